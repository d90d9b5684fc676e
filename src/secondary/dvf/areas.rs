//! What points are shared out by: areas of triangles, summed in whole numbers.

/// What is summed over all triangles of a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Areas {
    /// Steps in which areas are summed, a device unit of area.
    pub scale: f32,
    /// Twice the area of all, device units.
    pub total: f32,
}

impl Areas {
    /// Of so many triangles, none of which has twice an area of `most` device units or more, nothing yet; sums stay
    /// below 2^62 and areas below 2^40.
    pub fn of(triangles: u64, most: f64) -> Self {
        let bits = (most.log2().ceil() as i32).clamp(-80, 80);
        let count = 64 - triangles.max(1).leading_zeros() as i32;
        Self { scale: f64::from((62 - count).min(40) - bits).exp2() as f32, total: 0.0 }
    }

    /// With the sum of all.
    pub fn with_sum(self, sum: u64) -> Self {
        Self { total: (sum as f64 / f64::from(self.scale)) as f32, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_areas_have_room() {
        for (triangles, most) in [(1, 1.0), (3_000_000, 1e6), (4_000_000_000, 4e6), (12, 1e-12)] {
            let areas = Areas::of(triangles, most);
            assert!(f64::from(areas.scale) * most * triangles as f64 <= 2f64.powi(62), "{triangles} {most}");
            assert!(f64::from(areas.scale) * most <= 2f64.powi(40));
        }
        assert_eq!(Areas { scale: 4.0, total: 0.0 }.with_sum(10).total, 2.5);
    }
}

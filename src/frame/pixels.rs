//! What a frame shows.

/// What a pixel shows: that of its worst ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum PixelState {
    /// What it shows with everything resident.
    #[default]
    Exact = 0,
    /// Something is missing, and a level of detail stands in for it, within the level's bound.
    Bounded = 1,
    /// Something is missing that nothing stands in for, or a texture is coarser than it should be.
    Unresolved = 2,
}

impl PixelState {
    /// Of a ray ([`crate::schedule::Report::states`]).
    pub fn of_ray(state: u32) -> Self {
        match state {
            0 => Self::Exact,
            1 => Self::Bounded,
            _ => Self::Unresolved,
        }
    }
}

/// What a frame shows, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixels {
    /// Linear Rec. 709 radiance, the mean of the samples.
    pub radiance: Vec<[f32; 3]>,
    /// Distance along the ray through the pixel's centre, world units; infinite on a miss. Empty without AOVs.
    pub depth: Vec<f32>,
    /// Geometric unit normal toward the camera, world space; zero on a miss. Empty without AOVs.
    pub normal: Vec<[f32; 3]>,
    /// Global triangle id, 4294967295 on a miss. Empty without AOVs.
    pub id: Vec<u32>,
    /// Linear base colour; zero on a miss. Empty without AOVs.
    pub albedo: Vec<[f32; 3]>,
    /// Whether what the pixel shows is exact. Empty where frames have no budget.
    pub state: Vec<PixelState>,
}

impl Pixels {
    /// How many pixels have a value that is no number: radiance, normals and colours are finite, depths at most
    /// infinite.
    pub fn not_finite(&self) -> u64 {
        let count = |values: &[[f32; 3]]| values.iter().filter(|v| !v.iter().all(|x| x.is_finite())).count();
        let depths = self.depth.iter().filter(|d| d.is_nan() || **d == f32::NEG_INFINITY).count();
        (count(&self.radiance) + count(&self.normal) + count(&self.albedo) + depths) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nan_anywhere_is_counted() {
        let sound = Pixels {
            radiance: vec![[1.0; 3]; 2],
            depth: vec![f32::INFINITY, 2.0],
            normal: vec![[0.0; 3]; 2],
            id: vec![1, 2],
            albedo: vec![[0.5; 3]; 2],
            state: Vec::new(),
        };
        assert_eq!(sound.not_finite(), 0);
        let spoil: [fn(&mut Pixels); 5] = [
            |p| p.radiance[1][2] = f32::NAN,
            |p| p.radiance[0][0] = f32::INFINITY,
            |p| p.depth[0] = f32::NAN,
            |p| p.normal[1][0] = f32::NAN,
            |p| p.albedo[0][1] = f32::NEG_INFINITY,
        ];
        for spoil in spoil {
            let mut pixels = sound.clone();
            spoil(&mut pixels);
            assert_eq!(pixels.not_finite(), 1);
        }
    }
}

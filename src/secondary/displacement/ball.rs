//! Small spheres around vertices.

use glam::DVec3;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its middle.
    pub center: DVec3,
    /// Its radius.
    pub radius: f64,
}

/// Steps toward the farthest point.
const STEPS: u32 = 2000;
/// Of the radius: room for rounding, so that what touches the sphere is within it.
const ROOM: f64 = 1e-6;

/// The directions in which the outermost vertices are kept: those to the faces, edges and corners of a cube.
fn axes() -> impl Iterator<Item = DVec3> {
    (0..27).filter(|&i| i != 13).map(|i| DVec3::from_array([i % 3, i / 3 % 3, i / 9].map(|x| f64::from(x - 1))))
}

/// Those of many points that a small sphere around all is found by (Larsson 2008, "Fast and tight fitting bounding
/// spheres").
#[derive(Clone, Debug, Default)]
pub struct Outermost(Vec<(f64, DVec3)>);

impl Outermost {
    /// Takes a point.
    pub fn add(&mut self, point: DVec3) {
        if self.0.is_empty() {
            self.0 = vec![(f64::NEG_INFINITY, point); 26];
        }
        for (held, axis) in self.0.iter_mut().zip(axes()) {
            let along = axis.dot(point);
            if along > held.0 {
                *held = (along, point);
            }
        }
    }

    /// They.
    pub fn points(&self) -> impl Iterator<Item = DVec3> {
        self.0.iter().map(|held| held.1)
    }

    /// The middle of a small sphere around them (Bădoiu, Clarkson 2003); `None`: there are none.
    pub fn center(&self) -> Option<DVec3> {
        let mut center = self.0.first()?.1;
        for step in 0..STEPS {
            let far = self
                .0
                .iter()
                .map(|held| held.1)
                .max_by(|a, b| center.distance_squared(*a).total_cmp(&center.distance_squared(*b)))?;
            center += (far - center) / f64::from(step + 2);
        }
        Some(center)
    }
}

impl Ball {
    /// Around `center` and as large as `farthest`, the distance of the point that is farthest from it; of one point a
    /// sphere with room.
    pub fn new(center: DVec3, farthest: f64) -> Self {
        Self { center, radius: (farthest * (1.0 + ROOM)).max(ROOM * center.abs().max_element()).max(f64::MIN_POSITIVE) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickwalk_scenes::Rng;

    /// The sphere around points.
    fn around(points: &[DVec3]) -> Ball {
        let mut outermost = Outermost::default();
        points.iter().for_each(|&point| outermost.add(point));
        let center = outermost.center().unwrap();
        Ball::new(center, points.iter().map(|p| p.distance(center)).fold(0.0, f64::max))
    }

    #[test]
    fn spheres_hold_all_and_are_small() {
        let mut rng = Rng::new(3, &[1]);
        for _ in 0..50 {
            let middle = DVec3::from_array([(); 3].map(|()| rng.range(-50.0, 50.0)));
            // On a sphere, some of them opposite each other: none is smaller.
            let radius = rng.range(0.1, 9.0);
            let mut points: Vec<DVec3> = Vec::new();
            for _ in 0..40 {
                let way = DVec3::from_array([(); 3].map(|()| rng.range(-1.0, 1.0))).normalize();
                points.extend([middle + radius * way, middle - radius * way]);
            }
            let ball = around(&points);
            assert!(points.iter().all(|p| p.distance(ball.center) <= ball.radius));
            assert!(ball.radius < 1.05 * radius, "{} {radius}", ball.radius);
        }
        let one = around(&[DVec3::new(7.0, 0.0, -2.0)]);
        assert!(one.radius > 0.0 && one.radius < 1e-5);
        assert!(around(&[DVec3::ZERO]).radius > 0.0);
        assert!(Outermost::default().center().is_none());
        // Control: half of the diagonal of the box around a sphere is larger.
        assert!(3f64.sqrt() > 1.05);
    }
}

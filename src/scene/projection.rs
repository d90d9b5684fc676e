//! Where points of the world lie in a camera's picture.

use super::Camera;
use super::camera::RayBasis;
use glam::DVec3;

/// A camera's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    position: DVec3,
    forward: DVec3,
    basis: RayBasis,
}

impl Projection {
    /// The picture of `width` x `height` pixels.
    pub fn new(camera: &Camera, (width, height): (u32, u32)) -> Self {
        Self { position: camera.position, forward: camera.frame().2, basis: camera.ray_basis(width, height) }
    }

    /// Where the camera stands.
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// Pixel coordinates of what is seen in a direction, of any length; `None` behind the camera. Pixel (i, j) has its
    /// centre at (i + 0.5, j + 0.5).
    pub fn pixel_of_direction(&self, direction: DVec3) -> Option<[f64; 2]> {
        let along = direction.dot(self.forward);
        if along <= 0.0 || !along.is_finite() {
            return None;
        }
        let RayBasis { b, dx, dy } = self.basis;
        let across = direction / along - b;
        let pixel = [across.dot(dx) / dx.length_squared(), across.dot(dy) / dy.length_squared()];
        pixel.iter().all(|x| x.is_finite()).then_some(pixel)
    }

    /// Pixel coordinates of a point of the world.
    pub fn pixel_of_point(&self, point: DVec3) -> Option<[f64; 2]> {
        self.pixel_of_direction(point - self.position)
    }

    /// Width in world units of a pixel at the distance of `point`, seen head-on.
    pub fn footprint(&self, point: DVec3) -> f64 {
        (point - self.position).dot(self.forward).abs() * self.basis.dx.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_return_to_their_pixels() {
        let camera = Camera {
            position: DVec3::new(1e4, 2.0, -3.0),
            target: DVec3::new(1e4 + 3.0, 1.0, 5.0),
            up: DVec3::Y,
            fov_y: 1.1,
        };
        let projection = Projection::new(&camera, (64, 36));
        let basis = camera.ray_basis(64, 36);
        for [x, y] in [[0.5, 0.5], [63.5, 0.5], [10.25, 35.75]] {
            let point = camera.position + 7.0 * basis.direction(x, y);
            let found = projection.pixel_of_point(point).expect("in front");
            assert!((found[0] - x).abs() < 1e-8 && (found[1] - y).abs() < 1e-8, "{found:?}");
            assert_eq!(projection.pixel_of_point(camera.position - 7.0 * basis.direction(x, y)), None);
        }
    }
}

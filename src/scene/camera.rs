//! A pinhole camera in f64 world space and the rays of its pixels.

use glam::DVec3;
use thiserror::Error;

/// Least vertical field of view, degrees.
pub const MIN_FOV_Y_DEGREES: f64 = 1e-6;
/// Greatest vertical field of view, degrees.
pub const MAX_FOV_Y_DEGREES: f64 = 179.99;

/// Sine of the angle between the view and the up vector below which the up vector says nothing about the roll: the
/// cross product's rounding, about 1e-16, must stay small beside it.
const PARALLEL: f64 = 1e-7;

/// A camera: right-handed, world units, f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where the rays start, world units.
    pub position: DVec3,
    /// A point on the axis of view, world units.
    pub target: DVec3,
    /// Direction that appears upward in the picture, any non-zero length.
    pub up: DVec3,
    /// Vertical field of view, radians.
    pub fov_y: f64,
}

/// Rays of a camera's pixels: [`Self::direction`] is affine in the pixel coordinates, so a kernel needs three vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBasis {
    /// Direction through the image's upper left corner, pixel coordinates (0, 0).
    pub b: DVec3,
    /// Change of direction for one pixel to the right.
    pub dx: DVec3,
    /// Change of direction for one pixel down.
    pub dy: DVec3,
}

impl RayBasis {
    /// Direction through pixel coordinates `(x, y)`, y down, not normalised: its component along the axis of view is 1.
    /// Pixel (i, j) has its centre at (i + 0.5, j + 0.5).
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        self.b + x * self.dx + y * self.dy
    }
}

/// Why a camera has no rays.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// A coordinate is NaN or infinite.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// The axis of view has no direction.
    #[error("position and target are the same point; move one of them")]
    NoDirection,
    /// The up vector is zero.
    #[error("up is a zero vector; use [0, 1, 0]")]
    NoUp,
    /// The field of view is out of range.
    #[error("the vertical field of view is {0} degrees; it must be from {MIN_FOV_Y_DEGREES} to {MAX_FOV_Y_DEGREES}")]
    FieldOfView(f64),
}

/// `v` at unit length without overflow or underflow on the way; `None` when it is zero or not finite.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest == 0.0 || !v.is_finite() {
        return None;
    }
    // Scaling by a power of two is exact; a subnormal's reciprocal would overflow, so scale in two halves.
    let exponent = largest.log2().floor() as i32;
    let half = exponent / 2;
    Some((v * 2f64.powi(-half) * 2f64.powi(half - exponent)).normalize())
}

/// Checks a vertical field of view in degrees: finite, from [`MIN_FOV_Y_DEGREES`] to [`MAX_FOV_Y_DEGREES`].
pub fn check_fov_y_degrees(degrees: f64) -> Result<(), CameraError> {
    if (MIN_FOV_Y_DEGREES..=MAX_FOV_Y_DEGREES).contains(&degrees) {
        Ok(())
    } else {
        Err(CameraError::FieldOfView(degrees))
    }
}

impl Camera {
    /// Checks everything that [`Self::frame`] and [`Self::ray_basis`] rely on.
    ///
    /// # Errors
    /// A non-finite coordinate, position equal to target, a zero up vector, a field of view out of range.
    pub fn check(&self) -> Result<(), CameraError> {
        for (name, v) in [("position", self.position), ("target", self.target), ("up", self.up)] {
            if !v.is_finite() {
                return Err(CameraError::NotFinite(name));
            }
        }
        if self.position == self.target {
            return Err(CameraError::NoDirection);
        }
        if self.up == DVec3::ZERO {
            return Err(CameraError::NoUp);
        }
        // Degrees that came through radians may have moved by an ulp.
        let degrees = self.fov_y.to_degrees();
        let slack = 1.0 + 4.0 * f64::EPSILON;
        if !(MIN_FOV_Y_DEGREES / slack..=MAX_FOV_Y_DEGREES * slack).contains(&degrees) {
            return Err(CameraError::FieldOfView(degrees));
        }
        Ok(())
    }

    /// The camera's axes (right, up, forward), orthonormal: right × up = −forward.
    ///
    /// An up vector parallel to the view is replaced by the coordinate axis least aligned with the view (z, then x,
    /// then y where equal); a camera whose position and target coincide looks along −z.
    pub fn frame(&self) -> (DVec3, DVec3, DVec3) {
        let view = self.target - self.position;
        // The halved difference of two finite points is finite.
        let view = if view.is_finite() { view } else { self.target * 0.5 - self.position * 0.5 };
        let forward = unit(view).unwrap_or(DVec3::NEG_Z);
        let right = unit(self.up)
            .map(|up| forward.cross(up))
            .filter(|right| right.length() >= PARALLEL)
            .unwrap_or_else(|| forward.cross(least_aligned_axis(forward)))
            .normalize();
        // A first cross product with nearly parallel factors is orthogonal only up to rounding over its length.
        let right = (right - forward * right.dot(forward)).normalize();
        (right, right.cross(forward), forward)
    }

    /// The rays of an image of `width` x `height` square pixels.
    pub fn ray_basis(&self, width: u32, height: u32) -> RayBasis {
        let (right, up, forward) = self.frame();
        let pixel = 2.0 * (0.5 * self.fov_y).tan() / f64::from(height);
        let dx = right * pixel;
        let dy = -up * pixel;
        let b = forward - dx * (0.5 * f64::from(width)) - dy * (0.5 * f64::from(height));
        RayBasis { b, dx, dy }
    }
}

/// The coordinate axis at the greatest angle to `v`: z, then x, then y where equal.
fn least_aligned_axis(v: DVec3) -> DVec3 {
    let a = v.abs();
    if a.z <= a.x && a.z <= a.y {
        // The upper edge of a picture taken straight down shows what lies towards −z, as on a map with x to the right.
        DVec3::NEG_Z
    } else if a.x <= a.y {
        DVec3::X
    } else {
        DVec3::Y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera(position: [f64; 3], target: [f64; 3], up: [f64; 3]) -> Camera {
        Camera { position: position.into(), target: target.into(), up: up.into(), fov_y: 60f64.to_radians() }
    }

    /// Largest deviation of the camera's axes from a right-handed orthonormal frame.
    fn frame_error(c: &Camera) -> f64 {
        let (r, u, f) = c.frame();
        [
            r.length() - 1.0,
            u.length() - 1.0,
            f.length() - 1.0,
            r.dot(u),
            r.dot(f),
            u.dot(f),
            (r.cross(u) + f).length(), // right-handed
        ]
        .into_iter()
        .fold(0.0, |worst: f64, e| if e.is_nan() { f64::INFINITY } else { worst.max(e.abs()) })
    }

    #[test]
    fn looks_where_it_should() {
        let c = camera([0.0, 0.0, 5.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!(c.frame(), (DVec3::X, DVec3::Y, DVec3::NEG_Z));
        let rays = c.ray_basis(4, 2);
        let centre = rays.direction(2.0, 1.0);
        assert!((centre - DVec3::NEG_Z).length() < 1e-15, "{centre}");
        // Right of the centre is +x, above it +y, and half the field of view is at the upper edge.
        assert!(rays.direction(3.5, 1.0).x > 0.0);
        assert!(rays.direction(2.0, 0.5).y > 0.0);
        let edge = rays.direction(2.0, 0.0);
        assert!((edge.y / -edge.z - 30f64.to_radians().tan()).abs() < 1e-15);
        // Square pixels.
        assert!((rays.dx.length() - rays.dy.length()).abs() < 1e-16);
    }

    #[test]
    fn orthonormal_at_extremes() {
        let cases = [
            camera([0.0; 3], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]),  // straight down
            camera([0.0; 3], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]),   // straight up
            camera([0.0; 3], [1e-9, -1.0, 0.0], [0.0, 1.0, 0.0]), // almost straight down
            camera([0.0; 3], [2e-7, -1.0, 0.0], [0.0, 1.0, 0.0]), // just not parallel
            camera([0.0; 3], [1e-300, 2e-300, 3e-300], [0.0, 1.0, 0.0]), // tiny
            camera([5e-324, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]), // the least there is
            camera([-1.7e308, 0.0, 1.0], [1.7e308, 3.0, 0.0], [0.0, 1.0, 0.0]), // difference overflows
            camera([1e8, 2.0, -1e8], [1e8 + 1e-3, 2.0, -1e8], [0.0, 1.0, 0.0]), // far from the origin
            camera([0.0; 3], [1.0, 2.0, 3.0], [1e-200, 2e-200, 3e-200]), // parallel, tiny up
            camera([0.0; 3], [1.0, 2.0, 3.0], [1e300, -1e300, 1e300]),
            camera([1.0; 3], [1.0; 3], [0.0, 1.0, 0.0]), // no direction: −z
            camera([0.0; 3], [0.0, 0.0, 1.0], [0.0; 3]), // no up
        ];
        for c in cases {
            assert!(frame_error(&c) < 1e-14, "{c:?}: {:?}", c.frame());
        }
        // The measure itself sees a bad frame: without re-orthogonalising, a nearly parallel up is far worse.
        let c = camera([0.1, 0.2, 0.3], [1.3, -0.7, 0.9], [1.2 + 3e-7, -0.9, 0.6]);
        let (_, _, f) = c.frame();
        let raw = f.cross(unit(c.up).unwrap()).normalize();
        assert!(raw.dot(f).abs() > 1e-12, "negative control: {}", raw.dot(f));
        assert!(frame_error(&c) < 1e-14);
    }

    #[test]
    fn extreme_fields_of_view() {
        for degrees in [MIN_FOV_Y_DEGREES, MAX_FOV_Y_DEGREES] {
            let mut c = camera([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]);
            c.fov_y = degrees.to_radians();
            c.check().unwrap();
            let rays = c.ray_basis(640, 360);
            let top = rays.direction(320.0, 0.0);
            let got = (top.y / -top.z).atan().to_degrees() * 2.0;
            assert!((got / degrees - 1.0).abs() < 1e-12, "{got} for {degrees}");
        }
    }

    #[test]
    fn check_refuses() {
        let good = camera([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]);
        assert_eq!(good.check(), Ok(()));
        let nan = Camera { position: DVec3::new(f64::NAN, 0.0, 0.0), ..good };
        assert_eq!(nan.check(), Err(CameraError::NotFinite("position")));
        assert_eq!(Camera { target: DVec3::INFINITY, ..good }.check(), Err(CameraError::NotFinite("target")));
        assert_eq!(Camera { target: DVec3::ZERO, ..good }.check(), Err(CameraError::NoDirection));
        assert_eq!(Camera { up: DVec3::ZERO, ..good }.check(), Err(CameraError::NoUp));
        for fov_y in [0.0, -1.0, 3.15, f64::NAN, f64::INFINITY] {
            assert!(matches!(Camera { fov_y, ..good }.check(), Err(CameraError::FieldOfView(_))), "{fov_y}");
        }
    }

    proptest! {
        #[test]
        fn any_camera_is_orthonormal(
            p in prop::array::uniform3(-1e9f64..1e9), t in prop::array::uniform3(-1e9f64..1e9),
            u in prop::array::uniform3(-1f64..1.0), scale in -12i32..12,
        ) {
            let s = 10f64.powi(scale);
            let c = camera(p.map(|x| x * s), t.map(|x| x * s), u);
            prop_assert!(frame_error(&c) < 1e-14, "{:?}", c.frame());
        }

        #[test]
        fn the_axis_passes_through_the_centre(
            p in prop::array::uniform3(-1e3f64..1e3), t in prop::array::uniform3(-1e3f64..1e3),
            width in 1u32..5000, height in 1u32..5000,
        ) {
            let c = camera(p, t, [0.0, 1.0, 0.0]);
            let rays = c.ray_basis(width, height);
            let d = rays.direction(0.5 * f64::from(width), 0.5 * f64::from(height));
            let (_, _, forward) = c.frame();
            // Half an image of at most 5000:1 adds and subtracts components of up to 2900: 2900 x 2^-52 x a few.
            prop_assert!((d - forward).length() < 4e-12, "{}", (d - forward).length());
        }
    }
}

//! Camera paths that show a scene of which only boxes are known, or a room of which a free line of sight is known.

use super::path::CameraPath;
use glam::DVec3;

/// Share of the picture's width or height that the boxes take, whichever is larger.
const FILL: f64 = 0.9;
/// Vertical field of view of a path around something, and in a room, degrees.
const OUTSIDE_FOV: f64 = 40.0;
const INSIDE_FOV: f64 = 60.0;
/// How far above the horizon the camera is, of what is high and of what is flat, degrees.
const RISE: [f64; 2] = [12.0, 24.0];
/// Where a path begins and what part of a circle it goes, degrees about +Y from +X to +Z.
const START: f64 = 60.0;
const SPAN: f64 = 90.0;
/// Keyframes of it.
const KEYS: u32 = 9;
/// Corners that are nearest to the edges of a picture are found in so many steps; mostly the second changes nothing.
const STEPS: u32 = 16;

/// A picture, as far as framing goes.
#[derive(Clone, Copy, Debug)]
pub struct Picture {
    /// Width by height.
    pub aspect: f64,
    /// Vertical field of view in degrees; `None`: what suits.
    pub fov_y_degrees: Option<f64>,
}

/// The usual picture.
impl Default for Picture {
    fn default() -> Self {
        Self { aspect: 16.0 / 9.0, fov_y_degrees: None }
    }
}

/// [`around`] the box from `min` to `max`, in the usual picture.
pub fn path_from_bounds(min: [f64; 3], max: [f64; 3]) -> CameraPath {
    around(&[[min.into(), max.into()]], Picture::default())
}

/// A quarter turn around boxes, 10 s long, from a little above. In every keyframe the boxes take nine tenths of the
/// width or of the height of the picture, and stand in its middle.
///
/// Boxes that are empty (`min > max`) or not finite do not count. Where none counts, or all are one point, a unit cube
/// around that or around the origin stands for them.
pub fn around(boxes: &[[DVec3; 2]], picture: Picture) -> CameraPath {
    let is_box = |[min, max]: &&[DVec3; 2]| {
        min.is_finite() && max.is_finite() && min.cmple(*max).all() && (*max - *min).is_finite()
    };
    let mut boxes: Vec<[DVec3; 2]> = boxes.iter().filter(is_box).copied().collect();
    let whole = |boxes: &[[DVec3; 2]]| boxes.iter().copied().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let [mut min, mut max] = whole(&boxes).unwrap_or([DVec3::ZERO; 2]);
    let centre = min + (max - min) * 0.5;
    // A size that moves the camera by more than the rounding of its coordinates.
    let least = (centre.abs().max_element() * 1e-10).max(f64::MIN_POSITIVE * 1e6);
    if (max - min).max_element() < least {
        let half = DVec3::splat(0.5 * least.max(1.0));
        (min, max) = (centre - half, centre + half);
        boxes = vec![[min, max]];
    }
    let size = max - min;
    let flatness = (1.0 - size.y / size.x.max(size.z)).clamp(0.0, 1.0);
    let rise = (RISE[0] + (RISE[1] - RISE[0]) * flatness).to_radians();
    let fov = picture.fov_y_degrees.unwrap_or(OUTSIDE_FOV);
    let view = |k: u32| {
        let angle = (START + SPAN * f64::from(k) / f64::from(KEYS - 1)).to_radians();
        let away = DVec3::new(angle.cos() * rise.cos(), rise.sin(), angle.sin() * rise.cos());
        let position = centre + fitted(&boxes, centre, -away, fov, picture.aspect);
        // As far ahead as the middle is, and at least a step that rounding leaves.
        let ahead = (centre - position).dot(-away).max(least);
        [position, position - away * ahead]
    };
    let views: Vec<[DVec3; 2]> = (0..KEYS).map(view).collect();
    CameraPath::of_views(fov, views.into_iter())
}

/// Where a camera that looks along the unit vector `forward` must stand, relative to `centre`, for `boxes` to fill the
/// picture: as near as all corners are within [`FILL`] of it, in the middle of what they leave free.
fn fitted(boxes: &[[DVec3; 2]], centre: DVec3, forward: DVec3, fov_y_degrees: f64, aspect: f64) -> DVec3 {
    let right = forward.cross(DVec3::Y).normalize_or(DVec3::X);
    let up = right.cross(forward);
    let slope_y = FILL * (0.5 * fov_y_degrees.to_radians()).tan();
    let slopes = [slope_y * aspect, slope_y];
    // Corners, along the axes of the picture and into it.
    let corner = |[min, max]: &[DVec3; 2], k: usize| {
        let corner = DVec3::new([min, max][k & 1].x, [min, max][k >> 1 & 1].y, [min, max][k >> 2].z) - centre;
        [corner.dot(right), corner.dot(up), corner.dot(forward)]
    };
    let corners: Vec<[f64; 3]> = boxes.iter().flat_map(|own| (0..8).map(move |k| corner(own, k))).collect();
    // Of each axis of the picture and each of its two sides: the corner that comes nearest to the edge. A corner at
    // (x, depth) is within the edge of a camera at (X, Z) if ±(x - X) is at most slope * (depth - Z).
    let mut most = [[f64::NEG_INFINITY; 2]; 2];
    for corner in &corners {
        for (axis, most) in most.iter_mut().enumerate() {
            most[0] = most[0].max(corner[axis] - slopes[axis] * corner[2]);
            most[1] = most[1].max(-corner[axis] - slopes[axis] * corner[2]);
        }
    }
    let depth = |axis: usize| -0.5 * (most[axis][0] + most[axis][1]) / slopes[axis];
    let away = depth(0).min(depth(1));
    let middle = |axis: usize| middle(&corners, axis, away, 0.5 * (most[axis][0] - most[axis][1]));
    forward * away + right * middle(0) + up * middle(1)
}

/// Where along an axis a camera stands, `depth` into the picture, that sees the corners as far on one side of its
/// middle as on the other; `start` is near that.
fn middle(corners: &[[f64; 3]], axis: usize, depth: f64, start: f64) -> f64 {
    let mut at = start;
    for _ in 0..STEPS {
        // The corners that are seen farthest on either side, and where these two are seen equally far.
        let seen = |corner: &&[f64; 3]| (corner[axis] - at) / (corner[2] - depth);
        let least = corners.iter().min_by(|a, b| seen(a).total_cmp(&seen(b)));
        let most = corners.iter().max_by(|a, b| seen(a).total_cmp(&seen(b)));
        let (Some(least), Some(most)) = (least, most) else { return at };
        let [near, far] = [least[2] - depth, most[2] - depth];
        let next = (least[axis] * far + most[axis] * near) / (near + far);
        if next == at || !next.is_finite() {
            return at;
        }
        at = next;
    }
    at
}

/// A walk of 10 s along the unit vector `forward` in a room, from `start`, of which `free` lies free ahead; it ends
/// before it has gone half of it.
pub fn along(start: DVec3, forward: DVec3, free: f64, picture: Picture) -> CameraPath {
    let views = [0.0, 0.2, 0.4].map(|share| {
        let position = start + forward * (share * free);
        [position, position + (forward + DVec3::Y * 0.05) * (0.5 * free)]
    });
    CameraPath::of_views(picture.fov_y_degrees.unwrap_or(INSIDE_FOV), views.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Every camera of a path must be one, whatever the bounds.
    #[test]
    fn paths_are_valid_for_any_bounds() {
        let boxes = [
            ([0.0; 3], [0.0; 3]),
            ([1e9, -1e9, 5.0], [1e9, -1e9, 5.0]),
            ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]),
            ([f64::MAX; 3], [f64::MIN; 3]),
            ([f64::MIN; 3], [f64::MAX; 3]),
            ([f64::NAN; 3], [1.0; 3]),
            ([0.0; 3], [1.0, 0.0, 1.0]),
            ([0.0; 3], [1.0, 0.0, 0.0]),
            ([0.0; 3], [0.0, 1.0, 0.0]),
            ([1e7; 3], [1e7 + 1e-3, 1e7 + 1e-3, 1e7 + 1e-3]),
            ([-1e-12; 3], [1e-12; 3]),
            ([-1e9; 3], [1e9; 3]),
            ([0.0; 3], [10.0, 200.0, 12.0]),
        ];
        for (min, max) in boxes {
            let p = path_from_bounds(min, max);
            let path = CameraPath::new(p.fov_y_degrees(), [0.0, 1.0, 0.0], p.keyframes().to_vec(), Path::new("bounds"));
            assert_eq!(path.unwrap(), p);
            for k in 0..8 {
                p.frame(k, 8).check().unwrap_or_else(|e| panic!("{min:?} {max:?}: {e}"));
            }
        }
    }

    /// The shares of width and height that corners take in a picture, and how far their middle is from its own.
    fn seen(camera: &crate::scene::Camera, boxes: &[[DVec3; 2]], aspect: f64) -> [[f64; 2]; 2] {
        let (right, up, forward) = camera.frame();
        let slope = (0.5 * camera.fov_y).tan();
        let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for [min, max] in boxes {
            for k in 0..8 {
                let at = DVec3::new([min, max][k & 1].x, [min, max][k >> 1 & 1].y, [min, max][k >> 2].z);
                let at = at - camera.position;
                let depth = at.dot(forward);
                assert!(depth > 0.0, "behind the camera");
                let places = [at.dot(right) / (depth * slope * aspect), at.dot(up) / (depth * slope)];
                for (range, x) in range.iter_mut().zip(places) {
                    *range = [range[0].min(x), range[1].max(x)];
                }
            }
        }
        range.map(|[from, to]| [0.5 * (to - from), 0.5 * (from + to)])
    }

    #[test]
    fn boxes_fill_the_picture_and_stand_in_its_middle() {
        let of = |min: [f64; 3], max: [f64; 3]| [DVec3::from(min), DVec3::from(max)];
        let scenes = [
            vec![of([-1.0; 3], [1.0; 3])],
            vec![of([5.0, 0.0, -3.0], [6.0, 40.0, -2.0])],
            vec![of([0.0; 3], [1000.0, 60.0, 1000.0])],
            vec![of([0.0; 3], [3.0, 0.0, 4.0])],
            vec![of([1e6, 0.0, 1e6], [1e6 + 2.0, 1.0, 1e6 + 1.0])],
            vec![of([0.0; 3], [1.0; 3]), of([9.0, 0.0, 2.0], [10.0, 0.5, 3.0])],
        ];
        for boxes in scenes {
            for (aspect, fov) in [(16.0 / 9.0, None), (1.0, Some(90.0)), (0.5, Some(20.0))] {
                let path = around(&boxes, Picture { aspect, fov_y_degrees: fov });
                assert_eq!(path.fov_y_degrees(), fov.unwrap_or(OUTSIDE_FOV));
                for k in 0..17 {
                    let camera = path.frame(k, 17);
                    let [width, height] = seen(&camera, &boxes, aspect);
                    let most = width[0].max(height[0]);
                    // Between keyframes the spline is near the arc.
                    let slack = if k % 2 == 0 { 1e-6 } else { 0.04 };
                    assert!((most - FILL).abs() < slack, "{boxes:?}, {aspect}: {most} in frame {k}");
                    assert!(width[0].max(height[0]) <= FILL + slack);
                    for axis in [width, height] {
                        assert!(axis[1].abs() < 1e-6 + slack, "{boxes:?}: {width:?} {height:?}");
                    }
                    assert!(camera.frame().2.y < -0.1, "from above");
                }
            }
        }
    }

    #[test]
    fn walks_stay_in_the_free_part_and_look_along_it() {
        let path = along(DVec3::new(1.0, 2.0, 3.0), DVec3::X, 10.0, Picture::default());
        for k in 0..9 {
            let camera = path.frame(k, 9);
            assert!((1.0..=5.0).contains(&camera.position.x) && camera.position.y == 2.0, "{camera:?}");
            assert!(camera.frame().2.x > 0.99);
        }
    }
}

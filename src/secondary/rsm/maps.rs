//! Reflective shadow maps as kernels see them, and the rays that lamps send to make them.

use crate::kernels::frame::Frame;
use crate::kernels::layout::{RSM_PERSPECTIVE, Ray, RsmMap, T_INFINITE};
use glam::DVec3;

/// What a lamp sees through a grid of texels, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampView {
    /// The emitter's number; [`crate::kernels::layout::NONE`]: the sun.
    pub lamp: u32,
    /// Whether rays start in one point; else they have one direction.
    pub is_perspective: bool,
    /// Where rays start: all, or that of texel coordinate (0, 0).
    pub corner: DVec3,
    /// Unit vector in which depth is measured.
    pub axis: DVec3,
    /// Of perspective views: direction of texel coordinate (0, 0), of depth 1.
    pub base: DVec3,
    /// Change of direction, or of start, from texel to texel of a row; orthogonal to the axis.
    pub x: DVec3,
    /// From row to row; orthogonal to both.
    pub y: DVec3,
    /// Texels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// All maps in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RsmMaps {
    /// Maps of one lamp follow each other, the finest first.
    pub maps: Vec<RsmMap>,
    /// Texels of all.
    pub texels: u32,
}

impl LampView {
    /// Number of texels.
    pub fn texels(&self) -> u32 {
        self.width * self.height
    }

    /// Whether a box may show in it. Conservative: each side of what it sees is asked alone.
    pub fn meets(&self, min: DVec3, max: DVec3) -> bool {
        let [low, high] = [min - self.corner, max - self.corner];
        // Least and greatest of n · (p - corner) over the box.
        let span = |n: DVec3| {
            let (a, b) = (n * low, n * high);
            [a.min(b).element_sum(), a.max(b).element_sum()]
        };
        let sides = [(self.x, self.width), (self.y, self.height)];
        let within = |(step, count): (DVec3, u32)| {
            if !self.is_perspective {
                let [from, to] = span(step / step.length_squared());
                return to >= 0.0 && from <= f64::from(count);
            }
            // Of p = corner + depth (base + u x + v y), u depth = x (p - corner) - depth (x base), from 0 to count.
            let across = (step - self.axis * step.dot(self.base)) / step.length_squared();
            span(across)[1] >= 0.0 && span(across - self.axis * f64::from(count))[0] <= 0.0
        };
        span(self.axis)[1] >= 0.0 && sides.into_iter().all(within)
    }

    /// The ray through the middle of a texel in `frame`; its t is depth.
    pub fn ray(&self, frame: &Frame, column: u32, row: u32) -> Ray {
        let across = self.x * (f64::from(column) + 0.5) + self.y * (f64::from(row) + 0.5);
        let (origin, direction) = match self.is_perspective {
            true => (self.corner, self.base + across),
            false => (self.corner + across, self.axis),
        };
        let direction = direction.as_vec3().to_array();
        Ray { origin: frame.point(origin), t_min: 0.0, direction, t_max: T_INFINITE }
    }

    /// The map in `frame`, whose first texel is `first`.
    pub fn placed(&self, frame: &Frame, first: u32) -> RsmMap {
        let (x, y) = (self.x / self.x.length_squared(), self.y / self.y.length_squared());
        // p = corner + depth (base + u x + v y), or corner + depth axis + u x + v y; orthogonality leaves
        // u depth = x (p - corner) - depth (x base), or u = x (p - corner).
        let of = |x: DVec3| if self.is_perspective { (x - self.axis * x.dot(self.base)) / frame.unit } else { x };
        let row = |a: DVec3| {
            let linear = (a * frame.unit).as_vec3();
            linear.extend(a.dot(frame.origin - self.corner) as f32).to_array()
        };
        RsmMap {
            texel_from_point: [row(of(x)), row(of(y)), row(self.axis / frame.unit)],
            first,
            width: self.width,
            height: self.height,
            lamp: self.lamp,
            flags: if self.is_perspective { RSM_PERSPECTIVE } else { 0 },
            ..RsmMap::default()
        }
    }
}

impl RsmMaps {
    /// Those of `views` in `frame`, their texels one map after the other.
    pub fn new(views: &[LampView], frame: &Frame) -> Self {
        let mut texels = 0;
        let mut place = |view: &LampView| {
            let map = view.placed(frame, texels);
            texels += view.texels();
            map
        };
        Self { maps: views.iter().map(&mut place).collect(), texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::layout::NONE;

    #[test]
    fn maps_lead_back_to_the_texels_that_rays_come_from() {
        let frame = Frame { reference: [0; 3], unit: 0.25, origin: DVec3::new(5.0, -3.0, 2.0) };
        let (axis, x, y) = (DVec3::Z, DVec3::X, DVec3::Y);
        let turn = |v: DVec3| glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.4) * v;
        for is_perspective in [false, true] {
            let view = LampView {
                lamp: NONE,
                is_perspective,
                corner: DVec3::new(3.0, 4.0, -2.0),
                axis: turn(axis),
                base: turn(axis - x - 0.5 * y),
                x: turn(x) / 16.0,
                y: turn(y) / 12.0,
                width: 32,
                height: 12,
            };
            let map = RsmMaps::new(&[view, view], &frame).maps[1];
            assert_eq!(map.first, 32 * 12);
            for (column, row) in [(0, 0), (31, 11), (7, 3)] {
                let ray = view.ray(&frame, column, row);
                for t in [0.5f32, 40.0] {
                    let p = [0, 1, 2].map(|k| ray.origin[k] + t * ray.direction[k]);
                    let at = |k: usize| {
                        let r = map.texel_from_point[k];
                        r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]
                    };
                    let over = if is_perspective { at(2) } else { 1.0 };
                    let found = [at(0) / over, at(1) / over, at(2)];
                    let expected = [column as f32 + 0.5, row as f32 + 0.5, t];
                    assert!(
                        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3),
                        "{found:?}, not {expected:?}"
                    );
                }
            }
        }
    }
}

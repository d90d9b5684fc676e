//! The front of a tile as boxes, painted over a picture.

use super::steps::Sights;
use crate::scene::top_walk::TopWalk;
use crate::scene::{Camera, Projection};
use bricks::Resident;
use glam::DVec3;

/// Colours of boxes that rays of the tile enter, and of those that none does.
const COLORS: [[u8; 3]; 2] = [[90, 230, 120], [235, 80, 70]];
/// Weight of an edge, and of one behind what is seen.
const WEIGHTS: [f32; 2] = [0.9, 0.2];
/// Share of the distance to the middle of the box nearer than which edges are not painted: they would fill the picture.
const NEAR: f64 = 1e-3;

/// The front of a tile.
#[derive(Clone, Debug, Default)]
pub struct Boxes {
    /// Corners of boxes that a ray of the tile enters before its hit, world units.
    pub visible: Vec<[DVec3; 2]>,
    /// Of those that none enters.
    pub invisible: Vec<[DVec3; 2]>,
    /// Left upper corner and edge of the tile in the picture, pixels; `None`: it is another picture's.
    pub tile: Option<([u32; 2], u32)>,
}

impl Boxes {
    /// Those of the tile in the middle.
    pub fn of_middle(resident: &Resident, sights: &Sights) -> Self {
        let top = TopWalk::new(resident);
        let front = sights.front(&top, sights.middle());
        let [visible, invisible] =
            [front.visible, front.invisible].map(|nodes| nodes.into_iter().map(|node| top.bounds(node)).collect());
        Self { visible, invisible, tile: Some(sights.square(sights.middle())) }
    }

    /// What its colours say.
    pub fn legend(&self) -> String {
        let (visible, invisible) = (self.visible.len(), self.invisible.len());
        format!("pairs of the tile in the middle: {visible} visible, green; {invisible} invisible, red")
    }

    /// Paints them over a picture of such a width and height.
    pub fn paint(&self, camera: &Camera, size: (u32, u32), depth: &[f32], picture: &mut [[u8; 3]]) {
        let mut canvas = Canvas { camera, projection: Projection::new(camera, size), size, depth, picture };
        for (boxes, color) in [(&self.invisible, COLORS[1]), (&self.visible, COLORS[0])] {
            boxes.iter().for_each(|bounds| canvas.bounds(bounds, color));
        }
        if let Some(([x, y], edge)) = self.tile {
            for k in 0..edge {
                for (x, y) in [(x + k, y), (x + k, y + edge - 1), (x, y + k), (x + edge - 1, y + k)] {
                    canvas.dot([f64::from(x), f64::from(y)], 0.0, [255; 3]);
                }
            }
        }
    }
}

struct Canvas<'a> {
    camera: &'a Camera,
    projection: Projection,
    size: (u32, u32),
    depth: &'a [f32],
    picture: &'a mut [[u8; 3]],
}

impl Canvas<'_> {
    /// A pixel of something at a distance.
    fn dot(&mut self, [x, y]: [f64; 2], distance: f64, color: [u8; 3]) {
        if !(0.0..f64::from(self.size.0)).contains(&x) || !(0.0..f64::from(self.size.1)).contains(&y) {
            return;
        }
        let index = y as usize * self.size.0 as usize + x as usize;
        let is_behind = self.depth.get(index).is_some_and(|&depth| distance > f64::from(depth));
        let weight = WEIGHTS[usize::from(is_behind)];
        let shown = &mut self.picture[index];
        *shown = std::array::from_fn(|k| (f32::from(shown[k]) * (1.0 - weight) + f32::from(color[k]) * weight) as u8);
    }

    fn bounds(&mut self, [min, max]: &[DVec3; 2], color: [u8; 3]) {
        let corner =
            |i: usize| DVec3::from_array(std::array::from_fn(|k| if i >> k & 1 == 0 { min[k] } else { max[k] }));
        let near = NEAR * (0.5 * (*min + *max) - self.camera.position).length();
        for (a, b) in (0..8usize).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))).filter(|(a, b)| a != b) {
            self.edge(corner(a), corner(b), near, color);
        }
    }

    /// A straight edge, as far as it is farther away along the view than `near`.
    fn edge(&mut self, a: DVec3, b: DVec3, near: f64, color: [u8; 3]) {
        let forward = self.camera.frame().2;
        let along = |point: DVec3| (point - self.camera.position).dot(forward);
        let [at_a, at_b] = [a, b].map(along);
        if at_a.max(at_b) <= near {
            return;
        }
        let cut = |from: DVec3, to: DVec3, at: f64, other: f64| {
            if at >= near { from } else { from + (to - from) * ((near - at) / (other - at)) }
        };
        let (a, b) = (cut(a, b, at_a, at_b), cut(b, a, at_b, at_a));
        let [Some(from), Some(to)] = [a, b].map(|point| self.projection.pixel_of_point(point)) else { return };
        let Some([first, last]) = self.inside(from, to) else { return };
        let across = [0, 1].map(|k| (to[k] - from[k]).abs()).into_iter().fold(0.0, f64::max) * (last - first);
        let steps = across.ceil().clamp(1.0, 4.0 * f64::from(self.size.0.max(self.size.1)));
        let inverse = [along(a), along(b)].map(f64::recip);
        for step in 0..=steps as u32 {
            let share = first + (last - first) * f64::from(step) / steps;
            // What is even in the picture is not along the edge.
            let [of_a, of_b] = [(1.0 - share) * inverse[0], share * inverse[1]];
            let point = (a * of_a + b * of_b) / (of_a + of_b);
            let pixel = [0, 1].map(|k| from[k] + (to[k] - from[k]) * share);
            self.dot(pixel, (point - self.camera.position).length(), color);
        }
    }

    /// The part of a line that is in the picture, as shares of its length.
    fn inside(&self, from: [f64; 2], to: [f64; 2]) -> Option<[f64; 2]> {
        let edges = [f64::from(self.size.0), f64::from(self.size.1)];
        let (mut first, mut last) = (0f64, 1f64);
        for k in 0..2 {
            let length = to[k] - from[k];
            if length == 0.0 {
                if !(0.0..edges[k]).contains(&from[k]) {
                    return None;
                }
                continue;
            }
            let (a, b) = (-from[k] / length, (edges[k] - from[k]) / length);
            (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
        }
        (first <= last).then_some([first, last])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (40, 40);

    fn painted(boxes: &Boxes, depth: f32) -> Vec<[u8; 3]> {
        let (position, target) = (DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
        let camera = Camera { position, target, up: DVec3::Y, fov_y: 60f64.to_radians() };
        let mut picture = vec![[0; 3]; 1600];
        boxes.paint(&camera, SIZE, &vec![depth; 1600], &mut picture);
        picture
    }

    fn count(picture: &[[u8; 3]], is: impl Fn(&[u8; 3]) -> bool) -> usize {
        picture.iter().filter(|pixel| is(pixel)).count()
    }

    #[test]
    fn edges_of_boxes_are_where_their_corners_are_seen() {
        let unit = [DVec3::splat(-1.0), DVec3::ONE];
        let boxes = Boxes { visible: vec![unit], ..Boxes::default() };
        let picture = painted(&boxes, f32::INFINITY);
        // The near face is 4 away: its half edge is 20 / tan(30 degrees) / 4 = 8.66 pixels, at the rows 11 and 28.
        let is_green = |pixel: &[u8; 3]| pixel[1] > 150 && pixel[0] < 120;
        let row = |y: usize| count(&picture[40 * y..40 * y + 40], is_green);
        assert!((17..=19).contains(&row(11)) && (17..=19).contains(&row(28)), "{} and {}", row(11), row(28));
        assert!(row(10) == 0 && row(29) == 0 && row(20) == 4, "{}", row(20));
        // Behind what is seen, edges are faint; invisible pairs are red.
        assert_eq!(count(&painted(&boxes, 1.0), is_green), 0);
        assert!(count(&painted(&boxes, 1.0), |pixel| pixel[1] > 20) > 60);
        let boxes = Boxes { invisible: vec![unit], ..Boxes::default() };
        assert!(count(&painted(&boxes, f32::INFINITY), |pixel| pixel[0] > 150 && pixel[1] < 100) > 60);
    }

    #[test]
    fn boxes_around_the_camera_and_beyond_are_cut() {
        for bounds in [
            [DVec3::splat(-100.0), DVec3::splat(100.0)],
            [DVec3::new(0.0, 0.0, 5.0), DVec3::new(0.0, 0.0, 5.0)],
            [DVec3::new(-1e300, -1.0, -1e300), DVec3::new(1e300, 1.0, 1e300)],
            [DVec3::splat(f64::NAN), DVec3::ONE],
        ] {
            painted(&Boxes { visible: vec![bounds], ..Boxes::default() }, 3.0);
        }
        let behind = [DVec3::new(-1.0, -1.0, 6.0), DVec3::new(1.0, 1.0, 8.0)];
        let picture = painted(&Boxes { visible: vec![behind], ..Boxes::default() }, f32::INFINITY);
        assert_eq!(count(&picture, |pixel| *pixel != [0; 3]), 0);
    }
}

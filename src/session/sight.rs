//! Single rays into a scene file on the host, before there is a device: what a person would see from a place.
//!
//! In f64, brick by brick along the ray. Good for hundreds of rays; triangles of few bricks are kept.

use crate::frame::triangles::triangles;
use crate::scene::placement::{affine, leaf_box};
use bricks::SceneFile;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

/// Bricks that are read at most.
const MOST_BRICKS: usize = 256;
/// Share of the triangles that is not ground.
const GROUND: f64 = 0.9;
/// What is smaller than this share of the whole stands on a ground.
const SMALL: f64 = 0.5;
/// What is higher than this share of its width is no ground.
const FLAT: f64 = 0.2;
/// Leaves that are looked through at most.
const MOST_LEAVES: usize = 1 << 16;

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The distance, world units; infinite if it meets nothing.
    pub distance: f64,
    /// It is the side from which the vertices run counter-clockwise: the outside of closed objects.
    pub is_front: bool,
}

/// A leaf of the top-level tree.
struct Place {
    min: DVec3,
    max: DVec3,
    brick: u32,
    object_from_world: DAffine3,
}

/// Casts rays into a scene.
pub struct Sight<'a> {
    file: &'a SceneFile,
    places: Vec<Place>,
    triangles: HashMap<u32, Vec<[DVec3; 3]>>,
}

impl<'a> Sight<'a> {
    /// Of a scene; `None`: it has too many bricks to look through them.
    pub fn new(file: &'a SceneFile) -> Option<Self> {
        let resident = file.resident();
        if resident.leaves.len() > MOST_LEAVES {
            return None;
        }
        let place = |leaf: &bricks::Leaf| {
            let [min, max] = leaf_box(resident, leaf);
            let world_from_object = affine(&resident.instances[leaf.instance as usize].world_from_object);
            Place { min, max, brick: leaf.brick, object_from_world: world_from_object.inverse() }
        };
        Some(Self { file, places: resident.leaves.iter().map(place).collect(), triangles: HashMap::new() })
    }

    /// The boxes of the bricks that show what the scene is about, world units: all, but for a wide ground of few
    /// triangles around it.
    pub fn worth_seeing(&self) -> Vec<[DVec3; 2]> {
        let count = |place: &Place| u64::from(self.file.resident().bricks[place.brick as usize].triangle_count);
        let mut places: Vec<&Place> = self.places.iter().collect();
        places.sort_by(|a, b| (a.max - a.min).length().total_cmp(&(b.max - b.min).length()));
        let enough = GROUND * places.iter().map(|place| count(place)).sum::<u64>() as f64;
        let mut seen = 0;
        let dense = places.iter().take_while(|place| {
            let is_needed = (seen as f64) < enough;
            seen += count(place);
            is_needed
        });
        let dense = dense.count();
        let boxes: Vec<[DVec3; 2]> = places.iter().map(|place| [place.min, place.max]).collect();
        let span = |boxes: &[[DVec3; 2]]| {
            let whole = boxes.iter().copied().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            whole.map_or(0.0, |[min, max]| (max - min).length())
        };
        let is_flat = |[min, max]: &[DVec3; 2]| {
            let size = *max - *min;
            size.y <= FLAT * size.x.max(size.z)
        };
        // Parts of one object are not left out of its picture, coarse ones neither.
        let stands_on_ground = span(&boxes[..dense]) < SMALL * span(&boxes) && boxes[dense..].iter().all(is_flat);
        if stands_on_ground { boxes[..dense].to_vec() } else { boxes }
    }

    /// What a ray with this unit direction meets first; `None`: a brick cannot be read, or it would be too many.
    pub fn cast(&mut self, origin: DVec3, direction: DVec3) -> Option<Seen> {
        let enters = |place: &Place| {
            let (a, b) = ((place.min - origin) / direction, (place.max - origin) / direction);
            // A coordinate that does not change is NaN where it lies on a side; then the others decide.
            let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            (near <= far).then_some(near)
        };
        let mut order: Vec<(f64, usize)> =
            self.places.iter().enumerate().filter_map(|(i, place)| Some((enters(place)?, i))).collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut seen = Seen { distance: f64::INFINITY, is_front: false };
        for (near, index) in order {
            if near > seen.distance {
                break;
            }
            let Place { brick, object_from_world, .. } = self.places[index];
            let (from, along) =
                (object_from_world.transform_point3(origin), object_from_world.transform_vector3(direction));
            let is_mirrored = object_from_world.matrix3.determinant() < 0.0;
            for triangle in self.triangles(brick)? {
                if let Some((t, is_front)) = meet(from, along, triangle)
                    && t < seen.distance
                {
                    seen = Seen { distance: t, is_front: is_front != is_mirrored };
                }
            }
        }
        Some(seen)
    }

    fn triangles(&mut self, brick: u32) -> Option<&[[DVec3; 3]]> {
        if !self.triangles.contains_key(&brick) {
            if self.triangles.len() >= MOST_BRICKS {
                return None;
            }
            self.triangles.insert(brick, triangles(self.file, brick).ok()?.corners);
        }
        self.triangles.get(&brick).map(Vec::as_slice)
    }
}

/// Where a ray meets a triangle, in lengths of its direction, and whether on the front (Möller, Trumbore, "Fast,
/// Minimum Storage Ray-Triangle Intersection", 1997).
fn meet(origin: DVec3, direction: DVec3, [a, b, c]: &[DVec3; 3]) -> Option<(f64, bool)> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    let s = origin - a;
    let (u, q) = (s.dot(p) / determinant, s.cross(ab));
    let (v, t) = (direction.dot(q) / determinant, ac.dot(q) / determinant);
    // Of a triangle that is seen edge-on nothing is a number.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, determinant > 0.0))
}

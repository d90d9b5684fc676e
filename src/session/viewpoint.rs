//! The camera path of a scene for which none was given: around it, or through a room where it is one.
//!
//! A scene is a room if it is as large as one and rays from places within its bounds meet surfaces nearly everywhere,
//! some above them, and meet them from the front: from within a closed object one sees its back. Then the camera looks
//! where the free way is longest and stands as far back on this way as it may.

use super::sight::Sight;
use crate::scene::CameraPath;
use crate::scene::framing::{Picture, along, around};
use bricks::{Manifest, SceneFile};
use glam::DVec3;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Places that are looked from, each way.
const SIDE: u32 = 5;
/// Directions around a place.
const AROUND: u32 = 24;
/// Share of these rays that must meet something, and of these hits that must be on the front.
const ENCLOSED: f64 = 0.6;
const FRONT: f64 = 0.8;
/// Share of the places that have a ceiling; a court has none, a street neither.
const ROOFED: f64 = 0.3;
/// A scene that is lower than this share of its width is seen from above.
const FLAT: f64 = 0.2;
/// Least width of a room, and its heights, world units: metres.
const LEAST_WIDTH: f64 = 2.0;
const HEIGHTS: RangeInclusive<f64> = 2.0..=60.0;
/// Height of the eye, as a share of the height that is free above the floor.
const EYE: f64 = 0.22;
/// What is kept free of the way behind the camera.
const BEHIND: f64 = 0.15;
/// Half the angle of the rays that must be as free as the way, radians.
const SPREAD: f64 = 0.07;

/// The path of the scene in `file` for such a picture.
pub fn path(file: &SceneFile, picture: Picture) -> CameraPath {
    let Manifest { min, max, .. } = file.resident().manifest;
    let Some(mut sight) = Sight::new(file) else { return around(&[[min.into(), max.into()]], picture) };
    let through = room(&mut sight, min.into(), max.into());
    through.map_or_else(
        || around(&sight.worth_seeing(), picture),
        |Way { start, direction, free }| along(start, direction, free, picture),
    )
}

/// A free way through a room.
#[derive(Clone, Copy, Debug)]
struct Way {
    start: DVec3,
    /// Unit, level.
    direction: DVec3,
    /// The distance to what is at its end.
    free: f64,
}

/// What rays from a place say of it.
struct Place {
    best: Option<Way>,
    rays: u32,
    hits: u32,
    fronts: u32,
    has_roof: bool,
}

impl Place {
    fn is_enclosed(&self) -> bool {
        f64::from(self.hits) >= ENCLOSED * f64::from(self.rays)
    }
}

/// The longest free way within the bounds, if they are those of a room.
fn room(sight: &mut Sight, min: DVec3, max: DVec3) -> Option<Way> {
    let size = max - min;
    // Scans do not promise which side is the outside, but few are as large as rooms.
    let is_sized = size.x.min(size.z) >= LEAST_WIDTH && HEIGHTS.contains(&size.y);
    if !(size.is_finite() && is_sized && size.y >= FLAT * size.x.max(size.z)) {
        return None;
    }
    let mut places = Vec::new();
    for index in 0..SIDE * SIDE {
        let share = |k: u32| f64::from(k + 1) / f64::from(SIDE + 1);
        let middle = min + size * DVec3::new(share(index % SIDE), 0.4, share(index / SIDE));
        let place = look_around(sight, middle, [min, max])?;
        // Within a pillar or a chest one sees backs all around.
        let is_within = place.is_enclosed() && 2 * place.fronts <= place.hits;
        places.extend((!is_within).then_some(place));
    }
    let sum = |of: fn(&Place) -> u32| f64::from(places.iter().map(of).sum::<u32>());
    let (rays, hits) = (sum(|place| place.rays), sum(|place| place.hits));
    let is_room = 4 * places.len() as u32 >= SIDE * SIDE
        && hits >= ENCLOSED * rays
        && sum(|place| place.fronts) >= FRONT * hits
        && sum(|place| place.has_roof.into()) >= ROOFED * places.len() as f64;
    let ways = places.iter().filter_map(|place| place.best);
    ways.reduce(|a, b| if b.free > a.free { b } else { a }).filter(|_| is_room)
}

/// Looks around from above the floor below `middle`; `None`: bricks cannot be read.
fn look_around(sight: &mut Sight, middle: DVec3, [min, max]: [DVec3; 2]) -> Option<Place> {
    let below = sight.cast(middle, DVec3::NEG_Y)?;
    let above = sight.cast(middle, DVec3::Y)?;
    let floor = middle.y - below.distance.min(middle.y - min.y);
    let ceiling = middle.y + above.distance.min(max.y - middle.y);
    let eye = middle.with_y(floor + EYE * (ceiling - floor));
    let mut around = Vec::new();
    for k in 0..AROUND {
        around.push(sight.cast(eye, level(f64::from(k) / f64::from(AROUND) * TAU))?);
    }
    let mut place = Place {
        best: None,
        rays: AROUND + 1,
        hits: 0,
        fronts: 0,
        has_roof: above.distance.is_finite() && above.is_front,
    };
    for seen in around.iter().chain([&below]).filter(|seen| seen.distance.is_finite()) {
        place.hits += 1;
        place.fronts += u32::from(seen.is_front);
    }
    let longest = (max - min).with_y(0.0).max_element();
    for (k, seen) in around.iter().enumerate().filter(|(_, seen)| seen.distance.is_finite()) {
        let angle = k as f64 / f64::from(AROUND) * TAU;
        let opposite = around[(k + AROUND as usize / 2) % AROUND as usize].distance;
        // Out of a room that is open one steps no further than it is long.
        let back = (1.0 - BEHIND) * opposite.min(longest);
        let start = eye - level(angle) * back;
        let mut free = seen.distance + back;
        if place.best.is_some_and(|best| free <= best.free) {
            continue;
        }
        for turn in [-SPREAD, SPREAD] {
            free = free.min(sight.cast(start, level(angle + turn))?.distance);
        }
        if place.best.is_none_or(|best| free > best.free) {
            place.best = Some(Way { start, direction: level(angle), free });
        }
    }
    Some(place)
}

/// A level direction.
fn level(angle: f64) -> DVec3 {
    DVec3::new(angle.cos(), 0.0, angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickwalk_convert::build::{BuildSettings, build};
    use brickwalk_convert::progress::Progress;
    use brickwalk_convert::source::Primitive;
    use brickwalk_scenes::one_mesh;

    /// Adds a box whose faces are seen from outside, or from within.
    fn add_box(mesh: &mut Primitive, min: [f64; 3], max: [f64; 3], is_inward: bool) {
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend((0..8).map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { min[axis] } else { max[axis] })));
        for face in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            let [a, b, c, d] = face.map(|corner: u32| first + corner);
            mesh.indices.extend(if is_inward { [a, c, b, a, d, c] } else { [a, b, c, a, c, d] });
        }
    }

    /// The path through boxes, each with its corners and whether it is seen from within.
    fn path_of(boxes: &[([f64; 3], [f64; 3], bool)]) -> CameraPath {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("boxes.bricks");
        let mut mesh = Primitive::default();
        boxes.iter().for_each(|&(min, max, is_inward)| add_box(&mut mesh, min, max, is_inward));
        build(one_mesh("boxes", mesh), &BuildSettings::default(), &file, &Progress::hidden()).expect("a scene");
        path(&SceneFile::open(&file).expect("the scene"), Picture::default())
    }

    fn is_within(path: &CameraPath, min: [f64; 3], max: [f64; 3]) -> bool {
        (0..9).all(|k| {
            let at = path.frame(k, 9).position;
            at.cmpgt(min.into()).all() && at.cmplt(max.into()).all()
        })
    }

    #[test]
    fn rooms_are_seen_from_within_along_their_longest_way() {
        let (min, max) = ([-4.0, 0.0, -3.0], [11.0, 4.0, 3.0]);
        let pillar = ([3.2, 0.0, -0.3], [3.8, 4.0, 0.3], false);
        let through = path_of(&[(min, max, true), pillar]);
        assert!(is_within(&through, min, max), "{through:?}");
        for k in 0..9 {
            let (_, _, forward) = through.frame(k, 9).frame();
            assert!(forward.x.abs() > 0.9, "{forward}");
        }
        // The wall at the end stays away.
        let last = through.frame(8, 9);
        let ahead = if last.target.x > last.position.x { max[0] - last.position.x } else { last.position.x - min[0] };
        assert!(ahead > 5.0, "{ahead}");
    }

    #[test]
    fn all_else_is_seen_from_outside() {
        let (min, max) = ([-4.0, 0.0, -3.0], [11.0, 4.0, 3.0]);
        // A closed block; a room for dolls; a court between blocks.
        assert!(!is_within(&path_of(&[(min, max, false)]), min, max));
        let small = |at: [f64; 3]| at.map(|x| 0.01 * x);
        assert!(!is_within(&path_of(&[(small(min), small(max), true)]), small(min), small(max)));
        let court = [
            ([0.0, 0.0, 0.0], [12.0, 5.0, 3.0], false),
            ([0.0, 0.0, 9.0], [12.0, 5.0, 12.0], false),
            ([0.0, 0.0, 3.0], [3.0, 5.0, 9.0], false),
            ([9.0, 0.0, 3.0], [12.0, 5.0, 9.0], false),
        ];
        assert!(!is_within(&path_of(&court), [0.0; 3], [12.0; 3]));
        // A block that is turned inside out, as mirrors do, on a wide floor.
        let block = ([0.0, 0.0, -1.5], [8.0, 4.0, 1.5], true);
        let floor = ([-4.0, -0.1, -3.0], [11.0, 0.0, 3.0], false);
        assert!(!is_within(&path_of(&[block, floor]), min, max));
    }

    /// Blocks of few triangles among others of many belong to what is shown; they are no ground.
    #[test]
    fn coarse_parts_are_framed_too() {
        let mut boxes: Vec<_> = (0..30)
            .map(|i| {
                let at = [f64::from(i % 6), f64::from(i / 6)].map(|x| 100.0 * x);
                ([at[0], 0.0, at[1]], [at[0] + 60.0, 120.0, at[1] + 60.0], false)
            })
            .collect();
        boxes.extend((0..4000).map(|i: u32| {
            let at = [f64::from(i % 40), f64::from(i / 40)].map(|x| 0.5 * x);
            ([at[0] + 62.0, 0.0, at[1]], [at[0] + 62.4, 1.0, at[1] + 0.4], false)
        }));
        let path = path_of(&boxes);
        for k in 0..9 {
            let camera = path.frame(k, 9);
            let (_, _, forward) = camera.frame();
            let depth = (DVec3::new(280.0, 60.0, 230.0) - camera.position).dot(forward);
            assert!(depth > 400.0, "{depth}");
        }
    }

    #[test]
    fn a_wide_ground_is_not_framed() {
        let mut boxes = vec![([-500.0, -0.1, -500.0], [500.0, 0.0, 500.0], false)];
        let house = |i: u32| {
            let at = [f64::from(i % 40), f64::from(i / 40)].map(|x| 0.5 * x);
            ([at[0], 0.0, at[1]], [at[0] + 0.4, 1.0, at[1] + 0.4], false)
        };
        boxes.extend((0..4000).map(house));
        let around = path_of(&boxes);
        let distance = (around.frame(0, 1).position - DVec3::new(10.0, 0.5, 25.0)).length();
        assert!(distance < 200.0, "{distance}");
    }
}

//! The camera path of a scene for which none was given: around it, or through a room where it is one.
//!
//! A scene is a room if it is as large as one and rays from places within its bounds meet surfaces nearly everywhere,
//! some above them, and meet them from the front: from within a closed object one sees its back. Then the camera looks where the free way is
//! longest and stands as far back on this way as it may.

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
        // Within a pillar or a chest one sees backs.
        places.extend((2 * place.fronts > place.hits).then_some(place));
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

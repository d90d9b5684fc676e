//! The camera path of a scene for which none was given: around it, or through a room where it is one.
//!
//! A scene is a room if rays from places within its bounds meet surfaces nearly everywhere, some above them, and meet
//! them from the front: from within a closed object one sees its back. Then the camera looks where the free way is
//! longest and stands as far back on this way as it may.

use super::sight::{Seen, Sight};
use crate::scene::framing::{Picture, along, around};
use crate::scene::{CameraPath, path_from_bounds};
use bricks::{Manifest, SceneFile};
use glam::DVec3;
use std::f64::consts::TAU;

/// Places that are looked from.
const PLACES: u32 = 9;
/// Directions around a place.
const AROUND: u32 = 24;
/// Share of these rays that must meet something, and of these hits that must be on the front.
const ENCLOSED: f64 = 0.6;
const FRONT: f64 = 0.8;
/// Share of the places that have a ceiling; a court has none, a street neither.
const ROOFED: f64 = 0.3;
/// A scene that is lower than this share of its width is seen from above.
const FLAT: f64 = 0.2;
/// Height of the eye, as a share of the height that is free above the floor, and its most as a share of the longest
/// way.
const EYE: f64 = 0.22;
/// What is kept free of the way behind the camera.
const BEHIND: f64 = 0.15;
/// Half the angle of the rays that must be as free as the way, radians.
const SPREAD: f64 = 0.07;

/// The path of the scene in `file` for such a picture.
pub fn path(file: &SceneFile, picture: Picture) -> CameraPath {
    let Manifest { min, max, .. } = file.resident().manifest;
    let Some(mut sight) = Sight::new(file) else {
        return match picture.fov_y_degrees {
            Some(_) => around(&[[min.into(), max.into()]], picture),
            None => path_from_bounds(min, max),
        };
    };
    let through = room(&mut sight, min.into(), max.into());
    through.map_or_else(
        || around(&sight.boxes(), picture),
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

/// The longest free way within the bounds, if they are those of a room.
fn room(sight: &mut Sight, min: DVec3, max: DVec3) -> Option<Way> {
    let size = max - min;
    if !(size.is_finite() && size.min_element() > 0.0 && size.y >= FLAT * size.x.max(size.z)) {
        return None;
    }
    let (mut best, mut rays, mut hits, mut fronts, mut roofs) = (None::<Way>, 0u32, 0u32, 0u32, 0u32);
    for place in 0..PLACES {
        let share = DVec3::new(0.25 * f64::from(place % 3 + 1), 0.4, 0.25 * f64::from(place / 3 + 1));
        let middle = min + size * share;
        let [below, above] = [DVec3::NEG_Y, DVec3::Y].map(|way| sight.cast(middle, way));
        let (below, above) = (below?, above?);
        let floor = middle.y - below.distance.min(middle.y - min.y);
        let ceiling = middle.y + above.distance.min(max.y - middle.y);
        let eye = middle.with_y(floor + EYE * (ceiling - floor));
        let mut around = Vec::new();
        for k in 0..AROUND {
            around.push(sight.cast(eye, level(f64::from(k) / f64::from(AROUND) * TAU))?);
        }
        let met = |seen: &&Seen| seen.distance.is_finite();
        rays += AROUND + 1;
        roofs += u32::from(above.distance.is_finite() && above.is_front);
        for seen in around.iter().chain([&below]).filter(met) {
            hits += 1;
            fronts += u32::from(seen.is_front);
        }
        for (k, seen) in around.iter().enumerate().filter(|(_, seen)| seen.distance.is_finite()) {
            let angle = k as f64 / f64::from(AROUND) * TAU;
            let opposite = around[(k + AROUND as usize / 2) % AROUND as usize].distance;
            // Out of a room that is open one steps no further than it is long.
            let back = (1.0 - BEHIND) * opposite.min(size.x.max(size.z));
            let free = seen.distance + back;
            if best.is_some_and(|best| free <= best.free) {
                continue;
            }
            let mut narrow = free;
            let start = eye - level(angle) * back;
            for turn in [-SPREAD, SPREAD] {
                narrow = narrow.min(sight.cast(start, level(angle + turn))?.distance);
            }
            if best.is_none_or(|best| narrow > best.free) {
                best = Some(Way { start, direction: level(angle), free: narrow });
            }
        }
    }
    let is_room = f64::from(hits) >= ENCLOSED * f64::from(rays)
        && f64::from(fronts) >= FRONT * f64::from(hits)
        && f64::from(roofs) >= ROOFED * f64::from(PLACES);
    best.filter(|_| is_room)
}

/// A level direction.
fn level(angle: f64) -> DVec3 {
    DVec3::new(angle.cos(), 0.0, angle.sin())
}

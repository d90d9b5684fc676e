//! Reflective shadow maps (Dachsbacher and Stamminger 2005): which maps lamps have.
//!
//! *Theory.* A lamp's picture of the scene, with what each surface reflects of the light, holds every surface that the
//! lamp lights. What a ray that meets one of them sees of the lamp is one look-up there.
//!
//! *What we changed.* The paper draws points of the maps as lamps of their own; here, as in Zeng et al. (§4), rays look
//! up what they meet. The sun and other distant lights have a map for each of the base occupancy maps
//! ([`super::occupancy`]), of texels about as wide as its cells, so that what is met in a cell is found as finely as it
//! is known. They are moved by quarters of the base map's side, to be made seldom.
//!
//! *Practice.* Spots have one map, points, and spots that are too wide, the six sides of a cube.

pub mod answer;
pub mod kernels;
pub mod maps;
mod settings;
pub mod twin;

pub use settings::Options;

use super::occupancy::Cascades;
use super::rsm::maps::LampView;
use crate::kernels::Lamps;
use crate::kernels::lamps::Shape;
use crate::kernels::layout::NONE;
use glam::DVec3;

/// How reflective shadow maps are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RsmSettings {
    /// Texels of the longer side of a map, 32 to 2048; the six maps of a point have half as many on both sides.
    pub size: u32,
    /// Most emitters that have maps, the strongest; the sun has maps besides.
    pub lamps: u32,
}

/// Spots wider than this, radians from the axis, have a cube's maps.
const WIDEST_SPOT: f64 = 1.1;

/// The maps of all lamps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LampViews {
    /// Those of one lamp follow each other, the finest first.
    pub views: Vec<LampView>,
    /// Emitters with maps.
    pub lamps: u32,
    /// Points, spots and distant lights without, beyond [`RsmSettings::lamps`].
    pub left_out: u32,
    /// Area lights and surfaces that shine: none has a map.
    pub areas: u32,
}

/// A part of the world, from and to.
type Box3 = [DVec3; 2];

impl LampViews {
    /// Of the sun, if `sun` says where it is, and of `lamps`, for what `cascades` cover of a scene within `bounds`.
    pub fn new(settings: &RsmSettings, cascades: &Cascades, bounds: Box3, sun: Option<DVec3>, lamps: &Lamps) -> Self {
        let regions = regions(cascades, bounds);
        let mut all = Self::default();
        let distant =
            |lamp, along: DVec3| regions.iter().map(move |region| distant(lamp, along, *region, bounds, settings.size));
        all.views.extend(sun.into_iter().flat_map(|sun| distant(NONE, -sun)));
        let is_area = |shape: &Shape| matches!(shape, Shape::Parallelogram { .. } | Shape::Triangle { .. });
        let emitters = lamps.emitters();
        let mut order: Vec<usize> = (0..emitters.len()).filter(|&i| !is_area(&emitters[i].shape)).collect();
        all.areas = (emitters.len() - order.len()) as u32;
        // Of equal ones the first: the sort is stable.
        order.sort_by(|&a, &b| lamps.probabilities()[b].total_cmp(&lamps.probabilities()[a]));
        let most = settings.lamps as usize;
        all.left_out = order.len().saturating_sub(most) as u32;
        order.truncate(most);
        all.lamps = order.len() as u32;
        for index in order {
            let lamp = index as u32;
            match emitters[index].shape {
                Shape::Distant { direction } => all.views.extend(distant(lamp, direction)),
                Shape::Spot { position, direction, cone: [_, outer], .. } if outer <= WIDEST_SPOT => {
                    all.views.push(perspective(lamp, position, direction, outer.tan(), settings.size));
                }
                Shape::Spot { position, .. } | Shape::Point { position, .. } => {
                    let sides = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
                    all.views.extend(sides.map(|side| perspective(lamp, position, side, 1.0, settings.size / 2)));
                }
                Shape::Parallelogram { .. } | Shape::Triangle { .. } => {}
            }
        }
        all
    }
}

/// What maps of distant lights show: for each base map the part of the scene in it, an eighth of its side wider to all
/// sides, moved by whole quarters of its side.
fn regions(cascades: &Cascades, [low, high]: Box3) -> Vec<Box3> {
    let mut all: Vec<Box3> = Vec::new();
    for bom in &cascades.levels {
        let cell = f64::from(bom.cell_log2).exp2();
        let side = cell * f64::from(bom.cells());
        let middle = DVec3::from_array(bom.first.map(|x| x as f64)) * cell + DVec3::splat(0.5 * side);
        let middle = (middle / (0.25 * side)).round() * (0.25 * side);
        let half = DVec3::splat(0.625 * side);
        all.push([(middle - half).clamp(low, high), (middle + half).clamp(low, high)]);
        if all.last() == Some(&[low, high]) {
            break;
        }
    }
    all
}

/// The map of a distant light that shines `along`, of a region, from before the scene.
fn distant(lamp: u32, along: DVec3, [low, high]: Box3, bounds: Box3, size: u32) -> LampView {
    let (x, y) = along.any_orthonormal_pair();
    let span = |axis: DVec3, [low, high]: Box3| {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        [middle.dot(axis) - half.dot(axis.abs()), middle.dot(axis) + half.dot(axis.abs())]
    };
    let diagonal = (bounds[1] - bounds[0]).length().max(f64::MIN_POSITIVE);
    let [from_x, from_y] = [x, y].map(|axis| span(axis, [low, high]));
    // Wider by a texel on both sides than the region: its border lies within.
    let texel = (from_x[1] - from_x[0]).max(from_y[1] - from_y[0]).max(1e-4 * diagonal) / f64::from(size - 2);
    let count = |[from, to]: [f64; 2]| (((to - from) / texel).ceil() as u32 + 2).min(size);
    let start = span(along, bounds)[0] - 1e-3 * diagonal;
    LampView {
        lamp,
        is_perspective: false,
        corner: x * (from_x[0] - texel) + y * (from_y[0] - texel) + along * start,
        axis: along,
        base: DVec3::ZERO,
        x: x * texel,
        y: y * texel,
        width: count(from_x),
        height: count(from_y),
    }
}

/// What a point sees around `axis`, up to an angle of this tangent.
fn perspective(lamp: u32, corner: DVec3, axis: DVec3, tangent: f64, size: u32) -> LampView {
    let (x, y) = axis.any_orthonormal_pair();
    let step = 2.0 * tangent / f64::from(size);
    let base = axis - (x + y) * tangent;
    LampView { lamp, is_perspective: true, corner, axis, base, x: x * step, y: y * step, width: size, height: size }
}

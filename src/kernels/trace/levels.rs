//! Which leaves of the top level a ray takes where levels of detail stand for bricks: twin of
//! `shaders/trace/levels.wgsl`. Where no levels are in use all of this says at once that a ray takes everything.

use crate::kernels::bound::Bound;
use crate::kernels::layout::{LEVEL_OFFSET, LevelLeaf, NONE, Surface, TileBounds};
use crate::kernels::vector::{Vec3, each, most};
use crate::math::exact::{barrier, square_root};

/// The cone of a ray, times the tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cone {
    /// Origin of the ray.
    origin: Vec3,
    /// Square of the width there.
    square: f32,
    /// Square of what the width grows by over a distance of 1.
    spread: f32,
}

fn square_of(v: Vec3) -> f32 {
    barrier(barrier(barrier(v[0] * v[0]) + barrier(v[1] * v[1])) + barrier(v[2] * v[2]))
}

/// What the cone of a ray spreads by beyond its pass's, squared.
#[inline(always)]
pub fn spread_of(surface: &Surface) -> f32 {
    spread_in(surface.pending)
}

/// The same by [`Surface::pending`].
#[inline(always)]
pub fn spread_in(pending: u32) -> f32 {
    f32::from_bits(pending >> 1)
}

/// Whether a ray may still ask for bricks.
#[inline(always)]
pub fn is_pending(surface: &Surface) -> bool {
    surface.pending & 1 != 0
}

/// Notes whether it may.
#[inline(always)]
pub fn set_pending(surface: &mut Surface, pending: bool) {
    surface.pending = surface.pending & !1 | u32::from(pending);
}

impl Bound<'_> {
    /// Whether levels are in use.
    #[inline(always)]
    pub fn has_levels(&self) -> bool {
        !self.scene.levels.leaves.is_empty()
    }

    /// Whether no cone has a width: rays take bricks alone, or what is marked.
    #[inline(always)]
    pub fn are_cones_empty(&self) -> bool {
        !self.has_levels() || self.params.levels[..3] == [0.0; 3]
    }

    fn eye(&self) -> Vec3 {
        let [x, y, z, _] = self.params.origin;
        [x, y, z]
    }

    /// What the widths of a ray's cone are scaled by, squared: with blending at random between two levels.
    fn blend_of(&self, direction: Vec3) -> f32 {
        let share = self.params.levels[3];
        if share == 0.0 {
            return 1.0;
        }
        let [x, y, z] = direction.map(f32::to_bits);
        let mut h = (x ^ self.params.seed).wrapping_mul(0x9e37_79b1);
        h = (h ^ h >> 15).wrapping_add(y).wrapping_mul(0x85eb_ca77);
        h = (h ^ h >> 13).wrapping_add(z).wrapping_mul(0xc2b2_ae3d);
        h ^= h >> 16;
        barrier(1.0 - barrier(share * barrier((h >> 8) as f32 * 5.960_464_5e-8)))
    }

    /// The cone of a ray that spreads beyond its pass's by an angle, given squared ([`spread_of`]).
    #[inline(always)]
    pub fn cone_of(&self, origin: Vec3, direction: Vec3, own: f32) -> Cone {
        if !self.has_levels() {
            return Cone::default();
        }
        let [at_origin, spread, ..] = self.params.levels;
        let eye = self.eye();
        let blend = self.blend_of(direction);
        let square = barrier(at_origin * square_of(each(|k| origin[k] - eye[k])));
        Cone { origin, square: barrier(blend * square), spread: barrier(blend * most(spread, own)) }
    }

    fn level_leaf(&self, leaf: u32) -> &LevelLeaf {
        &self.scene.levels.leaves[leaf as usize]
    }

    fn width_square(&self, cone: &Cone, leaf: u32) -> f32 {
        let level = self.level_leaf(leaf);
        let d = each(|k| most(most(level.min[k] - cone.origin[k], cone.origin[k] - level.max[k]), 0.0));
        barrier(cone.square + barrier(cone.spread * square_of(d)))
    }

    fn suffices(&self, cone: &Cone, leaf: u32) -> bool {
        self.level_leaf(leaf).error_square <= self.width_square(cone, leaf)
    }

    /// Whether the ray takes a leaf.
    #[inline(always)]
    pub fn takes(&self, cone: &Cone, leaf: u32) -> bool {
        if !self.has_levels() {
            return true;
        }
        let parent = self.level_leaf(leaf).parent;
        self.suffices(cone, leaf) && (parent == NONE || !self.suffices(cone, parent))
    }

    /// Whether a level that the ray takes, or one above it, stands for all below a node of the binary top level.
    #[inline(always)]
    pub fn is_stood_for(&self, cone: &Cone, node: u32) -> bool {
        if !self.has_levels() {
            return false;
        }
        let level = self.scene.levels.nodes[node as usize];
        level != NONE && self.suffices(cone, level)
    }

    /// The same of the wide top level.
    #[inline(always)]
    pub fn is_stood_for_wide(&self, cone: &Cone, node: u32) -> bool {
        self.has_levels() && self.is_stood_for(cone, self.params.top_count + node)
    }

    /// Ranges of what the cones of a tile have, at the box of a leaf: the squares of widths.
    fn tile_widths(&self, tile: &TileBounds, leaf: u32) -> [f32; 2] {
        let ([at_origin, spread, _, share], eye) = (self.params.levels, self.eye());
        let LevelLeaf { min: lo, max: hi, .. } = *self.level_leaf(leaf);
        let (o0, o1) = (tile.origin_min, tile.origin_max);
        let from_eye = each(|k| most(most(o0[k] - eye[k], eye[k] - o1[k]), 0.0));
        let to_eye = each(|k| most((o0[k] - eye[k]).abs(), (o1[k] - eye[k]).abs()));
        let nearest = each(|k| most(most(lo[k] - o1[k], o0[k] - hi[k]), 0.0));
        let from = |origin: Vec3, k: usize| most(most(lo[k] - origin[k], origin[k] - hi[k]), 0.0);
        let farthest = each(|k| most(from(o0, k), from(o1, k)));
        let blend = barrier(1.0 - share);
        let least_square = barrier(blend * barrier(at_origin * square_of(from_eye)));
        let least_spread = barrier(blend * most(spread, f32::from_bits(tile.spreads & 0xffff_0000)));
        let most_spread = most(spread, f32::from_bits(tile.spreads << 16));
        let most_square = barrier(at_origin * square_of(to_eye));
        [
            barrier(least_square + barrier(least_spread * square_of(nearest))),
            barrier(most_square + barrier(most_spread * square_of(farthest))),
        ]
    }

    /// Whether a level stands for all below a node of the binary top level, for every ray of the tile.
    pub fn tile_is_stood_for(&self, tile: &TileBounds, node: u32) -> bool {
        if !self.has_levels() {
            return false;
        }
        let level = self.scene.levels.nodes[node as usize];
        level != NONE && self.level_leaf(level).error_square <= self.tile_widths(tile, level)[0]
    }

    /// Whether any ray of the tile may take a leaf.
    pub fn tile_may_take(&self, tile: &TileBounds, leaf: u32) -> bool {
        if !self.has_levels() {
            return true;
        }
        let level = self.level_leaf(leaf);
        level.error_square <= self.tile_widths(tile, leaf)[1]
            && (level.parent == NONE
                || self.level_leaf(level.parent).error_square > self.tile_widths(tile, level.parent)[0])
    }

    /// Whether a leaf is marked: a level below which something is missing, or a leaf below such a one.
    #[inline(always)]
    pub fn is_marked(&self, leaf: u32) -> bool {
        self.has_levels() && self.level_leaf(leaf).error_square.is_sign_negative()
    }

    /// Whether a level would suffice if nothing were missing.
    pub fn would_suffice(&self, cone: &Cone, leaf: u32) -> bool {
        !self.has_levels() || self.level_leaf(leaf).error_square.abs() <= self.width_square(cone, leaf)
    }

    /// Whether the ray would take a leaf.
    pub fn would_take(&self, cone: &Cone, leaf: u32) -> bool {
        if !self.has_levels() {
            return true;
        }
        let parent = self.level_leaf(leaf).parent;
        self.would_suffice(cone, leaf) && (parent == NONE || !self.would_suffice(cone, parent))
    }

    /// Whether a level that the ray would take, or one above it, stands for all below a node of the wide top level.
    pub fn would_be_stood_for_wide(&self, cone: &Cone, node: u32) -> bool {
        if !self.has_levels() {
            return false;
        }
        let level = self.scene.levels.nodes[(self.params.top_count + node) as usize];
        level != NONE && self.would_suffice(cone, level)
    }

    /// The leaf that stands in for one that the ray would take: itself where nothing is marked above it.
    pub fn stand_in_of(&self, leaf: u32) -> u32 {
        let mut level = leaf;
        while self.has_levels() {
            let parent = self.level_leaf(level).parent;
            if parent == NONE || !self.is_marked(parent) {
                break;
            }
            level = parent;
        }
        level
    }

    /// Has rays that start at a hit start off its surface where they may meet another level of it.
    #[inline(always)]
    pub fn start_off(&self, surface: &mut Surface) {
        if self.has_levels() && surface.leaf != NONE {
            let off = self.level_offset(surface.point, surface.leaf);
            if off > 0.0 {
                let Surface { point, normal, .. } = *surface;
                surface.point = each(|k| barrier(point[k] + barrier(off * normal[k])));
            }
        }
    }

    /// By what rays that start at a hit start off along its normal, beside the rounding of the point: the error of the
    /// level that they take there, which is the coarsest of those that the hit and they may be on.
    fn level_offset(&self, point: Vec3, leaf: u32) -> f32 {
        let ([at_origin, ..], eye) = (self.params.levels, self.eye());
        let square = barrier(at_origin * square_of(each(|k| point[k] - eye[k])));
        let mut level = self.level_leaf(leaf);
        while level.parent != NONE && self.level_leaf(level.parent).error_square <= square {
            level = self.level_leaf(level.parent);
        }
        barrier(LEVEL_OFFSET * square_root(level.error_square.abs()))
    }
}

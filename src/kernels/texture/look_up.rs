//! One texture at one hit: what lookups of `shaders/texture/sample.wgsl` and `shaders/texture/more.wgsl` share.

use super::texels::{Sampling, TileDemand};
use super::texture::{Level, color_at, level_at, levels_of, tile_at};
use crate::kernels::layout::{GBuffer, NONE};
use crate::kernels::vector::{Vec3, cross, dot, each, mix, most};
use std::sync::atomic::Ordering;

/// The normal that a texel of a normal texture stands for on a surface with this one.
pub(crate) fn turned_normal(normal: Vec3, g: &GBuffer, texel: Vec3, scale: f32) -> Vec3 {
    let n = texel.map(|c| 2.0 * c - 1.0);
    let beside = dot(normal, g.tangent);
    let along = each(|k| g.tangent[k] - normal[k] * beside);
    let size = dot(along, along);
    // The tangent may have no part beside the normal.
    let inverse = 1.0 / most(size, 1.0e-30).sqrt();
    let t = along.map(|x| x * inverse);
    let sign = if g.handedness > 0.0 { 1.0 } else { -1.0 };
    let b = cross(normal, t).map(|x| x * sign);
    let turned = each(|k| scale * n[0] * t[k] + scale * n[1] * b[k] + n[2] * normal[k]);
    let length = dot(turned, turned);
    if size > 1.0e-30 && length > 1.0e-12 {
        let inverse = 1.0 / most(length, 1.0e-30).sqrt();
        return turned.map(|x| x * inverse);
    }
    normal
}

fn tiles_of(level: &Level) -> impl Iterator<Item = u32> {
    (0..4).map(|k| tile_at(level, k)).filter(|&tile| tile != NONE)
}

/// What lookups read and ask for.
pub struct Lookups<'a> {
    /// Textures and their tiles.
    pub from: Sampling<'a>,
    /// What is asked of each tile.
    pub demand: &'a [TileDemand],
    /// Whether coarser levels stand for what is missing.
    pub takes_coarser: bool,
}

impl Lookups<'_> {
    /// Those of the scene.
    pub fn materials(&self) -> &[bricks::Material] {
        &self.from.texels.materials
    }

    /// Texture `which` of a material at a hit, that of ray `index`, and whether a coarser level stands for one that is
    /// missing. `None`: its tiles are not resident, and are asked for.
    pub fn look_up(&self, g: &GBuffer, m: &bricks::Material, which: usize, index: u32) -> Option<([f32; 4], bool)> {
        let Self { from, demand, takes_coarser } = *self;
        let is_resident = |level: &Level| tiles_of(level).all(|tile| !from.tiles[tile as usize].is_empty());
        let t = &from.texels.textures[m.textures()[which] as usize];
        let is_second = m.uv_sets >> which & 1 != 0;
        let (set, footprint) = if is_second { (g.uv1, g.footprint1) } else { (g.uv, g.footprint) };
        let [u, v] = [m.uv_from_set[2 * which], m.uv_from_set[2 * which + 1]];
        let uv = [u, v].map(|row| row[0] * set[0] + row[1] * set[1] + row[2]);
        let mut levels = levels_of(t, footprint * u[3]);
        let mut around =
            [0, 1].map(|n| if n < levels.count { level_at(t, levels.finer + n, uv) } else { Level::default() });
        let mut is_missing = !around[..levels.count as usize].iter().all(is_resident);
        let mut is_coarser = false;
        if is_missing && takes_coarser {
            levels.count = 1;
            // The tail ends this: it is resident throughout.
            while !is_resident(&around[0]) {
                levels.finer += 1;
                around[0] = level_at(t, levels.finer, uv);
            }
            (is_missing, is_coarser) = (false, true);
        }
        let around = &around[..levels.count as usize];
        for tile in around.iter().flat_map(tiles_of) {
            let asked = &demand[tile as usize];
            if is_missing {
                asked.rays.fetch_add(1, Ordering::Relaxed);
                asked.first.fetch_min(index, Ordering::Relaxed);
            } else if asked.used.load(Ordering::Relaxed) == 0 {
                asked.used.store(1, Ordering::Relaxed);
            }
        }
        if is_missing {
            return None;
        }
        let mut color = color_at(t, &around[0], from);
        if let Some(coarser) = around.get(1) {
            let other = color_at(t, coarser, from);
            color = [0, 1, 2, 3].map(|k| mix(color[k], other[k], levels.share));
        }
        Some((color, is_coarser))
    }
}

//! Terrain: a square of land around a pond, woods and meadows about it, mountains behind; what grows and lies on it is
//! stored once and placed many times.
//!
//! The land depends on the seed and the place alone: more triangles reach further out. Quads have edges of [`STEP`].

mod cover;
mod height;
mod way;

use crate::material::{Mat, materials};
use crate::mesh::Builder;
use crate::path::{self, CameraPath, Keyframe};
use crate::rng::Rng;
use crate::scene::{Draft, EMPTY, Recipe, Scene, rows, union};
use crate::settings::Settings;
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive};
use cover::{CELL, Item, Use};
use glam::{DVec2, DVec3};
use height::{Land, WATER};
use rayon::prelude::*;
use std::f64::consts::TAU;
use way::{CLEAR, way, way_distance};

/// Edge of a quad, metres.
const STEP: f64 = 0.5;
/// Quads along the edge of a tile.
const TILE: i64 = 128;
/// Segments and rings of the pond's surface.
const POND: [u32; 2] = [48, 6];
/// Radius of the pond's surface, metres; its rim is under the ground.
const POND_RADIUS: f64 = 21.0;

/// A tile: quads from `from` (inclusive) to `to` (exclusive), in quads from the origin.
#[derive(Clone, Copy, Debug)]
struct Tile {
    from: [i64; 2],
    to: [i64; 2],
}

struct Terrain {
    land: Land,
    items: Vec<Item>,
    /// Items by mesh, after the tiles and the pond.
    used: Vec<usize>,
    tiles: Vec<Tile>,
    bounds: Vec<[DVec3; 2]>,
}

impl Terrain {
    fn tile(&self, tile: Tile) -> Builder {
        let [nx, nz] = [0, 1].map(|k| (tile.to[k] - tile.from[k]) as usize);
        // Heights with a border, from which normals are made that agree with those of the neighbours.
        let wide = nx + 3;
        let at = |column: usize, row: usize| {
            DVec2::new((tile.from[0] + column as i64 - 1) as f64, (tile.from[1] + row as i64 - 1) as f64) * STEP
        };
        let heights: Vec<f64> = (0..(nz + 3) * wide).map(|k| self.land.height(at(k % wide, k / wide))).collect();
        let mut b = Builder::smooth();
        // Outside is (next column) × (next row), so columns go along z.
        b.lattice(Mat::Soil, nx + 1, nz + 1, |x, z| {
            let (column, row) = (x + 1, z + 1);
            let h = |dx: usize, dz: usize| heights[(row + dz - 1) * wide + column + dx - 1];
            let q = at(column, row);
            let p = DVec3::new(q.x, h(1, 1), q.y);
            let n = DVec3::new(h(0, 1) - h(2, 1), 2.0 * STEP, h(1, 0) - h(1, 2)).normalize();
            (p, n, self.land.color(p, n))
        });
        b
    }
}

fn pond() -> Builder {
    let mut b = Builder::smooth();
    let [around, rings] = POND;
    b.lattice(Mat::Water, rings as usize + 1, around as usize + 1, |row, column| {
        let r = POND_RADIUS * (1.0 - row as f64 / f64::from(rings));
        let (s, c) = (f64::from(column as u32 % around) * TAU / f64::from(around)).sin_cos();
        // Clockwise from above is counter-clockwise with z to the south.
        (DVec3::new(r * c, WATER, -r * s), DVec3::Y, [0.8, 0.9, 0.9])
    });
    b
}

impl Recipe for Terrain {
    fn mesh(&self, index: usize) -> Vec<Primitive> {
        if let Some(tile) = self.tiles.get(index) {
            return self.tile(*tile).into_primitives();
        }
        match index - self.tiles.len() {
            0 => pond().into_primitives(),
            k => self.items[self.used[k - 1]].mesh.clone().into_primitives(),
        }
    }

    /// Around the pond.
    fn near(&self, frames: u32) -> CameraPath {
        let eye = |s: f64, up: f64| {
            let p = way(s);
            // The mean ground of a few metres, so that the view does not shake, but never in the ground.
            let mean: f64 = (-4..=4).map(|k| self.land.height(way(s + 0.5 * f64::from(k)))).sum::<f64>() / 9.0;
            DVec3::new(p.x, mean.max(self.land.height(p) - 0.3) + up, p.y)
        };
        let keyframes = (0..frames).map(|k| {
            let s = f64::from(k) * 0.5;
            // Ahead and a little across the water.
            let (p, ahead) = (eye(s, path::EYE), eye(s + 13.0, path::EYE + 0.9));
            let target = ahead + DVec3::new(-ahead.x, 0.0, -ahead.z) * 0.28;
            Keyframe { time: f64::from(k), position: p.to_array(), target: target.to_array() }
        });
        CameraPath { fov_y_degrees: 65.0, up: path::UP, keyframes: keyframes.collect() }
    }

    /// Above the peaks.
    fn far(&self) -> CameraPath {
        let [_, high] = self.bounds.iter().copied().fold(EMPTY, union);
        path::around(DVec3::new(0.0, 0.3 * high.y, 0.0), &self.bounds, 27.0f64.to_radians(), 0.4)
    }

    fn bounds(&self) -> &[[DVec3; 2]] {
        &self.bounds
    }
}

/// Chebyshev distance from the origin, in quads rounded up, within which a thing is on the land.
fn reach(one: &Use) -> i64 {
    let t = one.world_from_mesh.translation;
    (t.x.abs().max(t.z.abs()) / STEP).ceil() as i64
}

/// See [`crate::generate()`].
pub fn generate(settings: &Settings, progress: &Progress) -> Scene {
    let Settings { triangles: wanted, seed, .. } = *settings;
    let (land, items) = (Land::new(seed), cover::items(seed));
    let pond = pond();
    let left = wanted - pond.triangles();
    // Half the edge in quads if the land were bare; then all that it would have, from the middle outward.
    let most = ((left as f64 / 8.0).sqrt()) as i64;
    let cells = (most as f64 * STEP / CELL).ceil() as i64;
    let columns: Vec<Vec<Use>> = (-cells..cells)
        .into_par_iter()
        .map(|i| {
            let mut uses = Vec::new();
            (-cells..cells).for_each(|j| cover::strew(&land, &items, seed, i, j, |one| uses.push(one)));
            progress.advance(wanted / (2 * cells) as u64);
            uses
        })
        .collect();
    let mut things = vec![0u64; most as usize + 1];
    for one in columns.iter().flatten() {
        if let Some(sum) = things.get_mut(reach(one) as usize) {
            *sum += items[one.item].triangles;
        }
    }
    let mut sum = 0;
    let mut half = 0;
    let mut spent = 0;
    for (k, more) in things.iter().enumerate() {
        sum += more;
        let all = 8 * (k as u64) * (k as u64) + sum;
        if all > left {
            break;
        }
        (half, spent) = (k as i64, all);
    }
    let mut uses: Vec<Use> = columns.into_iter().flatten().filter(|one| reach(one) <= half).collect();
    // Fallen logs use up what is too little for another row of quads.
    let filler = cover::filler(&items);
    let mut rng = Rng::new(seed, &[43]);
    let radius = half as f64 * STEP;
    let mut tries = 0;
    while spent + items[filler].triangles <= left && tries < 1_000_000 {
        tries += 1;
        let q = DVec2::new(rng.range(-radius, radius), rng.range(-radius, radius));
        if way_distance(q) > CLEAR + 4.0 && land.height(q) > WATER + 0.3 {
            uses.push(cover::lay(&land, &items, &mut rng, q));
            spent += items[filler].triangles;
        }
    }

    let mut draft = Draft::new(materials(), settings);
    let mut terrain = Terrain { land, items, used: Vec::new(), tiles: Vec::new(), bounds: Vec::new() };
    let starts = || (0..).map(move |k| TILE * k - half).take_while(move |from| *from < half);
    for x in starts() {
        for z in starts() {
            let tile = Tile { from: [x, z], to: [(x + TILE).min(half), (z + TILE).min(half)] };
            let quads = (tile.to[0] - x) * (tile.to[1] - z);
            let name = format!("tile {} {}", (x + half) / TILE, (z + half) / TILE);
            let mesh = draft.mesh(name.clone(), [2 * quads as u32]);
            draft.place(name, mesh, IDENTITY);
            let middle = DVec2::new((x + tile.to[0]) as f64, (z + tile.to[1]) as f64) * (0.5 * STEP);
            let y = terrain.land.height(middle);
            let corner = |k: [i64; 2], y: f64| DVec3::new(k[0] as f64 * STEP, y, k[1] as f64 * STEP);
            terrain.bounds.push([corner(tile.from, y - 20.0), corner(tile.to, y + 20.0)]);
            terrain.tiles.push(tile);
        }
    }
    let mesh = draft.mesh("pond".into(), pond.counts());
    draft.place("pond".into(), mesh, IDENTITY);
    let mut meshes: Vec<Option<u32>> = vec![None; terrain.items.len()];
    for one in uses {
        let item = &terrain.items[one.item];
        let mesh = *meshes[one.item].get_or_insert_with(|| {
            terrain.used.push(one.item);
            draft.mesh(item.name.clone(), item.mesh.counts())
        });
        draft.place(item.name.clone(), mesh, rows(&one.world_from_mesh));
    }
    Scene::new(draft.outline, Box::new(terrain))
}

//! Stadium: an ornate teapot on a pedestal in the middle of a stadium.
//!
//! The stadium's size is fixed. Of the triangles, at most half go into seats, as finely moulded as that allows; the
//! teapot gets the rest, in ever smaller triangles, so that sizes of 20 µm and of 200 m are in one scene.

mod bowl;
mod pitch;
mod teapot;

use crate::material::materials;
use crate::path::{self, CameraPath, Keyframe};
use crate::scene::{Draft, EMPTY, Recipe, Scene, union};
use crate::settings::Settings;
use bowl::{DETAILS, SECTORS};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive};
use glam::DVec3;
use pitch::TABLE;
use rayon::prelude::*;
use teapot::Tile;

/// Radians from frame to frame around the teapot.
const TURN: f64 = 0.021;

struct Stadium {
    seed: u64,
    detail: u32,
    tiles: Vec<Tile>,
    bounds: Vec<[DVec3; 2]>,
}

impl Recipe for Stadium {
    fn mesh(&self, index: usize) -> Vec<Primitive> {
        let mesh = match index {
            0 => pitch::pitch(self.seed),
            k if k <= SECTORS as usize => bowl::sector(self.seed, k as u32 - 1, self.detail),
            k => self.tiles[k - 1 - SECTORS as usize].mesh(DVec3::Y * TABLE),
        };
        mesh.into_primitives()
    }

    /// Around the teapot, an arm's length away, the stands behind it.
    fn near(&self, frames: u32) -> CameraPath {
        let keyframes = (0..frames).map(|k| {
            let angle = 0.75 + TURN * f64::from(k);
            let distance = 0.43 + 0.05 * (0.9 * angle).sin();
            let rise = 0.16 + 0.07 * (0.6 * angle).cos();
            let position = DVec3::new(angle.cos() * distance, TABLE + rise, angle.sin() * distance);
            let target = DVec3::new(0.0, TABLE + 0.098, 0.0);
            Keyframe { time: f64::from(k), position: position.to_array(), target: target.to_array() }
        });
        CameraPath { fov_y_degrees: 48.0, up: path::UP, keyframes: keyframes.collect() }
    }

    /// Above the roof, the pitch in view.
    fn far(&self) -> CameraPath {
        let [_, high] = self.bounds.iter().copied().fold(EMPTY, union);
        path::around(DVec3::new(0.0, 0.2 * high.y, 0.0), &self.bounds, 38.0f64.to_radians(), 0.5)
    }

    fn bounds(&self) -> &[[DVec3; 2]] {
        &self.bounds
    }
}

/// See [`crate::generate()`]. Builds the bowl once, to count.
pub fn generate(settings: &Settings, progress: &Progress) -> Scene {
    let Settings { triangles, seed, .. } = *settings;
    // The bowl's triangles are about those of as many times an ordinary sector.
    let about = |detail: u32| bowl::sector(seed, 1, detail).triangles() * u64::from(SECTORS);
    let detail = (1..DETAILS).rev().find(|detail| 2 * about(*detail) <= triangles).unwrap_or(0);
    let mut draft = Draft::new(materials(), settings);
    let mut stadium = Stadium { seed, detail, tiles: Vec::new(), bounds: Vec::new() };
    let pitch = pitch::pitch(seed);
    let mut left = triangles.saturating_sub(pitch.triangles());
    let mesh = draft.mesh("pitch".into(), pitch.counts());
    draft.place("pitch".into(), mesh, IDENTITY);
    let sectors: Vec<_> = (0..SECTORS)
        .into_par_iter()
        .map(|k| {
            let mesh = bowl::sector(seed, k, detail);
            progress.advance(mesh.triangles());
            (mesh.counts(), mesh.bounds(), mesh.triangles())
        })
        .collect();
    for (k, (counts, bounds, triangles)) in sectors.into_iter().enumerate() {
        let name = format!("sector {k}");
        let mesh = draft.mesh(name.clone(), counts);
        draft.place(name, mesh, IDENTITY);
        stadium.bounds.push(bounds);
        left = left.saturating_sub(triangles);
    }
    stadium.tiles = teapot::tiles(left);
    for tile in &stadium.tiles {
        let mesh = draft.mesh(tile.name(), [tile.triangles()]);
        draft.place(tile.name(), mesh, IDENTITY);
    }
    Scene::new(draft.outline, Box::new(stadium))
}

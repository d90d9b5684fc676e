//! Cornell box: a room of 4 m, open in front, with a lamp under the ceiling, two boxes on the floor, and a box that
//! orbits above them.
//!
//! The room is that of every such picture; its walls are flat. What triangles there are go into the boxes, whose sides
//! have a relief, and most of them into the one that moves.

use crate::material::{Tint, WHITE, material};
use crate::motion::{Mover, Pose};
use crate::path::{self, CameraPath, Keyframe};
use crate::rng::Rng;
use crate::scene::{Draft, Recipe, Scene, rows as matrix};
use crate::settings::Settings;
use bricks::{MATERIAL_DOUBLE_SIDED, Material};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive};
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI, TAU};

/// The node of the box that moves.
pub const MOVER: &str = "orbiting box";

/// Half the room's width and depth, and half its height, metres.
const HALF: f64 = 2.0;
/// Half the edge of the box that moves, metres.
const SMALL: f64 = 0.28;
/// Height at which it orbits, metres.
const HEIGHT: f64 = 2.85;
/// Radius of its orbit, metres.
const ORBIT: f64 = 1.15;
/// Keyframes an orbit, one a unit of time.
const STEPS: u32 = 12;
/// Depth of reliefs, as a share of half an edge.
const DEPTH: f64 = 0.06;

const ROOM: u32 = 0;
const LAMP: u32 = 1;
const BOX: u32 = 2;

/// A closed box: name, half edges, where its middle is, turn about the vertical, tint.
struct Solid {
    name: &'static str,
    half: DVec3,
    middle: DVec3,
    turn: f64,
    tint: Tint,
}

fn solids() -> [Solid; 3] {
    let at = DVec3::new;
    [
        Solid { name: "tall box", half: at(0.6, 1.1, 0.6), middle: at(-0.7, 1.1, -0.7), turn: 0.3, tint: [0.85; 3] },
        Solid {
            name: "short box",
            half: at(0.55, 0.55, 0.55),
            middle: at(0.7, 0.55, 0.5),
            turn: -0.31,
            tint: [0.85; 3],
        },
        Solid { name: MOVER, half: DVec3::splat(SMALL), middle: orbit(0.0), turn: 0.0, tint: [0.9, 0.62, 0.2] },
    ]
}

/// The middle of the box that moves, at a time.
fn orbit(time: f64) -> DVec3 {
    let (sin, cos) = (TAU * time / f64::from(STEPS)).sin_cos();
    DVec3::new(ORBIT * cos, HEIGHT + 0.12 * (2.0 * TAU * time / f64::from(STEPS)).sin(), ORBIT * sin)
}

/// A rectangle of `columns` x `rows` squares, from `corner` along `u` and `v`, whose outside is toward u × v, raised by
/// `relief` of shares of both edges.
fn rectangle(
    out: &mut Primitive,
    [corner, u, v]: [DVec3; 3],
    [columns, rows]: [u32; 2],
    tint: Tint,
    relief: impl Fn(f64, f64) -> f64,
) {
    let normal = u.cross(v).normalize();
    let base = out.positions.len() as u32;
    let colors = out.colors.get_or_insert_default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (s, t) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            out.positions.push((corner + u * s + v * t + normal * relief(s, t)).to_array());
            colors.push([tint[0], tint[1], tint[2], 1.0]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = base + row * (columns + 1) + column;
            let [b, d] = [a + 1, a + columns + 1];
            out.indices.extend([a, b, d + 1, a, d + 1, d]);
        }
    }
}

/// The room's five walls, `squares` of them each way, and the lamp.
fn room(squares: u32) -> Vec<Primitive> {
    let (at, h) = (DVec3::new, 2.0 * HALF);
    let (x, y, z) = (DVec3::X * h, DVec3::Y * h, DVec3::Z * h);
    let (red, green): (Tint, Tint) = ([0.63, 0.065, 0.05], [0.14, 0.45, 0.091]);
    let white: Tint = [0.73; 3];
    let walls = [
        ([at(-HALF, 0.0, -HALF), z, x], white),
        ([at(-HALF, h, -HALF), x, z], white),
        ([at(-HALF, 0.0, -HALF), x, y], white),
        ([at(-HALF, 0.0, -HALF), y, z], red),
        ([at(HALF, 0.0, -HALF), z, y], green),
    ];
    let mut inside = Primitive { material: ROOM, ..Primitive::default() };
    for (edges, tint) in walls {
        rectangle(&mut inside, edges, [squares; 2], tint, |_, _| 0.0);
    }
    let mut lamp = Primitive { material: LAMP, ..Primitive::default() };
    let (half, drop) = (0.5, 0.01);
    let edges = [at(-half, h - drop, -half), DVec3::X * 2.0 * half, DVec3::Z * 2.0 * half];
    rectangle(&mut lamp, edges, [1; 2], WHITE, |_, _| 0.0);
    vec![inside, lamp]
}

/// A box around the origin with a relief on its sides, which is zero at the edges.
fn solid(seed: u64, index: u32, half: DVec3, tint: Tint, squares: [u32; 2]) -> Primitive {
    let mut out = Primitive { material: BOX, ..Primitive::default() };
    for side in 0..6u32 {
        let rng = &mut Rng::new(seed, &[70, index.into(), side.into()]);
        let waves: [[f64; 3]; 4] =
            std::array::from_fn(|_| [rng.range(2.0, 7.0).floor(), rng.range(2.0, 7.0).floor(), rng.range(0.0, TAU)]);
        let axis = (side / 2) as usize;
        let sign = if side % 2 == 0 { 1.0 } else { -1.0 };
        let [n, mut u, mut v] = [0, 1, 2].map(|k| DVec3::AXES[(axis + k) % 3]);
        if sign < 0.0 {
            std::mem::swap(&mut u, &mut v);
        }
        let corner = half * (n * sign - u - v);
        let depth = DEPTH * half.min_element();
        let relief = |s: f64, t: f64| {
            let waves: f64 = waves.iter().map(|[a, b, phase]| (PI * (a * s + b * t) + phase).cos()).sum();
            depth * 0.25 * waves * (PI * s).sin() * (PI * t).sin()
        };
        rectangle(&mut out, [corner, 2.0 * half * u, 2.0 * half * v], squares, tint, relief);
    }
    out
}

fn materials() -> Vec<Material> {
    // The walls' own colours are those of their vertices; one sees them from outside as well.
    let lamp = Material { emission: [17.0, 12.0, 6.5], ..material([0.78; 3], 1.0, 0) };
    vec![material([1.0; 3], 1.0, MATERIAL_DOUBLE_SIDED), lamp, material([1.0; 3], 0.8, 0)]
}

struct Cornell {
    seed: u64,
    room: u32,
    /// Of the sides of each solid.
    squares: [[u32; 2]; 3],
    bounds: [[DVec3; 2]; 1],
}

impl Recipe for Cornell {
    fn mesh(&self, index: usize) -> Vec<Primitive> {
        let Some(of_solids) = index.checked_sub(1) else { return room(self.room) };
        let Solid { half, tint, .. } = solids()[of_solids];
        vec![solid(self.seed, of_solids as u32, half, tint, self.squares[of_solids])]
    }

    /// In the opening, swaying, the whole back of the room in view.
    fn near(&self, frames: u32) -> CameraPath {
        let keyframes = (0..frames).map(|k| {
            let time = f64::from(k);
            let position = [1.0 * (0.05 * time).sin(), 1.5 + 0.25 * (0.04 * time).sin(), 1.85];
            Keyframe { time, position, target: [0.0, 1.9, -1.0] }
        });
        CameraPath { fov_y_degrees: 75.0, up: path::UP, keyframes: keyframes.collect() }
    }

    /// From before the opening.
    fn far(&self) -> CameraPath {
        let middle = DVec3::new(0.0, HALF, 0.0);
        path::arc(middle, &self.bounds, 0.08, FRAC_PI_2 - 0.5 * FRAC_PI_6, FRAC_PI_6)
    }

    fn bounds(&self) -> &[[DVec3; 2]] {
        &self.bounds
    }

    /// The orbit, `steps` units of time long, and the box turning on its way.
    fn movers(&self, steps: u32) -> Vec<Mover> {
        let pose = |k: u32| {
            let time = f64::from(k);
            let turn = DQuat::from_euler(glam::EulerRot::YXZ, TAU * time / 8.0, TAU * time / 24.0, 0.0);
            Pose { time, translation: (orbit(time) - orbit(0.0)).to_array(), rotation: turn.to_array() }
        };
        vec![Mover { node: MOVER.into(), keyframes: (0..=steps).map(pose).collect() }]
    }
}

/// See [`crate::generate()`].
pub fn generate(settings: &Settings, progress: &Progress) -> Scene {
    let Settings { triangles, seed, .. } = *settings;
    // Squares along an edge, `sides` of which take about so many triangles.
    let edge = |share: f64, sides: f64| ((share * triangles as f64 / (2.0 * sides)).sqrt() as u32).max(1);
    let room_squares = edge(0.1, 5.0);
    let standing = edge(0.15, 6.0);
    let room_triangles = 10 * u64::from(room_squares).pow(2) + 2;
    let of_solid = |[columns, rows]: [u32; 2]| 12 * u64::from(columns) * u64::from(rows);
    let left = triangles.saturating_sub(room_triangles + 2 * of_solid([standing; 2]));
    let rows = ((left as f64 / 12.0).sqrt() as u32).max(1);
    let columns = ((left / (12 * u64::from(rows))) as u32).max(1);
    let squares = [[standing; 2], [standing; 2], [columns, rows]];
    let mut draft = Draft::new(materials(), settings);
    draft.outline.has_own_light = true;
    let mesh = draft.mesh("room".into(), [10 * room_squares.pow(2), 2]);
    draft.place("room".into(), mesh, IDENTITY);
    for (Solid { name, middle, turn, .. }, squares) in solids().into_iter().zip(squares) {
        let mesh = draft.mesh(name.into(), [of_solid(squares) as u32]);
        let place = DAffine3::from_rotation_translation(DQuat::from_rotation_y(turn), middle);
        draft.place(name.into(), mesh, matrix(&place));
        progress.advance(of_solid(squares));
    }
    let bounds = [[DVec3::new(-HALF, 0.0, -HALF), DVec3::new(HALF, 2.0 * HALF, HALF)]];
    Scene::new(draft.outline, Box::new(Cornell { seed, room: room_squares, squares, bounds }))
}

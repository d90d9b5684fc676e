//! What grows and lies on the land: trees, bushes, stones, patches of grass, each stored once and placed many times.

use super::height::{Land, WATER};
use super::way::{CLEAR, way_distance};
use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::Builder;
use crate::rng::Rng;
use crate::solid::{ball, rod};
use crate::vegetation::{Tree, bush, tree};
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// Edge of the cells in which things are strewn, metres.
pub const CELL: f64 = 8.0;

/// Kinds of things.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Conifer,
    Leafy,
    Bush,
    Boulder,
    Stones,
    Grass,
    Flowers,
    Log,
}

/// A thing that many places use.
pub struct Item {
    kind: Kind,
    /// Name.
    pub name: String,
    /// The mesh, its foot at the origin.
    pub mesh: Builder,
    /// Its triangles.
    pub triangles: u64,
}

/// A thing in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Use {
    /// Index of the item.
    pub item: usize,
    /// world_from_mesh.
    pub world_from_mesh: DAffine3,
}

/// The things of `seed`.
pub fn items(seed: u64) -> Vec<Item> {
    let kinds = [
        (Kind::Conifer, 6),
        (Kind::Leafy, 4),
        (Kind::Bush, 3),
        (Kind::Boulder, 5),
        (Kind::Stones, 3),
        (Kind::Grass, 6),
        (Kind::Flowers, 3),
        (Kind::Log, 1),
    ];
    let mut items = Vec::new();
    for (kind, count) in kinds {
        for k in 0..count {
            let mut rng = Rng::new(seed, &[40, kind as i64, k]);
            let mesh = item(&mut rng, kind);
            let name = format!("{kind:?} {k}").to_lowercase();
            items.push(Item { kind, name, triangles: mesh.triangles(), mesh });
        }
    }
    items
}

fn item(rng: &mut Rng, kind: Kind) -> Builder {
    let mut b = Builder::smooth();
    match kind {
        Kind::Conifer => tree(&mut b, rng, Tree::Conifer),
        Kind::Leafy => tree(&mut b, rng, Tree::Street),
        Kind::Bush => bush(&mut b, rng, DVec3::ZERO, 0.8),
        Kind::Boulder => stone(&mut b, rng, DVec3::ZERO, 1.0, 18),
        Kind::Stones => {
            for _ in 0..7 {
                let p = DVec3::new(rng.range(-1.2, 1.2), 0.0, rng.range(-1.2, 1.2));
                let size = rng.range(0.06, 0.3);
                stone(&mut b, rng, p, size, 6);
            }
        }
        Kind::Grass => grass(&mut b, rng, 130, [0.14, 0.4]),
        Kind::Flowers => flowers(&mut b, rng),
        Kind::Log => {
            let length = rng.range(2.0, 4.5);
            let (a, c) = (DVec3::new(-0.5 * length, 0.14, 0.0), DVec3::new(0.5 * length, 0.17, 0.2));
            rod(&mut b, Mat::Bark, shade(WHITE, 0.9), a, c, 0.17);
            for _ in 0..5 {
                let p = a + (c - a) * rng.unit();
                let d = (rng.direction() + DVec3::Y * 0.6).normalize() * rng.range(0.25, 0.6);
                b.tube(Mat::Bark, shade(WHITE, 0.8), [p, p + d], [0.05, 0.02], 6, true);
            }
        }
    }
    b
}

/// An irregular stone half in the ground.
fn stone(b: &mut Builder, rng: &mut Rng, o: DVec3, size: f64, rows: u32) {
    let planes: Vec<(DVec3, f64)> = (0..9).map(|_| (rng.direction(), rng.range(0.62, 0.95))).collect();
    let squash = DVec3::new(rng.range(0.8, 1.2), rng.range(0.55, 0.85), rng.range(0.8, 1.2)) * size;
    let waves: Vec<(DVec3, f64)> =
        (0..4).map(|_| (rng.direction() * rng.range(4.0, 11.0), rng.range(0.0, 6.0))).collect();
    let point = |d: DVec3| {
        // A ball cut by planes, their edges worn.
        let cut = planes.iter().map(|(n, h)| h / d.dot(*n).max(1e-3)).fold(1.0f64, f64::min);
        let bump: f64 = waves.iter().map(|(k, phase)| (k.dot(d) + phase).sin()).sum();
        o + d * (cut * (1.0 + 0.018 * bump)) * squash + DVec3::Y * (0.15 * size)
    };
    let tone = rng.range(0.75, 1.1);
    let base: Tint = rng.pick(&[[0.3, 0.285, 0.265], [0.26, 0.25, 0.24], [0.34, 0.31, 0.27]]);
    ball(b, Mat::Soil, rows, |d| {
        let moss = (0.9 * d.y + 0.25 * (7.0 * d.x + 3.0 * d.z).sin()).clamp(0.0, 1.0).powi(3) as f32;
        let [r, g, blue] = shade(base, tone * (0.8 + 0.2 * d.y));
        (point(d), [r + (0.12 - r) * 0.6 * moss, g + (0.15 - g) * 0.6 * moss, blue + (0.05 - blue) * 0.6 * moss])
    });
}

/// Blades of grass over a round patch.
fn grass(b: &mut Builder, rng: &mut Rng, count: u32, [low, high]: [f64; 2]) {
    for _ in 0..count {
        let r = 1.7 * rng.unit().sqrt();
        let (s, c) = rng.range(0.0, std::f64::consts::TAU).sin_cos();
        let p = DVec3::new(r * c, -0.05, r * s);
        let height = rng.range(low, high) * (1.0 - 0.3 * r / 1.7);
        let (s, c) = rng.range(0.0, std::f64::consts::TAU).sin_cos();
        let (side, lean) = (DVec3::new(c, 0.0, s) * rng.range(0.012, 0.022), DVec3::new(-s, 0.0, c) * (0.45 * height));
        let tint = shade(rng.pick(&[[0.9, 0.95, 0.6], [1.0, 0.95, 0.6], [0.8, 0.9, 0.6]]), rng.range(0.8, 1.0));
        let knee = p + DVec3::Y * (0.6 * height) + lean * 0.3;
        b.graded(Mat::Leaf, shade(tint, 0.6), tint, [p - side, p + side, knee + side * 0.7, knee - side * 0.7]);
        b.fan(Mat::Leaf, tint, &[knee - side * 0.7, knee + side * 0.7, p + DVec3::Y * height + lean]);
    }
}

fn flowers(b: &mut Builder, rng: &mut Rng) {
    grass(b, rng, 50, [0.12, 0.3]);
    let color = rng.pick(&[[0.8, 0.78, 0.72], [0.75, 0.55, 0.06], [0.4, 0.2, 0.6], [0.7, 0.12, 0.1]]);
    for _ in 0..14 {
        let r = 1.6 * rng.unit().sqrt();
        let (s, c) = rng.range(0.0, std::f64::consts::TAU).sin_cos();
        let (p, height) = (DVec3::new(r * c, 0.0, r * s), rng.range(0.15, 0.35));
        let top = p + DVec3::Y * height;
        b.tube(Mat::Leaf, [0.7, 0.8, 0.5], [p, top], [0.004, 0.003], 3, false);
        for k in 0..5 {
            let (s, c) = (f64::from(k) * 1.2566).sin_cos();
            let (out, side) = (DVec3::new(c, 0.35, s) * 0.032, DVec3::new(-s, 0.0, c) * 0.012);
            b.fan(Mat::Fabric, color, &[top, top + out * 0.6 + side, top + out, top + out * 0.6 - side]);
        }
    }
}

/// Strews what the cell (i, j) has: calls `put` with each thing.
pub fn strew(land: &Land, items: &[Item], seed: u64, i: i64, j: i64, mut put: impl FnMut(Use)) {
    let mut rng = Rng::new(seed, &[42, i, j]);
    let corner = DVec2::new(i as f64, j as f64) * CELL;
    for attempt in 0..9 {
        let q = corner + DVec2::new(rng.unit(), rng.unit()) * CELL;
        let mut own = rng.fork();
        let rng = &mut own;
        let p = DVec3::new(q.x, land.height(q), q.y);
        if p.y < WATER + 0.25 {
            continue;
        }
        let normal = land.normal(q, 0.6);
        let (snow, rock) = (land.snow(p, normal), land.rock(p, normal));
        let wood = land.smooth(20, q, 45.0) + 0.25 * (land.smooth(21, q, 9.0) - 0.5);
        let clear = way_distance(q);
        let kind = match attempt {
            0 | 1 => {
                // Woods in the valley and on the slopes, ever thinner toward the line where trees end.
                let chance = ((wood - 0.36) * 3.0).clamp(0.04, 0.85) * (1.0 - ((p.y - 25.0) / 55.0).clamp(0.0, 1.0));
                let shore = (clear + 4.0).min(1.0);
                if rock > 0.4 || snow > 0.5 || clear < CLEAR + 1.6 || !rng.chance(chance * shore) {
                    continue;
                }
                let leafy = rng.chance((0.55 - p.y / 22.0).clamp(0.02, 0.6));
                if leafy { Kind::Leafy } else { Kind::Conifer }
            }
            2 => {
                let chance = 0.05 + 0.3 * rock + 0.1 * snow;
                if clear < CLEAR + 1.4 || !rng.chance(chance) {
                    continue;
                }
                Kind::Boulder
            }
            3 => {
                if clear < CLEAR || !rng.chance(0.15 + 0.5 * rock) {
                    continue;
                }
                Kind::Stones
            }
            4 => {
                if rock > 0.3 || snow > 0.1 || clear < CLEAR + 1.0 || !rng.chance(0.16 * wood) {
                    continue;
                }
                if rng.chance(0.12) { Kind::Log } else { Kind::Bush }
            }
            _ => {
                if rock > 0.25 || snow > 0.2 || clear < 0.4 || !rng.chance(0.75 - 0.4 * (p.y / 70.0).clamp(0.0, 1.0)) {
                    continue;
                }
                if rng.chance(0.12) { Kind::Flowers } else { Kind::Grass }
            }
        };
        put(place(items, rng, kind, p, normal));
    }
}

/// A thing of `kind` at `p`.
fn place(items: &[Item], rng: &mut Rng, kind: Kind, p: DVec3, normal: DVec3) -> Use {
    let first = items.iter().position(|item| item.kind == kind).unwrap_or(0);
    let count = items.iter().filter(|item| item.kind == kind).count();
    let item = first + rng.int(0, count as i64 - 1) as usize;
    let (size, lean) = match kind {
        Kind::Conifer => (rng.range(0.55, 1.35), 0.05),
        Kind::Leafy => (rng.range(0.7, 1.15), 0.05),
        Kind::Bush => (rng.range(0.6, 1.4), 0.3),
        Kind::Boulder => (0.35 * 8.0f64.powf(rng.unit().powi(2)), 1.0),
        Kind::Stones => (rng.range(0.7, 1.5), 1.0),
        Kind::Grass | Kind::Flowers => (rng.range(0.8, 1.3), 1.0),
        Kind::Log => (rng.range(0.8, 1.2), 1.0),
    };
    let up = DVec3::Y.lerp(normal, lean).normalize();
    let (s, c) = rng.range(0.0, std::f64::consts::TAU).sin_cos();
    let n = DVec3::new(s, 0.0, c);
    let n = (n - up * n.dot(up)).normalize();
    let sink = match kind {
        Kind::Conifer | Kind::Leafy => 0.25 * (1.0 - normal.y) + 0.03,
        Kind::Boulder => 0.1 * size,
        _ => 0.01,
    };
    let matrix = DMat3::from_cols(up.cross(n), up, n) * size;
    Use { item, world_from_mesh: DAffine3::from_mat3_translation(matrix, p - DVec3::Y * sink) }
}

/// The thing that fills up what is left of a count: a log.
pub fn filler(items: &[Item]) -> usize {
    items.iter().position(|item| item.kind == Kind::Log).unwrap_or(0)
}

/// The log `item` on the ground at `q`.
pub fn lay(land: &Land, items: &[Item], rng: &mut Rng, q: DVec2) -> Use {
    place(items, rng, Kind::Log, DVec3::new(q.x, land.height(q), q.y), land.normal(q, 0.6))
}

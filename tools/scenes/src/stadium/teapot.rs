//! An ornate teapot of porcelain: five smooth surfaces over squares, displaced by flutes, beads and waves, as finely
//! divided as asked.

use crate::material::{Mat, Tint};
use crate::mesh::Builder;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Quads along the edge of a tile.
const TILE: usize = 128;

/// One of the surfaces, over u around and v along in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// From under the foot to the rim, and a little inside.
    Body,
    /// From its edge to the top of its knob.
    Lid,
    /// From inside the body to the lip, and back inside.
    Spout,
    /// From end to end, both in the body.
    Handle,
}

/// A surface, its division, and its share of what the teapot gets.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    surface: Surface,
    columns: usize,
    rows: usize,
}

/// A piece of a patch.
#[derive(Clone, Copy, Debug)]
pub struct Tile {
    patch: Patch,
    from: [usize; 2],
    to: [usize; 2],
}

impl Tile {
    /// Its triangles: a quad at a pole has one.
    pub fn triangles(&self) -> u32 {
        let [columns, rows] = [0, 1].map(|k| self.to[k] - self.from[k]);
        let poles = self.patch.surface.poles();
        let at_pole =
            usize::from(poles[0] && self.from[1] == 0) + usize::from(poles[1] && self.to[1] == self.patch.rows);
        (columns * (2 * rows - at_pole)) as u32
    }

    /// A name.
    pub fn name(&self) -> String {
        let place = self.from.map(|k| k / TILE);
        format!("teapot {:?} {} {}", self.patch.surface, place[0], place[1]).to_lowercase()
    }

    /// The mesh, the foot of the teapot at `o`.
    pub fn mesh(&self, o: DVec3) -> Builder {
        let Patch { surface, columns, rows } = self.patch;
        let mut b = Builder::smooth();
        let wide = [0, 1].map(|k| self.to[k] - self.from[k] + 1);
        let h = [0.25 / columns as f64, 0.25 / rows as f64];
        b.lattice(Mat::Ceramic, wide[1], wide[0], |row, column| {
            let (i, j) = (self.from[0] + column, self.from[1] + row);
            // The seam's two sides are the same points.
            let (u, v) = ((i % columns) as f64 / columns as f64, j as f64 / rows as f64);
            let (p, tint) = surface.at(u, v);
            let (v0, v1) = ((v - h[1]).max(0.0), (v + h[1]).min(1.0));
            // Beside a pole the tangent around vanishes; a little way off it does not.
            let near = v.clamp(h[1], 1.0 - h[1]);
            let along = surface.at(u, v1).0 - surface.at(u, v0).0;
            let around = surface.at(u + h[0], near).0 - surface.at(u - h[0], near).0;
            let n = around.normalize_or(DVec3::X).cross(along.normalize_or(DVec3::Y));
            (o + p, n.normalize_or(DVec3::Y), tint)
        });
        b
    }
}

/// Divides the teapot into at most `triangles` triangles, in tiles.
pub fn tiles(triangles: u64) -> Vec<Tile> {
    let shares = [
        (Surface::Body, 0.5, 1.55),
        (Surface::Lid, 0.16, 2.2),
        (Surface::Spout, 0.17, 1.0),
        (Surface::Handle, 0.17, 0.35),
    ];
    let mut tiles = Vec::new();
    let mut left = triangles;
    for (k, (surface, share, aspect)) in shares.into_iter().enumerate() {
        // The last gets what the others leave by rounding.
        let budget = if k + 1 == shares.len() { left as f64 } else { triangles as f64 * share };
        let columns = ((0.5 * budget * aspect).sqrt() as usize).max(6);
        let rows = ((0.5 * budget / columns as f64) as usize).max(6);
        let patch = Patch { surface, columns, rows };
        for j in (0..rows).step_by(TILE) {
            for i in (0..columns).step_by(TILE) {
                let tile = Tile { patch, from: [i, j], to: [(i + TILE).min(columns), (j + TILE).min(rows)] };
                left = left.saturating_sub(u64::from(tile.triangles()));
                tiles.push(tile);
            }
        }
    }
    tiles
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// 1 within `low..high`, 0 outside, with flanks of `soft`.
fn band(low: f64, high: f64, soft: f64, x: f64) -> f64 {
    smoothstep(low - soft, low + soft, x) * (1.0 - smoothstep(high - soft, high + soft, x))
}

/// The curve through `points`, uniform Catmull–Rom, at `t` in [0, 1].
fn curve<const N: usize>(points: &[[f64; N]], t: f64) -> [f64; N] {
    let last = points.len() - 1;
    let s = (t * last as f64).clamp(0.0, last as f64);
    let k = (s as usize).min(last - 1);
    let f = s - k as f64;
    let p = |d: isize| points[(k as isize + d).clamp(0, last as isize) as usize];
    std::array::from_fn(|c| {
        let [a, b, d, e] = [-1, 0, 1, 2].map(|d| p(d)[c]);
        b + 0.5 * f * (d - a + f * (2.0 * a - 5.0 * b + 4.0 * d - e + f * (3.0 * (b - d) + e - a)))
    })
}

const WHITE: Tint = [0.93, 0.92, 0.88];
const BLUE: Tint = [0.035, 0.07, 0.3];
const GOLD: Tint = [0.75, 0.47, 0.12];

fn mixed(a: Tint, b: Tint, t: f64) -> Tint {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t.clamp(0.0, 1.0) as f32)
}

/// Radius and height of the body, metres, from under the foot.
const BODY: [[f64; 2]; 15] = [
    [0.0, 0.006],
    [0.02, 0.006],
    [0.04, 0.005],
    [0.046, 0.0],
    [0.05, 0.003],
    [0.049, 0.011],
    [0.047, 0.017],
    [0.064, 0.03],
    [0.083, 0.052],
    [0.091, 0.078],
    [0.085, 0.105],
    [0.066, 0.127],
    [0.052, 0.136],
    [0.049, 0.142],
    [0.045, 0.134],
];

const LID: [[f64; 2]; 14] = [
    [0.0475, 0.131],
    [0.0485, 0.1385],
    [0.054, 0.1405],
    [0.053, 0.1445],
    [0.044, 0.149],
    [0.03, 0.156],
    [0.014, 0.161],
    [0.008, 0.166],
    [0.009, 0.17],
    [0.015, 0.176],
    [0.0165, 0.183],
    [0.0125, 0.19],
    [0.005, 0.194],
    [0.0, 0.1945],
];

/// Along the spout: x, y, radius.
const SPOUT: [[f64; 3]; 10] = [
    [0.06, 0.05, 0.024],
    [0.082, 0.054, 0.024],
    [0.1, 0.066, 0.02],
    [0.112, 0.085, 0.0155],
    [0.12, 0.106, 0.0125],
    [0.131, 0.125, 0.0108],
    [0.147, 0.138, 0.0112],
    [0.1505, 0.1405, 0.0102],
    [0.146, 0.137, 0.008],
    [0.13, 0.122, 0.0075],
];

/// Along the handle: x, y, radius.
const HANDLE: [[f64; 3]; 11] = [
    [-0.062, 0.122, 0.0085],
    [-0.08, 0.127, 0.0085],
    [-0.1, 0.136, 0.008],
    [-0.124, 0.138, 0.0075],
    [-0.143, 0.125, 0.0075],
    [-0.148, 0.102, 0.0078],
    [-0.14, 0.078, 0.008],
    [-0.122, 0.06, 0.0075],
    [-0.1, 0.05, 0.007],
    [-0.083, 0.047, 0.009],
    [-0.06, 0.05, 0.009],
];

impl Surface {
    /// Whether v = 0 and v = 1 are single points.
    fn poles(self) -> [bool; 2] {
        match self {
            Self::Body => [true, false],
            Self::Lid => [false, true],
            Self::Spout | Self::Handle => [false, false],
        }
    }

    /// Position and tint. Outside is on the side of (greater u) × (greater v).
    fn at(self, u: f64, v: f64) -> (DVec3, Tint) {
        match self {
            Self::Body => body(u, v),
            Self::Lid => lid(u, v),
            Self::Spout => spout(u, v),
            Self::Handle => handle(u, v),
        }
    }
}

/// A point of a surface of revolution: the profile displaced along its normal by `relief`.
fn revolved<const N: usize>(points: &[[f64; 2]; N], u: f64, v: f64, relief: f64) -> DVec3 {
    let e = 1e-4;
    let ([r, h], [r0, h0], [r1, h1]) =
        (curve(points, v), curve(points, (v - e).max(0.0)), curve(points, (v + e).min(1.0)));
    let length = (r1 - r0).hypot(h1 - h0).max(1e-12);
    // At the axis nothing is displaced sideways.
    let free = smoothstep(0.0, 0.004, r);
    let radius = (r + relief * free * (h1 - h0) / length).max(0.0);
    let (s, c) = (u * TAU).sin_cos();
    let radius = if points[if v < 0.5 { 0 } else { N - 1 }][0] == 0.0 && (v == 0.0 || v == 1.0) { 0.0 } else { radius };
    DVec3::new(radius * c, h - relief * free * (r1 - r0) / length, -radius * s)
}

/// Fine unevenness of the glaze, metres.
fn glaze(u: f64, v: f64) -> f64 {
    let wave = |a: f64, b: f64, phase: f64| (TAU * (a * u + b * v) + phase).sin();
    1.5e-5 * (wave(61.0, 83.0, 0.3) + wave(97.0, -59.0, 1.1) + wave(211.0, 127.0, 2.0) + 0.5 * wave(503.0, -317.0, 0.7))
}

fn body(u: f64, v: f64) -> (DVec3, Tint) {
    // Gadroons below, a frieze of scrolls at the widest, beads under the shoulder.
    let gadroon = band(0.47, 0.6, 0.03, v);
    let petal = (24.0 * PI * u).sin().abs();
    let frieze = band(0.615, 0.7, 0.006, v);
    let phase = 12.0 * TAU * u;
    let (x, y) = (phase.sin(), (v - 0.6575) / 0.03);
    let scroll = (1.0 - (y - 0.55 * x).abs() / 0.42).max(0.0).max((1.0 - (y + 0.55 * x).abs() / 0.42).max(0.0));
    let leaf = (1.0 - (y * y + (2.0 * phase).cos().mul_add(0.5, 0.5) * 1.6).sqrt() / 0.6).max(0.0);
    let beads = band(0.722, 0.742, 0.001, v);
    let bead = {
        let (a, c) = ((60.0 * u).fract() - 0.5, (v - 0.732) / 0.02);
        (0.25 - a * a - c * c).max(0.0).sqrt()
    };
    let rope = band(0.405, 0.43, 0.004, v) * (0.5 + 0.5 * (TAU * (72.0 * u + 40.0 * v)).sin());
    let flute = band(0.77, 0.86, 0.02, v) * (0.5 + 0.5 * (TAU * 36.0 * u).cos());
    let relief = 0.0035 * gadroon * petal.sqrt()
        + 0.0022 * frieze * smoothstep(0.0, 0.5, scroll.max(leaf))
        + 0.004 * beads * bead
        + 0.0015 * rope
        - 0.0012 * flute
        + glaze(u, v);
    let mut tint = mixed(WHITE, BLUE, frieze * (1.0 - smoothstep(0.02, 0.12, scroll.max(leaf))));
    tint = mixed(tint, BLUE, 0.9 * gadroon * smoothstep(0.45, 0.12, petal));
    tint = mixed(tint, GOLD, beads * smoothstep(0.1, 0.2, bead) + rope);
    tint = mixed(tint, GOLD, band(0.604, 0.612, 0.0015, v) + band(0.703, 0.711, 0.0015, v) + band(0.9, 0.96, 0.004, v));
    (revolved(&BODY, u, v, relief), tint)
}

fn lid(u: f64, v: f64) -> (DVec3, Tint) {
    let rays = band(0.3, 0.47, 0.025, v);
    let petal = (18.0 * PI * u).sin().abs();
    let knob = band(0.62, 0.97, 0.03, v);
    let spiral = 0.5 + 0.5 * (TAU * (9.0 * u + 5.0 * v)).sin();
    let relief = 0.0018 * rays * petal.sqrt() + 0.0012 * knob * spiral + glaze(u, v);
    let mut tint = mixed(WHITE, BLUE, 0.9 * rays * smoothstep(0.5, 0.15, petal));
    tint = mixed(tint, GOLD, band(0.14, 0.25, 0.01, v) + knob * smoothstep(0.35, 0.75, spiral));
    (revolved(&LID, u, v, relief), tint)
}

/// A point of a tube in the plane z = 0 along `points` of (x, y, radius), displaced by `relief`; its section is `wide`
/// times as wide as high.
fn swept(points: &[[f64; 3]], u: f64, v: f64, relief: f64, wide: f64) -> DVec3 {
    let e = 1e-4;
    let ([x, y, r], [x0, y0, _], [x1, y1, _]) =
        (curve(points, v), curve(points, (v - e).max(0.0)), curve(points, (v + e).min(1.0)));
    let t = DVec3::new(x1 - x0, y1 - y0, 0.0).normalize_or(DVec3::X);
    let n = DVec3::new(-t.y, t.x, 0.0);
    let (s, c) = (u * TAU).sin_cos();
    // Around such that outside is (around) × (along).
    DVec3::new(x, y, 0.0) + (n * c + t.cross(n) * (s * wide)) * (r + relief)
}

fn spout(u: f64, v: f64) -> (DVec3, Tint) {
    let ribs = band(0.12, 0.6, 0.06, v);
    let petal = (8.0 * PI * u + 5.0 * v).sin().abs();
    let scales = {
        let (a, c) = (14.0 * u, 46.0 * v);
        let shift = 0.5 * (c.floor() % 2.0);
        let (x, y) = ((a + shift).fract() - 0.5, c.fract());
        smoothstep(0.0, 0.25, 1.0 - y - 1.6 * x * x)
    };
    let scaled = band(0.18, 0.4, 0.02, v);
    let relief = 0.0011 * ribs * petal.sqrt() + 0.0005 * scaled * scales + glaze(u, v);
    let mut tint = mixed(WHITE, BLUE, 0.85 * ribs * smoothstep(0.4, 0.1, petal));
    tint = mixed(tint, BLUE, 0.5 * scaled * (1.0 - scales));
    tint = mixed(tint, GOLD, band(0.68, 0.84, 0.01, v));
    (swept(&SPOUT, u, v, relief, 1.0), tint)
}

fn handle(u: f64, v: f64) -> (DVec3, Tint) {
    let twist = band(0.18, 0.82, 0.05, v);
    let strand = (PI * (3.0 * u + 16.0 * v)).sin().abs();
    let rings = band(0.155, 0.17, 0.003, v) + band(0.83, 0.845, 0.003, v);
    let relief = 0.0016 * twist * (strand.sqrt() - 0.6) + 0.0014 * rings + glaze(u, v);
    let tint = mixed(mixed(WHITE, BLUE, 0.9 * twist * smoothstep(0.45, 0.15, strand)), GOLD, rings);
    (swept(&HANDLE, u, v, relief, 1.15), tint)
}

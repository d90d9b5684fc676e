//! Facades: walls divided into storeys and bays, with windows, doors, shops, ledges and balconies.

use super::style::{FRAMES, FacadeKind, Ground, Style};
use super::window::{Window, pane, reveal};
use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;

/// What a wall looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// A street: everything the style has.
    Street,
    /// A yard: plain windows.
    Rear,
    /// A neighbour: a blank wall.
    Party,
}

/// A wall of a building.
pub struct Wall<'a> {
    /// Origin at the left end of the wall's foot.
    pub frame: Frame,
    /// Length, metres.
    pub width: f64,
    /// What it looks at.
    pub side: Side,
    /// Whether ledges run around its left and right ends.
    pub joins: [bool; 2],
    /// Style of the building.
    pub style: &'a Style,
    /// Its own tint of the building's walls.
    pub tint: Tint,
}

impl Wall<'_> {
    fn wall(&self, b: &mut Builder, u: [f64; 2], v: [f64; 2]) {
        if u[1] - u[0] > 1e-6 && v[1] - v[0] > 1e-6 {
            b.panel(&self.frame, self.style.wall, self.tint, u, v, 0.0);
        }
    }

    /// A bar along the whole wall, `out` metres thick.
    pub fn ledge(&self, b: &mut Builder, v: [f64; 2], out: f64) {
        let s = self.style;
        let u = [if self.joins[0] { -out } else { 0.0 }, self.width + if self.joins[1] { out } else { 0.0 }];
        b.cuboid(&self.frame, s.trim, s.trim_tint, u, v, [0.0, out], face::ON_WALL);
    }

    /// A cornice below height `v`.
    pub fn cornice(&self, b: &mut Builder, v: f64, out: f64) {
        self.ledge(b, [v - 0.22, v], out);
        self.ledge(b, [v - 0.42, v - 0.22], 0.62 * out);
        self.ledge(b, [v - 0.75, v - 0.42], 0.25 * out);
        if self.side != Side::Street {
            return;
        }
        // Brackets under the cornice.
        let count = (self.width / 1.7).floor().max(1.0);
        for k in 0..count as u32 {
            let u = (f64::from(k) + 0.5) * self.width / count;
            let s = self.style;
            let faces = face::UPRIGHT | face::BOTTOM;
            b.cuboid(
                &self.frame,
                s.trim,
                s.trim_tint,
                [u - 0.09, u + 0.09],
                [v - 0.5, v - 0.22],
                [0.0, 0.9 * out],
                faces,
            );
        }
    }

    /// Storeys with floors at `base` + k × floor height.
    pub fn storeys(&self, b: &mut Builder, rng: &mut Rng, base: f64, floors: u32) {
        let s = self.style;
        let top = base + f64::from(floors) * s.floor;
        if floors == 0 {
            return;
        }
        if self.side == Side::Party || self.width < 2.0 {
            return self.blank(b, rng, base, top);
        }
        match s.kind {
            FacadeKind::Curtain => self.curtain(b, rng, base, floors),
            FacadeKind::Ribbon => self.ribbon(b, rng, base, floors),
            FacadeKind::Punched | FacadeKind::Loft => self.punched(b, rng, base, floors),
        }
        if s.ledges && self.side == Side::Street && s.kind != FacadeKind::Curtain {
            for k in 1..floors {
                let v = base + f64::from(k) * s.floor;
                self.ledge(b, [v - 0.09, v + 0.09], 0.09);
            }
        }
    }

    /// A wall without windows, or nearly.
    pub fn blank(&self, b: &mut Builder, rng: &mut Rng, base: f64, top: f64) {
        let s = self.style;
        let low = shade(self.tint, rng.range(0.8, 0.95));
        let f = &self.frame;
        b.graded(
            s.wall,
            low,
            self.tint,
            [f.at(0.0, base, 0.0), f.at(self.width, base, 0.0), f.at(self.width, top, 0.0), f.at(0.0, top, 0.0)],
        );
    }

    fn bays(&self) -> (u32, f64) {
        let count = (self.width / self.style.bay).round().max(1.0);
        (count as u32, self.width / count)
    }

    fn punched(&self, b: &mut Builder, rng: &mut Rng, base: f64, floors: u32) {
        let s = self.style;
        let (bays, pitch) = self.bays();
        let loft = s.kind == FacadeKind::Loft;
        let width = if loft { pitch - 0.75 } else { s.window_width.min(pitch - 0.7) };
        let street = self.side == Side::Street;
        let balconies: Vec<bool> = (0..bays).map(|_| street && rng.chance(s.balconies)).collect();
        for floor in 0..floors {
            let v = base + f64::from(floor) * s.floor;
            let (sill, head) = (v + s.sill, v + s.floor - s.head);
            self.wall(b, [0.0, self.width], [head, v + s.floor]);
            let mut left = 0.0;
            for bay in 0..bays {
                let center = (f64::from(bay) + 0.5) * pitch;
                let u = [center - 0.5 * width, center + 0.5 * width];
                let balcony = balconies[bay as usize] && (floor > 0 || s.solid_balconies);
                let low = if balcony { v + 0.12 } else { sill };
                self.wall(b, [left, u[0]], [v, head]);
                self.wall(b, u, [v, low]);
                left = u[1];
                let window = Window { sill: !balcony && s.sill > 0.3, full: street, ..Window::of(s, self.tint) };
                window.build(b, rng, &self.frame, u, [low, head]);
                if balcony {
                    self.balcony(b, rng, center, pitch.min(width + 1.3), v);
                } else if let (Some(tint), true) = (s.shutters, street) {
                    let leaf = (0.5 * width).min(0.5 * (pitch - width) - 0.06);
                    for side in [[u[0] - leaf - 0.03, u[0] - 0.03], [u[1] + 0.03, u[1] + leaf + 0.03]] {
                        let tint = shade(tint, rng.range(0.8, 1.0));
                        b.cuboid(&self.frame, Mat::Paint, tint, side, [low, head], [0.0, 0.05], face::ON_WALL);
                    }
                } else if s.sill <= 0.3 && street {
                    self.railing(b, &self.frame.moved(u[0], low, 0.0), width, 0.95, 0.06);
                }
                if !street && rng.chance(0.04) {
                    let v = [low - 0.65, low - 0.12];
                    b.cuboid(
                        &self.frame,
                        Mat::Metal,
                        shade(WHITE, 0.9),
                        [center, center + 0.8],
                        v,
                        [0.0, 0.4],
                        face::ON_WALL,
                    );
                }
            }
            self.wall(b, [left, self.width], [v, head]);
        }
    }

    fn ribbon(&self, b: &mut Builder, rng: &mut Rng, base: f64, floors: u32) {
        let s = self.style;
        let (bays, _) = self.bays();
        let f = &self.frame;
        let end = 0.35f64.min(0.1 * self.width);
        for floor in 0..floors {
            let v = base + f64::from(floor) * s.floor;
            let (sill, head) = (v + s.sill, v + s.floor - s.head);
            let (u0, u1) = (end, self.width - end);
            self.wall(b, [0.0, self.width], [v, sill]);
            self.wall(b, [0.0, self.width], [head, v + s.floor]);
            self.wall(b, [0.0, u0], [sill, head]);
            self.wall(b, [u1, self.width], [sill, head]);
            let reveal = [-s.recess, 0.0];
            b.cuboid(f, s.wall, self.tint, [u0, u1], [sill - 0.001, sill], reveal, face::TOP);
            b.cuboid(f, s.wall, self.tint, [u0, u1], [head, head + 0.001], reveal, face::BOTTOM);
            b.cuboid(f, s.wall, self.tint, [u0 - 0.001, u0], [sill, head], reveal, face::RIGHT);
            b.cuboid(f, s.wall, self.tint, [u1, u1 + 0.001], [sill, head], reveal, face::LEFT);
            let at = |k: u32| u0 + (u1 - u0) * f64::from(k) / f64::from(bays);
            for k in 0..bays {
                pane(b, rng, f, s.glass, [at(k), at(k + 1)], [sill, head], -s.recess);
                if k > 0 {
                    let u = [at(k) - 0.035, at(k) + 0.035];
                    let faces = if self.side == Side::Street { face::UPRIGHT } else { face::FRONT };
                    b.cuboid(f, Mat::Paint, s.frame_tint, u, [sill, head], [-s.recess, -s.recess + 0.07], faces);
                }
            }
            if self.side == Side::Street {
                b.cuboid(f, s.trim, s.trim_tint, [u0, u1], [sill - 0.06, sill], [0.0, 0.1], face::ON_WALL);
            }
        }
    }

    fn curtain(&self, b: &mut Builder, rng: &mut Rng, base: f64, floors: u32) {
        let s = self.style;
        let (bays, pitch) = self.bays();
        let f = &self.frame;
        let top = base + f64::from(floors) * s.floor;
        let spandrel = shade(WHITE, rng.range(0.55, 1.0));
        for floor in 0..floors {
            let v = base + f64::from(floor) * s.floor;
            b.panel(f, s.glass, spandrel, [0.0, self.width], [v, v + s.sill], 0.0);
            b.cuboid(
                f,
                Mat::Paint,
                s.frame_tint,
                [0.0, self.width],
                [v + s.sill - 0.05, v + s.sill + 0.05],
                [0.0, 0.06],
                face::LEVEL,
            );
            for k in 0..bays {
                let u = [f64::from(k) * pitch, if k + 1 == bays { self.width } else { f64::from(k + 1) * pitch }];
                pane(b, rng, f, s.glass, u, [v + s.sill, v + s.floor], 0.0);
            }
        }
        let fins = rng.chance(0.5);
        for k in 0..=bays {
            let u = f64::from(k) * pitch;
            let out = if fins { 0.22 } else { 0.07 };
            b.cuboid(f, Mat::Paint, s.frame_tint, [u - 0.04, u + 0.04], [base, top], [0.0, out], face::UPRIGHT);
        }
    }

    /// A balcony of width `width` around `center` at floor `v`.
    fn balcony(&self, b: &mut Builder, rng: &mut Rng, center: f64, width: f64, v: f64) {
        let s = self.style;
        let (u0, u1) = (center - 0.5 * width, center + 0.5 * width);
        let depth = if s.solid_balconies { 1.2 } else { 0.8 };
        b.cuboid(&self.frame, s.trim, s.trim_tint, [u0, u1], [v - 0.08, v + 0.1], [0.0, depth], face::ON_WALL);
        if s.solid_balconies {
            let glass = rng.chance(0.2);
            let (m, tint) = if glass { (Mat::Glass, [0.9; 3]) } else { (s.trim, shade(s.trim_tint, 0.9)) };
            let v = [v + 0.1, v + 1.05];
            b.cuboid(&self.frame, m, tint, [u0, u1], v, [depth - 0.1, depth], face::STANDING);
            for u in [[u0, u0 + 0.1], [u1 - 0.1, u1]] {
                b.cuboid(&self.frame, m, tint, u, v, [0.0, depth - 0.1], face::LEFT | face::RIGHT | face::TOP);
            }
        } else {
            for u in [u0 + 0.2, u1 - 0.4] {
                let faces = face::UPRIGHT | face::BOTTOM;
                b.cuboid(
                    &self.frame,
                    s.trim,
                    s.trim_tint,
                    [u, u + 0.2],
                    [v - 0.35, v - 0.08],
                    [0.0, 0.5 * depth],
                    faces,
                );
            }
            self.railing(b, &self.frame.moved(u0, v + 0.1, depth - 0.04), u1 - u0, 0.95, 0.13);
            for u in [u0, u1 - 0.04] {
                for v in [v + 0.2, v + 1.0] {
                    b.cuboid(
                        &self.frame,
                        Mat::Paint,
                        [0.05; 3],
                        [u, u + 0.04],
                        [v, v + 0.04],
                        [0.0, depth],
                        face::LEFT | face::RIGHT | face::TOP,
                    );
                }
            }
        }
    }

    /// Iron bars from u = 0 to `width` in the plane of `f`.
    fn railing(&self, b: &mut Builder, f: &Frame, width: f64, height: f64, gap: f64) {
        let iron = [0.05; 3];
        let gap = gap.max(0.16);
        let count = (width / gap).floor().max(1.0);
        for v in [0.08, height - 0.05] {
            b.cuboid(f, Mat::Paint, iron, [0.0, width], [v, v + 0.05], [0.0, 0.04], face::LEVEL);
        }
        for k in 0..=count as u32 {
            let u = f64::from(k) * (width - 0.02) / count;
            b.cuboid(f, Mat::Paint, iron, [u, u + 0.02], [0.0, height - 0.05], [0.01, 0.03], face::FRONT);
        }
    }

    /// The ground floor, from the foot to `height`.
    pub fn ground_floor(&self, b: &mut Builder, rng: &mut Rng, height: f64) {
        let s = self.style;
        if self.side == Side::Party || self.width < 2.0 {
            return self.blank(b, rng, 0.0, height);
        }
        let wide = match (self.side, s.ground) {
            (Side::Rear, _) | (_, Ground::Dwelling) => 3.0,
            (_, Ground::Shops) => 4.2,
            (_, Ground::Lobby) => 2.6,
        };
        let bays = (self.width / wide).round().max(1.0) as u32;
        let pitch = self.width / f64::from(bays);
        let door = rng.int(0, i64::from(bays) - 1) as u32;
        let sign = rng.fork();
        for bay in 0..bays {
            let u = [f64::from(bay) * pitch, if bay + 1 == bays { self.width } else { f64::from(bay + 1) * pitch }];
            match (self.side, s.ground) {
                _ if bay == door => self.entrance(b, rng, u, height),
                (Side::Rear, _) | (_, Ground::Dwelling) => self.ground_window(b, rng, u, height),
                (_, Ground::Shops) => self.shop(b, rng, &mut sign.clone(), u, height),
                (_, Ground::Lobby) => self.lobby(b, rng, u, height),
            }
        }
        if self.side == Side::Street {
            self.ledge(b, [height - 0.12, height + 0.12], 0.14);
            if s.ground == Ground::Dwelling {
                b.panel(&self.frame, Mat::Stone, shade(WHITE, 0.6), [0.0, self.width], [0.0, 0.45], 0.02);
            }
        }
    }

    /// An opening in the ground floor: the wall around it.
    fn around(&self, b: &mut Builder, u: [f64; 2], height: f64, hole_u: [f64; 2], hole_v: [f64; 2]) {
        let s = self.style;
        let mut part = |u: [f64; 2], v: [f64; 2]| {
            if u[1] - u[0] > 1e-6 && v[1] - v[0] > 1e-6 {
                let f = &self.frame;
                let low = if v[0] == 0.0 { shade(self.tint, 0.82) } else { self.tint };
                let quad = [f.at(u[0], v[0], 0.0), f.at(u[1], v[0], 0.0), f.at(u[1], v[1], 0.0), f.at(u[0], v[1], 0.0)];
                b.graded(s.wall, low, self.tint, quad);
            }
        };
        part([u[0], hole_u[0]], [0.0, height]);
        part([hole_u[1], u[1]], [0.0, height]);
        part(hole_u, [0.0, hole_v[0]]);
        part(hole_u, [hole_v[1], height]);
    }

    fn ground_window(&self, b: &mut Builder, rng: &mut Rng, u: [f64; 2], height: f64) {
        let s = self.style;
        let center = 0.5 * (u[0] + u[1]);
        let width = s.window_width.min(u[1] - u[0] - 0.7);
        let hole = [center - 0.5 * width, center + 0.5 * width];
        let v = [1.1, (height - 0.7).min(2.9)];
        self.around(b, u, height, hole, v);
        let window = Window { sill: true, full: self.side == Side::Street, ..Window::of(s, self.tint) };
        window.build(b, rng, &self.frame, hole, v);
    }

    fn entrance(&self, b: &mut Builder, rng: &mut Rng, u: [f64; 2], height: f64) {
        let s = self.style;
        let f = &self.frame;
        let street = self.side == Side::Street;
        let center = 0.5 * (u[0] + u[1]);
        let half = if street && s.ground != Ground::Dwelling { 0.85 } else { 0.55 };
        let half = f64::min(half, 0.5 * (u[1] - u[0]) - 0.3);
        let (hole, top) = ([center - half, center + half], (height - 0.6).min(2.9));
        self.around(b, u, height, hole, [0.0, top]);
        let depth = 0.4;
        reveal(b, f, s.wall, shade(self.tint, 0.85), hole, [0.0, top], depth);
        let paint = shade(
            rng.pick(&[[0.20, 0.07, 0.04], [0.05, 0.12, 0.08], [0.06, 0.09, 0.18], [0.35, 0.22, 0.12], [0.04; 3]]),
            1.0,
        );
        let leaf_top = 2.15f64.min(top - 0.3);
        b.panel(f, s.glass, WHITE, hole, [leaf_top, top], -depth);
        b.cuboid(f, Mat::Paint, paint, hole, [leaf_top, leaf_top + 0.08], [-depth, -depth + 0.08], face::LEVEL);
        let leaves = if half > 0.7 { 2 } else { 1 };
        for k in 0..leaves {
            let at = |t: f64| hole[0] + 2.0 * half * (f64::from(k) + t) / f64::from(leaves);
            b.cuboid(
                f,
                Mat::Paint,
                paint,
                [at(0.01), at(0.99)],
                [0.02, leaf_top],
                [-depth, -depth + 0.05],
                face::ON_WALL,
            );
            if street {
                let inner = [at(0.18), at(0.82)];
                b.panel(f, s.glass, shade(WHITE, 0.9), inner, [1.0, leaf_top - 0.2], -depth + 0.052);
                b.panel(f, Mat::Paint, shade(paint, 0.7), inner, [0.2, 0.85], -depth + 0.052);
                b.cuboid(
                    f,
                    Mat::Metal,
                    WHITE,
                    [at(0.88), at(0.92)],
                    [0.9, 1.2],
                    [-depth + 0.05, -depth + 0.1],
                    face::ON_WALL,
                );
            }
        }
        if street {
            for side in [[hole[0] - 0.2, hole[0]], [hole[1], hole[1] + 0.2]] {
                b.cuboid(f, s.trim, s.trim_tint, side, [0.0, top], [0.0, 0.08], face::UPRIGHT | face::TOP);
            }
            b.cuboid(
                f,
                s.trim,
                s.trim_tint,
                [hole[0] - 0.3, hole[1] + 0.3],
                [top, top + 0.25],
                [0.0, 0.18],
                face::ON_WALL,
            );
            b.cuboid(
                f,
                Mat::Stone,
                shade(WHITE, 0.85),
                [hole[0] - 0.1, hole[1] + 0.1],
                [0.0, 0.1],
                [0.0, 0.35],
                face::ON_WALL,
            );
        }
    }

    fn shop(&self, b: &mut Builder, rng: &mut Rng, sign: &mut Rng, u: [f64; 2], height: f64) {
        let s = self.style;
        let f = &self.frame;
        let hole = [u[0] + 0.3, u[1] - 0.3];
        let v = [0.45, height - 1.05];
        self.around(b, u, height, hole, v);
        let frame = sign.pick(&FRAMES);
        let window = Window {
            sill: false,
            full: true,
            recess: 0.3,
            panes: [3, 1],
            frame,
            blinds: false,
            ..Window::of(s, self.tint)
        };
        window.build(b, rng, f, hole, v);
        let board = sign.pick(&[
            [0.45, 0.06, 0.05],
            [0.05, 0.16, 0.10],
            [0.05, 0.08, 0.22],
            [0.7, 0.62, 0.4],
            [0.06; 3],
            [0.55, 0.33, 0.05],
        ]);
        let signs = [hole[0] - 0.1, hole[1] + 0.1];
        b.cuboid(f, Mat::Paint, board, signs, [v[1] + 0.12, v[1] + 0.7], [0.0, 0.12], face::ON_WALL);
        // Letters, as upright strokes.
        let letters = rng.int(4, 9);
        let size = 0.32;
        let start = 0.5 * (signs[0] + signs[1]) - 0.5 * letters as f64 * size;
        let ink = if board[0] + board[1] > 0.9 { [0.08; 3] } else { [0.9, 0.88, 0.8] };
        for k in 0..letters {
            let left = start + k as f64 * size;
            let (v0, wide) = (v[1] + 0.26, rng.range(0.1, 0.22));
            b.panel(f, Mat::Paint, ink, [left, left + 0.06], [v0, v0 + 0.3], 0.125);
            let bar = v0 + rng.pick(&[0.0, 0.12, 0.24]);
            b.panel(f, Mat::Paint, ink, [left + 0.06, left + wide], [bar, bar + 0.06], 0.125);
        }
        if sign.chance(0.55) {
            self.awning(b, sign, hole, v[1] + 0.08);
        }
    }

    fn awning(&self, b: &mut Builder, rng: &mut Rng, u: [f64; 2], v: f64) {
        let f = &self.frame;
        let tint = rng.pick(&[[0.6, 0.08, 0.07], [0.08, 0.28, 0.16], [0.10, 0.16, 0.40], [0.75, 0.55, 0.2], [0.5; 3]]);
        let count = ((u[1] - u[0]) / 0.45).round().max(1.0);
        for k in 0..count as u32 {
            let at = |k: u32| u[0] + (u[1] - u[0]) * f64::from(k) / count;
            let tint = if k % 2 == 0 { tint } else { [0.92, 0.90, 0.85] };
            let (a, c) = (at(k), at(k + 1));
            b.fan(
                Mat::Fabric,
                tint,
                &[f.at(a, v - 0.55, 1.25), f.at(c, v - 0.55, 1.25), f.at(c, v, 0.02), f.at(a, v, 0.02)],
            );
            b.fan(
                Mat::Fabric,
                tint,
                &[f.at(a, v - 0.75, 1.25), f.at(c, v - 0.75, 1.25), f.at(c, v - 0.55, 1.25), f.at(a, v - 0.55, 1.25)],
            );
        }
    }

    fn lobby(&self, b: &mut Builder, rng: &mut Rng, u: [f64; 2], height: f64) {
        let s = self.style;
        let hole = [u[0] + 0.2, u[1] - 0.2];
        let v = [0.12, height - 0.6];
        self.around(b, u, height, hole, v);
        let window =
            Window { sill: false, full: true, recess: 0.45, panes: [2, 2], blinds: false, ..Window::of(s, self.tint) };
        window.build(b, rng, &self.frame, hole, v);
    }
}

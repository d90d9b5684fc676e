//! Windows and the openings they sit in.

use super::style::Style;
use crate::material::{Mat, Tint, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;

/// The four sides of an opening, `depth` deep.
pub fn reveal(b: &mut Builder, f: &Frame, m: Mat, tint: Tint, [u0, u1]: [f64; 2], [v0, v1]: [f64; 2], depth: f64) {
    let dark = shade(tint, 0.9);
    b.fan(m, tint, &[f.at(u0, v0, 0.0), f.at(u1, v0, 0.0), f.at(u1, v0, -depth), f.at(u0, v0, -depth)]);
    b.fan(m, dark, &[f.at(u0, v1, -depth), f.at(u1, v1, -depth), f.at(u1, v1, 0.0), f.at(u0, v1, 0.0)]);
    b.fan(m, dark, &[f.at(u0, v0, 0.0), f.at(u0, v0, -depth), f.at(u0, v1, -depth), f.at(u0, v1, 0.0)]);
    b.fan(m, dark, &[f.at(u1, v0, -depth), f.at(u1, v0, 0.0), f.at(u1, v1, 0.0), f.at(u1, v1, -depth)]);
}

/// A pane of glass, each a little different from the next.
pub fn pane(b: &mut Builder, rng: &mut Rng, f: &Frame, m: Mat, u: [f64; 2], v: [f64; 2], w: f64) {
    let low = shade([0.75, 0.8, 0.85], rng.range(0.5, 1.0));
    let quad = [f.at(u[0], v[0], w), f.at(u[1], v[0], w), f.at(u[1], v[1], w), f.at(u[0], v[1], w)];
    b.graded(m, low, shade(low, 1.15), quad);
}

/// A window in a hole of a wall.
pub struct Window {
    /// Material of the reveal.
    pub wall: Mat,
    /// Its tint.
    pub tint: Tint,
    /// Glass.
    pub glass: Mat,
    /// Tint of the frame.
    pub frame: Tint,
    /// Depth in the wall, metres.
    pub recess: f64,
    /// Panes across and up.
    pub panes: [u32; 2],
    /// With a sill.
    pub sill: bool,
    /// With everything else that the street sees.
    pub full: bool,
    /// Some with blinds or curtains.
    pub blinds: bool,
    /// Material of a frame of stone around it.
    pub surround: Option<(Mat, Tint)>,
    /// Material of the sill.
    pub trim: (Mat, Tint),
}

impl Window {
    /// The windows of a style, in a wall of tint `tint`.
    pub fn of(s: &Style, tint: Tint) -> Self {
        Self {
            wall: s.wall,
            tint,
            glass: s.glass,
            frame: s.frame_tint,
            recess: s.recess,
            panes: s.panes,
            sill: true,
            full: true,
            blinds: true,
            surround: s.surrounds.then_some((s.trim, s.trim_tint)),
            trim: (s.trim, s.trim_tint),
        }
    }

    /// Builds it into the hole `u` × `v`.
    pub fn build(&self, b: &mut Builder, rng: &mut Rng, f: &Frame, u: [f64; 2], v: [f64; 2]) {
        let w = -self.recess;
        reveal(b, f, self.wall, shade(self.tint, 0.92), u, v, self.recess);
        pane(b, rng, f, self.glass, u, v, w);
        if self.blinds && rng.chance(0.35) {
            let cloth =
                shade(rng.pick(&[[0.8, 0.77, 0.7], [0.7, 0.72, 0.74], [0.75, 0.62, 0.45]]), rng.range(0.6, 1.0));
            if rng.chance(0.6) {
                let low = v[1] - (v[1] - v[0]) * rng.range(0.15, 0.85);
                b.panel(f, Mat::Fabric, cloth, u, [low, v[1]], w + 0.004);
            } else {
                let part = 0.28 * (u[1] - u[0]);
                b.panel(f, Mat::Fabric, cloth, [u[0], u[0] + part], v, w + 0.004);
                b.panel(f, Mat::Fabric, cloth, [u[1] - part, u[1]], v, w + 0.004);
            }
        }
        let (t, front) = (0.07, w + 0.05);
        let bar = |b: &mut Builder, u: [f64; 2], v: [f64; 2], faces: u8| {
            b.cuboid(f, Mat::Paint, self.frame, u, v, [w, front], faces);
        };
        if self.full {
            bar(b, u, [v[0], v[0] + t], face::FRONT | face::TOP);
            bar(b, u, [v[1] - t, v[1]], face::FRONT);
            bar(b, [u[0], u[0] + t], [v[0] + t, v[1] - t], face::FRONT);
            bar(b, [u[1] - t, u[1]], [v[0] + t, v[1] - t], face::FRONT);
        } else {
            let middle = 0.5 * (v[0] + v[1]);
            bar(b, u, [middle - 0.03, middle + 0.03], face::FRONT);
        }
        let [across, up] = self.panes;
        for k in 1..across {
            let at = u[0] + (u[1] - u[0]) * f64::from(k) / f64::from(across);
            bar(
                b,
                [at - 0.025, at + 0.025],
                [v[0] + t, v[1] - t],
                if self.full && across < 3 { face::UPRIGHT } else { face::FRONT },
            );
        }
        if self.full {
            for k in 1..up {
                let at = v[0] + (v[1] - v[0]) * f64::from(k) / f64::from(up);
                bar(b, [u[0] + t, u[1] - t], [at - 0.025, at + 0.025], face::FRONT);
            }
        }
        if self.sill {
            let faces = if self.full { face::LEVEL } else { face::FRONT | face::TOP };
            b.cuboid(f, self.trim.0, self.trim.1, [u[0] - 0.08, u[1] + 0.08], [v[0] - 0.08, v[0]], [0.0, 0.12], faces);
        }
        if let (Some((m, tint)), true) = (self.surround, self.full) {
            for (side, outer) in [([u[0] - 0.14, u[0]], face::LEFT), ([u[1], u[1] + 0.14], face::RIGHT)] {
                b.cuboid(f, m, tint, side, v, [0.0, 0.05], face::FRONT | outer);
            }
            b.cuboid(f, m, tint, [u[0] - 0.2, u[1] + 0.2], [v[1], v[1] + 0.18], [0.0, 0.1], face::LEVEL);
        }
    }
}

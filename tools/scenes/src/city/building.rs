//! Buildings: storeys, setbacks, and what closes them above.

use super::facade::{Side, Wall};
use super::layout::{KERB, NORTH, Rect, SOUTH};
use super::plan::Plan;
use super::roof;
use super::style::{FacadeKind, RoofKind, Style};
use crate::material::{Mat, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;

/// A part of a building with vertical walls.
struct Prism<'a> {
    plan: &'a Plan,
    style: &'a Style,
    base: f64,
    floors: u32,
    /// Starts with a ground floor.
    ground: bool,
}

impl Prism<'_> {
    fn height(&self) -> f64 {
        let ground = if self.ground { self.style.ground_floor } else { 0.0 };
        ground + f64::from(self.floors) * self.style.floor
    }

    /// Builds the walls and returns the height of their top.
    fn build(&self, b: &mut Builder, rng: &mut Rng, cornice: bool) -> f64 {
        let style = self.style;
        let party = shade(style.wall_tint, rng.range(0.75, 0.95));
        for k in 0..self.plan.corners.len() {
            let (frame, width) = self.plan.wall(k, self.base);
            let side = self.plan.sides[k];
            let tint = if side == Side::Street { style.wall_tint } else { party };
            let wall = Wall { frame, width, side, joins: self.plan.joins(k), style, tint };
            let mut storeys = 0.0;
            if self.ground {
                wall.ground_floor(b, rng, style.ground_floor);
                storeys = style.ground_floor;
            }
            wall.storeys(b, rng, storeys, self.floors);
            if cornice && style.cornice > 0.0 && side != Side::Party {
                let out = if side == Side::Street { style.cornice } else { 0.15 };
                wall.cornice(b, self.height(), out);
            }
        }
        self.base + self.height()
    }
}

/// A house in a row: `floors` storeys above the ground floor.
pub fn row_house(b: &mut Builder, rng: &mut Rng, lot: Rect, sides: [Side; 4], floors: u32, style: &Style) {
    let mut plan = Plan::rect(lot, sides);
    let corner = (0..4).find(|&k| sides[k] == Side::Street && sides[(k + 3) % 4] == Side::Street);
    if let Some(k) = corner
        && style.roof != RoofKind::Gable
        && rng.chance(0.4)
    {
        plan.chamfer(k, rng.range(1.8, 2.8));
    }
    let stepped = floors >= 6 && rng.chance(0.5);
    let upper = if stepped { rng.int(1, 3) as u32 } else { 0 };
    let lower = Prism { plan: &plan, style, base: KERB, floors: floors - upper, ground: true };
    let top = lower.build(b, rng, true);
    if stepped {
        let small = plan.set_back(rng.range(1.6, 2.6), rng.range(0.8, 1.6));
        roof::terrace(b, rng, &plan, &small, top, style);
        let penthouse = Prism { plan: &small, style, base: top, floors: upper, ground: false };
        let top = penthouse.build(b, rng, false);
        roof::flat(b, rng, &small, top, style, true);
        return;
    }
    match style.roof {
        RoofKind::Mansard => roof::mansard(b, rng, &plan, top, style),
        RoofKind::Gable if corner.is_none() => {
            let along_x = sides[SOUTH] != Side::Party || sides[NORTH] != Side::Party;
            roof::gable(b, rng, lot, along_x, sides.map(|s| s == Side::Party), top, style);
        }
        _ => roof::flat(b, rng, &plan, top, style, true),
    }
}

/// A long building that stands alone.
pub fn slab(b: &mut Builder, rng: &mut Rng, rect: Rect, floors: u32, style: &Style) {
    let plan = Plan::rect(rect, [Side::Street; 4]);
    let top = Prism { plan: &plan, style, base: KERB, floors, ground: true }.build(b, rng, true);
    roof::flat(b, rng, &plan, top, style, true);
}

/// A detached house with a gable roof.
pub fn house(b: &mut Builder, rng: &mut Rng, rect: Rect, front: usize, floors: u32, style: &Style) {
    let mut sides = [Side::Rear; 4];
    sides[front] = Side::Street;
    let plan = Plan::rect(rect, sides);
    let top = Prism { plan: &plan, style, base: KERB, floors, ground: true }.build(b, rng, false);
    let along_x = rect.width() > rect.depth();
    roof::gable(b, rng, rect, along_x, [false; 4], top, style);
}

/// A tower of about `floors` storeys: a lobby, a shaft in up to three tiers, machine rooms, a mast.
pub fn tower(b: &mut Builder, rng: &mut Rng, rect: Rect, floors: u32, style: &Style) {
    let mut plan = Plan::rect(rect, [Side::Street; 4]);
    if rng.chance(0.4) {
        let cut = 0.2 * rect.width().min(rect.depth());
        for k in (0..4).rev() {
            plan.chamfer(k, cut);
        }
    }
    let tiers = if floors > 14 { rng.int(1, 3) as u32 } else { 1 };
    let mut base = KERB;
    let mut left = floors;
    for tier in 0..tiers {
        let share = if tier + 1 == tiers { left } else { left * 3 / 5 };
        left -= share;
        let last = tier + 1 == tiers;
        let top = Prism { plan: &plan, style, base, floors: share, ground: tier == 0 }.build(b, rng, false);
        if last {
            roof::flat(b, rng, &plan, top, style, false);
            crown(b, rng, &plan, top, style);
        } else {
            let small = plan.set_back(rng.range(1.6, 2.4), 0.0);
            roof::terrace(b, rng, &plan, &small, top, style);
            plan = small;
        }
        base = top;
    }
}

/// Machine rooms behind louvres and a mast.
fn crown(b: &mut Builder, rng: &mut Rng, plan: &Plan, y: f64, style: &Style) {
    let core = plan.core();
    let rooms = core.shrunk([0.2 * core.depth(), 0.2 * core.width(), 0.2 * core.depth(), 0.2 * core.width()]);
    let height = rng.range(3.0, 5.5);
    let corners = rooms.polygon();
    for k in 0..4 {
        let (f, width) = Frame::wall(corners[k], corners[(k + 1) % 4], y);
        b.panel(&f, Mat::Concrete, shade(WHITE, 0.6), [0.0, width], [0.0, height], 0.0);
        for s in 0..(height / 0.35) as u32 {
            let v = 0.2 + f64::from(s) * 0.35;
            if v + 0.2 < height {
                let tint = shade(style.trim_tint, 0.6);
                b.cuboid(&f, Mat::Metal, tint, [0.1, width - 0.1], [v, v + 0.1], [0.0, 0.12], face::LEVEL);
            }
        }
    }
    super::street::flat(b, Mat::Gravel, shade(WHITE, 0.9), rooms, y + height);
    let c = rooms.center();
    let foot = glam::DVec3::new(c.x, y + height, c.y);
    let mast = rng.range(6.0, 18.0);
    let glass = style.kind == FacadeKind::Curtain;
    if glass || rng.chance(0.5) {
        let mid = foot + glam::DVec3::Y * (0.6 * mast);
        b.tube(Mat::Metal, shade(WHITE, 0.7), [foot, mid], [0.28, 0.16], 8, false);
        b.tube(Mat::Paint, [0.7, 0.08, 0.06], [mid, foot + glam::DVec3::Y * mast], [0.16, 0.05], 8, true);
    }
}

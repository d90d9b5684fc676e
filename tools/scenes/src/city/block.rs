//! Blocks: what stands on the lots of a cell, on its pavements and on its half of the streets.

use super::building;
use super::facade::Side;
use super::furniture as things;
use super::layout::{CORNER, EAST, KERB, NORTH, PAVEMENT, Rect, SOUTH, WEST, Zone, on_ground};
use super::open;
use super::site::Site;
use super::street;
use super::style::Style;
use super::vehicle::Vehicle;
use crate::material::{Mat, WHITE, shade};
use crate::mesh::Frame;
use crate::rng::Rng;
use crate::vegetation::{self, Tree};
use glam::{DVec2, DVec3};

/// Builds the block of `site`.
pub fn block(site: &mut Site, seed: u64) {
    let cell = site.cell;
    let mut rng = Rng::new(seed, &[5, cell.i, cell.j]);
    site.piece(&mut rng, |b, rng| street::cell_ground(b, rng, &cell));
    match cell.zone {
        Zone::Perimeter => perimeter(site, &mut rng),
        Zone::Towers => towers(site, &mut rng),
        Zone::Slabs => slabs(site, &mut rng),
        Zone::Houses => houses(site, &mut rng),
        Zone::Park => open::park(site, &mut rng),
        Zone::Plaza => open::plaza(site, &mut rng),
    }
    traffic_lights(site, &mut rng);
    pavement(site, &mut rng);
    traffic(site, &mut rng);
}

/// Cuts `from..to` into pieces of about `size`.
fn split(rng: &mut Rng, from: f64, to: f64, size: f64) -> Vec<[f64; 2]> {
    let count = ((to - from) / size).round().max(1.0) as usize;
    let weights: Vec<f64> = (0..count).map(|_| rng.range(0.75, 1.3)).collect();
    let total: f64 = weights.iter().sum();
    let mut at = from;
    let mut sum = 0.0;
    weights
        .iter()
        .enumerate()
        .map(|(k, w)| {
            sum += w;
            let end = if k + 1 == count { to } else { from + (to - from) * sum / total };
            let piece = [at, end];
            at = end;
            piece
        })
        .collect()
}

fn perimeter(site: &mut Site, rng: &mut Rng) {
    let lots = site.cell.lots();
    let density = site.cell.density;
    let (yard_mat, dark) = rng.pick(&[(Mat::Paving, 0.75), (Mat::Grass, 0.8), (Mat::Sand, 0.8)]);
    site.piece(rng, |b, rng| street::ground(b, rng, yard_mat, lots, KERB, 7.0, dark));
    let usual = 1.5 + 3.4 * density + rng.range(-0.6, 0.9);
    let depths = [0; 4].map(|_| rng.range(10.5, 13.0));
    let yard = lots.shrunk(depths);
    let mut rows: Vec<(Rect, [Side; 4])> = Vec::new();
    for k in [NORTH, SOUTH] {
        let (z0, z1) = if k == NORTH { (lots.z0, yard.z0) } else { (yard.z1, lots.z1) };
        let pieces = split(rng, lots.x0, lots.x1, 15.5);
        for (s, [x0, x1]) in pieces.iter().copied().enumerate() {
            let mut sides = [Side::Party; 4];
            sides[k] = Side::Street;
            sides[if k == NORTH { SOUTH } else { NORTH }] = Side::Rear;
            if s == 0 {
                sides[WEST] = Side::Street;
            }
            if s + 1 == pieces.len() {
                sides[EAST] = Side::Street;
            }
            rows.push((Rect { x0, x1, z0, z1 }, sides));
        }
    }
    for k in [WEST, EAST] {
        let (x0, x1) = if k == WEST { (lots.x0, yard.x0) } else { (yard.x1, lots.x1) };
        if yard.depth() > 7.0 && rng.chance(0.9) {
            for [z0, z1] in split(rng, yard.z0, yard.z1, 14.5) {
                let mut sides = [Side::Party; 4];
                sides[k] = Side::Street;
                sides[if k == WEST { EAST } else { WEST }] = Side::Rear;
                rows.push((Rect { x0, x1, z0, z1 }, sides));
            }
        }
    }
    for (lot, sides) in rows {
        let empty = rng.chance(0.04);
        let floors = (usual + rng.range(-1.0, 1.6)).round().clamp(1.0, 8.0) as u32;
        if empty {
            let p = lot.center();
            site.tree(rng, Tree::Street, on_ground(p));
            continue;
        }
        site.piece(rng, |b, rng| {
            let style = Style::row(rng, density);
            building::row_house(b, rng, lot, sides, floors, &style);
        });
    }
    yard_things(site, rng, yard);
}

fn yard_things(site: &mut Site, rng: &mut Rng, yard: Rect) {
    let inner = yard.shrunk([3.0; 4]);
    if inner.width() < 2.0 || inner.depth() < 1.0 {
        return;
    }
    for _ in 0..rng.int(2, 4) {
        let p = on_ground(inner.random(rng));
        site.tree(rng, Tree::Street, p);
    }
    for _ in 0..4 {
        let p = on_ground(inner.random(rng));
        let radius = rng.range(0.5, 0.9);
        site.piece(rng, |b, rng| vegetation::bush(b, rng, p, radius));
    }
    let shed = Frame::standing(on_ground(inner.random(rng)), rng.range(0.0, 6.0));
    site.piece(rng, |b, rng| {
        let tint = shade(WHITE, rng.range(0.6, 1.0));
        let all = crate::mesh::face::STANDING;
        b.cuboid(&shed, Mat::Wood, tint, [-1.4, 1.4], [0.0, 2.1], [-1.0, 1.0], all);
        b.cuboid(&shed, Mat::Slate, WHITE, [-1.6, 1.6], [2.1, 2.2], [-1.2, 1.2], crate::mesh::face::ALL);
    });
}

fn towers(site: &mut Site, rng: &mut Rng) {
    let lots = site.cell.lots();
    let density = site.cell.density;
    site.piece(rng, |b, rng| street::ground(b, rng, Mat::Paving, lots, KERB, 3.4, 0.82));
    let two = lots.width() > 48.0;
    let halves: Vec<[f64; 2]> = if two { vec![[0.0, 0.5], [0.5, 1.0]] } else { vec![[0.0, 1.0]] };
    for [u0, u1] in halves {
        let (a, c) = (lots.at(u0, 0.0), lots.at(u1, 1.0));
        let half = Rect { x0: a.x, x1: c.x, z0: a.y, z1: c.y };
        let (w, d) = (rng.range(17.0, 21.0), rng.range(18.0, 23.0));
        let free = [half.width() - w - 6.0, half.depth() - d - 6.0];
        let (x0, z0) = (half.x0 + 3.0 + free[0].max(0.0) * rng.unit(), half.z0 + 3.0 + free[1].max(0.0) * rng.unit());
        let rect = Rect { x0, x1: x0 + w, z0, z1: z0 + d };
        let floors = (9.0 + 17.0 * density * rng.range(0.75, 1.25)) as u32;
        site.piece(rng, |b, rng| {
            let style = Style::tower(rng);
            building::tower(b, rng, rect, floors, &style);
        });
        // What is left around the tower.
        for p in [half.at(0.12, 0.06), half.at(0.5, 0.05), half.at(0.88, 0.94), half.at(0.5, 0.95), half.at(0.08, 0.94)]
        {
            let clear = p.x < rect.x0 - 1.5 || p.x > rect.x1 + 1.5 || p.y < rect.z0 - 1.5 || p.y > rect.z1 + 1.5;
            if clear {
                let f = Frame::standing(on_ground(p), rng.range(0.0, 6.0));
                if rng.chance(0.5) {
                    site.piece(rng, |b, rng| things::planter(b, rng, &f));
                } else {
                    site.piece(rng, |b, rng| things::bench(b, rng, &f));
                }
            }
        }
    }
}

fn slabs(site: &mut Site, rng: &mut Rng) {
    let lots = site.cell.lots();
    let density = site.cell.density;
    site.piece(rng, |b, rng| street::ground(b, rng, Mat::Grass, lots, KERB, 6.0, 0.8));
    let style = {
        let mut own = rng.fork();
        Style::modern(&mut own)
    };
    let floors = (3.0 + 4.0 * density + rng.range(0.0, 1.5)) as u32;
    let depth = rng.range(10.0, 11.5);
    for z0 in [lots.z0 + 2.5, lots.z1 - 2.5 - depth] {
        let (a, c) = (rng.range(3.0, 8.0), rng.range(3.0, 8.0));
        let rect = Rect { x0: lots.x0 + a, x1: lots.x1 - c, z0, z1: z0 + depth };
        site.piece(rng, |b, rng| building::slab(b, rng, rect, floors, &style));
    }
    let (z0, z1) = (lots.z0 + depth + 4.5, lots.z1 - depth - 4.5);
    let middle = 0.5 * (lots.x0 + lots.x1);
    if z1 - z0 < 7.0 {
        return;
    }
    // Cars to the west, a lawn with trees to the east.
    let lot = Rect { x0: lots.x0 + 3.0, x1: middle - 1.0, z0, z1: z0 + 7.0 };
    site.piece(rng, |b, _| {
        street::flat(b, Mat::Asphalt, shade(WHITE, 0.95), lot, KERB + 0.015);
        let bays = (lot.width() / 2.6) as u32;
        for k in 0..=bays {
            let x = lot.x0 + 0.3 + f64::from(k) * 2.6;
            let line = Rect { x0: x - 0.05, x1: x + 0.05, z0: lot.z0 + 0.2, z1: lot.z0 + 5.2 };
            street::flat(b, Mat::Marking, WHITE, line, KERB + 0.021);
        }
    });
    for k in 0..(lot.width() / 2.6) as u32 {
        let p = DVec3::new(lot.x0 + 1.6 + f64::from(k) * 2.6, KERB + 0.015, lot.z0 + 2.8);
        let yaw = rng.pick(&[0.0, std::f64::consts::PI]);
        let kind = usual_car(rng);
        if rng.chance(0.6) {
            site.vehicle(rng, kind, &Frame::standing(p, yaw));
        }
    }
    let lawn = Rect { x0: middle + 2.0, x1: lots.x1 - 3.0, z0: z0 + 1.0, z1: z1 - 1.0 };
    for k in 0..6 {
        let p = on_ground(lawn.random(rng));
        site.tree(rng, if k % 3 == 0 { Tree::Conifer } else { Tree::Street }, p);
    }
    let p = lawn.center();
    site.piece(rng, |b, _| things::playground(b, &Frame::standing(on_ground(p), 0.3)));
}

fn houses(site: &mut Site, rng: &mut Rng) {
    let lots = site.cell.lots();
    site.piece(rng, |b, rng| street::ground(b, rng, Mat::Grass, lots, KERB, 6.0, 0.75));
    let middle = 0.5 * (lots.z0 + lots.z1);
    for k in [NORTH, SOUTH] {
        for [x0, x1] in split(rng, lots.x0, lots.x1, 15.0) {
            let (z0, z1) = if k == NORTH { (lots.z0, middle) } else { (middle, lots.z1) };
            house_lot(site, rng, Rect { x0, x1, z0, z1 }, k);
        }
    }
}

fn house_lot(site: &mut Site, rng: &mut Rng, lot: Rect, front: usize) {
    let (w, d) = ((lot.width() - 3.5).min(rng.range(8.5, 11.0)), rng.range(7.5, 9.5));
    let x0 = lot.x0 + (lot.width() - w) * rng.range(0.4, 0.6);
    let setback = rng.range(2.8, 4.2);
    let z0 = if front == NORTH { lot.z0 + setback } else { lot.z1 - setback - d };
    let rect = Rect { x0, x1: x0 + w, z0, z1: z0 + d };
    let floors = rng.int(1, 2) as u32;
    site.piece(rng, |b, rng| {
        let style = Style::house(rng);
        building::house(b, rng, rect, front, floors, &style);
    });
    // The fence or hedge toward the street, with a gap for the path to the door.
    let (a, c) = if front == NORTH {
        (DVec2::new(lot.x1, lot.z0 + 0.4), DVec2::new(lot.x0, lot.z0 + 0.4))
    } else {
        (DVec2::new(lot.x0, lot.z1 - 0.4), DVec2::new(lot.x1, lot.z1 - 0.4))
    };
    let (f, length) = Frame::wall(a, c, KERB);
    let hedge = rng.chance(0.5);
    let tint = rng.pick(&[[0.9, 0.9, 0.88], [0.35, 0.22, 0.13], [0.15, 0.22, 0.18]]);
    let gap = rng.range(0.3, 0.6) * length;
    for [u0, u1] in [[0.2, gap - 0.7], [gap + 0.7, length - 0.2]] {
        site.piece(rng, |b, rng| {
            if hedge {
                vegetation::hedge(b, rng, &f.moved(u0, 0.0, 0.0), u1 - u0, 1.1);
            } else {
                things::fence(b, &f.moved(u0, 0.0, 0.0), u1 - u0, tint);
            }
        });
    }
    site.piece(rng, |b, _| {
        let walk = [f.at(gap - 0.6, 0.02, 0.4), f.at(gap + 0.6, 0.02, 0.4)];
        b.fan(
            Mat::Paving,
            WHITE,
            &[walk[0], walk[1], walk[1] - f.n * (setback + 0.1), walk[0] - f.n * (setback + 0.1)],
        );
    });
    // The garden behind.
    let garden = if front == NORTH {
        Rect { z0: rect.z1 + 1.5, z1: lot.z1 - 0.8, ..lot }
    } else {
        Rect { z0: lot.z0 + 0.8, z1: rect.z0 - 1.5, ..lot }
    };
    let garden = garden.shrunk([0.0, 1.5, 0.0, 1.5]);
    if garden.depth() > 0.5 {
        let p = on_ground(garden.random(rng));
        let kind = rng.pick(&[Tree::Street, Tree::Street, Tree::Conifer, Tree::Column]);
        site.tree(rng, kind, p);
        let p = on_ground(garden.random(rng));
        site.piece(rng, |b, rng| vegetation::bush(b, rng, p, 0.8));
    }
    let w = rng.range(0.15, 0.85) * length;
    let p = f.at(w, 0.0, -1.4);
    site.piece(rng, |b, rng| vegetation::bush(b, rng, p, 0.6));
}

fn traffic_lights(site: &mut Site, rng: &mut Rng) {
    let cell = site.cell;
    for k in 0..4 {
        // The street that crosses at the end of side k.
        let across = cell.half[(k + 3) % 4];
        if across > 6.0 || cell.half[k] > 6.0 {
            let f = street::beside_stop_line(&cell, k);
            site.piece(rng, |b, rng| things::traffic_light(b, rng, &f));
        }
    }
}

/// Lamps, trees and furniture along the kerbs.
fn pavement(site: &mut Site, rng: &mut Rng) {
    let cell = site.cell;
    let green = [0; 4].map(|_| rng.chance(0.65));
    let stop = [0; 4].map(|_| rng.chance(0.3));
    let mut spots: Vec<(Frame, usize)> = Vec::new();
    street::along_kerb(&cell, 0.95, 5.2, |f, k| spots.push((f, k)));
    let mut index = [0usize; 4];
    for (f, k) in spots {
        let s = index[k];
        index[k] += 1;
        if s % 5 == 1 {
            site.piece(rng, |b, _| things::lamp(b, &f.moved(0.0, 0.0, 0.35)));
        } else if stop[k] && s == 5 {
            site.piece(rng, |b, rng| things::bus_stop(b, rng, &f.moved(0.0, 0.0, 0.1)));
        } else if green[k] && s % 2 == 0 && !(stop[k] && (4..=6).contains(&s)) {
            site.piece(rng, |b, _| {
                let pit = f.moved(0.0, 0.008, 0.0);
                let at = |u: f64, w: f64| pit.at(u, 0.0, w);
                b.fan(Mat::Bark, shade(WHITE, 0.7), &[at(-0.6, 0.6), at(0.6, 0.6), at(0.6, -0.6), at(-0.6, -0.6)]);
            });
            site.tree(rng, Tree::Street, f.o);
        } else {
            let kind = rng.int(0, 11);
            site.piece(rng, |b, rng| match kind {
                0 | 1 => things::bench(b, rng, &f.turned(std::f64::consts::PI).moved(0.0, 0.0, -0.2)),
                2 | 3 => things::bin(b, &f),
                4 => things::hydrant(b, &f.moved(0.0, 0.0, 0.4)),
                5 => things::letter_box(b, &f),
                6 => things::sign(b, rng, &f.moved(0.0, 0.0, 0.4)),
                7 => things::bicycles(b, rng, &f),
                8 => things::planter(b, rng, &f),
                9 => {
                    for u in [-1.5, 0.0, 1.5] {
                        things::bollard(b, &f.moved(u, 0.0, 0.5));
                    }
                }
                _ => {}
            });
        }
    }
    let corner = cell.block().polygon();
    for (k, c) in corner.iter().enumerate() {
        let toward = (cell.block().center() - *c).normalize();
        let p = *c + toward * (0.5 * PAVEMENT + 0.414 * CORNER);
        if rng.chance(0.5) {
            let f = Frame::standing(on_ground(p), k as f64);
            site.piece(rng, |b, rng| things::sign(b, rng, &f));
        }
    }
}

/// A car as most are.
pub fn usual_car(rng: &mut Rng) -> Vehicle {
    let kinds = [Vehicle::Saloon, Vehicle::Hatchback, Vehicle::Suv, Vehicle::Saloon, Vehicle::Hatchback, Vehicle::Van];
    rng.pick(&kinds)
}

/// Cars parked at the kerb and driving.
fn traffic(site: &mut Site, rng: &mut Rng) {
    let cell = site.cell;
    for k in 0..4 {
        let (length, half) = street::road_stretch(&cell, k);
        let lanes = street::lanes(half);
        let count = (length / 6.2).floor();
        for s in 0..count as u32 {
            let u = (f64::from(s) + 0.5 + rng.range(-0.06, 0.06)) / count;
            let (kind, taken) = (usual_car(rng), rng.chance(0.38));
            if taken {
                let f = street::on_road(&cell, k, u, half - 1.12 + rng.range(-0.06, 0.06));
                site.vehicle(rng, kind, &f);
            }
        }
        for (lane, center) in lanes.centers.iter().enumerate() {
            let cars = rng.int(0, 2);
            for s in 0..cars {
                let u = (s as f64 + rng.range(0.3, 0.7)) / cars as f64;
                let bus = lane == 1 && rng.chance(0.25);
                let kind = if bus { Vehicle::Bus } else { usual_car(rng) };
                site.vehicle(rng, kind, &street::on_road(&cell, k, u, *center));
            }
        }
    }
}

//! Colours, normals and materials of a level: means by area of what each of its triangles stands for.
//!
//! What a corner stands for are the triangles that touch its cell and face as it does. A triangle that is large against
//! a cell counts there no more than a cell's face, but in the one that it becomes as a whole.

use super::cluster::{Clusters, Output, Touching};
use super::fit::{Fitted, fit};
use super::flat::Flattened;
use super::merge::Merged;
use super::vector::{CLASSES, Vec3, add_scaled, area_vector, class, dot, length};
use crate::build::triangles::attributes::{NO_DETAIL, VertexBits, octahedral};
use crate::build::triangles::triangle::Triangle;
use bricks::{NO_NORMAL, NONE};

/// By how much a colour may exceed what a material of the family can show before the white one is taken.
const EXCESS: f64 = 1.02;

/// Share of what an output stands for that is opaque, at least: a third, as one opaque cell over it hides the others.
const CLEAR: f64 = 1.0 / 3.0;

/// Share of the light that comes from one direction.
const DIRECT: f64 = 0.7;

/// Length of a mean normal from which on normals do not differ.
const ALIKE: f64 = 0.995;

/// Cosine from which on a mean normal is that of the triangle.
const SAME_DIRECTION: f64 = 0.9999;

/// Sums over triangles.
#[derive(Clone, Copy, Debug)]
struct Sum {
    /// Area, opaque or not.
    area: f64,
    /// Area that is opaque.
    weight: f64,
    albedo: Vec3,
    normal: Vec3,
    /// Whether some of it has a normal of its own.
    is_smooth: bool,
}

impl Sum {
    const EMPTY: Self = Self { area: 0.0, weight: 0.0, albedo: [0.0; 3], normal: [0.0; 3], is_smooth: false };

    fn add(&mut self, (area, cover): (f64, f64), albedo: Vec3, normal: Vec3, is_smooth: bool) {
        let weight = area * cover;
        self.area += area;
        self.weight += weight;
        self.albedo = add_scaled(self.albedo, weight, albedo);
        self.normal = add_scaled(self.normal, weight, normal);
        self.is_smooth |= is_smooth;
    }

    fn merge(&mut self, other: &Self) {
        self.area += other.area;
        self.weight += other.weight;
        self.albedo = add_scaled(self.albedo, 1.0, other.albedo);
        self.normal = add_scaled(self.normal, 1.0, other.normal);
        self.is_smooth |= other.is_smooth;
    }

    /// How much darker it is than a surface of its mean normal: normals that differ see less of a light together.
    fn shade(&self) -> f64 {
        let together = if self.weight > 0.0 { length(self.normal) / self.weight } else { 1.0 };
        if together > ALIKE { 1.0 } else { 1.0 - DIRECT * (1.0 - together.max(0.5)) }
    }

    fn mean(&self) -> Vec3 {
        if self.weight > 0.0 { self.albedo.map(|x| x / self.weight) } else { [0.0; 3] }
    }
}

/// The share of a family in a slot; a list.
#[derive(Clone, Copy, Debug)]
struct Share {
    family: u32,
    next: u32,
    weight: f64,
}

/// A cell as seen from one of six sides, with the shares of families.
#[derive(Clone, Copy, Debug)]
struct Slot {
    sum: Sum,
    shares: u32,
}

impl Slot {
    const EMPTY: Self = Self { sum: Sum::EMPTY, shares: NONE };

    fn share(&mut self, shares: &mut Vec<Share>, family: u32, weight: f64) {
        let mut at = self.shares;
        while at != NONE {
            let share = &mut shares[at as usize];
            if share.family == family {
                share.weight += weight;
                return;
            }
            at = share.next;
        }
        shares.push(Share { family, next: self.shares, weight });
        self.shares = shares.len() as u32 - 1;
    }
}

/// What an output stands for, at each corner.
struct StandsFor {
    /// Twice the area vector of the output.
    vector: Vec3,
    sums: [Sum; 3],
}

/// Means over cells, and what they make of the outputs.
pub(super) struct Surface {
    slots: Vec<Slot>,
    /// Slots of each cell by class, or [`NONE`].
    of_cell: Vec<[u32; CLASSES]>,
    shares: Vec<Share>,
    /// What groups of outputs stand for beyond their cells; all of it where they are strands and specks.
    own: Vec<Slot>,
    /// Mean albedo of each source triangle.
    pub albedo: Vec<[f32; 3]>,
    /// Area of each source triangle that is opaque, square steps.
    pub area: Vec<f64>,
}

impl Surface {
    /// Collects what `clusters` brings together.
    pub fn collect(merged: &Merged, points: &[Vec3], clusters: &Clusters, flattened: &Flattened) -> Self {
        let count = merged.triangles.len();
        let mut all = Self {
            slots: Vec::new(),
            of_cell: vec![[NONE; CLASSES]; clusters.kept.len()],
            shares: Vec::new(),
            own: vec![Slot::EMPTY; clusters.spread.len()],
            albedo: Vec::with_capacity(count),
            area: Vec::with_capacity(count),
        };
        let face = clusters.size * clusters.size;
        for (source, &group) in merged.triangles.iter().zip(&clusters.group_of) {
            let vector = area_vector(source.corners.map(|corner| points[corner as usize]));
            let doubled = length(vector);
            let side = class(vector);
            let n = if doubled > 0.0 { vector.map(|x| x / doubled) } else { [0.0; 3] };
            let shades = source.shades.map(|shade| &merged.shades[shade as usize]);
            let (mean, cover) = flattened.under(source.material, shades);
            let alpha = shades.iter().map(|shade| shade.color[3]).sum::<f32>() / 3.0;
            // Only where rays pass does alpha mean something.
            let cover = f64::from(if flattened.is_opaque(source.material) { 1.0 } else { cover * alpha });
            let family = flattened.family_of[source.material as usize];
            let third = doubled / 6.0;
            let is_thin = group != NONE && clusters.is_thin(group);
            let weight = if is_thin { 0.0 } else { third.min(face) };
            let (mut albedo_sum, mut normal_sum, mut is_smooth) = ([0.0; 3], [0.0; 3], false);
            for (corner, shade) in source.corners.into_iter().zip(shades) {
                let albedo = std::array::from_fn(|k| f64::from(mean[k]) * f64::from(shade.color[k]));
                let has_normal = shade.normal != [0.0; 3];
                let normal = if has_normal { shade.normal.map(f64::from) } else { n };
                albedo_sum = add_scaled(albedo_sum, 1.0, albedo);
                normal_sum = add_scaled(normal_sum, 1.0, normal);
                is_smooth |= has_normal;
                if is_thin {
                    continue;
                }
                let slot = all.slot(clusters.cell_of[corner as usize], side);
                all.slots[slot].sum.add((weight, cover), albedo, normal, has_normal);
                all.slots[slot].share(&mut all.shares, family, weight * cover);
            }
            let third_of = |sum: Vec3| sum.map(|x| x / 3.0);
            let excess = 3.0 * (third - weight);
            if group != NONE && excess > 0.0 {
                let own = &mut all.own[group as usize];
                own.sum.add((excess, cover), third_of(albedo_sum), third_of(normal_sum), is_smooth);
                own.share(&mut all.shares, family, excess * cover);
            }
            all.albedo.push(third_of(albedo_sum).map(|x| x as f32));
            all.area.push(0.5 * doubled * cover);
        }
        all
    }

    /// Leaves out those outputs that stand for what is mostly not there, but for the smallest if there are no others.
    /// Those that stay are opaque.
    pub fn drop_clear(&self, points: &[Vec3], clusters: &mut Clusters) {
        if self.slots.iter().all(|slot| slot.sum.weight == slot.sum.area) {
            return;
        }
        let vector = |output: &Output| area_vector(output.corners.map(|corner| points[corner as usize]));
        let is_clear = |output: &Output| {
            let (side, mut sum) = (class(vector(output)), self.own[output.group as usize].sum);
            if !clusters.is_thin(output.group) {
                output.cells.iter().for_each(|&cell| sum.merge(&self.sum_of(cell, side)));
            }
            sum.weight < CLEAR * sum.area
        };
        let is_clear: Vec<bool> = clusters.outputs.iter().map(is_clear).collect();
        let opaque = (0u32..).zip(&is_clear).filter(|(_, is_clear)| !**is_clear);
        let mut stay: Vec<u32> = opaque.map(|(output, _)| output).collect();
        if stay.is_empty() {
            let area = |output: &u32| length(vector(&clusters.outputs[*output as usize]));
            let outputs = 0..clusters.outputs.len() as u32;
            stay.extend(outputs.min_by(|a, b| area(a).total_cmp(&area(b)).then(a.cmp(b))));
        }
        if stay.len() < is_clear.len() {
            clusters.keep(&stay);
        }
    }

    fn slot(&mut self, cell: u32, side: usize) -> usize {
        let slot = &mut self.of_cell[cell as usize][side];
        if *slot == NONE {
            *slot = self.slots.len() as u32;
            self.slots.push(Slot::EMPTY);
        }
        *slot as usize
    }

    /// The slots that a corner in `cell` of a triangle that faces `side` stands for: those of its side, else all.
    fn slots_of(&self, cell: u32, side: usize) -> impl Iterator<Item = &Slot> {
        let all = &self.of_cell[cell as usize];
        let own = all[side];
        let of_side = move |&&slot: &&u32| slot != NONE && (own == NONE || slot == own);
        all.iter().filter(of_side).map(|&slot| &self.slots[slot as usize])
    }

    fn sum_of(&self, cell: u32, side: usize) -> Sum {
        let mut sum = Sum::EMPTY;
        self.slots_of(cell, side).for_each(|slot| sum.merge(&slot.sum));
        sum
    }

    /// Whether a group stands for more than its cells do.
    pub fn has_own(&self, group: u32) -> bool {
        self.own[group as usize].sum.area > 0.0
    }

    /// What an output stands for, at each corner.
    fn sums(&self, output: &Output, side: usize, is_thin: bool) -> [Sum; 3] {
        output.cells.map(|cell| {
            let mut sum = if is_thin { Sum::EMPTY } else { self.sum_of(cell, side) };
            sum.merge(&self.own[output.group as usize].sum);
            sum
        })
    }

    /// The triangles of the level, ascending by id, and how they fit.
    pub fn triangles(
        &self,
        merged: &Merged,
        points: &[Vec3],
        (clusters, touching): (&Clusters, &Touching),
        flattened: &Flattened,
    ) -> (Vec<Triangle>, Fitted) {
        let stands_for = |output: &Output| {
            let vector = area_vector(output.corners.map(|corner| points[corner as usize]));
            StandsFor { vector, sums: self.sums(output, class(vector), clusters.is_thin(output.group)) }
        };
        let all: Vec<StandsFor> = clusters.outputs.iter().map(stands_for).collect();
        let means = all.iter().map(|output| output.sums.map(|sum| sum.mean())).collect();
        let fitted = fit(merged, points, (clusters, touching), self, means);
        let make = |((output, StandsFor { vector, sums }), means): ((&Output, &StandsFor), &[Vec3; 3])| {
            let (side, is_thin) = (class(*vector), clusters.is_thin(output.group));
            let id = merged.triangles[output.source as usize].id;
            let family = self.drawn(output, side, is_thin, scattered(id ^ scattered(clusters.size as u32)));
            let family = &flattened.families[family as usize];
            let ratio = |mean: Vec3| -> Vec3 {
                std::array::from_fn(|k| match f64::from(family.base[k]) {
                    0.0 if mean[k] == 0.0 => 1.0,
                    base => mean[k] / base,
                })
            };
            let ratios = means.map(ratio);
            let is_over = ratios.as_flattened().iter().any(|&x| x > EXCESS);
            let (material, colors) = if is_over { (family.white, *means) } else { (family.flat, ratios) };
            let n = vector.map(|x| x / length(*vector));
            let attributes = std::array::from_fn(|k| {
                // Normals of what is round say nothing; its triangles face as many ways.
                let (normal, shade) = if is_thin { (NO_NORMAL, 1.0) } else { (normal(&sums[k], n), sums[k].shade()) };
                VertexBits([normal, 0, 0, unorm8(colors[k].map(|x| x * shade))], NO_DETAIL)
            });
            let corners = output.corners.map(|corner| merged.positions[corner as usize]);
            Triangle { brick: 0, id, material, corners, attributes }
        };
        (clusters.outputs.iter().zip(&all).zip(&fitted.corners).map(make).collect(), fitted)
    }

    /// A family drawn by its share, so that of many triangles the share is right: a level emits and shines as much as
    /// what it stands for. `random` must differ from level to level: a triangle that was drawn once would else be
    /// drawn again, as it counts in the share.
    fn drawn(&self, output: &Output, side: usize, is_thin: bool, random: u32) -> u32 {
        let mut found: Vec<(u32, f64)> = Vec::with_capacity(8);
        let mut add = |slot: &Slot| {
            let mut at = slot.shares;
            while at != NONE {
                let share = &self.shares[at as usize];
                match found.iter_mut().find(|(other, _)| *other == share.family) {
                    Some((_, sum)) => *sum += share.weight,
                    None => found.push((share.family, share.weight)),
                }
                at = share.next;
            }
        };
        if !is_thin {
            output.cells.iter().for_each(|&cell| self.slots_of(cell, side).for_each(&mut add));
        }
        add(&self.own[output.group as usize]);
        if let [(family, _)] = found[..] {
            return family;
        }
        found.sort_unstable_by_key(|(family, _)| *family);
        let all: f64 = found.iter().map(|(_, weight)| weight).sum();
        let mut left = all * f64::from(random) / (f64::from(u32::MAX) + 1.0);
        let is_it = |(_, weight): &&(u32, f64)| {
            left -= weight;
            left < 0.0
        };
        found.iter().find(is_it).or(found.last()).map_or(NONE, |(family, _)| *family)
    }
}

/// Bits that are unlike those of ids near to it.
fn scattered(mut id: u32) -> u32 {
    id = (id ^ id >> 16).wrapping_mul(0x045d_9f3b);
    id = (id ^ id >> 16).wrapping_mul(0x045d_9f3b);
    id ^ id >> 16
}

/// The octahedral mean normal; none where that of the triangle, `n`, does.
fn normal(sum: &Sum, n: Vec3) -> u32 {
    let size = length(sum.normal);
    let along = dot(sum.normal, n);
    if along <= 0.0 || !sum.is_smooth && along >= SAME_DIRECTION * size {
        return NO_NORMAL;
    }
    octahedral(sum.normal).unwrap_or(NO_NORMAL)
}

/// Linear RGB and an alpha of 1.
fn unorm8(color: Vec3) -> u32 {
    let byte = |x: f64| u32::from((x.clamp(0.0, 1.0) * 255.0).round() as u8);
    byte(color[0]) | byte(color[1]) << 8 | byte(color[2]) << 16 | 0xff00_0000
}

//! Colours, normals and materials of a level: means by area of what each of its triangles stands for.
//!
//! What a corner stands for are the triangles that touch its cell and face as it does. A triangle that is large against
//! a cell counts there no more than a cell's face, but in the one that it becomes as a whole.

use super::cluster::{Clusters, Output};
use super::flat::Flattened;
use super::merge::Merged;
use super::vector::{CLASSES, Vec3, add_scaled, area_vector, class, dot, length};
use crate::build::triangles::attributes::{NO_DETAIL, VertexBits, octahedral};
use crate::build::triangles::triangle::Triangle;
use bricks::{NO_NORMAL, NONE};

/// By how much a colour may exceed what a material of the family can show before the white one is taken.
const EXCESS: f64 = 1.02;

/// Share of what an output stands for that is opaque, at least: a third, as one opaque cell over it hides the others.
const THIN: f64 = 1.0 / 3.0;

/// Share of the light that comes from one direction.
const DIRECT: f64 = 0.7;

/// Length of a mean normal from which on normals do not differ.
const ALIKE: f64 = 0.995;

/// Cosine from which on a mean normal is that of the triangle.
const SAME_DIRECTION: f64 = 0.9999;

/// Sums over triangles.
#[derive(Clone, Copy, Debug, Default)]
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

/// A cell as seen from one of six sides.
#[derive(Clone, Copy, Debug)]
struct Slot {
    sum: Sum,
    shares: u32,
}

/// Means over cells, and what they make of the outputs.
pub(super) struct Surface {
    slots: Vec<Slot>,
    /// Slots of each cell by class, or [`NONE`].
    of_cell: Vec<[u32; CLASSES]>,
    shares: Vec<Share>,
    /// What outputs stand for beyond their cells, with the family of the largest part.
    own: Vec<(Sum, u32, f64)>,
    /// Mean albedo of each source triangle.
    pub albedo: Vec<[f32; 3]>,
    /// Class of each source triangle.
    pub class: Vec<u8>,
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
            own: vec![(Sum::default(), NONE, 0.0); clusters.outputs.len()],
            albedo: Vec::with_capacity(count),
            class: Vec::with_capacity(count),
            area: Vec::with_capacity(count),
        };
        let face = clusters.size * clusters.size;
        for (source, &output) in merged.triangles.iter().zip(&clusters.output_of) {
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
            let weight = third.min(face);
            let (mut albedo_sum, mut normal_sum, mut is_smooth) = ([0.0; 3], [0.0; 3], false);
            for (corner, shade) in source.corners.into_iter().zip(shades) {
                let albedo = std::array::from_fn(|k| f64::from(mean[k]) * f64::from(shade.color[k]));
                let has_normal = shade.normal != [0.0; 3];
                let normal = if has_normal { shade.normal.map(f64::from) } else { n };
                albedo_sum = add_scaled(albedo_sum, 1.0, albedo);
                normal_sum = add_scaled(normal_sum, 1.0, normal);
                is_smooth |= has_normal;
                let slot = all.slot(clusters.cell_of[corner as usize], side);
                all.slots[slot].sum.add((weight, cover), albedo, normal, has_normal);
                all.share(slot, family, weight * cover);
            }
            let third_of = |sum: Vec3| sum.map(|x| x / 3.0);
            let excess = 3.0 * (third - weight);
            if output != NONE && excess > 0.0 {
                let (sum, largest, most) = &mut all.own[output as usize];
                sum.add((excess, cover), third_of(albedo_sum), third_of(normal_sum), is_smooth);
                if excess > *most {
                    (*largest, *most) = (family, excess);
                }
            }
            all.albedo.push(third_of(albedo_sum).map(|x| x as f32));
            all.class.push(side as u8);
            all.area.push(0.5 * doubled * cover);
        }
        all
    }

    /// Leaves out those outputs that stand for what is mostly not there, but for the smallest if there are no others.
    /// Those that stay are opaque.
    pub fn drop_thin(&mut self, points: &[Vec3], clusters: &mut Clusters) {
        if self.slots.iter().all(|slot| slot.sum.weight == slot.sum.area) {
            return;
        }
        let vector = |output: &Output| area_vector(clusters.corners(output).map(|corner| points[corner as usize]));
        let is_thin = |(output, (own, ..)): (&Output, &(Sum, u32, f64))| {
            let (side, mut sum) = (class(vector(output)), *own);
            output.cells.iter().for_each(|&cell| sum.merge(&self.sum_of(cell, side)));
            sum.weight < THIN * sum.area
        };
        let is_thin: Vec<bool> = clusters.outputs.iter().zip(&self.own).map(is_thin).collect();
        let mut stay: Vec<u32> = (0u32..).zip(&is_thin).filter(|(_, thin)| !**thin).map(|(output, _)| output).collect();
        if stay.is_empty() {
            let area = |output: &u32| length(vector(&clusters.outputs[*output as usize]));
            let outputs = 0..clusters.outputs.len() as u32;
            stay.extend(outputs.min_by(|a, b| area(a).total_cmp(&area(b)).then(a.cmp(b))));
        }
        if stay.len() < is_thin.len() {
            self.own = stay.iter().map(|&output| self.own[output as usize]).collect();
            clusters.keep(&stay);
        }
    }

    fn slot(&mut self, cell: u32, side: usize) -> usize {
        let slot = &mut self.of_cell[cell as usize][side];
        if *slot == NONE {
            *slot = self.slots.len() as u32;
            self.slots.push(Slot { sum: Sum::default(), shares: NONE });
        }
        *slot as usize
    }

    fn share(&mut self, slot: usize, family: u32, weight: f64) {
        let mut at = self.slots[slot].shares;
        while at != NONE {
            let share = &mut self.shares[at as usize];
            if share.family == family {
                share.weight += weight;
                return;
            }
            at = share.next;
        }
        self.shares.push(Share { family, next: self.slots[slot].shares, weight });
        self.slots[slot].shares = self.shares.len() as u32 - 1;
    }

    /// The slots that a corner in `cell` of a triangle that faces `side` stands for: those of its side, else all.
    fn slots_of(&self, cell: u32, side: usize) -> impl Iterator<Item = &Slot> {
        let all = &self.of_cell[cell as usize];
        let own = all[side];
        let of_side = move |&&slot: &&u32| slot != NONE && (own == NONE || slot == own);
        all.iter().filter(of_side).map(|&slot| &self.slots[slot as usize])
    }

    fn sum_of(&self, cell: u32, side: usize) -> Sum {
        let mut sum = Sum::default();
        self.slots_of(cell, side).for_each(|slot| sum.merge(&slot.sum));
        sum
    }

    /// Linear RGB that a level shows near a source triangle with corners in these cells which is none of its own.
    pub fn shown(&self, cells: [u32; 3], side: usize) -> Vec3 {
        let means = cells.map(|cell| self.sum_of(cell, side).mean());
        std::array::from_fn(|k| (means[0][k] + means[1][k] + means[2][k]) / 3.0)
    }

    /// The triangles of the level, ascending by id, and the mean linear RGB of each.
    pub fn triangles(&self, merged: &Merged, clusters: &Clusters, flattened: &Flattened) -> (Vec<Triangle>, Vec<Vec3>) {
        let make = |(number, output): (usize, &Output)| {
            let corners = clusters.corners(output).map(|corner| merged.positions[corner as usize]);
            let base = corners[0];
            let relative = corners.map(|p| std::array::from_fn(|k| (p[k] - base[k]) as f64));
            let vector = area_vector(relative);
            let side = class(vector);
            let (own, own_family, own_weight) = &self.own[number];
            let sums = output.cells.map(|cell| {
                let mut sum = self.sum_of(cell, side);
                sum.merge(own);
                sum
            });
            let means = sums.map(|sum| sum.mean());
            let family = self.largest(output.cells, side, (*own_family, *own_weight));
            let family = &flattened.families[family as usize];
            let ratio = |mean: Vec3| -> Vec3 {
                std::array::from_fn(|k| match f64::from(family.base[k]) {
                    0.0 if mean[k] == 0.0 => 1.0,
                    base => mean[k] / base,
                })
            };
            let ratios = means.map(ratio);
            let is_over = ratios.as_flattened().iter().any(|&x| x > EXCESS);
            let (material, colors) = if is_over { (family.white, means) } else { (family.flat, ratios) };
            let n = vector.map(|x| x / length(vector));
            let attributes = std::array::from_fn(|k| {
                let color = colors[k].map(|x| x * sums[k].shade());
                VertexBits([normal(&sums[k], n), 0, 0, unorm8(color)], NO_DETAIL)
            });
            let id = merged.triangles[output.source as usize].id;
            let mean = std::array::from_fn(|k| (means[0][k] + means[1][k] + means[2][k]) / 3.0);
            (Triangle { brick: 0, id, material, corners, attributes }, mean)
        };
        clusters.outputs.iter().enumerate().map(make).unzip()
    }

    /// The family with the largest share, of equal ones the first.
    fn largest(&self, cells: [u32; 3], side: usize, (own, own_weight): (u32, f64)) -> u32 {
        let mut found: Vec<(u32, f64)> = Vec::with_capacity(8);
        let mut add = |family: u32, weight: f64| match found.iter_mut().find(|(other, _)| *other == family) {
            Some((_, sum)) => *sum += weight,
            None => found.push((family, weight)),
        };
        for cell in cells {
            for slot in self.slots_of(cell, side) {
                let mut at = slot.shares;
                while at != NONE {
                    let share = &self.shares[at as usize];
                    add(share.family, share.weight);
                    at = share.next;
                }
            }
        }
        if own != NONE {
            add(own, own_weight);
        }
        let more = |best: (u32, f64), next: &(u32, f64)| {
            if next.1 > best.1 || next.1 == best.1 && next.0 < best.0 { *next } else { best }
        };
        found.iter().fold((NONE, -1.0), more).0
    }
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

//! Draws a lamp for a surface: one of the emitters, or a direction to the environment. Twin of
//! `shaders/shade/choose.wgsl`.

use super::lamps::{candidate_words, drawn_light, environment_samples, unit};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{
    EMITTER_DISTANT, EMITTER_DISTANT_GROUP, EMITTER_GROUP, EMITTER_KIND, EMITTER_PARALLELOGRAM, EMITTER_TRIANGLE,
    EMITTER_TWO_SIDED, Emitter, NONE, Origin,
};
use crate::kernels::simd::isa::{Isa, Work};
use crate::kernels::vector::{Vec3, cross, dot, each, least, mix, most};
use crate::math::exact::{divide, square_root};
use crate::math::sampling::pcg;

/// Squared distances below it count as it.
const LEAST_SQUARED: f32 = 1.0e-12;
/// Sums of bounds above it tell nothing, and below its inverse there is no light.
const GREATEST_SUM: f32 = 1.0e30;

/// Directions to the environment from which one is drawn.
const CANDIDATES: usize = 4;
/// What a grazing direction counts for beside one along the normal: the normal that is shaded may be another.
const GRAZING: f32 = 0.2;

/// What was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chosen {
    /// The emitter's number; [`NONE`] where none sends anything; of directions the number of the candidate.
    pub emitter: u32,
    /// Of being drawn here; of directions over that by the environment alone, 0 where none has light.
    pub probability: f32,
}

fn over_fourth_power(x: f32, squared: f32) -> f32 {
    divide(x, squared * squared)
}

fn luminance_of(c: Vec3) -> f32 {
    dot(c, [0.2126, 0.7152, 0.0722])
}

/// A bound of how much light of an area reaches a surface at p that is turned to n; see the kernel.
fn bound_of_area(e: &Emitter, p: Vec3, n: Vec3) -> f32 {
    let is_triangle = e.kind & EMITTER_KIND == EMITTER_TRIANGLE;
    let to_corner = each(|k| e.corner[k] - p[k]);
    let middle = if is_triangle { 0.333_333_34 } else { 0.5 };
    let d = each(|k| to_corner[k] + middle * (e.u[k] + e.v[k]));
    let mut front = -dot(cross(e.u, e.v), d);
    if e.kind & EMITTER_TWO_SIDED != 0 {
        front = front.abs();
    }
    let (rise_u, rise_v) = (dot(n, e.u), dot(n, e.v));
    let rise = most(most(rise_u, rise_v), if is_triangle { 0.0 } else { rise_u + rise_v });
    let above = dot(n, to_corner) + most(rise, 0.0);
    if front <= 0.0 || above <= 0.0 {
        return 0.0;
    }
    let size = 0.25 * most(dot(e.u, e.u), dot(e.v, e.v));
    let squared = most(most(dot(d, d), size), LEAST_SQUARED);
    let sent = luminance_of(e.radiance) * (if is_triangle { 0.5 } else { 1.0 } * front);
    over_fourth_power(sent * above, squared)
}

/// The same of a group.
fn bound_of_group(e: &Emitter, p: Vec3, n: Vec3) -> f32 {
    let d = each(|k| e.corner[k] - p[k]);
    let [radius, spread, behind] = e.v;
    let squared = dot(d, d);
    let held = most(most(squared, radius * radius), LEAST_SQUARED);
    let size = square_root(held);
    let above = least(dot(n, d) + radius, size);
    let front = least(spread * square_root(squared) + behind - dot(e.u, d), size);
    if front <= 0.0 || above <= 0.0 {
        return 0.0;
    }
    over_fourth_power(e.radiance[0] * front * above, held)
}

fn bound_of(e: &Emitter, p: Vec3, n: Vec3) -> f32 {
    match e.kind & EMITTER_KIND {
        EMITTER_PARALLELOGRAM | EMITTER_TRIANGLE => bound_of_area(e, p, n),
        EMITTER_GROUP => bound_of_group(e, p, n),
        EMITTER_DISTANT_GROUP => e.radiance[0],
        EMITTER_DISTANT => luminance_of(e.radiance) * most(-dot(n, e.u), 0.0),
        _ => {
            let d = each(|k| e.corner[k] - p[k]);
            let squared = most(dot(d, d), LEAST_SQUARED);
            let above = most(dot(n, d), 0.0);
            over_fourth_power(luminance_of(e.radiance) * above * square_root(squared), squared)
        }
    }
}

/// The share of the first half of a group at a surface; `None` where neither half sends anything.
pub(crate) fn share_of_first(emitters: &[Emitter], group: u32, p: Vec3, n: Vec3) -> Option<f32> {
    let group = &emitters[group as usize];
    let bound = bound_of(&emitters[group.first as usize], p, n);
    let sum = bound + bound_of(&emitters[group.second as usize], p, n);
    let share = if sum < GREATEST_SUM { divide(bound, most(sum, 1.0 / GREATEST_SUM)) } else { 0.5 };
    (sum > 1.0 / GREATEST_SUM).then_some(share)
}

/// One of the first `count` of `emitters`, which groups of them follow, for a surface at p that is turned to n, by a
/// random word.
pub fn choose_emitter(emitters: &[Emitter], count: u32, random: u32, p: Vec3, n: Vec3) -> Chosen {
    if count == 1 {
        return Chosen { emitter: 0, probability: 1.0 };
    }
    // The group of all is the first one.
    let mut chosen = Chosen { emitter: count, probability: 1.0 };
    let mut word = random;
    while chosen.emitter >= count {
        let Some(share) = share_of_first(emitters, chosen.emitter, p, n) else {
            return Chosen { emitter: NONE, probability: 0.0 };
        };
        let group = &emitters[chosen.emitter as usize];
        let is_first = unit(word) < share;
        chosen.emitter = if is_first { group.first } else { group.second };
        chosen.probability *= if is_first { share } else { 1.0 - share };
        word = pcg(word);
    }
    chosen
}

/// Chooses one of a few directions to the environment, by its light and the cosine at a surface that is turned to
/// `normal`; see the kernel.
pub struct ChooseDirection<'a, 'b> {
    /// What is bound.
    pub bound: &'a Bound<'b>,
    /// The ray.
    pub index: usize,
    /// Where rays of bounces come from.
    pub origins: &'a [Origin],
    /// Of the surface, a unit vector.
    pub normal: Vec3,
}

impl Work for ChooseDirection<'_, '_> {
    type Out = (Chosen, Vec3);

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> (Chosen, Vec3) {
        let Self { bound, index, origins, normal } = self;
        let words = candidate_words::<CANDIDATES, { 2 * CANDIDATES }>(bound, index, origins);
        let drawn = environment_samples(bound, words);
        let (mut number, mut weight, mut sum) = (0, 0.0, 0.0);
        for (k, drawn) in drawn.iter().enumerate() {
            let cosine = dot(normal, drawn.direction);
            // What lies behind is not looked up.
            if cosine.is_nan() || cosine <= 0.0 {
                continue;
            }
            let own = luminance_of(drawn_light(bound, drawn)) * mix(GRAZING, 1.0, cosine);
            sum += own;
            if unit(pcg(words[3][k])) * sum < own {
                (number, weight) = (k, own);
            }
        }
        let probability = if weight > 0.0 { CANDIDATES as f32 * weight / sum } else { 0.0 };
        let number = if weight > 0.0 { number } else { 0 };
        (Chosen { emitter: number as u32, probability }, drawn[number].direction)
    }
}

//! Twin of `shaders/denoise/denoise_begin.wgsl`: takes a frame apart, and recalls histories.

use super::buffers::{Buffers, LAYERS, LEAST_ALBEDO};
use super::grid::{Grid, each, is_sound, mixed, mixed_number};
use crate::kernels::layout::{DENOISE_LOST, DENOISE_UNSOUND, DenoiseGiven, DenoiseLit, DenoiseOwn, DenoisePast, NONE};
use crate::math::exact::divide;
use rayon::prelude::*;

fn is_sound3(c: [f32; 3]) -> bool {
    c.iter().all(|&x| is_sound(x))
}

fn is_sound_past(p: &DenoisePast) -> bool {
    is_sound3(p.long)
        && is_sound3(p.short)
        && is_sound3(p.mean)
        && [p.length, p.brightest, p.spread, p.squares].iter().all(|&x| is_sound(x))
}

/// The history of a layer where a pixel's surface was before. What is not finite there is left out.
fn recalled(past: &[DenoisePast], width: u32, g: &DenoiseGiven) -> DenoisePast {
    let mut sum = DenoisePast::default();
    if g.before == NONE {
        return sum;
    }
    let mut weights = 0.0;
    for (k, &weight) in (0..).zip(&g.shares).filter(|(_, weight)| **weight > 0.0) {
        let column = (g.before & 0xffff) + (k & 1) - 1;
        let row = (g.before >> 16) + (k >> 1) - 1;
        let old = &past[(row * width + column) as usize];
        if !is_sound_past(old) || old.length <= 0.0 {
            continue;
        }
        weights += weight;
        let share = divide(weight, weights);
        sum.long = mixed(sum.long, old.long, share);
        sum.short = mixed(sum.short, old.short, share);
        sum.mean = mixed(sum.mean, old.mean, share);
        sum.length = mixed_number(sum.length, old.length, share);
        sum.spread = mixed_number(sum.spread, old.spread, share);
        sum.squares = mixed_number(sum.squares, old.squares, share);
        sum.brightest = sum.brightest.max(old.brightest);
    }
    sum
}

/// One pixel: what goes around, the two layers; each `None` where it is not finite.
fn split(radiance: [f32; 3], g: &DenoiseGiven) -> (Option<[f32; 3]>, [Option<[f32; 3]>; LAYERS]) {
    let (mut around, mut lamps, mut other) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for k in 0..3 {
        if g.albedo[k] < LEAST_ALBEDO {
            around[k] = radiance[k];
            continue;
        }
        around[k] = g.around[k] + g.direct[k].min(0.0);
        lamps[k] = g.direct[k].max(0.0);
        other[k] = radiance[k] - g.around[k] - g.direct[k];
    }
    let is_known = is_sound3(g.around) && is_sound3(g.direct);
    let by = g.albedo.map(|x| x.max(LEAST_ALBEDO));
    let of = |light: [f32; 3]| [0, 1, 2].map(|k| divide(light[k], by[k]));
    let layers = [is_sound3(g.direct).then(|| of(lamps)), (is_known && is_sound3(radiance)).then(|| of(other))];
    ((is_known && is_sound3(around)).then_some(around), layers)
}

/// Takes a frame apart, and recalls histories.
pub fn begin(own: &DenoiseOwn, buffers: &mut Buffers) {
    let Buffers { given, past, known, lit, picture, tally, .. } = buffers;
    let (given, pixels) = (*given, Grid::new(own).pixels());
    for (past, known) in past.chunks_exact(pixels).zip(known.chunks_exact_mut(pixels)) {
        if own.remembers != 0 {
            tally[DENOISE_LOST as usize] += past.par_iter().filter(|past| !is_sound_past(past)).count() as u32;
        }
        each(known, |pixel, known| *known = recalled(past, own.width, &given[pixel]));
    }
    let (lamps, others) = lit[..LAYERS * pixels].split_at_mut(pixels);
    let layers = lamps.par_iter_mut().zip(others);
    let unsound = picture.par_iter_mut().zip(layers).zip(given).with_min_len(256);
    let unsound = unsound.map(|((picture, (lamps, others)), given)| {
        let [r, g, b, _] = *picture;
        let (around, layers) = split([r, g, b], given);
        let of = |light: Option<[f32; 3]>| match light {
            Some(color) => DenoiseLit { color, variance: 1.0 },
            None => DenoiseLit::default(),
        };
        (*lamps, *others) = (of(layers[0]), of(layers[1]));
        let [r, g, b] = around.unwrap_or_default();
        *picture = [r, g, b, 0.0];
        u32::from(around.is_none() || layers.iter().any(Option::is_none))
    });
    tally[DENOISE_UNSOUND as usize] += unsound.sum::<u32>();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_passes_untouched_and_nothing_is_lost() {
        // A mirror on a black wall: all of it goes around.
        let given = |albedo, direct, around| DenoiseGiven { albedo, direct, around, ..DenoiseGiven::default() };
        let (around, layers) = split([0.5, 0.25, 0.0], &given([0.0; 3], [0.1; 3], [0.0; 3]));
        assert_eq!((around, layers), (Some([0.5, 0.25, 0.0]), [Some([0.0; 3]); 2]));
        let (radiance, direct, albedo, shown) = ([0.9, 0.2, 0.4], [0.25, 0.05, -0.15], [0.5, 0.25, 0.001], [0.25; 3]);
        let (around, [lamps, other]) = split(radiance, &given(albedo, direct, shown));
        let [around, lamps, other] = [around, lamps, other].map(Option::unwrap);
        for k in 0..3 {
            let light = if albedo[k] < LEAST_ALBEDO { 0.0 } else { albedo[k] * (lamps[k] + other[k]) };
            assert!((around[k] + light - radiance[k]).abs() < 1e-6, "{k}");
        }
        assert!(lamps[0] == 0.5 && (other[0] - 0.8).abs() < 1e-6, "{lamps:?} {other:?}");
        assert!(lamps.iter().all(|&x| x >= 0.0) && other[1] < 0.0, "what is taken back is filtered, too");
    }

    #[test]
    fn what_is_not_finite_enters_no_layer() {
        let given = DenoiseGiven { albedo: [0.5; 3], direct: [0.1; 3], ..DenoiseGiven::default() };
        let (around, layers) = split([0.3, f32::NAN, 0.3], &given);
        assert!(around.is_some() && layers[0].is_some() && layers[1].is_none());
        let (around, layers) = split([0.3; 3], &DenoiseGiven { direct: [f32::INFINITY, 0.0, 0.0], ..given });
        assert!(around.is_none() && layers == [None; 2]);
        // The control.
        assert!(split([0.3; 3], &given).1.iter().all(Option::is_some));
    }
}

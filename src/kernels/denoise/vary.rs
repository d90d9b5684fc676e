//! Twin of `shaders/denoise/denoise_vary.wgsl`: variances of averages.

use super::buffers::{Buffers, LAYERS};
use super::grid::{Grid, difference, divided, is_same, mixed, squared};
use crate::kernels::layout::{DenoiseLit, DenoiseOwn, DenoisePast, DenoiseSeen};
use crate::math::exact::divide;
use rayon::prelude::*;

/// With fewer samples the variance of a lamp's light is that of the neighbourhood.
const FEW: f32 = 2.0;
/// The variance of sparse light is not told by a neighbourhood with fewer samples that found light.
const LEAST_FOUND: f32 = 10.0;
/// Samples that found light, of which a variance may be twice what they tell: the rare and bright ones may be missing.
const DOUBTFUL: f32 = 30.0;

/// Variance of the long averages around `pixel`, about their mean.
fn variance_around(grid: Grid, seen: &[DenoiseSeen], known: &[DenoisePast], pixel: usize, radius: i32) -> f32 {
    let (mut count, mut mean, mut squares) = (0u32, [0.0f32; 3], 0.0f32);
    let is_counted = |other: &usize| is_same(&seen[pixel], &seen[*other]) && known[*other].length > 0.0;
    for other in grid.around(pixel, radius).filter(is_counted) {
        let color = known[other].long;
        count += 1;
        let share = divide(1.0, count as f32);
        let off = difference(color, mean);
        mean = mixed(mean, color, share);
        // The square of the distance from the mean before times its share that the new mean leaves.
        squares += squared(off) * (1.0 - share);
    }
    if count < 2 { 0.0 } else { divide(squares.max(0.0), (count - 1) as f32) }
}

/// Variance of the mean of a pixel whose single samples have the variance that those around it have, each about its own
/// mean: a pixel that has seen nothing yet among others that have is not certain to be black. `None` where too few
/// found light: a share p of samples that find the same have the relative variance 1/p - 1, so that n of them have
/// found n / (1 + variance / mean²) times.
fn variance_pooled(grid: Grid, seen: &[DenoiseSeen], known: &[DenoisePast], pixel: usize, radius: i32) -> Option<f32> {
    let (mut sum, mut mean, mut freedom) = (0.0f32, [0.0f32; 3], 0.0f32);
    for other in grid.around(pixel, radius) {
        let p = &known[other];
        if p.count > 1.0 && is_same(&seen[pixel], &seen[other]) {
            // Of n samples alike n - 1 are free, and their variance is n / (n - 1) of the spread.
            let free = p.count - 1.0;
            sum += p.count * p.spread;
            mean = [0, 1, 2].map(|k| mean[k] + free * p.mean[k]);
            freedom += free;
        }
    }
    if freedom <= 0.0 {
        return None;
    }
    let of_mean = squared(divided(mean, freedom));
    let of_one = divide(sum, freedom);
    let found = divide(freedom * of_mean, (of_mean + of_one).max(f32::MIN_POSITIVE));
    (found >= LEAST_FOUND).then(|| (of_one + of_one * divide(DOUBTFUL, found)) * known[pixel].squares)
}

/// The variance of the mean of independent values, by their own spread; of fewer than two there is none.
pub fn variance_of_mean(p: &DenoisePast) -> Option<f32> {
    (p.count > 1.0).then(|| divide(p.spread * p.squares, 1.0 - p.squares))
}

/// Finds the variances of the averages of a layer.
pub fn vary(own: &DenoiseOwn, buffers: &mut Buffers) {
    let (grid, seen, radius) = (Grid::new(own), buffers.seen, own.radius);
    let pixels = grid.pixels();
    let first = own.layer as usize * pixels;
    let known = &buffers.known[first..][..pixels];
    let of = |pixel: usize| {
        let p = &known[pixel];
        let told = match own.sparse != 0 {
            true => variance_pooled(grid, seen, known, pixel, radius),
            false => variance_of_mean(p).filter(|_| p.count >= FEW),
        };
        let variance = told.unwrap_or_else(|| variance_around(grid, seen, known, pixel, radius));
        (DenoiseLit { color: p.long, variance }, u32::from(told.is_none() && own.sparse != 0))
    };
    let all: Vec<_> = (0..pixels).into_par_iter().with_min_len(256).map(of).collect();
    let lit = &mut buffers.lit[LAYERS * pixels + first..][..pixels];
    for ((lit, known), (found, young)) in lit.iter_mut().zip(&mut buffers.known[first..]).zip(all) {
        (*lit, known.young) = (found, young);
    }
}

#[cfg(test)]
mod tests {
    use super::super::advance::push;
    use super::*;

    fn of(values: impl IntoIterator<Item = [f32; 3]>) -> DenoisePast {
        let mut p = DenoisePast::default();
        for value in values {
            push(&mut p, value, (1.0, 0.0));
        }
        if p.squares > 0.0 {
            p.count = divide(1.0, p.squares);
        }
        p
    }

    #[test]
    fn equal_weights_give_the_textbook() {
        let values = [3.0f32, -1.0, 4.0, 1.5, 9.0];
        let p = of(values.map(|x| [x; 3]));
        let mean = values.iter().sum::<f32>() / 5.0;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 4.0;
        assert!((p.mean[1] - mean).abs() < 1e-6 && (p.squares - 0.2).abs() < 1e-6);
        assert!((variance_of_mean(&p).unwrap() / (variance / 5.0) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn one_value_has_no_variance() {
        assert_eq!(variance_of_mean(&of([])), None);
        let p = of([[7.0; 3]]);
        assert_eq!((p.mean, variance_of_mean(&p)), ([7.0; 3], None));
    }

    /// Directions to an environment are drawn by luminance, so that samples may differ in colour alone.
    #[test]
    fn colours_of_one_luminance_vary() {
        let color = |k: u32| if k.is_multiple_of(2) { [1.0 / 0.2126, 0.0, 0.0] } else { [0.0, 0.0, 1.0 / 0.0722] };
        let p = of((0..10).map(color));
        assert!(variance_of_mean(&p).is_some_and(|variance| variance > 0.1), "{p:?}");
    }
}

//! What sheen, thin films and stretched facets are looked up in: tables behind that of reflectances, which
//! `shaders/shade/layers.wgsl` and its twin read. They are made where some material has such layers.

use super::layout::{
    FACET_COSINES, REFLECTANCE_SIZE, SHEENS, STRETCHED, STRETCHED_AZIMUTHS, STRETCHED_COSINES, STRETCHED_ROUGHNESSES,
    STRETCHED_STRENGTHS,
};
use super::reflectance::REFLECTANCES;
use bricks::{MATERIAL_LAYERS, MATERIAL_MORE, Resident};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Angles over a turn and heights that an entry averages over.
const ANGLES: usize = 48;
const HEIGHTS: usize = 48;
/// Angles over half a turn, the other half being alike, and heights, for sheen.
const SHEEN_ANGLES: usize = 48;
const SHEEN_HEIGHTS: usize = 96;

/// Whether some material of the scene has layers, or further textures, which the same kernels read.
pub fn is_needed(resident: &Resident) -> bool {
    resident.materials.iter().any(|material| material.flags & (MATERIAL_LAYERS | MATERIAL_MORE) != 0)
}

/// The table of reflectances, and behind it:
///
/// - from [`SHEENS`] on, in the same rows and columns, what white sheen reflects of light from everywhere, and zero;
/// - from [`FACET_COSINES`] on, two entries a row and column: cosines between the view and facets, of which each stands
///   for a quarter of what white facets reflect;
/// - from [`STRETCHED`] on, what [`super::reflectance::REFLECTANCES`] says, of anisotropic facets: by azimuths (the
///   cosine of the angle from the direction of the anisotropy to the view, from 0 to 1), in them by the strength, then
///   by the root of the alpha across, then by the root of the cosine of the view.
pub static LAYER_TABLES: LazyLock<Vec<[f32; 2]>> = LazyLock::new(|| {
    let size = REFLECTANCE_SIZE as usize;
    let share = |i: usize, count: u32| i as f64 / f64::from(count - 1);
    let place = |i: usize| (share(i % size, REFLECTANCE_SIZE).powi(2), share(i / size, REFLECTANCE_SIZE).powi(2));
    let sheens = (0..size * size).into_par_iter().map(|i| {
        let (cosine, alpha) = place(i);
        [sheen(cosine.max(1e-4), alpha.max(LEAST_SHEEN_ALPHA)) as f32, 0.0]
    });
    let cosines = (0..size * size).into_par_iter().flat_map_iter(|i| {
        let (cosine, alpha) = place(i);
        let [a, b, c, d] = facet_cosines(cosine.max(1e-4), alpha.max(1e-3)).map(|x| x as f32);
        [[a, b], [c, d]]
    });
    let [columns, rows, strengths] =
        [STRETCHED_COSINES, STRETCHED_ROUGHNESSES, STRETCHED_STRENGTHS].map(|count| count as usize);
    let stretched = (0..columns * rows * strengths * STRETCHED_AZIMUTHS as usize).into_par_iter().map(|i| {
        let cosine = share(i % columns, STRETCHED_COSINES).powi(2).max(1e-4);
        let across = share(i / columns % rows, STRETCHED_ROUGHNESSES).powi(2).max(1e-3);
        let strength = share(i / (columns * rows) % strengths, STRETCHED_STRENGTHS);
        let azimuth = share(i / (columns * rows * strengths), STRETCHED_AZIMUTHS);
        stretched(cosine, [across + (1.0 - across) * strength * strength, across], azimuth).map(|x| x as f32)
    });
    let all: Vec<[f32; 2]> = REFLECTANCES.par_iter().copied().chain(sheens).chain(cosines).chain(stretched).collect();
    debug_assert_eq!([SHEENS, FACET_COSINES, STRETCHED].map(|x| x as usize / (size * size)), [1, 2, 4]);
    all
});

/// Sheen is not smoother.
pub const LEAST_SHEEN_ALPHA: f64 = 0.01;

/// The fit of masking of Conty Estevez and Kulla (2017), as KHR_materials_sheen has it.
pub(crate) fn sheen_lambda(cosine: f64, alpha: f64) -> f64 {
    let by = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f64, smooth: f64| rough + (smooth - rough) * by;
    let [a, b, c] = [mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)];
    let [d, e] = [mix(-1.97760, -1.27393), mix(-4.32054, -4.85967)];
    let l = |x: f64| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cosine < 0.5 { l(cosine).exp() } else { (2.0 * l(0.5) - l(1.0 - cosine)).exp() }
}

/// What white sheen reflects of light from everywhere. It is more than all at grazing angles where it is smooth.
fn sheen(cosine: f64, alpha: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt();
    let by_view = sheen_lambda(cosine, alpha);
    let mut sum = 0.0;
    for i in 0..SHEEN_HEIGHTS {
        // Denser where light grazes.
        let step = (i as f64 + 0.5) / SHEEN_HEIGHTS as f64;
        let (c, weight) = (step * step, 2.0 * step);
        let level = (1.0 - c * c).sqrt();
        let visible = weight / ((1.0 + by_view + sheen_lambda(c, alpha)) * 4.0 * cosine);
        for j in 0..SHEEN_ANGLES {
            let angle = PI * (j as f64 + 0.5) / SHEEN_ANGLES as f64;
            let h = [level * angle.cos() + sine, level * angle.sin(), c + cosine];
            let across = (h[0] * h[0] + h[1] * h[1]) / h.iter().map(|x| x * x).sum::<f64>();
            sum += visible * (2.0 + 1.0 / alpha) * across.powf(0.5 / alpha);
        }
    }
    // Directions are even over TAU, of which the distribution is divided.
    sum / (SHEEN_HEIGHTS * SHEEN_ANGLES) as f64
}

/// Calls `take` with the masking and the cosine between view and facet of facets that are seen along v, a unit vector
/// in the frame of the surface (Dupuy, Benyoub 2023), evenly drawn over `angles` of a turn; weights sum to `angles`
/// times ANGLES and HEIGHTS over a turn.
fn facets(v: [f64; 3], alphas: [f64; 2], mut take: impl FnMut(f64, f64)) {
    let unit = |v: [f64; 3]| {
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-300);
        v.map(|x| x / length)
    };
    let root = |d: [f64; 3]| ((alphas[0] * d[0]).powi(2) + (alphas[1] * d[1]).powi(2) + d[2] * d[2]).sqrt();
    let s = unit([alphas[0] * v[0], alphas[1] * v[1], v[2]]);
    for i in 0..ANGLES * HEIGHTS {
        let angle = TAU * ((i % ANGLES) as f64 + 0.5) / ANGLES as f64;
        let step = ((i / ANGLES) as f64 + 0.5) / HEIGHTS as f64;
        let (b, weight) = (1.0 - step * step, 2.0 * step);
        let height = 1.0 - b * (1.0 + s[2]);
        let level = (1.0 - height * height).max(0.0).sqrt();
        let h = [level * angle.cos() + s[0], level * angle.sin() + s[1], height + s[2]];
        let facet = unit([alphas[0] * h[0], alphas[1] * h[1], h[2].max(0.0)]);
        let between = (0..3).map(|k| v[k] * facet[k]).sum::<f64>();
        let d: [f64; 3] = std::array::from_fn(|k| 2.0 * between * facet[k] - v[k]);
        if d[2] > 0.0 && between > 0.0 {
            let masked = d[2] * (v[2] + root(v)) / (d[2] * root(v) + v[2] * root(d));
            take(weight * masked, between.min(1.0));
        }
    }
}

/// Of facets with alphas along and across their direction: what [`REFLECTANCES`] says. `azimuth`: cosine of the angle
/// from their direction to the view's.
fn stretched(cosine: f64, alphas: [f64; 2], azimuth: f64) -> [f64; 2] {
    let sine = (1.0 - cosine * cosine).sqrt();
    let mut sums = [0.0; 2];
    facets([sine * azimuth, sine * (1.0 - azimuth * azimuth).max(0.0).sqrt(), cosine], alphas, |masked, between| {
        let grazing = (1.0 - between).powi(5);
        sums[0] += masked * (1.0 - grazing);
        sums[1] += masked * grazing;
    });
    sums.map(|sum| sum / (ANGLES * HEIGHTS) as f64)
}

/// Mean cosines between view and facets in the four quarters, by their order, of what white facets reflect.
fn facet_cosines(cosine: f64, alpha: f64) -> [f64; 4] {
    let mut all = Vec::with_capacity(ANGLES * HEIGHTS);
    let view = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
    facets(view, [alpha; 2], |masked, between| all.push((between, masked)));
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let quarter = all.iter().map(|(_, masked)| masked).sum::<f64>() / 4.0;
    let (mut means, mut part, mut filled) = ([0.0; 4], 0, 0.0);
    for (between, mut masked) in all {
        while part < 3 && filled + masked >= quarter {
            means[part] += (quarter - filled) * between;
            masked -= quarter - filled;
            (part, filled) = (part + 1, 0.0);
        }
        means[part] += masked * between;
        filled += masked;
    }
    means.map(|mean| mean / quarter.max(1e-300))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sheen by another grid, even in angles; entries, and how they are looked up, are tested where they are used.
    #[test]
    fn sheen_is_its_integral() {
        for (cosine, alpha) in [(1.0, 1.0), (0.5, 0.5), (0.1, 0.25), (0.3, 0.04), (0.05, 0.09)] {
            let sine = f64::sqrt(1.0 - cosine * cosine);
            let (rows, columns) = (3000, 200);
            let mut sum = 0.0;
            for i in 0..rows {
                let angle = 0.5 * PI * (f64::from(i) + 0.5) / f64::from(rows);
                let (level, c) = angle.sin_cos();
                for j in 0..columns {
                    let phi = TAU * (f64::from(j) + 0.5) / f64::from(columns);
                    let h = [level * phi.cos() + sine, level * phi.sin(), c + cosine];
                    let z = h[2] * h[2] / h.iter().map(|x| x * x).sum::<f64>();
                    let distribution = (2.0 + 1.0 / alpha) * (1.0 - z).powf(0.5 / alpha) / TAU;
                    let masked = 1.0 + sheen_lambda(cosine, alpha) + sheen_lambda(c, alpha);
                    sum += distribution / (masked * 4.0 * cosine * c) * c * level;
                }
            }
            let expected = sum * 0.5 * PI * TAU / f64::from(rows * columns);
            let found = sheen(cosine, alpha);
            assert!((found - expected).abs() < 2e-3 + 5e-3 * expected, "{cosine} {alpha}: {found} is not {expected}");
        }
        // The fit gains energy there, which is why kernels divide by it.
        assert!(sheen(0.01, 0.01) > 1.5);
    }

    #[test]
    fn facets_of_one_width_are_those_of_the_other_table() {
        let size = REFLECTANCE_SIZE as usize;
        for (column, row) in [(31, 31), (16, 20), (5, 25), (20, 12)] {
            let place = |i: usize| (i as f64 / (size - 1) as f64).powi(2);
            let expected = REFLECTANCES[row * size + column].map(f64::from);
            for azimuth in [0.0, 0.6, 1.0] {
                let found = stretched(place(column), [place(row); 2], azimuth);
                assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-3), "{found:?}, not {expected:?}");
            }
            // Their mean of the fifth power is near what the table says of it.
            let cosines = facet_cosines(place(column), place(row));
            let mean = cosines.iter().map(|c| (1.0 - c).powi(5)).sum::<f64>() / 4.0;
            let share = expected[1] / (expected[0] + expected[1]);
            assert!((mean - share).abs() < 0.02, "{column} {row}: {mean}, not {share}");
            assert!(cosines.is_sorted() && cosines[0] > 0.0 && cosines[3] <= 1.0, "{cosines:?}");
        }
    }
}

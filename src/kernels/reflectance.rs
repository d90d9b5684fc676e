//! What rough surfaces reflect of light from everywhere: the table that `shaders/shade/gloss.wgsl` and its twin look
//! up.

use super::layout::REFLECTANCE_SIZE;
use bricks::Resident;
use std::f64::consts::TAU;
use std::sync::LazyLock;

/// Angles over half a turn, the other half being alike, and heights that an entry averages over: within 3e-4 of 1500
/// each way.
const ANGLES: usize = 24;
const HEIGHTS: usize = 48;

/// Rows by the square root of alpha from 0 to 1, in them columns by the square root of the cosine of the view from 0 to
/// 1: what a lobe of visible normals (Trowbridge–Reitz, Smith) with a Fresnel reflectance of 1 - (1 - cos)^5, and of (1
/// - cos)^5, reflects of light from everywhere (the split sum of Karis 2013). With F0 and F90 the sum is F0 x + F90 y.
pub static REFLECTANCES: LazyLock<Vec<[f32; 2]>> = LazyLock::new(|| {
    let last = f64::from(REFLECTANCE_SIZE - 1);
    let square = |i: u32| (f64::from(i) / last).powi(2);
    let entries = (0..REFLECTANCE_SIZE * REFLECTANCE_SIZE).map(|i| (i % REFLECTANCE_SIZE, i / REFLECTANCE_SIZE));
    entries.map(|(column, row)| entry(square(column).max(1e-4), square(row).max(1e-3)).map(|x| x as f32)).collect()
});

/// Whether some surface of the scene is not Lambertian.
pub fn is_needed(resident: &Resident) -> bool {
    resident.materials.iter().any(bricks::Material::is_glossy)
}

/// Of one view and roughness: the average of masking over facets that are seen (Heitz 2018, "Sampling the GGX
/// distribution of visible normals"), on an even grid of the numbers that they are drawn by.
fn entry(cosine: f64, alpha: f64) -> [f64; 2] {
    let sine = (1.0 - cosine * cosine).sqrt();
    let stretched = [alpha * sine, cosine];
    let length = (stretched[0].powi(2) + stretched[1].powi(2)).sqrt();
    let v = stretched.map(|x| x / length);
    let root = |c: f64| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
    let mut sums = [0.0; 2];
    for i in 0..ANGLES * HEIGHTS {
        let a = 0.5 * ((i % ANGLES) as f64 + 0.5) / ANGLES as f64;
        // A point of the cap of heights -v to 1 (Dupuy, Benyoub 2023), denser where facets are steep.
        let step = ((i / ANGLES) as f64 + 0.5) / HEIGHTS as f64;
        let (b, weight) = (1.0 - step * step, 2.0 * step);
        let height = 1.0 - b * (1.0 + v[1]);
        let level = (1.0 - height * height).max(0.0).sqrt();
        let h = [level * (TAU * a).cos() + v[0], level * (TAU * a).sin(), height + v[1]];
        let facet = [alpha * h[0], alpha * h[1], h[2].max(0.0)];
        let size = facet.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-300);
        let facet = facet.map(|x| x / size);
        let between = sine * facet[0] + cosine * facet[2];
        let leaving = 2.0 * between * facet[2] - cosine;
        if leaving > 0.0 && between > 0.0 {
            // Masking of both directions over that of the view.
            let masked = weight * leaving * (cosine + root(cosine)) / (leaving * root(cosine) + cosine * root(leaving));
            let grazing = (1.0 - between).max(0.0).powi(5);
            sums[0] += masked * (1.0 - grazing);
            sums[1] += masked * grazing;
        }
    }
    sums.map(|sum| sum / (ANGLES * HEIGHTS) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral over outgoing directions, by the distribution itself and not by drawing facets.
    fn integrated(cosine: f64, alpha: f64) -> [f64; 2] {
        let sine = (1.0 - cosine * cosine).sqrt();
        let root = |c: f64| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
        let (rows, columns) = (1200, 600);
        let mut sums = [0.0; 2];
        for i in 0..rows {
            // Even in the cosine of the direction.
            let c = (f64::from(i) + 0.5) / f64::from(rows);
            let s = (1.0 - c * c).sqrt();
            for j in 0..columns {
                let phi = TAU * (f64::from(j) + 0.5) / f64::from(columns);
                let d = [s * phi.cos(), s * phi.sin(), c];
                let h = [d[0] + sine, d[1], d[2] + cosine];
                let size = h.iter().map(|x| x * x).sum::<f64>().sqrt();
                let h = h.map(|x| x / size);
                let q = h[2] * h[2] * (alpha * alpha - 1.0) + 1.0;
                let distribution = alpha * alpha / (std::f64::consts::PI * q * q);
                let masked = 0.5 / (c * root(cosine) + cosine * root(c));
                let grazing = (1.0 - (sine * h[0] + cosine * h[2])).max(0.0).powi(5);
                let term = distribution * masked * c * TAU / f64::from(rows * columns);
                sums[0] += term * (1.0 - grazing);
                sums[1] += term * grazing;
            }
        }
        sums
    }

    #[test]
    fn entries_are_the_integrals() {
        for (cosine, alpha) in [(1.0, 1.0), (0.5, 1.0), (0.1, 0.7), (0.7, 0.3), (0.9, 0.15), (0.3, 0.4)] {
            let (found, expected) = (entry(cosine, alpha), integrated(cosine, alpha));
            for (f, e) in found.iter().zip(expected) {
                assert!((f - e).abs() < 1e-3, "{cosine} {alpha}: {found:?} instead of {expected:?}");
            }
        }
        // Without masking more would be reflected.
        assert!(entry(0.5, 1.0).iter().sum::<f64>() < 0.9);
    }

    #[test]
    fn smooth_surfaces_reflect_all() {
        let size = REFLECTANCE_SIZE as usize;
        for column in 4..size {
            let [a, b] = REFLECTANCES[column];
            assert!((a + b - 1.0).abs() < 0.01, "{column}: {a} and {b}");
        }
        assert_eq!(REFLECTANCES.len(), size * size);
        assert!(REFLECTANCES.iter().all(|[a, b]| (0.0..=1.0).contains(a) && (0.0..=1.0).contains(b) && a + b <= 1.001));
    }
}

//! Environments from equirectangular images: checked, reduced, and made ready to be drawn from and to light by
//! harmonics.

use crate::kernels::lamps::Environment;
use crate::math::alias::AliasTable;
use std::f64::consts::PI;

/// The largest environment that kernels get: 2^21 texels, 48 MiB with their table.
pub const MOST_WIDTH: u32 = 2048;
/// Its rows.
pub const MOST_HEIGHT: u32 = 1024;

/// Environments of less [`unevenness`] are even.
const EVEN: f64 = 2.0;

/// Linear radiance from all directions: rows from +Y down, the middle of a row along -Z, its right along +X.
#[derive(Clone, Debug, PartialEq)]
pub struct Equirectangular {
    /// Texels of a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Row by row.
    pub texels: Vec<[f32; 3]>,
}

/// What became of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnvironmentNotes {
    /// Texels with a value that was infinite, negative or no number; they are black.
    pub bad_texels: u64,
    /// Relative change of the power of all directions by the reduction to at most 2048 x 1024 texels.
    pub energy_change: f64,
}

/// The solid angle of a texel in `row` of `height`, times their number in a row.
fn zone(row: u32, height: u32) -> f64 {
    let at = |row: u32| (PI * f64::from(row) / f64::from(height)).cos();
    2.0 * PI * (at(row) - at(row + 1))
}

impl Equirectangular {
    /// Of `radiance` by unit direction, taken at the centres of the texels.
    pub fn of(width: u32, height: u32, radiance: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        let texel = |i: u32| {
            let (u, v) =
                ((f64::from(i % width) + 0.5) / f64::from(width), (f64::from(i / width) + 0.5) / f64::from(height));
            radiance(direction(u, v, 0.0)).map(|c| c as f32)
        };
        Self { width, height, texels: (0..width * height).map(texel).collect() }
    }

    /// The integral of radiance over all directions, each channel.
    pub fn power(&self) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (row, texels) in (0..).zip(self.texels.chunks(self.width as usize)) {
            let angle = zone(row, self.height) / f64::from(self.width);
            texels.iter().for_each(|texel| (0..3).for_each(|k| sums[k] += f64::from(texel[k]) * angle));
        }
        sums
    }

    /// Makes texels black that are no radiance; how many there were.
    fn clean(&mut self) -> u64 {
        let is_bad = |texel: &&mut [f32; 3]| !texel.iter().all(|c| c.is_finite() && *c >= 0.0);
        self.texels.iter_mut().filter(is_bad).map(|texel| *texel = [0.0; 3]).count() as u64
    }

    /// The means over the solid angles of the texels of a smaller image, which keep the power.
    fn reduced(&self, width: u32, height: u32) -> Self {
        let mut out = Self { width, height, texels: Vec::with_capacity((width * height) as usize) };
        let turn = |x: f64| (PI * x / f64::from(self.height)).cos();
        let columns: Vec<Vec<(u32, f64)>> = (0..width).map(|x| shares(x, width, self.width)).collect();
        for y in 0..height {
            let mut row = vec![[0.0; 3]; self.width as usize];
            let (mut whole, mut top) = (0.0, f64::from(y) * f64::from(self.height) / f64::from(height));
            for (source, share) in shares(y, height, self.height) {
                let angle = turn(top) - turn(top + share);
                (whole, top) = (whole + angle, top + share);
                let texels = &self.texels[(source * self.width) as usize..][..self.width as usize];
                for (sum, texel) in row.iter_mut().zip(texels) {
                    (0..3).for_each(|k| sum[k] += angle * f64::from(texel[k]));
                }
            }
            let across = f64::from(self.width) / f64::from(width) * whole;
            out.texels.extend(columns.iter().map(|shares| {
                [0, 1, 2]
                    .map(|k| (shares.iter().map(|&(x, share)| row[x as usize][k] * share).sum::<f64>() / across) as f32)
            }));
        }
        out
    }
}

/// Which of `sources` cells the cell `index` of `count` covers, and how much of each, in source cells.
fn shares(index: u32, count: u32, sources: u32) -> Vec<(u32, f64)> {
    let (from, to) = (u64::from(index) * u64::from(sources), u64::from(index + 1) * u64::from(sources));
    let count = u64::from(count);
    let share = |cell: u64| (to.min((cell + 1) * count) - from.max(cell * count)) as f64 / count as f64;
    (from / count..to.div_ceil(count)).map(|cell| (cell as u32, share(cell))).collect()
}

/// The direction at a place of the image, each coordinate 0 to 1, turned about +Y by radians.
fn direction(u: f64, v: f64, turn: f64) -> [f64; 3] {
    let (level, up) = (PI * v).sin_cos();
    let (sin, cos) = (2.0 * PI * (u - 0.5)).sin_cos();
    let (x, z) = (level * sin, -level * cos);
    let (s, c) = turn.sin_cos();
    [c * x + s * z, up, c * z - s * x]
}

/// The environment that `image` shows, of `intensity` times its radiance and turned about +Y, and what became of the
/// image.
pub fn environment(mut image: Equirectangular, intensity: f64, turn_degrees: f64) -> (Environment, EnvironmentNotes) {
    let mut notes = EnvironmentNotes { bad_texels: image.clean(), energy_change: 0.0 };
    if image.width > MOST_WIDTH || image.height > MOST_HEIGHT {
        let before: f64 = image.power().iter().sum();
        image = image.reduced(image.width.min(MOST_WIDTH), image.height.min(MOST_HEIGHT));
        if before > 0.0 {
            notes.energy_change = image.power().iter().sum::<f64>() / before - 1.0;
        }
    }
    for texel in &mut image.texels {
        *texel = texel.map(|c| (f64::from(c) * intensity).min(f32::MAX.into()) as f32);
    }
    let turn = turn_degrees.to_radians();
    let lights = image.texels.iter().zip(0..).map(|(texel, i): (_, u32)| {
        let (x, y) = (i % image.width, i / image.width);
        let (u, v) = ((f64::from(x) + 0.5) / f64::from(image.width), (f64::from(y) + 0.5) / f64::from(image.height));
        let angle = zone(y, image.height) / f64::from(image.width);
        (direction(u, v, turn), texel.map(|c| f64::from(c) * angle))
    });
    let ambient = ambient(lights).map(|color| color.map(|c| c.clamp(f32::MIN.into(), f32::MAX.into()) as f32));
    let (texels, table) = drawn(&image);
    let is_even = unevenness(&image) < EVEN;
    (Environment { width: image.width, height: image.height, texels, table, turn, ambient, is_even }, notes)
}

/// The mean of the squared luminance over all directions, over the square of its mean: 1 of a sky that is the same
/// everywhere, many thousands of one with a sun. Of a black sky 1.
fn unevenness(image: &Equirectangular) -> f64 {
    let (mut sum, mut squares, mut all) = (0.0, 0.0, 0.0);
    for (row, texels) in (0..).zip(image.texels.chunks(image.width as usize)) {
        let angle = zone(row, image.height) / f64::from(image.width);
        for light in texels.iter().map(|texel| luminance(texel.map(f64::from))) {
            (sum, squares, all) = (sum + light * angle, squares + light * light * angle, all + angle);
        }
    }
    if sum > 0.0 { squares * all / (sum * sum) } else { 1.0 }
}

/// What a white surface reflects of `lights`, each a unit direction and a radiance times a solid angle: the factors of
/// the terms of the normal in `ambient` of `shaders/shade/light.wgsl`. Of spherical harmonics up to order 2
/// (Ramamoorthi, Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001).
fn ambient(lights: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> [[f64; 3]; 9] {
    // Of each harmonic: its constant squared, times the share of its band that a cosine lobe leaves, over pi.
    let (first, second, third) = (0.25 / PI, 0.75 / PI * 2.0 / 3.0, 0.9375 / PI / 4.0);
    let factors = [first, second, second, second, 4.0 * third, 4.0 * third, third / 3.0, 4.0 * third, third];
    let mut sums = [[0.0; 3]; 9];
    for (d, light) in lights {
        for ((sum, term), factor) in sums.iter_mut().zip(terms(d)).zip(factors) {
            (0..3).for_each(|k| sum[k] += light[k] * term * factor);
        }
    }
    sums
}

/// The terms of a normal that `ambient` sums.
fn terms([x, y, z]: [f64; 3]) -> [f64; 9] {
    [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y]
}

/// Luminance of linear Rec. 709 radiance.
pub fn luminance(c: [f64; 3]) -> f64 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// The texels with the densities by which they are drawn, and their table. A texel's weight is the luminance that
/// lookups between texel centres have over it on average: wherever such a lookup finds light, directions are drawn.
fn drawn(image: &Equirectangular) -> (Vec<[f32; 4]>, Vec<[u32; 2]>) {
    let (width, height) = (image.width as usize, image.height as usize);
    let light: Vec<f64> = image.texels.iter().map(|texel| luminance(texel.map(f64::from))).collect();
    // Means of tents over the cells beside and around their peaks.
    let blend = |before: f64, at: f64, after: f64| 0.125 * (before + after) + 0.75 * at;
    let across: Vec<f64> = (0..width * height)
        .map(|i| {
            let (row, x) = (i / width * width, i % width);
            blend(light[row + (x + width - 1) % width], light[i], light[row + (x + 1) % width])
        })
        .collect();
    let weight = |i: usize| {
        let (y, x) = (i / width, i % width);
        let at = |y: usize| across[y * width + x];
        let mean = blend(at(y.saturating_sub(1)), at(y), at((y + 1).min(height - 1)));
        mean * zone(y as u32, image.height)
    };
    let weights: Vec<f64> = (0..width * height).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    // Of a black image every texel is drawn, with no density.
    let table = match AliasTable::new(&weights) {
        Some(table) => table.words(),
        None => (0..weights.len() as u32).map(|i| [u32::MAX, i]).collect(),
    };
    let density = |weight: f64| if sum > 0.0 { weight / sum * weights.len() as f64 / (2.0 * PI * PI) } else { 0.0 };
    let texels = image.texels.iter().zip(&weights);
    (texels.map(|(&[r, g, b], &weight)| [r, g, b, density(weight) as f32]).collect(), table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::pcg;

    fn noise(width: u32, height: u32) -> Equirectangular {
        let texels = (0..width * height).map(|i| [0, 1, 2].map(|k| pcg(3 * i + k) as f32 / 1e9)).collect();
        Equirectangular { width, height, texels }
    }

    #[test]
    fn unevenness_is_that_of_the_luminance() {
        // Of 1 + a y: 1 + a^2 / 3, as y^2 is 1/3 on average.
        let tilted = |a: f64| Equirectangular::of(64, 32, |[_, y, _]| [1.0 + a * y; 3]);
        for a in [0.0, 0.5, 1.0] {
            let (found, exact) = (unevenness(&tilted(a)), 1.0 + a * a / 3.0);
            assert!((found / exact - 1.0).abs() < 2e-3, "{a}: {found}");
        }
        // Light from a share of all directions alone: the inverse of the share. Turned and brighter it is the same.
        let half = Equirectangular::of(64, 32, |[_, y, _]| [f64::from(y > 0.0) * 7.0; 3]);
        assert!((unevenness(&half) - 2.0).abs() < 1e-9);
        let is_even = |image: Equirectangular| environment(image, 3.0, 70.0).0.is_even;
        assert!(is_even(tilted(1.0)) && is_even(Equirectangular::of(8, 4, |_| [0.0; 3])));
        let sun = Equirectangular::of(64, 32, |[_, y, _]| [if y > 0.98 { 1e4 } else { 1.0 }; 3]);
        assert!(unevenness(&sun) > 20.0 && !is_even(sun));
    }

    #[test]
    fn directions_are_where_the_image_says() {
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(direction(0.5, 0.5, 0.0), [0.0, 0.0, -1.0]) && near(direction(0.75, 0.5, 0.0), [1.0, 0.0, 0.0]));
        assert!(near(direction(0.3, 0.0, 0.0), [0.0, 1.0, 0.0]));
        // A quarter turn about +Y brings -Z to -X.
        assert!(near(direction(0.5, 0.5, PI / 2.0), [-1.0, 0.0, 0.0]));
    }

    #[test]
    fn reduction_keeps_power_and_bad_texels_are_counted() {
        let mut image = noise(2500, 1100);
        image.texels[77] = [1.0, f32::NAN, 1.0];
        image.texels[78] = [f32::INFINITY, 0.0, 0.0];
        image.texels[79] = [0.0, -1.0, 0.0];
        // A sun of a million does not overflow.
        image.texels[500_000] = [1e6; 3];
        let (environment, notes) = environment(image.clone(), 1.0, 0.0);
        assert_eq!((environment.width, environment.height, notes.bad_texels), (2048, 1024, 3));
        assert!(notes.energy_change.abs() < 1e-6, "{notes:?}");
        assert!(environment.texels.iter().flatten().all(|x| x.is_finite()));
        // Control: what is not weighted by solid angle loses power.
        image.clean();
        let power = |image: &Equirectangular| image.power()[0];
        let picked =
            (0..2048 * 1024).map(|i| image.texels[(i / 2048 * 1100 / 1024 * 2500 + i % 2048 * 2500 / 2048) as usize]);
        let picked = Equirectangular { width: 2048, height: 1024, texels: picked.collect() };
        assert!((power(&picked) / power(&image) - 1.0).abs() > 1e-6);
        // An image that is small enough stays as it is.
        let small = noise(64, 32);
        assert_eq!(super::environment(small, 1.0, 0.0).1, EnvironmentNotes::default());
    }

    #[test]
    fn densities_cover_what_lookups_find() {
        let mut image = Equirectangular { width: 16, height: 8, texels: vec![[0.0; 3]; 128] };
        image.texels[3 * 16] = [0.0, 0.0, 5.0];
        let (texels, table) = drawn(&image);
        let positive: Vec<usize> = (0..128).filter(|&i| texels[i][3] > 0.0).collect();
        // The texel and its neighbours, around the seam.
        assert_eq!(positive, [32, 33, 47, 48, 49, 63, 64, 65, 79]);
        assert_eq!(table.iter().filter(|entry| entry[0] == 0).count(), 119);
        // Over all angles a density sums to 1.
        for image in [image, noise(40, 20)] {
            let (texels, _) = drawn(&image);
            let sum: f64 = texels.iter().map(|t| f64::from(t[3])).sum::<f64>() * 2.0 * PI * PI / texels.len() as f64;
            assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        }
        let black = Equirectangular { width: 4, height: 2, texels: vec![[0.0; 3]; 8] };
        let (texels, table) = drawn(&black);
        assert!(texels.iter().all(|t| t[3] == 0.0) && table[7] == [u32::MAX, 7]);
    }

    #[test]
    fn harmonics_of_a_distant_light_are_known() {
        let toward = [0.6, 0.64, 0.48];
        let factors = ambient([(toward, [PI; 3])].into_iter());
        let reflected = |n: [f64; 3]| terms(n).iter().zip(&factors).map(|(t, c)| t * c[0]).sum::<f64>();
        // Along the light, and the least, where the cosine is -8/15.
        assert!((reflected(toward) - 1.0625).abs() < 1e-12, "{}", reflected(toward));
        let across = [0.8, -0.48, -0.36];
        let (c, s) = (-8.0 / 15.0f64, (1.0f64 - 64.0 / 225.0).sqrt());
        let least = reflected([0, 1, 2].map(|k| c * toward[k] + s * across[k]));
        assert!((least + 0.039_583_333).abs() < 1e-8, "{least}");
        // A white surface in a uniform environment reflects all of it, whatever its turn.
        let uniform = Equirectangular { width: 64, height: 32, texels: vec![[1.0; 3]; 2048] };
        let (environment, _) = environment(uniform, 2.0, 33.0);
        assert!((environment.ambient[0][0] - 2.0).abs() < 1e-5);
        assert!(environment.ambient[1..].iter().flatten().all(|c| c.abs() < 2e-3), "{:?}", environment.ambient);
    }
}

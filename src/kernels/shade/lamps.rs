//! The environment and the emitters, and how a point of them is drawn: twin of `shaders/shade/lamps.wgsl`.

use crate::kernels::bound::Bound;
use crate::kernels::layout::{
    EMITTER_DISTANT, EMITTER_KIND, EMITTER_SPOT, EMITTER_TRIANGLE, EMITTER_TWO_SIDED, Emitter, Origin, PARAM_BOUNCE,
    Params,
};
use crate::kernels::vector::{Vec3, cross, dot, each, least, mix, most, normalize};
use crate::math::sampling::{GOLDEN, pcg, points4, points4_of};
use crate::math::sines::sin_cos;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// The high word of a product.
fn multiply_high(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b)) >> 32) as u32
}

/// A random word as a number in [0, 1).
pub(crate) fn unit(word: u32) -> f32 {
    (word >> 8) as f32 / 16_777_216.0
}

/// Which random numbers the ray of a pixel takes to draw candidate `number` for a lamp: those that start at hits of
/// bounces take some of their own in every direction that their paths begin with.
pub fn lamp_words(bound: &Bound, index: usize, number: u32, origins: &[Origin]) -> [u32; 4] {
    points4(lamp_pixel(bound, index, origins), bound.params.stream, candidate_seed(bound, number))
}

/// [`lamp_words`] of the first `N` candidates, word by word; `BOTH` is twice `N`.
#[inline(always)]
pub fn candidate_words<const N: usize, const BOTH: usize>(
    bound: &Bound,
    index: usize,
    origins: &[Origin],
) -> [[u32; N]; 4] {
    let seeds = std::array::from_fn(|number| candidate_seed(bound, number as u32));
    points4_of::<N, BOTH>(lamp_pixel(bound, index, origins), bound.params.stream, seeds)
}

#[inline(always)]
fn lamp_pixel(bound: &Bound, index: usize, origins: &[Origin]) -> u32 {
    let pixel = bound.pixel_of(index, origins);
    if bound.has(PARAM_BOUNCE) { pixel ^ pcg(origins[index].direction.wrapping_add(1)) } else { pixel }
}

#[inline(always)]
fn candidate_seed(bound: &Bound, number: u32) -> u32 {
    bound.params.seed ^ number.wrapping_mul(GOLDEN)
}

/// The angle of the point (x, y) from the x axis, -pi to pi: Abramowitz, Stegun, "Handbook of Mathematical Functions",
/// 4.4.49, within 2e-8 of the arc tangent; 0 of the origin.
#[expect(clippy::excessive_precision, reason = "as the book has them")]
pub fn angle_of(y: f32, x: f32) -> f32 {
    let (a, b) = (x.abs(), y.abs());
    let q = least(a, b) / most(most(a, b), 1.0e-30);
    let s = q * q;
    let mut p = 0.002_866_225_7;
    p = p * s - 0.016_165_736_7;
    p = p * s + 0.042_909_613_8;
    p = p * s - 0.075_289_640_0;
    p = p * s + 0.106_562_639_3;
    p = p * s - 0.142_088_994_4;
    p = p * s + 0.199_935_508_5;
    p = p * s - 0.333_331_452_8;
    let mut angle = q + q * s * p;
    if b > a {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    if y < 0.0 { -angle } else { angle }
}

fn environment_texel(bound: &Bound, column: i32, row: i32) -> Vec3 {
    let Params { environment_width, environment_height, .. } = *bound.params;
    let width = environment_width as i32;
    // Places lie less than one width beyond the image; a division takes long.
    let x = match column {
        _ if (0..width).contains(&column) => column,
        _ if (-width..0).contains(&column) => column + width,
        _ => column.rem_euclid(width),
    };
    let y = row.clamp(0, environment_height as i32 - 1);
    crate::kernels::vector::xyz(bound.lamps.lamps().texels()[(y * width + x) as usize])
}

/// Radiance at a place in texels, between their centres bilinearly.
fn environment_lookup(bound: &Bound, place: [f32; 2]) -> Vec3 {
    let p = place.map(|x| x - 0.5);
    let f = p.map(|p| p - p.floor());
    let [x, y] = p.map(|p| p.floor() as i32);
    let texel = |x: i32, y: i32| environment_texel(bound, x, y);
    let between = |a: Vec3, b: Vec3, t: f32| each(|k| mix(a[k], b[k], t));
    let top = between(texel(x, y), texel(x + 1, y), f[0]);
    let bottom = between(texel(x, y + 1), texel(x + 1, y + 1), f[0]);
    between(top, bottom, f[1])
}

fn environment_size(p: &Params) -> [f32; 2] {
    [p.environment_width as f32, p.environment_height as f32]
}

/// Where in the image direction d, a unit vector, leads, in texels: its centre lies along -Z, its right along +X,
/// turned about +Y.
fn environment_place(params: &Params, d: Vec3) -> [f32; 2] {
    let turn = params.environment_turn;
    let x = turn[0] * d[0] - turn[1] * d[2];
    let z = turn[1] * d[0] + turn[0] * d[2];
    let u = 0.5 + angle_of(x, -z) / TAU;
    let v = angle_of((x * x + z * z).sqrt(), d[1]) / PI;
    let size = environment_size(params);
    [u * size[0], v * size[1]]
}

/// Radiance from direction d, of any length.
pub fn environment_at(bound: &Bound, d: Vec3) -> Vec3 {
    environment_lookup(bound, environment_place(bound.params, normalize(d)))
}

/// By which [`environment_sample`] draws direction d, a unit vector.
pub fn environment_density(bound: &Bound, d: Vec3) -> f32 {
    let (width, height) = (bound.params.environment_width, bound.params.environment_height);
    let [x, y] = environment_place(bound.params, d).map(|x| most(x, 0.0) as u32);
    let texel = y.min(height - 1) * width + x.min(width - 1);
    bound.lamps.lamps().texels()[texel as usize][3] / most((d[0] * d[0] + d[2] * d[2]).sqrt(), 1.0e-7)
}

/// By which the sun's disc draws d, with a part of 1 along the sun: evenly over a disc across it.
pub fn sun_density(params: &Params, d: Vec3) -> f32 {
    let squared = dot(d, d);
    squared * squared.sqrt() / (PI * params.sun_radius * params.sun_radius)
}

/// The share of a direction that was drawn by `own` where the other way draws it by `other` (Veach, Guibas 1995, the
/// power heuristic).
pub fn outweighs(own: f32, other: f32) -> f32 {
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

/// A direction to the environment that was drawn.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// A unit vector.
    pub direction: Vec3,
    /// Where it leads, in texels.
    place: [f32; 2],
    texel: u32,
    /// Sine of the angle from +Y.
    level: f32,
}

/// A direction drawn by the density that the texels state: a texel by their table, a place in it evenly over both
/// angles.
pub fn environment_sample(bound: &Bound, words: [u32; 4]) -> EnvironmentSample {
    let [sample] = environment_samples(bound, words.map(|word| [word]));
    sample
}

/// Several of them, by words as [`candidate_words`] gives them.
#[inline(always)]
pub fn environment_samples<const N: usize>(bound: &Bound, words: [[u32; N]; 4]) -> [EnvironmentSample; N] {
    let p = bound.params;
    let size = environment_size(p);
    let (mut places, mut texels, mut around, mut down) = ([[0.0; 2]; N], [0; N], [0.0; N], [0.0; N]);
    for k in 0..N {
        let mut texel = multiply_high(words[0][k], p.environment_width * p.environment_height);
        let entry = bound.lamps.lamps().texel_table()[texel as usize];
        if words[1][k] >= entry[0] {
            texel = entry[1];
        }
        let corner = [(texel % p.environment_width) as f32, (texel / p.environment_width) as f32];
        let place = [corner[0] + unit(words[2][k]), corner[1] + unit(words[3][k])];
        around[k] = TAU * (place[0] / size[0] - 0.5);
        down[k] = PI * (place[1] / size[1]);
        (places[k], texels[k]) = (place, texel);
    }
    let ([sines_around, cosines_around], [sines_down, cosines_down]) = (sin_cos(around), sin_cos(down));
    std::array::from_fn(|k| {
        let level = sines_down[k];
        let x = level * sines_around[k];
        let z = -level * cosines_around[k];
        let turn = p.environment_turn;
        let direction = [turn[0] * x + turn[1] * z, cosines_down[k], turn[0] * z - turn[1] * x];
        EnvironmentSample { direction, place: places[k], texel: texels[k], level }
    })
}

/// Radiance along a direction that was drawn over its density; zero where none is to be drawn.
pub fn drawn_light(bound: &Bound, drawn: &EnvironmentSample) -> Vec3 {
    let density = bound.lamps.lamps().texels()[drawn.texel as usize][3];
    if density > 0.0 {
        let weight = most(drawn.level, 0.0) / density;
        return environment_lookup(bound, drawn.place).map(|c| c * weight);
    }
    [0.0; 3]
}

/// The density by which a direction was drawn.
pub fn drawn_density(bound: &Bound, drawn: &EnvironmentSample) -> f32 {
    bound.lamps.lamps().texels()[drawn.texel as usize][3] / most(drawn.level, 1.0e-7)
}

/// How an emitter shines along `d`, which leads from a surface to the point of it that was drawn: what its radiance
/// times the cosine of the surface, with d unnormalised, times this over d^4 gives is the irradiance; 0 where it does
/// not shine. Of areas that is the area turned to the surface, times the length of d; points and spots fall off by
/// KHR_lights_punctual.
pub fn shines(e: &Emitter, d: Vec3) -> f32 {
    let kind = e.kind & EMITTER_KIND;
    if kind == EMITTER_DISTANT {
        return 1.0;
    }
    if kind <= EMITTER_TRIANGLE {
        // The length of the cross product is the area of the parallelogram.
        let turned = dot(d.map(|x| -x), cross(e.u, e.v));
        let from_light = most(if e.kind & EMITTER_TWO_SIDED != 0 { turned.abs() } else { turned }, 0.0);
        return if kind == EMITTER_TRIANGLE { 0.5 * from_light } else { from_light };
    }
    let squared = dot(d, d);
    let near = squared * e.v[2] * e.v[2];
    let window = (1.0 - near * near).clamp(0.0, 1.0);
    let mut cone = 1.0;
    if kind == EMITTER_SPOT {
        cone = (dot(normalize(d).map(|x| -x), e.u) * e.v[0] + e.v[1]).clamp(0.0, 1.0);
    }
    window * cone * cone * squared.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_arc_tangent() {
        let mut worst = 0.0f64;
        for i in 0..100_000 {
            let (y, x) = (f64::from(i) * 6.283_2e-5).sin_cos();
            for scale in [1.0, 1e-12, 1e12] {
                let found = angle_of((y * scale) as f32, (x * scale) as f32);
                let apart = f64::from(found) - f64::from((y * scale) as f32).atan2(f64::from((x * scale) as f32));
                worst = worst.max(apart.abs());
            }
        }
        // The polynomial's 2e-8 and a few roundings of numbers up to pi.
        assert!(worst < 6e-7, "{worst:e}");
        assert_eq!((angle_of(0.0, 0.0), angle_of(0.0, -1.0), angle_of(1.0, 0.0)), (0.0, PI, FRAC_PI_2));
    }

    #[test]
    fn high_words_are_exact() {
        // As the kernel puts them together from halves.
        let halves = |a: u32, b: u32| {
            let low = (a & 0xffff).wrapping_mul(b & 0xffff);
            let m = (a >> 16).wrapping_mul(b & 0xffff).wrapping_add(low >> 16);
            let n = (a & 0xffff).wrapping_mul(b >> 16).wrapping_add(m & 0xffff);
            (a >> 16).wrapping_mul(b >> 16).wrapping_add(m >> 16).wrapping_add(n >> 16)
        };
        for i in 0..10_000 {
            for (a, b) in [(pcg(i), pcg(!i)), (u32::MAX, u32::MAX - i), (pcg(i), 2048 * 1024), (u32::MAX, 1 << 21)] {
                assert_eq!(halves(a, b), multiply_high(a, b));
            }
        }
    }
}

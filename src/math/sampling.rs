//! Point sets and maps of the unit square: Halton, Hammersley and R2, the concentric disc, integer hashes.

/// Radical inverse of `index` in `base`: the digits mirrored at the point, in [0, 1). `base` is at least 2.
///
/// Computed in integers and divided once, so that it is exact to rounding; never 1 (Pharr, Jakob, Humphreys,
/// "Physically Based Rendering", 8.6.1).
pub fn radical_inverse(base: u32, index: u32) -> f64 {
    let (base, mut index) = (u64::from(base), u64::from(index));
    let (mut mirrored, mut power) = (0u64, 1u64);
    // power <= base * index < 2^64.
    while index > 0 {
        mirrored = mirrored * base + index % base;
        power *= base;
        index /= base;
    }
    // u64 above 2^53 round: 1 - 1/power may become 1.
    (mirrored as f64 / power as f64).min(1.0 - f64::EPSILON / 2.0)
}

/// Bases of the dimensions of [`halton`].
const PRIMES: [u32; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

/// Point `index` of the Halton sequence in `dimension` 0..12 (bases 2, 3, 5, ...; it repeats beyond), in [0, 1).
pub fn halton(index: u32, dimension: usize) -> f32 {
    below_one(radical_inverse(PRIMES[dimension % PRIMES.len()], index))
}

/// Point `index` of the Hammersley set of `count` points in the unit square: ((index + 0.5) / count, radical inverse in
/// base 2). Both are in [0, 1) for `index` below `count`; a `count` of 0 counts as 1.
pub fn hammersley(index: u32, count: u32) -> [f32; 2] {
    let x = (f64::from(index) + 0.5) / f64::from(count.max(1));
    [below_one(x), below_one(radical_inverse(2, index))]
}

/// Point `index` of the R2 sequence in the unit square, [0, 1): the centre moved by multiples of 1/p and 1/p², where
/// p^3 = p + 1 is the plastic number (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018). In
/// step with any dimensions of [`halton`] it is spread evenly over the product of both, because p is irrational, while
/// two points of the same dimensions of [`halton`] depend on one another.
pub fn r2(index: u32) -> [f32; 2] {
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    STEPS.map(|step| below_one((0.5 + f64::from(index) * step).fract()))
}

/// To f32, toward 0 where rounding would reach 1.
fn below_one(x: f64) -> f32 {
    (x as f32).clamp(0.0, 1.0 - f32::EPSILON / 2.0)
}

/// The unit square to the unit disc, areas and neighbours kept (Shirley, Chiu 1997). The centre goes to the centre.
pub fn concentric_disc([x, y]: [f32; 2]) -> [f32; 2] {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let (x, y) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    if x == 0.0 && y == 0.0 {
        return [0.0; 2];
    }
    let (r, angle) = if x.abs() > y.abs() { (x, FRAC_PI_4 * (y / x)) } else { (y, FRAC_PI_2 - FRAC_PI_4 * (x / y)) };
    [r * angle.cos(), r * angle.sin()]
}

/// A direction of the upper hemisphere about z with density cos / pi, from the disc (Malley). The height is clamped
/// at 0, because the disc's rounding can exceed 1.
pub fn cosine_hemisphere(square: [f32; 2]) -> [f32; 3] {
    let [x, y] = concentric_disc(square);
    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
}

/// A direction of the upper hemisphere about z, evenly over solid angle, from the disc: z = 1 - r².
pub fn uniform_hemisphere(square: [f32; 2]) -> [f32; 3] {
    let [x, y] = concentric_disc(square);
    let z = (1.0 - x * x - y * y).max(0.0);
    let across = (1.0 + z).sqrt();
    [x * across, y * across, z]
}

/// The golden section of 2^32.
pub const GOLDEN: u32 = 0x9e37_79b9;

/// 32 random bits from 32: the output function of PCG on one step of its generator (O'Neill 2014; Jarzynski, Olano
/// 2020). The kernels' `pcg` in `shaders/common/random.wgsl`.
pub fn pcg(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Two numbers in [0, 1) from (pixel, sample, seed): the kernels' `random2`, equal bit for bit.
pub fn random2(pixel: u32, sample: u32, seed: u32) -> [f32; 2] {
    let a = pcg(pixel ^ pcg(sample ^ pcg(seed)));
    [a, pcg(a)].map(|x| (x >> 8) as f32 / 16_777_216.0)
}

/// Four words; the first two are those of [`random2`]: the kernels' `random4`.
pub fn random4(pixel: u32, sample: u32, seed: u32) -> [u32; 4] {
    let a = pcg(pixel ^ pcg(sample ^ pcg(seed)));
    let b = pcg(a);
    let c = pcg(b);
    [a, b, c, pcg(c)]
}

/// Owen's scrambling of words whose bits are reversed, by hashes (Laine, Karras 2011, with Vegdahl's constants).
#[inline(always)]
fn scrambled<const N: usize>(mut words: [u32; N], hashes: [u32; N]) -> [u32; N] {
    for (x, hash) in words.iter_mut().zip(hashes) {
        *x ^= x.wrapping_mul(0x3d20_adea);
        *x = x.wrapping_add(hash);
        *x = x.wrapping_mul((hash >> 16) | 1);
        *x ^= x.wrapping_mul(0x0552_6c56);
        *x ^= x.wrapping_mul(0x53a2_2864);
        *x = x.reverse_bits();
    }
    words
}

/// Two words of a pixel's sample by every hash; see the kernels' `spread2`.
#[inline(always)]
fn spread2<const N: usize>(index: u32, hashes: [u32; N]) -> [[u32; N]; 2] {
    let own = scrambled([index.reverse_bits(); N], hashes);
    let mut sums = own;
    for (log2, mask) in [0x5555_5555, 0x3333_3333, 0x0f0f_0f0f, 0x00ff_00ff, 0x0000_ffff].into_iter().enumerate() {
        for sum in &mut sums {
            *sum ^= *sum >> (1 << log2) & mask;
        }
    }
    let mut by_first = hashes;
    for hash in &mut by_first {
        *hash = pcg(*hash);
    }
    let mut by_second = by_first;
    for hash in &mut by_second {
        *hash = pcg(*hash);
    }
    [scrambled(own, by_first), scrambled(sums, by_second)]
}

/// [`points4`] of several seeds, word by word. `BOTH` is twice `N`: as many vectors are made at once.
#[inline(always)]
pub fn points4_of<const N: usize, const BOTH: usize>(pixel: u32, stream: u32, seeds: [u32; N]) -> [[u32; N]; 4] {
    const { assert!(BOTH == 2 * N) }
    let mut hashes = [0; BOTH];
    for (k, seed) in seeds.into_iter().enumerate() {
        hashes[k] = pcg(pixel ^ pcg((stream >> 24) ^ pcg(seed)));
        hashes[N + k] = pcg(hashes[k] ^ GOLDEN);
    }
    let [first, second] = spread2(stream & 0x00ff_ffff, hashes);
    let mut words = [[0; N]; 4];
    for k in 0..N {
        (words[0][k], words[1][k], words[2][k], words[3][k]) = (first[k], second[k], first[N + k], second[N + k]);
    }
    words
}

/// Four words for what a stream draws at a sample of a pixel, two points that its samples spread evenly each: the low
/// 24 bits of `stream` are the sample, the others tell what is drawn. The kernels' `points4`, bit for bit.
pub fn points4(pixel: u32, stream: u32, seed: u32) -> [u32; 4] {
    points4_of::<1, 2>(pixel, stream, [seed]).map(|[word]| word)
}

/// Two numbers in [0, 1), of the first two words of [`points4`]: the kernels' `points2`.
pub fn points2(pixel: u32, stream: u32, seed: u32) -> [f32; 2] {
    points2_of([pixel], stream, seed).map(|[number]| number)
}

/// [`points2`] of several pixels, number by number.
#[inline(always)]
pub fn points2_of<const N: usize>(pixels: [u32; N], stream: u32, seed: u32) -> [[f32; N]; 2] {
    let by_stream = pcg((stream >> 24) ^ pcg(seed));
    spread2(stream & 0x00ff_ffff, pixels.map(|pixel| pcg(pixel ^ by_stream))).map(|words| words.map(number_of))
}

/// A word as a number in [0, 1).
#[inline(always)]
fn number_of(word: u32) -> f32 {
    (word >> 8) as f32 / 16_777_216.0
}

/// Frames after which [`pixel_jitter`] repeats.
const JITTER_PERIOD: u32 = 64;

/// Where in its pixels sample `sample` of frame `frame` lies, of `samples` a frame: the Halton sequence in bases 2 and
/// 3, without its first point.
pub fn pixel_jitter(frame: u32, sample: u32, samples: u32) -> [f32; 2] {
    let index = 1 + (frame % JITTER_PERIOD).wrapping_mul(samples).wrapping_add(sample);
    [halton(index, 0), halton(index, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radical_inverses_are_known_and_below_one() {
        assert_eq!((1..=6).map(|i| radical_inverse(2, i)).collect::<Vec<_>>(), [0.5, 0.25, 0.75, 0.125, 0.625, 0.375]);
        assert_eq!([1, 2, 3, 4].map(|i| radical_inverse(3, i)), [1.0 / 3.0, 2.0 / 3.0, 1.0 / 9.0, 4.0 / 9.0]);
        for base in PRIMES {
            for index in [u32::MAX, u32::MAX - 1, 1 << 31, base, base - 1] {
                let x = radical_inverse(base, index);
                assert!((0.0..1.0).contains(&x), "{base} {index} {x}");
            }
        }
        assert!(halton(u32::MAX, 0) < 1.0);
        // Mirrored twice is the same: for base 2 by bit reversal.
        for index in [3u32, 1234, 0xdead_beef] {
            assert_eq!(radical_inverse(2, index), f64::from(index.reverse_bits()) / 4_294_967_296.0);
        }
    }

    /// Greatest difference between the share of points in a box at the origin and its area.
    fn discrepancy(points: &[[f32; 2]]) -> f64 {
        let mut worst = 0.0f64;
        for i in 1..=16 {
            for j in 1..=16 {
                let (x, y) = (i as f32 / 16.0, j as f32 / 16.0);
                let inside = points.iter().filter(|p| p[0] < x && p[1] < y).count() as f64;
                worst = worst.max((inside / points.len() as f64 - f64::from(x * y)).abs());
            }
        }
        worst
    }

    /// Of 2^n samples of a pixel, from a multiple of 2^n on, each elementary interval has one point in both pairs;
    /// random ones leave some empty. Pixels, streams and seeds have points of their own.
    #[test]
    fn samples_of_a_pixel_are_spread_evenly() {
        let points = |pixel, stream: u32, seed, count: u32| -> Vec<[u32; 4]> {
            (0..count).map(|sample| points4(pixel, (stream << 24) + sample, seed)).collect()
        };
        let evenly = |points: &[[u32; 4]], [x, y]: [usize; 2]| {
            let n = points.len().ilog2();
            (0..=n).all(|wide| {
                let cell = |p: &[u32; 4]| (u64::from(p[x]) >> (32 - wide), u64::from(p[y]) >> (32 - (n - wide)));
                let mut cells: Vec<_> = points.iter().map(cell).collect();
                cells.sort_unstable();
                cells.dedup();
                cells.len() == points.len()
            })
        };
        for (pixel, stream, seed) in [(0, 0, 0), (7, 3, 1), (123_456, 80, u32::MAX)] {
            let all = points(pixel, stream, seed, 256);
            for range in [0..1, 0..4, 4..8, 0..16, 48..64, 0..64, 192..256, 0..256] {
                let part = &all[range.clone()];
                assert!(evenly(part, [0, 1]) && evenly(part, [2, 3]), "{pixel} {stream} {seed}: {range:?}");
            }
            let firsts = all.iter().map(|p| points2(pixel, (stream << 24) + (p[0] & 255), seed));
            assert!(firsts.flatten().all(|x| (0.0..1.0).contains(&x)));
            let random: Vec<_> = (0..16).map(|i| random4(pixel, i, seed)).collect();
            assert!(!evenly(&random, [0, 1]), "the control must show");
            for other in [points(pixel + 1, stream, seed, 256), points(pixel, stream ^ 1, seed, 256)] {
                assert!(all.iter().zip(&other).filter(|(a, b)| a[0] >> 24 == b[0] >> 24).count() < 12);
            }
        }
        // Nothing ties the two points of a sample, or those of two streams, to each other.
        let (a, b) = (points(5, 1, 2, 1024), points(5, 2, 2, 1024));
        let product = |x: u32, y: u32| (f64::from(x) / 2f64.powi(32) - 0.5) * (f64::from(y) / 2f64.powi(32) - 0.5);
        for (i, j) in [(0, 2), (0, 3), (1, 2), (1, 3)] {
            let within = a.iter().map(|p| product(p[i], p[j])).sum::<f64>() / 1024.0;
            let between = a.iter().zip(&b).map(|(p, q)| product(p[i], q[j])).sum::<f64>() / 1024.0;
            assert!(within.abs() < 0.012 && between.abs() < 0.012, "{i} {j}: {within} {between}");
        }
    }

    #[test]
    fn low_discrepancy_is_low() {
        let n = 1024;
        let hammersley: Vec<_> = (0..n).map(|i| hammersley(i, n)).collect();
        let halton: Vec<_> = (0..n).map(|i| [halton(i, 0), halton(i, 1)]).collect();
        let r2: Vec<_> = (0..n).map(r2).collect();
        let random: Vec<_> = (0..n).map(|i| random2(i, 0, 0)).collect();
        let [a, b, c, control] = [&hammersley, &halton, &r2, &random].map(|points| discrepancy(points));
        assert!(a < 0.005 && b < 0.01 && c < 0.01, "{a} {b} {c}");
        assert!(control > 0.01, "the control must show: {control}");
        assert!(hammersley.iter().chain(&r2).flatten().all(|x| (0.0..1.0).contains(x)));
        assert!(super::r2(u32::MAX).iter().all(|x| (0.0..1.0).contains(x)));
    }

    #[test]
    fn hemisphere_directions_are_unit_also_at_the_rim() {
        for i in 0..4096 {
            for square in [hammersley(i, 4096), [0.0, i as f32 / 4096.0], [1.0, 1.0]] {
                let d = cosine_hemisphere(square);
                let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
                assert!((length - 1.0).abs() < 1e-6 && d[2] >= 0.0, "{d:?}");
            }
        }
    }

    #[test]
    fn hashes_are_fixed_and_use_every_bit() {
        assert_eq!([0, 1, 2].map(pcg), [129_708_002, 2_831_084_092, 2_055_130_248]);
        let n = 1 << 16;
        for bit in 0..32 {
            let set = (0..n).filter(|&i| pcg(i) >> bit & 1 == 1).count() as i64;
            assert!((set - i64::from(n) / 2).abs() < 1000, "bit {bit}: {set}");
        }
        let [x, y] = random2(7, 3, 1);
        assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y) && x != y);
        assert_ne!(random2(7, 3, 1), random2(7, 3, 2));
        let words = random4(7, 3, 1);
        assert_eq!([words[0], words[1]].map(|w| (w >> 8) as f32 / 16_777_216.0), [x, y]);
    }

    #[test]
    fn jitters_spread_over_the_pixel() {
        let points: Vec<[f32; 2]> = (0..JITTER_PERIOD).map(|frame| pixel_jitter(frame, 0, 1)).collect();
        for k in 0..2 {
            let mean = points.iter().map(|p| p[k]).sum::<f32>() / JITTER_PERIOD as f32;
            assert!((mean - 0.5).abs() < 0.03 && points.iter().all(|p| (0.0..1.0).contains(&p[k])), "{mean}");
        }
        assert_eq!(pixel_jitter(3, 1, 4), pixel_jitter(13, 0, 1));
    }
}

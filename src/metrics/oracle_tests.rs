//! FLIP against the authors' implementations: `nv-flip` (their C++) in the test itself for pictures of low dynamic
//! range, and recorded results of their Python package for HDR-FLIP.

use crate::math::random::Rng;
use crate::metrics::*;

/// Linear images of 8-bit sRGB codes, which is what the oracle takes.
fn decode(width: usize, codes: &[u8]) -> Image {
    let linear = |code: u8| color::linear_from_srgb(f64::from(code) / 255.0) as f32;
    let rgb = codes.chunks_exact(3).map(|p| [linear(p[0]), linear(p[1]), linear(p[2])]).collect();
    Image { width, height: codes.len() / 3 / width, rgb }
}

/// The oracle's error map.
fn oracle(width: usize, test: &[u8], reference: &[u8], ppd: f32) -> Vec<f32> {
    let height = (test.len() / 3 / width) as u32;
    let of = |codes: &[u8]| nv_flip::FlipImageRgb8::with_data(width as u32, height, codes);
    nv_flip::flip(of(reference), of(test), ppd).to_vec()
}

fn codes(width: usize, height: usize, mut code: impl FnMut(usize, usize, usize) -> f32) -> Vec<u8> {
    let mut out = Vec::with_capacity(width * height * 3);
    for y in 0..height {
        for x in 0..width {
            out.extend((0..3).map(|c| (code(x, y, c).clamp(0.0, 1.0) * 255.0).round() as u8));
        }
    }
    out
}

/// Pairs (test, reference) of 8-bit images: noise, edges, thin lines, colour shifts, gradients.
fn pairs(width: usize, height: usize) -> Vec<(&'static str, Vec<u8>, Vec<u8>)> {
    let mut random = Rng(7);
    let noise = codes(width, height, |_, _, _| 0.5 + 0.5 * random.signed());
    let other = codes(width, height, |_, _, _| 0.5 + 0.5 * random.signed());
    let gradient = codes(width, height, |x, y, c| [x as f32 / width as f32, y as f32 / height as f32, 0.4][c]);
    let shifted = codes(width, height, |x, y, c| [x as f32 / width as f32 + 0.03, y as f32 / height as f32, 0.3][c]);
    let edges = codes(width, height, |x, y, _| if (x / 4 + y / 3) % 2 == 0 { 0.9 } else { 0.1 });
    let moved = codes(width, height, |x, y, _| if ((x + 1) / 4 + y / 3) % 2 == 0 { 0.9 } else { 0.1 });
    let lines = codes(width, height, |x, y, c| if x % 11 == 3 || y % 13 == 5 { [1.0, 0.2, 0.6][c] } else { 0.0 });
    let blue = codes(width, height, |x, _, c| if c == 2 { 0.5 + 0.5 * (x as f32 * 0.7).sin() } else { 0.2 });
    let green = codes(width, height, |x, _, c| if c == 1 { 0.5 + 0.5 * (x as f32 * 0.7).sin() } else { 0.2 });
    vec![
        ("noise against noise", noise.clone(), other),
        ("noise against a gradient", noise, gradient.clone()),
        ("shifted colours", shifted, gradient.clone()),
        ("edges moved by a pixel", edges.clone(), moved),
        ("lines against edges", lines.clone(), edges),
        ("lines against a gradient", lines, gradient),
        ("blue against green waves", blue, green),
    ]
}

#[test]
fn ldr_flip_agrees_with_nv_flip_everywhere() {
    // Wide, tall, and smaller than the filters; the default and a coarser viewing distance.
    for (width, height, ppd) in [(61, 40, PIXELS_PER_DEGREE), (33, 57, 30.0), (7, 5, PIXELS_PER_DEGREE)] {
        for (name, test, reference) in pairs(width, height) {
            let ours = flip_ldr(&decode(width, &test), &decode(width, &reference), ppd).unwrap();
            let theirs = oracle(width, &test, &reference, ppd);
            let worst = ours.errors.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-3, "{name} at {width}x{height}, {ppd} pixels per degree: {worst}");
            let mean = theirs.iter().map(|&e| f64::from(e)).sum::<f64>() / theirs.len() as f64;
            assert!((ours.mean() - mean).abs() < 1e-4 && mean > 0.005, "{name}: {} and {mean}", ours.mean());

            // Control: another viewing distance is told apart by the same tolerance.
            let other = oracle(width, &test, &reference, 0.7 * ppd);
            assert!(ours.errors.iter().zip(&other).any(|(a, b)| (a - b).abs() > 1e-3), "{name}");
        }
    }
}

/// The pictures of the recorded HDR results: 48 x 32, ten stops, coloured; number `k` of ten test images.
fn hdr_reference() -> Image {
    Image::from_fn(48, 32, |x, y| {
        let level = 2.0f64.powf(x as f64 / 48.0 * 10.0 - 5.0);
        let wave = 1.0 + 0.5 * (y as f64 * 0.9).sin();
        [level * wave, level * (2.0 - wave), 0.3 * level + 0.1].map(|c| c as f32)
    })
}

fn hdr_test(k: usize) -> Image {
    let reference = hdr_reference();
    Image::from_fn(48, 32, |x, y| {
        let p = reference.get(x, y);
        match k {
            0 => p.map(|c| c * 1.25),
            1 => reference.get((x + 1).min(47), y),
            2 => [p[0], p[1], if (x + y) % 5 == 0 { p[2] + 3.0 } else { p[2] }],
            3 => p.map(|c| c * 0.6),
            4 => reference.get(x, (y + 1).min(31)),
            5 => [p[1], p[0], p[2]],
            6 => p.map(|c| if (x + y) % 2 == 0 { c * 1.5 } else { c / 1.5 }),
            7 => p.map(|c| c.min(1.0)),
            8 => p.map(|c| if x % 9 == 4 { c * 8.0 } else { c }),
            _ => {
                let [a, b] = [reference.get(x.saturating_sub(1), y), reference.get((x + 1).min(47), y)];
                std::array::from_fn(|c| (a[c] + p[c] + b[c]) / 3.0)
            }
        }
    })
}

/// Mean HDR-FLIP of each test image by `flip-evaluator` 1.7 (ppd 67, ACES), and its range of exposures.
const RECORDED: [f64; 10] =
    [0.2826776, 0.2116486, 0.3228134, 0.4969289, 0.2806010, 0.4705343, 0.1350234, 0.4700357, 0.3255407, 0.0258913];
const RECORDED_RANGE: (f64, f64, usize) = (-3.968675, 1.299427, 6);

#[test]
fn hdr_flip_agrees_with_recorded_results() {
    let reference = hdr_reference();
    let range = exposures(&reference);
    assert!((range.start - RECORDED_RANGE.0).abs() < 1e-4 && (range.stop - RECORDED_RANGE.1).abs() < 1e-4, "{range:?}");
    assert_eq!(range.count, RECORDED_RANGE.2);
    for (k, recorded) in RECORDED.into_iter().enumerate() {
        let mean = flip_hdr(&hdr_test(k), &reference, PIXELS_PER_DEGREE).unwrap().mean();
        assert!((mean - recorded).abs() < 1e-4, "test image {k}: {mean}, recorded {recorded}");
        // Control: the dynamic range matters, a clamped comparison gives another number.
        let clamped = flip_ldr(&hdr_test(k), &reference, PIXELS_PER_DEGREE).unwrap().mean();
        assert!((clamped - recorded).abs() > 2e-3, "test image {k}: {clamped}, recorded {recorded}");
    }
}

/// RMSE, relMSE and bias of each test image, by NumPy in 64 bits.
const BY_NUMPY: [[f64; 3]; 10] = [
    [1.762198618522, 0.05126343678539, 0.8300313004058],
    [0.9469550086563, 0.01638576982877, 0.4418862244751],
    [0.7743444838045, 9.027229703826, 0.1998697924331],
    [2.819517593616, 0.1312343805673, -1.328049994623],
    [1.959051155264, 0.06368985859692, -1.40062184073e-9],
    [4.565263748645, 0.4525869090843, 0.0],
    [2.995080277692, 0.1480943981653, 0.276677096901],
    [6.611673417682, 0.2280172013999, -2.731429382745],
    [9.354921131317, 4.130655634054, 1.571286339331],
    [0.1636913990542, 7.799913505682e-5, 4.688950462474e-10],
];

#[test]
fn other_metrics_agree_with_numpy() {
    let reference = hdr_reference();
    for (k, by_numpy) in BY_NUMPY.into_iter().enumerate() {
        let own = pixel_errors(&hdr_test(k), &reference).unwrap();
        for (own, other) in [own.rmse, own.rel_mse, own.bias].into_iter().zip(by_numpy) {
            // Pictures are of f32, whose last bit may be another one where a sine is.
            assert!((own - other).abs() < 1e-6 * other.abs().max(1e-2), "test image {k}: {own}, by NumPy {other}");
        }
        // Control: the next image has other numbers.
        assert!((own.rel_mse / BY_NUMPY[(k + 1) % 10][1] - 1.0).abs() > 1e-3, "test image {k}");
    }
}

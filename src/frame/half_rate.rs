//! Secondary rays of one pixel in four, and what they bring, spread over the others, and over one another, by depth and
//! normal: joint bilateral upsampling (Kopf, Cohen, Lischinski and Uyttendaele 2007) of light without the surfaces'
//! colours. It takes out most of the noise of one sample.

use super::Pixels;
use rayon::prelude::*;

/// How many pixels with rays of their own count on each side, beyond those next to a pixel.
const REACH: usize = 1;
/// Difference of depth, as a share of it, at which a neighbour's weight has fallen to a half.
const DEPTH: f32 = 0.02;
/// Least cosine between normals of neighbours that count.
const COSINE: f32 = 0.7;
/// Least colour that light is divided by.
const LEAST_COLOR: f32 = 0.02;
/// Least sum of weights; below it neighbours count whatever they show.
const LEAST_WEIGHT: f32 = 1e-3;

/// The columns, or rows, whose pixels have rays of their own, around `x`, of `count`.
fn around(x: usize, count: usize) -> impl Iterator<Item = usize> + Clone {
    let (first, last) = ((x / 2).saturating_sub(REACH), x.div_ceil(2) + REACH);
    (first..=last).map(|cell| 2 * cell).take_while(move |&near| near < count)
}

/// How alike two pixels' surfaces are, 0 to 1.
fn likeness(pixels: &Pixels, a: usize, b: usize) -> f32 {
    let (p, q) = (pixels.depth[a], pixels.depth[b]);
    if !p.is_finite() || !q.is_finite() {
        return 0.0;
    }
    let (m, n) = (pixels.normal[a], pixels.normal[b]);
    let cosine = (m[0] * n[0] + m[1] * n[1] + m[2] * n[2] - COSINE).max(0.0) / (1.0 - COSINE);
    let apart = (p - q) / (DEPTH * p);
    cosine / (1.0 + apart * apart)
}

/// The light of `pixel`: that of neighbours with rays of their own, weighted; zero where none shows anything.
fn light_of(pixels: &Pixels, light: &[[f32; 3]], (width, height): (usize, usize), pixel: usize) -> [f32; 3] {
    let (x, y) = (pixel % width, pixel / width);
    let (mut sum, mut weights, mut plain, mut count) = ([0.0; 3], 0.0, [0.0; 3], 0.0);
    for near in around(y, height).flat_map(|row| around(x, width).map(move |column| row * width + column)) {
        let weight = likeness(pixels, pixel, near);
        let is_hit = f32::from(u8::from(pixels.depth[near].is_finite()));
        for k in 0..3 {
            sum[k] += weight * light[near][k];
            plain[k] += is_hit * light[near][k];
        }
        (weights, count) = (weights + weight, count + is_hit);
    }
    let (sum, weights) = if weights > LEAST_WEIGHT { (sum, weights) } else { (plain, count) };
    if weights > 0.0 { sum.map(|x| x / weights) } else { [0.0; 3] }
}

/// Spreads the light that secondary rays brought over a picture `width` wide: `before` has the radiance without it,
/// `after` with it. `pixels` has depth, normals and colours.
pub fn spread(width: usize, pixels: &Pixels, before: &[[f32; 4]], after: &mut [[f32; 4]]) {
    let size = (width, after.len() / width);
    let color = |pixel: usize| pixels.albedo[pixel].map(|c| c.max(LEAST_COLOR));
    let light: Vec<[f32; 3]> = (0..after.len())
        .map(|pixel| std::array::from_fn(|k| (after[pixel][k] - before[pixel][k]) / color(pixel)[k]))
        .collect();
    let lit = after.par_iter_mut().enumerate().filter(|(pixel, _)| pixels.depth[*pixel].is_finite());
    lit.for_each(|(pixel, radiance)| {
        let (light, color) = (light_of(pixels, &light, size, pixel), color(pixel));
        (0..3).for_each(|k| radiance[k] = before[pixel][k] + color[k] * light[k]);
    });
}

/// Has each pixel that shows something be no more exact than those whose light it shows.
pub fn note_states(width: usize, pixels: &mut Pixels) {
    let (states, depth) = (std::mem::take(&mut pixels.state), &pixels.depth);
    let height = states.len() / width;
    let worst = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        let near = around(y, height).flat_map(|row| around(x, width).map(move |column| row * width + column));
        let lenders = near.filter(|&near| depth[near].is_finite() && depth[pixel].is_finite());
        lenders.fold(states[pixel], |worst, near| worst.max(states[near]))
    };
    pixels.state = (0..states.len()).into_par_iter().map(worst).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::PixelState;

    /// A wall of two colours, left of it a nearer one, and right of it nothing; lit by 0.5, the nearer one by 2.
    #[test]
    fn light_spreads_over_surfaces_and_not_beyond() {
        let (width, height) = (9, 5);
        let of = |x: usize| match x {
            0..=2 => (1.0, [0.8; 3], 2.0),
            3..=4 => (10.0, [0.1; 3], 0.5),
            5..=6 => (10.1, [0.9; 3], 0.5),
            _ => (f32::INFINITY, [0.0; 3], 0.0),
        };
        let each = || (0..width * height).map(|pixel| of(pixel % width));
        let mut pixels = Pixels {
            depth: each().map(|own| own.0).collect(),
            albedo: each().map(|own| own.1).collect(),
            normal: vec![[0.0, 0.0, 1.0]; width * height],
            state: vec![PixelState::Exact; width * height],
            ..Pixels::default()
        };
        let before = vec![[0.25, 0.25, 0.25, 1.0]; width * height];
        let full: Vec<f32> = each().map(|(_, color, light)| 0.25 + color[0] * light).collect();
        let mut after = before.clone();
        for pixel in (0..width * height).filter(|pixel| ((pixel % width) | (pixel / width)) & 1 == 0) {
            after[pixel] = [full[pixel], full[pixel], full[pixel], 1.0];
        }
        spread(width, &pixels, &before, &mut after);
        for (pixel, (own, full)) in after.iter().zip(&full).enumerate() {
            assert!((own[0] / full - 1.0).abs() < 0.02, "pixel {pixel}: {} and {full}", own[0]);
        }
        // A pixel with rays of its own lends what it is not: to those around, and not to what shows nothing.
        pixels.state[2 * width + 4] = PixelState::Bounded;
        note_states(width, &mut pixels);
        let is_bounded = |pixel: usize| pixels.state[pixel] == PixelState::Bounded;
        assert!((0..width * height).filter(|&pixel| is_bounded(pixel)).all(|pixel| pixel % width < 7));
        assert!(is_bounded(2 * width + 3) && is_bounded(width + 5) && !is_bounded(0));
    }
}

//! Masks of directions: a bit a texel of the octahedral map, row by row. Twins of `shaders/dvf/dvf_dilate.wgsl`,
//! `dvf_labels.wgsl` and of `dvf_texel` in `shaders/dvf/dvf.wgsl`.

use crate::math::exact::{barrier, divide};

/// [`label`]: more directions miss than hit.
pub const VISIBLE: u32 = 0;
/// [`label`]: more hit than miss.
pub const OCCLUDED: u32 = 1;
/// [`label`]: nothing is known.
pub const UNKNOWN: u32 = 2;

/// Words of a mask of `side` texels on both axes, 8, 16 or 32.
pub fn words(side: u32) -> usize {
    (side * side / 32) as usize
}

/// The texel of a direction of any length but 0 (octahedral map: Cigolle et al. 2014; a component of 0 counts as
/// positive).
pub fn texel(d: [f32; 3], side: u32) -> u32 {
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let m = d.map(f32::abs);
    let sum = barrier(barrier(m[0] + m[1]) + m[2]);
    let (mut u, mut v) = (divide(d[0], sum), divide(d[1], sum));
    if d[2] < 0.0 {
        let folded = barrier(1.0 - v.abs());
        v = sign(v) * barrier(1.0 - u.abs());
        u = sign(u) * folded;
    }
    let at = |x: f32| (barrier(barrier(barrier(x + 1.0) * 0.5) * side as f32).max(0.0) as u32).min(side - 1);
    at(v) * side + at(u)
}

/// Whether a mask has a texel.
pub fn has(mask: &[u32], texel: u32) -> bool {
    mask[(texel / 32) as usize] >> (texel % 32) & 1 != 0
}

/// Widens a mask by a texel to all sides, across the seams of the octahedral map.
pub fn dilate(mask: &mut [u32], side: u32) {
    if mask.iter().all(|&word| word == 0) {
        return;
    }
    let (n, a_word) = (side as usize, (32 / side) as usize);
    let all_bits = u32::MAX >> (32 - side);
    let shift = |y: usize| (y % a_word * n % 32) as u32;
    let mut rows = [0u32; 32];
    for (y, row) in rows.iter_mut().enumerate().take(n) {
        *row = mask[y / a_word] >> shift(y) & all_bits;
    }
    // Along rows: beside the end of a row lies the end of the one that lies as far from the middle on the other side.
    for y in 0..n / 2 {
        let other = n - 1 - y;
        let ends = (rows[y] | rows[other]) & (1 | 1 << (side - 1));
        for row in [y, other] {
            rows[row] = (rows[row] | rows[row] << 1 | rows[row] >> 1 | ends) & all_bits;
        }
    }
    // From row to row: beyond the first lies itself, mirrored, and so beyond the last.
    let mirrored = |row: u32| row.reverse_bits() >> (32 - side);
    mask.fill(0);
    for y in 0..n {
        let before = if y > 0 { rows[y - 1] } else { mirrored(rows[0]) };
        let after = if y + 1 < n { rows[y + 1] } else { mirrored(rows[n - 1]) };
        mask[y / a_word] |= (rows[y] | before | after) << shift(y);
    }
}

/// What the masks of a cell say of it: those of directions that missed, then those that hit.
pub fn label(masks: &[u32]) -> u32 {
    let (missed, hit) = masks.split_at(masks.len() / 2);
    let count = |mask: &[u32]| mask.iter().map(|word| word.count_ones()).sum::<u32>();
    match (count(missed), count(hit)) {
        (0, 0) => UNKNOWN,
        (missed, hit) if hit > missed => OCCLUDED,
        _ => VISIBLE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::random2;

    /// The direction of the middle of a texel.
    fn middle(texel: u32, side: u32) -> [f32; 3] {
        let at = |x: u32| (x as f32 + 0.5) / side as f32 * 2.0 - 1.0;
        let (u, v) = (at(texel % side), at(texel / side));
        let z = 1.0 - u.abs() - v.abs();
        let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
        if z >= 0.0 { [u, v, z] } else { [(1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v), z] }
    }

    fn cosine(a: [f32; 3], b: [f32; 3]) -> f32 {
        let dot = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f32>();
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
    }

    #[test]
    fn every_texel_has_its_own_middle() {
        for side in [8, 16, 32] {
            for t in 0..side * side {
                assert_eq!(texel(middle(t, side), side), t, "{side}");
            }
        }
        // Zeros of either sign, and the poles.
        for d in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, -0.0, -0.0]] {
            let minus = d.map(|x: f32| if x == 0.0 { -x } else { x });
            assert_eq!(texel(d, 16), texel(minus, 16), "{d:?}");
        }
    }

    #[test]
    fn texels_next_to_each_other_on_the_sphere_are_next_to_each_other_when_widened() {
        for side in [8, 16, 32] {
            for t in 0..side * side {
                let mut mask = vec![0; words(side)];
                mask[(t / 32) as usize] |= 1 << (t % 32);
                dilate(&mut mask, side);
                let count: u32 = mask.iter().map(|word| word.count_ones()).sum();
                assert!((6..=9).contains(&count), "{side} {t}: {count}");
                let d = middle(t, side);
                // A small step in any direction stays within.
                for i in 0..64 {
                    let [a, b] = random2(i, t, side);
                    let step = 0.6 / side as f32;
                    let (around, height) = (a * std::f32::consts::TAU, 2.0 * b - 1.0);
                    let across = (1.0 - height * height).sqrt();
                    let length = cosine(d, d) * (0..3).map(|k| d[k] * d[k]).sum::<f32>().sqrt();
                    let moved = [across * around.cos(), across * around.sin(), height];
                    let near: [f32; 3] = std::array::from_fn(|k| d[k] / length + step * moved[k]);
                    assert!(has(&mask, texel(near, side)), "{side} {t}");
                }
                // And nothing far is.
                let far = (0..side * side).filter(|&other| has(&mask, other) && cosine(middle(other, side), d) < 0.0);
                assert_eq!(far.count(), 0, "{side} {t}");
            }
        }
    }

    #[test]
    fn widening_what_was_brought_together_is_bringing_together_what_was_widened() {
        for side in [8, 16, 32] {
            let random = |seed: u32| -> Vec<u32> {
                (0..words(side) as u32)
                    .map(|i| crate::math::sampling::pcg(i ^ seed << 8) & crate::math::sampling::pcg(i + 77 * seed))
                    .collect()
            };
            let (mut a, mut b) = (random(1), random(2));
            let mut both: Vec<u32> = a.iter().zip(&b).map(|(a, b)| a | b).collect();
            for mask in [&mut a, &mut b, &mut both] {
                dilate(mask, side);
            }
            assert!(both.iter().zip(a.iter().zip(&b)).all(|(c, (a, b))| *c == a | b));
        }
    }

    #[test]
    fn labels_are_by_number() {
        assert_eq!(label(&[0, 0, 0, 0]), UNKNOWN);
        assert_eq!(label(&[1, 0, 0, 0]), VISIBLE);
        assert_eq!(label(&[1, 0, 0, 2]), VISIBLE);
        assert_eq!(label(&[1, 0, 1, 2]), OCCLUDED);
    }
}

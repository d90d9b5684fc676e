//! Linear Rec. 709 colours.

/// Luminance.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// `a` on the way to `b` by the share `t`; exactly `b` at 1.
pub fn lerp(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    if t >= 1.0 { b } else { [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k])) }
}

/// Whether all of a colour is finite.
pub fn is_finite(c: &[f32; 3]) -> bool {
    c.iter().all(|x| x.is_finite())
}

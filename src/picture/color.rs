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

/// What channels count for in [`squared`]: what they do in luminance.
const SHARES: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The square of a colour or of a difference of colours: of greys that of their luminance.
pub fn squared(c: [f64; 3]) -> f64 {
    (0..3).map(|k| SHARES[k] * c[k] * c[k]).sum()
}

/// The root of [`squared`]. Unlike luminance it tells colours apart, and sees what is bright in one channel alone.
pub fn size(c: [f32; 3]) -> f32 {
    squared(c.map(f64::from)).sqrt() as f32
}

/// a - b.
pub fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

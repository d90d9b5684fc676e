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

/// A colour of a share in 0..=1: black, then violet, red, yellow, white.
pub fn heat(share: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [80.0, 20.0, 110.0], [200.0, 50.0, 50.0], [250.0, 190.0, 60.0], [255.0; 3]];
    let at = share.clamp(0.0, 1.0) * 4.0;
    let k = (at as usize).min(3);
    std::array::from_fn(|c| (STOPS[k][c] + (STOPS[k + 1][c] - STOPS[k][c]) * (at - k as f32)) as u8)
}

/// A colour of an error in 0..=1 such as FLIP's, of which small ones are told apart; white is what is no number.
pub fn error_heat(error: f32) -> [u8; 3] {
    heat(if error.is_nan() { 1.0 } else { error.max(0.0).sqrt() })
}

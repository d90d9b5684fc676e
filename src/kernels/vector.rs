//! Vectors as WGSL computes with them: component by component, sums from the left.

pub use crate::math::exact::{least, most};

/// x, y, z.
pub type Vec3 = [f32; 3];

/// A vector from its components' numbers.
#[inline(always)]
pub fn each(f: impl Fn(usize) -> f32) -> Vec3 {
    [f(0), f(1), f(2)]
}

/// The greatest component.
#[inline(always)]
pub fn most3(v: Vec3) -> f32 {
    most(v[0], most(v[1], v[2]))
}

/// WGSL's `dot`.
#[inline(always)]
pub fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// WGSL's `cross`.
#[inline(always)]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// WGSL's `normalize`.
#[inline(always)]
pub fn normalize(v: Vec3) -> Vec3 {
    let length = dot(v, v).sqrt();
    each(|k| v[k] / length)
}

/// WGSL's `mix` of two numbers.
#[inline(always)]
pub fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// The first three of four.
#[inline(always)]
pub fn xyz(v: [f32; 4]) -> Vec3 {
    [v[0], v[1], v[2]]
}

/// WGSL's `unpack4x8unorm`.
#[inline(always)]
pub fn unpack4x8unorm(word: u32) -> [f32; 4] {
    let ([a, b, c, d], unit) = (word.to_le_bytes(), |byte: u8| f32::from(byte) / 255.0);
    [unit(a), unit(b), unit(c), unit(d)]
}

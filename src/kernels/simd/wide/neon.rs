//! Eight numbers in two registers of NEON.

use super::Wide;
use std::arch::aarch64::*;
use std::ops::{Add, BitAnd, BitXor, Div, Mul, Sub};

/// A function of pairs of registers from one of registers: of their numbers or of their words.
macro_rules! by_register {
    (numbers $name:ident, $one:ident) => {
        #[inline]
        #[target_feature(enable = "neon")]
        fn $name(a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
            float32x4x2_t($one(a.0, b.0), $one(a.1, b.1))
        }
    };
    (words $name:ident, $one:ident) => {
        #[inline]
        #[target_feature(enable = "neon")]
        fn $name(a: float32x4x2_t, b: float32x4x2_t) -> float32x4x2_t {
            let ([a0, a1], [b0, b1]) = (words(a), words(b));
            float32x4x2_t(vreinterpretq_f32_u32($one(a0, b0)), vreinterpretq_f32_u32($one(a1, b1)))
        }
    };
}

/// A comparison of pairs of registers from one of registers: of their numbers or of their words.
macro_rules! by_comparison {
    (numbers $name:ident, $one:ident) => {
        #[inline]
        #[target_feature(enable = "neon")]
        fn $name(a: float32x4x2_t, b: float32x4x2_t) -> u32 {
            lanes([$one(a.0, b.0), $one(a.1, b.1)])
        }
    };
    (words $name:ident, $one:ident) => {
        #[inline]
        #[target_feature(enable = "neon")]
        fn $name(a: float32x4x2_t, b: float32x4x2_t) -> u32 {
            let ([a0, a1], [b0, b1]) = (words(a), words(b));
            lanes([$one(a0, b0), $one(a1, b1)])
        }
    };
}

#[inline]
#[target_feature(enable = "neon")]
fn words(x: float32x4x2_t) -> [uint32x4_t; 2] {
    [vreinterpretq_u32_f32(x.0), vreinterpretq_u32_f32(x.1)]
}

/// A bit for each lane that has all bits set; the others have none.
#[inline]
#[target_feature(enable = "neon")]
fn lanes(mask: [uint32x4_t; 2]) -> u32 {
    const BITS: [u16; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
    // SAFETY: all eight words are there.
    let bits = unsafe { vld1q_u16(BITS.as_ptr()) };
    let halves = vuzp1q_u16(vreinterpretq_u16_u32(mask[0]), vreinterpretq_u16_u32(mask[1]));
    u32::from(vaddvq_u16(vandq_u16(halves, bits)))
}

/// [`crate::math::exact::most`]. FMAX is another function: of zeros, and where one is no number.
#[inline]
#[target_feature(enable = "neon")]
pub fn most_of_four(a: float32x4_t, b: float32x4_t) -> float32x4_t {
    vbslq_f32(vcgtq_f32(a, b), a, b)
}

/// [`crate::math::exact::least`].
#[inline]
#[target_feature(enable = "neon")]
pub fn least_of_four(a: float32x4_t, b: float32x4_t) -> float32x4_t {
    vbslq_f32(vcltq_f32(a, b), a, b)
}

by_register!(numbers add, vaddq_f32);
by_register!(numbers sub, vsubq_f32);
by_register!(numbers mul, vmulq_f32);
by_register!(numbers div, vdivq_f32);
by_register!(numbers most, most_of_four);
by_register!(numbers least, least_of_four);
by_register!(words and, vandq_u32);
by_register!(words xor, veorq_u32);
by_register!(words add_bits, vaddq_u32);

by_comparison!(numbers less, vcltq_f32);
by_comparison!(numbers less_equal, vcleq_f32);
by_comparison!(words same_bits, vceqq_u32);
by_comparison!(words less_bits, vcltq_u32);

#[inline]
#[target_feature(enable = "neon")]
fn fused(a: float32x4x2_t, by: float32x4x2_t, plus: float32x4x2_t) -> float32x4x2_t {
    float32x4x2_t(vfmaq_f32(plus.0, a.0, by.0), vfmaq_f32(plus.1, a.1, by.1))
}

#[inline]
#[target_feature(enable = "neon")]
fn abs(x: float32x4x2_t) -> float32x4x2_t {
    float32x4x2_t(vabsq_f32(x.0), vabsq_f32(x.1))
}

#[inline]
#[target_feature(enable = "neon")]
fn sqrt(x: float32x4x2_t) -> float32x4x2_t {
    float32x4x2_t(vsqrtq_f32(x.0), vsqrtq_f32(x.1))
}

#[inline]
#[target_feature(enable = "neon")]
fn set(x: f32) -> float32x4x2_t {
    float32x4x2_t(vdupq_n_f32(x), vdupq_n_f32(x))
}

/// # Safety
/// Eight numbers are there.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn load(from: *const f32) -> float32x4x2_t {
    // SAFETY: as the caller promises.
    unsafe { float32x4x2_t(vld1q_f32(from), vld1q_f32(from.add(4))) }
}

/// # Safety
/// There is room for eight numbers.
#[inline]
#[target_feature(enable = "neon")]
unsafe fn store(to: *mut f32, x: float32x4x2_t) {
    // SAFETY: as the caller promises.
    unsafe {
        vst1q_f32(to, x.0);
        vst1q_f32(to.add(4), x.1);
    }
}

#[inline]
#[target_feature(enable = "neon")]
fn blend(bits: u32, yes: float32x4x2_t, no: float32x4x2_t) -> float32x4x2_t {
    const BITS: [u32; 8] = [1, 2, 4, 8, 16, 32, 64, 128];
    // SAFETY: all eight words are there.
    let [low, high] = unsafe { [vld1q_u32(BITS.as_ptr()), vld1q_u32(BITS.as_ptr().add(4))] };
    let bits = vdupq_n_u32(bits);
    float32x4x2_t(vbslq_f32(vtstq_u32(bits, low), yes.0, no.0), vbslq_f32(vtstq_u32(bits, high), yes.1, no.1))
}

impl Eight {
    /// Of numbers in registers.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub unsafe fn of(x: float32x4x2_t) -> Self {
        Self(x)
    }
}

over_intrinsics!(
    Eight,
    float32x4x2_t,
    8,
    add,
    sub,
    mul,
    div,
    most,
    least,
    sqrt,
    set,
    load,
    store,
    abs,
    and,
    xor,
    less,
    less_equal,
    same_bits,
    less_bits,
    add_bits,
    blend,
    fused
);

//! Eight numbers with AVX2, sixteen with AVX-512.

use super::Wide;
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitXor, Div, Mul, Sub};

#[inline]
#[target_feature(enable = "avx2")]
fn lanes(mask: __m256) -> u32 {
    _mm256_movemask_ps(mask) as u32
}

#[inline]
#[target_feature(enable = "avx2")]
fn abs(x: __m256) -> __m256 {
    _mm256_andnot_ps(_mm256_set1_ps(-0.0), x)
}

#[inline]
#[target_feature(enable = "avx2")]
fn less(a: __m256, b: __m256) -> u32 {
    lanes(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))
}

#[inline]
#[target_feature(enable = "avx2")]
fn less_equal(a: __m256, b: __m256) -> u32 {
    lanes(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))
}

#[inline]
#[target_feature(enable = "avx2")]
fn same_bits(a: __m256, b: __m256) -> u32 {
    lanes(_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b))))
}

#[inline]
#[target_feature(enable = "avx2")]
fn less_bits(a: __m256, b: __m256) -> u32 {
    // There is the comparison of signed numbers alone.
    let signed = |x: __m256| _mm256_xor_si256(_mm256_castps_si256(x), _mm256_set1_epi32(i32::MIN));
    lanes(_mm256_castsi256_ps(_mm256_cmpgt_epi32(signed(b), signed(a))))
}

#[inline]
#[target_feature(enable = "avx2")]
fn add_bits(a: __m256, b: __m256) -> __m256 {
    _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)))
}

#[inline]
#[target_feature(enable = "avx2")]
fn blend(bits: u32, yes: __m256, no: __m256) -> __m256 {
    let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    let set = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(bits as i32), lane), lane);
    _mm256_blendv_ps(no, yes, _mm256_castsi256_ps(set))
}

impl Eight {
    /// Of numbers in a register.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub unsafe fn of(x: __m256) -> Self {
        Self(x)
    }
}

over_intrinsics!(
    Eight,
    __m256,
    8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_max_ps,
    _mm256_min_ps,
    _mm256_sqrt_ps,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    abs,
    _mm256_and_ps,
    _mm256_xor_ps,
    less,
    less_equal,
    same_bits,
    less_bits,
    add_bits,
    blend,
    _mm256_fmadd_ps
);

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn abs_512(x: __m512) -> __m512 {
    _mm512_andnot_ps(_mm512_set1_ps(-0.0), x)
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn less_512(a: __m512, b: __m512) -> u32 {
    u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn less_equal_512(a: __m512, b: __m512) -> u32 {
    u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn same_bits_512(a: __m512, b: __m512) -> u32 {
    u32::from(_mm512_cmpeq_epi32_mask(_mm512_castps_si512(a), _mm512_castps_si512(b)))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn less_bits_512(a: __m512, b: __m512) -> u32 {
    u32::from(_mm512_cmplt_epu32_mask(_mm512_castps_si512(a), _mm512_castps_si512(b)))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn add_bits_512(a: __m512, b: __m512) -> __m512 {
    _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(a), _mm512_castps_si512(b)))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn blend_512(bits: u32, yes: __m512, no: __m512) -> __m512 {
    _mm512_mask_blend_ps(bits as u16, no, yes)
}

impl Sixteen {
    /// Of numbers in a register.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub unsafe fn of(x: __m512) -> Self {
        Self(x)
    }

    /// The register.
    #[inline(always)]
    pub fn register(self) -> __m512 {
        self.0
    }
}

over_intrinsics!(
    Sixteen,
    __m512,
    16,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_max_ps,
    _mm512_min_ps,
    _mm512_sqrt_ps,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    abs_512,
    _mm512_and_ps,
    _mm512_xor_ps,
    less_512,
    less_equal_512,
    same_bits_512,
    less_bits_512,
    add_bits_512,
    blend_512,
    _mm512_fmadd_ps
);

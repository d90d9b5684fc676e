//! AVX2 and AVX-512. Single rays meet eight children with AVX2 in both.

use super::{Isa, Lanes, MOST, Work};
use crate::kernels::simd::wide::x86::{Eight, Sixteen};
use crate::kernels::trace::node::{FramedRay, NodeHits, UNIT};
use bricks::Node;
use std::arch::x86_64::*;

/// AVX2 and FMA, of x86-64: all processors that have the first but for one family have the second.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

impl Avx2 {
    /// If the processor has it.
    pub fn detect() -> Option<Self> {
        (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(()))
    }
}

/// AVX-512, of x86-64, and AVX2 for single rays.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

impl Avx512 {
    /// If the processor has it.
    pub fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq");
        (has && Avx2::detect().is_some()).then_some(Self(()))
    }
}

isa_over_intrinsics!(Avx2, Eight, Eight);
isa_over_intrinsics!(
    Avx512, Sixteen, Eight;

    isa_over_intrinsics!(fn columns(rows: &[&[f32; 4]; MOST]) -> [Sixteen; 4] {
        let [a, b, c, d] = columns(rows);
        [Sixteen::of(a), Sixteen::of(b), Sixteen::of(c), Sixteen::of(d)]
    });
    isa_over_intrinsics!(fn rows(columns: [Sixteen; 4], to: &mut [[f32; 4]; MOST]) -> () {
        let [a, b, c, d] = columns;
        rows([a.register(), b.register(), c.register(), d.register()], to)
    });
    isa_over_intrinsics!(fn pick(from: &[f32; 64], at: &[u32]) -> Sixteen { Sixteen::of(pick(from, at)) });
);

/// Of four matrices side by side, of four rows and columns each, the columns as rows.
#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn turned([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    let (low, high) =
        ([_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d)], [_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d)]);
    [
        _mm512_shuffle_ps::<0b01_00_01_00>(low[0], low[1]),
        _mm512_shuffle_ps::<0b11_10_11_10>(low[0], low[1]),
        _mm512_shuffle_ps::<0b01_00_01_00>(high[0], high[1]),
        _mm512_shuffle_ps::<0b11_10_11_10>(high[0], high[1]),
    ]
}

#[inline]
#[target_feature(enable = "avx2,avx512f,avx512dq")]
fn columns(rows: &[&[f32; 4]; MOST]) -> [__m512; 4] {
    let every_fourth = |k: usize| {
        let x = _mm512_castps128_ps512(vector(rows[k]));
        let x = _mm512_insertf32x4::<1>(x, vector(rows[4 + k]));
        let x = _mm512_insertf32x4::<2>(x, vector(rows[8 + k]));
        _mm512_insertf32x4::<3>(x, vector(rows[12 + k]))
    };
    turned([every_fourth(0), every_fourth(1), every_fourth(2), every_fourth(3)])
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn rows(columns: [__m512; 4], to: &mut [[f32; 4]; MOST]) {
    let rows = turned(columns);
    for k in 0..4 {
        let every_fourth = [
            _mm512_castps512_ps128(rows[k]),
            _mm512_extractf32x4_ps::<1>(rows[k]),
            _mm512_extractf32x4_ps::<2>(rows[k]),
            _mm512_extractf32x4_ps::<3>(rows[k]),
        ];
        for i in 0..4 {
            // SAFETY: there is room for four numbers.
            unsafe { _mm_storeu_ps(to[4 * i + k].as_mut_ptr(), every_fourth[i]) }
        }
    }
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn pick(from: &[f32; 64], at: &[u32]) -> __m512 {
    let at = &at[..MOST];
    // SAFETY: all words, and all numbers from those places on, are there.
    let (at, [a, b, c, d]) = unsafe {
        let quarter = |k: usize| _mm512_loadu_ps(from[16 * k..].as_ptr());
        (_mm512_loadu_si512(at.as_ptr().cast()), [quarter(0), quarter(1), quarter(2), quarter(3)])
    };
    // Each looks at the lowest five bits.
    let (low, high) = (_mm512_permutex2var_ps(a, at, b), _mm512_permutex2var_ps(c, at, d));
    _mm512_mask_blend_ps(_mm512_test_epi32_mask(at, _mm512_set1_epi32(32)), low, high)
}

#[inline(always)]
fn prefetch_line(at: *const u8) {
    // SAFETY: SSE is part of x86-64, and a prefetch of any address does no harm.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn vector(v: &[f32; 4]) -> __m128 {
    // SAFETY: all four numbers are there.
    unsafe { _mm_loadu_ps(v.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn magnitude(x: __m128) -> __m128 {
    _mm_andnot_ps(_mm_set1_ps(-0.0), x)
}

/// The greatest of the first three lanes, in all.
#[inline]
#[target_feature(enable = "avx2")]
fn most3(x: __m128) -> __m128 {
    let y = _mm_shuffle_ps::<0b01_01_01_01>(x, x);
    let z = _mm_shuffle_ps::<0b10_10_10_10>(x, x);
    let most = _mm_max_ps(x, _mm_max_ps(y, z));
    _mm_shuffle_ps::<0>(most, most)
}

/// Eight bounds as numbers.
#[inline]
#[target_feature(enable = "avx2")]
fn numbers(bytes: &[u8; 8]) -> __m256 {
    _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(*bytes))))
}

/// Eight words as numbers.
#[inline]
#[target_feature(enable = "avx2")]
fn steps(words: &[u16; 8]) -> __m256 {
    // SAFETY: all eight words are there.
    let words = unsafe { _mm_loadu_si128(words.as_ptr().cast()) };
    _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(words))
}

/// Origin and steps of a node's grid; the last lanes are 0.
#[inline]
#[target_feature(enable = "avx2")]
fn grid(node: &Node) -> [__m128; 2] {
    let [first, ..]: &[[u32; 4]; 5] = bytemuck::cast_ref(node);
    // The last word holds the exponents and the mask of inner children; as a lane it is 0, because small numbers are
    // slow.
    let exponents = _mm_cvtepu8_epi32(_mm_cvtsi32_si128((first[3] & 0x00ff_ffff) as i32));
    let p = vector(bytemuck::cast_ref(first));
    [_mm_insert_ps::<0b1000>(p, p), _mm_castsi128_ps(_mm_slli_epi32::<23>(exponents))]
}

/// Four numbers, and four zeros.
#[inline]
#[target_feature(enable = "avx2")]
fn extended(x: __m128) -> __m256 {
    _mm256_zextps128_ps256(x)
}

/// Where `ray` enters the children of a node, and where it leaves them: `NodeFrame::new` and `node_hits`, with
/// `slack` where there is any.
#[inline]
#[target_feature(enable = "avx2")]
fn distances_to(ray: &FramedRay, lanes: &Lanes, node: &Node, slack: Option<f32>, t_max: f32) -> [__m256; 2] {
    let [p, s] = grid(node);
    let low = vector(&lanes.offset_low);
    let pc = _mm_add_ps(_mm_add_ps(p, vector(&lanes.offset_high)), low);
    let origin = vector(&lanes.origin);
    let w = _mm_sub_ps(pc, origin);
    let m = most3(_mm_add_ps(magnitude(w), _mm_mul_ps(_mm_set1_ps(255.0), s)));
    let mut all = _mm_mul_ps(_mm_set1_ps(64.0 * UNIT), m);
    if let Some(slack) = slack {
        let o = most3(magnitude(origin));
        all = _mm_add_ps(all, _mm_mul_ps(_mm_set1_ps(slack), _mm_add_ps(m, o)));
    }
    let delta = _mm_add_ps(
        _mm_add_ps(all, _mm_mul_ps(_mm_set1_ps(4.0 * UNIT), magnitude(pc))),
        _mm_mul_ps(_mm_set1_ps(2.0 * UNIT), magnitude(low)),
    );
    let inverse = vector(&lanes.inverse);
    let sign = _mm_and_ps(inverse, _mm_set1_ps(-0.0));
    let signed_delta = _mm_xor_ps(delta, sign);
    let scale = _mm_mul_ps(s, inverse);
    let near = _mm_mul_ps(_mm_sub_ps(w, signed_delta), inverse);
    let far = _mm_mul_ps(_mm_add_ps(w, signed_delta), inverse);
    let negative = _mm_movemask_ps(inverse) as usize;
    let bounds = [&node.lo, &node.hi];
    let (x, y, z) = (negative & 1, (negative >> 1) & 1, (negative >> 2) & 1);
    let distances = |bytes: &[u8; 8], scale: __m128, offset: __m128| {
        _mm256_add_ps(_mm256_mul_ps(numbers(bytes), _mm256_broadcastss_ps(scale)), _mm256_broadcastss_ps(offset))
    };
    let lane = |v: __m128| (v, _mm_shuffle_ps::<0b01_01_01_01>(v, v), _mm_shuffle_ps::<0b10_10_10_10>(v, v));
    let (scale_x, scale_y, scale_z) = lane(scale);
    let (near_x, near_y, near_z) = lane(near);
    let (far_x, far_y, far_z) = lane(far);
    let tn = _mm256_max_ps(
        _mm256_max_ps(distances(&bounds[x][0], scale_x, near_x), distances(&bounds[y][1], scale_y, near_y)),
        _mm256_max_ps(distances(&bounds[z][2], scale_z, near_z), _mm256_set1_ps(ray.t_min)),
    );
    let tf = _mm256_min_ps(
        _mm256_min_ps(distances(&bounds[1 - x][0], scale_x, far_x), distances(&bounds[1 - y][1], scale_y, far_y)),
        _mm256_min_ps(distances(&bounds[1 - z][2], scale_z, far_z), _mm256_set1_ps(t_max)),
    );
    [tn, tf]
}

/// All bits set in the lanes of the children that `ray` enters.
#[inline]
#[target_feature(enable = "avx2")]
fn entered(ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> __m256i {
    let [near, far] = distances_to(ray, lanes, node, None, t_max);
    _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far))
}

#[target_feature(enable = "avx2")]
fn hits(ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> NodeHits {
    let [near, far] = distances_to(ray, lanes, node, Some(slack), t_max);
    let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32;
    let mut hits = NodeHits { near: [0.0; 8], mask };
    // SAFETY: there is room for eight numbers.
    unsafe { _mm256_storeu_ps(hits.near.as_mut_ptr(), near) };
    hits
}

/// The lanes, all in one.
#[inline]
#[target_feature(enable = "avx2")]
fn any(x: __m256i) -> u32 {
    let x = _mm_or_si128(_mm256_castsi256_si128(x), _mm256_extracti128_si256::<1>(x));
    let x = _mm_or_si128(x, _mm_unpackhi_epi64(x, x));
    _mm_cvtsi128_si32(_mm_or_si128(x, _mm_srli_si128::<4>(x))) as u32
}

#[inline]
#[target_feature(enable = "avx2")]
fn meta(node: &Node) -> __m256i {
    _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(node.meta)))
}

#[inline]
#[target_feature(enable = "avx2")]
fn open(ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32 {
    let entered = entered(ray, lanes, node, t_max);
    let what = meta(node);
    let count = _mm256_and_si256(_mm256_srli_epi32::<5>(what), entered);
    let both = _mm256_set1_epi32(24);
    // In nodes that are valid, and all have been checked, these are inner children, and their count is 1.
    let inner = _mm256_cmpeq_epi32(_mm256_and_si256(what, both), both);
    let slot = _mm256_xor_si256(_mm256_and_si256(what, _mm256_set1_epi32(7)), _mm256_set1_epi32(ray.flip as i32));
    let priority = _mm256_sub_epi32(_mm256_set1_epi32(31), slot);
    let first = _mm256_and_si256(what, _mm256_set1_epi32(31));
    any(_mm256_sllv_epi32(count, _mm256_blendv_epi8(first, priority, inner)))
}

/// Does `work`, compiled for AVX2.
#[target_feature(enable = "avx2,fma")]
pub(super) fn run_avx2<W: Work>(isa: Avx2, work: W) -> W::Out {
    work.run(isa)
}

/// Does `work`, compiled for AVX-512.
#[target_feature(enable = "avx2,fma,avx512f,avx512dq")]
pub(super) fn run_avx512<W: Work>(isa: Avx512, work: W) -> W::Out {
    work.run(isa)
}

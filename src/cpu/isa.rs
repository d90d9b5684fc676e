//! Instruction sets: the node test for eight children at once, where the processor has the instructions for it. All give the same
//! bits: the same operations in the same order, none of them fused.

use super::node::{FramedRay, by_priority, node_hits, traversal_mask};
use super::vector::{Vec3, xyz};
use super::wide::{Portable, Wide};
use bricks::Node;

/// A ray and its offset from the space of nodes as vectors of four, the last of no meaning.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(16))]
pub struct Lanes {
    origin: [f32; 4],
    inverse: [f32; 4],
    offset_high: [f32; 4],
    offset_low: [f32; 4],
}

impl Lanes {
    /// Of `ray` in a frame in which nodes lie at the offset.
    #[inline(always)]
    pub fn new(ray: &FramedRay, offset_high: Vec3, offset_low: Vec3) -> Self {
        let four = |v: Vec3| [v[0], v[1], v[2], 0.0];
        let (origin, inverse) = (four(ray.origin), four(ray.frame.inv));
        Self { origin, inverse, offset_high: four(offset_high), offset_low: four(offset_low) }
    }
}

/// What nodes are tested by. A value of the type is proof that the processor has the instructions.
pub trait Isa: Copy + Send + Sync {
    /// Numbers of several rays.
    type Wide: Wide;

    /// Eight numbers.
    type Eight: Wide;

    /// The same number in all eight lanes.
    fn eight(self, x: f32) -> Self::Eight;

    /// Eight numbers, one a lane.
    fn load_eight(self, from: &[f32; 8]) -> Self::Eight;

    /// Eight bounds as numbers.
    fn numbers(self, bytes: &[u8; 8]) -> Self::Eight;

    /// Origin and steps of a node's grid by axis; the other lanes are 0.
    fn grid(self, node: &Node) -> [Self::Eight; 2];

    /// The same number in all lanes.
    fn splat(self, x: f32) -> Self::Wide;

    /// The first of `from`, a number a lane.
    fn load(self, from: &[f32]) -> Self::Wide;

    /// The same word in all lanes.
    #[inline(always)]
    fn splat_bits(self, x: u32) -> Self::Wide {
        self.splat(f32::from_bits(x))
    }

    /// The first of `from`, a word a lane.
    #[inline(always)]
    fn load_bits(self, from: &[u32]) -> Self::Wide {
        self.load(bytemuck::cast_slice(from))
    }

    /// Asks for the memory of `at` to be brought near, for it will be read.
    #[inline(always)]
    fn prefetch<T>(self, _at: &T) {}

    /// The traversal mask of a brick's node ([`traversal_mask`]): what `ray` enters of it up to `t_max`. `lanes` are the ray's.
    fn open(self, ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32;

    /// The children of a node of the top level that `ray` enters up to `t_max`, inner ones and leaves alike, by priority in the
    /// high byte. `slack`: see [`super::node::NodeFrame::new`].
    fn open_top(self, ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> u32;
}

/// No more than every processor has.
#[derive(Clone, Copy, Debug)]
pub struct Scalar;

impl Isa for Scalar {
    type Wide = Portable;
    type Eight = Portable;

    #[inline(always)]
    fn eight(self, x: f32) -> Portable {
        Portable([x; 8])
    }

    #[inline(always)]
    fn load_eight(self, from: &[f32; 8]) -> Portable {
        Portable(*from)
    }

    #[inline(always)]
    fn numbers(self, bytes: &[u8; 8]) -> Portable {
        Portable(bytes.map(f32::from))
    }

    #[inline(always)]
    fn grid(self, node: &Node) -> [Portable; 2] {
        let [x, y, z] = node.origin;
        let [i, j, k] = node.exponent.map(|e| f32::from_bits(u32::from(e) << 23));
        [Portable([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0]), Portable([i, j, k, 0.0, 0.0, 0.0, 0.0, 0.0])]
    }

    #[inline(always)]
    fn splat(self, x: f32) -> Portable {
        Portable([x; 8])
    }

    #[inline(always)]
    fn load(self, from: &[f32]) -> Portable {
        let mut lanes = [0.0; 8];
        lanes.copy_from_slice(&from[..8]);
        Portable(lanes)
    }

    #[inline(always)]
    fn open(self, ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32 {
        let (high, low) = (xyz(lanes.offset_high), xyz(lanes.offset_low));
        let entered = node_hits(ray, node, high, low, 0.0, t_max).mask;
        traversal_mask(entered, node, ray.flip)
    }

    #[inline(always)]
    fn open_top(self, ray: &FramedRay, _: &Lanes, node: &Node, slack: f32, t_max: f32) -> u32 {
        by_priority(node_hits(ray, node, [0.0; 3], [0.0; 3], slack, t_max).mask, node, ray.flip)
    }
}

/// AVX2, of x86-64.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    /// If the processor has it.
    pub fn detect() -> Option<Self> {
        std::arch::is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

/// AVX-512, of x86-64, and AVX2 for single rays.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

#[cfg(target_arch = "x86_64")]
impl Avx512 {
    /// If the processor has it.
    pub fn detect() -> Option<Self> {
        let has = std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512dq");
        (has && Avx2::detect().is_some()).then_some(Self(()))
    }
}

#[cfg(target_arch = "x86_64")]
macro_rules! isa_of_x86 {
    ($name:ident, $wide:ty) => {
        #[cfg(target_arch = "x86_64")]
        impl Isa for $name {
            type Wide = $wide;
            type Eight = super::wide::x86::Eight;

            #[inline(always)]
            fn eight(self, x: f32) -> Self::Eight {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe { Self::Eight::splat(x) }
            }

            #[inline(always)]
            fn load_eight(self, from: &[f32; 8]) -> Self::Eight {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe { Self::Eight::load(from) }
            }

            #[inline(always)]
            fn numbers(self, bytes: &[u8; 8]) -> Self::Eight {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe { Self::Eight::of(avx2::numbers(bytes)) }
            }

            #[inline(always)]
            fn grid(self, node: &Node) -> [Self::Eight; 2] {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe {
                    let [origin, step] = avx2::grid(node);
                    [Self::Eight::of(avx2::extended(origin)), Self::Eight::of(avx2::extended(step))]
                }
            }

            #[inline(always)]
            fn splat(self, x: f32) -> $wide {
                // SAFETY: a value of the type exists only where the instructions have been detected.
                unsafe { <$wide>::splat(x) }
            }

            #[inline(always)]
            fn load(self, from: &[f32]) -> $wide {
                // SAFETY: a value of the type exists only where the instructions have been detected.
                unsafe { <$wide>::load(from) }
            }

            #[inline(always)]
            fn prefetch<T>(self, at: &T) {
                use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
                let lines = size_of::<T>().div_ceil(64);
                for line in 0..lines {
                    // SAFETY: SSE is part of x86-64, and a prefetch of any address does no harm.
                    unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(at).cast::<i8>().wrapping_add(64 * line)) }
                }
            }

            #[inline(always)]
            fn open(self, ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32 {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe { avx2::open(ray, lanes, node, t_max) }
            }

            #[inline(always)]
            fn open_top(self, ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> u32 {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe { avx2::open_top(ray, lanes, node, slack, t_max) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
isa_of_x86!(Avx2, super::wide::x86::Eight);
#[cfg(target_arch = "x86_64")]
isa_of_x86!(Avx512, super::wide::x86::Sixteen);

/// The instruction set that kernels run with.
#[derive(Clone, Copy, Debug)]
pub enum Best {
    /// [`Scalar`].
    Scalar(Scalar),
    /// [`Avx2`].
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// [`Avx512`].
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Best {
    /// The best that this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx512) = Avx512::detect() {
            return Self::Avx512(avx512);
        } else if let Some(avx2) = Avx2::detect() {
            return Self::Avx2(avx2);
        }
        Self::Scalar(Scalar)
    }

    /// All that this processor has, for tests.
    #[cfg(test)]
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::Scalar(Scalar)];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(Avx2::detect().map(Self::Avx2));
            all.extend(Avx512::detect().map(Self::Avx512));
        }
        println!("{all:?}");
        all
    }

    /// Numbers in a vector.
    pub fn lanes(self) -> u32 {
        match self {
            Self::Scalar(_) => 1,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => 8,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => 16,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar(_) => "scalar",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "AVX-512",
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{FramedRay, Lanes};
    use crate::cpu::node::UNIT;
    use bricks::Node;
    use std::arch::x86_64::*;

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
    pub fn numbers(bytes: &[u8; 8]) -> __m256 {
        _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(*bytes))))
    }

    /// Origin and steps of a node's grid; the last lanes are 0.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn grid(node: &Node) -> [__m128; 2] {
        let [first, ..]: &[[u32; 4]; 5] = bytemuck::cast_ref(node);
        // The last word holds the exponents and the mask of inner children; as a lane it is 0, because small numbers are slow.
        let exponents = _mm_cvtepu8_epi32(_mm_cvtsi32_si128((first[3] & 0x00ff_ffff) as i32));
        let p = vector(bytemuck::cast_ref(first));
        [_mm_insert_ps::<0b1000>(p, p), _mm_castsi128_ps(_mm_slli_epi32::<23>(exponents))]
    }

    /// Four numbers, and four zeros.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn extended(x: __m128) -> __m256 {
        _mm256_zextps128_ps256(x)
    }

    /// All bits set in the lanes of the children that `ray` enters: `NodeFrame::new` and `node_hits`.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn entered(ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> __m256i {
        let [p, s] = grid(node);
        let low = vector(&lanes.offset_low);
        let pc = _mm_add_ps(_mm_add_ps(p, vector(&lanes.offset_high)), low);
        let origin = vector(&lanes.origin);
        let w = _mm_sub_ps(pc, origin);
        let m = most3(_mm_add_ps(magnitude(w), _mm_mul_ps(_mm_set1_ps(255.0), s)));
        let mut all = _mm_mul_ps(_mm_set1_ps(64.0 * UNIT), m);
        if slack != 0.0 {
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
        _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(tn, tf))
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
    pub fn open(ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32 {
        let entered = entered(ray, lanes, node, 0.0, t_max);
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

    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn open_top(ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> u32 {
        let entered = entered(ray, lanes, node, slack, t_max);
        let absent = _mm256_cmpeq_epi32(meta(node), _mm256_setzero_si256());
        let slots = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let shift = _mm256_xor_si256(slots, _mm256_set1_epi32(ray.flip as i32));
        let bits = _mm256_srlv_epi32(_mm256_set1_epi32(i32::MIN), shift);
        any(_mm256_and_si256(_mm256_andnot_si256(absent, entered), bits))
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use crate::cpu::node::framed_ray;

    /// SplitMix64 (Steele, Lea, Flood 2014).
    struct Rng(u64);

    impl Rng {
        fn bits(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }

        fn signed(&mut self) -> f32 {
            (self.bits() >> 40) as f32 / 8_388_608.0 - 1.0
        }

        fn point(&mut self, size: f32) -> Vec3 {
            [0; 3].map(|_| size * self.signed())
        }
    }

    /// A node as the reader accepts it: every child inner, or a leaf of 1 to 3 triangles, or absent.
    fn node(rng: &mut Rng) -> Node {
        let mut node = Node {
            origin: rng.point(20.0),
            exponent: [0; 3].map(|_| 115 + (rng.bits() % 8) as u8),
            inner_mask: 0,
            child_base: 1,
            triangle_base: 0,
            meta: [0; 8],
            lo: [[0; 8]; 3],
            hi: [[0; 8]; 3],
        };
        let mut first = 0;
        for i in 0..8 {
            for k in 0..3 {
                let [a, b] = [rng.bits() as u8, rng.bits() as u8];
                (node.lo[k][i], node.hi[k][i]) = (a.min(b), a.max(b));
            }
            let count = rng.bits() % 5;
            node.meta[i] = match count {
                0 => 0,
                4 => {
                    node.inner_mask |= 1 << i;
                    0x38 + i as u8
                }
                count => {
                    first += count as u8;
                    ((1 << count) - 1) << 5 | (first - count as u8)
                }
            };
        }
        node
    }

    #[test]
    fn eight_at_once_are_each_alone() {
        let Some(avx2) = Avx2::detect() else {
            println!("skipped: no AVX2");
            return;
        };
        let (mut entered, mut met) = (0, 0);
        let mut rng = Rng(11);
        println!("seed 11");
        for case in 0..200_000 {
            let node = node(&mut rng);
            let (high, low) = (rng.point(4.0), if case % 2 == 0 { [0.0; 3] } else { rng.point(1e-3) });
            let aim = [0, 1, 2].map(|k| {
                let step = f32::from_bits(u32::from(node.exponent[k]) << 23);
                // At the node where a brick has it, or where the top level has it.
                [high[k], 0.0][case / 2 % 2] + node.origin[k] + step * 255.0 * (0.5 + 0.5 * rng.signed())
            });
            let origin = rng.point([1.0, 30.0, 3e4][case % 3]);
            let mut direction = [0, 1, 2].map(|k| aim[k] - origin[k]);
            if case % 5 == 0 {
                // Of either sign.
                direction[case / 5 % 3] = [0.0, -0.0][case / 15 % 2];
            }
            let ray = framed_ray(origin, direction, [0.0, 0.9, 1.1][case / 3 % 3]);
            let t_max = [1.0, 3e38, 0.7][case / 7 % 3];
            let lanes = Lanes::new(&ray, high, low);
            let one = Scalar.open(&ray, &lanes, &node, t_max);
            assert_eq!(avx2.open(&ray, &lanes, &node, t_max), one, "case {case}: {ray:?} {node:?}");
            entered += u32::from(one != 0);
            let slack = [0.0, 1e-6][case % 2];
            let lanes = Lanes::new(&ray, [0.0; 3], [0.0; 3]);
            let one = Scalar.open_top(&ray, &lanes, &node, slack, t_max);
            assert_eq!(avx2.open_top(&ray, &lanes, &node, slack, t_max), one, "case {case}: {ray:?} {node:?}");
            met += u32::from(one != 0);
        }
        let some = 10_000..190_000;
        assert!(some.contains(&entered) && some.contains(&met), "{entered} and {met} of 200,000 rays enter a child");
    }
}

//! Instruction sets: the node test for eight children at once, where the processor has the instructions for it. All
//! give the same bits: the same operations in the same order, none of them fused.

use super::wide::{Portable, Wide};
use crate::kernels::trace::node::{FramedRay, NodeHits, node_hits, traversal_mask};
use crate::kernels::vector::{Vec3, xyz};
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

/// Most lanes of a vector.
pub const MOST: usize = 16;

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

    /// Eight numbers of steps.
    fn steps(self, words: &[u16; 8]) -> Self::Eight;

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

    /// The columns of a matrix, of whose rows the first count, one a lane.
    #[inline(always)]
    fn columns(self, rows: &[&[f32; 4]; MOST]) -> [Self::Wide; 4] {
        let mut of = [[0.0; MOST]; 4];
        for i in 0..MOST {
            (of[0][i], of[1][i], of[2][i], of[3][i]) = (rows[i][0], rows[i][1], rows[i][2], rows[i][3]);
        }
        [self.load(&of[0]), self.load(&of[1]), self.load(&of[2]), self.load(&of[3])]
    }

    /// The rows of a matrix, one a lane of its columns, to the first of `rows`.
    #[inline(always)]
    fn rows(self, columns: [Self::Wide; 4], rows: &mut [[f32; 4]; MOST]) {
        let mut of = [[0.0; MOST]; 4];
        for k in 0..4 {
            columns[k].store(&mut of[k]);
        }
        for i in 0..MOST {
            rows[i] = [of[0][i], of[1][i], of[2][i], of[3][i]];
        }
    }

    /// Numbers of a table: those at the first of `at`, one a lane, which are less than 64.
    #[inline(always)]
    fn pick(self, from: &[f32; 64], at: &[u32]) -> Self::Wide {
        let mut picked = [0.0; MOST];
        for i in 0..Self::Wide::LANES {
            picked[i] = from[at[i] as usize % 64];
        }
        self.load(&picked)
    }

    /// Asks for the memory of `at` to be brought near, for it will be read.
    #[inline(always)]
    fn prefetch<T>(self, _at: &T) {}

    /// The traversal mask of a brick's node ([`traversal_mask`]): what `ray` enters of it up to `t_max`. `lanes` are
    /// the ray's.
    fn open(self, ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32;

    /// [`node_hits`]; `lanes` are the ray's.
    fn hits(self, ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> NodeHits;
}

/// Numbers for which [`crate::math::exact::is_inside`] holds lie in these bounds, the upper one excluded.
pub const INSIDE: [f32; 2] = [f32::from_bits(2 << 23), f32::from_bits(254 << 23)];

/// [`crate::math::exact::is_inside`].
#[inline(always)]
pub fn inside<I: Isa>(isa: I, x: I::Wide) -> u32 {
    isa.splat(INSIDE[0]).less_equal(x.abs()) & x.abs().less(isa.splat(INSIDE[1]))
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
    fn steps(self, words: &[u16; 8]) -> Portable {
        Portable(words.map(f32::from))
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
    fn hits(self, ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> NodeHits {
        node_hits(ray, node, xyz(lanes.offset_high), xyz(lanes.offset_low), slack, t_max)
    }
}

/// [`Isa`] by the functions of the module where this is used. A value of `$name` is proof that the processor has their
/// instructions.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
macro_rules! isa_over_intrinsics {
    ($name:ident, $wide:ty, $eight:ty $(; $($own:tt)*)?) => {
        impl Isa for $name {
            type Wide = $wide;
            type Eight = $eight;

            isa_over_intrinsics!(fn eight(x: f32) -> $eight { <$eight>::splat(x) });
            isa_over_intrinsics!(fn load_eight(from: &[f32; 8]) -> $eight { <$eight>::load(from) });
            isa_over_intrinsics!(fn numbers(bytes: &[u8; 8]) -> $eight { <$eight>::of(numbers(bytes)) });
            isa_over_intrinsics!(fn steps(words: &[u16; 8]) -> $eight { <$eight>::of(steps(words)) });
            isa_over_intrinsics!(fn grid(node: &Node) -> [$eight; 2] {
                let [origin, step] = grid(node);
                [<$eight>::of(extended(origin)), <$eight>::of(extended(step))]
            });
            isa_over_intrinsics!(fn splat(x: f32) -> $wide { <$wide>::splat(x) });
            isa_over_intrinsics!(fn load(from: &[f32]) -> $wide { <$wide>::load(from) });
            isa_over_intrinsics!(fn open(ray: &FramedRay, lanes: &Lanes, node: &Node, t_max: f32) -> u32 {
                open(ray, lanes, node, t_max)
            });
            isa_over_intrinsics!(fn hits(
                ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32
            ) -> NodeHits {
                hits(ray, lanes, node, slack, t_max)
            });

            $($($own)*)?

            #[inline(always)]
            fn prefetch<T>(self, at: &T) {
                for line in 0..size_of::<T>().div_ceil(64) {
                    prefetch_line(std::ptr::from_ref(at).cast::<u8>().wrapping_add(64 * line));
                }
            }
        }
    };
    (fn $method:ident($($given:ident: $type:ty),* $(,)?) -> $out:ty { $($body:tt)* }) => {
        #[inline(always)]
        fn $method(self, $($given: $type),*) -> $out {
            // SAFETY: a value of the type exists only where the instructions have been detected.
            unsafe { $($body)* }
        }
    };
}

#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "aarch64")]
pub use neon::Neon;
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

/// Work that is compiled for every instruction set. Implementations are always inlined, so that all of it is.
pub trait Work {
    /// What comes of it.
    type Out;

    /// Does it.
    fn run<I: Isa>(self, isa: I) -> Self::Out;
}

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
    /// [`Neon`].
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
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
        #[cfg(target_arch = "aarch64")]
        if let Some(neon) = Neon::detect() {
            return Self::Neon(neon);
        }
        Self::Scalar(Scalar)
    }

    /// The best for work that takes one item at a time: compiled for vectors of sixteen it takes a tenth longer.
    pub fn for_one() -> Self {
        match Self::detect() {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => Avx2::detect().map_or(Self::Scalar(Scalar), Self::Avx2),
            best => best,
        }
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
        #[cfg(target_arch = "aarch64")]
        all.extend(Neon::detect().map(Self::Neon));
        println!("{all:?}");
        all
    }

    /// Does `work` with it.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Out {
        match self {
            Self::Scalar(isa) => work.run(isa),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(isa) => {
                // SAFETY: a value of the type exists only where AVX2 has been detected.
                unsafe { x86::run_avx2(isa, work) }
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(isa) => {
                // SAFETY: a value of the type exists only where AVX-512 and AVX2 have been detected.
                unsafe { x86::run_avx512(isa, work) }
            }
            #[cfg(target_arch = "aarch64")]
            Self::Neon(isa) => work.run(isa),
        }
    }

    /// [`Isa::hits`], by a call: the caller need not be compiled for the instruction set.
    #[inline]
    pub fn hits(self, ray: &FramedRay, lanes: &Lanes, node: &Node, slack: f32, t_max: f32) -> NodeHits {
        match self {
            Self::Scalar(isa) => isa.hits(ray, lanes, node, slack, t_max),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(isa) => isa.hits(ray, lanes, node, slack, t_max),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(isa) => isa.hits(ray, lanes, node, slack, t_max),
            #[cfg(target_arch = "aarch64")]
            Self::Neon(isa) => isa.hits(ray, lanes, node, slack, t_max),
        }
    }

    /// Its name, and how many numbers are in a vector.
    pub fn describe(self) -> (&'static str, u32) {
        match self {
            Self::Scalar(_) => ("scalar", 1),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => ("AVX2", 8),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => ("AVX-512", 16),
            #[cfg(target_arch = "aarch64")]
            Self::Neon(_) => ("NEON", 8),
        }
    }
}

/// The expression for every instruction set that this processor has.
#[cfg(test)]
macro_rules! for_each_isa {
    ($isa:ident => $x:expr) => {
        for best in $crate::kernels::simd::isa::Best::all() {
            match best {
                $crate::kernels::simd::isa::Best::Scalar($isa) => $x,
                #[cfg(target_arch = "x86_64")]
                $crate::kernels::simd::isa::Best::Avx2($isa) => $x,
                #[cfg(target_arch = "x86_64")]
                $crate::kernels::simd::isa::Best::Avx512($isa) => $x,
                #[cfg(target_arch = "aarch64")]
                $crate::kernels::simd::isa::Best::Neon($isa) => $x,
            }
        }
    };
}
#[cfg(test)]
pub(crate) use for_each_isa;

#[cfg(test)]
mod tests;

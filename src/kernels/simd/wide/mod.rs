//! Numbers of several rays at once. Operations are those of f32, lane by lane, none of them fused but where that is
//! asked for; comparisons give a bit a lane.

use crate::math::exact;
use std::ops::{Add, BitAnd, BitXor, Div, Mul, Sub};

/// As many numbers as one instruction takes. Values come from [`super::isa::Isa::splat`] and [`super::isa::Isa::load`]
/// alone, so that one is proof that the processor has the instructions.
pub trait Wide:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + BitAnd<Output = Self>
    + BitXor<Output = Self>
{
    /// How many.
    const LANES: usize;

    /// [`exact::most`].
    fn most(self, other: Self) -> Self;

    /// [`exact::least`].
    fn least(self, other: Self) -> Self;

    /// self * by + plus, of which the product is rounded or not: for what bounds, and does not show.
    fn times_plus(self, by: Self, plus: Self) -> Self;

    /// Magnitudes.
    fn abs(self) -> Self;

    /// Square roots.
    fn sqrt(self) -> Self;

    /// Where self < other; never where one is no number.
    fn less(self, other: Self) -> u32;

    /// Where self <= other; never where one is no number.
    fn less_equal(self, other: Self) -> u32;

    /// `self` where the bit is set, elsewhere `other`.
    fn or_else(self, bits: u32, other: Self) -> Self;

    /// Where both have the same bits.
    fn same_bits(self, other: Self) -> u32;

    /// Where self < other, both read as u32.
    fn less_bits(self, other: Self) -> u32;

    /// The sum of both, read as u32, that wraps around.
    fn add_bits(self, other: Self) -> Self;

    /// Writes the lanes to the first of `to`.
    fn store(self, to: &mut [f32]);
}

/// The expression for k = 0, 1, 2. No closure, which the compiler need not inline: code with the wider instructions
/// must lie in the function that is compiled for them.
macro_rules! three {
    ($k:ident => $x:expr) => {
        [
            {
                let $k = 0usize;
                $x
            },
            {
                let $k = 1usize;
                $x
            },
            {
                let $k = 2usize;
                $x
            },
        ]
    };
}
pub(crate) use three;

/// Eight numbers in the hands of the compiler.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub struct Portable(pub [f32; 8]);

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn bits(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        (0..8).map(|i| u32::from(f(self.0[i], other.0[i])) << i).sum()
    }
}

/// Operators of [`Portable`], each by a function of a lane of both.
macro_rules! portable {
    ($($operator:ident $method:ident $of_lanes:expr;)*) => { $(
        impl $operator for Portable {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(other, $of_lanes)
            }
        }
    )* };
}

portable! {
    Add add |a, b| a + b;
    Sub sub |a, b| a - b;
    Mul mul |a, b| a * b;
    Div div |a, b| a / b;
    BitXor bitxor |a, b| f32::from_bits(a.to_bits() ^ b.to_bits());
    BitAnd bitand |a, b| f32::from_bits(a.to_bits() & b.to_bits());
}

impl Wide for Portable {
    const LANES: usize = 8;

    #[inline(always)]
    fn most(self, other: Self) -> Self {
        self.with(other, exact::most)
    }

    #[inline(always)]
    fn least(self, other: Self) -> Self {
        self.with(other, exact::least)
    }

    #[inline(always)]
    fn times_plus(self, by: Self, plus: Self) -> Self {
        self * by + plus
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        self.bits(other, |a, b| a < b)
    }

    #[inline(always)]
    fn less_equal(self, other: Self) -> u32 {
        self.bits(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn or_else(self, bits: u32, other: Self) -> Self {
        Self(std::array::from_fn(|i| if bits >> i & 1 != 0 { self.0[i] } else { other.0[i] }))
    }

    #[inline(always)]
    fn same_bits(self, other: Self) -> u32 {
        self.bits(other, |a, b| a.to_bits() == b.to_bits())
    }

    #[inline(always)]
    fn less_bits(self, other: Self) -> u32 {
        self.bits(other, |a, b| a.to_bits() < b.to_bits())
    }

    #[inline(always)]
    fn add_bits(self, other: Self) -> Self {
        self.with(other, |a, b| f32::from_bits(a.to_bits().wrapping_add(b.to_bits())))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        to[..8].copy_from_slice(&self.0);
    }
}

/// A type of lanes over intrinsics: comparisons and `$blend` give and take a bit a lane.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
macro_rules! over_intrinsics {
    ($name:ident, $vector:ty, $lanes:literal, $add:ident, $sub:ident, $mul:ident, $div:ident, $max:ident, $min:ident,
     $sqrt:ident, $set:ident, $load:ident, $store:ident, $abs:ident, $and:ident, $xor:ident, $less:ident,
     $less_equal:ident, $same_bits:ident, $less_bits:ident, $add_bits:ident, $blend:ident, $fused:ident) => {
        /// Numbers in registers.
        #[derive(Clone, Copy)]
        pub struct $name($vector);

        impl $name {
            /// The same number in all lanes.
            ///
            /// # Safety
            /// The processor has the instructions.
            #[inline(always)]
            pub unsafe fn splat(x: f32) -> Self {
                // SAFETY: as the caller promises.
                Self(unsafe { $set(x) })
            }

            /// The first of `from`.
            ///
            /// # Safety
            /// The processor has the instructions.
            #[inline(always)]
            pub unsafe fn load(from: &[f32]) -> Self {
                let from = &from[..$lanes];
                // SAFETY: as the caller promises; all lanes are there.
                Self(unsafe { $load(from.as_ptr()) })
            }
        }

        over_intrinsics!(operator $name; Add add $add);
        over_intrinsics!(operator $name; Sub sub $sub);
        over_intrinsics!(operator $name; Mul mul $mul);
        over_intrinsics!(operator $name; Div div $div);
        over_intrinsics!(operator $name; BitAnd bitand $and);
        over_intrinsics!(operator $name; BitXor bitxor $xor);

        impl Wide for $name {
            const LANES: usize = $lanes;

            over_intrinsics!(numbers most $max other);
            over_intrinsics!(numbers least $min other);
            over_intrinsics!(numbers times_plus $fused by plus);
            over_intrinsics!(numbers abs $abs);
            over_intrinsics!(numbers sqrt $sqrt);
            over_intrinsics!(numbers add_bits $add_bits other);
            over_intrinsics!(bits less $less);
            over_intrinsics!(bits less_equal $less_equal);
            over_intrinsics!(bits same_bits $same_bits);
            over_intrinsics!(bits less_bits $less_bits);

            #[inline(always)]
            fn or_else(self, bits: u32, other: Self) -> Self {
                // SAFETY: a value of the type exists only where the processor has the instructions.
                Self(unsafe { $blend(bits, self.0, other.0) })
            }

            #[inline(always)]
            fn store(self, to: &mut [f32]) {
                let to = &mut to[..$lanes];
                // SAFETY: a value of the type exists only where the processor has the instructions; there is room for
                // all lanes.
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
        }
    };
    (operator $name:ident; $operator:ident $method:ident $intrinsic:ident) => {
        impl $operator for $name {
            type Output = Self;

            over_intrinsics!(numbers $method $intrinsic other);
        }
    };
    (numbers $method:ident $intrinsic:ident $($other:ident)*) => {
        #[inline(always)]
        fn $method(self $(, $other: Self)*) -> Self {
            // SAFETY: a value of the type exists only where the processor has the instructions.
            Self(unsafe { $intrinsic(self.0 $(, $other.0)*) })
        }
    };
    (bits $method:ident $intrinsic:ident) => {
        #[inline(always)]
        fn $method(self, other: Self) -> u32 {
            // SAFETY: a value of the type exists only where the processor has the instructions.
            unsafe { $intrinsic(self.0, other.0) }
        }
    };
}

#[cfg(target_arch = "aarch64")]
pub mod neon;
#[cfg(target_arch = "x86_64")]
pub mod x86;

#[cfg(test)]
mod tests;

//! The float types of the CPU kernels.

use crate::cpu::lanes::Lanes;
use crate::cpu::wide::Number;

/// `f32` for training, `f64` to test it.
pub trait Real: Number + Send + Sync + PartialOrd + Default + std::fmt::Debug + std::ops::MulAssign + 'static {
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// The largest finite value.
    const MAX: Self;
    /// Not a number.
    const NAN: Self;
    /// The value as a double.
    fn to_f64(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Natural exponential.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// Largest integer not above, held inside the range of `i32`; NaN gives 0. (The library's `floor` is a call on
    /// processors without a rounding instruction in their base set, this is not.)
    fn floor_i32(self) -> i32;
    /// The integer as a float.
    fn of_i32(value: i32) -> Self;
    /// `self * a + b`, rounded once where the processor can.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `2^self`.
    fn exp2(self) -> Self;
    /// `self^exponent`.
    fn powf(self, exponent: Self) -> Self;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// Bits that order positive finite values as unsigned integers do.
    fn order_bits(self) -> u64;
    /// Number of significant bits in [`Real::order_bits`].
    const ORDER_BITS: u32;
    /// Runs `task` with the widest lanes this machine has for the type.
    fn with_lanes<T: LaneTask<Self>>(task: T) -> T::Output;

    /// The smaller; `other` when `self` is NaN.
    #[inline(always)]
    fn least(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    /// The larger; `other` when `self` is NaN.
    #[inline(always)]
    fn greatest(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
}

/// Work written once for any vector unit; see [`Real::with_lanes`].
pub trait LaneTask<F: Real> {
    /// Result of the work.
    type Output;
    /// Does the work with lanes `L`. Implementations mark it `#[inline(always)]`, so that the caller's processor
    /// features apply to all of it.
    fn run<L: Lanes<Real = F>>(self) -> Self::Output;
}

macro_rules! real {
    ($float:ident, $bits:expr, $with_lanes:item) => {
        impl Number for $float {
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as Self
            }
        }

        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const MAX: Self = $float::MAX;
            const NAN: Self = $float::NAN;
            const ORDER_BITS: u32 = $bits;
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn exp(self) -> Self {
                self.exp()
            }
            #[inline(always)]
            fn ln(self) -> Self {
                self.ln()
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn floor_i32(self) -> i32 {
                let towards_zero = self as i32;
                if towards_zero as Self > self { towards_zero.saturating_sub(1) } else { towards_zero }
            }
            #[inline(always)]
            fn of_i32(value: i32) -> Self {
                value as Self
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                self.mul_add(a, b)
            }
            #[inline(always)]
            fn exp2(self) -> Self {
                self.exp2()
            }
            #[inline(always)]
            fn powf(self, exponent: Self) -> Self {
                self.powf(exponent)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            #[inline(always)]
            fn order_bits(self) -> u64 {
                self.to_bits().into()
            }
            $with_lanes
        }
    };
}

real!(
    f32,
    32,
    #[inline]
    fn with_lanes<T: LaneTask<f32>>(task: T) -> T::Output {
        crate::cpu::lanes::with_f32_lanes(task)
    }
);
real!(
    f64,
    64,
    #[inline]
    fn with_lanes<T: LaneTask<f64>>(task: T) -> T::Output {
        crate::cpu::lanes::with_f64_lanes(task)
    }
);

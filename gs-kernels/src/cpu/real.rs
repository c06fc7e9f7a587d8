//! The float types of the CPU kernels, and sixteen of them at once. [`crate::cpu::lanes`] implements these traits.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// The operations on numbers in the formulas of [`crate::cpu::math`].
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// The nearest value to a double.
    fn of(value: f64) -> Self;
}

/// `f32` for training, `f64` to test it.
pub trait Real: Number + Send + Sync + PartialOrd + Default + std::fmt::Debug + MulAssign + 'static {
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

/// Lanes in a vector: the tile's edge, and the pixels of a block.
pub const LANES: usize = crate::constants::TILE;

/// Lanes in memory, at the start of a cache line: a vector across two lines costs twice as much.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Aligned<F>(pub [F; LANES]);

/// Sixteen lanes of `Real`.
pub trait Lanes: Copy {
    /// The lane's type.
    type Real: Real;
    /// One truth value per lane.
    type Mask: Copy;

    /// The same value in every lane.
    fn splat(x: Self::Real) -> Self;
    /// Lanes from memory.
    fn load(from: &[Self::Real; LANES]) -> Self;
    /// Each of four numbers in four lanes: 0 to 3, 4 to 7 and so on.
    fn spread(from: &[Self::Real; 4]) -> Self;
    /// Lanes to memory.
    fn store(self, to: &mut [Self::Real; LANES]);
    /// `self + b`.
    fn add(self, b: Self) -> Self;
    /// `self - b`.
    fn sub(self, b: Self) -> Self;
    /// `self * b`.
    fn mul(self, b: Self) -> Self;
    /// `self / b`.
    fn div(self, b: Self) -> Self;
    /// `self * a + b`, rounded once.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `b - self * a`, rounded once.
    fn neg_mul_add(self, a: Self, b: Self) -> Self;
    /// Lanewise minimum of ordinary numbers.
    fn min(self, b: Self) -> Self;
    /// Lanewise maximum of ordinary numbers.
    fn max(self, b: Self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// `self >= b`; false for NaN.
    fn ge(self, b: Self) -> Self::Mask;
    /// `self > b`; false for NaN.
    fn gt(self, b: Self) -> Self::Mask;
    /// Both.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// `a` where the mask holds, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// The mask as bits, lane 0 lowest.
    fn bits(mask: Self::Mask) -> u16;
    /// `2^self` for `self <= 0`; relative error below 2e-7 for `f32`, where anything under `2^-120` may come out as any
    /// value up to `2^-119`.
    fn exp2_nonpositive(self) -> Self;
    /// Sum of all lanes by halves: `((0+8)+(4+12)) + ...`, the same tree everywhere.
    fn sum(self) -> Self::Real;
    /// [`Lanes::sum`] of four vectors, to the bit; most units share the work.
    #[inline(always)]
    fn sums([a, b, c, d]: [Self; 4]) -> [Self::Real; 4] {
        [a.sum(), b.sum(), c.sum(), d.sum()]
    }

    /// Lanes from sixteen numbers of `row`, from `at` on.
    #[inline(always)]
    fn load_at(row: &[Self::Real], at: usize) -> Self {
        Self::load(row[at..at + LANES].try_into().expect("sixteen numbers"))
    }
    /// Lanes to sixteen numbers of `row`, from `at` on.
    #[inline(always)]
    fn store_at(self, row: &mut [Self::Real], at: usize) {
        self.store((&mut row[at..at + LANES]).try_into().expect("sixteen numbers"));
    }

    /// 0, 1, ... 15.
    #[inline(always)]
    fn ramp() -> Self {
        Self::load(&std::array::from_fn(|i| Self::Real::of(i as f64)))
    }
    /// The lanes as an array.
    #[inline(always)]
    fn to_array(self) -> [Self::Real; LANES] {
        let mut out = [Self::Real::ZERO; LANES];
        self.store(&mut out);
        out
    }
}

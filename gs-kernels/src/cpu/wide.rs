//! Formulas over one number or over sixteen at once.
//!
//! [`Wide`] gives [`Lanes`] the operators of a number, so that a formula is written once and read as a formula. Every
//! operator is one rounding, as for a single number.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use crate::cpu::real::{LANES, Lanes, Number, Real};

/// Sixteen numbers with the operators of one.
#[derive(Clone, Copy, Debug)]
pub struct Wide<L>(pub L);

impl<L: Lanes> Wide<L> {
    /// The same number sixteen times.
    #[inline(always)]
    pub fn splat(x: L::Real) -> Self {
        Self(L::splat(x))
    }

    /// From memory.
    #[inline(always)]
    pub fn load(from: &[L::Real; LANES]) -> Self {
        Self(L::load(from))
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    /// The larger of ordinary numbers.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }

    /// `self > other`; false for NaN.
    #[inline(always)]
    pub fn above(self, other: Self) -> L::Mask {
        self.0.gt(other.0)
    }

    /// `low <= self <= high`; false for NaN.
    #[inline(always)]
    pub fn within(self, low: Self, high: Self) -> L::Mask {
        L::both(self.0.ge(low.0), high.0.ge(self.0))
    }

    /// Neither infinite nor NaN.
    #[inline(always)]
    pub fn is_finite(self) -> L::Mask {
        L::splat(L::Real::MAX).ge(self.0.abs())
    }

    /// `a` where the mask holds, else `b`.
    #[inline(always)]
    pub fn select(mask: L::Mask, a: Self, b: Self) -> Self {
        Self(L::select(mask, a.0, b.0))
    }
}

impl<L: Lanes> Number for Wide<L> {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self(L::splat(L::Real::of(value)))
    }
}

/// Each operator by the lanes' function of its name.
macro_rules! operators {
    ($($operator:ident $function:ident $(, $assign:ident $assigned:ident)?;)*) => {$(
        impl<L: Lanes> $operator for Wide<L> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, b: Self) -> Self {
                Self(self.0.$function(b.0))
            }
        }

        $(impl<L: Lanes> $assign for Wide<L> {
            #[inline(always)]
            fn $assigned(&mut self, b: Self) {
                *self = $operator::$function(*self, b);
            }
        })?
    )*};
}

operators! {
    Add add, AddAssign add_assign;
    Sub sub, SubAssign sub_assign;
    Mul mul;
    Div div;
}

impl<L: Lanes> Neg for Wide<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(L::splat(L::Real::ZERO).sub(self.0))
    }
}

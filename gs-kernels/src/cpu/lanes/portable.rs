//! Lanes as a plain array: any processor, and `f64`.

use crate::cpu::real::{LANES, Lanes, Real};

/// Coefficients of `2^f` on -1/2..=1/2, by falling power; minimax in relative error (9.2e-8) with the constant term 1.
#[allow(clippy::approx_constant)] // the minimax coefficient is close to ln 2, and is not it
pub(super) const EXP2_F32: [f32; 6] = [0.001_326_472_7, 0.009_671_513, 0.055_507_337, 0.240_222_42, 0.693_147, 1.0];

/// The bit trick behind `2^n` ends at the smallest exponent; anything below this is far under the alpha cut-off anyway.
pub(super) const EXP2_LOWEST: f32 = -120.0;

/// Sixteen lanes in an array.
#[derive(Clone, Copy, Debug)]
pub struct Portable<F>([F; LANES]);

/// The exponential differs by type: `f32` follows the vector units bit by bit, `f64` uses the library.
pub trait PortableExp: Real {
    /// `2^self` for `self <= 0`.
    fn exp2_lane(self) -> Self;
}

impl PortableExp for f32 {
    #[inline(always)]
    fn exp2_lane(self) -> f32 {
        let x = self.greatest(EXP2_LOWEST);
        let n = x.round_ties_even();
        let f = x - n;
        let [a, b, c, d, e, one] = EXP2_F32;
        let (high, middle, low) = (a.mul_add(f, b), c.mul_add(f, d), e.mul_add(f, one));
        let p = high.mul_add(f * f, middle).mul_add(f * f, low);
        p * f32::from_bits(((n as i32 + 127) as u32) << 23)
    }
}

impl PortableExp for f64 {
    #[inline(always)]
    fn exp2_lane(self) -> f64 {
        self.exp2()
    }
}

/// Operations by a formula for one lane.
macro_rules! lanewise {
    ($($name:ident($($other:ident),*) = |$lane:ident $(, $of:ident)*| $formula:expr,)*) => {$(
        #[inline(always)]
        fn $name(self $(, $other: Self)*) -> Self {
            Self(std::array::from_fn(|i| {
                let ($lane, $($of),*) = (self.0[i], $($other.0[i]),*);
                $formula
            }))
        }
    )*};
}

impl<F: PortableExp> Lanes for Portable<F> {
    type Real = F;
    type Mask = [bool; LANES];

    #[inline(always)]
    fn splat(x: F) -> Self {
        Self([x; LANES])
    }
    #[inline(always)]
    fn load(from: &[F; LANES]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn spread(from: &[F; 4]) -> Self {
        Self(std::array::from_fn(|i| from[i / 4]))
    }
    #[inline(always)]
    fn store(self, to: &mut [F; LANES]) {
        *to = self.0;
    }
    lanewise! {
        add(b) = |x, b| x + b, sub(b) = |x, b| x - b, mul(b) = |x, b| x * b, div(b) = |x, b| x / b,
        mul_add(a, b) = |x, a, b| x.mul_add(a, b), neg_mul_add(a, b) = |x, a, b| (-x).mul_add(a, b),
        min(b) = |x, b| x.least(b), max(b) = |x, b| x.greatest(b), abs() = |x| x.abs(), sqrt() = |x| x.sqrt(),
        exp2_nonpositive() = |x| x.exp2_lane(),
    }
    #[inline(always)]
    fn ge(self, b: Self) -> [bool; LANES] {
        std::array::from_fn(|i| self.0[i] >= b.0[i])
    }
    #[inline(always)]
    fn gt(self, b: Self) -> [bool; LANES] {
        std::array::from_fn(|i| self.0[i] > b.0[i])
    }
    #[inline(always)]
    fn both(a: [bool; LANES], b: [bool; LANES]) -> [bool; LANES] {
        std::array::from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn select(mask: [bool; LANES], a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|i| if mask[i] { a.0[i] } else { b.0[i] }))
    }
    #[inline(always)]
    fn bits(mask: [bool; LANES]) -> u16 {
        mask.iter().enumerate().fold(0, |bits, (i, &m)| bits | (u16::from(m) << i))
    }
    #[inline(always)]
    fn sum(self) -> F {
        let a: [F; 8] = std::array::from_fn(|i| self.0[i] + self.0[i + 8]);
        let b: [F; 4] = std::array::from_fn(|i| a[i] + a[i + 4]);
        (b[0] + b[2]) + (b[1] + b[3])
    }
}

//! Lanes as a plain array: any processor, and `f64`.

use super::{EXP2_F32, LANES, Lanes};
use crate::cpu::real::Real;

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
        let x = self.greatest(super::EXP2_LOWEST);
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

impl<F: Real> Portable<F> {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(F, F) -> F) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
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
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.zip(b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.zip(b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.zip(b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.zip(b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].mul_add(a.0[i], b.0[i])))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|i| (-self.0[i]).mul_add(a.0[i], b.0[i])))
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        self.zip(b, |a, b| a.least(b))
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        self.zip(b, |a, b| a.greatest(b))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(|a| a.abs()))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(|a| a.sqrt()))
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
    fn exp2_nonpositive(self) -> Self {
        Self(self.0.map(F::exp2_lane))
    }
    #[inline(always)]
    fn sum(self) -> F {
        let a: [F; 8] = std::array::from_fn(|i| self.0[i] + self.0[i + 8]);
        let b: [F; 4] = std::array::from_fn(|i| a[i] + a[i + 4]);
        (b[0] + b[2]) + (b[1] + b[3])
    }
}

//! Sixteen numbers at once: a block of 4 x 4 pixels, or sixteen Gaussians.
//!
//! One trait, one implementation per vector unit, chosen at run time. Every implementation rounds the same operations
//! in the same order (fused multiply-add, the same exponential polynomial, the same summation tree), so all give the
//! same bits.

mod portable;
pub use portable::Portable;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;

use crate::cpu::real::{LaneTask, Real};
use crate::cpu::wide::Number;

/// Lanes in a vector: the tile's edge, and the pixels of a block.
pub const LANES: usize = crate::constants::TILE;

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

/// Coefficients of `2^f` on -1/2..=1/2, by falling power; minimax in relative error (9.2e-8) with the constant term 1.
#[allow(clippy::approx_constant)] // the minimax coefficient is close to ln 2, and is not it
pub(super) const EXP2_F32: [f32; 6] = [0.001_326_472_7, 0.009_671_513, 0.055_507_337, 0.240_222_42, 0.693_147, 1.0];

/// The bit trick behind `2^n` ends at the smallest exponent; anything below this is far under the alpha cut-off anyway.
pub(super) const EXP2_LOWEST: f32 = -120.0;

/// Runs `task` with the best `f32` lanes of this processor.
pub(super) fn with_f32_lanes<T: LaneTask<f32>>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    {
        // The standard library caches the detection; a call costs one load.
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
        {
            // SAFETY: the features were just detected.
            return unsafe { avx512::run(task) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the features were just detected.
            return unsafe { avx2::run(task) };
        }
        task.run::<Portable<f32>>()
    }
    #[cfg(target_arch = "aarch64")]
    {
        // NEON is part of the architecture.
        task.run::<neon::Neon>()
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    task.run::<Portable<f32>>()
}

/// Runs `task` on doubles: portable code, compiled for fused multiply-add where the processor has it (the library's
/// fallback gives the same bits, thirty times slower).
pub(super) fn with_f64_lanes<T: LaneTask<f64>>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the features were just detected.
        return unsafe { avx2::run_f64(task) };
    }
    task.run::<Portable<f64>>()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Probe;
    impl LaneTask<f32> for Probe {
        type Output = Vec<u32>;
        #[inline(always)]
        fn run<L: Lanes<Real = f32>>(self) -> Vec<u32> {
            let mut bits = Vec::new();
            for k in 0..200 {
                let x = L::ramp().mul(L::splat(-0.037)).add(L::splat(-0.5 * k as f32));
                let e = x.exp2_nonpositive();
                let y = e.mul_add(x, L::splat(0.3)).neg_mul_add(e, x).div(L::splat(3.7));
                let m = y.ge(L::splat(-1.0));
                let z = L::select(L::both(m, y.ge(L::splat(-20.0))), y.abs(), y.min(e).max(x));
                bits.extend(e.to_array().map(f32::to_bits));
                bits.extend(z.to_array().map(f32::to_bits));
                bits.push(z.sum().to_bits());
                bits.extend(L::sums([z, e, y, x]).map(f32::to_bits));
                let spread = L::spread(&[e.sum(), -1.5, y.sum(), 0.25]);
                bits.extend(spread.abs().sqrt().to_array().map(f32::to_bits));
                bits.push(L::bits(m).into());
                bits.push(L::bits(x.gt(L::splat(x.to_array()[7]))).into());
            }
            bits
        }
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        let portable = Probe.run::<Portable<f32>>();
        assert_eq!(with_f32_lanes(Probe), portable);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the features were just detected.
            assert_eq!(unsafe { avx2::run(Probe) }, portable);
        }
    }

    struct Sums;
    impl LaneTask<f32> for Sums {
        type Output = [[f32; 4]; 2];
        #[inline(always)]
        fn run<L: Lanes<Real = f32>>(self) -> [[f32; 4]; 2] {
            let vectors = [0.1_f32, 0.7, -1.3, 2.9].map(|k| L::ramp().mul(L::splat(k)).add(L::splat(1.0 / k)));
            [L::sums(vectors), vectors.map(|v| v.sum())]
        }
    }

    #[test]
    fn four_sums_at_once_are_the_sums() {
        let [together, alone] = with_f32_lanes(Sums);
        assert_eq!(together, alone);
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the features were just detected.
            let [together, alone] = unsafe { avx2::run(Sums) };
            assert_eq!(together, alone);
        }
    }

    #[test]
    fn exponential_is_accurate() {
        for k in 0..4000 {
            let x = -0.02 * k as f32;
            let got = f64::from(Portable::<f32>::splat(x).exp2_nonpositive().to_array()[3]);
            let want = f64::from(x).exp2();
            assert!((got / want - 1.0).abs() < 2e-7, "2^{x}: {got} against {want}");
        }
    }
}

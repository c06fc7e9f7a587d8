//! The vector unit of the processor at hand, chosen at run time, and the float types that use it.

#[cfg(target_arch = "aarch64")]
use super::neon;
use super::portable::Portable;
#[cfg(target_arch = "x86_64")]
use super::{avx2, avx512};
use crate::cpu::real::{LaneTask, Number, Real};

/// Whether this processor has all features that `avx2` is compiled with.
#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
}

/// Whether this processor has all features that `avx512` is compiled with.
#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

/// Runs `task` with the best `f32` lanes of this processor.
fn with_f32_lanes<T: LaneTask<f32>>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    {
        // The standard library caches the detection; a call costs one load.
        if has_avx512() {
            // SAFETY: the features were just detected.
            return unsafe { avx512::run(task) };
        }
        if has_avx2() {
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
fn with_f64_lanes<T: LaneTask<f64>>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    if has_avx2() {
        // SAFETY: the features were just detected.
        return unsafe { avx2::run_f64(task) };
    }
    task.run::<Portable<f64>>()
}

macro_rules! real {
    ($float:ident, $bits:expr, $with_lanes:ident, [$($function:ident)*]) => {
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
            // The library's own functions.
            $(
                #[inline(always)]
                fn $function(self) -> Self {
                    self.$function()
                }
            )*
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
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
            #[inline]
            fn with_lanes<T: LaneTask<Self>>(task: T) -> T::Output {
                $with_lanes(task)
            }
        }
    };
}

real!(f32, 32, with_f32_lanes, [sqrt exp ln abs exp2]);
real!(f64, 64, with_f64_lanes, [sqrt exp ln abs exp2]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::real::Lanes;

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
        if has_avx2() {
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
        if has_avx2() {
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

//! Lanes in four 128-bit registers.

use std::arch::aarch64::*;

use super::portable::{EXP2_F32, EXP2_LOWEST};
use crate::cpu::real::{LANES, Lanes};

/// Sixteen `f32` lanes; NEON is part of every aarch64 processor, which makes the `unsafe` calls below sound.
#[derive(Clone, Copy)]
pub struct Neon([float32x4_t; 4]);

impl Neon {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(float32x4_t, float32x4_t) -> float32x4_t) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
}

#[inline(always)]
unsafe fn exp2(x: float32x4_t) -> float32x4_t {
    unsafe {
        let x = vmaxq_f32(x, vdupq_n_f32(EXP2_LOWEST));
        let n = vrndnq_f32(x);
        let f = vsubq_f32(x, n);
        let [a, b, c, d, e, one] = EXP2_F32;
        let f2 = vmulq_f32(f, f);
        let high = vfmaq_f32(vdupq_n_f32(b), vdupq_n_f32(a), f);
        let middle = vfmaq_f32(vdupq_n_f32(d), vdupq_n_f32(c), f);
        let low = vfmaq_f32(vdupq_n_f32(one), vdupq_n_f32(e), f);
        let p = vfmaq_f32(low, vfmaq_f32(middle, high, f2), f2);
        let exponent = vshlq_n_s32::<23>(vaddq_s32(vcvtq_s32_f32(n), vdupq_n_s32(127)));
        vmulq_f32(p, vreinterpretq_f32_s32(exponent))
    }
}

impl Lanes for Neon {
    type Real = f32;
    type Mask = [uint32x4_t; 4];

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([unsafe { vdupq_n_f32(x) }; 4])
    }
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(std::array::from_fn(|i| unsafe { vld1q_f32(from[4 * i..].as_ptr()) }))
    }
    #[inline(always)]
    fn spread(from: &[f32; 4]) -> Self {
        Self(std::array::from_fn(|i| unsafe { vdupq_n_f32(from[i]) }))
    }
    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        for (i, v) in self.0.into_iter().enumerate() {
            unsafe { vst1q_f32(to[4 * i..].as_mut_ptr(), v) }
        }
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.zip(b, |a, b| unsafe { vaddq_f32(a, b) })
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.zip(b, |a, b| unsafe { vsubq_f32(a, b) })
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.zip(b, |a, b| unsafe { vmulq_f32(a, b) })
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.zip(b, |a, b| unsafe { vdivq_f32(a, b) })
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|i| unsafe { vfmaq_f32(b.0[i], self.0[i], a.0[i]) }))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|i| unsafe { vfmsq_f32(b.0[i], self.0[i], a.0[i]) }))
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        self.zip(b, |a, b| unsafe { vminq_f32(a, b) })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        self.zip(b, |a, b| unsafe { vmaxq_f32(a, b) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(|a| unsafe { vabsq_f32(a) }))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(|a| unsafe { vsqrtq_f32(a) }))
    }
    #[inline(always)]
    fn ge(self, b: Self) -> [uint32x4_t; 4] {
        std::array::from_fn(|i| unsafe { vcgeq_f32(self.0[i], b.0[i]) })
    }
    #[inline(always)]
    fn gt(self, b: Self) -> [uint32x4_t; 4] {
        std::array::from_fn(|i| unsafe { vcgtq_f32(self.0[i], b.0[i]) })
    }
    #[inline(always)]
    fn both(a: [uint32x4_t; 4], b: [uint32x4_t; 4]) -> [uint32x4_t; 4] {
        std::array::from_fn(|i| unsafe { vandq_u32(a[i], b[i]) })
    }
    #[inline(always)]
    fn select(mask: [uint32x4_t; 4], a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|i| unsafe { vbslq_f32(mask[i], a.0[i], b.0[i]) }))
    }
    #[inline(always)]
    fn bits(mask: [uint32x4_t; 4]) -> u16 {
        let weights: [u32; 4] = [1, 2, 4, 8];
        mask.into_iter().enumerate().fold(0, |bits, (i, m)| {
            let four = unsafe { vaddvq_u32(vandq_u32(m, vld1q_u32(weights.as_ptr()))) };
            bits | ((four as u16) << (4 * i))
        })
    }
    #[inline(always)]
    fn exp2_nonpositive(self) -> Self {
        Self(self.0.map(|x| unsafe { exp2(x) }))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        unsafe {
            let low = vaddq_f32(self.0[0], self.0[2]);
            let high = vaddq_f32(self.0[1], self.0[3]);
            let b = vaddq_f32(low, high);
            let c = vadd_f32(vget_low_f32(b), vget_high_f32(b));
            vget_lane_f32::<0>(c) + vget_lane_f32::<1>(c)
        }
    }
}

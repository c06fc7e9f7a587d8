//! Lanes in one 512-bit register.

use std::arch::x86_64::*;

use super::portable::EXP2_F32;
use crate::cpu::real::{LANES, LaneTask, Lanes};

/// Sixteen `f32` lanes. Values exist only inside [`run`], where the processor is known to have the instructions;
/// that is what makes the `unsafe` calls below sound.
#[derive(Clone, Copy)]
pub struct Avx512(__m512);

/// Runs a task compiled for AVX-512.
///
/// # Safety
/// The processor must have AVX-512 F, DQ and VL.
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma,bmi1,bmi2")]
pub unsafe fn run<T: LaneTask<f32>>(task: T) -> T::Output {
    task.run::<Avx512>()
}

/// Operations that are one instruction.
macro_rules! lanewise {
    ($($name:ident($($other:ident),*) = $instruction:ident,)*) => {$(
        #[inline(always)]
        fn $name(self $(, $other: Self)*) -> Self {
            Self(unsafe { $instruction(self.0 $(, $other.0)*) })
        }
    )*};
}

impl Lanes for Avx512 {
    type Real = f32;
    type Mask = __mmask16;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(x) })
    }
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(unsafe { _mm512_loadu_ps(from.as_ptr()) })
    }
    #[inline(always)]
    fn spread(from: &[f32; 4]) -> Self {
        unsafe {
            let four = _mm512_broadcast_f32x4(_mm_loadu_ps(from.as_ptr()));
            let index = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
            Self(_mm512_permutevar_ps(four, index))
        }
    }
    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }
    lanewise! {
        add(b) = _mm512_add_ps, sub(b) = _mm512_sub_ps, mul(b) = _mm512_mul_ps, div(b) = _mm512_div_ps,
        mul_add(a, b) = _mm512_fmadd_ps, neg_mul_add(a, b) = _mm512_fnmadd_ps,
        min(b) = _mm512_min_ps, max(b) = _mm512_max_ps, abs() = _mm512_abs_ps, sqrt() = _mm512_sqrt_ps,
    }
    #[inline(always)]
    fn ge(self, b: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, b.0) }
    }
    #[inline(always)]
    fn gt(self, b: Self) -> __mmask16 {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, b.0) }
    }
    #[inline(always)]
    fn both(a: __mmask16, b: __mmask16) -> __mmask16 {
        a & b
    }
    #[inline(always)]
    fn select(mask: __mmask16, a: Self, b: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_ps(mask, b.0, a.0) })
    }
    #[inline(always)]
    fn bits(mask: __mmask16) -> u16 {
        mask
    }
    #[inline(always)]
    fn exp2_nonpositive(self) -> Self {
        unsafe {
            let n = _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0);
            let f = _mm512_sub_ps(self.0, n);
            let [a, b, c, d, e, one] = EXP2_F32;
            let f2 = _mm512_mul_ps(f, f);
            let high = _mm512_fmadd_ps(_mm512_set1_ps(a), f, _mm512_set1_ps(b));
            let middle = _mm512_fmadd_ps(_mm512_set1_ps(c), f, _mm512_set1_ps(d));
            let low = _mm512_fmadd_ps(_mm512_set1_ps(e), f, _mm512_set1_ps(one));
            let p = _mm512_fmadd_ps(_mm512_fmadd_ps(high, f2, middle), f2, low);
            Self(_mm512_scalef_ps(p, n))
        }
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        unsafe {
            let halves = _mm256_add_ps(_mm512_castps512_ps256(self.0), _mm512_extractf32x8_ps::<1>(self.0));
            super::avx2::sum8(halves)
        }
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self; 4]) -> [f32; 4] {
        unsafe {
            // Quarters 0 + 2 and 1 + 3 of a, then of b.
            let ab = _mm512_add_ps(_mm512_shuffle_f32x4::<0x44>(a.0, b.0), _mm512_shuffle_f32x4::<0xee>(a.0, b.0));
            let cd = _mm512_add_ps(_mm512_shuffle_f32x4::<0x44>(c.0, d.0), _mm512_shuffle_f32x4::<0xee>(c.0, d.0));
            // One quarter for each of a, b, c, d.
            let quarters = _mm512_add_ps(_mm512_shuffle_f32x4::<0x88>(ab, cd), _mm512_shuffle_f32x4::<0xdd>(ab, cd));
            let pairs = _mm512_add_ps(quarters, _mm512_permute_ps::<0x4e>(quarters));
            let sums = _mm512_add_ps(pairs, _mm512_permute_ps::<0xb1>(pairs));
            let firsts = _mm512_castps512_ps128(_mm512_permutexvar_ps(
                _mm512_setr_epi32(0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12),
                sums,
            ));
            let mut out = [0.0; 4];
            _mm_storeu_ps(out.as_mut_ptr(), firsts);
            out
        }
    }
}

//! Lanes in two 256-bit registers.

use std::arch::x86_64::*;

use super::portable::{EXP2_F32, EXP2_LOWEST, Portable};
use crate::cpu::real::{LANES, LaneTask, Lanes};

/// Sixteen `f32` lanes. Values exist only inside [`run`], where the processor is known to have the instructions;
/// that is what makes the `unsafe` calls below sound.
#[derive(Clone, Copy)]
pub struct Avx2(__m256, __m256);

/// Runs a task compiled for AVX2 with FMA.
///
/// # Safety
/// The processor must have AVX2 and FMA.
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
pub unsafe fn run<T: LaneTask<f32>>(task: T) -> T::Output {
    task.run::<Avx2>()
}

/// Runs a task on portable doubles compiled for AVX2 with FMA.
///
/// # Safety
/// The processor must have AVX2 and FMA.
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
pub unsafe fn run_f64<T: LaneTask<f64>>(task: T) -> T::Output {
    task.run::<Portable<f64>>()
}

/// Sum of eight lanes by halves.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub unsafe fn sum8(v: __m256) -> f32 {
    unsafe {
        let b = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
        let c = _mm_add_ps(b, _mm_movehl_ps(b, b));
        _mm_cvtss_f32(_mm_add_ss(c, _mm_shuffle_ps::<1>(c, c)))
    }
}

/// [`sum8`] of four vectors, transposed as they shrink; the same additions.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub unsafe fn sums8([a, b, c, d]: [__m256; 4]) -> [f32; 4] {
    unsafe {
        // Halves of two vectors side by side: their sums are lanes 0 to 3 of a, then of b.
        let ab = _mm256_add_ps(_mm256_permute2f128_ps::<0x20>(a, b), _mm256_permute2f128_ps::<0x31>(a, b));
        let cd = _mm256_add_ps(_mm256_permute2f128_ps::<0x20>(c, d), _mm256_permute2f128_ps::<0x31>(c, d));
        // Per half: lanes 0 + 2 and 1 + 3 of a (or b), then of c (or d).
        let pairs = _mm256_add_ps(_mm256_shuffle_ps::<0x44>(ab, cd), _mm256_shuffle_ps::<0xee>(ab, cd));
        let sums = _mm256_add_ps(_mm256_shuffle_ps::<0x88>(pairs, pairs), _mm256_shuffle_ps::<0xdd>(pairs, pairs));
        // [a, c, a, c | b, d, b, d]
        let both = _mm_unpacklo_ps(_mm256_castps256_ps128(sums), _mm256_extractf128_ps::<1>(sums));
        let mut out = [0.0; 4];
        _mm_storeu_ps(out.as_mut_ptr(), both);
        out
    }
}

#[inline(always)]
unsafe fn exp2(x: __m256) -> __m256 {
    unsafe {
        let x = _mm256_max_ps(x, _mm256_set1_ps(EXP2_LOWEST));
        let n = _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(x);
        let f = _mm256_sub_ps(x, n);
        let [a, b, c, d, e, one] = EXP2_F32;
        let f2 = _mm256_mul_ps(f, f);
        let high = _mm256_fmadd_ps(_mm256_set1_ps(a), f, _mm256_set1_ps(b));
        let middle = _mm256_fmadd_ps(_mm256_set1_ps(c), f, _mm256_set1_ps(d));
        let low = _mm256_fmadd_ps(_mm256_set1_ps(e), f, _mm256_set1_ps(one));
        let p = _mm256_fmadd_ps(_mm256_fmadd_ps(high, f2, middle), f2, low);
        let exponent = _mm256_slli_epi32::<23>(_mm256_add_epi32(_mm256_cvtps_epi32(n), _mm256_set1_epi32(127)));
        _mm256_mul_ps(p, _mm256_castsi256_ps(exponent))
    }
}

/// Operations that are one instruction, or one function, for each register.
macro_rules! lanewise {
    ($($name:ident($($other:ident),*) = $instruction:ident,)*) => {$(
        #[inline(always)]
        fn $name(self $(, $other: Self)*) -> Self {
            unsafe { Self($instruction(self.0 $(, $other.0)*), $instruction(self.1 $(, $other.1)*)) }
        }
    )*};
}

impl Lanes for Avx2 {
    type Real = f32;
    type Mask = (__m256, __m256);

    #[inline(always)]
    fn splat(x: f32) -> Self {
        let v = unsafe { _mm256_set1_ps(x) };
        Self(v, v)
    }
    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        unsafe { Self(_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(8))) }
    }
    #[inline(always)]
    fn spread(from: &[f32; 4]) -> Self {
        unsafe {
            let four = _mm256_broadcast_ps(&_mm_loadu_ps(from.as_ptr()));
            let (low, high) = (_mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1), _mm256_setr_epi32(2, 2, 2, 2, 3, 3, 3, 3));
            Self(_mm256_permutevar_ps(four, low), _mm256_permutevar_ps(four, high))
        }
    }
    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        unsafe {
            _mm256_storeu_ps(to.as_mut_ptr(), self.0);
            _mm256_storeu_ps(to.as_mut_ptr().add(8), self.1);
        }
    }
    lanewise! {
        add(b) = _mm256_add_ps, sub(b) = _mm256_sub_ps, mul(b) = _mm256_mul_ps, div(b) = _mm256_div_ps,
        mul_add(a, b) = _mm256_fmadd_ps, neg_mul_add(a, b) = _mm256_fnmadd_ps,
        min(b) = _mm256_min_ps, max(b) = _mm256_max_ps, sqrt() = _mm256_sqrt_ps, exp2_nonpositive() = exp2,
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe {
            let sign = _mm256_set1_ps(-0.0);
            Self(_mm256_andnot_ps(sign, self.0), _mm256_andnot_ps(sign, self.1))
        }
    }
    #[inline(always)]
    fn ge(self, b: Self) -> (__m256, __m256) {
        unsafe { (_mm256_cmp_ps::<_CMP_GE_OQ>(self.0, b.0), _mm256_cmp_ps::<_CMP_GE_OQ>(self.1, b.1)) }
    }
    #[inline(always)]
    fn gt(self, b: Self) -> (__m256, __m256) {
        unsafe { (_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, b.0), _mm256_cmp_ps::<_CMP_GT_OQ>(self.1, b.1)) }
    }
    #[inline(always)]
    fn both(a: (__m256, __m256), b: (__m256, __m256)) -> (__m256, __m256) {
        unsafe { (_mm256_and_ps(a.0, b.0), _mm256_and_ps(a.1, b.1)) }
    }
    #[inline(always)]
    fn select(mask: (__m256, __m256), a: Self, b: Self) -> Self {
        unsafe { Self(_mm256_blendv_ps(b.0, a.0, mask.0), _mm256_blendv_ps(b.1, a.1, mask.1)) }
    }
    #[inline(always)]
    fn bits(mask: (__m256, __m256)) -> u16 {
        unsafe { (_mm256_movemask_ps(mask.0) as u16) | ((_mm256_movemask_ps(mask.1) as u16) << 8) }
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        unsafe { sum8(_mm256_add_ps(self.0, self.1)) }
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self; 4]) -> [f32; 4] {
        unsafe {
            sums8([_mm256_add_ps(a.0, a.1), _mm256_add_ps(b.0, b.1), _mm256_add_ps(c.0, c.1), _mm256_add_ps(d.0, d.1)])
        }
    }
}

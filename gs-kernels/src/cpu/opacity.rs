//! From logits to opacities: `o = 1 / (1 + exp(-logit))`, 0 where the logit is not a number.

use rayon::prelude::*;

use crate::cpu::Real;

/// Rows per task; a task is about 30 microseconds.
const BLOCK: usize = 1 << 13;

/// Opacities `[N]` of `logits` `[N]`.
pub fn forward<F: Real>(logits: &[F]) -> Vec<F> {
    let mut opacities = vec![F::ZERO; logits.len()];
    opacities.par_chunks_mut(BLOCK).zip(logits.par_chunks(BLOCK)).for_each(|(opacities, logits)| {
        for (opacity, &logit) in opacities.iter_mut().zip(logits) {
            *opacity = opacity_of(logit);
        }
    });
    opacities
}

/// The gradient by `logits` from `v` by the opacities: `v e / (1 + e)^2` with `e = exp(-|logit|)`, which does not
/// cancel where the opacity is near 1; 0 where the logit is not a number.
pub fn backward<F: Real>(logits: &[F], v: &[F]) -> Vec<F> {
    assert_eq!(logits.len(), v.len(), "a gradient for each logit");
    let mut v_logits = vec![F::ZERO; logits.len()];
    v_logits.par_chunks_mut(BLOCK).zip(logits.par_chunks(BLOCK).zip(v.par_chunks(BLOCK))).for_each(
        |(v_logits, (logits, v))| {
            for ((out, &logit), &v) in v_logits.iter_mut().zip(logits).zip(v) {
                let slope = slope_of(logit);
                *out = if slope > F::ZERO { v * slope } else { F::ZERO };
            }
        },
    );
    v_logits
}

/// The opacity of a logit.
#[inline(always)]
pub(crate) fn opacity_of<F: Real>(logit: F) -> F {
    let value = F::ONE / (F::ONE + (-logit).exp());
    // False for NaN.
    if value >= F::ZERO { value } else { F::ZERO }
}

/// The derivative of [`opacity_of`].
#[inline(always)]
pub(crate) fn slope_of<F: Real>(logit: F) -> F {
    let e = (-logit.abs()).exp();
    let slope = e / ((F::ONE + e) * (F::ONE + e));
    if slope >= F::ZERO { slope } else { F::ZERO }
}

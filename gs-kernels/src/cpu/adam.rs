//! One fused Adam step (Kingma and Ba 2015) in place. It moves 28 bytes per parameter, the minimum.

use rayon::prelude::*;

use crate::config::AdamConfig;
use crate::cpu::Real;

/// Parameters per task; a task is about 100 microseconds.
const BLOCK: usize = 1 << 16;

/// Updates `params`, `m` and `v` in place from `grads`.
///
/// `m = b1 m + (1 - b1) g`, `v = b2 v + (1 - b2) g^2`, `p -= lr m^ / (sqrt(v^) + eps)` with bias-corrected `m^`, `v^`.
///
/// # Panics
/// When the slices disagree in length or `step` is 0.
pub fn step<F: Real>(params: &mut [F], grads: &[F], m: &mut [F], v: &mut [F], config: &AdamConfig) {
    assert!(config.step > 0, "Adam's steps count from 1");
    let len = params.len();
    assert!(grads.len() == len && m.len() == len && v.len() == len, "Adam's buffers differ in length");
    let exponent = i32::try_from(config.step).unwrap_or(i32::MAX);
    let rate = F::of(config.lr / (1.0 - config.beta1.powi(exponent)));
    let spread = F::of(1.0 / (1.0 - config.beta2.powi(exponent)).sqrt());
    let (beta1, beta2, eps) = (F::of(config.beta1), F::of(config.beta2), F::of(config.eps));
    let (rest1, rest2) = (F::of(1.0 - config.beta1), F::of(1.0 - config.beta2));
    params
        .par_chunks_mut(BLOCK)
        .zip(grads.par_chunks(BLOCK))
        .zip(m.par_chunks_mut(BLOCK))
        .zip(v.par_chunks_mut(BLOCK))
        .for_each(|(((params, grads), m), v)| {
            for (((p, &g), m), v) in params.iter_mut().zip(grads).zip(m).zip(v) {
                *m = beta1 * *m + rest1 * g;
                *v = beta2 * *v + rest2 * g * g;
                *p -= rate * *m / (v.sqrt() * spread + eps);
            }
        });
}

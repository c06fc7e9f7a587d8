//! One fused Adam step (Kingma and Ba 2015) in place. It moves 28 bytes per parameter, the minimum.

use rayon::prelude::*;

use crate::config::AdamConfig;
use crate::cpu::Real;

/// Parameters per task; a task is about 100 microseconds.
const BLOCK: usize = 1 << 16;

/// Updates `params`, `m` and `v` in place from `grads`.
///
/// `m = b1 m + (1 - b1) g`, `v = b2 v + (1 - b2) g^2`, `p -= lr m^ / (sqrt(v^) + eps)` with bias-corrected `m^`, `v^`.
/// [`AdamConfig::first_columns`] of every row may have a learning rate of their own.
///
/// # Panics
/// When the slices disagree in length, `step` is 0, or the parameters are not whole rows.
pub fn step<F: Real>(params: &mut [F], grads: &[F], m: &mut [F], v: &mut [F], config: &AdamConfig) {
    assert!(config.step > 0, "Adam's steps count from 1");
    let len = params.len();
    assert!(grads.len() == len && m.len() == len && v.len() == len, "Adam's buffers differ in length");
    let first = config.first_columns.filter(|first| first.count > 0);
    let row = first.map_or(1, |first| first.row);
    assert!(row > 0 && len.is_multiple_of(row), "{len} parameters are not rows of {row}");
    let exponent = i32::try_from(config.step).unwrap_or(i32::MAX);
    let corrected = |lr: f64| F::of(lr / (1.0 - config.beta1.powi(exponent)));
    let update = Update {
        rate: corrected(config.lr),
        spread: F::of(1.0 / (1.0 - config.beta2.powi(exponent)).sqrt()),
        beta1: F::of(config.beta1),
        beta2: F::of(config.beta2),
        rest1: F::of(1.0 - config.beta1),
        rest2: F::of(1.0 - config.beta2),
        eps: F::of(config.eps),
    };
    let block = (BLOCK / row).max(1) * row;
    params
        .par_chunks_mut(block)
        .zip(grads.par_chunks(block))
        .zip(m.par_chunks_mut(block))
        .zip(v.par_chunks_mut(block))
        .for_each(|(((params, grads), m), v)| match first {
            None => update.run(params, grads, m, v),
            Some(first) => {
                let of_first = Update { rate: corrected(first.lr), ..update };
                let split = first.count.min(row);
                let rows = params.chunks_exact_mut(row).zip(grads.chunks_exact(row));
                for (((params, grads), m), v) in rows.zip(m.chunks_exact_mut(row)).zip(v.chunks_exact_mut(row)) {
                    of_first.run(&mut params[..split], &grads[..split], &mut m[..split], &mut v[..split]);
                    update.run(&mut params[split..], &grads[split..], &mut m[split..], &mut v[split..]);
                }
            }
        });
}

/// The step's constants.
#[derive(Clone, Copy)]
struct Update<F> {
    /// Learning rate over the first moment's bias correction.
    rate: F,
    /// Inverse root of the second moment's bias correction.
    spread: F,
    beta1: F,
    beta2: F,
    /// `1 - beta1`.
    rest1: F,
    /// `1 - beta2`.
    rest2: F,
    eps: F,
}

impl<F: Real> Update<F> {
    #[inline(always)]
    fn run(self, params: &mut [F], grads: &[F], m: &mut [F], v: &mut [F]) {
        for (((p, &g), m), v) in params.iter_mut().zip(grads).zip(m).zip(v) {
            *m = self.beta1 * *m + self.rest1 * g;
            *v = self.beta2 * *v + self.rest2 * g * g;
            *p -= self.rate * *m / (v.sqrt() * self.spread + self.eps);
        }
    }
}

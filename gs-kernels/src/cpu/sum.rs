//! The sum of many numbers, in one order whatever the number of threads.

use rayon::prelude::*;

use crate::config::Activation;
use crate::cpu::Real;
use crate::cpu::opacity::{opacity_of, slope_of};

/// Numbers per task; a task is about 10 microseconds.
const BLOCK: usize = 1 << 14;

/// Partial sums of a block: one for each lane of a vector unit, so that no addition waits for the one before.
const LANES: usize = 16;

/// The sum of `values`: blocks of `BLOCK`, then the blocks' sums in order.
pub fn sum<F: Real>(values: &[F]) -> F {
    let parts: Vec<F> = values.par_chunks(BLOCK).map(block_sum).collect();
    parts.into_iter().fold(F::ZERO, |total, part| total + part)
}

fn block_sum<F: Real>(values: &[F]) -> F {
    let mut lanes = [F::ZERO; LANES];
    let chunks = values.chunks_exact(LANES);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane += *value;
        }
    }
    for (lane, value) in lanes.iter_mut().zip(rest) {
        *lane += *value;
    }
    lanes.into_iter().fold(F::ZERO, |total, lane| total + lane)
}

/// `factor` times the sum of the activations of `values`.
pub fn activated<F: Real>(values: &[F], activation: Activation, factor: F) -> F {
    let part = |block: &[F]| -> F {
        let value = |x: &F| match activation {
            Activation::Exp => x.exp(),
            Activation::Sigmoid => opacity_of(*x),
        };
        block.iter().fold(F::ZERO, |total, x| total + value(x))
    };
    let parts: Vec<F> = values.par_chunks(ACTIVATED).map(part).collect();
    parts.into_iter().fold(F::ZERO, |total, part| total + part) * factor
}

/// The gradient by `values` of [`activated`] from `v` by its result.
pub fn activated_backward<F: Real>(values: &[F], v: F, activation: Activation, factor: F) -> Vec<F> {
    let (scale, mut out) = (v * factor, vec![F::ZERO; values.len()]);
    out.par_chunks_mut(ACTIVATED).zip(values.par_chunks(ACTIVATED)).for_each(|(out, values)| {
        for (out, x) in out.iter_mut().zip(values) {
            *out = scale
                * match activation {
                    Activation::Exp => x.exp(),
                    Activation::Sigmoid => slope_of(*x),
                };
        }
    });
    out
}

/// Numbers per task where each takes an exponential; a task is about 10 microseconds, and an `f32` sum of so few is
/// exact to 1e-5.
const ACTIVATED: usize = 1 << 11;

/// Whether every number is finite.
pub fn all_finite<F: Real>(values: &[F]) -> bool {
    // No early end within a block: its branch would keep the loop from vectors.
    values.par_chunks(BLOCK).all(|block| block.iter().fold(true, |all, value| all & value.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_whole_numbers_are_exact() {
        for count in [0usize, 1, 15, 16, 17, BLOCK - 1, BLOCK, 5 * BLOCK + 3] {
            let values: Vec<f64> = (0..count).map(|i| (i % 7) as f64 - 2.0).collect();
            assert_eq!(sum(&values), values.iter().sum::<f64>(), "{count}");
        }
    }

    #[test]
    fn one_broken_number_is_found() {
        let mut values = vec![1.0f32; 3 * BLOCK];
        assert!(all_finite(&values));
        values[2 * BLOCK + 5] = f32::NAN;
        assert!(!all_finite(&values));
        values[2 * BLOCK + 5] = f32::INFINITY;
        assert!(!all_finite(&values));
    }
}

//! The sum of many numbers, in one order whatever the number of threads.

use rayon::prelude::*;

use crate::cpu::Real;

/// Numbers per task; a task is about 10 microseconds.
const BLOCK: usize = 1 << 14;

/// Partial sums of a block: one for each lane of a vector unit, so that no addition waits for the one before.
const LANES: usize = 16;

/// The sum of `values`: blocks of [`BLOCK`], then the blocks' sums in order.
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

/// Whether every number is finite.
pub fn all_finite<F: Real>(values: &[F]) -> bool {
    values.par_chunks(BLOCK).all(|block| block.iter().all(|value| value.is_finite()))
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

//! Forward, and backward by the input: block by block of output rows, offset by offset.
//!
//! A block is one task and writes its rows alone. Offsets are added in a fixed order, so results are equal to the bit
//! for any number of threads.

use rayon::prelude::*;

use super::direct::{self, Channels};
use super::pairs::PairLists;
use crate::cpu::Real;
use crate::cpu::parallel::zeros;

/// `[outputs, C_out]` from `input` `[inputs, C_in]` and `weights` `[K, C_in, C_out]`; with `flip`, offset `k` takes
/// the weights of offset `K - 1 - k`.
///
/// The backward by the input is this function with [`transposed_weights`] and the lists of the reversed table.
///
/// # Panics
/// When the slices disagree in length.
pub fn forward<F: Real>(input: &[F], weights: &[F], lists: &PairLists, flip: bool, channels: Channels) -> Vec<F> {
    let Channels { input: wide_in, output: wide_out } = channels;
    assert_eq!(input.len(), lists.inputs * wide_in, "input must be [{}, {wide_in}]", lists.inputs);
    assert_eq!(weights.len(), lists.offsets * wide_in * wide_out, "weights must be [K, C_in, C_out]");
    let mut output = zeros(lists.outputs * wide_out);
    if output.is_empty() || wide_in == 0 {
        return output;
    }
    let weight = |k: usize| if flip { lists.offsets - 1 - k } else { k };
    let packed = direct::packed(weights, channels);
    let tasks = output.par_chunks_mut(lists.block * wide_out).enumerate();
    tasks.for_each(|(block, out)| direct::block(input, &packed, lists, block, weight, channels, out));
    output
}

/// `[K, C_out, C_in]` from `[K, C_in, C_out]`.
///
/// # Panics
/// When the slice disagrees with `channels`.
pub fn transposed_weights<F: Real>(weights: &[F], channels: Channels) -> Vec<F> {
    let Channels { input, output } = channels;
    let mut transposed = zeros(weights.len());
    if weights.is_empty() {
        return transposed;
    }
    assert!(weights.len().is_multiple_of(input * output), "weights must be [K, {input}, {output}]");
    let offsets = transposed.par_chunks_exact_mut(input * output).zip(weights.par_chunks_exact(input * output));
    offsets.for_each(|(to, from)| {
        for (c, row) in from.chunks_exact(output).enumerate() {
            row.iter().enumerate().for_each(|(d, w)| to[d * input + c] = *w);
        }
    });
    transposed
}

//! The product of a block: sixteen columns of six output rows stay in registers while the input rows are read through
//! the pairs.
//!
//! Left aside: gathered rows, a matrix product, and a sum into the output. With 32 columns copying takes longer than
//! the product, and with 96 the rate was two thirds of this one (BENCHMARKS.md).

use super::pairs::{PairLists, Pairs};
use crate::cpu::Real;
use crate::cpu::parallel::zeros;
use crate::cpu::real::{LANES, LaneTask, Lanes};

/// Columns of the input and the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channels {
    /// Columns of the input.
    pub input: usize,
    /// Columns of the output.
    pub output: usize,
}

/// Output rows at a time: six vectors of sixteen lanes are twelve registers of AVX2, which has sixteen.
const ROWS: usize = 6;

/// Weights as `[K, C_out / 16, C_in, 16]`, zeros beyond `C_out`.
pub(super) fn packed<F: Real>(weights: &[F], Channels { input, output }: Channels) -> Vec<F> {
    let (offsets, strips) = (weights.len() / (input * output), output.div_ceil(LANES));
    let mut packed = zeros(offsets * strips * input * LANES);
    for (at, row) in packed.chunks_exact_mut(LANES).enumerate() {
        let (k, strip, c) = (at / input / strips, at / input % strips, at % input);
        let columns = strip * LANES..((strip + 1) * LANES).min(output);
        row[..columns.len()].copy_from_slice(&weights[(k * input + c) * output..][columns]);
    }
    packed
}

/// The rows of one block; `weight(k)` is the index of the weights of offset `k`.
pub(super) fn block<F: Real>(
    input: &[F],
    packed: &[F],
    lists: &PairLists,
    block: usize,
    weight: impl Fn(usize) -> usize,
    channels: Channels,
    out: &mut [F],
) {
    let wide = channels.output.next_multiple_of(LANES);
    if wide == channels.output {
        return F::with_lanes(Block { input, packed, lists, block, weight, inner: channels.input, wide, out });
    }
    let rows = out.len() / channels.output;
    let mut padded = zeros(rows * wide);
    F::with_lanes(Block { input, packed, lists, block, weight, inner: channels.input, wide, out: &mut padded });
    for (to, from) in out.chunks_exact_mut(channels.output).zip(padded.chunks_exact(wide)) {
        to.copy_from_slice(&from[..channels.output]);
    }
}

struct Block<'a, F, W> {
    input: &'a [F],
    packed: &'a [F],
    lists: &'a PairLists,
    block: usize,
    weight: W,
    /// Columns of the input.
    inner: usize,
    /// Columns of `out`.
    wide: usize,
    out: &'a mut [F],
}

impl<F: Real, W: Fn(usize) -> usize> LaneTask<F> for Block<'_, F, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        let Self { input, packed, lists, block, weight, inner, wide, out } = self;
        for k in lists.order() {
            let weights = &packed[weight(k) * inner * wide..][..inner * wide];
            let Pairs { from, to } = lists.pairs(block, k);
            // The weights of sixteen columns stay in the first-level cache while all rows pass.
            for (strip, weights) in weights.chunks_exact(inner * LANES).enumerate() {
                let first = strip * LANES;
                let (mut from, mut to) = (from.chunks_exact(ROWS), to.chunks_exact(ROWS));
                for (from, to) in from.by_ref().zip(to.by_ref()) {
                    tile::<L, ROWS>(input, weights, [inner, wide], first, from, to, out);
                }
                for (from, to) in from.remainder().chunks(1).zip(to.remainder().chunks(1)) {
                    tile::<L, 1>(input, weights, [inner, wide], first, from, to, out);
                }
            }
        }
    }
}

/// Adds the products of `R` input rows to sixteen columns, from `first`, of `R` distinct output rows.
#[inline(always)]
fn tile<L: Lanes, const R: usize>(
    input: &[L::Real],
    weights: &[L::Real],
    [inner, wide]: [usize; 2],
    first: usize,
    from: &[u32],
    to: &[u16],
    out: &mut [L::Real],
) {
    let rows: [&[L::Real]; R] = std::array::from_fn(|r| &input[from[r] as usize * inner..][..inner]);
    assert_eq!(weights.len(), inner * LANES, "the weights of sixteen columns");
    let at: [usize; R] = std::array::from_fn(|r| usize::from(to[r]) * wide + first);
    let mut sums: [L; R] = std::array::from_fn(|r| L::load_at(out, at[r]));
    for (c, w) in weights.chunks_exact(LANES).enumerate() {
        let w = L::load_at(w, 0);
        for r in 0..R {
            // SAFETY: `weights` has `inner` vectors, so `c` is below `inner`, the length of every row.
            let x = unsafe { *rows[r].get_unchecked(c) };
            sums[r] = L::splat(x).mul_add(w, sums[r]);
        }
    }
    for r in 0..R {
        sums[r].store_at(out, at[r]);
    }
}

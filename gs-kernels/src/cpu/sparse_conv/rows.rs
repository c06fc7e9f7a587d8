//! Forward, and backward by the input: block by block of output rows, offset by offset, gather, product, one sum a row.
//!
//! A block is one task and writes its rows alone. Offsets are added in a fixed order, so results are equal to the bit for any number of
//! threads.

use rayon::prelude::*;

use super::direct;
use super::pairs::{PairLists, Pairs};
use crate::cpu::Real;
use crate::cpu::parallel::zeros;

/// Widest output row that is computed without buffers; above, a matrix product of gathered rows is faster.
const WIDEST_DIRECT: usize = 64;

/// Columns of the input and the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channels {
    /// Columns of the input.
    pub input: usize,
    /// Columns of the output.
    pub output: usize,
}

/// `[outputs, C_out]` from `input` `[inputs, C_in]` and `weights` `[K, C_in, C_out]`; with `flip`, offset `k` takes the weights of offset
/// `K - 1 - k`.
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
    let tasks = output.par_chunks_mut(lists.block * wide_out).enumerate();
    if wide_out <= WIDEST_DIRECT {
        let packed = direct::packed(weights, channels);
        tasks.for_each(|(block, out)| direct::block(input, &packed, lists, block, weight, channels, out));
    } else {
        let size = wide_in * wide_out;
        tasks.for_each_init(Vec::new, |buffer, (block, out)| {
            for k in lists.order() {
                let product = Product { weights: &weights[weight(k) * size..][..size], channels };
                product.add(input, lists, block, k, buffer, out);
            }
        });
    }
    output
}

/// The weights of one offset.
struct Product<'a, F> {
    weights: &'a [F],
    channels: Channels,
}

impl<F: Real> Product<'_, F> {
    /// Adds one offset to the rows of a block.
    fn add(&self, input: &[F], lists: &PairLists, block: usize, k: usize, buffer: &mut Vec<F>, out: &mut [F]) {
        let Channels { input: wide_in, output: wide_out } = self.channels;
        let Pairs { from, to } = lists.pairs(block, k);
        if lists.is_identity(k) {
            // Each row meets itself, and this offset is the first: neither gather nor sum.
            let rows = &input[block * lists.block * wide_in..][..to.len() * wide_in];
            return multiply(rows, [wide_in, 1], self.weights, out, [to.len(), wide_in, wide_out], false);
        }
        buffer.resize(lists.block * (wide_in + wide_out), F::ZERO);
        let (gathered, products) = buffer.split_at_mut(lists.block * wide_in);
        gather(input, from.iter().map(|row| *row as usize), wide_in, gathered);
        multiply(gathered, [wide_in, 1], self.weights, products, [to.len(), wide_in, wide_out], false);
        for (&row, product) in to.iter().zip(products.chunks_exact(wide_out)) {
            let sums = &mut out[usize::from(row) * wide_out..][..wide_out];
            sums.iter_mut().zip(product).for_each(|(sum, x)| *sum += *x);
        }
    }
}

/// Copies rows one after the other.
pub(super) fn gather<F: Copy>(input: &[F], rows: impl Iterator<Item = usize>, wide: usize, gathered: &mut [F]) {
    for (row, to) in rows.zip(gathered.chunks_exact_mut(wide)) {
        to.copy_from_slice(&input[row * wide..][..wide]);
    }
}

/// `out [m, n] = a [m, k] b [k, n]`, or with `add` added to it, on this thread. `strides` are those of `a` by row and column.
pub(super) fn multiply<F: Real>(
    a: &[F],
    strides: [usize; 2],
    b: &[F],
    out: &mut [F],
    [m, k, n]: [usize; 3],
    add: bool,
) {
    assert!(a.len() >= m * k && b.len() >= k * n && out.len() >= m * n, "product of [{m}, {k}] by [{k}, {n}]");
    let fits = m * k == 0 || (m - 1) * strides[0] + (k - 1) * strides[1] < a.len();
    assert!(fits, "strides {strides:?} of [{m}, {k}]");
    let (n_step, [row, column]) = (n as isize, strides.map(|s| s as isize));
    // SAFETY: the assertions above keep every access inside the slices, and `out` is borrowed for writing.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.as_mut_ptr(),
            1,
            n_step,
            add,
            a.as_ptr(),
            column,
            row,
            b.as_ptr(),
            1,
            n_step,
            F::ONE,
            F::ONE,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
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

//! Backward by the weights: `dW_k = sum over pairs of X[i]^T dY[o]`, by fixed groups of blocks and then a fixed tree
//! over the groups.

use rayon::prelude::*;

use super::direct::Channels;
use super::pairs::{PairLists, Pairs};
use crate::cpu::Real;
use crate::cpu::parallel::zeros;

/// Most groups: each holds weights of its own until the tree adds them.
const MOST_GROUPS: usize = 16;
/// Fewest blocks of a group: fewer would add more than they multiply.
const FEWEST_BLOCKS: usize = 4;
/// Pairs of one product: the gathered rows stay in the second-level cache.
const PAIRS: usize = 1024;

/// `[K, C_in, C_out]` from `input` `[inputs, C_in]` and `v_output` `[outputs, C_out]`; `flip` as in
/// [`forward`](super::forward).
///
/// # Panics
/// When the slices disagree in length.
pub fn backward_weights<F: Real>(
    input: &[F],
    v_output: &[F],
    lists: &PairLists,
    flip: bool,
    channels: Channels,
) -> Vec<F> {
    let Channels { input: wide_in, output: wide_out } = channels;
    assert_eq!(input.len(), lists.inputs * wide_in, "input must be [{}, {wide_in}]", lists.inputs);
    assert_eq!(v_output.len(), lists.outputs * wide_out, "v_output must be [{}, {wide_out}]", lists.outputs);
    let (size, offsets, blocks) = (wide_in * wide_out, lists.offsets, lists.blocks());
    if size == 0 || blocks == 0 {
        return zeros(offsets * size);
    }
    let per_group = blocks.div_ceil(MOST_GROUPS).max(FEWEST_BLOCKS);
    let groups = blocks.div_ceil(per_group);
    let mut partial: Vec<Vec<F>> = (0..groups).map(|_| zeros(offsets * size)).collect();
    let tasks = partial
        .par_iter_mut()
        .enumerate()
        .flat_map(|(group, sums)| sums.par_chunks_exact_mut(size).enumerate().map(move |(k, sums)| (group, k, sums)));
    tasks.for_each_init(Vec::new, |buffer, (group, k, sums)| {
        let offset = if flip { offsets - 1 - k } else { k };
        let blocks = group * per_group..((group + 1) * per_group).min(blocks);
        let mut sum = Sum { input, v_output, channels, buffer, pairs: 0, sums };
        blocks.for_each(|block| sum.add(lists, block, offset));
        sum.flush();
    });
    while partial.len() > 1 {
        partial = partial.par_chunks_mut(2).map(added).collect();
    }
    partial.swap_remove(0)
}

/// The sum of one or two vectors.
fn added<F: Real>(pair: &mut [Vec<F>]) -> Vec<F> {
    let (first, rest) = pair.split_at_mut(1);
    let mut sum = std::mem::take(&mut first[0]);
    if let [second] = rest {
        sum.iter_mut().zip(second).for_each(|(a, b)| *a += *b);
    }
    sum
}

/// The weights of one offset, summed over products of up to [`PAIRS`] pairs.
struct Sum<'a, F> {
    input: &'a [F],
    v_output: &'a [F],
    channels: Channels,
    /// Gathered rows of the input, then of the output.
    buffer: &'a mut Vec<F>,
    pairs: usize,
    sums: &'a mut [F],
}

impl<F: Real> Sum<'_, F> {
    fn add(&mut self, lists: &PairLists, block: usize, offset: usize) {
        let Channels { input: wide_in, output: wide_out } = self.channels;
        let Pairs { from, to } = lists.pairs(block, offset);
        let first = block * lists.block;
        if lists.is_identity(offset) {
            let rows = &self.input[first * wide_in..][..to.len() * wide_in];
            let v_rows = &self.v_output[first * wide_out..][..to.len() * wide_out];
            return multiply(rows, [1, wide_in], v_rows, self.sums, [wide_in, to.len(), wide_out], true);
        }
        if self.pairs + to.len() > PAIRS {
            self.flush();
        }
        let room = PAIRS.max(lists.block);
        self.buffer.resize(room * (wide_in + wide_out), F::ZERO);
        let (rows, v_rows) = self.buffer.split_at_mut(room * wide_in);
        gather(self.input, from.iter().map(|row| *row as usize), wide_in, &mut rows[self.pairs * wide_in..]);
        let to = to.iter().map(|row| first + usize::from(*row));
        gather(self.v_output, to, wide_out, &mut v_rows[self.pairs * wide_out..]);
        self.pairs += from.len();
    }

    /// Multiplies what is gathered.
    fn flush(&mut self) {
        let Channels { input: wide_in, output: wide_out } = self.channels;
        if self.pairs > 0 {
            let room = self.buffer.len() / (wide_in + wide_out);
            let (rows, v_rows) = self.buffer.split_at(room * wide_in);
            multiply(rows, [1, wide_in], v_rows, self.sums, [wide_in, self.pairs, wide_out], true);
            self.pairs = 0;
        }
    }
}

/// Copies rows one after the other.
fn gather<F: Copy>(input: &[F], rows: impl Iterator<Item = usize>, wide: usize, gathered: &mut [F]) {
    for (row, to) in rows.zip(gathered.chunks_exact_mut(wide)) {
        to.copy_from_slice(&input[row * wide..][..wide]);
    }
}

/// `out [m, n] = a [m, k] b [k, n]`, or with `add` added to it, on this thread. `strides` are those of `a` by row and
/// column.
fn multiply<F: Real>(a: &[F], strides: [usize; 2], b: &[F], out: &mut [F], [m, k, n]: [usize; 3], add: bool) {
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

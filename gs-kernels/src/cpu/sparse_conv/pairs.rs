//! Pairs of input and output row by block of output rows and offset of the kernel: the pairs that exist, and no others.

use rayon::prelude::*;

use super::table::Neighbours;

/// Most output rows of a block: the results of a block stay in cache while 27 offsets are added to them.
const LARGEST_BLOCK: usize = 1024;
/// Fewest output rows of a block: below, the weights would be read more often than the rows.
const SMALLEST_BLOCK: usize = 128;
/// Blocks wanted of a small set of rows, for so many threads.
const BLOCKS_WANTED: usize = 16;

/// The pairs of a table of neighbours.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PairLists {
    /// Rows of the input.
    pub inputs: usize,
    /// Rows of the output.
    pub outputs: usize,
    /// Offsets of the kernel.
    pub offsets: usize,
    /// Output rows of a block.
    pub block: usize,
    /// `[blocks * offsets + 1]`: where the pairs of a block and offset begin.
    starts: Vec<usize>,
    /// Input row of each pair.
    from: Vec<u32>,
    /// Output row of each pair, from the block's first.
    to: Vec<u16>,
    /// The offset at which every row meets itself, if there is one.
    identity: Option<usize>,
}

/// The pairs of one block and offset.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pairs<'a> {
    pub from: &'a [u32],
    /// From the block's first row.
    pub to: &'a [u16],
}

impl PairLists {
    /// The pairs of `neighbours`. The size of a block depends on the number of rows alone.
    pub fn of(neighbours: &Neighbours) -> Self {
        let Neighbours { inputs, outputs, offsets, ref table } = *neighbours;
        let block = (outputs / BLOCKS_WANTED).next_power_of_two().clamp(SMALLEST_BLOCK, LARGEST_BLOCK);
        let blocks: Vec<_> = table.par_chunks(block * offsets).map(|rows| block_pairs(rows, offsets)).collect();
        let pairs = blocks.iter().map(|(_, from, _)| from.len()).sum();
        let (mut starts, mut all_from, mut all_to) = (vec![0], Vec::with_capacity(pairs), Vec::with_capacity(pairs));
        for (counts, from, to) in blocks {
            for count in counts {
                starts.push(starts[starts.len() - 1] + count);
            }
            all_from.extend(from);
            all_to.extend(to);
        }
        let meets_itself = |k: &usize| table.chunks_exact(offsets).enumerate().all(|(i, row)| row[*k] == i as i32);
        let identity = (inputs == outputs).then(|| (0..offsets).find(meets_itself)).flatten();
        Self { inputs, outputs, offsets, block, starts, from: all_from, to: all_to, identity }
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.from.len()
    }

    /// Whether there is no pair.
    pub fn is_empty(&self) -> bool {
        self.from.is_empty()
    }

    /// All pairs of one offset as `(input row, output row)`, output rows ascending.
    pub fn of_offset(&self, offset: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.blocks()).flat_map(move |block| {
            let Pairs { from, to } = self.pairs(block, offset);
            from.iter().zip(to).map(move |(from, to)| (*from as usize, block * self.block + *to as usize))
        })
    }

    /// Blocks of output rows.
    pub(super) fn blocks(&self) -> usize {
        self.outputs.div_ceil(self.block)
    }

    /// The pairs of a block and offset.
    pub(super) fn pairs(&self, block: usize, offset: usize) -> Pairs<'_> {
        let at = block * self.offsets + offset;
        let range = self.starts[at]..self.starts[at + 1];
        Pairs { from: &self.from[range.clone()], to: &self.to[range] }
    }

    /// The offset at which every row meets itself, first, then the others in order.
    pub(super) fn order(&self) -> impl Iterator<Item = usize> + '_ {
        self.identity.into_iter().chain((0..self.offsets).filter(|k| Some(*k) != self.identity))
    }

    /// Whether every row meets itself at `offset`.
    pub(super) fn is_identity(&self, offset: usize) -> bool {
        self.identity == Some(offset)
    }
}

/// Number of pairs by offset, input rows and output rows of a block.
fn block_pairs(rows: &[i32], offsets: usize) -> (Vec<usize>, Vec<u32>, Vec<u16>) {
    let (mut counts, mut from, mut to) = (Vec::with_capacity(offsets), Vec::new(), Vec::new());
    for k in 0..offsets {
        let before = from.len();
        for (row, neighbours) in rows.chunks_exact(offsets).enumerate() {
            if neighbours[k] >= 0 {
                from.push(neighbours[k] as u32);
                to.push(row as u16);
            }
        }
        counts.push(from.len() - before);
    }
    (counts, from, to)
}

//! Sums of rows by segment, and the rows of segments: points to voxels and back, each the backward of the other.

use rayon::prelude::*;

use super::Real;
use super::parallel::{CHUNK, zeros};
use super::sparse_conv::SparseError;

/// The segment of each of `N` rows and the rows of each of `V` segments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SegmentLists {
    /// `[N]`: the segment of each row.
    pub of_row: Vec<u32>,
    /// `[V + 1]`: segment `s` owns `rows[starts[s]..starts[s + 1]]`.
    pub starts: Vec<u32>,
    /// `[N]`: rows by segment.
    pub rows: Vec<u32>,
}

impl SegmentLists {
    /// The lists of `segments` segments; `order` names every row once, and sums of a segment follow it.
    ///
    /// # Errors
    /// When a row is in no segment.
    pub fn new(
        of_row: Vec<u32>,
        segments: usize,
        order: impl Iterator<Item = u32> + Clone,
    ) -> Result<Self, SparseError> {
        if let Some(row) = of_row.iter().position(|segment| *segment as usize >= segments) {
            return Err(SparseError::Segment { row, found: of_row[row], segments });
        }
        let mut starts = vec![0; segments + 1];
        of_row.iter().for_each(|segment| starts[*segment as usize + 1] += 1);
        for segment in 0..segments {
            starts[segment + 1] += starts[segment];
        }
        let (mut next, mut rows) = (starts.clone(), vec![0; of_row.len()]);
        for row in order {
            let place = &mut next[of_row[row as usize] as usize];
            rows[*place as usize] = row;
            *place += 1;
        }
        Ok(Self { of_row, starts, rows })
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        self.starts.len() - 1
    }

    /// The rows of a segment.
    pub fn rows_of(&self, segment: usize) -> &[u32] {
        &self.rows[self.starts[segment] as usize..self.starts[segment + 1] as usize]
    }

    /// `1 / rows` of a segment, 0 without rows.
    fn share<F: Real>(&self, segment: usize) -> F {
        match self.rows_of(segment).len() {
            0 => F::ZERO,
            count => F::of(1.0 / count as f64),
        }
    }
}

/// Sum of the rows of each segment in list order, `[V, C]` from `input` `[N, C]`; with `mean` the sum over the count,
/// 0 for an empty segment.
///
/// # Panics
/// When the slice disagrees in length.
pub fn reduce<F: Real>(input: &[F], channels: usize, lists: &SegmentLists, mean: bool) -> Vec<F> {
    assert_eq!(input.len(), lists.of_row.len() * channels, "input must be [{}, {channels}]", lists.of_row.len());
    let mut output = zeros(lists.segments() * channels);
    if channels == 0 {
        return output;
    }
    output.par_chunks_mut(CHUNK * channels).enumerate().for_each(|(chunk, sums)| {
        for (at, sums) in sums.chunks_exact_mut(channels).enumerate() {
            let segment = chunk * CHUNK + at;
            for row in lists.rows_of(segment) {
                let row = &input[*row as usize * channels..][..channels];
                sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += *x);
            }
            if mean {
                let share = lists.share::<F>(segment);
                sums.iter_mut().for_each(|sum| *sum *= share);
            }
        }
    });
    output
}

/// The segment's row for each row, `[N, C]` from `input` `[V, C]`; with `mean` over the segment's count.
///
/// # Panics
/// When the slice disagrees in length.
pub fn take<F: Real>(input: &[F], channels: usize, lists: &SegmentLists, mean: bool) -> Vec<F> {
    assert_eq!(input.len(), lists.segments() * channels, "input must be [{}, {channels}]", lists.segments());
    let mut output = zeros(lists.of_row.len() * channels);
    if channels == 0 {
        return output;
    }
    output.par_chunks_mut(CHUNK * channels).zip(lists.of_row.par_chunks(CHUNK)).for_each(|(rows, segments)| {
        for (to, segment) in rows.chunks_exact_mut(channels).zip(segments) {
            let segment = *segment as usize;
            to.copy_from_slice(&input[segment * channels..][..channels]);
            if mean {
                let share = lists.share::<F>(segment);
                to.iter_mut().for_each(|x| *x *= share);
            }
        }
    });
    output
}

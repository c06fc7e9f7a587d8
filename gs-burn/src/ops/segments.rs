//! Rows and the segments that they are in, such as points and their voxels: means of rows by segment, and each
//! segment's row back.
//!
//! The gradient of Burn's `select` adds rows in one thread a column on a GPU. Here the backward of each operation is
//! the forward of the other, with one write a row, so results are equal to the bit from run to run.

mod lists;

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::segments as cpu;
use gs_kernels::cpu::segments::SegmentLists;

use super::operation::{Operation, Output, State, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use lists::Segments;

/// The mean row of each segment, `[V, C]` from `input` `[N, C]`; zeros for a segment without rows. Differentiable.
///
/// # Panics
/// When `input` has not one row for each row of `segments`.
pub fn segment_mean(input: Tensor<2>, segments: &Segments) -> Tensor<2> {
    let ([_, channels], rows) = (input.dims(), segments.rows());
    assert_shape!(input, [rows, channels]);
    let _stage = profile::stage("segments");
    differentiable(AlongSegments::Mean(segments.lists().clone()), [input.into_dispatch()], segments.tables())
}

/// The row of its segment for each row, `[N, C]` from `input` `[V, C]`. Differentiable.
///
/// # Panics
/// When `input` has not one row for each segment.
pub fn take_rows(input: Tensor<2>, segments: &Segments) -> Tensor<2> {
    let ([_, channels], count) = (input.dims(), segments.count());
    assert_shape!(input, [count, channels]);
    let _stage = profile::stage("segments");
    differentiable(AlongSegments::Take(segments.lists().clone()), [input.into_dispatch()], segments.tables())
}

/// [`segment_mean`] and [`take_rows`] as operations; each is the backward of the other, but for the factors of the
/// mean. Their lists are the tables of [`Segments`], which are empty on a CPU.
#[derive(Clone, Debug)]
pub(crate) enum AlongSegments {
    Mean(Arc<SegmentLists>),
    Take(Arc<SegmentLists>),
}

/// A walk along the lists, with the factors of a mean or without.
pub(crate) enum Walk<'a> {
    /// Rows added up by segment.
    Reduce(&'a SegmentLists, bool),
    /// Each segment's row, for every row that is in it.
    Take(&'a SegmentLists, bool),
}

impl AlongSegments {
    pub(crate) fn forward_walk(&self) -> Walk<'_> {
        match self {
            Self::Mean(lists) => Walk::Reduce(lists, true),
            Self::Take(lists) => Walk::Take(lists, false),
        }
    }

    pub(crate) fn backward_walk(&self) -> Walk<'_> {
        match self {
            Self::Mean(lists) => Walk::Take(lists, true),
            Self::Take(lists) => Walk::Reduce(lists, false),
        }
    }
}

impl Walk<'_> {
    fn on_host<B: HostBackend>(self, input: &FloatTensor<B>) -> FloatTensor<B> {
        let channels = input.shape()[1];
        with_float!(*input, F => match self {
            Self::Reduce(lists, mean) => {
                let sums = cpu::reduce::<F>(input.elements(), channels, lists, mean);
                float_tensor::<B>(sums, [lists.segments(), channels])
            }
            Self::Take(lists, mean) => {
                let rows = cpu::take::<F>(input.elements(), channels, lists, mean);
                float_tensor::<B>(rows, [lists.of_row.len(), channels])
            }
        })
    }
}

impl Operation<1, 3> for AlongSegments {
    const READS_INPUTS: bool = false;

    fn forward<B: HostBackend>(&self, [input]: [FloatTensor<B>; 1], _: [IntTensor<B>; 3], _: bool) -> Output<B> {
        Output::of(self.forward_walk().on_host::<B>(&input))
    }

    fn backward<B: HostBackend>(
        &self,
        _: State<B, 1, 3>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        [Some(self.backward_walk().on_host::<B>(&v))]
    }
}

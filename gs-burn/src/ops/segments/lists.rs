//! The lists of rows and segments, on the host and on a GPU.

use std::sync::Arc;

use burn::backend::Dispatch;
use burn::backend::tensor::IntTensor;
use burn::tensor::{Device, Int, Tensor};
use gs_kernels::cpu::segments::SegmentLists;
use gs_kernels::cpu::sparse_conv::SparseError;

use crate::device::is_gpu;

/// The segment of each of `N` rows, and the rows of each of `V` segments; built once on the host. A clone shares it.
#[derive(Clone, Debug)]
pub struct Segments {
    lists: Arc<SegmentLists>,
    of_row: Tensor<1, Int>,
    starts: Tensor<1, Int>,
    by_segment: Tensor<1, Int>,
}

impl Segments {
    /// Segments from the index of each row's segment, `[N]`, each below `count`. Sums of a segment follow the order
    /// of rows.
    ///
    /// # Errors
    /// When an index is not below `count`.
    pub fn new(of_row: Vec<u32>, count: usize, device: &Device) -> Result<Self, SparseError> {
        let rows = of_row.len() as u32;
        Ok(Self::upload(SegmentLists::new(of_row, count, 0..rows)?, device))
    }

    /// [`Segments::new`] whose sums follow `order`, a permutation of the rows: sums that do not depend on the order
    /// of the rows need an order that does not either.
    ///
    /// # Errors
    /// When an index is not below `count`.
    ///
    /// # Panics
    /// When `order` is not a permutation of the rows.
    pub fn with_order(of_row: Vec<u32>, count: usize, order: &[u32], device: &Device) -> Result<Self, SparseError> {
        let mut seen = vec![false; of_row.len()];
        order.iter().for_each(|row| seen[*row as usize] = true);
        let permutes = order.len() == of_row.len() && seen.iter().all(|seen| *seen);
        assert!(permutes, "the order must name each of {} rows once", of_row.len());
        Ok(Self::upload(SegmentLists::new(of_row, count, order.iter().copied())?, device))
    }

    fn upload(lists: SegmentLists, device: &Device) -> Self {
        let table = |values: &[u32]| {
            let values = if is_gpu(device) { values.iter().map(|v| *v as i32).collect() } else { Vec::new() };
            crate::ops::index_tensor(values, device)
        };
        let (of_row, starts, by_segment) = (table(&lists.of_row), table(&lists.starts), table(&lists.rows));
        Self { lists: Arc::new(lists), of_row, starts, by_segment }
    }

    /// Number of rows, `N`.
    pub fn rows(&self) -> usize {
        self.lists.of_row.len()
    }

    /// Number of segments, `V`.
    pub fn count(&self) -> usize {
        self.lists.segments()
    }

    /// The segment of each row, `[N]`.
    pub fn of_row(&self) -> &[u32] {
        &self.lists.of_row
    }

    pub(super) fn lists(&self) -> &Arc<SegmentLists> {
        &self.lists
    }

    pub(super) fn tables(&self) -> [IntTensor<Dispatch>; 3] {
        [&self.of_row, &self.starts, &self.by_segment].map(|list| list.clone().into_dispatch())
    }
}

//! Row maps: the old row of each row of a changed scene.

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};

use crate::named_parameters::map_parameters;

/// A change of the rows of a scene, by copying, moving or removing Gaussians.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RowMap {
    /// The old row of each new row.
    pub from: Vec<u32>,
    /// Whether the new row's optimiser moments are reset to zero.
    pub reset: Vec<bool>,
}

impl RowMap {
    /// Keeps the old rows `kept`, in this order, with their moments.
    pub fn keep(kept: Vec<u32>) -> Self {
        Self { reset: vec![false; kept.len()], from: kept }
    }

    /// Number of new rows.
    pub fn len(&self) -> usize {
        self.from.len()
    }

    /// Whether no row is left.
    pub fn is_empty(&self) -> bool {
        self.from.is_empty()
    }

    /// Whether each of `rows` rows keeps its position (its moments may be reset).
    pub fn is_identity(&self, rows: usize) -> bool {
        self.len() == rows && self.from.iter().enumerate().all(|(new, old)| new as u32 == *old)
    }

    /// The new rows of `table` `[old rows, columns]`, outside autodiff.
    pub fn select(&self, table: Tensor<2>) -> Tensor<2> {
        let [rows, columns] = table.dims();
        if self.is_identity(rows) {
            return table;
        }
        if self.is_empty() || columns == 0 {
            return Tensor::zeros([self.len(), columns], (&table.device(), table.dtype()));
        }
        let index = self.index(&table.device());
        table.select(0, index)
    }

    /// The new rows of moments `[old rows, columns]`, zero where they are reset.
    pub fn select_moments(&self, table: Tensor<2>) -> Tensor<2> {
        let selected = self.select(table);
        if self.is_empty() || !self.reset.contains(&true) {
            return selected;
        }
        let keep: Vec<f32> = self.reset.iter().map(|reset| if *reset { 0.0 } else { 1.0 }).collect();
        let options = (&selected.device(), selected.dtype());
        let keep = Tensor::<2>::from_data(TensorData::new(keep, [self.len(), 1]), options);
        selected * keep
    }

    /// `module` with the new rows of every learned tensor, for modules with one row per Gaussian in every tensor.
    pub fn apply<M: Module>(&self, module: M) -> M {
        map_parameters(module, |_, table| self.select(table))
    }

    fn index(&self, device: &Device) -> Tensor<1, Int> {
        let rows: Vec<i32> = self.from.iter().map(|row| *row as i32).collect();
        Tensor::from_data(TensorData::new(rows, [self.len()]), device)
    }
}

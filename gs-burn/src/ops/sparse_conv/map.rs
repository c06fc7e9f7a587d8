//! Kernel maps: which input row meets which output row at each offset of a kernel.

use std::sync::Arc;

use burn::tensor::{Device, Int, Tensor};
use gs_kernels::cpu::sparse_conv::{Neighbours, PairLists, SparseError, strided, submanifold};

use crate::device::is_gpu;

/// The pairs of one direction.
#[derive(Clone, Debug)]
pub struct PairSide {
    /// Pairs by block of output rows and offset.
    pub lists: Arc<PairLists>,
    /// Whether offset `k` takes the weights of offset `K - 1 - k`.
    pub flip: bool,
}

/// The pairs of both directions, on the host.
#[derive(Clone, Debug)]
pub struct PairMap {
    /// From the input to the output.
    pub forward: PairSide,
    /// From the output's gradient to the input's.
    pub backward: PairSide,
}

/// For each output voxel and each offset of a kernel, the input voxel there; built once on the host for a set of
/// voxels. A clone shares it.
///
/// Coordinates are `[batch, x, y, z]` in voxels. `batch` is 0 to 1023, and voxels of different batches never meet. x,
/// y and z are within [`COORDINATE_LIMIT`](super::COORDINATE_LIMIT). No two rows may have the same coordinates. Their
/// order is free, and the rows of the tensors follow it.
///
/// The offsets of an odd kernel are `-r..=r` on each axis with x fastest, those of an even one `0..n` with z fastest,
/// as in TorchSparse.
///
/// Memory: 6 bytes a pair on the host (a voxel on a surface has about 11 pairs of 27), twice that for a strided map.
/// On a GPU 4 bytes for each output voxel and offset in addition: 108 MB for a million voxels of a kernel of edge 3.
#[derive(Clone, Debug)]
pub struct KernelMap {
    pairs: Arc<PairMap>,
    forward: Tensor<1, Int>,
    backward: Tensor<1, Int>,
}

impl KernelMap {
    /// The map of voxels `[V]` to themselves, for a kernel of odd edge `kernel` (27 offsets for 3).
    ///
    /// The reverse map is this map with the offsets in reverse order, so nothing is stored for it.
    ///
    /// # Errors
    /// When a coordinate is out of range or occurs twice, or the kernel is even or above 15.
    pub fn submanifold(coordinates: &[[i32; 4]], kernel: usize, device: &Device) -> Result<Self, SparseError> {
        let neighbours = submanifold(coordinates, kernel)?;
        let lists = Arc::new(PairLists::of(&neighbours));
        let table = table(&neighbours, device);
        let pairs = PairMap {
            forward: PairSide { lists: lists.clone(), flip: false },
            backward: PairSide { lists, flip: true },
        };
        Ok(Self { pairs: Arc::new(pairs), forward: table.clone(), backward: table })
    }

    /// The coordinates of the coarser voxels `floor(c / stride)`, ascending, and the map to them: an output voxel `o`
    /// reads the input voxels at `o * stride` plus the kernel's offsets. With `kernel == stride` each input voxel has
    /// one output voxel and one offset.
    ///
    /// # Errors
    /// When a coordinate is out of range or occurs twice, or kernel or stride are 0 or above 15.
    pub fn strided(
        coordinates: &[[i32; 4]],
        kernel: usize,
        stride: usize,
        device: &Device,
    ) -> Result<(Vec<[i32; 4]>, Self), SparseError> {
        let (coarse, neighbours) = strided(coordinates, kernel, stride)?;
        let reversed = neighbours.reversed()?;
        let side = |neighbours| PairSide { lists: Arc::new(PairLists::of(neighbours)), flip: false };
        let pairs = PairMap { forward: side(&neighbours), backward: side(&reversed) };
        let (forward, backward) = (table(&neighbours, device), table(&reversed, device));
        Ok((coarse, Self { pairs: Arc::new(pairs), forward, backward }))
    }

    /// The map with input and output exchanged, for transposed convolution back to the voxels that a strided one came
    /// from. Nothing is copied.
    pub fn transposed(&self) -> Self {
        let PairMap { forward, backward } = &*self.pairs;
        let pairs = PairMap { forward: backward.clone(), backward: forward.clone() };
        Self { pairs: Arc::new(pairs), forward: self.backward.clone(), backward: self.forward.clone() }
    }

    /// Rows of the input.
    pub fn inputs(&self) -> usize {
        self.pairs.forward.lists.inputs
    }

    /// Rows of the output.
    pub fn outputs(&self) -> usize {
        self.pairs.forward.lists.outputs
    }

    /// Offsets of the kernel.
    pub fn offsets(&self) -> usize {
        self.pairs.forward.lists.offsets
    }

    /// Pairs of input and output row over all offsets. A convolution multiplies and adds `C_in C_out` numbers for each.
    pub fn pair_count(&self) -> usize {
        self.pairs.forward.lists.len()
    }

    /// The pairs `(input row, output row)` that take the weights of offset `k`, by ascending output row.
    pub fn pairs_of(&self, k: usize) -> Vec<(usize, usize)> {
        let PairSide { lists, flip } = &self.pairs.forward;
        lists.of_offset(if *flip { self.offsets() - 1 - k } else { k }).collect()
    }

    pub(super) fn pairs(&self) -> &Arc<PairMap> {
        &self.pairs
    }

    pub(super) fn forward_table(&self) -> Tensor<1, Int> {
        self.forward.clone()
    }

    pub(super) fn backward_table(&self) -> Tensor<1, Int> {
        self.backward.clone()
    }
}

/// The table as the kernels of a GPU read it; empty on a CPU, which reads pairs.
fn table(neighbours: &Neighbours, device: &Device) -> Tensor<1, Int> {
    let values = if is_gpu(device) { device_table(neighbours) } else { Vec::new() };
    crate::ops::index_tensor(values, device)
}

#[cfg(feature = "cube")]
fn device_table(neighbours: &Neighbours) -> Vec<i32> {
    gs_kernels::cube::sparse_conv::device_table(neighbours)
}

/// A build without CubeCL has no GPU.
#[cfg(not(feature = "cube"))]
fn device_table(_: &Neighbours) -> Vec<i32> {
    Vec::new()
}

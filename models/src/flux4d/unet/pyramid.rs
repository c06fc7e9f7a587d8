//! Points in voxels of several sizes, each twice the one before, and the kernel maps that all convolutions share.

use burn::tensor::Device;
use gs_burn::ops::segments::Segments;
use gs_burn::ops::sparse_conv::{KernelMap, SparseError, Voxels, voxels};

/// Edge of the kernels within a level, voxels.
const SAME: usize = 3;
/// Edge and stride of the kernels between levels, voxels.
const STEP: usize = 2;

/// The voxels of a cloud of points at each level, and the kernel maps within and between levels.
///
/// It is built once on the host for a cloud and used by every layer and every pass. It does not depend on the order
/// of the points.
#[derive(Clone, Debug)]
pub struct VoxelPyramid {
    points: Segments,
    same: Vec<KernelMap>,
    down: Vec<KernelMap>,
}

impl VoxelPyramid {
    /// The pyramid of `points` `[N]`, metres, with `levels` levels: voxels of edge `voxel` metres at level 0, twice
    /// that at level 1, and so on.
    ///
    /// A [`SparseUnet`](super::SparseUnet) needs [`SparseUnetConfig::levels`](super::SparseUnetConfig::levels) of them.
    ///
    /// # Errors
    /// When a point is not finite, further than 131,000 voxels from the origin, or `voxel` is not positive.
    ///
    /// # Panics
    /// When `levels` is 0.
    pub fn of(points: &[[f32; 3]], voxel: f32, levels: usize, device: &Device) -> Result<Self, SparseError> {
        assert!(levels > 0, "a pyramid has at least one level");
        let Voxels { mut coordinates, of_point, order } = voxels(points, voxel)?;
        let points = Segments::with_order(of_point, coordinates.len(), &order, device)?;
        let mut same = vec![KernelMap::submanifold(&coordinates, SAME, device)?];
        let mut down = Vec::new();
        for _ in 1..levels {
            let (coarser, map) = KernelMap::strided(&coordinates, STEP, STEP, device)?;
            coordinates = coarser;
            down.push(map);
            same.push(KernelMap::submanifold(&coordinates, SAME, device)?);
        }
        Ok(Self { points, same, down })
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.same.len()
    }

    /// Number of voxels at `level`.
    ///
    /// # Panics
    /// When there is no such level.
    pub fn voxels(&self, level: usize) -> usize {
        self.same[level].outputs()
    }

    /// The points of each voxel of level 0.
    pub fn points(&self) -> &Segments {
        &self.points
    }

    /// The map within `level`: 27 offsets.
    ///
    /// # Panics
    /// When there is no such level.
    pub fn same(&self, level: usize) -> &KernelMap {
        &self.same[level]
    }

    /// The map from `level` to the coarser one above: 8 offsets. Its [`transposed`](KernelMap::transposed) leads back.
    ///
    /// # Panics
    /// When there is no level above.
    pub fn down(&self, level: usize) -> &KernelMap {
        &self.down[level]
    }
}

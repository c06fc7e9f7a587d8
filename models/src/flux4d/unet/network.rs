//! Stem, encoder, decoder and head.
//!
//! ```text
//! stem      2 x (conv 3^3, N, f)                                              level 0
//! encoder   conv 2^3 stride 2, N, f, residual blocks                          levels 1, 2, ...
//! decoder   transposed conv 2^3, N, f, (up, skip) side by side, residual blocks   back to level 0
//! head      the voxel's row and the point's own features, one linear layer    points
//! ```

use burn::config::Config;
use burn::module::Module;
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use gs_burn::ops::segments::{segment_mean, take_rows};
use gs_burn::ops::sparse_conv::KernelMap;
use gs_burn::profile;

use super::block::{ResidualBlock, SAME};
use super::conv::{ConvNorm, SparseConvConfig};
use super::pyramid::VoxelPyramid;
use crate::random::SplitMix64;
use crate::{Mlp, MlpConfig};

/// Offsets of a kernel of edge 2.
const STEP: usize = 8;

/// Widths are multiples of this: half a vector of a processor, and what GPUs load at once.
const WIDTH_STEP: usize = 8;

/// Bytes that a training step holds at most for each voxel of the finest level, times the multiplier of the widths:
/// published measurements of such a network have 10.4 GB for 420,000 voxels. One pass was measured at 11 kB, and a
/// refinement has two alive.
pub const BYTES_PER_VOXEL: f64 = 25e3;

/// Configuration of a [`SparseUnet`].
#[derive(Config, Debug)]
pub struct SparseUnetConfig {
    /// Columns of a point's features.
    pub input: usize,
    /// Columns of the result for each point.
    pub output: usize,
    /// Multiplies every width of the levels; the result is rounded to a multiple of 8, at least 8. Work and
    /// parameters grow with its square.
    #[config(default = 1.0)]
    pub width: f64,
    /// Width of the stem, before the multiplier.
    #[config(default = 32)]
    pub stem: usize,
    /// Width of each level of the encoder, before the multiplier.
    #[config(default = "vec![32, 64, 128, 256]")]
    pub encoder: Vec<usize>,
    /// Width of each level of the decoder, from the coarsest, before the multiplier; as many as the encoder has.
    #[config(default = "vec![256, 128, 96, 96]")]
    pub decoder: Vec<usize>,
    /// Residual blocks of a level.
    #[config(default = 2)]
    pub blocks: usize,
    /// Slope of the leaky ReLU for negative numbers.
    #[config(default = 0.01)]
    pub slope: f64,
    /// Whether the head starts at zero. The first answer is then zero for every point; its gradient is not.
    #[config(default = true)]
    pub zero_last: bool,
    /// The weights are drawn from this alone: the same on every device and machine.
    #[config(default = 0)]
    pub seed: u64,
}

impl SparseUnetConfig {
    /// Levels of the [`VoxelPyramid`] that the network needs.
    pub fn levels(&self) -> usize {
        self.encoder.len() + 1
    }

    /// The network before training: weights of convolutions as in [`SparseConvConfig::init`], those of the head as in
    /// [`MlpConfig::init`].
    ///
    /// # Panics
    /// When a width or the number of blocks is 0, the multiplier is not positive, or encoder and decoder differ in
    /// length.
    pub fn init(&self, device: &Device) -> SparseUnet {
        let Self { input, output, encoder, decoder, blocks, slope, .. } = self;
        assert!(
            self.width.is_finite() && self.width > 0.0,
            "the width multiplier must be positive, it is {}",
            self.width
        );
        let sides = [encoder.len(), decoder.len()];
        assert!(sides[0] == sides[1], "encoder and decoder must have as many levels, they have {sides:?}");
        assert!(*blocks > 0, "a level has at least one residual block");
        let mut build = Builder { blocks: *blocks, slope: *slope, seeds: SplitMix64::new(self.seed), device };
        let stem_width = self.scaled(self.stem);
        let stem = vec![build.conv([*input, stem_width], SAME, false), build.conv([stem_width; 2], SAME, false)];
        let mut skips = vec![stem_width];
        let mut down = Vec::new();
        for width in encoder.iter().map(|width| self.scaled(*width)) {
            let below = skips[skips.len() - 1];
            down.push(Encoder { down: build.conv([below; 2], STEP, false), blocks: build.blocks(below, width) });
            skips.push(width);
        }
        let mut below = skips.pop().unwrap_or(stem_width);
        let mut up = Vec::new();
        for width in decoder.iter().map(|width| self.scaled(*width)) {
            let skip = skips.pop().expect("as many levels up as down");
            let conv = build.conv([below, width], STEP, true);
            up.push(Decoder { up: conv, blocks: build.blocks(width + skip, width) });
            below = width;
        }
        let head = MlpConfig::new(vec![below + input, *output]).with_zero_last(self.zero_last);
        let head = head.with_seed(build.seeds.bits()).init(device);
        SparseUnet { stem, encoder: down, decoder: up, head, slope: *slope }
    }

    fn scaled(&self, width: usize) -> usize {
        assert!(width > 0, "no level may have the width 0");
        let steps = (width as f64 * self.width / WIDTH_STEP as f64).round() as usize;
        steps.max(1) * WIDTH_STEP
    }
}

/// The parts from which every layer is made.
struct Builder<'a> {
    blocks: usize,
    slope: f64,
    seeds: SplitMix64,
    device: &'a Device,
}

impl Builder<'_> {
    fn conv(&mut self, [input, output]: [usize; 2], offsets: usize, transposed: bool) -> ConvNorm {
        let config = SparseConvConfig::new(input, output, offsets).with_transposed(transposed);
        ConvNorm::new(&config.with_seed(self.seeds.bits()), self.device)
    }

    fn blocks(&mut self, input: usize, output: usize) -> Vec<ResidualBlock> {
        let inputs = std::iter::once(input).chain(std::iter::repeat(output)).take(self.blocks);
        inputs.map(|input| ResidualBlock::new([input, output], self.slope, &mut self.seeds, self.device)).collect()
    }
}

/// One level of the encoder.
#[derive(Module, Debug)]
pub struct Encoder {
    /// From the finer level, at its width.
    pub down: ConvNorm,
    /// The first leads to the level's width.
    pub blocks: Vec<ResidualBlock>,
}

/// One level of the decoder.
#[derive(Module, Debug)]
pub struct Decoder {
    /// From the coarser level.
    pub up: ConvNorm,
    /// The first takes the skip of the encoder beside the result of `up`.
    pub blocks: Vec<ResidualBlock>,
}

/// A UNet on the voxels of points, and a linear layer for each point.
///
/// One training step on a million points in 350,000 voxels takes 3.8 GB on a CPU at width 1, and 1.2 GB at a quarter
/// of it.
///
/// All points of a voxel get the same row from the voxels, so the head takes the point's own features beside it.
#[derive(Module, Debug)]
pub struct SparseUnet {
    /// Two convolutions at level 0.
    pub stem: Vec<ConvNorm>,
    /// From level 1 on.
    pub encoder: Vec<Encoder>,
    /// From the coarsest level but one back to level 0.
    pub decoder: Vec<Decoder>,
    /// One linear layer.
    pub head: Mlp,
    /// Slope of the leaky ReLU for negative numbers.
    #[module(skip)]
    pub slope: f64,
}

impl SparseUnet {
    /// `[N, input]` features of points to `[N, output]`. Differentiable with respect to the features and all weights.
    ///
    /// A voxel takes the mean of its points. Without points there is nothing to differentiate: the result is `[0,
    /// output]`, outside the graph. Batch norm takes the statistics of the voxels of this call.
    ///
    /// # Panics
    /// When the features are not those of the pyramid's points, or the pyramid has not one level more than the encoder.
    pub fn forward(&self, features: Tensor<2>, pyramid: &VoxelPyramid) -> Tensor<2> {
        let _stage = profile::stage("sparse UNet");
        if features.dims()[0] == 0 {
            // Burn's operations on no rows fail in the backward pass.
            return Tensor::zeros([0, self.head.outputs()], (&features.device(), features.dtype()));
        }
        let rows = self.voxels(segment_mean(features.clone(), pyramid.points()), pyramid);
        let rows = take_rows(rows, pyramid.points());
        self.head.forward(Tensor::cat(vec![rows, features], 1))
    }

    /// The UNet without the head: `[V, input]` rows of the voxels of level 0 to `[V, width of the last decoder level]`.
    ///
    /// # Panics
    /// As [`forward`](Self::forward).
    pub fn voxels(&self, input: Tensor<2>, pyramid: &VoxelPyramid) -> Tensor<2> {
        let levels = self.encoder.len() + 1;
        assert!(pyramid.levels() == levels, "the network needs {levels} levels, the pyramid has {}", pyramid.levels());
        let mut rows = self.stem.iter().fold(input, |rows, conv| self.active(conv, rows, pyramid.same(0)));
        let mut skips = Vec::new();
        for (level, encoder) in self.encoder.iter().enumerate() {
            let coarser = self.active(&encoder.down, rows.clone(), pyramid.down(level));
            skips.push(std::mem::replace(&mut rows, through(&encoder.blocks, coarser, pyramid.same(level + 1))));
        }
        for (decoder, (level, skip)) in self.decoder.iter().zip(skips.into_iter().enumerate().rev()) {
            let finer = self.active(&decoder.up, rows, &pyramid.down(level).transposed());
            rows = through(&decoder.blocks, Tensor::cat(vec![finer, skip], 1), pyramid.same(level));
        }
        rows
    }

    fn active(&self, conv: &ConvNorm, rows: Tensor<2>, map: &KernelMap) -> Tensor<2> {
        leaky_relu(conv.forward(rows, map), self.slope)
    }
}

fn through(blocks: &[ResidualBlock], rows: Tensor<2>, map: &KernelMap) -> Tensor<2> {
    blocks.iter().fold(rows, |rows, block| block.forward(rows, map))
}

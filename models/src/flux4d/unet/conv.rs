//! A sparse convolution with learned weights, and one followed by batch norm.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::nn::{BatchNorm, BatchNormConfig};
use burn::tensor::module::batch_norm_train;
use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::ops::sparse_conv::{KernelMap, sparse_conv};

use crate::random::SplitMix64;

/// Configuration of a [`SparseConv`].
#[derive(Config, Debug)]
pub struct SparseConvConfig {
    /// Columns of the input.
    pub input: usize,
    /// Columns of the output.
    pub output: usize,
    /// Offsets of the kernel: 27 for edge 3, 8 for edge 2, 1 for a product row by row.
    pub offsets: usize,
    /// Whether the convolution leads back to finer voxels. It changes the bound of the first weights and nothing else.
    #[config(default = false)]
    pub transposed: bool,
    /// The weights are drawn from this alone: the same on every device and machine.
    #[config(default = 0)]
    pub seed: u64,
}

impl SparseConvConfig {
    /// The convolution before training: weights uniform in `+-1 / sqrt(C_in K)`, or `+-1 / sqrt(C_out K)` if
    /// transposed.
    ///
    /// # Panics
    /// When a size is 0.
    pub fn init(&self, device: &Device) -> SparseConv {
        let Self { input, output, offsets, transposed, seed } = *self;
        assert!(input * output * offsets > 0, "no size of a convolution may be 0, found {self:?}");
        let fan = if transposed { output } else { input };
        let bound = 1.0 / ((fan * offsets) as f64).sqrt();
        let mut random = SplitMix64::new(seed);
        let draw = |_| (bound * (2.0 * random.unit() - 1.0)) as f32;
        let values: Vec<f32> = (0..offsets * input * output).map(draw).collect();
        let weight = Tensor::from_data(TensorData::new(values, [offsets, input, output]), (device, DType::F32));
        SparseConv { weight: Param::from_tensor(weight) }
    }
}

/// [`sparse_conv`] with learned weights and no bias.
#[derive(Module, Debug)]
pub struct SparseConv {
    /// `[K, C_in, C_out]`
    pub weight: Param<Tensor<3>>,
}

impl SparseConv {
    /// `[V_in, C_in]` to `[V_out, C_out]` along `map`.
    ///
    /// # Panics
    /// When the map's rows or offsets are not those of the input and the weights.
    pub fn forward(&self, input: Tensor<2>, map: &KernelMap) -> Tensor<2> {
        sparse_conv(input, self.weight.val(), map)
    }
}

/// A sparse convolution and batch norm over its rows.
#[derive(Module, Debug)]
pub struct ConvNorm {
    /// The convolution.
    pub conv: SparseConv,
    /// Batch norm of each column over all rows, by their own statistics; running ones stay as they begin.
    pub norm: BatchNorm,
}

impl ConvNorm {
    /// Before training.
    pub(super) fn new(config: &SparseConvConfig, device: &Device) -> Self {
        let norm = BatchNormConfig::new(config.output).init(device);
        Self { conv: config.init(device), norm }
    }

    /// `[V_in, C_in]` to `[V_out, C_out]` along `map`, each column normalised.
    ///
    /// # Panics
    /// As [`SparseConv::forward`].
    pub fn forward(&self, input: Tensor<2>, map: &KernelMap) -> Tensor<2> {
        normalised(&self.norm, self.conv.forward(input, map))
    }
}

/// Batch norm of each column by the rows' own statistics, with gradients and without; no rows have no mean, and stay as
/// they are.
pub(super) fn normalised(norm: &BatchNorm, rows: Tensor<2>) -> Tensor<2> {
    match rows.dims()[0] {
        0 => rows,
        _ => batch_norm_train(rows, norm.gamma.val(), norm.beta.val(), norm.epsilon).output,
    }
}

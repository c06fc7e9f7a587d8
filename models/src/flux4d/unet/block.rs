//! The residual block: `f(N(C(f(N(C(x))))) + s(x))` with convolutions `C`, batch norms `N` and leaky ReLU `f`.

use burn::module::{Module, Param};
use burn::nn::{BatchNorm, BatchNormConfig};
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use gs_burn::ops::sparse_conv::KernelMap;

use super::conv::{ConvNorm, SparseConvConfig, normalised};
use crate::random::SplitMix64;

/// Offsets of a kernel of edge 3.
pub(super) const SAME: usize = 27;

/// Two convolutions within a level and the input added to their result.
#[derive(Module, Debug)]
pub struct ResidualBlock {
    /// The first convolution, from the input's width to the output's.
    pub first: ConvNorm,
    /// The second, within the output's width.
    pub second: ConvNorm,
    /// A product row by row for the input, where its width differs from the output's.
    pub shortcut: Option<Shortcut>,
    /// Slope of the leaky ReLU for negative numbers.
    #[module(skip)]
    pub slope: f64,
}

impl ResidualBlock {
    /// Before training, from `input` to `output` columns.
    pub(super) fn new([input, output]: [usize; 2], slope: f64, seeds: &mut SplitMix64, device: &Device) -> Self {
        let mut conv = |input, offsets| SparseConvConfig::new(input, output, offsets).with_seed(seeds.bits());
        let first = ConvNorm::new(&conv(input, SAME), device);
        let second = ConvNorm::new(&conv(output, SAME), device);
        let shortcut = (input != output).then(|| Shortcut::new(&conv(input, 1), device));
        Self { first, second, shortcut, slope }
    }

    /// `[V, C_in]` to `[V, C_out]`; `map` is that of the level.
    ///
    /// # Panics
    /// When the shapes disagree.
    pub fn forward(&self, input: Tensor<2>, map: &KernelMap) -> Tensor<2> {
        let inner = leaky_relu(self.first.forward(input.clone(), map), self.slope);
        let inner = self.second.forward(inner, map);
        let shortcut = match &self.shortcut {
            Some(shortcut) => shortcut.forward(input),
            None => input,
        };
        leaky_relu(inner + shortcut, self.slope)
    }
}

/// A matrix product of each row, and batch norm.
#[derive(Module, Debug)]
pub struct Shortcut {
    /// `[C_in, C_out]`
    pub weight: Param<Tensor<2>>,
    /// Batch norm of each column over all rows.
    pub norm: BatchNorm,
}

impl Shortcut {
    fn new(config: &SparseConvConfig, device: &Device) -> Self {
        let weight = config.init(device).weight.val().squeeze_dim::<2>(0);
        let norm = BatchNormConfig::new(config.output).init(device);
        Self { weight: Param::from_tensor(weight), norm }
    }

    fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        normalised(&self.norm, input.matmul(self.weight.val()))
    }
}

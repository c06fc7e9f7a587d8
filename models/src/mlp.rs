//! A small multilayer perceptron on rows, for the networks of the papers.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::nn::Linear;
use burn::tensor::activation::relu;
use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::ops::products::affine;
use gs_burn::ops::silu::silu;
use gs_burn::profile;

use crate::random::SplitMix64;

/// The function between two layers.
#[derive(Config, Debug, Copy, PartialEq, Eq)]
pub enum Activation {
    /// `max(x, 0)`: cheap, for networks that run on every moving pixel.
    Relu,
    /// `x / (1 + exp(-x))`: smooth, at the price of an exponential per unit.
    Silu,
}

/// Configuration of an [`Mlp`].
#[derive(Config, Debug)]
pub struct MlpConfig {
    /// Numbers a row has before the first layer, after the first, ... after the last; at least two sizes, none 0.
    pub sizes: Vec<usize>,
    /// The function between two layers.
    #[config(default = "Activation::Relu")]
    pub activation: Activation,
    /// Whether the last layer starts at zero. The network's first answer is then zero for every input; its gradient is
    /// not.
    #[config(default = false)]
    pub zero_last: bool,
    /// The weights are drawn from this alone: the same on every device and machine.
    #[config(default = 0)]
    pub seed: u64,
}

impl MlpConfig {
    /// The network before training: weights uniform with variance `2 / in` (He et al. 2015), biases zero.
    ///
    /// # Panics
    /// With fewer than two sizes, or a size of 0.
    pub fn init(&self, device: &Device) -> Mlp {
        let Self { sizes, activation, zero_last, seed } = self;
        assert!(sizes.len() >= 2, "a network has an input and an output, sizes are {sizes:?}");
        assert!(sizes.iter().all(|size| *size > 0), "no layer may be empty, sizes are {sizes:?}");
        let mut random = SplitMix64::new(*seed);
        let layers = sizes.len() - 1;
        let layer = |layer: usize| {
            let (rows, columns) = (sizes[layer], sizes[layer + 1]);
            let is_zero = *zero_last && layer == layers - 1;
            // A uniform number in -a..a has variance a^2 / 3.
            let bound = if is_zero { 0.0 } else { (6.0 / rows as f64).sqrt() };
            let values: Vec<f32> = (0..rows * columns).map(|_| (bound * (2.0 * random.unit() - 1.0)) as f32).collect();
            let weight = Tensor::from_data(TensorData::new(values, [rows, columns]), (device, DType::F32));
            let bias = Tensor::zeros([columns], (device, DType::F32));
            Linear { weight: Param::from_tensor(weight), bias: Some(Param::from_tensor(bias)) }
        };
        Mlp { layers: (0..layers).map(layer).collect(), activation: *activation }
    }
}

/// `x -> W_L f(... f(W_1 x + b_1) ...) + b_L` on each row, `f` the [`Activation`].
///
/// On CUDA its products may be computed in TF32, ten bits after the point: a network does not need more.
#[derive(Module, Debug)]
pub struct Mlp {
    /// The layers in order; every one has a bias.
    pub layers: Vec<Linear>,
    /// The function between two of them.
    #[module(skip)]
    pub activation: Activation,
}

impl Mlp {
    /// `[R, in]` to `[R, out]`, each row by itself; differentiable by input and weights.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        let _stage = profile::stage("networks");
        self.after_first(affine(input, self.layers[0].weight.val(), bias(&self.layers[0])))
    }

    /// [`forward`](Self::forward) on rows that all end in the same columns: `input` is `[R, a]`, `shared` `[1, c]`, and
    /// the network takes `a + c`. The shared columns enter once, as part of the first bias, instead of once a row.
    pub fn forward_shared(&self, input: Tensor<2>, shared: Tensor<2>) -> Tensor<2> {
        let _stage = profile::stage("networks");
        let own = input.dims()[1];
        let total = self.inputs();
        let weight = self.layers[0].weight.val();
        let shared = affine(shared, weight.clone().narrow(0, own, total - own), bias(&self.layers[0]));
        self.after_first(affine(input, weight.narrow(0, 0, own), shared.squeeze_dim(0)))
    }

    fn after_first(&self, first: Tensor<2>) -> Tensor<2> {
        let activation = |x| match self.activation {
            Activation::Relu => relu(x),
            Activation::Silu => silu(x),
        };
        self.layers.iter().skip(1).fold(first, |x, layer| affine(activation(x), layer.weight.val(), bias(layer)))
    }

    /// Numbers a row takes.
    pub fn inputs(&self) -> usize {
        self.layers[0].weight.dims()[0]
    }

    /// Numbers a row gives.
    pub fn outputs(&self) -> usize {
        self.layers[self.layers.len() - 1].weight.dims()[1]
    }
}

/// `[out]`.
fn bias(layer: &Linear) -> Tensor<1> {
    layer.bias.as_ref().expect("MlpConfig gives every layer a bias").val()
}

//! How much each moment of the exposure counts at a pixel: the weight network of Eq. 11.
//!
//! `w(u) = softmax(F_w(D_in(u), v_cam(u)))`, N weights that sum to 1. The last layer starts at zero, so the first
//! weights are all equal, as for a shutter that opens and closes at once.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor, activation::softmax};

use crate::mlp::{Mlp, MlpConfig};

/// Units of each of the two hidden layers; the paper says only "lightweight".
const HIDDEN: usize = 32;

/// Configuration of the blur weight network.
#[derive(Config, Debug)]
pub struct BlurWeightsConfig {
    /// `N`, the number of moments.
    pub samples: usize,
    /// The unit of depth, scene units, positive: about the scene's distance from the cameras.
    pub depth_unit: f64,
    /// The unit of velocity, scene units per unit of time, positive: about the fastest motion.
    pub velocity_unit: f64,
    /// Seed of the weights.
    #[config(default = 0)]
    pub seed: u64,
}

impl BlurWeightsConfig {
    /// A network that gives equal weights, to be trained.
    pub fn init(&self, device: &Device) -> BlurWeights {
        let sizes = vec![1 + 3, HIDDEN, HIDDEN, self.samples];
        let mlp = MlpConfig::new(sizes).with_seed(self.seed).with_zero_last(true).init(device);
        BlurWeights { mlp, depth_unit: self.depth_unit, velocity_unit: self.velocity_unit }
    }
}

/// The blur weight network `F_w`.
#[derive(Module, Debug)]
pub struct BlurWeights {
    /// `[P, 1 + 3]` to `[P, N]`.
    pub mlp: Mlp,
    /// See [`BlurWeightsConfig`].
    pub depth_unit: f64,
    /// See [`BlurWeightsConfig`].
    pub velocity_unit: f64,
}

impl BlurWeights {
    /// `N`, the number of moments.
    pub fn samples(&self) -> usize {
        self.mlp.outputs()
    }

    /// Weights `[P, N]`, positive, each row summing to 1, from the depth `[P, 1]` (camera z, scene units) and the
    /// velocity `[P, 3]` (camera axes, scene units per unit of time).
    pub fn forward(&self, depth: Tensor<2>, velocity: Tensor<2>) -> Tensor<2> {
        let input = Tensor::cat(vec![depth / self.depth_unit, velocity / self.velocity_unit], 1);
        softmax(self.mlp.forward(input), 1)
    }
}

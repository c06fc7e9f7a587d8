//! How much each moment of the exposure counts at a pixel: the weight network of Eq. 11.
//!
//! `w(u) = softmax(F_w(D_in(u), v_cam(u)))`, N weights that sum to 1. The last layer starts at zero, so the first weights
//! are those of a shutter that opens and closes at once: all equal.

use burn::tensor::{Device, Tensor, activation::softmax};

use crate::network::Mlp;

/// Units of each of the two hidden layers; the paper says only "lightweight".
const HIDDEN: usize = 32;

/// The blur weight network `F_w`.
#[derive(Debug, Clone)]
pub struct BlurWeights {
    /// `[P, 1 + 3]` to `[P, N]`.
    pub mlp: Mlp,
    /// The unit of depth, scene units: about the scene's distance from the cameras.
    pub depth_unit: f64,
    /// The unit of velocity, scene units per unit of time: about the fastest motion.
    pub velocity_unit: f64,
}

impl BlurWeights {
    /// Equal weights for `samples` moments, to be learned; the units are positive, see the fields.
    pub fn new(samples: usize, depth_unit: f64, velocity_unit: f64, seed: u64, device: &Device) -> Self {
        Self { mlp: Mlp::new(&[4, HIDDEN, HIDDEN, samples], seed, true, device), depth_unit, velocity_unit }
    }

    /// `N`, the number of moments.
    pub fn samples(&self) -> usize {
        self.mlp.outputs()
    }

    /// Weights `[P, N]`, positive, each row summing to 1, from the depth `[P, 1]` (camera z, scene units) and the velocity
    /// `[P, 3]` (camera axes, scene units per unit of time).
    pub fn forward(&self, depth: Tensor<2>, velocity: Tensor<2>) -> Tensor<2> {
        let input = Tensor::cat(vec![depth / self.depth_unit, velocity / self.velocity_unit], 1);
        softmax(self.mlp.forward(input), 1)
    }

    /// With `f` of every learned tensor.
    pub fn map(&self, f: impl FnMut(Tensor<2>) -> Tensor<2>) -> Self {
        Self { mlp: self.mlp.map(f), ..self.clone() }
    }
}

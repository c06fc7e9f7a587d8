//! The networks `f` and `r`: a sparse UNet for the scene's rows and a small network for far ones.
//!
//! Sky and random points stay out of the convolutions: each would be alone in its voxel at all levels, twenty times the
//! scene's work, and nine tenths of the rows of every batch norm. Their residual is a function of their own features
//! and their gradient. `unet.far = "voxels"` makes them voxels like others. They have no velocity either way.
//!
//! Inputs and outputs have units: positions are divided by 25 m, residuals and velocities multiplied by a unit a
//! channel. The paper names none. Without them the head's first steps move Gaussians by metres.
//!
//! Batch norm takes the statistics of the snippet at hand, in training and later: a snippet has thousands of voxels,
//! and running statistics of other logs would not be its own. Without autodiff a network keeps no graph.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use gs_models::flux4d::channels::CHANNELS;
use gs_models::flux4d::unet::{SparseUnet, SparseUnetConfig, VoxelPyramid};
use gs_models::flux4d::{Network, Refinement};
use gs_models::mlp::{Mlp, MlpConfig};

use super::config::{FarChoice, FluxConfig};
use super::sample::Sample;
use gs_train::fit::parameters::from_host;

/// Factors of the 14 channels as the network reads them: positions over 25 m, scales, opacities and colours about 1.
const INPUT: [f32; CHANNELS] = [0.04, 0.04, 0.04, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5];
/// Features beyond this are cut: a point beyond 100 m is far and nothing else, and a gradient of four times the usual
/// is large.
const INPUT_MAX: f64 = 4.0;
/// Residuals of the 14 channels for an output of 1: 0.1 m of position, a tenth of a turn, one step of the other raw
/// channels.
const OUTPUT: [f32; CHANNELS] = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
/// Velocity for an output of 1, metres per window: a person walks at 1.5 m/s, a car drives at 10.
const VELOCITY: f32 = 5.0;
/// Hidden width of the network of far rows.
const FAR_WIDTH: usize = 16;

/// One of the two networks.
#[derive(Module, Debug)]
pub struct Pass {
    /// For rows of the scene.
    pub unet: SparseUnet,
    /// For far rows.
    pub far: Mlp,
}

/// The base network and the refinement network.
#[derive(Module, Debug)]
pub struct FluxNetwork {
    /// `f`: 15 features to 14 residuals and the velocity.
    pub first: Pass,
    /// `r`: 29 features to 14 residuals; none without refinement.
    pub next: Option<Pass>,
}

impl FluxNetwork {
    /// The networks before training, which change nothing.
    pub fn new(config: &FluxConfig, device: &Device) -> Self {
        let velocities = 3 * (config.own.unet.degree + 1);
        let pass = |input: usize, output: usize, seed: u64| {
            let unet = SparseUnetConfig::new(input, output).with_width(config.own.unet.width).with_seed(seed);
            let far = MlpConfig::new(vec![input, FAR_WIDTH, CHANNELS]).with_zero_last(true).with_seed(seed ^ 1);
            Pass { unet: unet.init(device), far: far.init(device) }
        };
        let (f, r) = (config.seed.wrapping_mul(4), config.seed.wrapping_mul(4).wrapping_add(2));
        Self {
            first: pass(CHANNELS + 1, CHANNELS + velocities, f),
            next: (config.own.refinement.passes > 1).then(|| pass(2 * CHANNELS + 1, CHANNELS, r)),
        }
    }

    /// The networks bound to a snippet, for `run`.
    pub fn bound<T>(
        &self,
        sample: &Sample,
        config: &FluxConfig,
        run: impl FnOnce(Refinement<Bound<'_>, Bound<'_>>) -> T,
    ) -> T {
        let velocities = sample.frame.motion.columns();
        let far = sample.lifted.far;
        let is_apart = config.own.unet.far == FarChoice::Apart;
        let is_tracked = self.first.unet.stem[0].conv.weight.val().device().is_autodiff();
        let bind = |pass, velocities| Bound { pass, pyramid: &sample.pyramid, far, is_apart, is_tracked, velocities };
        let first = bind(&self.first, velocities);
        // With one pass `r` is never called.
        let next = bind(self.next.as_ref().unwrap_or(&self.first), 0);
        run(Refinement { first: &first, next: &next, config: config.refinement() })
    }
}

/// A network with the voxels of a snippet.
#[derive(Debug, Clone, Copy)]
pub struct Bound<'a> {
    pass: &'a Pass,
    pyramid: &'a VoxelPyramid,
    /// Far rows, which rest.
    far: usize,
    /// Whether far rows have a network of their own.
    is_apart: bool,
    /// Whether its weights take gradients.
    is_tracked: bool,
    /// Columns of the velocity; 0 for `r`.
    velocities: usize,
}

impl Network for Bound<'_> {
    fn forward(&self, features: Tensor<2>, times: Tensor<2>) -> (Tensor<2>, Option<Tensor<2>>) {
        let device = features.device();
        let [rows, columns] = features.dims();
        let apart = if self.is_apart { self.far } else { 0 };
        let near = rows - apart;
        let factors: Vec<f32> = INPUT.into_iter().chain(std::iter::repeat_n(1.0, columns - CHANNELS)).collect();
        let features = (features * from_host(factors, columns, &device)).clamp(-INPUT_MAX, INPUT_MAX);
        let mut features = Tensor::cat(vec![features, times - 0.5], 1);
        if self.is_tracked {
            features = features.autodiff();
        }
        let mut output = self.pass.unet.forward(features.clone().narrow(0, 0, near), self.pyramid);
        if apart > 0 {
            let far = self.pass.far.forward(features.narrow(0, near, apart));
            let far = match self.velocities {
                0 => far,
                columns => Tensor::cat(vec![far, Tensor::zeros([apart, columns], &output.device())], 1),
            };
            output = Tensor::cat(vec![output, far], 0);
        }
        let residual = output.clone().narrow(1, 0, CHANNELS) * from_host(OUTPUT.to_vec(), OUTPUT.len(), &device);
        let velocity = (self.velocities > 0).then(|| output.narrow(1, CHANNELS, self.velocities));
        // Rows with a network of their own have zeros already.
        let velocity = velocity.map(|predicted| resting(predicted * VELOCITY, self.far - apart));
        (residual, velocity)
    }
}

/// `velocity` with the last `far` rows zero.
fn resting(velocity: Tensor<2>, far: usize) -> Tensor<2> {
    let [rows, columns] = velocity.dims();
    if far == 0 {
        return velocity;
    }
    let rest = Tensor::zeros([far, columns], &velocity.device());
    match rows - far {
        0 => rest,
        near => Tensor::cat(vec![velocity.narrow(0, 0, near), rest], 0),
    }
}

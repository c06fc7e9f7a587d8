//! Networks on the velocity map: the paper's remainder (Eq. 5), which corrects it, and the ablation that predicts it.
//!
//! The map itself (Eq. 4), `V_render(u) = sum_i T_i alpha_i v_i`, is three more channels of the rasterizer's one pass,
//! fed with [`Paths::velocities`](super::Paths::velocities).
//!
//! `V_final = V_render + F_p(V_render, gamma(t))`. The network sees and gives velocities in a unit of about the fastest
//! motion, so that its numbers are of order 1 whatever the scene's. Its last layer starts at zero: at first, and
//! wherever it learns nothing, `V_final` is `V_render` exactly.

use std::f64::consts::PI;

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use crate::mlp::{Mlp, MlpConfig};

/// Octaves of `gamma`: the finest has 8 half-waves in half the window. More separate neighbouring frames better, and
/// let the network learn each frame by heart.
pub const OCTAVES: usize = 4;
/// Units of each of the two hidden layers; the paper says only "lightweight".
const HIDDEN: usize = 32;

/// `gamma(s)` = `sin(2^l pi s), cos(2^l pi s)`, `l = 0..4`, of time in window units, as one row `[1, 8]`.
pub fn time_embedding(s: f64, like: &Tensor<2>) -> Tensor<2> {
    let waves = (0..OCTAVES).flat_map(|octave| {
        let (sin, cos) = (f64::from(1_u32 << octave) * PI * s).sin_cos();
        [sin, cos]
    });
    let values: Vec<f64> = waves.collect();
    Tensor::from_data(TensorData::new(values, [1, 2 * OCTAVES]), (&like.device(), like.dtype()))
}

/// `[P, 3 + 8]` to `[P, 3]`, zero at first.
fn network(seed: u64, device: &Device) -> Mlp {
    let sizes = vec![3 + 2 * OCTAVES, HIDDEN, HIDDEN, 3];
    MlpConfig::new(sizes).with_seed(seed).with_zero_last(true).init(device)
}

/// Configuration of the Peano remainder network on the velocity map.
#[derive(Config, Debug)]
pub struct PeanoMapConfig {
    /// The unit of velocity, scene units per unit of time, positive: about the fastest motion.
    pub unit: f64,
    /// Seed of the weights.
    #[config(default = 0)]
    pub seed: u64,
}

impl PeanoMapConfig {
    /// A network that adds nothing yet.
    pub fn init(&self, device: &Device) -> PeanoMap {
        PeanoMap { mlp: network(self.seed, device), unit: self.unit }
    }
}

/// The Peano remainder network `F_p` on the velocity map, Eq. 5.
#[derive(Module, Debug)]
pub struct PeanoMap {
    /// `[P, 3 + 8]` to `[P, 3]`.
    pub mlp: Mlp,
    /// See [`PeanoMapConfig`].
    pub unit: f64,
}

impl PeanoMap {
    /// `V_final` of `V_render`, both `[P, 3]`, scene units per unit of time, world axes; `s` in window units.
    pub fn forward(&self, rendered: Tensor<2>, s: f64) -> Tensor<2> {
        let embedding = time_embedding(s, &rendered);
        rendered.clone() + self.mlp.forward_shared(rendered / self.unit, embedding) * self.unit
    }
}

/// Configuration of the network that predicts velocities.
#[derive(Config, Debug)]
pub struct DirectVelocityConfig {
    /// Centre of the scene, subtracted from positions, scene units.
    pub centre: [f64; 3],
    /// Positions are divided by this, scene units, positive: about the scene's size.
    pub scale: f64,
    /// The unit of velocity, scene units per unit of time, positive.
    pub unit: f64,
    /// Seed of the weights.
    #[config(default = 0)]
    pub seed: u64,
}

impl DirectVelocityConfig {
    /// A network that says nothing moves, to be trained.
    pub fn init(&self, device: &Device) -> DirectVelocity {
        let Self { centre, scale, unit, seed } = *self;
        DirectVelocity { mlp: network(seed, device), centre, scale, unit }
    }
}

/// Velocity from position and time by a network alone: the ablation "w/o Taylor expansion" of Table 2.
#[derive(Module, Debug)]
pub struct DirectVelocity {
    /// `[P, 3 + 8]` to `[P, 3]`.
    pub mlp: Mlp,
    /// See [`DirectVelocityConfig`].
    #[module(skip)]
    pub centre: [f64; 3],
    /// See [`DirectVelocityConfig`].
    pub scale: f64,
    /// See [`DirectVelocityConfig`].
    pub unit: f64,
}

impl DirectVelocity {
    /// Velocity `[P, 3]` (scene units per unit of time, world axes) of the surface at `positions` `[P, 3]` (world); `s`
    /// in window units.
    pub fn forward(&self, positions: Tensor<2>, s: f64) -> Tensor<2> {
        let embedding = time_embedding(s, &positions);
        let centre = row(self.centre, &positions);
        self.mlp.forward_shared((positions - centre) / self.scale, embedding) * self.unit
    }
}

/// `[1, 3]`, where and in the float type that `like` is.
pub(super) fn row(values: [f64; 3], like: &Tensor<2>) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values.to_vec(), [1, 3]), (&like.device(), like.dtype()))
}

//! The dynamics field `f(x, t) -> (v, a, omega, beta)` (Eq. 3): frequency encodings, a perceptron with SiLU, a last
//! layer of zeros.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::profile;

use super::dynamics::Dynamics;
use crate::{Activation, Mlp, MlpConfig};

/// Numbers per Gaussian that the network gives: four vectors.
const OUTPUTS: usize = 12;

/// Configuration of a [`DynamicsField`].
#[derive(Config, Debug)]
pub struct DynamicsFieldConfig {
    /// The reference point of velocities, world, scene units: the middle of the objects. About a far point, rotation
    /// and velocity could hardly be told apart.
    pub centre: [f64; 3],
    /// The size of the objects, scene units: the unit of positions and velocities in the network.
    pub length: f64,
    /// Sines and cosines of each input, at `2^0 .. 2^(bands - 1)`.
    #[config(default = 3)]
    pub bands: usize,
    /// Units of a hidden layer.
    #[config(default = 128)]
    pub width: usize,
    /// Hidden layers.
    #[config(default = 7)]
    pub layers: usize,
    /// TRACE's accelerations: `r |r| / 10` of raw numbers `r`, instead of these. No gradient would move them from zero,
    /// so that the last layer does not begin there.
    #[config(default = false)]
    pub squared: bool,
    /// Seed of the initial weights.
    #[config(default = 0)]
    pub seed: u64,
}

/// Divisor of TRACE's accelerations.
const SQUARED_BY: f64 = 10.0;

impl DynamicsFieldConfig {
    /// The field before training: nothing moves, unless accelerations are `squared`.
    pub fn init(&self, device: &Device) -> DynamicsField {
        let inputs = 4 * (1 + 2 * self.bands);
        let hidden = std::iter::repeat_n(self.width, self.layers);
        let sizes = std::iter::once(inputs).chain(hidden).chain([OUTPUTS]).collect();
        let mlp =
            MlpConfig::new(sizes).with_activation(Activation::Silu).with_zero_last(!self.squared).with_seed(self.seed);
        let Self { bands, centre, length, squared, .. } = *self;
        DynamicsField { mlp: mlp.init(device), bands, centre, length, squared }
    }
}

/// A network that gives the physical quantities of Gaussians by position and time.
#[derive(Module, Debug)]
pub struct DynamicsField {
    /// The network on encoded positions and times.
    pub mlp: Mlp,
    /// Sines and cosines of each input.
    #[module(skip)]
    pub bands: usize,
    /// The reference point of velocities, world, scene units.
    #[module(skip)]
    pub centre: [f64; 3],
    /// The unit of lengths, scene units.
    #[module(skip)]
    pub length: f64,
    /// Whether accelerations are `r |r| / 10` of raw numbers.
    #[module(skip)]
    pub squared: bool,
}

impl DynamicsField {
    /// The quantities of Gaussians at `positions` `[M, 3]`, world, scene units, at time `t`.
    pub fn forward(&self, positions: Tensor<2>, t: f64) -> Dynamics {
        let _stage = profile::stage("dynamics field");
        let scaled = offsets(self, &positions) / self.length;
        let time = Tensor::from_data(TensorData::new(vec![t], [1, 1]), (&positions.device(), positions.dtype()));
        let raw = self.mlp.forward_shared(encoded(scaled, self.bands), encoded(time, self.bands));
        let vector = |index: usize| raw.clone().narrow(1, 3 * index, 3);
        let acceleration = |index: usize| match self.squared {
            true => vector(index) * vector(index).abs() / SQUARED_BY,
            false => vector(index),
        };
        Dynamics {
            velocity: vector(0) * self.length,
            acceleration: acceleration(1) * self.length,
            angular: vector(2),
            angular_acceleration: acceleration(3),
        }
    }
}

/// A source of the physical quantities of Gaussians, as a rollout needs them.
pub trait Asked {
    /// The quantities of Gaussians at `positions` `[M, 3]`, world, scene units, at time `t`.
    fn ask(&self, positions: Tensor<2>, t: f64) -> Dynamics;

    /// The reference point of velocities, world, scene units.
    fn centre(&self) -> [f64; 3];
}

impl Asked for DynamicsField {
    fn ask(&self, positions: Tensor<2>, t: f64) -> Dynamics {
        self.forward(positions, t)
    }

    fn centre(&self) -> [f64; 3] {
        self.centre
    }
}

/// `positions` `[M, 3]` from the field's reference point.
pub fn offsets(field: &impl Asked, positions: &Tensor<2>) -> Tensor<2> {
    positions.clone() - centre_row(field, positions)
}

/// The field's reference point `[1, 3]`, of the type and on the device of `like`.
pub fn centre_row(field: &impl Asked, like: &Tensor<2>) -> Tensor<2> {
    Tensor::from_data(TensorData::new(field.centre().to_vec(), [1, 3]), (&like.device(), like.dtype()))
}

/// `[R, c]` and its sines and cosines at `2^0 .. 2^(bands - 1)`: `[R, c (1 + 2 bands)]`.
pub(super) fn encoded(x: Tensor<2>, bands: usize) -> Tensor<2> {
    let mut columns = vec![x.clone()];
    for band in 0..bands {
        let scaled = x.clone() * (1_u64 << band) as f64;
        columns.extend([scaled.clone().sin(), scaled.cos()]);
    }
    Tensor::cat(columns, 1)
}

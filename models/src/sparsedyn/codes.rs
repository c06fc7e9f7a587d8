//! FreeGave's velocity field, a baseline: each Gaussian mixes `K` rigid motions of time by a code of its own.
//!
//! `v(x, t) = sum_k s_k (u_k(t) + w_k(t) x (x - c))`, where the code `s` depends on the Gaussian's first position
//! alone. Every term is free of divergence, and so is the sum for a Gaussian that keeps its code. There are no
//! accelerations: they lie in the network of time.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::dynamics::Dynamics;
use super::field::{Asked, encoded};
use crate::{Activation, Mlp, MlpConfig};

/// Sines and cosines of positions in the network of codes.
const CODE_BANDS: usize = 8;

/// Sines and cosines of time.
const TIME_BANDS: usize = 3;

/// Units of the hidden layers of both networks.
const WIDTH: usize = 128;

/// Hidden layers of the network of codes.
const CODE_LAYERS: usize = 4;

/// Hidden layers of the network of time.
const TIME_LAYERS: usize = 5;

/// Configuration of a [`CodedField`].
#[derive(Config, Debug)]
pub struct CodedFieldConfig {
    /// The reference point of velocities, world, scene units.
    pub centre: [f64; 3],
    /// The unit of lengths, scene units.
    pub length: f64,
    /// `K`, rigid motions: 16 for objects, 32 for rooms.
    #[config(default = 16)]
    pub motions: usize,
    /// Seed of the initial weights.
    #[config(default = 0)]
    pub seed: u64,
}

impl CodedFieldConfig {
    /// The field before training: nothing moves.
    pub fn init(&self, device: &Device) -> CodedField {
        let hidden = |count: usize| std::iter::repeat_n(WIDTH, count);
        let inputs = |numbers: usize, bands: usize| numbers * (1 + 2 * bands);
        let code = std::iter::once(inputs(3, CODE_BANDS)).chain(hidden(CODE_LAYERS)).chain([self.motions]).collect();
        let mix = vec![self.motions, 4 * self.motions, 4 * self.motions, self.motions];
        let time =
            std::iter::once(inputs(1, TIME_BANDS)).chain(hidden(TIME_LAYERS)).chain([6 * self.motions]).collect();
        let zero = MlpConfig::new(time).with_activation(Activation::Silu).with_zero_last(true);
        CodedField {
            code: MlpConfig::new(code).with_seed(self.seed).init(device),
            mix: MlpConfig::new(mix).with_seed(self.seed ^ 1).init(device),
            time: zero.with_seed(self.seed ^ 2).init(device),
            centre: self.centre,
            length: self.length,
        }
    }
}

/// The networks of codes and of time.
#[derive(Module, Debug)]
pub struct CodedField {
    /// First position to code.
    pub code: Mlp,
    /// Code to the weights of the motions.
    pub mix: Mlp,
    /// Time to the motions.
    pub time: Mlp,
    /// The reference point of velocities, world, scene units.
    #[module(skip)]
    pub centre: [f64; 3],
    /// The unit of lengths, scene units.
    #[module(skip)]
    pub length: f64,
}

/// Gaussians with their codes.
#[derive(Debug, Clone)]
pub struct Coded<'a> {
    field: &'a CodedField,
    weights: Tensor<2>,
}

impl CodedField {
    /// The field of Gaussians that are at `positions` `[M, 3]` in the first frame.
    pub fn of(&self, positions: &Tensor<2>) -> Coded<'_> {
        Coded { weights: self.mix.forward(self.codes(positions)), field: self }
    }

    /// The codes `[M, K]` of first positions `[M, 3]`.
    pub fn codes(&self, positions: &Tensor<2>) -> Tensor<2> {
        let centre = TensorData::new(self.centre.to_vec(), [1, 3]);
        let centre = Tensor::<2>::from_data(centre, (&positions.device(), positions.dtype()));
        self.code.forward(encoded((positions.clone() - centre) / self.length, CODE_BANDS))
    }
}

impl Asked for Coded<'_> {
    fn ask(&self, positions: Tensor<2>, t: f64) -> Dynamics {
        let time = Tensor::from_data(TensorData::new(vec![t], [1, 1]), (&positions.device(), positions.dtype()));
        let motions = self.weights.dims()[1];
        let bases = self.field.time.forward(encoded(time, TIME_BANDS)).reshape([motions, 6]);
        let mixed = self.weights.clone().matmul(bases);
        let zeros = positions.zeros_like();
        Dynamics {
            velocity: mixed.clone().narrow(1, 0, 3) * self.field.length,
            acceleration: zeros.clone(),
            angular: mixed.narrow(1, 3, 3),
            angular_acceleration: zeros,
        }
    }

    fn centre(&self) -> [f64; 3] {
        self.field.centre
    }
}

//! The deformation field of the baselines (as in Deformable 3D Gaussians): position, orientation and size at a time by
//! a network.
//!
//! It follows whatever was seen and says nothing beyond it. TRACE and FreeGave learn it beside their velocity field.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::profile;

use super::field::encoded;
use crate::{Mlp, MlpConfig};

/// Sines and cosines of positions.
const POSITION_BANDS: usize = 8;

/// Sines and cosines of time.
const TIME_BANDS: usize = 6;

/// Units of the hidden layer of the network of times.
const TIME_WIDTH: usize = 256;

/// Numbers by which the network of times describes one.
const TIME_CODE: usize = 30;

/// Units of the hidden layers (the "light" form of the baselines' code).
const WIDTH: usize = 128;

/// Hidden layers before the input enters again.
const LAYERS_BEFORE: usize = 4;

/// Hidden layers after that.
const LAYERS_AFTER: usize = 2;

/// Configuration of a [`Deformation`].
#[derive(Config, Debug)]
pub struct DeformationConfig {
    /// The middle of the objects, world, scene units.
    pub centre: [f64; 3],
    /// The unit of lengths, scene units.
    pub length: f64,
    /// Numbers of a code given beside position and time; 0: none.
    #[config(default = 0)]
    pub codes: usize,
    /// Seed of the initial weights.
    #[config(default = 0)]
    pub seed: u64,
}

impl DeformationConfig {
    /// The field before training: nothing is deformed. (The baselines' code begins with a random rotation instead,
    /// since it normalises an arbitrary quaternion.)
    pub fn init(&self, device: &Device) -> Deformation {
        let inputs = 3 * (1 + 2 * POSITION_BANDS) + self.codes + TIME_CODE;
        let hidden = |count: usize| std::iter::repeat_n(WIDTH, count);
        let first = std::iter::once(inputs).chain(hidden(LAYERS_BEFORE)).collect();
        let last = std::iter::once(WIDTH + inputs).chain(hidden(LAYERS_AFTER)).chain([9]).collect();
        let mlp = |sizes: Vec<usize>, salt: u64| MlpConfig::new(sizes).with_seed(self.seed ^ salt);
        Deformation {
            time: mlp(vec![1 + 2 * TIME_BANDS, TIME_WIDTH, TIME_CODE], 1 << 32).init(device),
            first: mlp(first, 0).init(device),
            last: mlp(last, 1 << 33).with_zero_last(true).init(device),
            centre: self.centre,
            length: self.length,
        }
    }
}

/// A network that gives shift, rotation and change of size by first position and time.
#[derive(Module, Debug)]
pub struct Deformation {
    /// The network on encoded times.
    pub time: Mlp,
    /// The layers before the skip, on encoded positions, codes and times.
    pub first: Mlp,
    /// The layers after it, on these and what the layers before give.
    pub last: Mlp,
    /// The middle of the objects, world, scene units.
    #[module(skip)]
    pub centre: [f64; 3],
    /// The unit of lengths, scene units.
    #[module(skip)]
    pub length: f64,
}

/// A deformation of `M` Gaussians at one time.
#[derive(Debug, Clone)]
pub struct Deformed {
    /// `[M, 3]`, scene units, added to the first position.
    pub shift: Tensor<2>,
    /// `[M, 3]` rotation vectors, radians, world axes.
    pub rotation: Tensor<2>,
    /// `[M, 3]`, added to the logarithms of the sizes.
    pub growth: Tensor<2>,
}

impl Deformation {
    /// The deformation of Gaussians at `positions` `[M, 3]` in the first frame, at time `t`. Positions get no gradient
    /// through the network, as in the baselines.
    pub fn forward(&self, positions: &Tensor<2>, codes: Option<Tensor<2>>, t: f64) -> Deformed {
        let _stage = profile::stage("deformation field");
        let options = (&positions.device(), positions.dtype());
        let centre = Tensor::<2>::from_data(TensorData::new(self.centre.to_vec(), [1, 3]), options);
        let scaled = (positions.clone().detach() - centre) / self.length;
        let time = Tensor::from_data(TensorData::new(vec![t], [1, 1]), options);
        let own = match codes {
            Some(codes) => Tensor::cat(vec![encoded(scaled, POSITION_BANDS), codes], 1),
            None => encoded(scaled, POSITION_BANDS),
        };
        let time = self.time.forward(encoded(time, TIME_BANDS));
        let before = relu(self.first.forward_shared(own.clone(), time.clone()));
        let raw = self.last.forward_shared(Tensor::cat(vec![before, own], 1), time);
        let vector = |index: usize| raw.clone().narrow(1, 3 * index, 3);
        Deformed { shift: vector(0) * self.length, rotation: vector(1), growth: vector(2) }
    }
}

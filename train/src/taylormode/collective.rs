//! What moves, moves mostly as one: an update of all paths together, beside each Gaussian's own.
//!
//! A path's blocks `c_k` are numbers of one Gaussian, learned from the few pixels it covers. On a body that turns, those pixels
//! repeat, and each Gaussian alone may settle on the wrong repetition or lag behind. Near the body's centre the motion of a
//! whole body is the first order of a Taylor series in space,
//!
//! `c_k(x) = W_k [1, (x - centre) / scale]`,   `W_k` `[3, 4]`,
//!
//! which holds every rigid motion exactly (a rotation by any angle is linear in `x`) and many others nearly. Adam on `W`, whose
//! gradient is the sum of those of all Gaussians, moves all blocks by `dW_k [1, ...]`. The model is not changed by it: what is
//! stored, and what single Gaussians may do, stays the same. Not part of the paper.

use burn::tensor::{Device, Tensor};
use gs_burn::ops::adam::AdamConfig;

use crate::taylormode::learned::Learned;

/// The common motion as Adam sees it.
#[derive(Debug, Clone)]
pub struct Collective {
    /// `[4, 3 K]`: what all paths were moved by so far.
    pub sum: Learned,
    /// Where places are measured from, scene units.
    pub centre: [f64; 3],
    /// What they are divided by, scene units: [`REACH`] times the body's size.
    pub scale: f64,
}

/// Root mean square distances from the centre over which places count: nearly all of a body lies within, so that a place adds
/// less than 1 an axis to a step.
const REACH: f64 = 2.0;

/// Of the rate, what each number of `W` moves by: the four that move a place add up to about one step of its own.
const SHARE: f64 = 0.5;

impl Collective {
    /// Nothing yet, for a body about `centre` of root mean square size `size` (scene units), whose paths have `order` blocks.
    pub fn new(centre: [f64; 3], size: f64, order: usize, device: &Device) -> Self {
        Self { sum: Learned::new(Tensor::zeros([4, 3 * order], device)), centre, scale: REACH * size }
    }

    /// The change `[M, 3 K]` of the blocks of Gaussians at `places` `[M, 3]` (at `t0`), whose own gradients are `gradients`
    /// `[M, 3 K]`.
    pub fn step(&mut self, places: Tensor<2>, gradients: Tensor<2>, adam: &AdamConfig) -> Tensor<2> {
        let device = places.device();
        let count = places.dims()[0];
        let centre: Tensor<2> = Tensor::<1>::from_floats(self.centre.map(|x| x as f32), &device).unsqueeze();
        let offset = (places - centre) * (1.0 / self.scale);
        let basis = Tensor::cat(vec![Tensor::ones([count, 1], &device), offset], 1);
        let before = self.sum.value.clone();
        let adam = AdamConfig { lr: SHARE * adam.lr, ..*adam };
        self.sum.step(basis.clone().transpose().matmul(gradients), &adam);
        basis.matmul(self.sum.value.clone() - before)
    }
}

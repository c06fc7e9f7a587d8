//! The velocity at each pixel that the paper's blur is formed with: splatted (Eq. 4) and corrected by the Peano network (Eq. 5), or
//! predicted by a network alone ("w/o Taylor Expansion" of Table 2).

use burn::tensor::Tensor;
use gs_models::network::Mlp;
use gs_models::taylormode::{DirectVelocity, PeanoMap};

use crate::taylormode::config::{BlurConfig, VelocitySource};
use crate::taylormode::state::Network;

/// Where velocities come from.
pub struct VelocityField<'a> {
    /// Says which source and which networks are in use.
    pub blur: &'a BlurConfig,
    /// What depths (scene units) and speeds (scene units per unit of time) are divided by before a network sees them.
    pub units: (f64, f64),
    /// The networks of the run.
    pub network: &'a dyn Fn(Network) -> Option<Mlp>,
}

impl VelocityField<'_> {
    /// World velocity at some pixels, `[P, 3]`, scene units per unit of time, at `s` in window units; from the velocities
    /// `splatted` there or from the `places` seen there (world), both `[P, 3]`. A splatted one is that of what is seen times its
    /// alpha, a predicted one is not.
    pub fn at(&self, s: f64, splatted: impl FnOnce() -> Tensor<2>, places: impl FnOnce() -> Tensor<2>) -> Tensor<2> {
        let (depth_unit, velocity_unit) = self.units;
        if self.blur.velocity == VelocitySource::Network {
            let mlp = (self.network)(Network::Velocity).expect("the recipe has this network");
            let places = places();
            let centre = Tensor::zeros([1, 3], &places.device());
            return DirectVelocity { mlp, centre, scale: depth_unit, unit: velocity_unit }.forward(places, s);
        }
        let splatted = splatted();
        match (self.network)(Network::Peano).filter(|_| self.blur.peano) {
            Some(mlp) => PeanoMap { mlp, unit: velocity_unit }.forward(splatted, s),
            None => splatted,
        }
    }
}

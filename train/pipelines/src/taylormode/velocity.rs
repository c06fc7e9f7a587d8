//! The velocity at each pixel for the paper's blur: splatted (Eq. 4) and corrected by the Peano network (Eq. 5), or
//! predicted by a network alone ("w/o Taylor Expansion" of Table 2).

use burn::tensor::Tensor;

use super::Taylormode;

impl Taylormode {
    /// World velocity at some pixels, `[P, 3]`, scene units per unit of time, at `s` in window units. It is computed
    /// from the velocities `splatted` there, or from the `positions` seen there (world), both `[P, 3]`. A splatted
    /// velocity is multiplied by its alpha, a predicted one is not.
    pub fn pixel_velocity(
        &self,
        s: f64,
        splatted: impl FnOnce() -> Tensor<2>,
        positions: impl FnOnce() -> Tensor<2>,
    ) -> Tensor<2> {
        if let Some(network) = &self.velocity {
            return network.forward(positions(), s);
        }
        match &self.peano {
            Some(network) => network.forward(splatted(), s),
            None => splatted(),
        }
    }
}

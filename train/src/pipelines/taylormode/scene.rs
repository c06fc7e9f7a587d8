//! The moving scene with the exposure that was learned beside it.

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_models::DynamicScene;
use gs_models::basis::MotionBasis;
use gs_models::taylormode::TaylorScene;

/// A moving scene that knows how long the shutter was open.
#[derive(Debug)]
pub struct ExposedScene {
    /// The scene.
    pub scene: TaylorScene,
    /// The exposure, the data set's unit of time.
    pub exposure: f64,
}

impl DynamicScene for ExposedScene {
    fn at(&self, t: f64) -> Gaussians {
        self.scene.at(t)
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        self.scene.velocity(t)
    }

    fn span(&self) -> Option<[f64; 2]> {
        self.scene.span()
    }

    fn at_times(&self, times: &[f64]) -> Vec<Gaussians> {
        self.scene.at_times(times)
    }

    fn basis(&self) -> Option<MotionBasis> {
        self.scene.basis()
    }

    fn exposure(&self) -> Option<f64> {
        Some(self.exposure)
    }
}

//! Given `t`, return Gaussians: the trait [`Motion`], and [`Static`], which ignores `t`.

use burn::tensor::Tensor;
use gs_burn::Gaussians;

/// A scene that may move.
///
/// `t` is in the data set's own time unit (seconds, or 0 to 1 where the format normalises); a model states which one it
/// was trained with. Both functions are differentiable in the model's parameters when those live on an autodiff device.
pub trait Motion {
    /// The Gaussians at time `t`; their number N does not depend on `t`.
    fn at(&self, t: f64) -> Gaussians;

    /// World velocity of each centre at time `t`, `[N, 3]`, scene units per time unit: the derivative of the means of
    /// [`at`](Motion::at).
    fn velocity(&self, t: f64) -> Tensor<2>;
}

/// A scene that does not move.
#[derive(Debug, Clone)]
pub struct Static {
    gaussians: Gaussians,
}

impl Static {
    /// A scene in which `gaussians` stay where they are.
    pub fn new(gaussians: Gaussians) -> Self {
        Self { gaussians }
    }

    /// The Gaussians.
    pub fn gaussians(&self) -> &Gaussians {
        &self.gaussians
    }
}

impl Motion for Static {
    fn at(&self, _t: f64) -> Gaussians {
        self.gaussians.clone()
    }

    fn velocity(&self, _t: f64) -> Tensor<2> {
        self.gaussians.means.val().zeros_like()
    }
}

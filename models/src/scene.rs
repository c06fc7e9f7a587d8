//! Given a time, return Gaussians: the trait [`DynamicScene`], and [`Static`], which ignores the time.

use burn::module::Module;
use burn::tensor::Tensor;
use gs_burn::Gaussians;

use serde::Serialize;

use crate::basis::MotionBasis;

/// A scene that may move.
///
/// `t` is in the data set's own time unit (seconds, or 0 to 1 where the format normalises); a model states which one it
/// was trained with. All functions are differentiable in the model's parameters when those live on an autodiff device.
pub trait DynamicScene {
    /// The Gaussians at time `t`; their number N does not depend on `t`.
    fn at(&self, t: f64) -> Gaussians;

    /// World velocity of each centre at time `t`, `[N, 3]`, scene units per time unit: the derivative of the means of
    /// [`at`](DynamicScene::at).
    fn velocity(&self, t: f64) -> Tensor<2>;

    /// First and last time that the model was trained for; `None` if the scene does not move.
    fn span(&self) -> Option<[f64; 2]>;

    /// The earliest and the latest time at which the scene can be asked; `None`: any. A time outside is a mistake of
    /// the caller.
    fn reach(&self) -> Option<[f64; 2]> {
        None
    }

    /// The Gaussians at each of `times`. A model that integrates its motion over time overrides this, to integrate
    /// once.
    fn at_times(&self, times: &[f64]) -> Vec<Gaussians> {
        times.iter().map(|t| self.at(*t)).collect()
    }

    /// The motion as a sum of fixed functions of time; `None` where it is none, or nothing moves.
    fn basis(&self) -> Option<MotionBasis> {
        None
    }

    /// How long the shutter was open for the photos that the scene was learned from, in the unit of time; `None` where
    /// the model does not know.
    fn exposure(&self) -> Option<f64> {
        None
    }
}

/// How the exposures of photos are formed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shutter {
    /// How long it is open, the unit of time.
    pub exposure: f64,
    /// Whether light adds up, as in a sensor; otherwise encoded colours do.
    pub linear: bool,
}

/// A scene that does not move.
#[derive(Module, Debug)]
pub struct Static {
    /// The Gaussians at all times.
    pub gaussians: Gaussians,
}

impl Static {
    /// A scene in which `gaussians` stay where they are.
    pub fn new(gaussians: Gaussians) -> Self {
        Self { gaussians }
    }
}

impl DynamicScene for Static {
    fn at(&self, _t: f64) -> Gaussians {
        self.gaussians.clone()
    }

    fn velocity(&self, _t: f64) -> Tensor<2> {
        self.gaussians.means.val().zeros_like()
    }

    fn span(&self) -> Option<[f64; 2]> {
        None
    }
}

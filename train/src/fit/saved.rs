//! [`Saved`]: what a file holds of a method beside its tensors.

use burn::tensor::Device;
use gs_burn::Gaussians;
use gs_datasets::Scene;

use super::method::{Method, Step};
use crate::config::FitConfig;

/// The part of a method that files hold beside its tensors.
pub trait Saved: Method {
    /// The method's constants, which a checkpoint must hold: which rows move, a window of time.
    fn frame(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// A module with the structure described by [`frame`](Self::frame), on `device`; the values of its tensors are
    /// arbitrary.
    ///
    /// # Errors
    /// A sentence when the frame is damaged.
    fn from_frame(frame: &serde_json::Value, config: &FitConfig<Self::Config>, device: &Device)
    -> Result<Self, String>;

    /// Whether its tensors fit each other and `gaussians` rows, after they were read from a file.
    ///
    /// # Errors
    /// A sentence about the mismatch.
    fn fits(&self, _gaussians: usize) -> Result<(), String> {
        Ok(())
    }

    /// The module for Gaussians that are known at one time alone, such as those of a PLY file.
    ///
    /// # Errors
    /// A sentence if the method cannot do without its learned tensors.
    fn at_rest(_scene: &Scene, at: &Step<Self>, device: &Device) -> Result<Self, String> {
        Self::from_frame(&serde_json::Value::Null, at.config, device)
    }

    /// Bytes of the finished scene: every number, as f32, that is needed to draw it at any time.
    fn bytes(&self, gaussians: &Gaussians, _config: &FitConfig<Self::Config>) -> usize {
        4 * gaussians.len() * (11 + 3 * gaussians.sh.dims()[1])
    }
}

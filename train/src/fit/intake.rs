//! [`Intake`]: what a method takes from a data set.

use std::path::Path;

use gs_datasets::{LoadOptions, Scene};

use super::facts::Unseen;
use super::method::Method;
use crate::config::FitConfig;

/// The part of a method that reads a data set and its configuration.
pub trait Intake: Method {
    /// Whether photos may be compared at a reduced width: nothing in [`Method::Extra`] or [`Method::Cues`] has
    /// their size.
    const ANY_WIDTH: bool = false;
    /// Whether photos may be decoded when they are asked for: no cue and no figure looks at those of a whole set.
    const ON_DEMAND: bool = false;
    /// The background where the photos do not tell.
    const UNSEEN: Unseen = Unseen::Black;

    /// The configuration of `pipeline = "..."` alone.
    fn defaults() -> FitConfig<Self::Config>;

    /// Changes how the data set is loaded.
    fn loading(_config: &FitConfig<Self::Config>, _options: &mut LoadOptions) {}

    /// Removes views that the method cannot use, with a warning in `scene.warnings`, and checks that the others suit
    /// `config`.
    ///
    /// # Errors
    /// A sentence about `dataset` or a key of the configuration.
    fn prepare(_dataset: &Path, _scene: &mut Scene, _config: &FitConfig<Self::Config>) -> Result<(), String> {
        Ok(())
    }

    /// The warning about `without_time` photos without a time, if others have one.
    fn leaves_out(_without_time: usize) -> Option<String> {
        None
    }

    /// Whether the method can learn from `train` training views, `timed` of which have a time.
    ///
    /// # Errors
    /// A sentence about `dataset`.
    fn suits(_dataset: &Path, _train: usize, _timed: usize) -> Result<(), String> {
        Ok(())
    }

    /// The method's near plane, as a share of the subject's distance; `None`: the renderer's own.
    fn near_share(_scene: &Scene, _config: &FitConfig<Self::Config>) -> Option<f64> {
        None
    }

    /// Infers the cues from the training views, once per run.
    fn cues(scene: &Scene, config: &FitConfig<Self::Config>) -> Self::Cues;
}

//! The outcome of a training: its figures, and the contents of the report, which the program draws.

use burn::tensor::Device;
use gs_datasets::Scene;

use super::ending::LastFiles;
use super::evaluate::Comparison;
use super::folder::{EvalFile, MetricsLine};
use super::presentation::PresentedScene;
use crate::config::RenderConfig;
use crate::fit::facts::SceneFacts;
use crate::fit::timetable::Timetable;

/// A finished training.
pub struct Outcome {
    /// Its figures, as in eval.json.
    pub eval: EvalFile,
    /// The contents of its report; `None` where the run was finished before and has one.
    pub report: Option<Box<Contents>>,
}

/// The contents of a report beside the figures.
#[derive(Default)]
pub struct Contents {
    /// The configuration as TOML.
    pub config: String,
    /// The metrics of the steps.
    pub history: Vec<MetricsLine>,
    /// Photos of some views with their renderings.
    pub pictures: Vec<Comparison>,
    /// The schedule, where something changes on the way.
    pub schedule: Option<Timetable>,
    /// The scene, for the viewer.
    pub scene: Option<PresentedScene>,
    /// The photos of `scene`, where it was fitted to a data set.
    pub photos: Option<ScenePhotos>,
    /// The last files of the run so far.
    pub files: LastFiles,
}

/// The photos of a scene, and how it is rendered to be compared with them.
pub struct ScenePhotos {
    /// The data set; the scene's origin is subtracted from its cameras.
    pub photos: Scene,
    /// Values fixed by the data set.
    pub facts: SceneFacts,
    /// Options of the renderer.
    pub render: RenderConfig,
    /// The compute device, without autodiff.
    pub device: Device,
}

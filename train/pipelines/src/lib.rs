//! The pipelines: the crate that names the papers. A new pipeline is a folder here and a line in [`PIPELINES`].
//!
//! The program sees a [`Pipeline`]; the loop that fits one scene sees a [`Method`](gs_train::fit::method::Method), and
//! [`Fit`](fit::Fit) makes the one of the other.
//!
//! [`fit`] is a whole run on one screen.
//!
//! ```no_run
//! use gs_pipelines::resolve_overrides;
//! use gs_train::run::folder::RunFolder;
//! use gs_train::run::watch::{Ending, Job};
//!
//! # fn main() -> anyhow::Result<()> {
//! let resolved = resolve_overrides(&["steps=1000".to_string()])?;
//! let ending = resolved.pipeline.train(&Job {
//!     dataset: "my-photos".into(),
//!     config: resolved.config.clone(),
//!     folder: RunFolder::vacant("runs/my-photos")?,
//!     device: burn::tensor::Device::default(),
//!     more_devices: Vec::new(),
//!     device_name: "the default device".to_string(),
//!     resume: false,
//!     stop_at: None,
//!     quiet: false,
//!     minutes: None,
//!     schedule_svg: None,
//! })?;
//! if let Ending::Finished(outcome) = ending {
//!     println!("{:.2} dB", outcome.eval.last.mean().psnr);
//! }
//! # Ok(())
//! # }
//! ```
#![recursion_limit = "256"]

pub mod bench;
pub mod examples;
pub mod fit;
pub mod flux4d;
mod from_scene;
mod plan;
pub mod resolve;
pub mod sparsedyn;
pub mod still;
pub mod taylormode;

use std::path::Path;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use gs_datasets::{CheckReport, Scene};
use gs_models::DynamicScene;
use toml::Table;

use gs_train::config::ConfigError;
use gs_train::fit::extrapolation::Extrapolation;
use gs_train::fit::snapshot::Snapshot;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::evaluate::Comparison;
use gs_train::run::measured::Measured;
use gs_train::run::presentation::Presentation;
use gs_train::run::scene::{LoadedScene, SceneFile, read_file};
use gs_train::run::watch::{Ending, Job};

pub use flux4d::protocol::Protocol;
pub use flux4d::saved::shipped_checkpoint as shipped;
pub use flux4d::sweep_flow::{SweepFlow, sweep_flow};
pub use resolve::{Resolved, Sources, resolve, resolve_changed, resolve_overrides, resolve_saved};

/// Every pipeline of the program.
pub static PIPELINES: [&dyn Pipeline; 4] = [
    &fit::Fit::<still::Still>::NEW,
    &fit::Fit::<taylormode::Taylormode>::NEW,
    &fit::Fit::<sparsedyn::Sparsedyn>::with_future(sparsedyn::future::extrapolate),
    &flux4d::Flux4d,
];

/// The recipes of `gsburn demo`: for blurry video, and for photos of a static scene. World and training must take less
/// than two minutes on two old cores.
pub const DEMO_RECIPES: [&str; 2] = ["taylormode/demo", "static/demo"];

/// The program's view of a paper.
pub trait Pipeline: Sync {
    /// Its name: `pipeline = "..."`.
    fn name(&self) -> &'static str;

    /// Every key of its configuration, with the value of `pipeline = "..."` alone.
    fn defaults(&self) -> Table;

    /// Checks types and ranges of a configuration and returns it as the TOML text that a run saves.
    ///
    /// # Errors
    /// A value of the wrong type or outside its range; `origin` names the place in type errors.
    fn validate(&self, config: &Table, origin: &str) -> Result<String, ConfigError>;

    /// The report on a data set, with the warnings or the refusal of training with `config`.
    ///
    /// # Errors
    /// When the configuration is not valid.
    fn check(&self, dataset: &Path, config: &Table) -> Result<CheckReport>;

    /// Trains.
    ///
    /// # Errors
    /// One sentence: bad data, a damaged checkpoint, a full disk.
    fn train(&self, job: &Job) -> Result<Ending>;

    /// The scene of a checkpoint, with the photos of a data set if one is named.
    ///
    /// # Errors
    /// A sentence when the checkpoint is damaged, or about the data set.
    fn open(&self, checkpoint: &Checkpoint, dataset: Option<&Path>, device: &Device) -> Result<Opened>;

    /// Measures a scene on a split of a data set.
    ///
    /// # Errors
    /// One sentence saying what was wrong with the scene or the data set.
    fn evaluate(&self, request: &EvalRequest) -> Result<Evaluated>;

    /// The networks of the pipeline, if it trains networks over many logs.
    fn networks(&self) -> Option<&dyn Networks> {
        None
    }

    /// The future of its scenes, if it can extrapolate beyond the Gaussians at any time.
    fn future(&self) -> Option<Extrapolate> {
        None
    }
}

/// Networks that reconstruct recordings which they have not seen.
pub trait Networks {
    /// Applies the network of a checkpoint to a recording; returns lines for the terminal.
    ///
    /// # Errors
    /// One sentence saying what was wrong with the recording.
    fn reconstruct(&self, checkpoint: &Checkpoint, request: &Reconstruction) -> Result<Vec<String>>;

    /// The network of a checkpoint without the state of its optimiser.
    ///
    /// # Errors
    /// A sentence when the checkpoint is damaged.
    fn alone(&self, checkpoint: &Checkpoint, device: &Device) -> Result<Snapshot>;
}

/// The future of the scene of a checkpoint, which was learned from these photos; the error says what is damaged.
pub type Extrapolate = fn(&Checkpoint, &Scene, &Device) -> Result<Box<dyn Extrapolation>>;

/// A request for a measurement.
pub struct EvalRequest<'a> {
    /// The scene.
    pub file: &'a SceneFile,
    /// The data set.
    pub dataset: &'a Path,
    /// The resolved configuration.
    pub config: &'a Table,
    /// The split; `None`: the one on which figures are reported.
    pub split: Option<&'a str>,
    /// The compute device.
    pub device: &'a Device,
    /// Whether pictures of all views are returned.
    pub pictures: bool,
}

/// A request for a reconstruction without training.
pub struct Reconstruction<'a> {
    /// The recording.
    pub log: &'a Path,
    /// Changes of the network's configuration, each as `key=value`.
    pub set: &'a [String],
    /// Folder for the results.
    pub out: &'a Path,
    /// The first frame.
    pub start: usize,
    /// Whether all of the recording is reconstructed, by snippets that overlap.
    pub full: bool,
    /// Frames after the last input that are predicted.
    pub future: usize,
    /// Further times that are rendered, seconds from the begin of the first snippet; each by the snippet that holds it.
    pub times: &'a [f64],
    /// Steps of an optimisation of each snippet after the network; 0: none.
    pub polish: usize,
    /// How far the cameras are moved: forward, left, up, metres.
    pub shift: [f64; 3],
    /// Gaussians slower than this at all times carry no motion, metres per second; `None`: the method's own threshold.
    pub rest_speed: Option<f64>,
    /// A script of edits.
    pub edit: Option<&'a Path>,
    /// Draws the page of a snippet as HTML.
    pub page: fn(&dyn DynamicScene, &Presentation) -> String,
    /// The compute device.
    pub device: &'a Device,
}

/// A measured scene.
pub struct Evaluated {
    /// Training steps of the scene.
    pub step: usize,
    /// The measurement.
    pub measured: Measured,
    /// Pictures, if they were requested.
    pub pictures: Vec<Comparison>,
}

/// A scene of a checkpoint.
pub struct Opened {
    /// The scene.
    pub loaded: LoadedScene,
    /// The data set, if one was named; the scene's own origin is subtracted from its cameras.
    pub photos: Option<Scene>,
}

/// Keys of a configuration, each with a few values.
pub type Sizes = &'static [(&'static str, &'static [&'static str])];

/// The keys that decide how large a model of a pipeline is, with values to try; empty: none is proposed.
pub fn sizes(pipeline: &dyn Pipeline) -> Sizes {
    match pipeline.name() {
        sparsedyn::NAME => &sparsedyn::SIZES,
        _ => &[],
    }
}

/// The pipeline called `name`.
pub fn find(name: &str) -> Option<&'static dyn Pipeline> {
    PIPELINES.iter().copied().find(|pipeline| pipeline.name() == name)
}

/// Names of all pipelines, comma-separated.
pub fn names() -> String {
    PIPELINES.map(|pipeline| pipeline.name()).join(", ")
}

/// Reads a scene from a run folder (its newest checkpoint), a checkpoint (`.safetensors`) or a PLY, SPZ or glTF file.
///
/// # Errors
/// A sentence naming the file, what was expected and what was found.
pub fn load_scene(path: &Path, device: &Device) -> Result<LoadedScene> {
    match read_file(path)? {
        SceneFile::Ply(packed) => Ok(LoadedScene::of_packed(*packed, device)),
        SceneFile::Checkpoint(checkpoint) => Ok(of_checkpoint(&checkpoint)?.open(&checkpoint, None, device)?.loaded),
    }
}

/// The networks of the pipeline that wrote a checkpoint.
///
/// # Errors
/// A sentence if it is of a scene, or of a pipeline that this program does not have.
pub fn networks_of(checkpoint: &Checkpoint) -> Result<&'static dyn Networks> {
    let pipeline = of_checkpoint(checkpoint)?;
    let found = pipeline.name();
    pipeline.networks().with_context(|| {
        let path = checkpoint.path.display();
        format!("{path}: expected a network that reconstructs logs, found a scene of the pipeline {found}")
    })
}

/// The pipeline that wrote a checkpoint.
///
/// # Errors
/// A sentence if this program does not have it.
pub fn of_checkpoint(checkpoint: &Checkpoint) -> Result<&'static dyn Pipeline> {
    let (path, name) = (&checkpoint.path, &checkpoint.origin.pipeline);
    match find(name) {
        Some(pipeline) => Ok(pipeline),
        None => bail!("{}: expected a scene of a pipeline of this program ({}), found {name}", path.display(), names()),
    }
}

//! Configurations: sections with their defaults and ranges; files, recipes and arguments are merged into one.
//!
//! [`Config`] holds the sections that every training of one scene has; a pipeline adds its own ([`FitConfig`]). A run's
//! `config.toml` has the keys its pipeline uses and no others. A file holds only differences: it may name a `base` file
//! beside it, and a key that neither has keeps the pipeline's default. `--set density.cap=50000` overrides one value. A
//! key that does not exist is an error that names the nearest one.

mod camera;
mod correction;
mod data;
mod declare;
mod density;
mod error;
pub mod halves;
mod init;
mod loss;
mod model;
pub mod nearest;
mod optimiser;
mod ranges;
mod retired;
mod run;
pub mod tables;

use std::fmt::Debug;
use std::ops::Deref;

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::section;

pub use camera::{CameraConfig, READOUT_MAX};
pub use correction::{CorrectionConfig, CorrectionMode, CorrectionPer};
pub use data::{Auto, Background, DataConfig, DepthChoice, HoldoutChoice, MaskChoice, PriorKind};
pub use declare::{Declared, Key, check_key, word};
pub use density::{ClassicConfig, DensityConfig, McmcConfig, OpacityPolicy, Strategy};
pub use error::{ConfigError, brief, check};
pub use init::InitConfig;
pub use loss::LossConfig;
pub use model::{ModelConfig, RenderConfig};
pub use optimiser::OptimiserConfig;
pub use ranges::{NOT_NEGATIVE, OPEN_UNIT, Only, POSITIVE, Range, SHARE, is_box, not_negative, positive};
pub use retired::{present_name, with_moved, without_retired};
pub use run::{CheckpointConfig, EvalConfig};

/// The pipeline of a configuration that does not name one.
pub const DEFAULT_PIPELINE: &str = "static";

section! {
    /// The sections that every training of one scene has.
    pub struct Config {
        /// The pipeline's name; `gsburn recipes` lists them.
        pipeline: String = DEFAULT_PIPELINE.into();
        /// The seed of all random draws.
        seed: u64 = 42;
        /// Optimisation steps; one photo is compared in each.
        steps: usize = 7000, in 1..;
        /// Options for reading the data set.
        data: DataConfig;
        /// Options of the initial Gaussians.
        init: InitConfig;
        /// Numbers that a Gaussian stores.
        model: ModelConfig;
        /// Options of the renderer.
        render: RenderConfig;
        /// Weights of the loss.
        loss: LossConfig;
        /// Exposure and white balance of the photos.
        correction: CorrectionConfig;
        /// Poses that are learned.
        camera: CameraConfig;
        /// Learning rates.
        optimiser: OptimiserConfig;
        /// Adding, relocating and removing Gaussians.
        density: DensityConfig;
        /// When and how the scene is measured.
        eval: EvalConfig;
        /// When the state is saved.
        checkpoint: CheckpointConfig;
    }
}

impl Config {
    /// The defaults without the measures by which a still scene is fitted sooner: rates, first Gaussians, growth and
    /// photo sizes are as published, whatever the length of the run. Pipelines begin with it in which those were not
    /// measured to help.
    pub fn published() -> Self {
        let base = Self::default();
        Self {
            data: DataConfig { coarse_share: 0.0, ..base.data },
            model: ModelConfig { sh_interval: 1000, ..base.model },
            init: InitConfig { dense_share: 0.0, ..base.init },
            density: DensityConfig {
                mcmc: McmcConfig { growth: 0.05, full: 0.0, ..base.density.mcmc },
                ..base.density
            },
            optimiser: OptimiserConfig { means_pixels: 0.0, short_run_factor: 1.0, decay_steps: 0, ..base.optimiser },
            ..base
        }
    }
}

/// The sections that one pipeline adds: a struct whose fields are sections, each a struct of values.
pub trait Section:
    Declared + Debug + Clone + Default + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// Checks what concerns the shared sections too.
    ///
    /// # Errors
    /// The first value outside its range.
    fn check_beside(&self, _shared: &Config) -> Result<(), ConfigError> {
        Ok(())
    }
}

/// Checks what a pipeline of moving scenes cannot do: photos at a reduced width, because its other data of a photo are
/// not reduced with it; a begin from a scene, which says nothing of the motion; and a region, which things may leave.
///
/// # Errors
/// The first value that asks for it.
pub fn of_moving_scenes(shared: &Config) -> Result<(), ConfigError> {
    let (share, scene) = (shared.data.coarse_share, &shared.init.scene);
    check("data.coarse_share", share, share == 0.0, "0 in a pipeline of moving scenes")?;
    check("init.scene", format!("{scene:?}"), scene.is_empty(), "\"\" in a pipeline of moving scenes")?;
    let region = &shared.data.region;
    check("data.region", format!("{region:?}"), region.is_empty(), "[] in a pipeline of moving scenes")
}

/// A whole configuration: the shared sections and a pipeline's own.
///
/// It dereferences to the shared sections, so that a function of those takes either.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitConfig<S> {
    /// The shared sections.
    pub shared: Config,
    /// The pipeline's own.
    pub method: S,
}

impl<S> Deref for FitConfig<S> {
    type Target = Config;

    fn deref(&self) -> &Config {
        &self.shared
    }
}

impl<S: Section> FitConfig<S> {
    /// Reads a table, which may omit keys; `origin` names it in errors.
    ///
    /// # Errors
    /// A key that does not exist, a value of the wrong type, a value outside its range.
    pub fn from_table(table: &Table, origin: &str) -> Result<Self, ConfigError> {
        let (shared, method) = halves::read(table, origin)?;
        let config = Self { shared, method };
        config.validate()?;
        Ok(config)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.shared.check_ranges("")?;
        self.method.check_ranges("")?;
        self.method.check_beside(&self.shared)
    }

    /// Every key with its value.
    pub fn to_table(&self) -> Table {
        halves::table(&self.shared, &self.method)
    }

    /// Every key with its value as TOML text, in the order of the sections.
    pub fn to_toml(&self) -> String {
        halves::text(&self.shared, &self.method)
    }
}

/// The values of a table as a type; `origin` names the table in errors.
///
/// # Errors
/// A key that does not exist, or a value of the wrong type.
pub fn typed<T: DeserializeOwned>(table: Table, origin: &str) -> Result<T, ConfigError> {
    let wrong_type =
        |error: toml::de::Error| ConfigError::Type { origin: origin.into(), found: tables::one_line(&error) };
    Value::Table(table).try_into().map_err(wrong_type)
}

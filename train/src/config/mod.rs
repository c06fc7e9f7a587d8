//! Configurations: sections with their defaults and ranges; files, recipes and arguments are merged into one.
//!
//! [`Config`] holds the sections that every training of one scene has; a pipeline adds its own ([`FitConfig`]). A run's
//! `config.toml` has the keys its pipeline uses and no others. A file holds only differences: it may name a `base` file beside it,
//! and a key that neither has keeps the pipeline's default. `--set density.cap=50000` overrides one value. A key that does not
//! exist is an error that names the nearest one.

mod data;
mod density;
mod error;
mod init;
mod loss;
mod model;
pub mod nearest;
mod optimiser;
mod run;
pub mod tables;

use std::fmt::Debug;
use std::ops::Deref;

use serde::Deserialize;
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

pub use data::{Auto, Background, DataConfig, DepthChoice, HoldoutChoice, MaskChoice, PriorKind};
pub use density::{DensityConfig, OpacityPolicy, Strategy};
pub use error::{ConfigError, brief, check, not_negative, open_unit, positive};
pub use init::InitConfig;
pub use loss::LossConfig;
pub use model::{ModelConfig, RenderConfig};
pub use optimiser::OptimiserConfig;
pub use run::{CheckpointConfig, EvalConfig};

/// The pipeline of a configuration that does not name one.
pub const DEFAULT_PIPELINE: &str = "static";

/// The sections that every training of one scene has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The pipeline's name; `gsburn recipes` lists them.
    pub pipeline: String,
    /// The seed of all random draws.
    pub seed: u64,
    /// Optimisation steps; one photo is compared in each.
    pub steps: usize,
    /// Options for reading the data set.
    pub data: DataConfig,
    /// Options of the initial Gaussians.
    pub init: InitConfig,
    /// Numbers that a Gaussian stores.
    pub model: ModelConfig,
    /// Options of the renderer.
    pub render: RenderConfig,
    /// Weights of the loss.
    pub loss: LossConfig,
    /// Learning rates.
    pub optimiser: OptimiserConfig,
    /// Adding, relocating and removing Gaussians.
    pub density: DensityConfig,
    /// When and how the scene is measured.
    pub eval: EvalConfig,
    /// When the state is saved.
    pub checkpoint: CheckpointConfig,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            pipeline: DEFAULT_PIPELINE.into(),
            seed: 42,
            steps: 7000,
            data: DataConfig::default(),
            init: InitConfig::default(),
            model: ModelConfig::default(),
            render: RenderConfig::default(),
            loss: LossConfig::default(),
            optimiser: OptimiserConfig::default(),
            density: DensityConfig::default(),
            eval: EvalConfig::default(),
            checkpoint: CheckpointConfig::default(),
        }
    }
}

impl Config {
    /// The defaults without the measures by which a still scene is fitted sooner: rates, first Gaussians, growth and photo sizes are as
    /// published, whatever the length of the run. Pipelines begin with it in which those were not measured to help.
    pub fn published() -> Self {
        let base = Self::default();
        Self {
            data: DataConfig { coarse_share: 0.0, ..base.data },
            init: InitConfig { dense_share: 0.0, ..base.init },
            density: DensityConfig { growth: 0.05, full: 0.0, ..base.density },
            optimiser: OptimiserConfig { short_run_factor: 1.0, decay_steps: 0, ..base.optimiser },
            ..base
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        check("steps", self.steps, self.steps >= 1, "at least 1")?;
        self.data.validate()?;
        self.init.validate()?;
        self.model.validate()?;
        self.render.validate()?;
        self.loss.validate()?;
        self.optimiser.validate()?;
        self.density.validate()?;
        self.eval.validate()?;
        self.checkpoint.validate()
    }
}

/// The sections that one pipeline adds: a struct whose fields are sections, each a struct of values.
pub trait Section: Debug + Clone + Default + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    fn validate(&self, shared: &Config) -> Result<(), ConfigError>;
}

/// Checks that photos have their full width throughout, for a pipeline whose other data of a photo are not reduced with it.
///
/// # Errors
/// Where they are to be reduced for a share of the run.
pub fn full_width(shared: &Config) -> Result<(), ConfigError> {
    let share = shared.data.coarse_share;
    check("data.coarse_share", share, share == 0.0, "0 in a pipeline of moving scenes")
}

/// No sections.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoSection {}

impl Section for NoSection {
    fn validate(&self, _shared: &Config) -> Result<(), ConfigError> {
        Ok(())
    }
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
        let keys = Table::try_from(S::default()).expect("sections are tables");
        // Not by `serde(flatten)`: its buffer loses the key that a type error is about.
        let (own, shared): (Table, Table) = table.clone().into_iter().partition(|(key, _)| keys.contains_key(key));
        let config = Self { shared: typed(shared, origin)?, method: typed(own, origin)? };
        config.validate()?;
        Ok(config)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.shared.validate()?;
        self.method.validate(&self.shared)
    }

    /// Every key with its value.
    pub fn to_table(&self) -> Table {
        let mut table = Table::try_from(&self.shared).expect("a configuration of numbers, strings and lists is TOML");
        table.extend(Table::try_from(&self.method).expect("sections are tables"));
        table
    }

    /// Every key with its value as TOML text, in the order of the sections.
    pub fn to_toml(&self) -> String {
        let text = |value: &dyn Fn() -> Result<String, toml::ser::Error>| value().expect("a configuration is TOML");
        let (shared, own) =
            (text(&|| toml::to_string_pretty(&self.shared)), text(&|| toml::to_string_pretty(&self.method)));
        if own.is_empty() { shared } else { format!("{shared}\n{own}") }
    }
}

/// The values of a table as a type; `origin` names the table in errors.
///
/// # Errors
/// A key that does not exist, or a value of the wrong type.
pub fn typed<T: DeserializeOwned>(table: Table, origin: &str) -> Result<T, ConfigError> {
    let wrong = |error: toml::de::Error| ConfigError::Type { origin: origin.into(), found: tables::one_line(&error) };
    Value::Table(table).try_into().map_err(wrong)
}

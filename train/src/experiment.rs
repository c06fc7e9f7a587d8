//! Arguments + configuration file + defaults -> one resolved [`Config`], which is saved with the run.
//!
//! A file holds only differences: it may name a `base` file beside it, and what it does not mention keeps its default.
//! `--set density.cap=50000` overrides one value. A key that does not exist is an error naming the nearest one that does.

mod files;

use std::path::{Path, PathBuf};

use gs_datasets::{DatasetError, PriorUse, Scene};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::checkpoint::CheckpointConfig;
use crate::data::DataConfig;
use crate::density::DensityConfig;
use crate::evaluate::EvalConfig;
use crate::experiment::files::{MAX_BASES, check_keys, merge, one_line, parse, parse_override, read_with_base};
use crate::losses::LossConfig;
use crate::optimiser::OptimiserConfig;
use crate::scene_init::InitConfig;
use crate::step::{ModelConfig, RenderConfig};
use crate::taylormode::config::{BlurConfig, MotionConfig, PriorConfig};
use crate::taylormode::hints::{leave_out_timeless, mask_held_out};
use crate::taylormode::saved::ROWS_MAX;

/// Everything a run depends on, except the data set's path and the device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// The one seed of all random draws.
    pub seed: u64,
    /// Optimisation steps; one photo is compared in each.
    pub steps: usize,
    /// Which method.
    pub pipeline: Pipeline,
    /// How the data set is read.
    pub data: DataConfig,
    /// How the scene begins.
    pub init: InitConfig,
    /// What a Gaussian stores.
    pub model: ModelConfig,
    /// How images are formed.
    pub render: RenderConfig,
    /// What is minimised.
    pub loss: LossConfig,
    /// Learning rates.
    pub optimiser: OptimiserConfig,
    /// Where Gaussians are added, moved and removed.
    pub density: DensityConfig,
    /// When and how the result is measured.
    pub eval: EvalConfig,
    /// When the state is saved.
    pub checkpoint: CheckpointConfig,
    /// `taylormode`: how Gaussians move.
    pub motion: MotionConfig,
    /// `taylormode`: how blur is formed.
    pub blur: BlurConfig,
    /// `taylormode`: what priors weigh.
    pub prior: PriorConfig,
}

/// Which method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pipeline {
    /// 3D Gaussian Splatting: posed photos of a scene that stands still.
    Static,
    /// TaylorMoDe-GS: multi-view video, sharp or with motion blur.
    Taylormode,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            seed: 42,
            steps: 7000,
            pipeline: Pipeline::Static,
            data: DataConfig::default(),
            init: InitConfig::default(),
            model: ModelConfig::default(),
            render: RenderConfig::default(),
            loss: LossConfig::default(),
            optimiser: OptimiserConfig::default(),
            density: DensityConfig::default(),
            eval: EvalConfig::default(),
            checkpoint: CheckpointConfig::default(),
            motion: MotionConfig::default(),
            blur: BlurConfig::default(),
            prior: PriorConfig::default(),
        }
    }
}

/// What can be wrong with a configuration; one sentence each.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: cannot read the configuration: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's answer.
        source: std::io::Error,
    },
    /// The file is not TOML.
    #[error("{origin}: expected TOML, found: {found}")]
    Syntax {
        /// The file or argument.
        origin: String,
        /// The parser's complaint on one line.
        found: String,
    },
    /// A key that does not exist.
    #[error("{origin}: unknown key `{key}`; the nearest valid key is `{nearest}`")]
    UnknownKey {
        /// The file or argument.
        origin: String,
        /// The key as written, with its sections.
        key: String,
        /// The valid key most like it.
        nearest: String,
    },
    /// A value of the wrong type.
    #[error("{origin}: {found}")]
    Type {
        /// The file or argument.
        origin: String,
        /// What was expected, found, and where.
        found: String,
    },
    /// A value outside its range.
    #[error("configuration: `{key}` must be {expected}, found {found}")]
    Range {
        /// The key with its sections.
        key: &'static str,
        /// The range, as a phrase.
        expected: &'static str,
        /// The value.
        found: String,
    },
    /// `base` files that lead to no end.
    #[error("{}: more than {MAX_BASES} `base` files are stacked here; is there a circle?", path.display())]
    Circle {
        /// The file at which it was noticed.
        path: PathBuf,
    },
}

impl Config {
    /// The defaults, changed by `file` (and what it is based on), changed by `overrides` of the form `section.key=value`.
    ///
    /// # Errors
    /// A sentence naming the file or argument, the key, what was expected and what was found.
    pub fn resolve(file: Option<&Path>, overrides: &[String]) -> Result<Self, ConfigError> {
        let mut table = Table::new();
        if let Some(path) = file {
            merge(&mut table, read_with_base(path, 0)?);
        }
        for text in overrides {
            merge(&mut table, parse_override(text)?);
        }
        let origin = file.map_or_else(|| "arguments".to_string(), |path| path.display().to_string());
        Self::from_table(table, &origin)
    }

    /// Reads a resolved configuration saved by [`to_toml`](Config::to_toml).
    ///
    /// # Errors
    /// As [`resolve`](Config::resolve).
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::resolve(Some(path), &[])
    }

    /// Reads the TOML text of a resolved configuration; `origin` names it in errors.
    ///
    /// # Errors
    /// As [`resolve`](Config::resolve).
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, ConfigError> {
        let table = parse(text, origin)?;
        check_keys(&table, origin)?;
        Self::from_table(table, origin)
    }

    /// The configuration as TOML, every key present.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).expect("a configuration of numbers, strings and lists is TOML")
    }

    /// Reads the data set at `path` for training and measuring by this configuration.
    ///
    /// # Errors
    /// A sentence naming the file, what was expected and what was found.
    pub fn load(&self, path: &Path) -> Result<Scene, DatasetError> {
        let mut options = self.data.options();
        if self.pipeline == Pipeline::Static {
            // Nothing in a still scene is compared with them. Masks of what moves stay: moving parts are measured by them.
            options.priors = PriorUse { depth: false, sharp: false, ..options.priors };
        }
        let mut scene = gs_datasets::load(path, &options)?;
        if self.pipeline == Pipeline::Taylormode {
            leave_out_timeless(&mut scene);
            mask_held_out(&mut scene);
        }
        Ok(scene)
    }

    fn from_table(table: Table, origin: &str) -> Result<Self, ConfigError> {
        let config: Self = Value::Table(table)
            .try_into()
            .map_err(|error: toml::de::Error| ConfigError::Type { origin: origin.into(), found: one_line(&error) })?;
        config.validate()?;
        Ok(config)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        check("steps", self.steps, self.steps >= 1, "at least 1")?;
        let (data, model, render, loss) = (&self.data, &self.model, &self.render, &self.loss);
        check("data.holdout_every", data.holdout_every, data.holdout_every >= 2, "at least 2")?;
        let named = data.holdout != crate::data::HoldoutChoice::Names || !data.holdout_names.is_empty();
        check("data.holdout_names", "[]", named, "a list of view names when data.holdout = \"names\"")?;
        let in_range = data.background.color().iter().all(|c| (0.0..=1.0).contains(c));
        check("data.background", format!("{:?}", data.background.color()), in_range, "three numbers from 0 to 1")?;
        check("init.opacity", self.init.opacity, open_unit(self.init.opacity), "between 0 and 1, both excluded")?;
        check("init.scale", self.init.scale, positive(self.init.scale), "positive")?;
        check("init.random_points", self.init.random_points, self.init.random_points >= 1, "at least 1")?;
        check("model.sh_degree", model.sh_degree, model.sh_degree <= 3, "0, 1, 2 or 3")?;
        check("model.sh_interval", model.sh_interval, model.sh_interval >= 1, "at least 1")?;
        check(
            "render.near",
            render.near,
            positive(render.near) || render.near == 0.0,
            "positive, or 0: by the data set",
        )?;
        check("render.far", render.far, render.far > render.near, "larger than render.near")?;
        check("render.eps2d", render.eps2d, render.eps2d.is_finite() && render.eps2d >= 0.0, "0 or more")?;
        check("loss.dssim", loss.dssim, (0.0..=1.0).contains(&loss.dssim), "from 0 to 1")?;
        check("loss.opacity_reg", loss.opacity_reg, not_negative(loss.opacity_reg), "0 or more")?;
        check("loss.scale_reg", loss.scale_reg, not_negative(loss.scale_reg), "0 or more")?;
        self.optimiser.validate()?;
        self.density.validate()?;
        let (cap, moves) = (self.density.cap, self.pipeline == Pipeline::Taylormode);
        check("density.cap", cap, !moves || cap <= ROWS_MAX, "at most 16777216 Gaussians of a moving scene")?;
        self.motion.validate()?;
        self.blur.validate()?;
        self.prior.validate()?;
        check("eval.images", self.eval.images, self.eval.images <= 1000, "at most 1000")?;
        check("checkpoint.keep", self.checkpoint.keep, self.checkpoint.keep >= 1, "at least 1")
    }
}

/// `Ok` when `holds`, otherwise the sentence "`key` must be `expected`, found `found`".
pub(crate) fn check(
    key: &'static str,
    found: impl ToString,
    holds: bool,
    expected: &'static str,
) -> Result<(), ConfigError> {
    if holds { Ok(()) } else { Err(ConfigError::Range { key, expected, found: found.to_string() }) }
}

/// Above 0, also as f32, which is what kernels compute with.
pub(crate) fn positive(x: f64) -> bool {
    not_negative(x) && x as f32 > 0.0
}

/// 0 or more, and finite as f32.
pub(crate) fn not_negative(x: f64) -> bool {
    x >= 0.0 && (x as f32).is_finite()
}

pub(crate) fn open_unit(x: f64) -> bool {
    x > 0.0 && x < 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(overrides: &[&str]) -> Result<Config, ConfigError> {
        Config::resolve(None, &overrides.iter().map(|s| s.to_string()).collect::<Vec<_>>())
    }

    #[test]
    fn overrides_change_one_value() {
        let config =
            resolve(&["density.cap=123", "density.strategy=default", "loss.dssim = 0", "data.background=[1,1,1]"]);
        let config = config.expect("valid");
        assert_eq!((config.density.cap, config.loss.dssim, config.data.background.color()), (123, 0.0, [1.0; 3]));
        assert_eq!(config.steps, Config::default().steps);
    }

    #[test]
    fn unknown_keys_name_the_nearest() {
        let message = |text| resolve(&[text]).expect_err("unknown").to_string();
        assert!(message("density.capp=1").contains("`density.cap`"), "{}", message("density.capp=1"));
        assert!(message("cap=1").contains("`density.cap`"), "{}", message("cap=1"));
        assert!(message("model.sh_degre=1").contains("`model.sh_degree`"));
        assert!(message("stepz=1").contains("`steps`"));
    }

    #[test]
    fn wrong_types_and_ranges_are_sentences() {
        let message = |text| resolve(&[text]).expect_err("invalid").to_string();
        assert!(message("steps=many").contains("steps"), "{}", message("steps=many"));
        assert!(message("loss.dssim=1.5").contains("from 0 to 1, found 1.5"));
        assert!(message("steps=0").contains("at least 1"));
        assert!(message("steps").contains("no `=`"));
        assert!(message("render.near=nan").contains("positive"));
        assert!(!message("density.strategy=magic").contains('\n'));
    }

    #[test]
    fn what_is_saved_reads_back_the_same() {
        let config =
            resolve(&["seed=7", "eval.at=[1,2]", "data.holdout=names", "data.holdout_names=['a']"]).expect("valid");
        assert_eq!(Config::from_toml(&config.to_toml(), "test").expect("reads back"), config);
    }

    #[test]
    fn files_stack_on_their_base() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write("base.toml", "steps = 10\n[density]\ncap = 20\n");
        write("scene.toml", "base = \"base.toml\"\n[density]\nevery = 30\n");
        write("circle.toml", "base = \"circle.toml\"\n");
        let config = Config::resolve(Some(&folder.path().join("scene.toml")), &[]).expect("valid");
        assert_eq!((config.steps, config.density.cap, config.density.every), (10, 20, 30));
        assert!(Config::read(&folder.path().join("circle.toml")).expect_err("circle").to_string().contains("circle"));
        assert!(Config::read(&folder.path().join("none.toml")).expect_err("missing").to_string().contains("none.toml"));
    }
}

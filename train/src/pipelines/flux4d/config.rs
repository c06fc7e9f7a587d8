//! The configuration of Flux4D: the shared sections of any run, and those of a network over many logs.

use gs_driving::OVERLAP;
use gs_models::flux4d::actors::ActorConfig;
use gs_models::flux4d::{Feedback, LossConfig, RefinementConfig};
use serde::{Deserialize, Serialize};
use toml::Table;

mod ranges;

use super::NAME;
use crate::config::{CheckpointConfig, ConfigError, EvalConfig, typed};

/// The sections of a network that is trained on driving logs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sections {
    /// The driving logs and their snippets.
    pub logs: LogsConfig,
    /// Points to first Gaussians.
    pub lift: LiftSection,
    /// The sparse 3D UNet and the motion that it predicts.
    pub unet: UnetConfig,
    /// Passes of the network over one snippet.
    pub refinement: RefinementSection,
    /// What a snippet is compared with, and the weights of the loss.
    pub supervision: SupervisionConfig,
    /// The optimiser of the network.
    pub learning: LearningConfig,
    /// Moving objects of a reconstruction.
    pub actors: ActorsSection,
}

/// Moving objects of a reconstruction: clusters of the Gaussians that move (Algorithm 3).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ActorsSection {
    /// Slowest speed of an actor's Gaussians, metres per second.
    pub speed: f64,
    /// Radius of the clustering, metres.
    pub radius: f64,
    /// Gaussians within the radius, itself included, that make one the core of an actor.
    pub fewest: usize,
}

impl Default for ActorsSection {
    fn default() -> Self {
        // Of 20,000 points, merged in voxels, a car at 20 m has some 30, up to 0.6 m apart: the paper's 0.4 m and 10 points, which
        // `flux4d/paper` has, are of unmerged ones and break it into pieces.
        Self { speed: ActorConfig::default().speed, radius: 0.8, fewest: 5 }
    }
}

impl ActorsSection {
    /// As the clustering takes it.
    pub fn config(self) -> ActorConfig {
        ActorConfig { speed: self.speed, eps: self.radius, min_points: self.fewest }
    }
}

/// Cameras of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CameraChoice {
    /// The one that looks ahead, as in the paper.
    #[default]
    Front,
    /// All of the log.
    All,
}

/// The logs that are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SplitChoice {
    /// One log in eight, the last ones by name, and at least one of several.
    #[default]
    LastEighth,
    /// The paper's (C.1): 001, 011, 016, 065, 084, 090, 106, 115, 123 and 158 of PandaSet, the first hundred by name of Argoverse 2.
    Paper,
}

/// The driving logs and their snippets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LogsConfig {
    /// Frames of a snippet. Of the first 11, every second is an input and the others are targets; those after them
    /// are the future, and targets of the training too. A snippet never reaches over a gap in the recording.
    pub frames: usize,
    /// Frames from the begin of one snippet to that of the next; 0: neighbours share 5 frames, as in the paper.
    pub every: usize,
    /// The cameras.
    pub camera: CameraChoice,
    /// Wider images are downscaled to this width, pixels; 0 keeps the full size.
    pub max_width: usize,
    /// Names of the logs that are held out; with none, `logs.split` chooses them.
    pub validation: Vec<String>,
    /// The logs that are held out where `logs.validation` names none.
    pub split: SplitChoice,
    /// Snippets of each held-out log that are measured, spread evenly; 0: all.
    pub validation_snippets: usize,
    /// Memory for snippets that were read, MB; those beyond are read again. Beside it, the snippets of a step, three for
    /// the next ones and one of a measurement are in memory.
    pub cache_mb: usize,
}

/// First orientations of Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RotationChoice {
    /// Random, as in the paper: four channels of noise in the network's input.
    Random,
    /// None; the first Gaussians are isotropic, so their image is the same.
    #[default]
    Identity,
}

/// First velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VelocityChoice {
    /// None, as in the paper: the network learns all of them.
    Zero,
    /// Those that bring the points of a sweep onto the points of the others; the network predicts the difference. What
    /// no sweep shows to move carries no velocity.
    #[default]
    Aligned,
}

/// Voxels whose points are merged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MergeChoice {
    /// Their edge grows with the root of the distance from the nearest input camera.
    #[default]
    Growing,
    /// Their edge is the same everywhere.
    Equal,
}

/// Points to first Gaussians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LiftSection {
    /// LiDAR points of a snippet at most for each camera of its inputs; beyond them, the points of a voxel in one sweep are merged.
    /// 0: no limit.
    pub points: usize,
    /// Edges of the voxels whose points are merged.
    pub merge: MergeChoice,
    /// Whether points that no input image shows are left out.
    pub in_view: bool,
    /// Points on the sky's half sphere.
    pub sky_points: usize,
    /// Random points in a ball around the scene.
    pub random_points: usize,
    /// Largest scale of a Gaussian that is not sky, metres.
    pub scale_max: f64,
    /// First orientations.
    pub rotations: RotationChoice,
    /// First velocities.
    pub velocity: VelocityChoice,
}

/// What corrects sky and random points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FarChoice {
    /// A small network, point by point: in the convolutions each would be alone in its voxel.
    #[default]
    Apart,
    /// The convolutions, as the rows of the scene (the paper).
    Voxels,
}

/// The sparse 3D UNet and the motion that it predicts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UnetConfig {
    /// Edge of the finest voxels, metres.
    pub voxel: f64,
    /// Multiplier of all widths (32 to 256 channels).
    pub width: f64,
    /// Degree of the polynomial of velocity: 0 is constant velocity, 1 constant acceleration; up to 3.
    pub degree: usize,
    /// What corrects sky and random points: a small network of their own (`"apart"`), or the convolutions (`"voxels"`, the paper).
    pub far: FarChoice,
}

/// The gradient as the next pass reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeedbackChoice {
    /// As it is; channels differ by orders of magnitude.
    Raw,
    /// Each channel over its largest magnitude.
    Largest,
    /// Each channel over its root mean square.
    #[default]
    RootMeanSquare,
}

/// Passes of the network over one snippet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefinementSection {
    /// Passes, the base network's included; 1: no refinement.
    pub passes: usize,
    /// The gradient as the next pass reads it.
    pub feedback: FeedbackChoice,
}

/// What a snippet is compared with, and the weights of the loss.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SupervisionConfig {
    /// Input images of a step; the gradient over these is fed back.
    pub input_views: usize,
    /// Images between the inputs of a step, and after them where snippets have a future; 0: the inputs alone.
    pub target_views: usize,
    /// Share of 1 - SSIM in the photometric loss; the rest is L1.
    pub dssim: f64,
    /// Weight of the LiDAR's depth, one over metres; 0: none.
    pub depth: f64,
    /// Weight of the mean speed ("as static as possible"), windows per metre; 0: none. Where velocities begin at what the sweeps show
    /// (`lift.velocity`), the speed of the change from these counts: what the sweeps show is kept.
    pub velocity: f64,
    /// Largest image velocity of the reweighting, pixels per frame; 0: no reweighting.
    pub reweight_clip: f64,
}

/// The optimiser of the network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearningConfig {
    /// Adam's rate after the warm-up.
    pub rate: f64,
    /// Rate of the last step; in between the rate falls exponentially.
    pub last_rate: f64,
    /// Steps in which the rate rises from 0.
    pub warm_up: usize,
    /// Snippets whose gradients are averaged in a step.
    pub accumulate: usize,
    /// Change of a snippet's brightness, contrast and tint, drawn anew for each step: largest logarithm of gain and gamma; 0: none
    /// (the paper). More: other light and other paint than those of the training logs cost less, and those cost more.
    pub recolour: f64,
}

impl Default for LogsConfig {
    fn default() -> Self {
        Self {
            frames: 11,
            every: 0,
            camera: CameraChoice::Front,
            max_width: 320,
            validation: Vec::new(),
            split: SplitChoice::LastEighth,
            validation_snippets: 2,
            cache_mb: 512,
        }
    }
}

impl Default for LiftSection {
    fn default() -> Self {
        Self {
            points: 50_000,
            merge: MergeChoice::Growing,
            in_view: true,
            sky_points: 2000,
            random_points: 0,
            scale_max: 1.0,
            rotations: RotationChoice::Identity,
            velocity: VelocityChoice::Aligned,
        }
    }
}

impl Default for UnetConfig {
    fn default() -> Self {
        Self { voxel: 0.4, width: 0.25, degree: 1, far: FarChoice::Apart }
    }
}

impl Default for RefinementSection {
    fn default() -> Self {
        Self { passes: 3, feedback: FeedbackChoice::RootMeanSquare }
    }
}

impl Default for SupervisionConfig {
    fn default() -> Self {
        let LossConfig { dssim, depth, velocity, reweight_clip } = LossConfig::default();
        Self { input_views: 2, target_views: 2, dssim, depth, velocity, reweight_clip }
    }
}

impl Default for LearningConfig {
    fn default() -> Self {
        Self { rate: 4e-3, last_rate: 2e-4, warm_up: 10, accumulate: 1, recolour: 0.0 }
    }
}

/// Sections that any run has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Shared {
    pipeline: String,
    seed: u64,
    steps: usize,
    eval: EvalConfig,
    checkpoint: CheckpointConfig,
}

impl Default for Shared {
    fn default() -> Self {
        let checkpoint = CheckpointConfig { every: 100, ..CheckpointConfig::default() };
        // MS-SSIM takes seconds a view on a CPU, as long as the network.
        let eval = EvalConfig { ms_ssim: false, ..EvalConfig::default() };
        Self { pipeline: NAME.into(), seed: 42, steps: 300, eval, checkpoint }
    }
}

/// The whole configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct FluxConfig {
    /// The seed of all random draws.
    pub seed: u64,
    /// Optimisation steps.
    pub steps: usize,
    /// When and how the network is measured.
    pub eval: EvalConfig,
    /// When the state is saved.
    pub checkpoint: CheckpointConfig,
    /// The pipeline's own sections.
    pub own: Sections,
}

impl Default for FluxConfig {
    fn default() -> Self {
        Self::of(Shared::default(), Sections::default())
    }
}

impl FluxConfig {
    fn of(shared: Shared, own: Sections) -> Self {
        let Shared { seed, steps, eval, checkpoint, .. } = shared;
        Self { seed, steps, eval, checkpoint, own }
    }

    fn shared(&self) -> Shared {
        let (eval, checkpoint) = (self.eval.clone(), self.checkpoint.clone());
        Shared { pipeline: NAME.into(), seed: self.seed, steps: self.steps, eval, checkpoint }
    }

    /// Reads a table, which may omit keys; `origin` names it in errors.
    ///
    /// # Errors
    /// A key that does not exist, a value of the wrong type, a value outside its range.
    pub fn from_table(table: &Table, origin: &str) -> Result<Self, ConfigError> {
        let keys = Table::try_from(Sections::default()).expect("sections are tables");
        // Not by `serde(flatten)`: its buffer loses the key that a type error is about.
        let (own, shared): (Table, Table) = table.clone().into_iter().partition(|(key, _)| keys.contains_key(key));
        let config = Self::of(typed(shared, origin)?, typed(own, origin)?);
        config.validate()?;
        Ok(config)
    }

    /// Every key with its value.
    pub fn to_table(&self) -> Table {
        let mut table = Table::try_from(self.shared()).expect("a configuration is TOML");
        table.extend(Table::try_from(&self.own).expect("sections are tables"));
        table
    }

    /// Every key with its value as TOML text, in the order of the sections.
    pub fn to_toml(&self) -> String {
        let shared = toml::to_string_pretty(&self.shared()).expect("a configuration is TOML");
        let own = toml::to_string_pretty(&self.own).expect("a configuration is TOML");
        format!("{shared}\n{own}")
    }

    /// The weights of the loss.
    pub fn loss(&self) -> LossConfig {
        let SupervisionConfig { dssim, depth, velocity, reweight_clip, .. } = self.own.supervision;
        LossConfig { dssim, depth, velocity, reweight_clip }
    }

    /// The settings of the refinement.
    pub fn refinement(&self) -> RefinementConfig {
        let RefinementSection { passes, feedback } = self.own.refinement;
        let feedback = match feedback {
            FeedbackChoice::Raw => Feedback::Raw,
            FeedbackChoice::Largest => Feedback::Largest,
            FeedbackChoice::RootMeanSquare => Feedback::RootMeanSquare,
        };
        RefinementConfig { passes, feedback }
    }
}

impl LogsConfig {
    /// Frames from the begin of one snippet to that of the next, at least 1.
    pub fn spacing(&self) -> usize {
        match self.every {
            0 => self.frames.saturating_sub(OVERLAP).max(1),
            every => every,
        }
    }
}

impl LearningConfig {
    /// The rate of `step`, counted from 1, of `steps`.
    pub fn at(&self, step: usize, steps: usize) -> f64 {
        let rise = (step as f64 / self.warm_up.max(1) as f64).min(1.0);
        rise * crate::fit::schedule::exponential(self.rate, self.last_rate, step, steps)
    }
}

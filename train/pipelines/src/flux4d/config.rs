//! The configuration of Flux4D: the shared sections of any run, and those of a network over many logs.

use std::ops::Deref;

use gs_driving::OVERLAP;
use gs_models::flux4d::actors::ActorConfig;
use gs_models::flux4d::{Feedback, LossConfig, RefinementConfig};
use toml::Table;

use super::NAME;
use gs_train::config::{CheckpointConfig, ConfigError, Declared, EvalConfig, NOT_NEGATIVE, Only, POSITIVE, halves};
use gs_train::{choice, section};

section! {
    /// The sections of a network that is trained on driving logs.
    pub struct Sections {
        /// The driving logs and their snippets.
        logs: LogsConfig;
        /// Points to first Gaussians.
        lift: LiftSection;
        /// The sparse 3D UNet and the motion that it predicts.
        unet: UnetConfig;
        /// Passes of the network over one snippet.
        refinement: RefinementSection;
        /// The images that a snippet is compared with, and the weights of the loss.
        supervision: SupervisionConfig;
        /// The optimiser of the network.
        learning: LearningConfig;
        /// Moving objects of a reconstruction.
        actors: ActorsSection;
    }
}

section! {
    /// Moving objects of a reconstruction: clusters of the Gaussians that move (Algorithm 3).
    #[derive(Copy)]
    pub struct ActorsSection {
        // Of 20,000 points, merged in voxels, a car at 20 m has some 30, up to 0.6 m apart: the paper's 0.4 m and 10
        // points, which `flux4d/paper` has, are of unmerged ones and break it into pieces.
        /// Radius of the clustering, metres.
        radius: f64 = 0.8, in 0.01..=100.0;
        /// Gaussians within the radius, itself included, that make one the core of an actor.
        fewest: usize = 5, in 1..;
    }
}

impl ActorsSection {
    /// The configuration of the clustering.
    pub fn config(self) -> ActorConfig {
        ActorConfig { eps: self.radius, min_points: self.fewest, ..ActorConfig::default() }
    }
}

choice! {
    /// Cameras of a log.
    pub enum CameraChoice {
        /// The one that looks ahead, as in the paper.
        Front,
        /// All of the log.
        All,
    }
}

choice! {
    /// The logs that are held out.
    pub enum SplitChoice {
        /// One log in eight, the last ones by name.
        LastEighth,
        /// The paper's (C.1): ten logs of PandaSet, the first hundred by name of Argoverse 2.
        Paper,
    }
}

section! {
    /// The driving logs and their snippets.
    pub struct LogsConfig {
        /// Frames of a snippet. Of the first 11, every second is an input and the others are targets; those after them
        /// are the future, and targets too.
        frames: usize = 11, in 3..=300;
        /// Frames from the begin of one snippet to that of the next; 0: neighbours share 5 frames, as in the paper.
        every: usize = 0;
        /// The cameras.
        camera: CameraChoice = CameraChoice::Front;
        /// Width to which wider images are downscaled, pixels; 0: full size.
        max_width: usize = 320, in Only("0 or at least 16", |width| *width == 0 || *width >= 16);
        /// Logs that are held out; with none, `split` chooses them.
        validation: Vec<String> = Vec::new();
        /// The logs that are held out where `validation` names none.
        split: SplitChoice = SplitChoice::LastEighth;
        /// Snippets of each held-out log that are measured, spread evenly; 0: all.
        validation_snippets: usize = 2;
        /// Memory for snippets that were read, MB; those beyond are read again.
        cache_mb: usize = 512;
    }
}

choice! {
    /// First orientations of Gaussians.
    pub enum RotationChoice {
        /// Random (the paper): noise in four channels of the input.
        Random,
        /// None: the first Gaussians are isotropic.
        Identity,
    }
}

choice! {
    /// Velocities beside those of the network.
    pub enum VelocityChoice {
        /// None (the paper).
        Zero,
        /// Motion and rest that the sweeps show of points: they teach the network, whose velocities count elsewhere.
        Aligned,
    }
}

choice! {
    /// Voxels whose points are merged.
    pub enum MergeChoice {
        /// Growing with the root of the distance from the nearest input camera.
        Growing,
        /// The same everywhere.
        Equal,
    }
}

/// Most points: the maps of the convolutions number rows by 32 bits.
const POINTS_MAX: usize = 100_000_000;

section! {
    /// Points to first Gaussians.
    pub struct LiftSection {
        /// LiDAR points of a snippet for each camera of its inputs; beyond them, the points of a voxel in one sweep are
        /// merged. 0: no limit.
        points: usize = 50_000, in ..=POINTS_MAX;
        /// Edges of the voxels whose points are merged.
        merge: MergeChoice = MergeChoice::Growing;
        /// Whether points that no input image shows are left out.
        in_view: bool = true;
        /// Points on the sky's half sphere.
        sky_points: usize = 2000, in ..=POINTS_MAX;
        /// Random points in a ball around the scene.
        random_points: usize = 0, in ..=POINTS_MAX;
        /// First orientations.
        rotations: RotationChoice = RotationChoice::Identity;
        /// Velocities beside those of the network.
        velocity: VelocityChoice = VelocityChoice::Aligned;
    }
}

choice! {
    /// The network that corrects sky and random points.
    pub enum FarChoice {
        /// A small one of their own, point by point.
        Apart,
        /// The convolutions, as the rows of the scene (the paper).
        Voxels,
    }
}

section! {
    /// The sparse 3D UNet and the motion that it predicts.
    pub struct UnetConfig {
        /// Edge of the finest voxels, metres.
        voxel: f64 = 0.4, in 0.01..=100.0;
        /// Multiplier of all widths (32 to 256 channels).
        width: f64 = 0.25, in 0.01..=4.0;
        /// Degree of the polynomial of velocity, up to 3: 0 is constant velocity, 1 constant acceleration.
        degree: usize = 1, in 0..=3;
        /// The network that corrects sky and random points.
        far: FarChoice = FarChoice::Apart;
    }
}

choice! {
    /// The gradient as the next pass reads it.
    pub enum FeedbackChoice {
        /// As it is.
        Raw,
        /// Over each channel's largest magnitude.
        Largest,
        /// Over each channel's root mean square.
        RootMeanSquare,
    }
}

section! {
    /// Passes of the network over one snippet.
    pub struct RefinementSection {
        /// Passes, the base network's included; 1: no refinement.
        passes: usize = 3, in 1..=20;
        /// The gradient as the next pass reads it.
        feedback: FeedbackChoice = FeedbackChoice::RootMeanSquare;
    }
}

section! {
    /// The images that a snippet is compared with, and the weights of the loss.
    pub struct SupervisionConfig {
        /// Input images of a step; the gradient over these is fed back.
        input_views: usize = 2, in 1..;
        /// Images between the inputs of a step, and after them where snippets have a future.
        target_views: usize = 2;
        /// Weight of the LiDAR's depth, one over metres; 0: none.
        depth: f64 = LossConfig::default().depth, in NOT_NEGATIVE;
        /// Weight of the mean speed, windows per metre, of what neither moves nor rests by the sweeps; 0: none.
        velocity: f64 = LossConfig::default().velocity, in NOT_NEGATIVE;
        /// Weight of the mean difference of the network's velocities from those that the sweeps show, windows per
        /// metre, under `lift.velocity = "aligned"`.
        shown: f64 = LossConfig::default().shown, in NOT_NEGATIVE;
        /// Largest image velocity of the reweighting, pixels per frame; 0: no reweighting.
        reweight_clip: f64 = LossConfig::default().reweight_clip, in NOT_NEGATIVE;
    }
}

section! {
    /// The optimiser of the network.
    pub struct LearningConfig {
        /// Adam's rate after the warm-up.
        rate: f64 = 4e-3, in POSITIVE;
        /// Rate of the last step; in between the rate falls exponentially.
        last_rate: f64 = 2e-4, in POSITIVE;
        /// Steps in which the rate rises from 0.
        warm_up: usize = 10;
        /// Snippets whose gradients are averaged in a step.
        accumulate: usize = 1, in 1..;
        /// Change of a snippet's colours in each step, largest logarithm of gain and gamma; 0: none (the paper). More:
        /// other light and paint cost less, those of the training logs more.
        recolour: f64 = 0.0, in 0.0..=2.0;
    }
}

section! {
    /// The keys and sections that any run has.
    pub struct Shared {
        /// The pipeline's name.
        pipeline: String = NAME.into();
        /// The seed of all random draws.
        seed: u64 = 42;
        /// Optimisation steps.
        steps: usize = 300, in 1..;
        // MS-SSIM takes seconds a view on a CPU, as long as the network.
        /// When and how the network is measured.
        eval: EvalConfig = EvalConfig { ms_ssim: false, ..EvalConfig::default() };
        /// When the state is saved.
        checkpoint: CheckpointConfig = CheckpointConfig { every: 100, ..CheckpointConfig::default() };
    }
}

/// The whole configuration. It dereferences to what any run has.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FluxConfig {
    /// The keys and sections that any run has.
    pub shared: Shared,
    /// The pipeline's own sections.
    pub own: Sections,
}

impl Deref for FluxConfig {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.shared
    }
}

impl FluxConfig {
    /// Reads a table, which may omit keys; `origin` names it in errors.
    ///
    /// # Errors
    /// A key that does not exist, a value of the wrong type, a value outside its range.
    pub fn from_table(table: &Table, origin: &str) -> Result<Self, ConfigError> {
        let (shared, own): (Shared, Sections) = halves::read(table, origin)?;
        shared.check_ranges("")?;
        own.check_ranges("")?;
        Ok(Self { shared, own })
    }

    /// Every key with its value.
    pub fn to_table(&self) -> Table {
        halves::table(&self.shared, &self.own)
    }

    /// Every key with its value as TOML text, in the order of the sections.
    pub fn to_toml(&self) -> String {
        halves::text(&self.shared, &self.own)
    }

    /// The weights of the loss.
    pub fn loss(&self) -> LossConfig {
        let SupervisionConfig { depth, velocity, shown, reweight_clip, .. } = self.own.supervision;
        LossConfig { depth, velocity, shown, reweight_clip, ..LossConfig::default() }
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
        rise * gs_train::fit::schedule::exponential(self.rate, self.last_rate, step, steps)
    }
}

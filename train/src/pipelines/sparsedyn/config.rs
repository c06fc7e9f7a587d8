//! `[warmup]`, `[dynamics]`, `[curriculum]`, `[moving]` and `[bodies]`: the sections of the pipeline.

use gs_models::sparsedyn::{Ask, Integrator};
use serde::{Deserialize, Serialize};

use crate::config::{
    Config, ConfigError, DensityConfig, FitConfig, LossConfig, ModelConfig, OpacityPolicy, OptimiserConfig, Section,
    Strategy, check, full_width, not_negative, positive,
};

/// Weight of the mean opacity (paper, 4.1).
pub const LAMBDA_OPACITY: f64 = 1e-2;

/// Weight of the depth term (paper, 4.1).
pub const LAMBDA_DEPTH: f64 = 5e-3;

/// Weight of the outlines. First frames of three object sets, five cameras, by held-out ones: 24.7 dB at 0, 26.0 at 2, 26.4 at 5; of two, 26.0 at 5
/// and 24.2 at 20.
pub const LAMBDA_OUTLINE: f64 = 5.0;

/// The refinement of the first frame (section 3.2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WarmupConfig {
    /// Share of the run in which the first frame alone is fitted and nothing moves. Under the models `rollout` and `hybrid`, `density.stop` must not
    /// exceed it: a small fast object would vanish if Gaussians were pruned when it begins to move. The density control of `trace` and `freegave`
    /// goes on as their authors published it, but rests in the first 100 steps of motion.
    pub share: f64,
    /// Weight of the mean opacity in the warm-up (Eq. 5; paper: 1e-2). More leaves fewer Gaussians.
    pub opacity: f64,
    /// Weight of the difference between rendered and prior depth in the warm-up (Eq. 6; paper: 5e-3), per scene extent.
    pub depth: f64,
    /// Weight of the difference between rendered alpha and the outline of what stands before a plain background, in the warm-up, where there is such
    /// a background; 0: none. Without it, Gaussians of the background's colour stand in empty space and change no training photo.
    pub outline: f64,
}

impl Default for WarmupConfig {
    fn default() -> Self {
        Self { share: 0.2, opacity: LAMBDA_OPACITY, depth: 10.0 * LAMBDA_DEPTH, outline: LAMBDA_OUTLINE }
    }
}

/// What moves the Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionModel {
    /// The rollout of the dynamics field from the first frame (the paper).
    Rollout,
    /// The rollout, and a deformation field that corrects it while frames are seen.
    Hybrid,
    /// The baseline TRACE: a deformation field, and a dynamics field that is learned over one step at a time and asked for the future alone.
    Trace,
    /// The baseline FreeGave: as TRACE, with rigid motions of time mixed by a code of each Gaussian.
    Freegave,
}

/// The dynamics field (Eq. 3) and the rollout (Eq. 4 and 9).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DynamicsConfig {
    /// What moves the Gaussians.
    pub model: MotionModel,
    /// When the field is asked: at every stage of a step, once a step, or once at the start with accelerations that hold.
    pub ask: Ask,
    /// The integrator of a step.
    pub integrator: Integrator,
    /// Length of a step, frames (paper: 2).
    pub step_frames: f64,
    /// Sines and cosines of each input, at 2^0 to 2^(bands - 1).
    pub bands: usize,
    /// Units of a hidden layer.
    pub width: usize,
    /// Hidden layers.
    pub layers: usize,
    /// Rigid motions that codes mix under the model `freegave`, K (FreeGave: 16 for objects, 32 for rooms).
    pub bases: usize,
    /// Learning rate of the field at the first step after the warm-up.
    pub lr: f64,
    /// Learning rate of the field at the last step; exponential in between.
    pub lr_final: f64,
}

impl Default for DynamicsConfig {
    fn default() -> Self {
        Self {
            model: MotionModel::Rollout,
            ask: Ask::Start,
            integrator: Integrator::Screw,
            step_frames: 2.0,
            bands: 3,
            width: 64,
            layers: 3,
            bases: 16,
            lr: 5e-3,
            lr_final: 2e-5,
        }
    }
}

/// Progressive physics learning (section 3.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CurriculumConfig {
    /// Frames by which the window grows (Eq. 8; paper: 4); 0: all frames from the start.
    pub growth: usize,
    /// Steps from one growth to the next (Eq. 8; paper: 500); 0: by `short`.
    pub interval: usize,
    /// Share of the steps after the warm-up in which the window grows, where `interval` is 0.
    pub short: f64,
    /// Share of the draws from the growing window that are of its four newest frames; 0 (the paper): all its frames are drawn alike. A pendulum's
    /// future, five cameras: 20.6 dB at 0, 24.7 at 0.5, 23.8 at 0.8.
    pub newest: f64,
    /// First frame of the late horizon as a share of the frames seen (paper: 35 of 45); 0: the late horizon holds all frames.
    pub late: f64,
    /// Frames replayed in each step of the long-horizon phase (Eq. 10; paper: 4).
    pub replays: usize,
    /// Weight of their mean loss (Eq. 10; paper: 0.5).
    pub replay_weight: f64,
    /// Weight of the difference between rendered alpha and the outline of what stands before a plain background, as `warmup.outline`, in photos of
    /// all frames after the warm-up; 0: none. With 1, a chest that opens gains 1.6 dB of its future and a pendulum 0.7; a hollow body that spins, whose
    /// outline hardly changes, loses 2.6.
    pub outline: f64,
}

impl Default for CurriculumConfig {
    fn default() -> Self {
        Self {
            growth: 1,
            interval: 0,
            short: 0.5,
            newest: 0.5,
            late: 35.0 / 45.0,
            replays: 4,
            replay_weight: 0.5,
            outline: 0.0,
        }
    }
}

/// Which Gaussians may move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MovingConfig {
    /// Whether Gaussians without evidence of motion stay static; otherwise all may move.
    pub select: bool,
    /// Change of a pixel over the frames of a static camera above which something moves there, 0 to 1 of the brightest.
    pub change: f64,
    /// Share of the cameras in whose image a Gaussian lies that must see a change there.
    pub cameras: f64,
    /// Largest movement of a body over the seen frames, pixels of the training view that shows it largest, at which it is found to rest when bodies
    /// are looked for the last time; its Gaussians are static from then on.
    pub still_pixels: f64,
}

impl Default for MovingConfig {
    fn default() -> Self {
        Self { select: true, change: 0.06, cameras: 0.5, still_pixels: 2.0 }
    }
}

/// What moves Gaussians that may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyUse {
    /// Rigid bodies where there are any, the field for the rest.
    Both,
    /// Rigid bodies alone: a Gaussian of no body goes with the nearest one.
    Bodies,
    /// The field alone (the paper).
    Field,
}

/// Rigid bodies with laws of motion, beyond the paper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BodiesConfig {
    /// What moves Gaussians that may move.
    pub mode: BodyUse,
    /// Share of the steps after the warm-up at which bodies are first looked for in the paths of the field. Early: few frames say little of a
    /// motion, and a body is lost in the next ones. Late: a field that is followed long loses what swings.
    pub from: f64,
    /// How often bodies are looked for, from the first time until all frames are seen: what begins to move late is found late. At the last
    /// time, what rests becomes static.
    pub examinations: usize,
    /// Most parts into which a body is divided once all frames are seen; parts that moved alike are one body again when laws are chosen. 1 (default): bodies stay as
    /// they were found; more parts tell apart what was taken for one body, and follow noise where there is only one.
    pub parts: usize,
    /// Share of the steps after the warm-up at which each body's law is chosen; between the two, bodies follow a smooth free motion.
    pub select: f64,
    /// Share of the steps after the warm-up until which Gaussians are added and removed again, from 100 steps after laws are chosen on; 0: never.
    /// Surfaces that the first frame hides get their Gaussians then.
    pub regrow: f64,
    /// Largest distance of a Gaussian's path from its body's motion, pixels of the nearest training view.
    pub tolerance_pixels: f64,
    /// Share of a Gaussian's distance from where it began that is added to the tolerance.
    pub tolerance_share: f64,
    /// Most bodies.
    pub most: usize,
    /// Smallest share of a body among the Gaussians that move and have no body yet.
    pub share: f64,
    /// Frames from one knot of the free motion to the next.
    pub knot_frames: f64,
    /// Uncertainty of a body's pose, pixels: smaller misfits do not ask for a richer law.
    pub noise_pixels: f64,
    /// Learning rate of the laws' numbers when bodies are found, and again when laws are chosen, in body units (objects' size, radians, per unit
    /// of time).
    pub lr: f64,
    /// Learning rate at the last step; exponential in between.
    pub lr_final: f64,
}

impl Default for BodiesConfig {
    fn default() -> Self {
        Self {
            mode: BodyUse::Both,
            from: 0.14,
            examinations: 8,
            parts: 1,
            select: 0.7,
            regrow: 0.92,
            tolerance_pixels: 2.0,
            tolerance_share: 0.08,
            most: 12,
            share: 0.02,
            knot_frames: 4.0,
            noise_pixels: 0.5,
            lr: 4e-3,
            lr_final: 2e-5,
        }
    }
}

/// The sections that the pipeline adds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sections {
    /// The refinement of the first frame.
    pub warmup: WarmupConfig,
    /// The dynamics field and the rollout.
    pub dynamics: DynamicsConfig,
    /// Progressive physics learning.
    pub curriculum: CurriculumConfig,
    /// Which Gaussians may move.
    pub moving: MovingConfig,
    /// Rigid bodies with laws of motion.
    pub bodies: BodiesConfig,
}

impl Section for Sections {
    fn validate(&self, shared: &Config) -> Result<(), ConfigError> {
        full_width(shared)?;
        let Self { warmup, dynamics, curriculum, moving, bodies } = self;
        let share = |value: f64| (0.0..=1.0).contains(&value);
        check("warmup.share", warmup.share, (0.0..1.0).contains(&warmup.share), "at least 0 and below 1")?;
        check_density(shared, warmup, dynamics.model)?;
        check("warmup.opacity", warmup.opacity, not_negative(warmup.opacity), "0 or more")?;
        check("warmup.depth", warmup.depth, not_negative(warmup.depth), "0 or more")?;
        check("warmup.outline", warmup.outline, not_negative(warmup.outline), "0 or more")?;
        let step = (0.01..=100.0).contains(&dynamics.step_frames);
        check("dynamics.step_frames", dynamics.step_frames, step, "from 0.01 to 100")?;
        check("dynamics.bands", dynamics.bands, dynamics.bands <= 16, "from 0 to 16")?;
        check("dynamics.width", dynamics.width, (1..=4096).contains(&dynamics.width), "from 1 to 4096")?;
        check("dynamics.layers", dynamics.layers, (1..=32).contains(&dynamics.layers), "from 1 to 32")?;
        check("dynamics.bases", dynamics.bases, (1..=256).contains(&dynamics.bases), "from 1 to 256")?;
        check("dynamics.lr", dynamics.lr, positive(dynamics.lr), "positive")?;
        check("dynamics.lr_final", dynamics.lr_final, positive(dynamics.lr_final), "positive")?;
        check("curriculum.short", curriculum.short, share(curriculum.short), "from 0 to 1")?;
        check("curriculum.newest", curriculum.newest, share(curriculum.newest), "from 0 to 1")?;
        check("curriculum.late", curriculum.late, share(curriculum.late), "from 0 to 1")?;
        check("curriculum.replays", curriculum.replays, curriculum.replays <= 64, "from 0 to 64")?;
        let weight = not_negative(curriculum.replay_weight);
        check("curriculum.replay_weight", curriculum.replay_weight, weight, "0 or more")?;
        check("curriculum.outline", curriculum.outline, not_negative(curriculum.outline), "0 or more")?;
        check("moving.change", moving.change, share(moving.change), "from 0 to 1")?;
        check("moving.cameras", moving.cameras, share(moving.cameras), "from 0 to 1")?;
        check("moving.still_pixels", moving.still_pixels, not_negative(moving.still_pixels), "0 or more")?;
        check("bodies.from", bodies.from, share(bodies.from), "from 0 to 1")?;
        let select = (bodies.from..=1.0).contains(&bodies.select);
        check("bodies.select", bodies.select, select, "from bodies.from to 1")?;
        check("bodies.regrow", bodies.regrow, share(bodies.regrow), "from 0 to 1")?;
        check("bodies.examinations", bodies.examinations, (1..=1000).contains(&bodies.examinations), "from 1 to 1000")?;
        check("bodies.parts", bodies.parts, (1..=100).contains(&bodies.parts), "from 1 to 100")?;
        check("bodies.tolerance_pixels", bodies.tolerance_pixels, positive(bodies.tolerance_pixels), "positive")?;
        let tolerance = not_negative(bodies.tolerance_share);
        check("bodies.tolerance_share", bodies.tolerance_share, tolerance, "0 or more")?;
        check("bodies.most", bodies.most, (1..=1000).contains(&bodies.most), "from 1 to 1000")?;
        check("bodies.share", bodies.share, share(bodies.share), "from 0 to 1")?;
        check("bodies.knot_frames", bodies.knot_frames, bodies.knot_frames >= 1.0, "at least 1")?;
        check("bodies.noise_pixels", bodies.noise_pixels, positive(bodies.noise_pixels), "positive")?;
        check("bodies.lr", bodies.lr, positive(bodies.lr), "positive")?;
        check("bodies.lr_final", bodies.lr_final, positive(bodies.lr_final), "positive")
    }
}

/// First steps of motion in which density control rests under any model: as many as lie between two refinements of the baselines. Gaussians of a
/// fast object have just lost their colour to the background there, and would be taken for dead.
pub const RESTING_STEPS: usize = 100;

/// Checks that Gaussians are neither added nor pruned when motion begins.
fn check_density(shared: &Config, warmup: &WarmupConfig, model: MotionModel) -> Result<(), ConfigError> {
    let (density, steps) = (&shared.density, shared.steps as f64);
    if density.strategy == Strategy::None {
        return Ok(());
    }
    match model {
        MotionModel::Rollout | MotionModel::Hybrid => {
            let within = density.stop <= warmup.share;
            check("density.stop", density.stop, within, "at most warmup.share, since motion begins there")
        }
        MotionModel::Trace | MotionModel::Freegave => {
            let since = (density.stop * steps).ceil() - (warmup.share * steps).round();
            let prunes = density.prune_share > 0.0 && density.stop > warmup.share && since < RESTING_STEPS as f64;
            check(
                "density.stop",
                density.stop,
                !prunes,
                "outside the first 100 steps of motion where Gaussians are pruned",
            )
        }
    }
}

/// The recommended configuration.
pub fn defaults() -> FitConfig<Sections> {
    let base = Config::published();
    let shared = Config {
        pipeline: "sparsedyn".into(),
        steps: 6000,
        // Few views do not determine how a colour depends on the view.
        model: ModelConfig { sh_degree: 0, ..base.model },
        // Twice the published rate: held-out first frames of eight object sets, five cameras, gain 0.3 dB, and 0.25 dB at four times the rate.
        optimiser: OptimiserConfig { means_lr: 3.2e-4, means_lr_final: 3.2e-6, ..base.optimiser },
        // Opacity is weighted in the warm-up alone.
        loss: LossConfig { opacity_reg: 0.0, scale_reg: 0.0, ..base.loss },
        density: DensityConfig {
            strategy: Strategy::Default,
            cap: 20_000,
            start: 100,
            every: 50,
            // Before motion begins: a small fast object would vanish if its Gaussians were pruned then.
            stop: 0.19,
            prune_share: 0.05,
            min_opacity: 0.1,
            // The same first frames: 26.7 dB and 739 Gaussians at 1e-3, 26.9 and 1098 at 5e-4, 26.8 and 1496 at 3e-4, 26.0 and 427 without growth.
            gradient: 5e-4,
            opacity_policy: OpacityPolicy::None,
            ..base.density
        },
        ..base
    };
    FitConfig { shared, method: Sections::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(model: MotionModel, stop: f64, steps: usize) -> FitConfig<Sections> {
        let mut config = defaults();
        config.method.dynamics.model = model;
        (config.shared.density.stop, config.shared.steps) = (stop, steps);
        config
    }

    #[test]
    fn density_control_that_goes_on_while_things_move_is_the_baselines_alone() {
        for (model, refused) in [
            (MotionModel::Rollout, true),
            (MotionModel::Hybrid, true),
            (MotionModel::Trace, false),
            (MotionModel::Freegave, false),
        ] {
            let found = with(model, 0.375, 6000).validate();
            assert_eq!(found.is_err(), refused, "{model:?}: {found:?}");
            assert!(
                found
                    .err()
                    .is_none_or(|error| error.to_string().contains("`density.stop` must be at most warmup.share"))
            );
            with(model, 0.19, 6000).validate().expect("before motion");
        }
        let mut still = with(MotionModel::Rollout, 0.8, 6000);
        still.shared.density.strategy = Strategy::None;
        still.validate().expect("a count that never changes");
        // 0.2 of 6000 steps are 1200, and 0.21 of them 1260.
        let found = with(MotionModel::Trace, 0.21, 6000).validate().expect_err("pruned while objects begin to move");
        assert!(found.to_string().contains("outside the first 100 steps of motion"), "{found}");
    }
}

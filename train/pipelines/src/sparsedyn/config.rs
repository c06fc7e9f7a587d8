//! `[warmup]`, `[dynamics]`, `[curriculum]`, `[moving]` and `[bodies]`: the sections of the pipeline.

use gs_models::sparsedyn::{Ask, Integrator};

use gs_train::config::{
    ClassicConfig, Config, ConfigError, DensityConfig, FitConfig, LossConfig, ModelConfig, NOT_NEGATIVE, OpacityPolicy,
    OptimiserConfig, POSITIVE, SHARE, Section, Strategy, check, of_moving_scenes,
};
use gs_train::{choice, section};

/// Weight of the mean opacity (paper, 4.1).
pub const LAMBDA_OPACITY: f64 = 1e-2;

/// Weight of the depth term (paper, 4.1).
pub const LAMBDA_DEPTH: f64 = 5e-3;

/// Weight of the outlines. First frames of three object sets, five cameras, by held-out ones: 24.7 dB at 0, 26.0 at 2,
/// 26.4 at 5; of two, 26.0 at 5 and 24.2 at 20.
pub const LAMBDA_OUTLINE: f64 = 5.0;

section! {
    /// The refinement of the first frame (section 3.2).
    pub struct WarmupConfig {
        /// Share of the run in which the first frame alone is fitted. Under `rollout` and `hybrid` at least
        /// `density.stop`, or a small fast object is pruned when it begins to move; under the baselines, density
        /// control rests in the first 100 steps of motion.
        share: f64 = 0.2, in 0.0..1.0;
        /// Weight of the mean opacity (Eq. 5; paper: 1e-2). More leaves fewer Gaussians.
        opacity: f64 = LAMBDA_OPACITY, in NOT_NEGATIVE;
        /// Weight of the difference between rendered and prior depth (Eq. 6; paper: 5e-3), per scene extent.
        depth: f64 = 10.0 * LAMBDA_DEPTH, in NOT_NEGATIVE;
        /// Weight of the difference between rendered alpha and the outline before a plain background. Without it,
        /// Gaussians of the background's colour stand in empty space.
        outline: f64 = LAMBDA_OUTLINE, in NOT_NEGATIVE;
    }
}

choice! {
    /// The model of motion.
    pub enum MotionModel {
        /// The dynamics field, rolled out from the first frame (the paper).
        Rollout,
        /// The rollout, corrected by a deformation field while frames are seen.
        Hybrid,
        /// The baseline TRACE: a deformation field; a dynamics field for the future alone.
        Trace,
        /// The baseline FreeGave: as TRACE, with rigid motions mixed by a code of each Gaussian.
        Freegave,
    }
}

choice! {
    /// When a rollout asks the field.
    pub enum AskChoice {
        /// At every stage of a step (the paper).
        Stage,
        /// Once a step; accelerations hold over the step.
        Step,
        /// Once, at the start; accelerations hold for good.
        Start,
    }
}

impl From<AskChoice> for Ask {
    fn from(choice: AskChoice) -> Self {
        match choice {
            AskChoice::Stage => Self::Stage,
            AskChoice::Step => Self::Step,
            AskChoice::Start => Self::Start,
        }
    }
}

choice! {
    /// The integrator of a step.
    pub enum IntegratorChoice {
        /// The explicit midpoint rule (the paper).
        Rk2,
        /// The classical Runge-Kutta method.
        Rk4,
        /// The exponential of the twist in the middle of the step: exact while the twist is constant.
        Screw,
    }
}

impl From<IntegratorChoice> for Integrator {
    fn from(choice: IntegratorChoice) -> Self {
        match choice {
            IntegratorChoice::Rk2 => Self::Rk2,
            IntegratorChoice::Rk4 => Self::Rk4,
            IntegratorChoice::Screw => Self::Screw,
        }
    }
}

section! {
    /// The dynamics field (Eq. 3) and the rollout (Eq. 4 and 9).
    pub struct DynamicsConfig {
        /// The model of motion.
        model: MotionModel = MotionModel::Rollout;
        /// When the field is asked.
        ask: AskChoice = AskChoice::Start;
        /// The integrator of a step.
        integrator: IntegratorChoice = IntegratorChoice::Screw;
        /// Length of a step, frames (paper: 2).
        step_frames: f64 = 2.0, in 0.01..=100.0;
        /// Sines and cosines of each input, at 2^0 to 2^(bands - 1).
        bands: usize = 3, in 0..=16;
        /// Units of a hidden layer.
        width: usize = 64, in 1..=4096;
        /// Hidden layers.
        layers: usize = 3, in 1..=32;
        /// Rigid motions that codes mix under the model `freegave`, K (FreeGave: 16 for objects, 32 for rooms).
        bases: usize = 16, in 1..=256;
        /// Learning rate of the field at the first step after the warm-up.
        lr: f64 = 5e-3, in POSITIVE;
        /// The same at the last step; exponential in between.
        lr_final: f64 = 2e-5, in POSITIVE;
    }
}

section! {
    /// Progressive physics learning (section 3.3).
    pub struct CurriculumConfig {
        /// Frames by which the window grows (Eq. 8; paper: 4); 0: all frames from the start.
        growth: usize = 1;
        /// Steps from one growth to the next (Eq. 8; paper: 500); 0: by `short`.
        interval: usize = 0;
        /// Share of the steps after the warm-up in which the window grows, where `interval` is 0.
        short: f64 = 0.5, in SHARE;
        // A pendulum's future, five cameras: 20.6 dB at 0, 24.7 at 0.5, 23.8 at 0.8.
        /// Share of the draws from the growing window that are of its four newest frames; 0: all alike (the paper).
        newest: f64 = 0.5, in SHARE;
        /// Share of the replayed frames that are the first; 0: all alike (the paper).
        first: f64 = 0.25, in SHARE;
        /// First frame of the late horizon as a share of the frames seen (paper: 35 of 45); 0: all frames.
        late: f64 = 35.0 / 45.0, in SHARE;
        /// Frames replayed in each step of the long-horizon phase (Eq. 10; paper: 4).
        replays: usize = 4, in 0..=64;
        /// Weight of their mean loss (Eq. 10; paper: 0.5).
        replay_weight: f64 = 0.5, in NOT_NEGATIVE;
    }
}

section! {
    /// The Gaussians that may move.
    pub struct MovingConfig {
        /// Whether Gaussians without evidence of motion stay static; otherwise all may move.
        select: bool = true;
        /// Movement of a resting body, pixels of the training view that shows it largest: a root mean square over the
        /// seen frames.
        still_pixels: f64 = 1.0, in NOT_NEGATIVE;
    }
}

choice! {
    /// The use of bodies.
    pub enum BodyUse {
        /// Bodies.
        Bodies,
        /// The field alone (the paper).
        Field,
    }
}

section! {
    /// Rigid bodies with laws of motion, beyond the paper.
    pub struct BodiesConfig {
        /// The use of rigid bodies.
        mode: BodyUse = BodyUse::Bodies;
        // At 0.05 a tube that bends gains 2 dB, and a block and a spinner that move alike for five frames are one body.
        /// Share of the steps after the warm-up at which bodies are looked for. Early: few frames say little of a
        /// motion. Late: a field that is followed long loses what swings.
        from: f64 = 0.14, in SHARE;
        /// Share of the steps after the warm-up at which each body's law is chosen; before, bodies follow a smooth free
        /// motion.
        select: f64 = 0.7;
        /// Share of the steps after the warm-up until which Gaussians are added and removed again, for surfaces that
        /// the first frame hides; 0: never.
        regrow: f64 = 0.92, in SHARE;
        /// Frames from one knot of the free motion to the next.
        knot_frames: f64 = 4.0, in 1.0..;
        /// Uncertainty of a body's pose, pixels: smaller misfits do not ask for a richer law.
        noise_pixels: f64 = 0.3, in POSITIVE;
        /// Most nodes that bend a body until it gets its law; 0 or 1: bodies are rigid.
        nodes: usize = 24, in 0..=256;
        // A tube that bends, five cameras, seen times at held-out ones: 21.5 dB at 1e-1, 24.9 at 1e-2, 31.0 at 1e-3,
        // 31.2 at 1e-4.
        /// Weight of the strain between neighbouring nodes, in pixels.
        strain: f64 = 1e-3, in NOT_NEGATIVE;
        /// Learning rate of the laws' numbers when bodies are found and when laws are chosen, in body units.
        lr: f64 = 4e-3, in POSITIVE;
    }
    also check_times;
}

section! {
    /// The sections that the pipeline adds.
    pub struct Sections {
        /// The refinement of the first frame.
        warmup: WarmupConfig;
        /// The dynamics field and the rollout.
        dynamics: DynamicsConfig;
        /// Progressive physics learning.
        curriculum: CurriculumConfig;
        /// The Gaussians that may move.
        moving: MovingConfig;
        /// Rigid bodies with laws of motion.
        bodies: BodiesConfig;
    }
}

impl Section for Sections {
    fn check_beside(&self, shared: &Config) -> Result<(), ConfigError> {
        let camera = &shared.camera;
        check("camera.motion", camera.motion, camera.motion == 0, "0 in sparsedyn")?;
        check("camera.refine", camera.refine, !camera.refine, "false in sparsedyn")?;
        of_moving_scenes(shared)?;
        check_density(shared, &self.warmup, self.dynamics.model)
    }
}

fn check_times(bodies: &BodiesConfig) -> Result<(), ConfigError> {
    let in_order = (bodies.from..=1.0).contains(&bodies.select);
    check("bodies.select", bodies.select, in_order, "from bodies.from to 1")
}

/// First steps of motion in which density control rests under any model: as many as lie between two refinements of the
/// baselines. Gaussians of a fast object have just lost their colour to the background there, and would be taken for
/// dead.
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
        // Twice the published rate: held-out first frames of eight object sets, five cameras, gain 0.3 dB, and 0.25 dB
        // at four times the rate.
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
            // The same first frames: 26.7 dB and 739 Gaussians at 1e-3, 26.9 and 1098 at 5e-4, 26.8 and 1496 at 3e-4,
            // 26.0 and 427 without growth.
            default: ClassicConfig { gradient: 5e-4, opacity_policy: OpacityPolicy::None, ..base.density.default },
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

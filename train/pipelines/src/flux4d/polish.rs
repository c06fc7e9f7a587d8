//! Polish (`gsburn reconstruct --polish STEPS`, beyond the paper): Adam on the Gaussians and velocities of one snippet.
//!
//! The loss is that of the training over the snippet's input images: L1, SSIM, LiDAR depth, reweighting, and the
//! difference from the velocities that were found. The frames between the inputs take no part; they are rendered before
//! and after to say what the polish is worth. A row that rests before it rests afterwards.

use std::time::Instant;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use gs_burn::NamedGradients;
use gs_burn::adam::AdamRate;
use gs_driving::DrivingLog;
use gs_models::flux4d::channels::{CHANNELS, COLOR, OPACITY, POSITION, QUATERNION, SCALE};
use gs_models::flux4d::{LossConfig, SnippetFrame, TargetView};
use rand::seq::index;
use serde::Serialize;

use super::config::FluxConfig;
use super::evaluate::color;
use super::infer::Inferred;
use super::prepare::HostSnippet;
use super::sample::{camera, photo, target};
use gs_train::fit::parameters::from_host;
use gs_train::fit::random::{Purpose, stream};
use gs_train::fit::schedule::exponential;
use gs_train::fit::training::Training;
use gs_train::run::interrupt;
use gs_train::run::metrics::psnr;
use gs_train::run::progress::Progress;

/// The rate of the first step by parameter, in its unit per step: metres for positions and metres per window for
/// velocities, raw channels for the others. A hundred steps move a Gaussian by some centimetres.
const RATES: [(&str, f64); 6] =
    [("positions", 2e-3), ("quats", 2e-3), ("scales", 1e-2), ("opacities", 3e-2), ("colors", 2e-2), (VELOCITY, 5e-3)];
/// The parameter whose gradient is masked.
const VELOCITY: &str = "velocity";
/// Rates fall exponentially to this share: the last steps settle what images of different times disagree on.
const LAST_SHARE: f64 = 0.1;

/// The result of a polish.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Polished {
    /// Steps taken; fewer than asked for after Ctrl-C.
    pub steps: usize,
    /// Steps asked for.
    pub steps_asked: usize,
    /// Steps whose loss or gradient was not finite; they changed nothing.
    pub skipped: usize,
    /// Seconds of the steps, without the measurements before and after.
    pub seconds: f64,
    /// Loss over all input images before and after.
    pub loss: [f64; 2],
    /// Mean PSNR of the frames between the inputs before and after, dB; none without such frames.
    pub psnr: Option<[f64; 2]>,
}

/// The parameters, outside autodiff between steps.
#[derive(Module, Debug)]
struct Parameters {
    /// `[N, 3]`, metres.
    positions: Param<Tensor<2>>,
    /// `[N, 4]`.
    quats: Param<Tensor<2>>,
    /// `[N, 3]`, raw.
    scales: Param<Tensor<2>>,
    /// `[N, 1]`, raw.
    opacities: Param<Tensor<2>>,
    /// `[N, 3]`, raw.
    colors: Param<Tensor<2>>,
    /// `[N, 3 (l + 1)]`, metres per window.
    velocity: Param<Tensor<2>>,
}

impl Parameters {
    fn new(raw: &Tensor<2>, velocity: &Tensor<2>) -> Self {
        let part = |channels: std::ops::Range<usize>| {
            Param::from_tensor(raw.clone().inner().narrow(1, channels.start, channels.len()))
        };
        Self {
            positions: part(POSITION),
            quats: part(QUATERNION),
            scales: part(SCALE),
            opacities: part(OPACITY),
            colors: part(COLOR),
            velocity: Param::from_tensor(velocity.clone().inner()),
        }
    }

    /// `[N, 14]`.
    fn raw(&self) -> Tensor<2> {
        let parts = [&self.positions, &self.quats, &self.scales, &self.opacities, &self.colors];
        let raw = Tensor::cat(parts.map(|part| part.val()).to_vec(), 1);
        debug_assert_eq!(raw.dims()[1], CHANNELS);
        raw
    }
}

/// Polishes what a network says of a snippet by `steps` steps, or fewer after Ctrl-C; `None` and no change with 0
/// steps.
pub fn polish(
    inferred: &mut Inferred,
    host: &HostSnippet,
    log: &DrivingLog,
    config: &FluxConfig,
    steps: usize,
    device: &Device,
) -> Option<Polished> {
    if steps == 0 {
        return None;
    }
    let views: Vec<TargetView> = host.inputs.iter().map(|view| target(log, view, device)).collect();
    let frame = inferred.sample.frame.around(inferred.velocity.clone());
    // Velocities that were found are kept to, and not to rest.
    let speed = if frame.shown.is_some() { 0.0 } else { config.loss().velocity };
    let weights = LossConfig { velocity: speed, ..config.loss() };
    let of_inputs = |inferred: &Inferred| {
        let (raw, velocity) = (inferred.raw.clone(), inferred.velocity.clone());
        frame.loss(raw, velocity, &views, &weights).into_scalar::<f64>()
    };
    let (loss, seen) = (of_inputs(inferred), psnr_between(inferred, host, log));
    let begun = Instant::now();
    let mut polish = Polish::new(inferred, steps);
    let mut progress = Progress::new(0, steps, false);
    progress.say(&format!("polishing {}", host.name));
    while polish.training.step < steps && !interrupt::asked() {
        let step = polish.training.step + 1;
        let count = config.own.supervision.input_views.min(views.len());
        let mut random = stream(config.seed, Purpose::Polish, step as u64);
        let drawn = index::sample(&mut random, views.len(), count).into_iter().map(|place| views[place].clone());
        let loss = polish.step(&frame, &drawn.collect::<Vec<_>>(), &weights);
        progress.step(step, loss as f32, None, &[("Gaussians", host.rows.times.len() as f64)]);
    }
    progress.finish();
    let seconds = begun.elapsed().as_secs_f64();
    let training = polish.training;
    (inferred.raw, inferred.velocity) = (training.module().raw(), training.module().velocity.val());
    let psnr = seen.zip(psnr_between(inferred, host, log)).map(|(before, after)| [before, after]);
    Some(Polished {
        steps: training.step,
        steps_asked: steps,
        skipped: training.skipped,
        seconds,
        loss: [loss, of_inputs(inferred)],
        psnr,
    })
}

/// A polish under way.
struct Polish {
    training: Training<Parameters>,
    /// `[N, 1]`, 1 for the rows that may move.
    moves: Tensor<2>,
    /// Steps asked for.
    steps: usize,
}

impl Polish {
    fn new(inferred: &Inferred, steps: usize) -> Self {
        let training = Training::new(Parameters::new(&inferred.raw, &inferred.velocity));
        Self { training, moves: moves(inferred), steps }
    }

    /// One step over some input views; returns its loss. A step that is not finite changes nothing.
    fn step(&mut self, frame: &SnippetFrame, views: &[TargetView], weights: &LossConfig) -> f64 {
        self.training.step += 1;
        let tracked = self.training.module().clone().train();
        let loss = frame.loss(tracked.raw(), tracked.velocity.val(), views, weights);
        let value: f64 = loss.clone().inner().into_scalar();
        let mut graph = loss.backward();
        let mut gradients = NamedGradients::take(&tracked, &mut graph);
        drop((tracked, graph));
        if !value.is_finite() || !gradients.all_finite() {
            self.training.skipped += 1;
            return value;
        }
        if let Some(gradient) = gradients.remove(VELOCITY) {
            gradients.insert(VELOCITY, gradient * self.moves.clone());
        }
        let step = self.training.step;
        self.training.update(gradients, |path| {
            let (_, first) = RATES.iter().find(|(name, _)| *name == path)?;
            Some(AdamRate::new(exponential(*first, LAST_SHARE * first, step, self.steps)))
        });
        value
    }
}

/// `[N, 1]`, 1 for the rows that may move: those of a velocity, or all but far ones where the network alone was asked.
fn moves(inferred: &Inferred) -> Tensor<2> {
    let sample = &inferred.sample;
    if sample.frame.shown.is_some() {
        return inferred.velocity.clone().abs().max_dim(1).greater_elem(0.0).float();
    }
    let rows = sample.lifted.raw.dims()[0];
    let near = rows - sample.lifted.far;
    let column = (0..rows).map(|row| if row < near { 1.0 } else { 0.0 }).collect();
    from_host(column, 1, &sample.lifted.raw.device())
}

/// Mean PSNR of the frames between the inputs, dB.
fn psnr_between(inferred: &Inferred, host: &HostSnippet, log: &DrivingLog) -> Option<f64> {
    let device = inferred.raw.device();
    let of_view = |view| {
        let image = color(inferred, &inferred.raw, &inferred.velocity, (&camera(log, view, &device), view.time));
        psnr(image, photo(view, &device))
    };
    let sum: f64 = host.targets.iter().map(of_view).sum();
    (!host.targets.is_empty()).then(|| sum / host.targets.len() as f64)
}

//! One optimisation step: the passes of a snippet with their own backwards, gradients added up, Adam.

use anyhow::Result;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use gs_burn::NamedGradients;
use gs_burn::adam::AdamRate;
use gs_models::flux4d::FluxError;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::config::FluxConfig;
use super::feed::Drawn;
use super::logs::{Logs, Place};
use super::network::FluxNetwork;
use super::prepare::{HostSnippet, HostView};
use super::sample::{Sample, Supervision, target};
use crate::fit::random::{Purpose, stream};
use crate::fit::training::Training;
use crate::sentence::one_sentence;

/// What a step tells its observers.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepReport {
    /// Mean loss after the last pass over the snippets used; not finite where none was.
    pub loss: f32,
    /// Gaussians of the last snippet.
    pub gaussians: usize,
    /// Finest voxels of the last snippet.
    pub voxels: usize,
}

/// Why a snippet contributed nothing.
pub type Unusable = String;

/// What a snippet that was used tells.
#[derive(Debug, Clone, Copy)]
pub struct Used {
    /// Loss after the last pass.
    pub loss: f64,
    /// Gaussians.
    pub gaussians: usize,
    /// Finest voxels.
    pub voxels: usize,
}

/// Data, configuration and device of a training.
pub type Setting<'a> = (&'a Logs, &'a FluxConfig, &'a Device);

/// One step over some snippets; `say` is told why one was skipped.
pub fn step(
    training: &mut Training<FluxNetwork>,
    snippets: &[Drawn],
    setting: Setting,
    say: &mut dyn FnMut(&str),
) -> StepReport {
    let tracked = training.module().clone().train();
    let mut sum = None::<NamedGradients>;
    let mut outcomes = Vec::new();
    for drawn in snippets {
        let outcome = contribution(&tracked, drawn, setting).map(|(found, used)| {
            match &mut sum {
                Some(sum) => sum.add(found),
                None => sum = Some(found),
            }
            used
        });
        outcomes.push(outcome);
    }
    drop(tracked);
    finish(training, sum.unwrap_or_default(), snippets.len(), &outcomes, setting.1, say)
}

/// Ends a step with the sum of the gradients, of which `count` make the mean. A skipped snippet contributes zeros to the mean;
/// a step without any other changes nothing.
pub fn finish(
    training: &mut Training<FluxNetwork>,
    sum: NamedGradients,
    count: usize,
    outcomes: &[Result<Used, Unusable>],
    config: &FluxConfig,
    say: &mut dyn FnMut(&str),
) -> StepReport {
    training.step += 1;
    for reason in outcomes.iter().filter_map(|outcome| outcome.as_ref().err()) {
        training.skipped += 1;
        say(&format!("a snippet of step {} was skipped: {reason}", training.step));
    }
    let used: Vec<&Used> = outcomes.iter().filter_map(|outcome| outcome.as_ref().ok()).collect();
    let Some(last) = used.last() else {
        return StepReport { loss: f32::NAN, ..StepReport::default() };
    };
    let loss = used.iter().map(|used| used.loss).sum::<f64>() / used.len() as f64;
    let mut mean = NamedGradients::default();
    for (path, table) in sum.iter() {
        mean.insert(path, table.clone() / count as f64);
    }
    drop(sum);
    let rate = AdamRate { eps: ADAM_EPS, ..AdamRate::new(config.own.learning.at(training.step, config.steps)) };
    training.update(mean, |_| Some(rate));
    StepReport { loss: loss as f32, gaussians: last.gaussians, voxels: last.voxels }
}

/// The gradients of one snippet by the leaves of `tracked`, summed over its passes.
///
/// # Errors
/// Why the snippet cannot be used.
pub fn contribution(
    tracked: &FluxNetwork,
    drawn: &Drawn,
    (logs, config, device): Setting,
) -> Result<(NamedGradients, Used), Unusable> {
    let host = drawn.prepared.as_ref().map_err(Clone::clone)?;
    let mut random = stream(config.seed, Purpose::Supervision, drawn.draw as u64);
    let sample = Sample::new(host, config, device).map_err(|error| one_sentence(&error))?;
    let supervision = supervised(host, &sample, (logs, &drawn.place, config), &mut random, device)?;
    let found = gradients(tracked, &sample, &supervision, config);
    let (gradients, loss) = found.map_err(|error| format!("{}: {error}", host.name))?;
    Ok((gradients, Used { loss, gaussians: sample.lifted.raw.dims()[0], voxels: sample.pyramid.voxels(0) }))
}

/// Adam's epsilon, Burn's and PyTorch's default: gradients of a network are not as tiny as those of single Gaussians.
const ADAM_EPS: f64 = 1e-8;

/// The gradients of one snippet and its loss after the last pass.
fn gradients(
    tracked: &FluxNetwork,
    sample: &Sample,
    supervision: &Supervision,
    config: &FluxConfig,
) -> Result<(NamedGradients, f64), FluxError> {
    let mut sum = NamedGradients::default();
    let mut surrogate = |scalar: Tensor<1>| {
        let mut graph = scalar.backward();
        sum.add(NamedGradients::take(tracked, &mut graph));
    };
    let (raw, times) = (sample.lifted.raw.clone(), sample.lifted.times.clone());
    let refined =
        tracked.bound(sample, config, |refinement| refinement.train(raw, times, supervision, &mut surrogate))?;
    let passes = refined.losses.len();
    if !sum.all_finite() {
        return Err(FluxError::NotFinite { what: "the gradient of the network", pass: passes.saturating_sub(1) });
    }
    Ok((sum, refined.losses.last().copied().unwrap_or(f64::NAN)))
}

/// The views of a step, drawn at random.
fn supervised<'a>(
    host: &HostSnippet,
    sample: &'a Sample,
    (logs, place, config): (&Logs, &Place, &FluxConfig),
    random: &mut ChaCha8Rng,
    device: &Device,
) -> Result<Supervision<'a>, Unusable> {
    let log = &logs.logs[place.log];
    let mut drawn = |views: Vec<&HostView>, count: usize| {
        let mut places = index::sample(random, views.len(), count.min(views.len())).into_vec();
        places.sort_unstable();
        places.into_iter().map(|place| target(log, views[place], device)).collect::<Vec<_>>()
    };
    let (inputs, targets) = (config.own.supervision.input_views, config.own.supervision.target_views);
    // C.2: of a snippet with a future, its frames are targets too.
    let (given, held_out) = (host.inputs.iter().collect(), host.targets.iter().chain(&host.future).collect());
    let (inputs, found) = (drawn(given, inputs), drawn(held_out, targets));
    if targets > 0 && found.is_empty() {
        return Err(format!("snippet {}: expected a target image that shows something, found none", host.name));
    }
    Ok(Supervision { frame: &sample.frame, inputs, targets: found, loss: config.loss() })
}

#[cfg(test)]
mod tests {
    use gs_worlds::driving::{StreetOptions, write};

    use super::*;
    use crate::pipelines::flux4d::prepare::prepare;

    /// C.2: of 16 frames, six are inputs and ten are targets, the five after the last input among them.
    #[test]
    fn the_future_is_trained_on() {
        let temporary = tempfile::tempdir().expect("a folder");
        let small =
            StreetOptions { cameras: 1, width: 32, height: 18, beams: 8, columns: 180, ..StreetOptions::default() };
        write(temporary.path(), &StreetOptions { frames: 16, subpixels: 1, ..small }, |_, _| {}).expect("written");
        let mut config = FluxConfig::default();
        config.own.logs.frames = 16;
        config.own.supervision.target_views = 10;
        let logs = Logs::open(temporary.path(), &config.own.logs).expect("a log");
        let place = &logs.train[0];
        let host = prepare(&logs.logs[0], &place.snippet, "street", &config.own.lift, config.seed).expect("a snippet");
        let device = Device::default();
        let sample = Sample::new(&host, &config, &device).expect("a sample");
        let mut random = stream(config.seed, Purpose::Supervision, 0);
        let supervision =
            supervised(&host, &sample, (&logs, place, &config), &mut random, &device).expect("views of the snippet");
        assert_eq!((supervision.targets.len(), host.targets.len(), host.future.len()), (10, 5, 5));
        assert_eq!(supervision.targets.iter().filter(|view| view.time > 1.0).count(), 5);
    }
}

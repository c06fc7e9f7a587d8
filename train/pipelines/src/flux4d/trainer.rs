//! One optimisation step: the passes of each snippet with their own backwards, gradients added up, Adam.
//!
//! The loop is our own. burn-train (0.22.1) resumes at the first item of an epoch and saves at its last, so that a
//! training does not go on in the middle of one with the same bits. Its step returns the gradients of one backward of
//! Burn's graph and its optimiser takes all of them, so that neither the passes of a snippet, each with a backward
//! whose graph is freed before the next, nor a snippet without any has a place. Burn's `all_reduce` exists on CUDA
//! alone and adds in no fixed order; here several devices send their gradients to the first one, which adds them in the
//! order of the draws, so that the bits are those of one device.

use std::thread;

use anyhow::Result;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use gs_burn::NamedGradients;
use gs_burn::adam::AdamRate;
use gs_driving::DrivingLog;
use gs_models::flux4d::FluxError;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use super::config::FluxConfig;
use super::feed::Drawn;
use super::host_view::HostView;
use super::logs::Logs;
use super::network::FluxNetwork;
use super::prepare::HostSnippet;
use super::sample::{Sample, Supervision, target};
use gs_train::fit::random::{Purpose, stream};
use gs_train::fit::training::Training;
use gs_train::sentence::one_sentence;

/// Adam's epsilon, Burn's and PyTorch's default: gradients of a network are not as tiny as those of single Gaussians.
const ADAM_EPS: f64 = 1e-8;

/// The report of a step to its observers.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepReport {
    /// Mean loss after the last pass over the snippets used; not finite where none was.
    pub loss: f32,
    /// Gaussians of the last snippet.
    pub gaussians: usize,
    /// Finest voxels of the last snippet.
    pub voxels: usize,
}

/// Data, configuration and devices of a training.
#[derive(Debug, Clone, Copy)]
pub struct Setup<'a> {
    /// The logs.
    pub logs: &'a Logs,
    /// The configuration.
    pub config: &'a FluxConfig,
    /// The devices that share a step (without autodiff); the first one holds the training.
    pub devices: &'a [Device],
}

/// A snippet that was used: its gradients by path, and what it tells.
struct Contribution {
    gradients: NamedGradients,
    /// Loss after the last pass.
    loss: f64,
    gaussians: usize,
    /// Finest voxels.
    voxels: usize,
}

/// One step over some snippets, which the devices share; `say` is told why one was skipped. A skipped snippet
/// contributes zeros to the mean of the gradients; a step without any other changes nothing.
pub fn step(
    training: &mut Training<FluxNetwork>,
    snippets: &[Drawn],
    setup: Setup,
    say: &mut dyn FnMut(&str),
) -> StepReport {
    training.step += 1;
    let network = training.module();
    let networks: Vec<_> = setup.devices.iter().map(|device| network.clone().to_device(device).train()).collect();
    let mut sum = NamedGradients::default();
    let (mut losses, mut report) = (Vec::new(), StepReport { loss: f32::NAN, ..StepReport::default() });
    for snippets in snippets.chunks(networks.len()) {
        for found in contributions(&networks, snippets, setup) {
            match found {
                Ok(Contribution { gradients, loss, gaussians, voxels }) => {
                    sum.add(gradients.to_device(&setup.devices[0]));
                    losses.push(loss);
                    (report.gaussians, report.voxels) = (gaussians, voxels);
                }
                Err(reason) => {
                    training.skipped += 1;
                    say(&format!("a snippet of step {} was skipped: {reason}", training.step));
                }
            }
        }
    }
    // Nobody else may hold a tensor that is to be updated in place.
    drop(networks);
    if !losses.is_empty() {
        report.loss = (losses.iter().sum::<f64>() / losses.len() as f64) as f32;
        update(training, sum, snippets.len(), setup.config);
    }
    report
}

/// One Adam update by the mean of `count` gradients.
fn update(training: &mut Training<FluxNetwork>, sum: NamedGradients, count: usize, config: &FluxConfig) {
    let mut mean = NamedGradients::default();
    for (path, table) in sum.iter() {
        mean.insert(path, table.clone() / count as f64);
    }
    drop(sum);
    let rate = AdamRate { eps: ADAM_EPS, ..AdamRate::new(config.own.learning.at(training.step, config.steps)) };
    training.update(mean, |_| Some(rate));
}

/// The contributions of as many snippets as there are networks at most, in their order: each snippet on the device of a
/// network.
fn contributions(networks: &[FluxNetwork], snippets: &[Drawn], setup: Setup) -> Vec<Result<Contribution, String>> {
    let contribution = |network: FluxNetwork, drawn, device| contribution(&network, drawn, setup, device);
    let mut pairs = networks.iter().cloned().zip(snippets).zip(setup.devices);
    let Some(((network, drawn), device)) = pairs.next() else { return Vec::new() };
    thread::scope(|scope| {
        let others: Vec<_> =
            pairs.map(|((network, drawn), device)| scope.spawn(move || contribution(network, drawn, device))).collect();
        // On this thread, to which a profile belongs.
        let mut found = vec![contribution(network, drawn, device)];
        found.extend(
            others.into_iter().map(|other| other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))),
        );
        found
    })
}

/// The gradients of one snippet by the leaves of `tracked`, summed over its passes.
///
/// # Errors
/// Why the snippet cannot be used.
fn contribution(
    tracked: &FluxNetwork,
    drawn: &Drawn,
    Setup { logs, config, .. }: Setup,
    device: &Device,
) -> Result<Contribution, String> {
    let host = drawn.prepared.as_ref().map_err(Clone::clone)?;
    let mut random = stream(config.seed, Purpose::Supervision, drawn.draw as u64);
    let sample = Sample::new(host, config, device).map_err(|error| one_sentence(&error))?;
    let supervision = supervised(host, &sample, &logs.logs[drawn.place.log], config, &mut random)?;
    let found = gradients(tracked, &sample, &supervision, config);
    let (gradients, loss) = found.map_err(|error| format!("{}: {error}", host.name))?;
    Ok(Contribution { gradients, loss, gaussians: sample.lifted.raw.dims()[0], voxels: sample.pyramid.voxels(0) })
}

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
    log: &DrivingLog,
    config: &FluxConfig,
    random: &mut ChaCha8Rng,
) -> Result<Supervision<'a>, String> {
    let device = sample.lifted.raw.device();
    let mut drawn = |views: Vec<&HostView>, count: usize| {
        let mut places = index::sample(random, views.len(), count.min(views.len())).into_vec();
        places.sort_unstable();
        places.into_iter().map(|place| target(log, views[place], &device)).collect::<Vec<_>>()
    };
    let (inputs, targets) = (config.own.supervision.input_views, config.own.supervision.target_views);
    // C.2: of a snippet with a future, its frames are targets too.
    let (given, held_out) = (host.inputs.iter().collect(), host.targets.iter().chain(&host.future).collect());
    let (inputs, found) = (drawn(given, inputs), drawn(held_out, targets));
    if targets > 0 && found.is_empty() {
        return Err(format!("snippet {}: expected a target image that shows something, found none", host.name));
    }
    Ok(Supervision { frame: &sample.frame, inputs, targets: found, host: None, loss: config.loss() })
}

#[cfg(test)]
mod tests {
    use gs_worlds::driving::{StreetOptions, write};

    use super::*;
    use crate::flux4d::prepare::prepare;

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
            supervised(&host, &sample, &logs.logs[0], &config, &mut random).expect("views of the snippet");
        assert_eq!((supervision.targets.len(), host.targets.len(), host.future.len()), (10, 5, 5));
        assert_eq!(supervision.targets.iter().filter(|view| view.time > 1.0).count(), 5);
    }
}

//! A network applied along the values of one key or one fault.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use gs_pipelines::flux4d::config::{FluxConfig, VelocityChoice};
use gs_pipelines::flux4d::feed::{Feed, SnippetCache};
use gs_pipelines::flux4d::logs::Logs;
use gs_pipelines::flux4d::network::FluxNetwork;
use gs_pipelines::flux4d::trainer::{Setup, step};
use gs_train::fit::training::Training;
use gs_worlds::driving::StreetOptions;

use super::trial::{Outcome, applied, network, streets};
use crate::experiments::lab::go_on;
use crate::experiments::{Findings, Lab, Series, largest};

/// PSNR that an eighth of the beams may cost, dB, and that the refinements of the training must add: the paper's add
/// that much (its table 7).
const REFINED: f64 = 2.4;

/// Speed of objects at rest, m/s, at any number of beams: fewer points may hide motion and must not invent any.
pub const REST: f64 = 0.05;

/// PSNR that poses off by 5 cm and 0.03 degrees may cost, dB: calibrations of research vehicles are that good.
const POSES: f64 = 2.0;

/// Change of the moving points' error by wrong poses and times, metres in 0.1 s: a third of the 0.15 m that a network
/// may err.
const FLOW: f64 = 0.05;

/// Weights of the mean speed; the paper's is 5e-3.
const WEIGHTS: [f64; 5] = [5e-5, 5e-4, 5e-3, 5e-2, 5e-1];

/// The network of a run.
#[derive(Clone, Copy)]
enum Net {
    Shipped,
    /// Before training a network changes nothing.
    Untrained,
    /// Trained on the street that is looked at.
    Trained,
}

/// A network at each value, applied to as many streets: `street` makes them, `change` sets keys. Means over the
/// streets.
fn along(
    lab: &Lab,
    values: &[f64],
    (net, count): (Net, u64),
    street: impl Fn(f64, StreetOptions) -> StreetOptions,
    change: impl Fn(f64, &mut FluxConfig),
) -> Result<Vec<(f64, Outcome)>> {
    let saved = network(lab)?;
    let apply = |value: &f64| {
        let mut config = saved.config.clone();
        change(*value, &mut config);
        let fresh = || FluxNetwork::new(&config, &lab.device);
        let mut all = Vec::new();
        for options in streets(count) {
            let path = lab.street(&street(*value, options))?;
            let begun = Instant::now();
            let outcome = match net {
                Net::Shipped => applied(lab, &path, &saved.network, &config)?,
                Net::Untrained => applied(lab, &path, &fresh(), &config)?,
                Net::Trained => {
                    let logs = Arc::new(Logs::unseen(&path, &config.own.logs)?);
                    applied(lab, &path, trained(lab, &logs, &config)?.module(), &config)?
                }
            };
            all.push(Outcome { seconds: begun.elapsed().as_secs_f64(), ..outcome });
        }
        Ok((*value, Outcome::mean(&all)))
    };
    values.iter().map(apply).collect()
}

/// Trains from nothing.
fn trained(lab: &Lab, logs: &Arc<Logs>, config: &FluxConfig) -> Result<Training<FluxNetwork>> {
    let mut training = Training::new(FluxNetwork::new(config, &lab.device));
    let mut feed = Feed::start(&Arc::new(SnippetCache::new(logs.clone(), config)), 0, 1)?;
    let setup = Setup { logs, config, devices: std::slice::from_ref(&lab.device) };
    while training.step < config.steps {
        go_on()?;
        let snippets = [feed.take()?];
        step(&mut training, &snippets, setup, &mut |reason| lab.say(reason));
        lab.count_step();
    }
    Ok(training)
}

/// A figure over the values.
fn line(name: &str, outcomes: &[(f64, Outcome)], figure: fn(&Outcome) -> f64) -> [Series; 1] {
    [Series::line_and_dots(name, outcomes.iter().map(|(x, outcome)| (*x, figure(outcome))).collect())]
}

const SHIPPED: &str = "shipped network";

/// The outcome at a value.
fn at(outcomes: &[(f64, Outcome)], value: f64) -> Option<Outcome> {
    outcomes.iter().find(|(x, _)| *x == value).map(|(_, outcome)| *outcome)
}

pub fn beams(lab: &Lab, found: &mut Findings) -> Result<()> {
    let counts: &[f64] = lab.either(&[4.0, 8.0, 16.0, 32.0, 64.0, 128.0], &[4.0, 32.0, 64.0]);
    let with_beams = |beams, street| StreetOptions { beams: beams as usize, ..street };
    let outcomes = along(lab, counts, (Net::Shipped, 1), with_beams, |_, _| ())?;
    let with_width = |width, street| StreetOptions { width: width as usize, height: width as usize * 9 / 16, ..street };
    let widths: &[f64] = lab.either(&[160.0, 320.0, 480.0], &[320.0]);
    for (width, outcome) in
        along(lab, widths, (Net::Shipped, 1), with_width, |_, config| config.own.logs.max_width = 0)?
    {
        let height = width * 9.0 / 16.0;
        let Outcome { psnr, moving, .. } = outcome;
        found.note(format!("Images of {width} x {height}: {psnr:.2} dB, moving EPE {moving:.3} m."));
    }
    let lost = at(&outcomes, 32.0).zip(at(&outcomes, 4.0)).map(|(known, few)| known.psnr - few.psnr);
    found.at_most("PSNR lost with an eighth of the beams", lost, REFINED, "dB");
    let resting = largest(outcomes.iter().map(|(_, outcome)| outcome.resting));
    found.at_most("speed of what rests, largest", resting, REST, "m/s");
    let x = "beams of the LiDAR";
    let psnr = line(SHIPPED, &outcomes, |outcome| outcome.psnr);
    found.chart("psnr", "Frames between the inputs over beams", [x, "PSNR, dB"], psnr);
    let moving = line(SHIPPED, &outcomes, |outcome| outcome.moving);
    found.chart("flow", "Motion over beams", [x, "EPE3D of moving points, m"], moving);
    Ok(())
}

pub fn calibration(lab: &Lab, found: &mut Findings) -> Result<()> {
    // Standard deviation of camera positions in metres, and of their angles in hundredths of a radian.
    let noise: &[f64] = lab.either(&[0.0, 0.02, 0.05, 0.1, 0.3], &[0.0, 0.1]);
    // Delay of the images, seconds; 0.1 s is a frame.
    let delays: &[f64] = lab.either(&[-0.1, -0.03, 0.0, 0.03, 0.1], &[-0.1, 0.03]);
    let with_noise = |pose_noise, street| StreetOptions { pose_noise, ..street };
    let noisy = along(lab, noise, (Net::Shipped, 1), with_noise, |_, _| ())?;
    let with_delay = |camera_delay, street| StreetOptions { camera_delay, ..street };
    let late = along(lab, delays, (Net::Shipped, 1), with_delay, |_, _| ())?;
    let exact = noisy[0].1;
    if !lab.quick {
        let slightly = at(&noisy, 0.05).map(|outcome| exact.psnr - outcome.psnr);
        found.at_most("PSNR lost by poses off by 5 cm", slightly, POSES, "dB");
    }
    let changed = noisy.iter().chain(&late).map(|(_, outcome)| (outcome.moving - exact.moving).abs());
    found.at_most("change of the moving EPE, largest", largest(changed), FLOW, "m");
    let y = "PSNR of the frames between the inputs, dB";
    let psnr = |outcomes| line(SHIPPED, outcomes, |outcome| outcome.psnr);
    found.chart("poses", "Noise of camera poses", ["standard deviation, m and 0.01 rad", y], psnr(&noisy));
    found.chart("times", "Images taken later than their times", ["delay, s", y], psnr(&late));
    Ok(())
}

/// The degree of motion. The sweeps show a velocity and an acceleration, so that before training the degrees 2 and 3
/// are degree 1 with further coefficients of zero. They are drawn to show that nothing else depends on the degree.
pub fn degree(lab: &Lab, found: &mut Findings) -> Result<()> {
    let set = |degree: f64, config: &mut FluxConfig| config.own.unet.degree = degree as usize;
    let outcomes = along(lab, &[0.0, 1.0, 2.0, 3.0], (Net::Untrained, lab.either(3, 1)), |_, street| street, set)?;
    let gain = outcomes[0].1.moving - outcomes[1].1.moving;
    found.at_least("moving EPE that degree 1 gains over degree 0", gain, 0.0, "m");
    for (degree, Outcome { moving, psnr, .. }) in &outcomes {
        found.note(format!("Degree {degree}: moving EPE {moving:.3} m, {psnr:.2} dB before training."));
    }
    let moving = line("velocities of the sweeps", &outcomes, |outcome| outcome.moving);
    found.chart("", "Motion by degree of the velocity", ["degree", "EPE3D of moving points, m"], moving);
    Ok(())
}

pub fn passes(lab: &Lab, found: &mut Findings) -> Result<()> {
    // The first pass is the base network.
    let counts: &[f64] = lab.either(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[1.0, 3.0]);
    let set = |passes: f64, config: &mut FluxConfig| config.own.refinement.passes = passes as usize;
    let outcomes = along(lab, counts, (Net::Shipped, lab.either(3, 1)), |_, street| street, set)?;
    for (passes, Outcome { psnr, seconds, .. }) in &outcomes {
        let refinements = passes - 1.0;
        found.note(format!("{refinements} refinements: {psnr:.2} dB, {seconds:.2} s with reading and measuring."));
    }
    let usual = network(lab)?.config.own.refinement.passes as f64;
    let gain = at(&outcomes, usual).zip(at(&outcomes, 1.0)).map(|(refined, base)| refined.psnr - base.psnr);
    found.at_least("PSNR that the refinements of the training add", gain, REFINED, "dB");
    let curve = outcomes.iter().map(|(_, outcome)| (outcome.seconds, outcome.psnr)).collect();
    let axes = ["seconds with reading and measuring", "PSNR, dB"];
    let title = "Frames between the inputs over seconds, none to five refinements";
    found.chart("", title, axes, [Series::line_and_dots(SHIPPED, curve)]);
    Ok(())
}

/// The weight of the mean speed; velocities start at zero, as in the paper.
pub fn weight(lab: &Lab, found: &mut Findings) -> Result<()> {
    let set = |weight: f64, config: &mut FluxConfig| {
        config.shared.steps = lab.steps();
        config.own.lift.velocity = VelocityChoice::Zero;
        config.own.refinement.passes = 1;
        config.own.supervision.velocity = weight;
    };
    let weights: &[f64] = lab.either(&WEIGHTS, &[WEIGHTS[0], WEIGHTS[4]]);
    let mut outcomes = along(lab, weights, (Net::Trained, 1), |_, street| street, set)?;
    for (weight, Outcome { psnr, moving, resting, .. }) in &mut outcomes {
        found.note(format!("Weight {weight:e}: {psnr:.2} dB, moving EPE {moving:.3} m, at rest {resting:.3} m/s."));
        *weight = weight.log10();
    }
    let falls = outcomes.first().zip(outcomes.last()).map(|(small, large)| small.1.resting - large.1.resting);
    found.above("speed at rest that the largest weight removes", falls, 0.0, "m/s");
    let x = "weight of the mean speed, log10";
    let resting = line("60 steps", &outcomes, |outcome| outcome.resting);
    found.chart("rest", "What rests, over the weight", [x, "speed, m/s"], resting);
    let moving = line("60 steps", &outcomes, |outcome| outcome.moving);
    found.chart("motion", "What moves, over the weight", [x, "EPE3D of moving points, m"], moving);
    Ok(())
}

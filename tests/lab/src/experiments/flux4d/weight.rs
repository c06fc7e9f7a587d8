//! How does the weight of the mean speed trade rest against motion? Velocities that start at zero, as in the paper.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use gs_train::pipelines::flux4d::config::{FluxConfig, VelocityChoice};
use gs_train::pipelines::flux4d::feed::{Draws, Feed, Library};
use gs_train::pipelines::flux4d::logs::Logs;
use gs_train::pipelines::flux4d::network::FluxNetwork;
use gs_train::pipelines::flux4d::trainer::Trainer;
use gs_train::report::charts::{Chart, Series};
use gs_train::run::interrupt;

use super::trial::{Outcome, applied, network, street};
use crate::experiments::{Criterion, Experiment, Findings, Interrupted, Lab};

/// The experiment; see the module.
pub const EXPERIMENT: Experiment = Experiment {
    name: "weight",
    question: "The weight of the mean speed over five decades, trained on one street without velocities of the sweeps: does what rests \
               come to rest, and at which weight does motion vanish?",
    steps: |quick| if quick { 2 * STEPS_QUICK } else { WEIGHTS.len() * STEPS },
    on_request: false,
    run,
};

/// The paper's weight is 5e-3.
const WEIGHTS: [f64; 5] = [5e-5, 5e-4, 5e-3, 5e-2, 5e-1];
const STEPS: usize = 60;
const STEPS_QUICK: usize = 5;

fn run(lab: &Lab) -> Result<Findings> {
    let saved = network(lab)?;
    let path = lab.street(&street())?;
    let weights: &[f64] = if lab.quick { &[WEIGHTS[0], WEIGHTS[4]] } else { &WEIGHTS };
    let (mut moving, mut resting) = (Vec::new(), Vec::new());
    let mut found = Findings::default();
    for weight in weights {
        let mut config = saved.config.clone();
        config.shared.steps = lab.either(STEPS, STEPS_QUICK);
        config.own.lift.velocity = VelocityChoice::Zero;
        config.own.refinement.passes = 1;
        config.own.supervision.velocity = *weight;
        let Outcome { psnr, moving: epe, resting: speed, .. } = trained(lab, &path, &config)?;
        let x = weight.log10();
        moving.push((x, epe));
        resting.push((x, speed));
        found.notes.push(format!("Weight {weight:e}: {psnr:.2} dB, moving EPE {epe:.3} m, at rest {speed:.3} m/s."));
    }
    let falls = resting.first().zip(resting.last()).map(|(small, large)| small.1 - large.1);
    found.criteria.push(Criterion::above("speed at rest that the largest weight removes", falls, 0.0, "m/s"));
    let x = "weight of the mean speed, log10";
    let chart = |title: &str, y: &str, points| Chart {
        title: title.into(),
        x: x.into(),
        y: y.into(),
        series: vec![Series::line_and_dots("60 steps", points)],
    };
    found.figures.push(("rest", chart("What rests, over the weight", "speed, m/s", resting)));
    found.figures.push(("motion", chart("What moves, over the weight", "EPE3D of moving points, m", moving)));
    Ok(found)
}

/// Trains on a street and measures on it.
fn trained(lab: &Lab, path: &Path, config: &FluxConfig) -> Result<Outcome> {
    let logs = Arc::new(Logs::unseen(path, &config.own.logs)?);
    let mut trainer = Trainer::new(FluxNetwork::new(config, &lab.device));
    let feed = Feed::start(Arc::new(Library::new(logs.clone(), config)), Draws::from(0))?;
    while trainer.step < config.steps {
        if interrupt::asked() {
            return Err(Interrupted.into());
        }
        let snippets = [feed.next()?];
        trainer.step(&snippets, (&logs, config, &lab.device), &mut |reason| lab.say(reason));
        lab.count_step();
    }
    applied(lab, path, trainer.network(), config)
}

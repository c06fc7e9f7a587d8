//! The cost of more points, stage by stage, and their gain. The budget of points is a key (`lift.points`).

use std::time::Instant;

use anyhow::Result;
use gs_driving::Snippet;
use gs_pipelines::flux4d::evaluate::color;
use gs_pipelines::flux4d::infer::infer;
use gs_pipelines::flux4d::logs::open;
use gs_pipelines::flux4d::prepare::prepare;
use gs_pipelines::flux4d::sample::camera;
use gs_worlds::driving::StreetOptions;

use super::trial::{applied, network, street};
use crate::experiments::lab::go_on;
use crate::experiments::{Findings, Lab, Series};

/// LiDAR points of a snippet at most.
const BUDGETS: [usize; 5] = [10_000, 30_000, 100_000, 300_000, 1_000_000];
const BUDGETS_QUICK: [usize; 2] = [8_000, 100_000];

/// Beams and columns of a LiDAR of which the front camera shows half a million points in a snippet.
const DENSE: [usize; 2] = [128, 3600];

/// Exponent of the seconds of the passes over the points, between the second budget and the last. 1 is in proportion;
/// sorting and caches cost a logarithm.
const BOUND: f64 = 1.15;

/// Stages, as they are named in the figure.
const STAGES: [&str; 4] = ["read and lift", "kernel maps", "passes", "one image"];

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let saved = network(lab)?;
    let [beams, columns] = DENSE;
    let dense = StreetOptions { beams, columns, ..street() };
    let path = lab.street(&lab.either(dense, street()))?;
    let log = open(&path, &saved.config.own.logs)?;
    let snippet = Snippet::new(0, gs_driving::INTERPOLATION_FRAMES);
    let mut stages = STAGES.map(|_| Vec::new());
    let mut psnr = Vec::new();
    for budget in lab.either(&BUDGETS[..], &BUDGETS_QUICK[..]) {
        go_on()?;
        let mut config = saved.config.clone();
        config.own.lift.points = *budget;
        let begun = Instant::now();
        let host = prepare(&log, &snippet, "street", &config.own.lift, config.seed)?;
        let prepared = begun.elapsed().as_secs_f64();
        let inferred = infer(&saved.network, &host, &log, &config, &lab.device)?;
        let begun = Instant::now();
        let view = &host.targets[0];
        let camera = camera(&log, view, &lab.device);
        // Reading the image back waits for the device.
        color(&inferred, &inferred.raw, &inferred.velocity, (&camera, view.time)).into_data();
        let rendered = begun.elapsed().as_secs_f64();
        let points = host.near_points().len() as f64;
        let seconds = [prepared, inferred.map_seconds, inferred.pass_seconds, rendered];
        for (stage, seconds) in stages.iter_mut().zip(seconds) {
            stage.push((points, seconds));
        }
        drop(inferred);
        let outcome = applied(lab, &path, &saved.network, &config)?;
        psnr.push((points, outcome.psnr));
        let [lift, maps, passes, image] = seconds;
        found.note(format!(
            "{points} points: read and lift {lift:.2} s, maps {maps:.3} s, passes {passes:.2} s, image {image:.3} s; \
             {:.2} dB, moving EPE {:.3} m.",
            outcome.psnr, outcome.moving
        ));
    }
    let exponent =
        stages[2].get(1).zip(stages[2].last()).map(|(few, many)| (many.1 / few.1).ln() / (many.0 / few.0).ln());
    if !lab.quick {
        found.at_most("exponent of the seconds of the passes over the points", exponent, BOUND, "");
    }
    let logarithms =
        |points: Vec<(f64, f64)>| points.into_iter().map(|(x, y)| (x.log10(), y.max(1e-6).log10())).collect();
    let series = STAGES.into_iter().zip(stages).map(|(name, points)| Series::line_and_dots(name, logarithms(points)));
    let (x, y) = ("points, power of ten", "seconds, power of ten");
    found.chart("seconds", "Seconds by stage over points", [x, y], series);
    let psnr = psnr.into_iter().map(|(x, y)| (x.log10(), y)).collect();
    let series = [Series::line_and_dots("shipped network", psnr)];
    found.chart("psnr", "Frames between the inputs over points", [x, "PSNR, dB"], series);
    Ok(())
}

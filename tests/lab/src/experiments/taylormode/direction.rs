//! Does blur determine the direction of motion? With a symmetric exposure and straight motion, v and -v give the same
//! blur, so one frame cannot; two can.

use anyhow::Result;
use burn::module::Param;
use gs_datasets::Scene;
use gs_models::taylormode::TaylorMotion;
use gs_multiview::Trajectory;
use gs_pipelines::taylormode::Taylormode;
use gs_pipelines::taylormode::cues::find_cues;
use gs_train::fit::parameters::from_host;
use gs_worlds::deblur::{DeblurOptions, PriorFaults, World};

use super::surface::on_surface;
use super::trial::trial;
use crate::experiments::lab::small;
use crate::experiments::{Findings, Lab, Series, largest, smallest};

/// Speeds of the world: 0.8, 1.7 and 3.3 pixels from one frame to the next, and about as much blur. The object's
/// texture repeats every 3.4 pixels; a start at minus the velocity is wrong by twice the motion.
const SPEEDS: [(f64, &str); 3] =
    [(0.125, "0.8 pixels a frame"), (0.25, "1.7 pixels a frame"), (0.5, "3.3 pixels a frame")];

/// The share that a bound is on.
const TURNED: &str = "Gaussians with the right sign after a start at minus the velocity, two or more frames, at worst";

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let counts: &[usize] = lab.either(&[1, 2, 3, 5], &[1, 2]);
    let (mut series, mut one) = (Vec::new(), Vec::new());
    for (speed, pixels) in lab.either(&SPEEDS[..], &SPEEDS[..1]) {
        let options = DeblurOptions { speed: *speed, priors: PriorFaults::none(), ..small(World::Cube, 8) };
        let scene = lab.world(&options)?;
        let percent = |count: &usize| Ok((*count as f64, 100.0 * turned(lab, &scene, *count, -1.0)?));
        let points: Vec<(f64, f64)> = counts.iter().map(percent).collect::<Result<_>>()?;
        let kept = 100.0 * turned(lab, &scene, 1, 1.0)?;
        one.push(0.5 * (points[0].1 + kept));
        found.note(format!(
            "{pixels}, one frame: {:.0} % have the right sign after a start at minus the velocity, {kept:.0} % after \
             one at the velocity.",
            points[0].1
        ));
        found.at_least(format!("{pixels}: {TURNED}"), smallest(points[1..].iter().map(|(_, share)| *share)), 99.0, "%");
        series.push(Series::line_and_dots(pixels, points));
    }
    let chance = "one frame, mean of starts at plus and at minus: no more than chance, farthest from 50";
    let farthest = largest(one.iter().map(|share| (share - 50.0).abs()));
    found.at_most(chance, farthest, 15.0, "%");
    found.note(
        "Ordinary runs begin on the path of the masks' centre, which has the right sign; this is what happens where \
         that is not known. Only Gaussians on a surface that a photo shows are counted.",
    );
    let axes = ["frames", "Gaussians with the right sign, %"];
    found.chart("", "Right direction after a start at minus the velocity", axes, series);
    Ok(())
}

/// Share of the Gaussians whose velocity has the true direction after training on `count` frames of each camera, from
/// an initial velocity of `sign` times that of the masks' centre.
fn turned(lab: &Lab, scene: &Scene, count: usize, sign: f64) -> Result<f64> {
    let part = frames(scene, count);
    let trial = trial(
        lab,
        &part,
        &[
            "motion.order=1",
            "motion.order_max=1",
            "motion.rotation_order=0",
            "motion.select=false",
            "motion.remainder=off",
            "motion.final_share=0.2",
            "density.strategy=none",
            // Blur alone must determine the direction.
            "blur.learn_exposure=false",
            "prior.sharp=0",
            "prior.depth=0",
        ],
    )?;
    // The path is fitted to the whole recording, however few frames training uses.
    let path = Trajectory::fit(&find_cues(scene, &trial.config).centres, 3, 0);
    let mut session = trial.begin(lab);
    let (window, rows) = (session.method().motion.window, session.method().motion.len());
    let start = path.map_or(glam::DVec3::ZERO, |path| path.velocity(window.t0)) * sign * window.half;
    let row = start.to_array().map(|x| x as f32).to_vec();
    let turned = Param::from_tensor(from_host(row.repeat(rows), 3, &lab.device));
    session
        .fit
        .trainer
        .change_method(|method| Taylormode { motion: TaylorMotion { position: turned, ..method.motion }, ..method });
    session.until(lab.steps())?;
    let compared = on_surface(&session.scene(), &part, window.t0);
    let right = compared.iter().filter(|pair| pair.found.dot(pair.truth) > 0.0).count();
    Ok(right as f64 / compared.len() as f64)
}

/// The scene with the `count` consecutive times nearest the middle.
fn frames(scene: &Scene, count: usize) -> Scene {
    let mut times: Vec<f64> = scene.train.iter().filter_map(|view| view.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let first = (times.len() - count.min(times.len())) / 2;
    let kept = &times[first..][..count.min(times.len())];
    let mut part = scene.clone();
    part.train.retain(|view| view.time.is_some_and(|t| kept.contains(&t)));
    part.time_range = kept.first().copied().zip(kept.last().copied());
    part
}

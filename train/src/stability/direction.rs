//! Does blur say which way things went (FIELD B15 a)? With a symmetric exposure and straight motion, v and -v blur alike, so one
//! frame cannot tell; two can.

use anyhow::Result;
use gs_datasets::Scene;
use gs_datasets::motion::Trajectory;
use gs_datasets::synthetic::deblur::{DeblurOptions, PriorFaults, World};

use crate::parameters::from_host;
use crate::report::charts::{Chart, Series};
use crate::stability::lab::{Session, small};
use crate::stability::surface::on_surface;
use crate::stability::{Criterion, Experiment, Findings, Lab};
use crate::taylormode::hints;

/// See the module.
pub const EXPERIMENT: Experiment = Experiment {
    name: "direction",
    question: "Paths begin with minus the velocity that the masks say: from how many frames on does training turn them round?",
    steps: |quick| if quick { 3 * STEPS_QUICK } else { 8 * STEPS },
    run,
};

const STEPS: usize = 250;
const STEPS_QUICK: usize = 100;

/// Half speed: 3 pixels of blur, and as much from frame to frame, less than the mover's texture repeats in.
const SPEED: f64 = 0.5;

fn run(lab: &Lab) -> Result<Findings> {
    let options = DeblurOptions { speed: SPEED, priors: PriorFaults::none(), ..small(World::Cube, 8) };
    let scene = lab.world(&options)?;
    let counts: &[usize] = lab.either(&[1, 2, 3, 5], &[1, 2]);
    let (mut wrong, mut right) = (Vec::new(), Vec::new());
    for count in counts {
        wrong.push((*count as f64, turned(lab, &scene, *count, -1.0)?));
        // The quick look needs only one comparison.
        if !lab.quick || *count == 1 {
            right.push((*count as f64, turned(lab, &scene, *count, 1.0)?));
        }
    }
    let several = wrong.iter().filter(|(count, _)| *count > 1.0).map(|(_, share)| 100.0 * share);
    let several = crate::stability::findings::smallest(several);
    let one = 50.0 * (wrong[0].1 + right[0].1);
    let percent = |points: &[(f64, f64)]| points.iter().map(|(x, y)| (*x, 100.0 * y)).collect();
    Ok(Findings {
        criteria: vec![
            Criterion::at_least(
                "moving Gaussians with the right sign after a start at minus the velocity, two or more frames, at worst",
                several,
                99.0,
                "%",
            ),
            Criterion::within(
                "the same with one frame, mean of starts at plus and at minus: no more than chance",
                Some(one),
                [35.0, 65.0],
                "%",
            ),
        ],
        figures: vec![(
            "",
            Chart {
                title: "Direction of motion from blurry frames".into(),
                x: "frames".into(),
                y: "Gaussians with the right sign, %".into(),
                series: vec![
                    Series::line_and_dots("started at minus the velocity", percent(&wrong)),
                    Series::line_and_dots("started at the velocity", percent(&right)),
                ],
            },
        )],
        notes: vec![format!(
            "With one frame {:.0} % have the right sign after a start at minus the velocity and {:.0} % after a start at the \
             velocity: it stays what it was. Only Gaussians on a surface that a photo shows are counted.",
            100.0 * wrong[0].1,
            100.0 * right[0].1
        )],
    })
}

/// Share of the Gaussians whose velocity points the true way after training on `count` frames of each camera, from `sign` times
/// the velocity of the masks' centre.
fn turned(lab: &Lab, scene: &Scene, count: usize, sign: f64) -> Result<f64> {
    let part = frames(scene, count);
    let steps = lab.either(STEPS, STEPS_QUICK);
    let config = lab.config(
        steps,
        &[
            "motion.order=1",
            "motion.order_max=1",
            "motion.rotation_order=0",
            "motion.select=false",
            "motion.remainder=off",
            "motion.final_share=0.2",
            "density.strategy=none",
            // The question is what blur alone says.
            "blur.learn_exposure=false",
            "prior.sharp=0",
            "prior.depth=0",
        ],
    )?;
    let path = Trajectory::fit(&hints::gather(scene, &config).centres, 3);
    let mut session = Session::begin(lab, &part, config);
    let (device, state) = (lab.device.clone(), session.state());
    let window = state.window;
    let start = path.map_or(glam::DVec3::ZERO, |path| path.velocity(window.t0)) * sign * window.half;
    let row = start.to_array().map(|x| x as f32).to_vec();
    state.position.value = from_host(row.repeat(state.rows.len()), 3, &device);
    session.until(steps)?;
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

//! What do wrong camera poses and wrong times cost? Colours are read off images at projected points.

use anyhow::Result;
use gs_worlds::driving::StreetOptions;
use gs_train::report::charts::{Chart, Series};

use super::trial::{Outcome, applied, network, street};
use crate::experiments::findings::largest;
use crate::experiments::{Criterion, Experiment, Findings, Lab};

/// The experiment; see the module.
pub const EXPERIMENT: Experiment = Experiment {
    name: "calibration",
    question: "Camera poses with noise, and images that were taken later than their times say: what does that cost in images, and does \
               motion, which is read off the LiDAR, stay as it was?",
    steps: |_| 0,
    on_request: false,
    run,
};

/// Standard deviation of camera positions, metres, and of their angles, hundredths of a radian.
const NOISE: [f64; 5] = [0.0, 0.02, 0.05, 0.1, 0.3];
/// Delay of the images, seconds; 0.1 s is a frame.
const DELAYS: [f64; 5] = [-0.1, -0.03, 0.0, 0.03, 0.1];
const QUICK: [usize; 2] = [0, 3];

/// PSNR that poses off by 5 cm and 0.03 degrees may cost, dB: calibrations of research vehicles are that good.
const BOUND: f64 = 2.0;

/// Change of the moving points' error, metres in 0.1 s: a third of what is asked of it.
const FLOW_BOUND: f64 = 0.05;

fn run(lab: &Lab) -> Result<Findings> {
    let saved = network(lab)?;
    let of = |options: StreetOptions| -> Result<Outcome> {
        applied(lab, &lab.street(&options)?, &saved.network, &saved.config)
    };
    let chosen = |values: &[f64; 5]| -> Vec<f64> {
        if lab.quick { QUICK.map(|index| values[index]).to_vec() } else { values.to_vec() }
    };
    let mut found = Findings::default();
    let (mut noisy, mut late) = (Vec::new(), Vec::new());
    for noise in chosen(&NOISE) {
        noisy.push((noise, of(StreetOptions { pose_noise: noise, ..street() })?));
    }
    for delay in chosen(&DELAYS) {
        late.push((delay, of(StreetOptions { camera_delay: delay, ..street() })?));
    }
    let exact = noisy[0].1;
    let slightly = noisy.iter().find(|(noise, _)| *noise == 0.05).map(|(_, outcome)| exact.psnr - outcome.psnr);
    let changed = noisy.iter().chain(&late).map(|(_, outcome)| (outcome.moving - exact.moving).abs());
    if !lab.quick {
        found.criteria.push(Criterion::at_most("PSNR lost by poses off by 5 cm", slightly, BOUND, "dB"));
    }
    found.criteria.push(Criterion::at_most("change of the moving EPE, largest", largest(changed), FLOW_BOUND, "m"));
    let psnr = |list: &[(f64, Outcome)]| list.iter().map(|(x, outcome)| (*x, outcome.psnr)).collect::<Vec<_>>();
    let y = "PSNR of the frames between the inputs, dB";
    let chart = |title: &str, x: &str, points| Chart {
        title: title.into(),
        x: x.into(),
        y: y.into(),
        series: vec![Series::line_and_dots("shipped network", points)],
    };
    found.figures.push(("poses", chart("Noise of camera poses", "standard deviation, m and 0.01 rad", psnr(&noisy))));
    found.figures.push(("times", chart("Images taken later than their times", "delay, s", psnr(&late))));
    Ok(found)
}

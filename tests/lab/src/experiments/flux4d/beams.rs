//! What do fewer beams cost, and other rigs? The Gaussians begin at LiDAR points, and motion is read off them.

use anyhow::Result;
use gs_worlds::driving::StreetOptions;
use gs_train::report::charts::{Chart, Series};

use super::trial::{applied, network, street};
use crate::experiments::findings::largest;
use crate::experiments::{Criterion, Experiment, Findings, Lab};

/// The experiment; see the module.
pub const EXPERIMENT: Experiment = Experiment {
    name: "beams",
    question: "A network trained on 32 beams and images of 320 pixels, applied to a LiDAR of 4 to 128 beams and to images of other sizes: \
               what breaks first?",
    steps: |_| 0,
    on_request: false,
    run,
};

/// Beams of the LiDAR; the network knows 32.
const BEAMS: [usize; 6] = [4, 8, 16, 32, 64, 128];
const BEAMS_QUICK: [usize; 3] = [4, 32, 64];
const KNOWN: usize = 32;

/// PSNR that an eighth of the beams may cost, dB: what the paper gains by its refinement.
const BOUND: f64 = 2.4;

/// Speed of what rests, m/s, at any number of beams: fewer points may hide motion and must not invent any.
const REST: f64 = 0.05;

fn run(lab: &Lab) -> Result<Findings> {
    let saved = network(lab)?;
    let mut found = Findings::default();
    let (mut psnr, mut moving, mut resting) = (Vec::new(), Vec::new(), Vec::new());
    for beams in lab.either(&BEAMS[..], &BEAMS_QUICK[..]) {
        let path = lab.street(&StreetOptions { beams: *beams, ..street() })?;
        let outcome = applied(lab, &path, &saved.network, &saved.config)?;
        let x = *beams as f64;
        psnr.push((x, outcome.psnr));
        moving.push((x, outcome.moving));
        resting.push((x, outcome.resting));
    }
    let sizes: &[(usize, usize)] = lab.either(&[(160, 90), (320, 180), (480, 270)], &[(320, 180)]);
    for (width, height) in sizes {
        let path = lab.street(&StreetOptions { width: *width, height: *height, ..street() })?;
        let mut config = saved.config.clone();
        config.own.logs.max_width = 0;
        let outcome = applied(lab, &path, &saved.network, &config)?;
        found
            .notes
            .push(format!("Images of {width} x {height}: {:.2} dB, moving EPE {:.3} m.", outcome.psnr, outcome.moving));
    }
    let at = |points: &[(f64, f64)], beams: usize| points.iter().find(|point| point.0 == beams as f64).map(|p| p.1);
    let lost = at(&psnr, KNOWN).zip(at(&psnr, 4)).map(|(known, few)| known - few);
    found.criteria = vec![
        Criterion::at_most("PSNR lost with an eighth of the beams", lost, BOUND, "dB"),
        Criterion::at_most("speed of what rests, largest", largest(resting.iter().map(|p| p.1)), REST, "m/s"),
    ];
    let x = "beams of the LiDAR";
    let chart = |title: &str, y: &str, points| Chart {
        title: title.into(),
        x: x.into(),
        y: y.into(),
        series: vec![Series::line_and_dots("shipped network", points)],
    };
    found.figures.push(("psnr", chart("Frames between the inputs over beams", "PSNR, dB", psnr)));
    found.figures.push(("flow", chart("Motion over beams", "EPE3D of moving points, m", moving)));
    Ok(found)
}

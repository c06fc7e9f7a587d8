//! Which degree does the motion of traffic need? The velocities that the sweeps show, as polynomials of each degree.
//!
//! The sweeps show a velocity and an acceleration, so that before training the degrees 2 and 3 are degree 1 with further
//! coefficients of zero. They are drawn to show that nothing else depends on the degree; the comparison is of 0 and 1.

use anyhow::Result;
use gs_train::pipelines::flux4d::network::FluxNetwork;
use gs_train::report::charts::{Chart, Series};

use super::trial::{applied, network, streets};
use crate::experiments::{Criterion, Experiment, Findings, Lab};

/// The experiment; see the module.
pub const EXPERIMENT: Experiment = Experiment {
    name: "degree",
    question: "Cars that drive, brake and turn, each followed over the frames between the inputs by velocities of degree 0 to 3, before \
               any training (2 and 3 then equal 1): does an acceleration pay?",
    steps: |_| 0,
    on_request: false,
    run,
};

/// Streets that are averaged.
const STREETS: u64 = 3;
const STREETS_QUICK: u64 = 1;

fn run(lab: &Lab) -> Result<Findings> {
    let saved = network(lab)?;
    let (mut error, mut psnr) = (Vec::new(), Vec::new());
    for degree in 0..=3 {
        let mut config = saved.config.clone();
        config.own.unet.degree = degree;
        // Before training a network changes nothing.
        let network = FluxNetwork::new(&config, &lab.device);
        let count = lab.either(STREETS, STREETS_QUICK);
        let mut sums = [0.0; 2];
        for options in streets(count) {
            let path = lab.street(&options)?;
            let outcome = applied(lab, &path, &network, &config)?;
            sums = [sums[0] + outcome.moving, sums[1] + outcome.psnr];
        }
        error.push((degree as f64, sums[0] / count as f64));
        psnr.push((degree as f64, sums[1] / count as f64));
    }
    let mut found = Findings::default();
    let gain = error[0].1 - error[1].1;
    found.criteria.push(Criterion::at_least("moving EPE that degree 1 gains over degree 0", Some(gain), 0.0, "m"));
    let notes = error.iter().zip(&psnr).map(|((degree, epe), (_, psnr))| {
        format!("Degree {degree}: moving EPE {epe:.3} m, {psnr:.2} dB before training.")
    });
    found.notes.extend(notes);
    found.figures.push((
        "",
        Chart {
            title: "Motion by degree of the velocity".into(),
            x: "degree".into(),
            y: "EPE3D of moving points, m".into(),
            series: vec![Series::line_and_dots("velocities of the sweeps", error)],
        },
    ));
    Ok(found)
}

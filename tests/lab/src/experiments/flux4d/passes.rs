//! What does each refinement add, and what does it cost?

use std::time::Instant;

use anyhow::Result;
use gs_train::report::charts::{Chart, Series};

use super::trial::{applied, network, streets};
use crate::experiments::{Criterion, Experiment, Findings, Lab};

/// The experiment; see the module.
pub const EXPERIMENT: Experiment = Experiment {
    name: "passes",
    question: "The shipped network, trained with two refinements, applied with none to five: what does each add to the frames between \
               the inputs, and how long does it take?",
    steps: |_| 0,
    on_request: false,
    run,
};

/// Passes through a network, the first of which is the base network.
const PASSES: [usize; 6] = [1, 2, 3, 4, 5, 6];
const PASSES_QUICK: [usize; 2] = [1, 3];
/// Streets that are averaged.
const STREETS: u64 = 3;
const STREETS_QUICK: u64 = 1;

/// What the refinements of the training must add, dB: the paper's add 2.4 (its table 7).
const BOUND: f64 = 2.4;

fn run(lab: &Lab) -> Result<Findings> {
    let saved = network(lab)?;
    let mut found = Findings::default();
    let mut curve = Vec::new();
    let mut of_passes = Vec::new();
    for passes in lab.either(&PASSES[..], &PASSES_QUICK[..]) {
        let mut config = saved.config.clone();
        config.own.refinement.passes = *passes;
        let count = lab.either(STREETS, STREETS_QUICK);
        let (mut psnr, mut seconds) = (0.0, 0.0);
        for options in streets(count) {
            let path = lab.street(&options)?;
            let begun = Instant::now();
            psnr += applied(lab, &path, &saved.network, &config)?.psnr / count as f64;
            seconds += begun.elapsed().as_secs_f64() / count as f64;
        }
        found
            .notes
            .push(format!("{} refinements: {psnr:.2} dB, {seconds:.2} s with reading and measuring.", passes - 1));
        curve.push((seconds, psnr));
        of_passes.push((*passes, psnr));
    }
    let at = |passes: usize| of_passes.iter().find(|(count, _)| *count == passes).map(|(_, psnr)| *psnr);
    let gain = at(saved.config.own.refinement.passes).zip(at(1)).map(|(refined, base)| refined - base);
    found.criteria.push(Criterion::at_least("PSNR that the refinements of the training add", gain, BOUND, "dB"));
    found.figures.push((
        "",
        Chart {
            title: "Frames between the inputs over seconds, none to five refinements".into(),
            x: "seconds with reading and measuring".into(),
            y: "PSNR, dB".into(),
            series: vec![Series::line_and_dots("shipped network", curve)],
        },
    ));
    Ok(found)
}

//! How far do runs spread that differ by the seed alone? Differences within the spread say nothing.

use anyhow::Result;
use gs_worlds::extrapolation::World;

use super::trial::{Film, SEEN, means, scores, small, trial};
use crate::experiments::{Findings, Lab, Series};

/// Seeds.
const SEEDS: u64 = 8;
const SEEDS_QUICK: u64 = 3;

/// Largest standard deviation of PSNR over the image, dB: papers compare methods by differences of this size.
const PSNR_BOUND: f64 = 0.3;

/// The same in moving parts, which are a tenth of the image and err together.
const MOVING_BOUND: f64 = 0.6;

/// Largest standard deviation of the number of Gaussians, a share of their mean: comparisons at equal counts allow as
/// much.
const COUNT_BOUND: f64 = 0.05;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let film = Film::of(lab, &small(World::Slider))?;
    let future = film.future(SEEN, 1.0);
    let (mut whole, mut moving, mut counts, mut laws) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for seed in 0..lab.either(SEEDS, SEEDS_QUICK) {
        let trial = trial(lab, film.until(SEEN), &[&format!("seed={seed}")])?;
        let session = trial.trained(lab)?;
        let [of_image, of_moving] = means(&scores(lab, &session, &future));
        whole.push((seed as f64, of_image));
        moving.push((seed as f64, of_moving));
        counts.push(session.fit.trainer.gaussians().len() as f64);
        let lines = session.fit.trainer.method().body_lines();
        laws.push(format!("seed {seed}: {of_image:.2} dB, {of_moving:.2} dB in moving parts; {}.", lines.join("; ")));
    }
    let values = |points: &[(f64, f64)]| -> Vec<f64> { points.iter().map(|(_, psnr)| *psnr).collect() };
    let [image, part, count] = [values(&whole), values(&moving), counts].map(Spread::of);
    found.at_most("standard deviation of PSNR over the image", image.deviation, PSNR_BOUND, "dB");
    found.at_most("standard deviation of PSNR in moving parts", part.deviation, MOVING_BOUND, "dB");
    let what = "standard deviation of the number of Gaussians, shares of the mean";
    found.at_most(what, count.deviation / count.mean, COUNT_BOUND, "");
    found.note(format!(
        "PSNR over the image {}, in moving parts {}, Gaussians {}.",
        image.in_words(2),
        part.in_words(2),
        count.in_words(0)
    ));
    found.notes.extend(laws);
    let series = [Series::line_and_dots("image", whole), Series::line_and_dots("moving parts", moving)];
    found.chart("", "The future by seed", ["seed", "PSNR, dB"], series);
    Ok(())
}

/// Mean, standard deviation and range of some values.
struct Spread {
    mean: f64,
    deviation: f64,
    range: [f64; 2],
}

impl Spread {
    fn of(values: Vec<f64>) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self { mean, deviation: (squares / (count - 1.0)).sqrt(), range: [low, high] }
    }

    fn in_words(&self, decimals: usize) -> String {
        let Self { mean, deviation, range: [low, high] } = self;
        format!("{mean:.decimals$} +- {deviation:.decimals$} ({low:.decimals$} to {high:.decimals$})")
    }
}

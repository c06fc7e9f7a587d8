//! The cost of wrong depth priors. The first frame begins at the pixels of the priors in space, so their errors are
//! errors of the scene.

use anyhow::Result;
use gs_datasets::Scene;
use gs_train::fit::random::normal_pair;
use gs_worlds::extrapolation::World;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::trial::{Film, SEEN, means, scores, small, trial};
use crate::experiments::{Findings, Lab, Series, largest};

/// Held-out photos up to this time are measured: later ones, and still more the future, show by which motion a run goes
/// on, which differs from seed to seed by more than any prior does.
const FIRST: f64 = 0.1;

/// Errors with their sizes at level 1: standard deviation as a share of depth; largest error of a photo's scale, a
/// share; share of pixels with the depth of another pixel.
const KINDS: [(&str, Wrong); 3] = [
    ("noise of 10 %", Wrong { noise: 0.1, ..Wrong::NONE }),
    ("scale off by 30 %", Wrong { scale: 0.3, ..Wrong::NONE }),
    ("30 % outliers", Wrong { outliers: 0.3, ..Wrong::NONE }),
];

/// Levels of each error: shares of its size.
const LEVELS: [f64; 2] = [0.33, 1.0];

/// Distance of the two layers of a doubled prior, a share of depth: every other photo places the surfaces that much
/// farther away.
const DOUBLED: Wrong = Wrong { apart: 0.1, ..Wrong::NONE };

/// Largest cost of an error, of those with levels at the lower one, dB over the image: the bound on the spread of
/// seeds.
const BOUND: f64 = 0.3;

/// Errors of priors.
#[derive(Clone, Copy)]
struct Wrong {
    noise: f64,
    scale: f64,
    outliers: f64,
    apart: f64,
}

impl Wrong {
    const NONE: Self = Self { noise: 0.0, scale: 0.0, outliers: 0.0, apart: 0.0 };

    fn at(self, level: f64) -> Self {
        let Self { noise, scale, outliers, apart } = self;
        Self { noise: noise * level, scale: scale * level, outliers: outliers * level, apart: apart * level }
    }
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let film = Film::of(lab, &small(World::Slider))?;
    let exact = psnr(lab, &film, Some(Wrong::NONE))?;
    let none = psnr(lab, &film, None)?;
    let levels: &[f64] = lab.either(&LEVELS, &LEVELS[1..]);
    let kinds: &[(&str, Wrong)] = lab.either(&KINDS, &KINDS[1..]);
    let mut series = Vec::new();
    for (name, wrong) in kinds {
        let mut points = vec![(0.0, exact[0])];
        for level in levels {
            let [first, later] = psnr(lab, &film, Some(wrong.at(*level)))?;
            points.push((*level, first));
            found.note(format!(
                "{name}, level {level}: {first:.2} dB in the first frames, {later:.2} dB in the future."
            ));
        }
        let what = format!("{name}: PSNR lost at level {}", levels[0]);
        found.at_most(what, exact[0] - points[1].1, BOUND, "dB");
        series.push(Series::line_and_dots(name, points));
    }
    let doubled = psnr(lab, &film, Some(DOUBLED))?;
    let lost = [("a doubled prior, 10 % apart", doubled), ("no prior: hull of the outlines", none)];
    for (name, psnr) in lost {
        found.at_most(format!("{name}: PSNR lost"), exact[0] - psnr[0], BOUND, "dB");
        series.push(Series::line(name, vec![(0.0, psnr[0]), (1.0, psnr[0])]));
    }
    found.note(format!(
        "Held-out cameras, dB in the first frames and in the future: exact priors {:.2} and {:.2}, doubled {:.2} and \
         {:.2}, none {:.2} and {:.2}.",
        exact[0], exact[1], doubled[0], doubled[1], none[0], none[1]
    ));
    let worst = largest(series.iter().flat_map(Series::points).map(|(_, psnr)| exact[0] - psnr)).unwrap_or(f64::NAN);
    found.note(format!("The costliest error of all costs {worst:.2} dB. Confidences say nothing of the errors."));
    found.chart(
        "",
        "What wrong depth priors cost",
        ["size of the error, shares of the size named", "PSNR of the first frames, dB"],
        series,
    );
    Ok(())
}

/// PSNR over held-out photos of the first frames and of the future, dB.
fn psnr(lab: &Lab, film: &Film, wrong: Option<Wrong>) -> Result<[f64; 2]> {
    let trial = trial(lab, with_priors(film.until(SEEN), wrong), &[])?;
    let session = trial.trained(lab)?;
    let psnr = |from: f64, to: f64| means(&scores(lab, &session, &film.future(from, to)))[0];
    Ok([psnr(-1.0, FIRST), psnr(SEEN, 1.0)])
}

/// The scene with wrong priors; without any for `None`.
fn with_priors(mut scene: Scene, wrong: Option<Wrong>) -> Scene {
    let mut odd = false;
    for (index, view) in scene.train.iter_mut().enumerate() {
        let Some(wrong) = wrong else {
            view.priors.depth = None;
            continue;
        };
        let Some(prior) = &mut view.priors.depth else { continue };
        // Every variant draws the same errors.
        prior.values = corrupted(&prior.values, wrong, odd, &mut ChaCha8Rng::seed_from_u64(index as u64));
        odd = !odd;
    }
    scene
}

/// `[H, W]` depths with errors; pixels without a depth stay so. `odd`: the photo places the second layer.
fn corrupted(truth: &[f32], wrong: Wrong, odd: bool, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let known: Vec<f32> = truth.iter().copied().filter(|z| *z > 0.0).collect();
    let layer = if odd { 1.0 + wrong.apart } else { 1.0 };
    let scale = layer * (1.0 + wrong.scale * rng.random_range(-1.0..=1.0));
    let at = |z: &f32| {
        let (draw, other, noise) = (rng.random::<f64>(), rng.random::<u64>(), normal_pair(rng)[0]);
        if *z <= 0.0 {
            return 0.0;
        }
        let value = if draw < wrong.outliers { known[other as usize % known.len()] } else { *z };
        // A depth that is not positive would be unknown.
        let noisy = (1.0 + wrong.noise * noise).max(0.1);
        (f64::from(value) * scale * noisy) as f32
    };
    truth.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priors_err_as_they_are_told() {
        let truth: Vec<f32> = (0..2000).map(|i| if i % 10 == 0 { 0.0 } else { 2.0 + i as f32 / 1000.0 }).collect();
        let with = |wrong: Wrong, odd: bool| corrupted(&truth, wrong, odd, &mut ChaCha8Rng::seed_from_u64(3));
        assert_eq!(with(Wrong::NONE, true), truth, "no error changes nothing");
        let factors = |found: &[f32]| -> Vec<f32> {
            truth.iter().zip(found).filter(|(z, _)| **z > 0.0).map(|(z, found)| found / z).collect()
        };
        let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
        assert!(factors(&with(DOUBLED, false)).iter().all(|f| near(*f, 1.0)), "the first layer is the truth");
        assert!(factors(&with(DOUBLED, true)).iter().all(|f| near(*f, 1.1)), "the second is 10 % behind");
        let scaled = factors(&with(KINDS[1].1, false));
        assert!(scaled.iter().all(|f| near(*f, scaled[0])) && (0.7..1.3).contains(&scaled[0]), "one scale for a photo");
        let changed = factors(&with(KINDS[2].1, false)).iter().filter(|f| !near(**f, 1.0)).count() as f64 / 1800.0;
        // 1800 draws at 0.3 spread by 0.011; the bound is five times that.
        assert!((changed - 0.3).abs() < 0.055, "{changed} of the pixels are outliers");
    }
}

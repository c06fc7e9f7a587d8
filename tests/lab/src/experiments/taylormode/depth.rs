//! The cost of a wrong depth prior. Networks estimate depth or disparity up to a scale and a shift that differ
//! between photos, and some pixels are outliers.

use anyhow::Result;
use gs_datasets::{DepthPrior, DepthSpace, Scene, View};
use gs_models::depth_prior::align;
use gs_train::fit::depth::in_space;
use gs_worlds::deblur::World;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::trial::trial;
use crate::experiments::lab::small;
use crate::experiments::{Findings, Lab, Series, largest};

/// At corruption 1, scales are from 1 / (1 + this) to 1 + this, and shifts within half of this share of the mean.
const AFFINE: f64 = 0.6;

/// Share of pixels whose value is replaced by that of another pixel.
const OUTLIERS: f64 = 0.2;

/// Ten times the recipe's weight of depth: at the recipe's own, errors of depth have almost no effect on these worlds,
/// aligned or not.
const WEIGHT: &str = "prior.depth=0.2";

#[derive(Clone, Copy)]
struct Wrong {
    space: DepthSpace,
    /// Size of the affine errors, 0 to 1.
    affine: f64,
    outliers: f64,
    fit: Fit,
}

/// Treatment of scale and shift.
#[derive(Clone, Copy, PartialEq)]
enum Fit {
    /// Fitted per photo to the rendered depth, as in the recipe.
    Photo,
    /// One pair for all photos, fitted to the true depth: the best possible single pair.
    Global,
    /// Not fitted: the loss is the correlation.
    Correlation,
    /// Not fitted: the values are used as they are.
    Absolute,
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let scene = lab.world(&small(World::Monkey, 6))?;
    let none = psnr(lab, &with_prior(&scene, None), Fit::Absolute)?;
    let levels: &[f64] = lab.either(&[0.0, 0.5, 1.0], &[0.0, 1.0]);
    let sweep = |space, outliers, fit| -> Result<Vec<(f64, f64)>> {
        let measure = |affine: &f64| {
            let wrong = Wrong { space, affine: *affine, outliers, fit };
            Ok((*affine, psnr(lab, &with_prior(&scene, Some(wrong)), fit)?))
        };
        levels.iter().map(measure).collect()
    };
    let unless_quick = |space, outliers, fit| if lab.quick { Ok(Vec::new()) } else { sweep(space, outliers, fit) };
    let depth = sweep(DepthSpace::Depth, 0.0, Fit::Photo)?;
    let disparity = unless_quick(DepthSpace::InverseDepth, 0.0, Fit::Photo)?;
    let outliers = unless_quick(DepthSpace::Depth, OUTLIERS, Fit::Photo)?;
    let global = unless_quick(DepthSpace::Depth, 0.0, Fit::Global)?;
    let correlated = unless_quick(DepthSpace::Depth, 0.0, Fit::Correlation)?;
    let taken = sweep(DepthSpace::Depth, 0.0, Fit::Absolute)?;
    // Relative to the same loss on true values, because fitting scale and shift costs something even if both are right.
    let worst = |points: &[(f64, f64)], base: f64| largest(points.iter().map(|(_, psnr)| (psnr - base).abs()));
    let aligned = "change of PSNR from true values, aligned";
    found.at_most(format!("affine error in depth: {aligned}"), worst(&depth, depth[0].1), 0.1, "dB");
    if let Some((_, base)) = disparity.first() {
        let what = format!("affine error in disparity: {aligned}");
        found.at_most(what, worst(&disparity, *base), 0.1, "dB");
        let what = format!("20 % outliers as well: {aligned}");
        found.at_most(what, worst(&outliers, depth[0].1), 0.3, "dB");
    }
    let at_worst = |points: &[(f64, f64)]| points.last().map_or(f64::NAN, |(_, psnr)| *psnr);
    let others = format!(
        "At the largest errors: {:.2} dB fitted per photo, {:.2} dB with one fit for all (to the true depth), {:.2} dB \
         by correlation, {:.2} dB believed.",
        at_worst(&depth),
        at_worst(&global),
        at_worst(&correlated),
        at_worst(&taken)
    );
    let note = format!(
        "Without any depth {none:.2} dB, with the true one {:.2} dB, with that but fitted {:.2} dB; every run is of \
         the whole image, held-out camera.",
        taken[0].1, depth[0].1
    );
    let without = levels.iter().map(|level| (*level, none)).collect();
    let series = [
        Series::line_and_dots("affine in depth, aligned", depth),
        Series::line_and_dots("affine in disparity, aligned", disparity),
        Series::line_and_dots("affine and 20 % outliers, aligned", outliers),
        Series::line_and_dots("affine in depth, one fit for all photos", global),
        Series::line_and_dots("affine in depth, correlation", correlated),
        Series::line_and_dots("affine in depth, not aligned", taken),
        Series::line("no depth prior", without),
    ];
    found.note(note);
    if !lab.quick {
        found.note(others);
    }
    let visible = series.into_iter().filter(Series::is_visible);
    found.chart("", "What a wrong depth prior costs", ["size of scale and shift errors", "PSNR, dB"], visible);
    Ok(())
}

fn psnr(lab: &Lab, scene: &Scene, fit: Fit) -> Result<f64> {
    let loss = if fit == Fit::Correlation { "prior.depth_fit=correlation" } else { "prior.depth_fit=photo" };
    Ok(trial(lab, scene, &["prior.until=1", "prior.sharp=0", WEIGHT, loss])?.measured(lab)?.quality.mean.psnr)
}

/// The scene with the true depth of its training photos as prior, corrupted by `wrong`; without any for `None`.
fn with_prior(scene: &Scene, wrong: Option<Wrong>) -> Scene {
    let mut scene = scene.clone();
    for (index, view) in scene.train.iter_mut().enumerate() {
        // Every variant draws the same errors.
        let mut rng = ChaCha8Rng::seed_from_u64(index as u64);
        view.priors.depth = wrong.and_then(|wrong| Some(corrupted(view.truth.depth.as_ref()?, wrong, &mut rng)));
    }
    if let Some(Wrong { fit: Fit::Global, space, .. }) = wrong {
        fit_once(&mut scene, space);
    }
    scene
}

/// Converts all priors to depth by one scale and one shift.
fn fit_once(scene: &mut Scene, space: DepthSpace) {
    let pairs = |view: &View| Some((view.priors.depth.as_ref()?.values.clone(), view.truth.depth.clone()?));
    let (values, truth): (Vec<_>, Vec<_>) = scene.train.iter().filter_map(pairs).unzip();
    let Some(fit) = align(&values.concat(), &truth.concat(), None, in_space(space)) else { return };
    for prior in scene.train.iter_mut().filter_map(|view| view.priors.depth.as_mut()) {
        *prior = DepthPrior { values: fit.depth(&prior.values), space: DepthSpace::Depth, metric: true };
    }
}

fn corrupted(truth: &[f32], wrong: Wrong, rng: &mut ChaCha8Rng) -> DepthPrior {
    let known = |z: f32| z > 0.0;
    let in_space = |z: f32| match wrong.space {
        DepthSpace::Depth => f64::from(z),
        DepthSpace::InverseDepth => 1.0 / f64::from(z),
    };
    let true_values: Vec<f64> = truth.iter().filter(|z| known(**z)).map(|z| in_space(*z)).collect();
    let mean = true_values.iter().sum::<f64>() / true_values.len().max(1) as f64;
    let scale = ((1.0 + AFFINE * wrong.affine).ln() * rng.random_range(-1.0..=1.0)).exp();
    let shift = 0.5 * AFFINE * wrong.affine * mean * rng.random_range(-1.0..=1.0);
    let values = truth.iter().map(|z| {
        let (other, draw) = (rng.random::<u64>(), rng.random::<f64>());
        if !known(*z) {
            return 0.0;
        }
        let value = if draw < wrong.outliers { true_values[other as usize % true_values.len()] } else { in_space(*z) };
        // A prior that is not positive would be unknown.
        (scale * value + shift).max(1e-3 * mean) as f32
    });
    DepthPrior { values: values.collect(), space: wrong.space, metric: wrong.fit == Fit::Absolute }
}

//! Does early training displace Gaussians far? Deformation fields have moved points out of the scene if its unit was
//! not the one they were tuned for.

use anyhow::Result;
use burn::tensor::Tensor;
use gs_datasets::Scene;
use gs_pipelines::taylormode::Taylormode;
use gs_worlds::deblur::World;

use super::trial::trial;
use crate::experiments::lab::{Session, Trial, small};
use crate::experiments::{Findings, Lab, Series, largest};

/// Seeds of the initial Gaussians, the order of the photos and the networks.
const SEEDS: [u64; 3] = [42, 43, 44];

/// Times of the window at which positions are compared, normalised.
const TIMES: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let scene = lab.world(&small(World::Sphere, 6))?;
    let exponents: &[i32] = lab.either(&[-2, -1, 0, 1, 2], &[-2, 2]);
    let (mut series, mut first, mut steps) = (Vec::new(), Vec::new(), Vec::new());
    for exponent in exponents {
        let scaled = scaled(&scene, 10f64.powi(*exponent));
        let mut farthest: Vec<(f64, f64)> = Vec::new();
        for seed in lab.either(&SEEDS[..], &SEEDS[..1]) {
            first.push(untouched(lab, &scaled, *seed)?);
            let curve = trained(lab, &scaled, *seed)?;
            steps.extend(curve.iter().map(|(_, share)| *share));
            farthest = match farthest.is_empty() {
                true => curve,
                false => farthest.iter().zip(&curve).map(|(a, b)| (a.0, a.1.max(b.1))).collect(),
            };
        }
        series.push(Series::line(&format!("scale 1e{exponent}"), farthest));
    }
    found.zero("displacement before the first step, remainder on, no path known", largest(first), "");
    found.at_most("farthest that a step moved a Gaussian, share of the scene's extent", largest(steps), 0.01, "");
    let title = "Farthest that a step moves a Gaussian, of all seeds";
    found.chart("", title, ["step", "share of the scene's extent"], series);
    found.note(
        "Positions are compared at five times over the whole window. The near plane stays at 0.01 scene units, as in \
         any run that does not know the scale.",
    );
    found.note(
        "Rates rise over the first tenth of the run: at its full rate Adam's first step would move every coefficient \
         by all of it, and at the window's ends those of all orders add up.",
    );
    Ok(())
}

/// A run of `seed` with changes.
fn seeded(lab: &Lab, scene: &Scene, seed: u64, changes: &[&str]) -> Result<Trial<Taylormode>> {
    // The count must be fixed and no path may be lowered, so that rows stay the same Gaussians. Rates stay at their
    // highest.
    let fixed = [
        "density.strategy=none",
        "motion.select=false",
        "motion.remainder=on",
        "prior.sharp=0",
        "motion.final_share=1",
    ];
    trial(lab, scene, &[&fixed, changes, &[&format!("seed={seed}")]].concat())
}

/// Largest displacement before the first step if no motion is known, scene units.
fn untouched(lab: &Lab, scene: &Scene, seed: u64) -> Result<f64> {
    let trial = seeded(lab, scene, seed, &["steps=1", "motion.masks=none"])?;
    let motion = trial.begin(lab).scene().paths();
    let window = motion.window;
    Ok(TIMES.iter().map(|s| most(motion.displacement(window.t0 + s * window.half))).fold(0.0, f64::max))
}

/// For each step, the largest displacement of a Gaussian by it, in scene extents.
fn trained(lab: &Lab, scene: &Scene, seed: u64) -> Result<Vec<(f64, f64)>> {
    let trial = seeded(lab, scene, seed, &[])?;
    let mut session = trial.begin(lab);
    let extent = trial.data.facts.extent;
    let mut before = positions(&session);
    let mut curve = Vec::new();
    for step in 1..=lab.steps() {
        session.until(step)?;
        let after = positions(&session);
        let moved = before.iter().zip(&after).map(|(a, b)| most(b.clone() - a.clone())).fold(0.0, f64::max);
        curve.push((step as f64, moved / extent));
        before = after;
    }
    Ok(curve)
}

fn positions(session: &Session<Taylormode>) -> Vec<Tensor<2>> {
    let scene = session.scene();
    let (paths, window) = (scene.paths(), scene.motion.window);
    TIMES.iter().map(|s| paths.means_at(scene.gaussians.means.val(), window.t0 + s * window.half)).collect()
}

/// The largest norm of a row.
fn most(rows: Tensor<2>) -> f64 {
    let squares = (rows.clone() * rows).sum_dim(1).max();
    f64::from(squares.into_scalar::<f32>()).sqrt()
}

/// The scene in another unit of length.
fn scaled(scene: &Scene, factor: f64) -> Scene {
    let mut scene = scene.clone();
    for view in scene.train.iter_mut().chain(scene.held_out.iter_mut().flat_map(|split| &mut split.views)) {
        let position = view.c2w.w_axis.truncate() * factor;
        view.c2w.w_axis = position.extend(1.0);
        // Depth priors are aligned to the rendering or dropped: only motion matters here.
        view.priors.depth = None;
    }
    for position in scene.points.iter_mut().flat_map(|points| &mut points.positions) {
        *position = position.map(|x| (f64::from(x) * factor) as f32);
    }
    scene
}

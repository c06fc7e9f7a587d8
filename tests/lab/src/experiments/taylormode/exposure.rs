//! Can exposure and speed be told apart? One frame determines only their product; successive frames determine the speed
//! alone.

use anyhow::Result;
use burn::module::Param;
use burn::tensor::Tensor;
use gs_base::median;
use gs_datasets::Scene;
use gs_models::taylormode::{Kinks, TaylorScene};
use gs_pipelines::taylormode::Taylormode;
use gs_pipelines::taylormode::figures::blur_over;
use gs_train::fit::photos::to_tensor;
use gs_worlds::deblur::World;

use super::surface::on_surface;
use super::trial::trial;
use crate::experiments::lab::{Session, small};
use crate::experiments::{Findings, Lab, Series, largest};

/// Rate of the exposure's logarithm, which allows the same total change as the 4000 steps at 2e-3 of a run of
/// `base.toml`.
const RATE: &str = "blur.exposure_lr=5e-3";

/// The same for a quick run, which has fewer steps.
const RATE_QUICK: &str = "blur.exposure_lr=3e-2";

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let options = small(World::Cube, 6);
    let scene = lab.world(&options)?;
    let truth = options.exposure_time();
    let factors: &[f64] = lab.either(&[0.25, 0.5, 1.0, 2.0, 4.0], &[0.5, 2.0]);
    let (mut taus, mut products, mut valley) = (Vec::new(), Vec::new(), Vec::new());
    for factor in factors {
        let start = format!("blur.exposure={}", factor * truth);
        // Selection would leave order 0 if the exposure begins far too short; it is tested elsewhere.
        let rate = lab.either(RATE, RATE_QUICK);
        let trial = trial(lab, &scene, &[&start, rate, "motion.select=false", "blur.samples=7"])?;
        let session = trial.trained(lab)?;
        let tau = session.method().exposure_on_host() / truth;
        let compared = on_surface(&session.scene(), &scene, session.method().motion.window.t0);
        let speed =
            median(compared.iter().map(|pair| pair.found.length() / pair.truth.length()).collect()).unwrap_or(f64::NAN);
        taus.push((factor.log2(), tau));
        products.push((factor.log2(), tau * speed));
        if valley.is_empty() && *factor >= 1.0 {
            valley = hyperbola(&session, &scene);
        }
    }
    let worst = |points: &[(f64, f64)]| largest(points.iter().map(|(_, ratio)| 100.0 * (ratio - 1.0).abs()));
    found.at_most("error of exposure times speed over all starts, at worst", worst(&products), 2.0, "%");
    found.at_most("error of the exposure over all starts, at worst", worst(&taus), 5.0, "%");
    let series = [Series::line_and_dots("exposure", taus), Series::line_and_dots("exposure x speed", products)];
    let axes = ["log2 of exposure at the start / truth", "found / truth"];
    found.chart("found", "Exposure and speed by where the exposure began", axes, series);
    let title = "Exposure times a, speed over a: only neighbouring frames object";
    found.chart("valley", title, ["log2 of a", "difference of moving pixels / the smallest"], valley);
    found.note(
        "The speed is the median over Gaussians on the visible surface at t0, against the surface's own. The second \
         figure takes the first run that began at the truth or above, and looks at the photos' moving pixels.",
    );
    Ok(())
}

/// Difference of formed and given photos along the hyperbola of equal exposure times speed, in the middle frame and in
/// all.
fn hyperbola(session: &Session<Taylormode>, scene: &Scene) -> Vec<Series> {
    let (method, at) = (session.method(), session.fit.at());
    let (t0, exposure) = (method.motion.window.t0, method.exposure_on_host());
    let (mut middle, mut all) = (Vec::new(), Vec::new());
    for step in -4..=4 {
        let log = f64::from(step) / 4.0;
        let model = slowed(&session.scene(), log.exp2());
        let difference = |only: Option<f64>| {
            let views = scene.train.iter().filter(|view| only.is_none() || view.time == only);
            let each = views.filter_map(|view| {
                let mask = view.truth.moving_union.as_ref()?;
                let formed = blur_over(&model.gaussians, &model.motion, exposure * log.exp2(), view, &at);
                let device = model.gaussians.device();
                let mask = to_tensor(view, mask, 1, &device);
                let error = (formed - to_tensor(view, &view.image.data, 3, &device)).abs() * mask.clone();
                let sums = [error.sum(), mask.sum()].map(|sum| f64::from(sum.into_scalar::<f32>()));
                Some(sums[0] / (3.0 * sums[1]))
            });
            let each: Vec<f64> = each.collect();
            each.iter().sum::<f64>() / each.len() as f64
        };
        middle.push((log, difference(Some(t0))));
        all.push((log, difference(None)));
    }
    let relative = |points: Vec<(f64, f64)>| {
        let least = points.iter().map(|(_, y)| *y).fold(f64::INFINITY, f64::min);
        points.into_iter().map(|(x, y)| (x, y / least)).collect()
    };
    vec![
        Series::line_and_dots("the frame at t0 alone", relative(middle)),
        Series::line_and_dots("all frames", relative(all)),
    ]
}

/// The scene with all speeds divided by `factor`.
fn slowed(scene: &TaylorScene, factor: f64) -> TaylorScene {
    let mut motion = scene.motion.clone();
    let divided = |coefficients: Param<Tensor<2>>| coefficients.map(|tensor| tensor * (1.0 / factor));
    motion.position = divided(motion.position);
    motion.rotation = divided(motion.rotation);
    motion.kinks = motion.kinks.map(|kinks| Kinks { jumps: divided(kinks.jumps), ..kinks });
    TaylorScene { motion, gaussians: scene.gaussians.clone() }
}

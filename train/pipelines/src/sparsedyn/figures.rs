//! Figures of the dynamics: how many Gaussians move, how fast, and how far that is from the truth of synthetic worlds.

use gs_burn::{Gaussians, parameter_bytes, render};
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;

use super::scene::RolledScene;
use super::{Config, Sparsedyn, Step};
use gs_train::fit::figure::{Figure, Figures};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{camera, mask_of, to_tensor};
use gs_train::run::metrics::psnr_counted;

/// Figures beside image quality: over `views` after the last time seen, what the scene gains over its last state.
pub fn figures(model: &Sparsedyn, gaussians: &Gaussians, _scene: &Scene, views: &[View], at: &Step) -> Figures {
    let moving = model.frame.rows.len();
    let count = Figure::new("moving_gaussians", "moving Gaussians", moving as f64, "").column();
    let speed = Figure::new(
        "mean_speed",
        "mean speed of moving Gaussians at the first frame",
        speed(model, gaussians),
        "units/time",
    );
    let mut numbers = vec![count, speed.digits(3)];
    if let Some([future, held]) = future_and_held(model, gaussians, views, at) {
        numbers.push(Figure::new("held", "PSNR of the last state seen, held", held, "dB").digits(2));
        numbers.push(Figure::new("gain", "PSNR of the future over it", future - held, "dB").digits(2).column());
    }
    Figures { numbers, tables: Vec::new() }
}

/// The mean PSNR of `views` after the last time seen, and that of the scene as it was at that time, dB; `None` without
/// such a view.
fn future_and_held(model: &Sparsedyn, gaussians: &Gaussians, views: &[View], at: &Step) -> Option<[f64; 2]> {
    let last = model.frame.span[1];
    let time = |view: &View| model.frame.clock.inner(view.time.unwrap_or(0.0));
    let later: Vec<&View> = views.iter().filter(|view| time(view) > last).collect();
    let scene = RolledScene { gaussians: gaussians.clone(), method: model.clone() };
    let held = scene.at(model.frame.clock.outer(last));
    let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
    let psnr = |scene: &Gaussians, view: &View| {
        let device = gaussians.device();
        let image = render(scene, &camera(view, &device), &options).color;
        psnr_counted(image, to_tensor(view, &view.image.data, 3, &device), mask_of(view, &device))
    };
    let both = later.iter().map(|view| [psnr(&scene.at(view.time.unwrap_or(0.0)), view), psnr(&held, view)]);
    let both: Vec<[f64; 2]> = both.filter(|both| both.iter().all(|x| x.is_finite())).collect();
    let of = |which: usize| both.iter().map(|both| both[which]).sum::<f64>() / both.len() as f64;
    (!both.is_empty()).then(|| [of(0), of(1)])
}

fn speed(model: &Sparsedyn, gaussians: &Gaussians) -> f64 {
    if model.frame.rows.is_empty() {
        return 0.0;
    }
    let first = model.first_positions(gaussians);
    let velocities = to_host(model.velocities(&first, model.frame.start));
    let speeds = velocities.chunks_exact(3).map(|v| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt());
    speeds.sum::<f64>() / model.frame.rows.len() as f64 / model.frame.clock.unit
}

/// Bytes of every number that is needed to draw the scene at any time: Gaussians, field, and a row number for each
/// moving Gaussian.
pub fn bytes(model: &Sparsedyn, gaussians: &Gaussians, _config: &Config) -> usize {
    let own = 4 * gaussians.len() * (11 + 3 * gaussians.sh.dims()[1]);
    let moving = if model.frame.rows.is_empty() { 0 } else { parameter_bytes(model) + 4 * model.frame.rows.len() };
    own + moving
}

//! Figures of the dynamics: how many Gaussians move, how fast, and how far that is from the truth of synthetic worlds.

use gs_burn::{Gaussians, parameter_bytes};
use gs_datasets::{Scene, View};

use super::{Config, Sparsedyn, Step};
use gs_train::fit::figure::{Figure, Figures};
use gs_train::fit::parameters::to_host;

/// Figures beside image quality.
pub fn figures(model: &Sparsedyn, gaussians: &Gaussians, _scene: &Scene, _views: &[View], _at: &Step) -> Figures {
    let moving = model.frame.rows.len();
    let count = Figure::new("moving_gaussians", "moving Gaussians", moving as f64, "").column();
    let speed = Figure::new(
        "mean_speed",
        "mean speed of moving Gaussians at the first frame",
        speed(model, gaussians),
        "units/time",
    );
    Figures { numbers: vec![count, speed.digits(3)], tables: Vec::new() }
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

//! Figures of the dynamics: how many Gaussians move, how fast, and how far that is from the truth of synthetic worlds.

use gs_burn::{Gaussians, parameter_bytes, render};
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;

use super::scene::RolledScene;
use super::{Config, Sparsedyn, Step};
use gs_train::fit::figure::{Figure, FigureTable, Figures};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{camera, colors_of, mask_of};
use gs_train::fit::times::{by_time, each_view};
use gs_train::run::metrics::{mean, psnr_counted};

/// Figures beside image quality: over `views` after the last time seen, what the scene gains over its last state, and
/// how well held-out cameras are met while frames are seen.
pub fn figures(model: &Sparsedyn, gaussians: &Gaussians, scene: &Scene, views: &[View], at: &Step) -> Figures {
    let moving = model.frame.rows.len();
    let count = Figure::new("moving_gaussians", "moving Gaussians", moving as f64, "").column();
    let speed = Figure::new(
        "mean_speed",
        "mean speed of moving Gaussians at the first frame",
        speed(model, gaussians),
        "units/time",
    );
    let mut numbers = vec![count, speed.digits(3)];
    let tables = bodies_table(model).into_iter().collect();
    let is_later = |view: &&View| model.frame.clock.inner(view.time.unwrap_or(0.0)) > model.frame.span[1];
    let later: Vec<&View> = views.iter().filter(is_later).collect();
    if later.is_empty() {
        return Figures { numbers, tables };
    }
    let compared = Compared { model, gaussians, at };
    if let Some([future, held]) = compared.future_and_held(&later) {
        numbers.push(Figure::new("held", "PSNR of the last state seen, held", held, "dB").digits(2));
        numbers.push(Figure::new("gain", "PSNR of the future over it", future - held, "dB").digits(2).column());
    }
    let seen: Vec<&View> = scene.held_out_views().filter(|view| !is_later(view)).collect();
    // At most as many as show the future, by whole times.
    let every = seen.len().div_ceil(later.len()).max(1);
    let groups = by_time(seen.iter().copied()).into_iter().step_by(every);
    let seen: Vec<&View> = groups.flat_map(|(_, indices)| indices).map(|index| seen[index]).collect();
    if let Some(seen) = mean_finite(compared.psnr(&seen)) {
        numbers.push(Figure::new("seen", "PSNR of the seen times, held-out cameras", seen, "dB").digits(2));
    }
    Figures { numbers, tables }
}

/// The motion of each body; `None` without bodies.
fn bodies_table(model: &Sparsedyn) -> Option<FigureTable> {
    let rows = model.body_rows().into_iter().enumerate();
    let rows: Vec<Vec<String>> =
        rows.map(|(body, (count, words))| vec![format!("body_{body}"), count.to_string(), words]).collect();
    let columns = ["body", "Gaussians", "motion"].map(String::from).to_vec();
    (!rows.is_empty()).then(|| FigureTable { title: "Bodies".into(), columns, rows })
}

/// A model that is compared with photos.
struct Compared<'a> {
    model: &'a Sparsedyn,
    gaussians: &'a Gaussians,
    at: &'a Step<'a>,
}

impl Compared<'_> {
    /// The mean PSNR of views `later` than the last time seen, and that of the scene as it was at that time, dB; `None`
    /// without a view that counts.
    fn future_and_held(&self, later: &[&View]) -> Option<[f64; 2]> {
        let frame = &self.model.frame;
        let held = self.scene().at(frame.clock.outer(frame.span[1]));
        Some([mean_finite(self.psnr(later))?, mean_finite(later.iter().map(|view| self.psnr_of(&held, view)))?])
    }

    /// The PSNR of each of `views`, ordered by time, dB.
    fn psnr(&self, views: &[&View]) -> Vec<f64> {
        let mut all = Vec::new();
        each_view(&self.scene(), views, |scene, index| all.push(self.psnr_of(scene, views[index])));
        all
    }

    fn scene(&self) -> RolledScene {
        RolledScene { gaussians: self.gaussians.clone(), method: self.model.clone() }
    }

    fn psnr_of(&self, scene: &Gaussians, view: &View) -> f64 {
        let device = scene.device();
        let options = self.at.facts.render_options(&self.at.config.render, scene.sh_degree());
        let image = render(scene, &camera(view, &device), &options).color;
        psnr_counted(image, colors_of(view, &device), mask_of(view, &device))
    }
}

/// The mean of those of `values` that are finite: a view of which no pixel counts has no PSNR.
fn mean_finite(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    mean(values.into_iter().filter(|x| x.is_finite()))
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

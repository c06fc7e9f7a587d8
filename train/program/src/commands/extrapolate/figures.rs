//! extrapolate.json.

use serde::Serialize;

use super::Work;
use super::ensemble::SpreadFigures;
use super::frames::StepNote;
use super::parts::PartFigures;
use crate::report::future::Horizon;
use crate::report::future::motion::Map;
use gs_train::run::outputs::MARK;

/// The file.
pub const JSON: &str = "extrapolate.json";

/// Every file that lies in the folder itself.
pub const NAMES: [&str; 9] = [
    JSON,
    "trajectories.png",
    "speed.png",
    "velocity.png",
    "angular_velocity.png",
    "uncertainty.png",
    "strip.png",
    "psnr_over_time.svg",
    "calibration.svg",
];

/// The content of extrapolate.json.
#[derive(Debug, Serialize)]
pub struct Figures {
    /// [`MARK`], so that a later call may write over the file.
    program: &'static str,
    /// Name of the run.
    run: String,
    /// Steps that it was trained.
    trained_steps: Option<usize>,
    /// First and last time that was seen.
    seen: [f64; 2],
    /// The times of the frames.
    times: Vec<f64>,
    /// The cameras of the frames.
    cameras: Vec<String>,
    /// Gaussians that move by more than half a pixel.
    moving_gaussians: usize,
    /// Scene units of a pixel of the first camera, where things move.
    pixel: f64,
    /// PSNR over time, by split.
    pub future: Vec<Horizon>,
    /// The maps' full scales.
    pub maps: Vec<Map>,
    /// Rigid parts, what the field moves, and what rests.
    pub parts: Vec<PartFigures>,
    /// The ensemble.
    pub spread: Option<SpreadFigures>,
    /// The changes by the step that was asked for.
    pub step: Option<StepNote>,
}

impl Figures {
    /// The figures that are known before anything is measured.
    pub(super) fn new(work: &Work) -> Self {
        Self {
            program: MARK,
            run: work.run_name(),
            trained_steps: work.loaded.run.as_ref().map(|run| run.step),
            seen: work.span,
            times: work.times.clone(),
            cameras: work.shots.iter().map(|shot| shot.name.clone()).collect(),
            moving_gaussians: work.moving.len(),
            pixel: work.pixel,
            future: Vec::new(),
            maps: Vec::new(),
            parts: Vec::new(),
            spread: None,
            step: None,
        }
    }
}

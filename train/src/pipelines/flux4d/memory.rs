//! Prediction of the memory of a training and of a reconstruction, shown before they start.

use gs_driving::{DrivingLog, Snippet};
use gs_models::flux4d::unet::BYTES_PER_VOXEL;

use super::config::{FarChoice, FluxConfig, LiftSection};
use super::feed::in_flight;
use super::logs::{Logs, Place};
use crate::run::memory::Prediction;

/// Bytes that a Gaussian holds in a step: raw channels, activations, projected rows and their gradients, of one view at a time.
const BYTES_PER_GAUSSIAN: usize = 2000;
/// Program, thread stacks and allocator.
const PROGRAM_BYTES: usize = 60 << 20;
/// LiDAR points of a snippet where the configuration has no limit: six sweeps of PandaSet.
const USUAL_POINTS: usize = 1_000_000;

/// Rows of the first Gaussians.
#[derive(Clone, Copy)]
struct Rows {
    points: usize,
    far: usize,
}

impl Rows {
    /// At most, for logs of so many cameras.
    fn of(lift: &LiftSection, cameras: usize) -> Self {
        let points = if lift.points == 0 { USUAL_POINTS } else { lift.points * cameras };
        Self { points, far: lift.sky_points + lift.random_points }
    }

    fn all(self) -> usize {
        self.points + self.far
    }

    /// A snippet on the host: 8-bit colours and depth of its images; 14 channels and a time; motion and input frame.
    fn snippet_bytes(self, log: &DrivingLog, snippet: &Snippet) -> usize {
        let pixels: usize = log.cameras().iter().map(|camera| camera.width * camera.height).sum();
        7 * snippet.frames.len() * pixels + 60 * self.all() + 18 * self.points
    }

    /// What the network and the renderings of a step hold.
    fn step(self, config: &FluxConfig) -> [(&'static str, u64); 2] {
        // Half of the points share their voxel with another at the default edge; each far point is alone in its voxel.
        let alone = if config.own.unet.far == FarChoice::Voxels { self.far } else { 0 };
        let unet = (0.5 * self.points as f64 + alone as f64) * BYTES_PER_VOXEL * config.own.unet.width;
        [("UNet", unet as u64), ("rendering", (self.all() * BYTES_PER_GAUSSIAN) as u64)]
    }
}

/// Of a training on `devices` devices.
pub fn of_training(config: &FluxConfig, logs: &Logs, devices: usize) -> Prediction {
    let own = &config.own;
    let rows = |log: &DrivingLog| Rows::of(&own.lift, log.cameras().len());
    let bytes = |place: &Place| rows(&logs.logs[place.log]).snippet_bytes(&logs.logs[place.log], &place.snippet);
    let all: usize = logs.train.iter().map(bytes).sum();
    let largest = logs.train.iter().chain(&logs.held_out).map(bytes).max().unwrap_or(0);
    // Snippets in flight are shared with the library where it keeps them, unless each draw has colours of its own.
    let (kept, in_flight) = (all.min(own.logs.cache_mb << 20), largest * in_flight(own.learning.accumulate, devices));
    let snippets = if own.learning.recolour > 0.0 { kept + in_flight } else { (kept + in_flight).min(all + largest) };
    let most = logs.logs.iter().map(rows).max_by_key(|rows| rows.all()).unwrap_or(Rows::of(&own.lift, 1));
    let [unet, rendering] = most.step(config);
    Prediction { parts: vec![("snippets", snippets as u64), unet, rendering, ("program", PROGRAM_BYTES as u64)] }
}

/// Of the reconstruction of some snippets of a log, one after the other.
pub fn of_reconstruction(config: &FluxConfig, log: &DrivingLog, snippets: &[Snippet]) -> Prediction {
    let rows = Rows::of(&config.own.lift, log.cameras().len());
    let largest = snippets.iter().map(|snippet| rows.snippet_bytes(log, snippet)).max().unwrap_or(0);
    let [unet, rendering] = rows.step(config);
    Prediction { parts: vec![("snippet", largest as u64), unet, rendering, ("program", PROGRAM_BYTES as u64)] }
}

//! Prediction of the memory of a training and of a reconstruction, shown before they start.

use gs_driving::{DrivingLog, Snippet};
use gs_models::flux4d::unet::BYTES_PER_VOXEL;

use super::config::{FarChoice, FluxConfig, LiftSection};
use super::feed::in_flight;
use super::logs::{Logs, Place};
use super::start::RowMotion;
use gs_train::run::memory::Prediction;

/// Bytes that a Gaussian holds in a step: raw channels, activations, projected rows and their gradients, of one view at
/// a time.
const BYTES_PER_GAUSSIAN: usize = 2000;
/// Program, thread stacks and allocator.
const PROGRAM_BYTES: usize = 60 << 20;
/// Copies of the parameters in a training: themselves, the gradients of a step's sum and of a snippet, and Adam's two
/// moments.
const COPIES_IN_A_STEP: usize = 5;
/// Copies while a checkpoint is written: parameters and moments as they were taken off the device.
const COPIES_IN_A_SAVE: usize = 3;
/// Copies in a reconstruction: the checkpoint's bytes and the parameters.
const COPIES_IN_A_PASS: usize = 2;
/// Bytes of a LiDAR point while its sweep is read (its file and each of its columns), and while the sweeps of a snippet
/// are brought together, measured on PandaSet with one, two and three sweeps read at once.
const BYTES_PER_POINT_READ: usize = 160;
const BYTES_PER_POINT_KEPT: usize = 80;
/// A sweep without a file that can be read has this many points, as those of PandaSet.
const USUAL_SWEEP: usize = 170_000;
/// Logs of which a sweep is read to know how many points there are: those of a data set have a few kinds of LiDAR at
/// most.
const LOGS_LOOKED_AT: usize = 4;

/// LiDAR points of the input sweeps of a snippet.
#[derive(Clone, Copy)]
struct Points {
    sweep: usize,
    inputs: usize,
}

impl Points {
    /// Points of the first sweep of a snippet and a quarter more: other sweeps differ by less.
    fn of(log: &DrivingLog, snippet: &Snippet) -> Self {
        let first = log.sweep(snippet.inputs[0]).map_or(USUAL_SWEEP, |sweep| sweep.len());
        Self { sweep: first + first / 4, inputs: snippet.inputs.len() }
    }

    fn all(self) -> usize {
        self.sweep * self.inputs
    }

    /// Bytes of all of them while a snippet is prepared, by this many threads.
    fn bytes(self) -> usize {
        let at_once = self.inputs.min(rayon::current_num_threads());
        self.sweep * (at_once * BYTES_PER_POINT_READ + self.inputs * BYTES_PER_POINT_KEPT)
    }
}

/// Rows of the first Gaussians.
#[derive(Clone, Copy)]
struct Rows {
    points: usize,
    far: usize,
}

impl Rows {
    /// Most rows for logs of so many cameras.
    fn of(lift: &LiftSection, cameras: usize, points: Points) -> Self {
        let points = if lift.points == 0 { points.all() } else { lift.points * cameras };
        Self { points, far: lift.sky_points + lift.random_points }
    }

    fn all(self) -> usize {
        self.points + self.far
    }

    /// A snippet on the host: 8-bit colours and depth of its images; 14 channels and a time; motion and input frame.
    fn snippet_bytes(self, log: &DrivingLog, snippet: &Snippet) -> usize {
        let pixels: usize = log.cameras().iter().map(|camera| camera.width * camera.height).sum();
        7 * snippet.frames.len() * pixels + 60 * self.all() + (size_of::<RowMotion>() + size_of::<u16>()) * self.points
    }

    /// Bytes of the network and of the renderings of a step.
    fn step(self, config: &FluxConfig) -> [(&'static str, u64); 2] {
        // Half of the points share their voxel with another at the default edge; each far point is alone in its voxel.
        let alone = if config.own.unet.far == FarChoice::Voxels { self.far } else { 0 };
        let unet = (0.5 * self.points as f64 + alone as f64) * BYTES_PER_VOXEL * config.own.unet.width;
        [("UNet", unet as u64), ("rendering", (self.all() * BYTES_PER_GAUSSIAN) as u64)]
    }
}

/// Bytes of copies of all parameters.
fn network(parameters: usize, copies: usize) -> (&'static str, u64) {
    ("network", (size_of::<f32>() * parameters * copies) as u64)
}

/// The memory of a training of a network of so many `parameters` on `devices` devices.
pub fn of_training(config: &FluxConfig, logs: &Logs, parameters: usize, devices: usize) -> Prediction {
    let own = &config.own;
    let points = most_points(logs);
    let rows = |log: &DrivingLog| Rows::of(&own.lift, log.cameras().len(), points);
    let bytes = |place: &Place| rows(&logs.logs[place.log]).snippet_bytes(&logs.logs[place.log], &place.snippet);
    let all: usize = logs.train.iter().map(bytes).sum();
    let largest = logs.train.iter().chain(&logs.held_out).map(bytes).max().unwrap_or(0);
    // Snippets in flight are shared with the library where it keeps them, unless each draw has colours of its own.
    let (kept, in_flight) = (all.min(own.logs.cache_mb << 20), largest * in_flight(own.learning.accumulate, devices));
    let snippets = if own.learning.recolour > 0.0 { kept + in_flight } else { (kept + in_flight).min(all + largest) };
    let most = logs.logs.iter().map(rows).max_by_key(|rows| rows.all()).unwrap_or(Rows::of(&own.lift, 1, points));
    let [unet, rendering] = most.step(config);
    let network = network(parameters, devices * COPIES_IN_A_STEP + COPIES_IN_A_SAVE);
    // Each feed prepares one snippet while a step computes, and a measurement another one.
    let sweeps = ("sweeps", ((devices + 1) * points.bytes()) as u64);
    let program = ("program", PROGRAM_BYTES as u64);
    Prediction { parts: vec![("snippets", snippets as u64), sweeps, network, unet, rendering, program] }
}

/// The most points of the snippets of some logs.
fn most_points(logs: &Logs) -> Points {
    let every = logs.train.len().div_ceil(LOGS_LOOKED_AT).max(1);
    let some = logs.train.iter().step_by(every).map(|place| Points::of(&logs.logs[place.log], &place.snippet));
    some.max_by_key(|points| points.all()).unwrap_or(Points { sweep: USUAL_SWEEP, inputs: 1 })
}

/// The memory of the reconstruction of some snippets of a log, one after the other, by a network of so many
/// `parameters`.
pub fn of_reconstruction(config: &FluxConfig, log: &DrivingLog, parameters: usize, snippets: &[Snippet]) -> Prediction {
    let points = snippets.iter().max_by_key(|snippet| snippet.inputs.len()).map(|snippet| Points::of(log, snippet));
    let points = points.unwrap_or(Points { sweep: USUAL_SWEEP, inputs: 1 });
    let rows = Rows::of(&config.own.lift, log.cameras().len(), points);
    let largest = snippets.iter().map(|snippet| rows.snippet_bytes(log, snippet)).max().unwrap_or(0);
    let [unet, rendering] = rows.step(config);
    let network = network(parameters, COPIES_IN_A_PASS);
    let (sweeps, program) = (("sweeps", points.bytes() as u64), ("program", PROGRAM_BYTES as u64));
    Prediction { parts: vec![("snippet", largest as u64), sweeps, network, unet, rendering, program] }
}

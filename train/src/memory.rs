//! How much memory a run will take, said before it starts.

use std::fmt;

use gs_datasets::{Scene, View};

use crate::experiment::Config;
use crate::parameters::Group;

/// Bytes a run is expected to need at its peak, by what they are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Prediction {
    /// Parameters and both moments of every Gaussian at the cap.
    pub gaussians: u64,
    /// What one step adds: gradients, projected rows, intersection lists, images and SSIM maps.
    pub step: u64,
    /// The photos, as 8 bits and as cached floats.
    pub photos: u64,
    /// The program itself, its thread stacks and allocator slack.
    pub program: u64,
}

/// Projected row, colours, opacity and their gradients, per Gaussian, bytes: 2 (8 + 3 + 1) floats, the screen row and sums.
const STEP_BYTES_PER_GAUSSIAN: u64 = 4 * (2 * 12 + 8);

/// Tiles a Gaussian touches, on average over the scenes tried.
const TILES_PER_GAUSSIAN: u64 = 6;

/// Bytes of one intersection: sorted row number and position, and key and value of the sort twice.
const BYTES_PER_INTERSECTION: u64 = 32;

/// Floats per pixel of one step: image, alpha, loss image, their gradients (3 + 1 each), SSIM's three maps of three
/// channels and its work space.
const STEP_FLOATS_PER_PIXEL: u64 = 3 * 4 + 9 + 9;

/// Measured on Linux with the CPU backend.
const PROGRAM_BYTES: u64 = 40 << 20;

impl Prediction {
    /// The peak for training `scene` as `config` says.
    pub fn new(scene: &Scene, config: &Config) -> Self {
        let cap = match config.density.strategy {
            crate::density::Strategy::None => first_count(scene, config),
            _ => config.density.cap as u64,
        };
        let floats: u64 = Group::ALL.iter().map(|group| group.columns(config.model.sh_degree) as u64).sum();
        let pixels = |view: &View| (view.width * view.height) as u64;
        let views = || scene.train.iter().chain(&scene.test);
        let all_pixels: u64 = views().map(pixels).sum();
        let largest: u64 = views().map(pixels).max().unwrap_or(0);
        // Masks as found.
        let moving = config.pipeline == crate::experiment::Pipeline::Taylormode;
        let masks = if moving { scene.train.iter().map(pixels).sum::<u64>() } else { 0 };
        let cached = (12 * all_pixels).min((config.data.cache_mb as u64) << 20);
        Self {
            gaussians: 3 * 4 * floats * cap,
            step: cap * (4 * floats + STEP_BYTES_PER_GAUSSIAN + TILES_PER_GAUSSIAN * BYTES_PER_INTERSECTION)
                + 4 * STEP_FLOATS_PER_PIXEL * largest,
            photos: views().map(stored_bytes).sum::<u64>() + masks + cached,
            program: PROGRAM_BYTES,
        }
    }

    /// All together.
    pub fn total(&self) -> u64 {
        self.gaussians + self.step + self.photos + self.program
    }
}

/// What a view keeps in memory: photo, mask, priors, truth.
fn stored_bytes(view: &View) -> u64 {
    let (priors, truth) = (&view.priors, &view.truth);
    let images = [Some(&view.image), priors.sharp.as_ref(), truth.sharp.as_ref(), truth.blurry.as_ref()];
    let masks = [&view.mask, &priors.moving, &truth.moving, &truth.moving_union];
    let floats = [priors.depth.as_ref().map(|depth| &depth.values), truth.depth.as_ref(), truth.velocity.as_ref()];
    let sum = images.into_iter().flatten().map(|image| image.data.len()).sum::<usize>()
        + masks.into_iter().flatten().map(Vec::len).sum::<usize>()
        + floats.into_iter().flatten().map(|values| 4 * values.len()).sum::<usize>();
    sum as u64
}

fn first_count(scene: &Scene, config: &Config) -> u64 {
    let points = scene.points.as_ref().map_or(config.init.random_points, |points| points.len());
    points.min(config.density.cap) as u64
}

impl fmt::Display for Prediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} (Gaussians {}, step {}, photos {}, program {})",
            megabytes(self.total()),
            megabytes(self.gaussians),
            megabytes(self.step),
            megabytes(self.photos),
            megabytes(self.program)
        )
    }
}

/// Bytes for people.
pub fn megabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.0} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.0} MB", bytes as f64 / 1e6),
        _ => format!("{:.2} GB", bytes as f64 / 1e9),
    }
}

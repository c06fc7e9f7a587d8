//! Prediction of the memory that a run needs, shown before it starts.

use std::fmt;

use gs_datasets::{Scene, View, surveyed};

use crate::config::{FitConfig, InitConfig, Strategy};
use crate::fit::intake::Intake;
use crate::fit::parameters::Group;
use crate::fit::session::AHEAD;
use crate::fit::shutter::most_instants;
use crate::fit::told::Told;

/// Predicted peak memory, by purpose.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Prediction {
    /// Purpose, and bytes.
    pub parts: Vec<(&'static str, u64)>,
}

/// Bytes per Gaussian of projected row, colours, opacity and their gradients: 2 (8 + 3 + 1) floats, the screen row and
/// sums.
const STEP_BYTES_PER_GAUSSIAN: u64 = 4 * (2 * 12 + 8);

/// Tiles that a Gaussian touches: 1.6 to 3.2 in the scenes tried, at 320 to 480 pixels of width.
const TILES_PER_GAUSSIAN: u64 = 3;

/// Bytes of one intersection in its list: sorted row number and position, key and value of the sort twice, and the
/// blocks it reached.
const BYTES_PER_INTERSECTION: u64 = 36;

/// Bytes of one intersection in the backward pass: gradients of its projected row, opacity and channels.
const BACKWARD_BYTES_PER_INTERSECTION: u64 = 4 * 12;

/// Floats per pixel of a rendering without gradients: colour, alpha, transmittance and last index.
const RENDERING_FLOATS_PER_PIXEL: u64 = 6;

/// Floats per Gaussian of a rendering without gradients: projected row, colour, opacity, and the means and orientations
/// of the instant.
const RENDERING_FLOATS_PER_GAUSSIAN: u64 = 8 + 3 + 1 + 7;

/// Floats per pixel of one step: image, alpha, loss image, their gradients (3 + 1 each), SSIM's three maps of three
/// channels and its work space.
const STEP_FLOATS_PER_PIXEL: u64 = 3 * 4 + 9 + 9;

/// Bytes per pixel of a photo that is being decoded: of the file as it is, and of the view. One of more than 8 bits is
/// held as floats too, with an alpha where it is in linear light.
const DECODING_BYTES_PER_PIXEL: [u64; 2] = [6, 34];

/// Program (23 MiB of it are read), thread stacks and allocator; measured on Linux with the CPU backend.
const PROGRAM_BYTES: u64 = 48 << 20;

/// Pixels of a photo.
pub fn pixels(view: &View) -> u64 {
    (view.width * view.height) as u64
}

/// Pixels of the largest photo, held-out ones included.
pub fn largest_photo(scene: &Scene) -> u64 {
    scene.train.iter().chain(scene.held_out_views()).map(pixels).max().unwrap_or(0)
}

/// Bytes of a rendering of `gaussians` in `pixels`, without gradients, beside the Gaussians themselves.
pub fn of_rendering(gaussians: u64, pixels: u64) -> u64 {
    let lists = TILES_PER_GAUSSIAN * BYTES_PER_INTERSECTION;
    gaussians * (4 * RENDERING_FLOATS_PER_GAUSSIAN + lists) + 4 * RENDERING_FLOATS_PER_PIXEL * pixels
}

impl Prediction {
    /// Predicted peak of fitting `scene` with `config`:
    ///
    /// - Gaussians: parameters and both moments of every Gaussian at the cap;
    /// - step: gradients, projected rows, intersection lists, images and SSIM maps of one step;
    /// - instants of an exposure: the renderings of a photo beside the first, if cameras move;
    /// - photos: as 8 bits, at reduced widths, and as cached floats; where they are decoded when they are asked for,
    ///   the bound and those in use;
    /// - the method's own data;
    /// - program: the program itself, its thread stacks and allocator slack.
    pub fn of_fit<M: Intake + Told>(scene: &Scene, config: &FitConfig<M::Config>) -> Self {
        let cap = match config.density.strategy {
            Strategy::None => initial_count(scene, &config.init, config.density.cap),
            _ => config.density.cap as u64,
        };
        let floats: u64 = Group::ALL.iter().map(|group| group.columns(config.model.sh_degree) as u64).sum();
        let views = || scene.train.iter().chain(scene.held_out_views());
        let all_pixels: u64 = views().map(pixels).sum();
        let largest = largest_photo(scene);
        // A half and a quarter of the width.
        let reduced = match M::ANY_WIDTH && config.data.coarse_share > 0.0 {
            true => scene.train.iter().map(|view| stored_bytes(view) * 5 / 16).sum::<u64>(),
            false => 0,
        };
        let cached = (12 * all_pixels).min((config.data.cache_mb as u64) << 20);
        let intersection = BYTES_PER_INTERSECTION + BACKWARD_BYTES_PER_INTERSECTION;
        let (name, stored) = match scene.train.first().is_some_and(|view| view.source.is_some()) {
            false => ("photos", views().map(stored_bytes).sum::<u64>() + reduced),
            true => {
                let surveyed = surveyed(&scene.train);
                let is_deep = surveyed.iter().any(|view| view.fine.is_some());
                let in_use = (AHEAD as u64 + 1) * DECODING_BYTES_PER_PIXEL[usize::from(is_deep)] * largest;
                let surveyed = surveyed.iter().map(stored_bytes).sum::<u64>();
                let bound = (config.data.memory_mb as u64) << 20;
                ("photos decoded when asked for, by data.memory_mb", bound.max(surveyed) + in_use)
            }
        };
        let mut parts = vec![
            ("Gaussians", 3 * 4 * floats * cap),
            (
                "step",
                cap * (4 * floats + STEP_BYTES_PER_GAUSSIAN + TILES_PER_GAUSSIAN * intersection)
                    + 4 * STEP_FLOATS_PER_PIXEL * largest,
            ),
            (name, stored + cached),
        ];
        if config.camera.motion > 0 {
            let further = most_instants(&config.camera) as u64 - 1;
            parts.push(("instants of an exposure", further * of_rendering(cap, largest)));
        }
        parts.extend(M::blur().map(|blur| blur.memory(scene, config)).unwrap_or_default());
        parts.push(("program", PROGRAM_BYTES));
        Self { parts }
    }

    /// Sum of all parts.
    pub fn total(&self) -> u64 {
        self.parts.iter().map(|(_, bytes)| bytes).sum()
    }
}

/// Bytes of a view in memory: photo, its rests at 16 bits, mask, priors, truth.
fn stored_bytes(view: &View) -> u64 {
    let (priors, truth) = (&view.priors, &view.truth);
    let images = [Some(&view.image), priors.sharp.as_ref(), truth.sharp.as_ref(), truth.blurry.as_ref()];
    let masks = [&view.mask, &priors.moving, &truth.moving, &truth.moving_union];
    let floats = [priors.depth.as_ref().map(|depth| &depth.values), truth.depth.as_ref(), truth.velocity.as_ref()];
    let sum = images.into_iter().flatten().map(|image| image.data.len()).sum::<usize>()
        + view.fine.as_ref().map_or(0, Vec::len)
        + masks.into_iter().flatten().map(Vec::len).sum::<usize>()
        + floats.into_iter().flatten().map(|values| 4 * values.len()).sum::<usize>();
    sum as u64
}

fn initial_count(scene: &Scene, init: &InitConfig, cap: usize) -> u64 {
    let given = scene.points.as_ref().map_or(init.random_points, |points| points.len());
    given.max((init.dense_share * cap as f64) as usize).min(cap) as u64
}

impl fmt::Display for Prediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> =
            self.parts.iter().map(|(name, bytes)| format!("{name} {}", megabytes(*bytes))).collect();
        write!(f, "{} ({})", megabytes(self.total()), parts.join(", "))
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

//! Priors with the faults that networks make: what a depth, segmentation or deblurring network might have said.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::named::named;
use crate::random::gaussian;

/// How wrong the priors are. [`PriorFaults::default`] is about what today's networks leave; [`PriorFaults::none`]
/// writes the truth as prior. Lengths in pixels are at a width of 256 and grow with the image.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorFaults {
    /// Each frame's depth is multiplied by a factor between 1 / (1 + this) and 1 + this; at least 0.
    pub depth_scale: f64,
    /// Each frame's depth is shifted by up to this share of the frame's mean depth, either way; 0 to 1.
    pub depth_shift: f64,
    /// Standard deviation of the depth's noise as a share of depth, half of its variance in patches of 16 pixels; 0 to
    /// 1.
    pub depth_noise: f64,
    /// Share of pixels whose depth is replaced by a random one of the frame's range; 0 to 1.
    pub depth_outliers: f64,
    /// Depth is written as inverse depth (1 / z), and scale, shift and noise apply to that.
    pub inverse_depth: bool,
    /// How far the masks' outlines stray, pixels; each mask as a whole is also wider or narrower by up to half of it.
    pub mask_edge: f64,
    /// The share of the exposure whose blur a pseudo-sharp image keeps; 0 (sharp) to 1 (no better than the photo).
    pub sharp_blur: f64,
    /// Standard deviation of a pseudo-sharp image's noise, encoded values from 0 to 1.
    pub sharp_noise: f64,
}

named! {
    /// A fault that priors can have, of the size in which networks have it today.
    pub enum PriorFault {
        /// Depth up to a scale and a shift per frame.
        DepthAffine = "depth-affine",
        /// Depth with fine and coarse noise.
        DepthNoise = "depth-noise",
        /// One pixel in twenty has a random depth of the frame's range.
        DepthOutliers = "depth-outliers",
        /// Inverse depth is written.
        InverseDepth = "inverse-depth",
        /// Masks with ragged outlines.
        Masks = "masks",
        /// Pseudo-sharp photos keep a third of the blur.
        Sharp = "sharp",
    }
}

impl PriorFault {
    /// The faults of [`PriorFaults::default`].
    pub const USUAL: [Self; 4] = [Self::DepthAffine, Self::DepthNoise, Self::Masks, Self::Sharp];
}

impl Default for PriorFaults {
    fn default() -> Self {
        Self::of(&PriorFault::USUAL)
    }
}

impl PriorFaults {
    /// Priors that are the truth: metric depth, exact masks, sharp images.
    pub fn none() -> Self {
        Self {
            depth_scale: 0.0,
            depth_shift: 0.0,
            depth_noise: 0.0,
            depth_outliers: 0.0,
            inverse_depth: false,
            mask_edge: 0.0,
            sharp_blur: 0.0,
            sharp_noise: 0.0,
        }
    }

    /// Priors with these faults alone.
    pub fn of(faults: &[PriorFault]) -> Self {
        let mut all = Self::none();
        for fault in faults {
            match fault {
                PriorFault::DepthAffine => (all.depth_scale, all.depth_shift) = (0.25, 0.1),
                PriorFault::DepthNoise => all.depth_noise = 0.01,
                PriorFault::DepthOutliers => all.depth_outliers = 0.05,
                PriorFault::InverseDepth => all.inverse_depth = true,
                PriorFault::Masks => all.mask_edge = 2.0,
                PriorFault::Sharp => (all.sharp_blur, all.sharp_noise) = (1.0 / 3.0, 0.01),
            }
        }
        all
    }

    /// The value of `depth_kind` in the JSON for these priors.
    pub(super) fn depth_kind(&self) -> &'static str {
        let is_metric = self.depth_scale == 0.0 && self.depth_shift == 0.0;
        match (self.inverse_depth, is_metric) {
            (true, _) => "inverse_depth",
            (false, true) => "metric_z",
            (false, false) => "depth",
        }
    }
}

/// Side of the patches of coarse noise, pixels at a width of 256.
const PATCH: f64 = 16.0;

/// Side of the ragged bits of a mask's outline, pixels at a width of 256.
const RAG: f64 = 7.0;

/// Nothing is nearer than this share of the mean, so that a shift leaves depth positive.
const DEPTH_MIN: f64 = 0.05;

/// A depth prior `[height, width]` from true camera z; 0 (unknown) stays.
pub(super) fn depth(truth: &[f32], width: usize, faults: &PriorFaults, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let into = |z: f32| if faults.inverse_depth { 1.0 / f64::from(z) } else { f64::from(z) };
    let known: Vec<f64> = truth.iter().filter(|z| **z > 0.0).map(|z| into(*z)).collect();
    if known.is_empty() {
        return truth.to_vec();
    }
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    let (low, high) = known.iter().fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(*z), high.max(*z)));
    let scale = ((1.0 + faults.depth_scale).ln() * rng.random_range(-1.0..=1.0)).exp();
    let shift = mean * faults.depth_shift * rng.random_range(-1.0..=1.0);
    let patches = Patches::new(width, truth.len() / width, PATCH, rng);
    // Two independent halves; interpolation between patches leaves less than half, which nobody will miss.
    let spread = faults.depth_noise * 0.5_f64.sqrt();
    let mut out = Vec::with_capacity(truth.len());
    for (index, z) in truth.iter().enumerate() {
        let noise = spread * (patches.at(index % width, index / width) + gaussian(rng));
        let random = faults.depth_outliers > 0.0 && rng.random_bool(faults.depth_outliers);
        let value = if random { rng.random_range(low..=high) } else { into(*z) };
        let wrong = (scale * value * (1.0 + noise) + shift).max(DEPTH_MIN * mean);
        out.push(if *z > 0.0 { wrong as f32 } else { 0.0 });
    }
    out
}

/// A mask prior `[height, width]` from a true one: pixels are in it up to a random distance from the true outline.
pub(super) fn mask(truth: &[u8], width: usize, faults: &PriorFaults, rng: &mut ChaCha8Rng) -> Vec<u8> {
    if faults.mask_edge == 0.0 {
        return truth.to_vec();
    }
    let height = truth.len() / width;
    let edge = faults.mask_edge * width as f64 / 256.0;
    let bias = 0.5 * edge * rng.random_range(-1.0..=1.0);
    let rags = Patches::new(width, height, RAG, rng);
    let inside = distance_to(truth, width, 0);
    let outside = distance_to(truth, width, 255);
    (0..truth.len())
        .map(|index| {
            // Half a pixel: the outline runs between pixel centres.
            let signed = if truth[index] > 0 { inside[index] - 0.5 } else { 0.5 - outside[index] };
            let grown = signed + bias + edge * rags.at(index % width, index / width);
            if grown > 0.0 { 255 } else { 0 }
        })
        .collect()
}

/// A pseudo-sharp image from a partly blurred one, encoded, `[height, width, 3]`.
pub(super) fn sharp(partly: &[u8], faults: &PriorFaults, rng: &mut ChaCha8Rng) -> Vec<u8> {
    if faults.sharp_noise == 0.0 {
        return partly.to_vec();
    }
    let spread = 255.0 * faults.sharp_noise;
    partly.iter().map(|value| (f64::from(*value) + spread * gaussian(rng)).round().clamp(0.0, 255.0) as u8).collect()
}

/// Normal noise on a coarse grid, interpolated.
struct Patches {
    values: Vec<f64>,
    columns: usize,
    side: f64,
}

impl Patches {
    fn new(width: usize, height: usize, side: f64, rng: &mut ChaCha8Rng) -> Self {
        let side = (side * width as f64 / 256.0).max(2.0);
        let columns = (width as f64 / side).ceil() as usize + 2;
        let rows = (height as f64 / side).ceil() as usize + 2;
        Self { values: (0..columns * rows).map(|_| gaussian(rng)).collect(), columns, side }
    }

    fn at(&self, x: usize, y: usize) -> f64 {
        let (u, v) = (x as f64 / self.side, y as f64 / self.side);
        let (column, row) = (u as usize, v as usize);
        let (s, t) = (u - column as f64, v - row as f64);
        let value = |dx: usize, dy: usize| self.values[(row + dy) * self.columns + column + dx];
        let mix = |a: f64, b: f64, share: f64| a + (b - a) * share;
        mix(mix(value(0, 0), value(1, 0), s), mix(value(0, 1), value(1, 1), s), t)
    }
}

/// How far each pixel is from the nearest one with `value`, pixels: chamfer steps of 1 and the root of 2, within 8 % of
/// the true distance. Large where there is none.
fn distance_to(mask: &[u8], width: usize, value: u8) -> Vec<f64> {
    let height = mask.len() / width;
    let mut distance: Vec<f64> = mask.iter().map(|m| if (*m > 0) == (value > 0) { 0.0 } else { 1e6 }).collect();
    let mut relax = |x: usize, y: usize, steps: [(isize, isize); 4]| {
        for (dx, dy) in steps {
            let (Some(nx), Some(ny)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
            if nx < width && ny < height {
                let step = if dx != 0 && dy != 0 { std::f64::consts::SQRT_2 } else { 1.0 };
                let through = distance[ny * width + nx] + step;
                let here = &mut distance[y * width + x];
                *here = here.min(through);
            }
        }
    };
    for y in 0..height {
        for x in 0..width {
            relax(x, y, [(-1, 0), (0, -1), (-1, -1), (1, -1)]);
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            relax(x, y, [(1, 0), (0, 1), (1, 1), (-1, 1)]);
        }
    }
    distance
}

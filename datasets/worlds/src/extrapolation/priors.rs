//! Depth and confidence as a feed-forward reconstructor gives them: known up to a scale and a shift for each view,
//! smeared at depth edges, with a confidence that is low there.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::random::gaussian;

/// How wrong the priors are. The default is about what feed-forward reconstructors leave after their scale is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorErrors {
    /// Each view's depth is multiplied by a factor between 1 - this and 1 + this; 0 to 0.9.
    pub scale: f64,
    /// Each view's depth is shifted by up to this share of its mean depth, either way; 0 to 0.9.
    pub shift: f64,
    /// Standard deviation of the depth's noise as a share of depth; 0 to 1.
    pub noise: f64,
    /// Share of pixels whose depth is replaced by a random one of the view's range; 0 to 1.
    pub outliers: f64,
    /// Depth at depth edges is the mean over 3 x 3 pixels, which lies between the surfaces.
    pub bleeding: bool,
}

impl Default for PriorErrors {
    fn default() -> Self {
        Self { scale: 0.03, shift: 0.01, noise: 0.005, outliers: 0.01, bleeding: true }
    }
}

impl PriorErrors {
    /// Depth that is the truth.
    pub fn none() -> Self {
        Self { scale: 0.0, shift: 0.0, noise: 0.0, outliers: 0.0, bleeding: false }
    }
}

/// Neighbours whose depths differ by more than this share are on two sides of an edge. A floor at 75 degrees from the
/// normal changes by 3 % from pixel to pixel of a 160 pixel wide image.
const EDGE: f64 = 0.05;

/// Confidences as VGGT gives them: 1 where it knows nothing, around 10 on surfaces; its viewer draws points from 5 on.
const NOTHING: f32 = 1.0;
const AT_EDGE: f64 = 1.6;
const AT_OUTLIER: f64 = 1.3;
const ON_SURFACE: f64 = 10.0;

/// Standard deviation of the logarithm of the confidence less 1.
const CONFIDENCE_SPREAD: f64 = 0.2;

/// Nothing is nearer than this share of the mean, so that errors leave depth positive.
const DEPTH_MIN: f64 = 0.02;

/// The prior of one view.
pub(super) struct Prior {
    /// `[height, width]` camera z up to a scale and a shift; 0 where nothing is met.
    pub depth: Vec<f32>,
    /// `[height, width]`, at least 1.
    pub confidence: Vec<f32>,
}

/// A prior from true camera z `[height, width]`, 0 where nothing is met.
pub(super) fn prior(truth: &[f32], width: usize, errors: &PriorErrors, rng: &mut ChaCha8Rng) -> Prior {
    let known: Vec<f64> = truth.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)).collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let (low, high) = known.iter().fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(*z), high.max(*z)));
    let scale = 1.0 + errors.scale * rng.random_range(-1.0..=1.0);
    let shift = mean * errors.shift * rng.random_range(-1.0..=1.0);
    let (mut depth, mut confidence) = (Vec::with_capacity(truth.len()), Vec::with_capacity(truth.len()));
    for (index, z) in truth.iter().enumerate() {
        // The same draws at every pixel, so that one error does not change the others.
        let (noise, spread) = (gaussian(rng), gaussian(rng));
        let (chance, other): (f64, f64) = (rng.random(), rng.random());
        if *z <= 0.0 {
            depth.push(0.0);
            confidence.push(NOTHING);
            continue;
        }
        let around = Around::of(truth, width, index);
        let is_outlier = chance < errors.outliers;
        let value = match (is_outlier, errors.bleeding && around.is_step) {
            (true, _) => low + (high - low) * other,
            (false, true) => around.mean,
            (false, false) => f64::from(*z),
        };
        let wrong = scale * value * (1.0 + errors.noise * noise) + shift;
        // Exact where no error is asked for.
        depth.push(wrong.max(DEPTH_MIN * mean) as f32);
        let usual = if is_outlier {
            AT_OUTLIER
        } else if around.is_step || around.is_border {
            AT_EDGE
        } else {
            ON_SURFACE
        };
        confidence.push((1.0 + (usual - 1.0) * (CONFIDENCE_SPREAD * spread).exp()) as f32);
    }
    Prior { depth, confidence }
}

/// The 3 x 3 pixels around one.
struct Around {
    /// A depth differs from the middle's by more than [`EDGE`].
    is_step: bool,
    /// Nothing is met at one of them.
    is_border: bool,
    /// Mean depth of those that meet something.
    mean: f64,
}

impl Around {
    fn of(depth: &[f32], width: usize, index: usize) -> Self {
        let height = depth.len() / width;
        let (x, y) = (index % width, index / width);
        let middle = f64::from(depth[index]);
        let (mut sum, mut count) = (0.0, 0.0);
        let mut around = Self { is_step: false, is_border: false, mean: middle };
        for row in y.saturating_sub(1)..=(y + 1).min(height - 1) {
            for column in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                let z = f64::from(depth[row * width + column]);
                if z <= 0.0 {
                    around.is_border = true;
                    continue;
                }
                around.is_step |= (z - middle).abs() > EDGE * middle;
                sum += z;
                count += 1.0;
            }
        }
        around.mean = sum / count;
        around
    }
}

//! Depth priors beside photos: one scale and one shift per photo, in the prior's own space, and the losses against
//! them.
//!
//! Networks give depth, or inverse depth, up to an affine map that differs from photo to photo; one pair for all
//! photos, or one fitted in the other space, bends the prior. The fit is against depths that are already in scene units
//! (rendered, or of triangulated points), and holds out against a fifth of them being wrong: it starts from medians,
//! then twice rejects outliers and fits the rest by weighted least squares. The fit runs on the host and has no
//! gradient.
//!
//! Two losses compare rendered depth with a prior: [`depth_loss`] (TaylorMoDe-GS, Eq. 16) after such a fit, and
//! [`depth_correlation_loss`] without one.

use burn::tensor::Tensor;
use gs_base::median;
use gs_burn::ops::sum::sum;
use gs_burn::profile;

/// In which space a prior is an affine image of the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthSpace {
    /// Camera z.
    Depth,
    /// One over camera z, as most networks give.
    InverseDepth,
}

/// Fewer common pixels than this fix two numbers only on paper.
const FEWEST: usize = 16;
/// The start uses at most this many pixels: sorting more takes longer and moves a median by less than a hundredth of
/// the deviation.
const START_PIXELS: usize = 4096;
/// Passes of rejection and least squares.
const PASSES: usize = 2;
/// Residuals beyond this many standard deviations are rejected: 0.3 % of good ones.
const REJECT: f64 = 3.0;
/// Median absolute to standard deviation, for a normal distribution.
const DEVIATION: f64 = 1.4826;
/// A perfect prior has no deviation; residuals of this share of the median value are rounding in `f32`.
const ROUNDING: f64 = 1e-5;

/// `epsilon` of [`depth_loss`], scene units. Below it depths are the same to the loss; the renderer shows nothing
/// nearer.
pub const DEPTH_EPSILON: f64 = 0.01;
/// Standard deviation below which a depth map is flat, in the map's unit.
const RELIEF: f64 = 1e-6;

/// `scale * prior + shift` is depth, or inverse depth, in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// The space of prior and result.
    pub space: DepthSpace,
    /// Positive.
    pub scale: f64,
    /// In scene units, or one over them.
    pub shift: f64,
    /// Share of the common pixels that the last fit used, 0 to 1.
    pub inliers: f64,
    /// Standard deviation of their residuals, in the unit of `shift`.
    pub deviation: f64,
}

/// Aligns `prior` to `reference` (camera z, scene units), a value a pixel each; 0 or not finite means unknown.
/// `weights`, not negative, say how sure each reference is, such as the rendering's alpha; all 1 without them.
///
/// None when too few pixels are known in both, when the prior is flat, or when it says near where the reference says
/// far: then nothing can be learned from it.
///
/// # Panics
/// When lengths differ.
pub fn align(prior: &[f32], reference: &[f32], weights: Option<&[f32]>, space: DepthSpace) -> Option<Alignment> {
    assert_eq!(prior.len(), reference.len(), "pixels of prior and reference");
    assert!(weights.is_none_or(|weights| weights.len() == prior.len()), "pixels of prior and weights");
    let _stage = profile::stage("depth alignment");
    let point = |i: usize| {
        let (x, z) = (f64::from(prior[i]), f64::from(reference[i]));
        let weight = weights.map_or(1.0, |weights| f64::from(weights[i]));
        let known = x.is_finite() && x != 0.0 && z.is_finite() && z > 0.0 && weight > 0.0;
        let y = match space {
            DepthSpace::Depth => z,
            DepthSpace::InverseDepth => 1.0 / z,
        };
        known.then_some(Point { x, y, weight })
    };
    let points: Vec<Point> = (0..prior.len()).filter_map(point).collect();
    if points.len() < FEWEST {
        return None;
    }
    let mut fit = start(&points)?;
    let (mut inliers, mut deviation) = (0.0, 0.0);
    for _ in 0..PASSES {
        let floor = ROUNDING * median(thinned(&points).map(|p| p.y.abs()).collect())?;
        let cut = (REJECT * DEVIATION * median(thinned(&points).map(|p| fit.residual(p).abs()).collect())?).max(floor);
        let good: Vec<Point> = points.iter().filter(|p| fit.residual(p).abs() <= cut).copied().collect();
        fit = least_squares(&good)?;
        inliers = good.len() as f64 / points.len() as f64;
        let total: f64 = good.iter().map(|p| p.weight).sum();
        deviation = (good.iter().map(|p| p.weight * fit.residual(p).powi(2)).sum::<f64>() / total).sqrt();
    }
    let Line { scale, shift } = fit;
    (scale > 0.0).then_some(Alignment { space, scale, shift, inliers, deviation })
}

impl Alignment {
    /// The prior as camera z in scene units; 0 where it is unknown or comes out behind the camera.
    pub fn depth(&self, prior: &[f32]) -> Vec<f32> {
        let one = |x: &f32| {
            let value = self.scale * f64::from(*x) + self.shift;
            let depth = match self.space {
                DepthSpace::Depth => value,
                DepthSpace::InverseDepth => 1.0 / value,
            };
            let known = x.is_finite() && *x != 0.0 && value > 0.0 && (depth as f32).is_finite();
            if known { depth as f32 } else { 0.0 }
        };
        prior.iter().map(one).collect()
    }
}

/// TaylorMoDe-GS, Eq. 16, between rendered and aligned prior depth `[H, W, 1]`, camera z in scene units. Pixels where
/// either is unknown (0) are left out of the sum; the prior gets no gradient.
pub fn depth_loss(rendered: Tensor<3>, prior: Tensor<3>) -> Tensor<1> {
    let _stage = profile::stage("depth loss");
    let prior = prior.detach();
    let pixels = prior.shape().num_elements();
    let known = prior.clone().greater_scalar(0.0).bool_and(rendered.clone().greater_scalar(0.0));
    let known = known.float().cast(rendered.dtype());
    // The floor keeps the logarithm, and its gradient, finite where the factor takes the pixel out.
    let log = |depth: Tensor<3>| (depth.clamp_min(0.0) + DEPTH_EPSILON).log();
    let difference = (log(rendered) - log(prior)).abs() * known;
    sum(difference) / pixels as f64
}

/// One less the correlation (Pearson's) of rendered depth `[H, W, 1]` (camera z, scene units) with a prior, over the
/// pixels where both are known: 0 for a prior that is any scale and shift of the truth in its own `space`, 2 for its
/// mirror image. Not part of the paper: the loss of those who do not fit scale and shift. The prior gets no gradient;
/// zero where either has no relief.
pub fn depth_correlation_loss(rendered: Tensor<3>, prior: Tensor<3>, space: DepthSpace) -> Tensor<1> {
    let _stage = profile::stage("depth loss");
    let prior = prior.detach();
    let known = prior.clone().not_equal_elem(0.0).bool_and(rendered.clone().greater_scalar(DEPTH_EPSILON));
    let known = known.float().cast(rendered.dtype());
    let rendered = match space {
        DepthSpace::Depth => rendered,
        DepthSpace::InverseDepth => rendered.clamp_min(DEPTH_EPSILON).recip(),
    };
    let count = sum(known.clone()).clamp_min(1.0);
    let centred = |x: Tensor<3>| {
        let mean = sum(x.clone() * known.clone()) / count.clone();
        (x - mean.reshape([1, 1, 1])) * known.clone()
    };
    let (a, b) = (centred(rendered), centred(prior));
    let mean = |x: Tensor<3>| sum(x) / count.clone();
    let (variance, other) = (mean(a.clone().square()), mean(b.clone().square()));
    // Flat maps have no correlation; the floor keeps its gradient finite.
    let least = RELIEF * RELIEF;
    let has_relief = variance.clone().greater_scalar(least).bool_and(other.clone().greater_scalar(least));
    let correlation = mean(a * b) / (variance.clamp_min(least) * other.clamp_min(least)).sqrt();
    (correlation.neg() + 1.0) * has_relief.float().cast(known.dtype())
}

#[derive(Clone, Copy)]
struct Point {
    x: f64,
    y: f64,
    weight: f64,
}

#[derive(Clone, Copy)]
struct Line {
    scale: f64,
    shift: f64,
}

impl Line {
    fn residual(&self, point: &Point) -> f64 {
        point.y - self.scale * point.x - self.shift
    }
}

/// Theil 1950 and Sen 1968, on pairs half the range apart: the median slope, which a fifth of wrong points leaves in
/// place since 0.8^2 = 64 % of the pairs are then right.
fn start(points: &[Point]) -> Option<Line> {
    let mut sorted: Vec<Point> = thinned(points).copied().collect();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x));
    let (low, high) = sorted.split_at(sorted.len() / 2);
    let pairs = low.iter().zip(high).filter(|(a, b)| b.x > a.x);
    let slopes: Vec<f64> = pairs.map(|(a, b)| (b.y - a.y) / (b.x - a.x)).collect();
    if slopes.len() < FEWEST / 2 {
        return None;
    }
    let scale = median(slopes)?;
    let shift = median(sorted.iter().map(|p| p.y - scale * p.x).collect())?;
    Some(Line { scale, shift })
}

fn least_squares(points: &[Point]) -> Option<Line> {
    let total: f64 = points.iter().map(|p| p.weight).sum();
    let mean = |f: &dyn Fn(&Point) -> f64| points.iter().map(|p| p.weight * f(p)).sum::<f64>() / total;
    let (x, y) = (mean(&|p| p.x), mean(&|p| p.y));
    let spread = mean(&|p| (p.x - x).powi(2));
    let scale = mean(&|p| (p.x - x) * (p.y - y)) / spread;
    scale.is_finite().then_some(Line { scale, shift: y - scale * x })
}

/// At most [`START_PIXELS`] of the points, evenly.
fn thinned(points: &[Point]) -> impl Iterator<Item = &Point> {
    points.iter().step_by(points.len().div_ceil(START_PIXELS).max(1))
}

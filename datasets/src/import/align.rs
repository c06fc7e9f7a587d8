//! Scale and shift of each view's depth, from surfaces that several views see.
//!
//! Known cameras and the depth of one view say where its pixels are in another view, and how deep; that view's own depth disagrees by the
//! error of both. The fit minimises these disagreements over all pairs of views (Gauss-Newton on relative residuals). Pixels count as far
//! as the photos show the same colour, and lose their weight with the disagreement (Tukey), because a surface may be hidden by another. No
//! feature is detected. Where views say nothing, weak priors keep the scale of the cameras and no shift.

use super::pairs::{Anchor, DepthFit, Match, Pairs};
use super::solve::Normal;
use crate::statistics::median;

/// Common factors of depth that are tried: from 1/2 to 2, each 3 % above the one before. A reconstruction that is off by more has other
/// faults as well.
const FACTOR_STEPS: i32 = 23;
const FACTOR_STEP: f64 = 1.03;

/// Relative disagreement up to which a pixel speaks for a common factor; the scales of single views differ by a few percent.
const AGREEING: f64 = 0.1;

/// A common factor is believed when it wins by this share over the factor 1: without texture all factors are about as good.
const EVIDENCE: f64 = 1.15;

/// Rounds of matching and fitting; the disagreement settles within 15.
const ROUNDS: usize = 30;

/// Disagreement up to which pixels count in the first round; each round takes 0.8 of it, down to [`TUKEY`] standard deviations.
const FIRST_CUTOFF: f64 = 0.3;
const CUTOFF_STEP: f64 = 0.8;

/// Tukey's constant: 95 % of the efficiency of least squares on Gaussian errors.
const TUKEY: f64 = 4.685;

/// From the median of absolute values to a standard deviation.
const MAD: f64 = 1.4826;

/// Standard deviation of a match below which its precision is that of interpolation between pixels.
const PRECISION: f64 = 0.002;

/// Independent matches that the pixels of one view are worth: their errors are smooth over a surface.
const WORTH: f64 = 50.0;

/// Usual differences of a view's scale from the common one, and of its shift as a share of its depth.
const SCALE_PRIOR: f64 = 0.1;
const SHIFT_PRIOR: f64 = 0.05;

/// Usual difference of the common scale from that of the cameras: predicted cameras are 1 to 3 % off.
const COMMON_PRIOR: f64 = 0.03;

/// Smallest and largest scale of a view, as a share of the common one.
const SCALE_RANGE: (f64, f64) = (0.2, 5.0);

/// The fitted depths of all views.
#[derive(Debug, Clone)]
pub(super) struct Alignment {
    pub fits: Vec<DepthFit>,
    /// Depth of the fitted views over that of the cameras' scale alone, the median over views.
    pub factor: f64,
    /// Median relative disagreement of pixels of the same colour, with the cameras' scale alone and with the fits; `None` where no two
    /// views see the same surface.
    pub before: Option<f64>,
    pub after: Option<f64>,
    /// Pixels that were compared.
    pub matches: usize,
}

/// Fits scale and shift of each view. `scale` is that of the cameras. `anchors` are known points, where there are any.
pub(super) fn align(pairs: &Pairs, scale: f64, anchors: &[Anchor]) -> Alignment {
    let count = pairs.views.len();
    let plain = |scale: f64| vec![DepthFit { scale, shift: 0.0 }; count];
    let usual = pairs.usual_depths();
    let first = pairs.matches(&plain(scale));
    let before = disagreement(&first);
    let common = scale * common_factor(pairs, scale);
    let mut fits = plain(common);
    let mut cutoff = FIRST_CUTOFF;
    for _ in 0..ROUNDS {
        let matches = pairs.matches(&fits);
        let inside = matches.iter().filter(|m| m.agrees_in_colour() && m.residual.abs() < cutoff);
        let deviation = median(inside.map(|m| m.residual.abs()).collect()).map_or(cutoff, |median| MAD * median);
        let deviation = deviation.max(PRECISION);
        cutoff = (CUTOFF_STEP * cutoff).max((TUKEY * deviation).min(FIRST_CUTOFF));
        let problem = Problem { usual: &usual, common, deviation, cutoff };
        let Some(stepped) = problem.step(&matches, anchors, &fits) else { break };
        fits = stepped;
    }
    let last = pairs.matches(&fits);
    let factors = fits.iter().zip(&usual).map(|(fit, usual)| fit.apply(*usual) / (scale * usual));
    Alignment {
        factor: median(factors.collect()).unwrap_or(1.0),
        before,
        after: disagreement(&last),
        matches: last.len(),
        fits,
    }
}

/// Median of the absolute residuals of matches of the same colour.
fn disagreement(matches: &[Match]) -> Option<f64> {
    median(matches.iter().filter(|m| m.agrees_in_colour()).map(|m| m.residual.abs()).collect())
}

/// The factor of all depths with which most pixels agree in depth and colour; 1 where none is clearly better. Depth alone would favour
/// large factors: far away, all views see nearly the same.
fn common_factor(pairs: &Pairs, scale: f64) -> f64 {
    let score = |factor: f64| -> f64 {
        let fit = DepthFit { scale: factor * scale, shift: 0.0 };
        let matches = pairs.matches(&vec![fit; pairs.views.len()]);
        matches.iter().map(|m| m.colour_weight() * (1.0 - m.residual.abs() / AGREEING).max(0.0)).sum()
    };
    let factors = (-FACTOR_STEPS..=FACTOR_STEPS).map(|step| FACTOR_STEP.powi(step));
    let scored = factors.map(|factor| (factor, score(factor)));
    let best = scored.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((1.0, 0.0));
    if best.1 > EVIDENCE * score(1.0) { best.0 } else { 1.0 }
}

/// One round of the fit. The unknowns of view `i` are changes of its scale (2 i), a share of the common one, and of its shift (2 i + 1), a
/// share of its usual depth.
struct Problem<'a> {
    /// Median predicted depth of each view.
    usual: &'a [f64],
    common: f64,
    /// Standard deviation of a residual.
    deviation: f64,
    /// Residual from which a match has no weight.
    cutoff: f64,
}

impl Problem<'_> {
    fn step(&self, matches: &[Match], anchors: &[Anchor], fits: &[DepthFit]) -> Option<Vec<DepthFit>> {
        let mut normal = Normal::new(2 * fits.len());
        self.add_priors(&mut normal, fits);
        let share = WORTH * fits.len() as f64 / self.deviation.powi(2);
        for found in matches {
            let weight = found.colour_weight() * self.tukey(found.residual) * share / matches.len() as f64;
            if weight > 0.0 {
                let from = self.slopes(found.from, found.slope * found.depth / found.z, found.slope / found.z);
                let to = self.slopes(found.to, -found.other / found.z, -1.0 / found.z);
                normal.add(&[from, to].concat(), found.residual, weight);
            }
        }
        for anchor in anchors {
            let residual = (anchor.z - fits[anchor.view].apply(anchor.other)) / anchor.z;
            let weight = self.tukey(residual) * share / anchors.len() as f64;
            normal.add(&self.slopes(anchor.view, -anchor.other / anchor.z, -1.0 / anchor.z), residual, weight);
        }
        let change = normal.solve()?;
        let stepped =
            fits.iter().zip(self.usual).zip(change.as_chunks::<2>().0).map(|((fit, usual), [scale, shift])| {
                let scale = (fit.scale / self.common + scale).clamp(SCALE_RANGE.0, SCALE_RANGE.1);
                DepthFit { scale: self.common * scale, shift: fit.shift + self.common * usual * shift }
            });
        Some(stepped.collect())
    }

    /// The slopes of a residual by a view's two unknowns, from those by scale and shift.
    fn slopes(&self, view: usize, by_scale: f64, by_shift: f64) -> [(usize, f64); 2] {
        [(2 * view, self.common * by_scale), (2 * view + 1, self.common * self.usual[view] * by_shift)]
    }

    fn tukey(&self, residual: f64) -> f64 {
        (1.0 - (residual / self.cutoff).powi(2)).max(0.0).powi(2)
    }

    fn add_priors(&self, normal: &mut Normal, fits: &[DepthFit]) {
        let count = fits.len() as f64;
        let (mut all, mut off) = (Vec::new(), 0.0);
        for (view, fit) in fits.iter().enumerate() {
            let (scale, shift) = (fit.scale / self.common - 1.0, fit.shift / (self.common * self.usual[view]));
            normal.add(&[(2 * view, 1.0)], scale, SCALE_PRIOR.powi(-2));
            normal.add(&[(2 * view + 1, 1.0)], shift, SHIFT_PRIOR.powi(-2));
            all.extend([(2 * view, 1.0 / count), (2 * view + 1, 1.0 / count)]);
            off += (scale + shift) / count;
        }
        normal.add(&all, off, COMMON_PRIOR.powi(-2));
    }
}

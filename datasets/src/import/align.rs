//! Scale and shift of each view's depth, from surfaces that several views see.
//!
//! Known cameras and the depth of one view say where its pixels are in another view, and how deep; that view's own depth disagrees by the
//! error of both. First, factors of depth are tried, of all views and then of each, and the one with which the photos agree best is kept: it
//! needs no depth of another view. The fit then minimises these disagreements over all pairs of views (Gauss-Newton on relative residuals). Pixels count as far
//! as the photos show the same colour, and lose their weight with the disagreement (Tukey), because a surface may be hidden by another. No
//! feature is detected. Where views say nothing, weak priors keep the scale of the cameras and no shift.

use gs_base::median;
use rayon::prelude::*;

use super::pairs::{Anchor, DepthFit, Match, Pairs};
use super::solve::Normal;

/// Common factors of depth that are tried: from 1/2 to 2, each 3 % above the one before. A reconstruction that is off by more has other
/// faults as well.
const COMMON: Factors = Factors { step: 1.03, count: 23, evidence: 1.1 };

/// Factors of single views that are tried, to 16 % either way: their scales differ by a few percent.
const OWN: Factors = Factors { step: 1.01, count: 15, evidence: 1.03 };

/// A factor is tried where at least this share of the samples still fall into other photos.
const STILL_SEEN: f64 = 0.5;

/// Rounds of matching and fitting; the disagreement settles within 15.
const ROUNDS: usize = 30;

/// Disagreement up to which pixels count in the first round: half of the relief, because beyond it front and back of an object would
/// match, and within these bounds. Each round takes 0.8 of it, down to [`TUKEY`] standard deviations.
const FIRST_CUTOFF: (f64, f64) = (0.02, 0.3);
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
    let all: Vec<usize> = (0..count).collect();
    let common = scale * COMMON.best(pairs, &all, scale);
    let own = |view: usize| DepthFit { scale: common * OWN.best(pairs, &[view], common), shift: 0.0 };
    let mut fits: Vec<DepthFit> = all.par_iter().map(|view| own(*view)).collect();
    let first_cutoff = (0.5 * pairs.relief()).clamp(FIRST_CUTOFF.0, FIRST_CUTOFF.1);
    let mut cutoff = first_cutoff;
    for _ in 0..ROUNDS {
        let matches = pairs.matches(&fits);
        let inside = matches.iter().filter(|m| m.agrees_in_colour() && m.residual.abs() < cutoff);
        let deviation = median(inside.map(|m| m.residual.abs()).collect()).map_or(cutoff, |median| MAD * median);
        let deviation = deviation.max(PRECISION);
        cutoff = (CUTOFF_STEP * cutoff).max((TUKEY * deviation).min(first_cutoff));
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

/// Powers of a step, `count` of them either way of 1.
struct Factors {
    step: f64,
    count: i32,
    /// A factor is believed when the photos agree with it this much better than with 1: without texture all are about as good.
    evidence: f64,
}

impl Factors {
    /// The factor of `scale` in `views` with which most photos agree; 1 where none is clearly better. The disagreement of depths would
    /// be no guide: far away, all views see nearly the same.
    fn best(&self, pairs: &Pairs, views: &[usize], scale: f64) -> f64 {
        let score = |factor: f64| {
            let fit = DepthFit { scale: factor * scale, shift: 0.0 };
            let scores: Vec<(f64, usize)> = views.par_iter().map(|view| pairs.photo_score(*view, fit)).collect();
            let count: usize = scores.iter().map(|(_, count)| count).sum();
            (scores.iter().map(|(score, count)| score * *count as f64).sum::<f64>() / count.max(1) as f64, count)
        };
        let (usual, seen) = score(1.0);
        let factors = (-self.count..=self.count).map(|power| self.step.powi(power));
        let scored = factors.map(|factor| (factor, score(factor)));
        let seen_enough = scored.filter(|(_, (_, count))| *count as f64 >= STILL_SEEN * seen as f64);
        let best = seen_enough.map(|(factor, (score, _))| (factor, score)).max_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, score)| *score > self.evidence * usual).map_or(1.0, |(factor, _)| factor)
    }
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

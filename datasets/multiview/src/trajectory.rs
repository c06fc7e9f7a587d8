//! Path of an object through its centres over time: a polynomial of the order that the data support, with kinks at
//! impacts.
//!
//! ```text
//! x(s) = sum_k c_k s^k + sum_j a_j r_j(s),   s = (t - t0) / half  in [-1, 1] over the fitted times
//! BIC(p, J) = N ln(RSS / N) + (3 (p + 1) + 5 J) ln N,   N = 3 n coordinates of n centres
//! ```
//!
//! `r_j` is a ramp: 0 before a contact, a line of slope 1 after it, a parabola during it ([`Kink`]), as a constant
//! force during the contact adds to a free path. A kink has three numbers for the change of velocity and two for its
//! begin and end. Order `p` and kinks are the choice with the least BIC; a kink must also lower BIC by [`EVIDENCE`],
//! because its time was searched for.

use glam::DVec3;
use gs_base::least_squares::{combined, least_squares, weighted_least_squares};
use gs_base::statistics::median_by;

use crate::centres::Centre;

/// Centres farther than this many robust standard deviations from the curve of the highest order are outliers.
const OUTLIER: f64 = 6.0;

/// Rounds of reweighting towards least absolute distances.
const ROUNDS: usize = 30;

/// The median of |x| over the standard deviation, for normal x.
const MEDIAN_ABSOLUTE: f64 = 0.6745;

/// Smallest standard deviation of a coordinate in BIC, as a share of the path's extent. Without it a path free of
/// noise would gain orders that explain rounding.
const DEVIATION_MIN: f64 = 1e-4;

/// Centres that a fit needs beyond the number of coefficients, so that a residual remains.
const SPARE: usize = 1;

/// Amount by which a kink must lower BIC: very strong evidence (Kass and Raftery 1995).
const EVIDENCE: f64 = 10.0;

/// Centres required on each side of a kink. With two, a line would pass through both.
const SIDE: usize = 3;

/// Times tried for a kink in one frame interval.
const POSITIONS: usize = 4;

/// Durations tried for a contact, frame intervals. Shorter ones cannot be told from the first.
const CONTACTS: [f64; 3] = [0.25, 0.5, 1.0];

/// Rounds of refining a kink's begin and end, each with 0.7 of the step before: to a hundredth of a contact.
const REFINEMENTS: usize = 14;

/// A kink of the path at an impact: the velocity changes evenly from `begin` to `end`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kink {
    /// Begin of the contact, the data set's unit of time.
    pub begin: f64,
    /// End of the contact, the data set's unit of time.
    pub end: f64,
    /// Change of the velocity, scene units per unit of time.
    pub jump: DVec3,
}

impl Kink {
    /// Displacement per unit of `jump`, the data set's unit of time, and its derivative.
    fn ramp(begin: f64, end: f64, t: f64) -> (f64, f64) {
        let share = ((t - begin) / (end - begin)).clamp(0.0, 1.0);
        (0.5 * share * share * (end - begin) + (t - end).max(0.0), share)
    }
}

/// Path of a centre over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Middle of the fitted times.
    pub t0: f64,
    /// Half of their range; s = (t - t0) / half.
    pub half: f64,
    /// `[order + 1]` coefficients of s^0, s^1, ..., scene units.
    pub coefficients: Vec<DVec3>,
    /// Kinks, earliest first.
    pub kinks: Vec<Kink>,
    /// Root mean square distance of the centres from the curve, scene units.
    pub residual: f64,
    /// Number of centres left out as outliers.
    pub outliers: usize,
}

/// Centres to be fitted, with the normalisation of time.
struct Data {
    times: Vec<f64>,
    positions: Vec<DVec3>,
    t0: f64,
    half: f64,
}

/// A fitted curve.
struct Fit {
    order: usize,
    coefficients: Vec<DVec3>,
    squares: f64,
    bic: f64,
}

impl Trajectory {
    /// Fits orders 0 to `max_order` (as far as the number of centres allows) with up to `max_kinks` kinks and keeps
    /// the fit with the least BIC. With three kinks or more a single outlier can become a spike. `None` without two
    /// centres at different finite times.
    pub fn fit(centres: &[Centre], max_order: usize, max_kinks: usize) -> Option<Self> {
        let used = centres.iter().filter(|centre| centre.t.is_finite() && centre.position.is_finite());
        let (times, positions): (Vec<f64>, Vec<DVec3>) = used.map(|centre| (centre.t, centre.position)).unzip();
        let low = times.iter().copied().fold(f64::INFINITY, f64::min);
        let high = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (t0, half) = (0.5 * (low + high), 0.5 * (high - low));
        if times.len() < 2 || half.is_nan() || half <= 0.0 {
            return None;
        }
        let mut data = Data { times, positions, t0, half };
        let before = data.times.len();
        // A bounce seen by few centres must not count as outliers: they are judged with the one kink that fits best.
        let score = |data: &Data, kinks: &[[f64; 2]]| Some(data.distances(max_order, kinks)?.iter().sum::<f64>());
        let suspect = if max_kinks > 0 { data.best_kink(&[], score) } else { None };
        data.drop_outliers(max_order, suspect.as_slice());

        let mut kinks: Vec<[f64; 2]> = Vec::new();
        let mut best = data.best_order(max_order, &kinks)?;
        while kinks.len() < max_kinks {
            let score = |data: &Data, kinks: &[[f64; 2]]| Some(data.best_order(max_order, kinks)?.bic);
            let Some(kink) = data.best_kink(&kinks, score) else { break };
            let kink = data.refined(kink, &kinks, max_order);
            let mut more = kinks.clone();
            more.push(kink);
            more.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let Some(fit) = data.best_order(max_order, &more).filter(|fit| fit.bic < best.bic - EVIDENCE) else {
                break;
            };
            (kinks, best) = (more, fit);
        }
        let jumps = best.coefficients.split_off(best.order + 1);
        let kinks = kinks.into_iter().zip(jumps).map(|([begin, end], jump)| Kink { begin, end, jump });
        Some(Self {
            t0,
            half,
            kinks: kinks.collect(),
            residual: (best.squares / data.times.len() as f64).sqrt(),
            coefficients: best.coefficients,
            outliers: before - data.times.len(),
        })
    }

    /// The chosen order; 0 is a static object, apart from kinks.
    pub fn order(&self) -> usize {
        self.coefficients.len() - 1
    }

    /// Whether no contact overlaps the time from `begin` to `end`.
    pub fn is_undisturbed(&self, begin: f64, end: f64) -> bool {
        self.kinks.iter().all(|kink| end <= kink.begin || begin >= kink.end)
    }

    /// Position at a time. Outside the fitted times the path continues straight: a polynomial would diverge.
    pub fn position(&self, t: f64) -> DVec3 {
        let s = (t - self.t0) / self.half;
        let inside = s.clamp(-1.0, 1.0);
        let hits: DVec3 = self.kinks.iter().map(|kink| Kink::ramp(kink.begin, kink.end, t).0 * kink.jump).sum();
        evaluate(&self.coefficients, inside) + (s - inside) * evaluate(&derivative(&self.coefficients), inside) + hits
    }

    /// Velocity at a time, scene units per unit of time; constant outside the fitted times.
    pub fn velocity(&self, t: f64) -> DVec3 {
        let s = ((t - self.t0) / self.half).clamp(-1.0, 1.0);
        let hits: DVec3 = self.kinks.iter().map(|kink| Kink::ramp(kink.begin, kink.end, t).1 * kink.jump).sum();
        evaluate(&derivative(&self.coefficients), s) / self.half + hits
    }
}

impl Data {
    /// Powers of the normalised time up to `order`, then a ramp for each kink, at all centres.
    fn columns(&self, order: usize, kinks: &[[f64; 2]]) -> Vec<Vec<f64>> {
        let powers =
            (0..=order as i32).map(|k| self.times.iter().map(|t| ((t - self.t0) / self.half).powi(k)).collect());
        let ramps =
            kinks.iter().map(|[begin, end]| self.times.iter().map(|t| Kink::ramp(*begin, *end, *t).0).collect());
        powers.chain(ramps).collect()
    }

    /// Highest order that leaves a residual; `None` if the kinks alone leave none.
    fn highest(&self, max_order: usize, kinks: &[[f64; 2]]) -> Option<usize> {
        // A kink uses up two centres: it has five numbers, a centre has three.
        match self.times.len().checked_sub(1 + SPARE + 2 * kinks.len()) {
            Some(room) => Some(max_order.min(room)),
            None => kinks.is_empty().then_some(0),
        }
    }

    /// Order by which outliers are judged. A kink does the work of two orders; with both, a curve could reach an
    /// outlier near the end.
    fn judge(&self, max_order: usize, kinks: &[[f64; 2]]) -> Option<usize> {
        self.highest(max_order.saturating_sub(2 * kinks.len()), kinks)
    }

    /// The fit with the least BIC, for given kinks.
    fn best_order(&self, max_order: usize, kinks: &[[f64; 2]]) -> Option<Fit> {
        let floor = self.extent() * DEVIATION_MIN;
        let count = 3.0 * self.times.len() as f64;
        let fits = (0..=self.highest(max_order, kinks)?).map(|order| {
            let columns = self.columns(order, kinks);
            let coefficients = least_squares(&columns, &self.positions);
            let squares = self.misses(&columns, &coefficients).iter().map(|miss| miss * miss).sum::<f64>();
            let variance = (squares / count).max(floor * floor).max(f64::MIN_POSITIVE);
            let numbers = 3.0 * (order as f64 + 1.0) + 5.0 * kinks.len() as f64;
            Fit { order, coefficients, squares, bic: count * variance.ln() + numbers * count.ln() }
        });
        fits.reduce(|best, fit| if fit.bic < best.bic { fit } else { best })
    }

    /// One more kink, as begin and end: the one of all times and durations tried with the least `score`.
    fn best_kink(&self, kinks: &[[f64; 2]], score: impl Fn(&Self, &[[f64; 2]]) -> Option<f64>) -> Option<[f64; 2]> {
        let mut sorted = self.times.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        if sorted.len() < 2 * SIDE {
            return None;
        }
        let interval = (sorted[sorted.len() - 1] - sorted[0]) / (sorted.len() - 1) as f64;
        let (first, last) = (sorted[SIDE - 1], sorted[sorted.len() - SIDE]);
        let positions = ((last - first) / interval * POSITIONS as f64).round() as usize;
        let tried = (0..=positions).flat_map(|i| {
            let middle = first + (last - first) * i as f64 / positions.max(1) as f64;
            CONTACTS.map(|length| [middle - 0.5 * length * interval, middle + 0.5 * length * interval])
        });
        let apart = |new: &[f64; 2]| kinks.iter().all(|old| new[1] <= old[0] || old[1] <= new[0]);
        let scored = tried.filter(apart).filter_map(|kink| {
            let with: Vec<[f64; 2]> = kinks.iter().copied().chain([kink]).collect();
            Some((score(self, &with)?, kink))
        });
        scored.reduce(|best, new| if new.0 < best.0 { new } else { best }).map(|(_, kink)| kink)
    }

    /// Time of the `n`-th centre, in time order.
    fn nth(&self, n: usize) -> f64 {
        let mut sorted = self.times.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[n]
    }

    /// Shifts and stretches a kink to the least BIC, beside others. A kink off by a fraction of a frame would need a
    /// second one to correct it.
    fn refined(&self, kink: [f64; 2], others: &[[f64; 2]], max_order: usize) -> [f64; 2] {
        let score = |kink: [f64; 2]| {
            let with: Vec<[f64; 2]> = others.iter().copied().chain([kink]).collect();
            self.best_order(max_order, &with).map_or(f64::INFINITY, |fit| fit.bic)
        };
        let (first, last) = (self.nth(SIDE - 1), self.nth(self.times.len() - SIDE));
        let apart = |new: &[f64; 2]| {
            let middle = 0.5 * (new[0] + new[1]);
            (first..=last).contains(&middle) && others.iter().all(|old| new[1] <= old[0] || old[1] <= new[0])
        };
        let (mut best, mut least, shortest) = (kink, score(kink), 0.5 * (kink[1] - kink[0]));
        let mut step = shortest;
        for _ in 0..REFINEMENTS {
            for [begin, end] in [[step, step], [-step, -step], [step, -step], [-step, step]] {
                let moved = [best[0] + begin, best[1] + end];
                if moved[1] - moved[0] >= shortest && apart(&moved) && score(moved) < least {
                    (best, least) = (moved, score(moved));
                }
            }
            step *= 0.7;
        }
        best
    }

    /// Distances from the curve of least absolute distances: a least squares curve bends towards outliers and hides
    /// them.
    fn distances(&self, max_order: usize, kinks: &[[f64; 2]]) -> Option<Vec<f64>> {
        let columns = self.columns(self.judge(max_order, kinks)?, kinks);
        let floor = (self.extent() * DEVIATION_MIN).max(f64::MIN_POSITIVE);
        let mut weights = vec![1.0; self.times.len()];
        let mut distances = Vec::new();
        for _ in 0..ROUNDS {
            distances = self.misses(&columns, &weighted_least_squares(&columns, &self.positions, &weights));
            weights.iter_mut().zip(&distances).for_each(|(weight, distance)| *weight = 1.0 / distance.max(floor));
        }
        Some(distances)
    }

    /// Removes outliers of the highest order's curve; against a lower order the ends of a bent path would look like
    /// outliers. At most a fifth goes, so that the curve cannot be bent to a few.
    fn drop_outliers(&mut self, max_order: usize, kinks: &[[f64; 2]]) {
        let (Some(order), Some(distances)) = (self.judge(max_order, kinks), self.distances(max_order, kinks)) else {
            return;
        };
        let floor = (self.extent() * DEVIATION_MIN).max(f64::MIN_POSITIVE);
        let mut sorted = distances.clone();
        sorted.sort_by(f64::total_cmp);
        // The curve passes through as many centres as it has coefficients; their distances say nothing about the
        // noise.
        let most_far = sorted[sorted.len() - 1 - sorted.len() / 5];
        let free = &mut sorted[(order + 1 + kinks.len()).min(distances.len() - 1)..];
        let typical = median_by(free, f64::total_cmp).expect("at least the farthest is left");
        let limit = OUTLIER * (typical / MEDIAN_ABSOLUTE).max(floor);
        let keeps: Vec<bool> = distances.iter().map(|distance| *distance <= limit.max(most_far)).collect();
        let mut kept = keeps.iter();
        self.times.retain(|_| *kept.next().expect("one for each"));
        let mut kept = keeps.iter();
        self.positions.retain(|_| *kept.next().expect("one for each"));
    }

    fn misses(&self, columns: &[Vec<f64>], coefficients: &[DVec3]) -> Vec<f64> {
        self.positions
            .iter()
            .enumerate()
            .map(|(i, position)| combined(columns, coefficients, i).distance(*position))
            .collect()
    }

    /// Diagonal of the bounding box of the positions.
    fn extent(&self) -> f64 {
        let low = self.positions.iter().fold(DVec3::INFINITY, |low, x| low.min(*x));
        let high = self.positions.iter().fold(DVec3::NEG_INFINITY, |high, x| high.max(*x));
        if self.positions.is_empty() { 0.0 } else { low.distance(high) }
    }
}

fn evaluate(coefficients: &[DVec3], s: f64) -> DVec3 {
    coefficients.iter().rev().fold(DVec3::ZERO, |sum, coefficient| sum * s + *coefficient)
}

fn derivative(coefficients: &[DVec3]) -> Vec<DVec3> {
    coefficients.iter().enumerate().skip(1).map(|(k, coefficient)| k as f64 * *coefficient).collect()
}

//! Oscillations that many quantities share: sums of sines of a few common rates.
//!
//! A body that bends goes to and fro: a wave along it, a wing, a swimmer's tail have few rates, and each place of it
//! its own amplitudes and phases.

use super::least_squares::{descent, dot, solver};

/// Rates tried for each new oscillation.
const TRIED: usize = 64;

/// Smallest share of a period in the observed time. Less of one is not told from an even motion.
const PERIODS_LEAST: f64 = 0.4;

/// Frames of the shortest period.
const FRAMES_LEAST: f64 = 6.0;

/// Share of the misfit by which a step of the search for the rates must gain to go on.
const CONVERGED: f64 = 1e-6;

/// Share of a column's square that is added to it while rates are looked for: more would bend them.
const SEARCH_RIDGE: f64 = 1e-4;

/// Factor by which a periodic motion may leave more than free rates: it has one rate, which a short time tells better.
const PERIODIC: f64 = 1.3;

/// Oscillations of several quantities.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rhythm {
    /// Radians per unit of time.
    pub rates: Vec<f64>,
    /// The rates as multiples of the first, where they are one periodic motion; empty: each is free.
    pub multiples: Vec<u32>,
    /// For each quantity the amplitudes of `sin(w s)` by rate, then of `cos(w s) - 1`.
    pub amplitudes: Vec<Vec<f64>>,
}

impl Rhythm {
    /// `count` oscillations of quantities whose values at times `s` since the first frame, at which they are 0, are the
    /// rows of `data`: a periodic motion (one rate and its multiples, or what doubles it again and again) where that
    /// leaves hardly more than free rates. Beside them each quantity may move by a polynomial of order `drift`, which
    /// is left out.
    ///
    /// A body that bends to and fro and keeps its length moves along itself at twice the rate: the rates of a body that
    /// bends in one direction at twice the rate of the other are doubled twice, and none of them is three times the
    /// first.
    pub fn fit(s: &[f64], data: &[Vec<f64>], count: usize, drift: usize) -> Self {
        let seen = Seen { s, data, range: range(s), drift };
        let mut free: Vec<f64> = Vec::new();
        for _ in 0..count {
            let with = |rate: f64| free.iter().copied().chain([rate]).collect::<Vec<f64>>();
            free = seen.refined(seen.first(with), <[f64]>::to_vec);
        }
        let left = seen.misfit(&free);
        let mut series = vec![multiples(count), doubles(count)];
        series.dedup();
        let series = series.into_iter().filter(|of| of.len() > 1);
        let all = series.map(|of| seen.periodic(of)).filter(|one| one.0 <= PERIODIC * left);
        let (_, rates, multiples) = all.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((left, free, Vec::new()));
        Self::of_rates(&seen, rates, multiples)
    }

    fn of_rates(seen: &Seen, rates: Vec<f64>, multiples: Vec<u32>) -> Self {
        // Less than a period of an oscillation is near an even motion, so that two of them may take large amplitudes
        // against each other: amplitudes are held against the share of the values that they and the drift leave.
        let all = seen.data.iter().flatten().map(|x| x * x).sum::<f64>().max(f64::MIN_POSITIVE);
        let mut amplitudes = seen.solved(&rates, seen.misfit(&rates) / all);
        amplitudes.iter_mut().for_each(|own| own.truncate(2 * rates.len()));
        Self { rates, multiples, amplitudes }
    }

    /// Oscillations with the rates that have these [`numbers`](Self::numbers), and the best amplitudes.
    pub(super) fn refitted(&self, s: &[f64], data: &[Vec<f64>], numbers: &[f64]) -> Self {
        Self::of_rates(&Seen { s, data, range: range(s), drift: 0 }, self.rates_of(numbers), self.multiples.clone())
    }

    /// Its rates as numbers to be fitted beside others: their logarithms, of a periodic one that of its first.
    pub(super) fn numbers(&self) -> Vec<f64> {
        logarithms(if self.multiples.is_empty() { &self.rates } else { &self.rates[..1] })
    }

    /// The rates that have these [`numbers`](Self::numbers).
    pub(super) fn rates_of(&self, numbers: &[f64]) -> Vec<f64> {
        tied(&self.multiples, &exponentials(numbers))
    }

    /// The value of each quantity at `s`.
    pub fn at(&self, s: f64) -> Vec<f64> {
        let basis = basis(s, &self.rates);
        self.amplitudes.iter().map(|own| dot(own, &basis)).collect()
    }
}

/// The rates of which `own` are the free ones: these, or the multiples of the first.
pub(super) fn tied(multiples: &[u32], own: &[f64]) -> Vec<f64> {
    if multiples.is_empty() { own.to_vec() } else { multiples.iter().map(|k| f64::from(*k) * own[0]).collect() }
}

/// 1, 2, 3 and so on: those of any periodic motion.
fn multiples(count: usize) -> Vec<u32> {
    (1..=count as u32).collect()
}

/// 1, 2, 4 and so on.
fn doubles(count: usize) -> Vec<u32> {
    (0..count).map(|k| 1 << k).collect()
}

/// Least and largest rate that the times `s` tell.
pub(super) fn range(s: &[f64]) -> [f64; 2] {
    let span = s.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    let least = PERIODS_LEAST * std::f64::consts::TAU / span;
    [least, (std::f64::consts::TAU * s.len() as f64 / (FRAMES_LEAST * span)).max(least)]
}

fn basis(s: f64, rates: &[f64]) -> Vec<f64> {
    rates.iter().map(|rate| (rate * s).sin()).chain(rates.iter().map(|rate| (rate * s).cos() - 1.0)).collect()
}

/// Quantities over the seen time.
struct Seen<'a> {
    s: &'a [f64],
    data: &'a [Vec<f64>],
    /// Least and largest rate.
    range: [f64; 2],
    /// Order of the polynomial beside the oscillations.
    drift: usize,
}

impl Seen<'_> {
    /// Of the rates `with` one more, tried over the range, those that leave least.
    fn first(&self, with: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
        let [least, most] = self.range;
        let tried = (0..TRIED).map(|k| with(least * (most / least).powf(k as f64 / (TRIED - 1) as f64)));
        let tried = tried.map(|rates| (self.misfit(&rates), rates));
        tried.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |(_, rates)| rates)
    }

    /// The misfit of the best periodic motion of given multiples, and its rates.
    fn periodic(&self, multiples: Vec<u32>) -> (f64, Vec<f64>, Vec<u32>) {
        let series = |first: &[f64]| tied(&multiples, first);
        let begun = self.first(|rate| series(&[rate])).into_iter().take(1).collect();
        let rates = series(&self.refined(begun, series));
        (self.misfit(&rates), rates, multiples)
    }

    /// The functions of time: the oscillations', then the powers of a drift.
    fn rows(&self, rates: &[f64]) -> Vec<Vec<f64>> {
        let row = |s: &f64| basis(*s, rates).into_iter().chain((1..=self.drift).map(|k| s.powi(k as i32))).collect();
        self.s.iter().map(row).collect()
    }

    /// The best amplitudes of each quantity for given rates, then its drift.
    fn solved(&self, rates: &[f64], ridge: f64) -> Vec<Vec<f64>> {
        let rows = self.rows(rates);
        let count = 2 * rates.len() + self.drift;
        let columns: Vec<Vec<f64>> = (0..count).map(|k| rows.iter().map(|row| row[k]).collect()).collect();
        let solver = solver(&columns, ridge).unwrap_or_else(|| vec![Vec::new(); count]);
        self.data.iter().map(|own| solver.iter().map(|row| dot(row, own)).collect()).collect()
    }

    /// The rest of each value after oscillations of given rates.
    fn residuals(&self, rates: &[f64]) -> Vec<f64> {
        let rows = self.rows(rates);
        let of = |(own, values): (Vec<f64>, &Vec<f64>)| {
            rows.iter().zip(values).map(|(row, x)| dot(&own, row) - x).collect::<Vec<f64>>()
        };
        self.solved(rates, SEARCH_RIDGE).into_iter().zip(self.data).flat_map(of).collect()
    }

    fn misfit(&self, rates: &[f64]) -> f64 {
        self.residuals(rates).iter().map(|x| x * x).sum()
    }

    /// The numbers of which `rates` makes the rates, where least is left, the amplitudes being the best ones for each
    /// (variable projection).
    fn refined(&self, numbers: Vec<f64>, rates: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
        let of = |logs: &[f64]| self.residuals(&rates(&exponentials(logs)));
        exponentials(&descent(logarithms(&numbers), |logs| held(logs, self.range), of, CONVERGED))
    }
}

/// The rest of each value after oscillations of given rates.
pub(super) fn rest(s: &[f64], data: &[Vec<f64>], rates: &[f64]) -> Vec<f64> {
    Seen { s, data, range: range(s), drift: 0 }.residuals(rates)
}

/// Logarithms of rates within `range`.
pub(super) fn held(logs: Vec<f64>, [least, most]: [f64; 2]) -> Vec<f64> {
    logs.into_iter().map(|log| log.clamp(least.ln(), most.ln())).collect()
}

fn logarithms(rates: &[f64]) -> Vec<f64> {
    rates.iter().map(|rate| rate.ln()).collect()
}

fn exponentials(logs: &[f64]) -> Vec<f64> {
    logs.iter().map(|log| log.exp()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six places along a wave of two rates, seen for 1.1 and 0.56 periods, as `bend` says.
    fn wave(s: f64) -> Vec<f64> {
        let one = |place: usize| {
            let (x, tau) = (place as f64 / 5.0, std::f64::consts::TAU);
            let yaw = x * (tau * (1.5 * s - 1.1 * x)).sin();
            let pitch = 0.4 * x * (tau * (0.75 * s - 0.3 * x)).sin();
            yaw + pitch
        };
        let first = |place: usize| {
            one(place) - {
                let (x, tau) = (place as f64 / 5.0, std::f64::consts::TAU);
                x * (-tau * 1.1 * x).sin() + 0.4 * x * (-tau * 0.3 * x).sin()
            }
        };
        (0..6).map(first).collect()
    }

    #[test]
    fn a_travelling_wave_is_foreseen() {
        let s: Vec<f64> = (0..45).map(|k| f64::from(k) / 59.0).collect();
        let rows: Vec<Vec<f64>> = s.iter().map(|s| wave(*s)).collect();
        let data: Vec<Vec<f64>> = (0..6).map(|k| rows.iter().map(|row| row[k]).collect()).collect();
        let rhythm = Rhythm::fit(&s, &data, 2, 0);
        let mut rates: Vec<f64> = rhythm.rates.iter().map(|rate| rate / std::f64::consts::TAU).collect();
        rates.sort_by(f64::total_cmp);
        assert!((rates[0] - 0.75).abs() < 0.02 && (rates[1] - 1.5).abs() < 0.02, "{rates:?}");
        for (own, truth) in rhythm.at(1.0).iter().zip(wave(1.0)) {
            assert!((own - truth).abs() < 0.03, "{own} for {truth}");
        }
    }

    /// Joints of a chain of eight links of one length that bends sideways at 1.5 periods a unit and up at 0.75.
    fn chain(s: f64) -> Vec<f64> {
        let tau = std::f64::consts::TAU;
        let mut place = [0.0; 3];
        let mut joints = Vec::new();
        for link in 0..8 {
            let x = f64::from(link) / 7.0;
            let yaw = 0.8 * x * (tau * (1.5 * s - 1.1 * x)).sin();
            let pitch = 0.2 * x * (tau * (0.75 * s - 0.6 * x) + 1.0).sin();
            let way = [yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), pitch.sin()];
            place.iter_mut().zip(way).for_each(|(x, by)| *x += 0.2 * by);
            joints.extend(place);
        }
        joints
    }

    #[test]
    fn what_keeps_its_length_moves_along_itself_at_twice_its_rate() {
        let s: Vec<f64> = (0..45).map(|k| f64::from(k) / 59.0).collect();
        let less = |s: f64| chain(s).into_iter().zip(chain(0.0)).map(|(x, first)| x - first).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = s.iter().map(|s| less(*s)).collect();
        let data: Vec<Vec<f64>> = (0..24).map(|k| rows.iter().map(|row| row[k]).collect()).collect();
        let off = |rhythm: &Rhythm| {
            let squares = rhythm.at(1.0).into_iter().zip(less(1.0)).map(|(x, truth)| (x - truth).powi(2));
            (squares.sum::<f64>() / 8.0).sqrt()
        };
        let found = Rhythm::fit(&s, &data, 3, 0);
        let first = found.rates[0] / std::f64::consts::TAU;
        assert!(found.multiples == [1, 2, 4] && (first - 0.75).abs() < 0.02, "{:?} {first}", found.multiples);
        // Joints at the end move by 0.5.
        assert!(off(&found) < 0.03 && off(&found) < 0.5 * off(&Rhythm::fit(&s, &data, 2, 0)), "{}", off(&found));
    }

    #[test]
    fn what_rests_has_no_amplitude() {
        let s = [0.0, 0.1, 0.2];
        let rhythm = Rhythm::fit(&s, &[vec![0.0; 3]], 1, 0);
        assert_eq!(rhythm.at(0.15), [0.0]);
        assert_eq!(Rhythm::fit(&s, &[], 0, 0), Rhythm::default());
    }
}

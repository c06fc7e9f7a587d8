//! An axis of a chart: values to pixels, round ticks and their names.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// Width of a character of a label, pixels: the mean over letters and digits of a sans serif font of 11 pixels.
pub const WIDTH_OF_CHARACTER: f64 = 6.1;

/// Ticks of an axis, about.
const TICKS: f64 = 6.0;

/// A map from values to pixels.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
    log: bool,
    whole: bool,
}

impl Axis {
    /// An axis that shows `low..high` with a margin between the pixels `from` and `to`.
    pub fn new((low, high): (f64, f64), from: f64, to: f64, log: bool) -> Self {
        let map = |x: f64| if log { x.log10() } else { x };
        let (low, high) = (map(low), map(high));
        let air = if high > low { 0.06 * (high - low) } else { 0.05 * high.abs().max(1.0) };
        Self { low: low - air, high: high + air, from, to, log, whole: false }
    }

    /// The axis with ticks at integers alone, where it is of integers.
    pub fn whole(self, whole: bool) -> Self {
        Self { whole, ..self }
    }

    /// The pixel of a value.
    pub fn place(&self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Ticks at round numbers.
    pub fn ticks(&self) -> Vec<f64> {
        if self.log {
            let decades = self.low.floor() as i32..=self.high.ceil() as i32;
            let all = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * 10_f64.powi(decade)));
            return all.filter(|x| (self.low..=self.high).contains(&x.log10())).collect();
        }
        let rough = (self.high - self.low) / TICKS;
        let decade = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let step = if self.whole { step.max(1.0) } else { step };
        let first = (self.low / step).ceil() as i64;
        // Integer multiples of the step, so that rounding does not accumulate.
        (first..).map(|k| k as f64 * step).take_while(|x| *x <= self.high).take(20).collect()
    }
}

/// An axis from 0 to 1 as plotters has it.
impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        first + (self.place(*value) * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let names = named(&self.ticks());
        names.into_iter().find(|(tick, _)| tick == value).map_or(String::new(), |(_, name)| name)
    }
}

/// Ticks with as few digits as distinguish them.
pub fn named(ticks: &[f64]) -> Vec<(f64, String)> {
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let largest = ticks.iter().fold(0.0_f64, |largest, tick| largest.max(tick.abs()));
    let (unit, sign) = match step {
        _ if largest >= 1e6 => (1e6, "M"),
        _ if largest >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let digits = (-(step / unit).log10().floor()).clamp(0.0, 6.0) as usize;
    let digits = match ticks {
        [only] if (only / unit).fract() == 0.0 => 0,
        [_] => 2,
        _ => digits,
    };
    ticks.iter().map(|tick| (*tick, format!("{:.digits$}{sign}", tick / unit))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(low: f64, high: f64, whole: bool) -> Vec<String> {
        let ticks = Axis::new((low, high), 0.0, 1.0, false).whole(whole).ticks();
        named(&ticks).into_iter().map(|(_, name)| name).collect()
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::new((0.0, 1000.0), 0.0, 1.0, false);
        assert_eq!(axis.ticks(), [0.0, 200.0, 400.0, 600.0, 800.0, 1000.0]);
        let log = Axis::new((10.0, 1000.0), 0.0, 1.0, true);
        assert_eq!(log.ticks(), [10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0]);
        assert_eq!(named(&[20.0, 20.5]).iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>(), ["20.0", "20.5"]);
        assert_eq!(named(&[5000.0, 10000.0])[1].1, "10k");
    }

    /// A loss that hardly changes, a count that hardly changes, large numbers: no name stands twice.
    #[test]
    fn no_two_ticks_have_one_name() {
        let ranges = [(0.186, 0.194), (0.1101, 0.1104), (11.9, 12.1), (5178.0, 7000.0), (1e6, 1.01e6), (-3e-5, 2e-5)];
        for (low, high) in ranges {
            let names = names(low, high, false);
            let mut distinct = names.clone();
            distinct.dedup();
            assert!(names.len() > 2 && distinct == names, "{low} to {high}: {names:?}");
        }
    }

    #[test]
    fn integers_have_ticks_at_integers() {
        assert_eq!(names(0.0, 0.0, true), ["0"]);
        assert_eq!(names(0.0, 3.0, true), ["0", "1", "2", "3"]);
        assert_eq!(names(0.0, 1.0, true), ["0", "1"]);
        assert_eq!(names(6.0, 6.0, true), ["6"]);
    }
}

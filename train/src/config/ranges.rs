//! The ranges of a configuration's values, each with the phrase that an error says of it.

use std::fmt::Display;
use std::ops;

/// The values that a key may have.
pub trait Range<T> {
    /// Whether a value is one of them.
    fn holds(&self, value: &T) -> bool;

    /// The range as a phrase, to follow "must be".
    fn expected(&self) -> String;
}

impl<T: PartialOrd + Display> Range<T> for ops::RangeInclusive<T> {
    fn holds(&self, value: &T) -> bool {
        self.contains(value)
    }

    fn expected(&self) -> String {
        format!("from {} to {}", self.start(), self.end())
    }
}

impl<T: PartialOrd + Display> Range<T> for ops::Range<T> {
    fn holds(&self, value: &T) -> bool {
        self.contains(value)
    }

    fn expected(&self) -> String {
        format!("at least {} and below {}", self.start, self.end)
    }
}

impl<T: PartialOrd + Display> Range<T> for ops::RangeFrom<T> {
    fn holds(&self, value: &T) -> bool {
        self.contains(value)
    }

    fn expected(&self) -> String {
        format!("at least {}", self.start)
    }
}

impl<T: PartialOrd + Display> Range<T> for ops::RangeToInclusive<T> {
    fn holds(&self, value: &T) -> bool {
        self.contains(value)
    }

    fn expected(&self) -> String {
        format!("at most {}", self.end)
    }
}

/// A range that no pair of bounds describes: its phrase, and whether a value lies in it.
pub struct Only<T>(pub &'static str, pub fn(&T) -> bool);

impl<T> Range<T> for Only<T> {
    fn holds(&self, value: &T) -> bool {
        (self.1)(value)
    }

    fn expected(&self) -> String {
        self.0.into()
    }
}

/// Shares of a whole.
pub const SHARE: ops::RangeInclusive<f64> = 0.0..=1.0;

/// Numbers above 0, also as `f32`.
pub const POSITIVE: Only<f64> = Only("positive", |x| positive(*x));

/// Numbers from 0 on that are finite as `f32`.
pub const NOT_NEGATIVE: Only<f64> = Only("0 or more", |x| not_negative(*x));

/// Numbers inside the unit interval.
pub const OPEN_UNIT: Only<f64> = Only("between 0 and 1, both excluded", |x| *x > 0.0 && *x < 1.0);

/// Whether numbers are the corners of a box: x, y, z of the smallest coordinates, then of the largest.
pub fn is_box(numbers: &[f64]) -> bool {
    let (low, high) = numbers.split_at(numbers.len() / 2);
    let is_finite = |x: &f64| (*x as f32).is_finite();
    numbers.len() == 6 && numbers.iter().all(is_finite) && low.iter().zip(high).all(|(low, high)| low < high)
}

/// Whether `x` is above 0, also as f32, in which kernels compute.
pub fn positive(x: f64) -> bool {
    not_negative(x) && x as f32 > 0.0
}

/// Whether `x` is 0 or more, and finite as f32.
pub fn not_negative(x: f64) -> bool {
    x >= 0.0 && (x as f32).is_finite()
}

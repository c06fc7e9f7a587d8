//! Laws of motion of a rigid body, as sets of terms.
//!
//! With `s` the time since the first frame, `o(s) = sin(W s + p) - sin(p)`, and `R(s) = Exp(w s + b s^2 / 2 + q o(s))`,
//! a body with its centre at `c` in the first frame has its centre at `c + v s + a s^2 / 2 + u o(s) - (R(s) - 1) d`;
//! `d` leads from the centre to the pivot of a rotation about a fixed point, which a pendulum or a hinge has. Terms
//! that a law does not have are zero. A rotation about a pivot that speeds up does so about one axis: `b` is parallel
//! to `w`. What dies away at a rate `k` has, for `s > 0`, `(1 - exp(-k s)) / k` for `s` in the even terms, and
//! `exp(-k s)` before the first sine of `o`.

use gs_burn::glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Numbers of a law with every term.
pub const NUMBERS: usize = 24;

/// Added to the rate `k`, per unit of time: the quotient stays finite, and nothing dies away at it.
pub(super) const DAMPING_FLOOR: f64 = 1e-4;

/// A term of a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// `v`: the centre moves evenly.
    Velocity,
    /// `a`: the centre accelerates evenly.
    Acceleration,
    /// `w`: an even rotation.
    Spin,
    /// `b`: an evenly accelerated rotation.
    SpinUp,
    /// `q`: a rotation to and fro, as of a pendulum.
    Swing,
    /// `u`: the centre moves to and fro, as of a spring.
    Sway,
    /// `W` and `p`: the rate and the phase of what goes to and fro.
    Oscillation,
    /// `d`: the rotation is about a fixed pivot.
    Pivot,
    /// `k`: the motion dies away.
    Damping,
}

impl Term {
    /// All terms, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::Velocity,
        Self::Acceleration,
        Self::Spin,
        Self::SpinUp,
        Self::Swing,
        Self::Sway,
        Self::Oscillation,
        Self::Pivot,
        Self::Damping,
    ];

    /// Its numbers among all [`NUMBERS`].
    pub fn numbers(self) -> std::ops::Range<usize> {
        match self {
            Self::Oscillation => 18..20,
            Self::Pivot => 20..23,
            Self::Damping => 23..24,
            vector => 3 * vector as usize..3 * vector as usize + 3,
        }
    }
}

/// A set of terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Law(u16);

impl Law {
    /// The law with these terms.
    pub const fn of(terms: &[Term]) -> Self {
        let (mut bits, mut index) = (0, 0);
        while index < terms.len() {
            bits |= 1 << terms[index] as u16;
            index += 1;
        }
        Self(bits)
    }

    /// The laws among which a body's is chosen, simplest first.
    pub const ALL: [Self; 20] = {
        use Term::{
            Acceleration as A, Damping as D, Oscillation as O, Pivot as P, Spin as S, SpinUp as U, Sway as Y,
            Swing as W, Velocity as V,
        };
        [
            Self::of(&[]),
            Self::of(&[V]),
            Self::of(&[S, P]),
            Self::of(&[V, A]),
            Self::of(&[V, S]),
            Self::of(&[Y, O]),
            Self::of(&[W, O, P]),
            Self::of(&[S, U, P]),
            Self::of(&[S, P, D]),
            Self::of(&[Y, O, D]),
            Self::of(&[W, O, P, D]),
            Self::of(&[V, A, S]),
            Self::of(&[V, S, U]),
            Self::of(&[V, W, O]),
            Self::of(&[V, A, S, U]),
            Self::of(&[V, A, W, O]),
            Self::of(&[S, Y, O]),
            Self::of(&[V, S, P]),
            Self::of(&[V, A, S, P]),
            Self::of(&[V, A, S, U, P]),
        ]
    };

    /// The laws among which a body's first motion is chosen: the terms of [`Law::GENERAL`], fewest first.
    pub const SMOOTH: [Self; 5] = [
        Self::of(&[Term::Velocity]),
        Self::of(&[Term::Velocity, Term::Acceleration]),
        Self::of(&[Term::Velocity, Term::Spin]),
        Self::of(&[Term::Velocity, Term::Acceleration, Term::Spin]),
        Self::GENERAL,
    ];

    /// Smooth motion of any kind to second order: what a body begins with.
    pub const GENERAL: Self = Self::of(&[Term::Velocity, Term::Acceleration, Term::Spin, Term::SpinUp]);

    /// Whether few things move by the law: what flies has no torque, and turns about its middle; what swings hangs.
    pub fn is_rare(self) -> bool {
        let flies = self.has(Term::Velocity);
        (flies && (self.has(Term::SpinUp) || self.has(Term::Pivot) || self.has(Term::Swing)))
            || (self.has(Term::Sway) && self.has(Term::Spin))
    }

    /// Whether the law has a term.
    pub fn has(self, term: Term) -> bool {
        self.0 & (1 << term as u16) != 0
    }

    /// Whether it is one of [`Law::ALL`], after it was read from a file.
    pub fn is_known(self) -> bool {
        Self::ALL.contains(&self)
    }

    /// 1 for each number that the law has.
    pub fn mask(self) -> [f64; NUMBERS] {
        let mut mask = [0.0; NUMBERS];
        for term in Term::ALL.into_iter().filter(|term| self.has(*term)) {
            mask[term.numbers()].fill(1.0);
        }
        mask
    }

    /// The numbers of `values` that the law has.
    pub(super) fn free_numbers(self, values: &LawValues) -> Vec<f64> {
        values.0.iter().zip(self.mask()).filter(|(_, on)| *on > 0.0).map(|(x, _)| *x).collect()
    }

    /// The values of which these are the [`free_numbers`](Self::free_numbers).
    pub(super) fn with_free(self, numbers: &[f64]) -> LawValues {
        let mut values = LawValues::REST;
        let own = values.0.iter_mut().zip(self.mask()).filter(|(_, on)| *on > 0.0);
        own.zip(numbers).for_each(|((value, _), x)| *value = *x);
        values
    }

    /// Numbers that the law is free to choose: a shift of the pivot along the axis of a rotation changes nothing, and
    /// one axis takes two numbers from the second of two parallel vectors.
    pub fn freedom(self) -> usize {
        let numbers: usize =
            Term::ALL.into_iter().filter(|term| self.has(*term)).map(|term| term.numbers().len()).sum();
        numbers - usize::from(self.has(Term::Pivot)) - 2 * usize::from(self.has_one_axis())
    }

    /// Whether rotation and angular acceleration have one axis: they are about a fixed pivot.
    pub fn has_one_axis(self) -> bool {
        self.has(Term::Spin) && self.has(Term::SpinUp) && self.has(Term::Pivot) && !self.has(Term::Velocity)
    }

    /// `values` with rotation and angular acceleration along one axis where the law asks for it, and a rate of dying
    /// away that is not negative. `duration` is the time
    /// over which the two are weighed against each other.
    pub fn constrained(self, mut values: LawValues, duration: f64) -> LawValues {
        if self.has_one_axis() {
            let (spin, up) = (values.vector(Term::Spin), values.vector(Term::SpinUp));
            let sign = if spin.dot(up) < 0.0 { -1.0 } else { 1.0 };
            let axis = (spin + up * (0.5 * sign * duration)).normalize_or_zero();
            values.set(Term::Spin, axis * spin.dot(axis));
            values.set(Term::SpinUp, axis * up.dot(axis));
        }
        values.set_damping(values.damping());
        values
    }

    /// The law in words.
    pub fn in_words(self) -> &'static str {
        if self.has(Term::Damping) {
            return match (self.has(Term::Sway), self.has(Term::Swing)) {
                (true, _) => "sways, ever less",
                (_, true) => "swings about a pivot, ever less",
                _ => "rotates about a pivot and spins down",
            };
        }
        let translation = match (self.has(Term::Velocity), self.has(Term::Acceleration), self.has(Term::Sway)) {
            (_, _, true) => "sways",
            (_, true, false) => "accelerates",
            (true, false, false) => "moves evenly",
            (false, false, false) => "",
        };
        match (translation, self.has(Term::Swing), self.has(Term::SpinUp), self.has(Term::Spin)) {
            ("", true, _, _) => "swings about a pivot",
            ("", _, true, _) => "rotates about a pivot, ever faster or slower",
            ("", _, _, true) => "rotates evenly about a pivot",
            ("", ..) => "rests",
            ("accelerates", _, false, true) if self.has(Term::Pivot) => {
                "accelerates and rotates evenly about a point off its middle"
            }
            ("accelerates", _, true, true) if self.has(Term::Pivot) => {
                "accelerates, its rotation too, about a point off its middle"
            }
            (_, _, _, true) if self.has(Term::Pivot) => "moves and rotates evenly about a point off its middle",
            ("sways", false, false, false) => "sways",
            ("sways", ..) => "sways and rotates",
            ("accelerates", true, _, _) => "accelerates and swings",
            ("accelerates", _, true, _) => "accelerates, its rotation too",
            ("accelerates", _, _, true) => "accelerates and rotates evenly",
            ("accelerates", ..) => "accelerates evenly",
            (_, true, _, _) => "moves evenly and swings",
            (_, _, true, _) => "moves evenly, its rotation accelerates",
            (_, _, _, true) => "moves and rotates evenly",
            _ => "moves evenly",
        }
    }
}

/// The numbers of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawValues(pub [f64; NUMBERS]);

/// A rigid body's pose relative to its first one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyPose {
    /// The rotation since the first frame.
    pub rotation: DQuat,
    /// Where the body's centre is, world, scene units.
    pub centre: DVec3,
}

impl BodyPose {
    /// Where the body's point is that was at `position` in the first frame, when its centre was at `first`.
    pub fn apply(&self, position: DVec3, first: DVec3) -> DVec3 {
        self.centre + self.rotation * (position - first)
    }
}

impl LawValues {
    /// All numbers zero: rest.
    pub const REST: Self = Self([0.0; NUMBERS]);

    /// The vector of a term.
    pub fn vector(&self, term: Term) -> DVec3 {
        DVec3::from_slice(&self.0[term.numbers()])
    }

    /// Sets the vector of a term.
    pub fn set(&mut self, term: Term, vector: DVec3) {
        self.0[term.numbers()].copy_from_slice(&vector.to_array());
    }

    /// Rate and phase of the oscillation.
    pub fn oscillation(&self) -> (f64, f64) {
        let first = Term::Oscillation.numbers().start;
        (self.0[first], self.0[first + 1])
    }

    /// Sets rate and phase of the oscillation.
    pub fn set_oscillation(&mut self, rate: f64, phase: f64) {
        let first = Term::Oscillation.numbers().start;
        self.0[first..first + 2].copy_from_slice(&[rate, phase]);
    }

    /// The rate at which the motion dies away, per unit of time; 0: it does not.
    pub fn damping(&self) -> f64 {
        self.0[Term::Damping.numbers().start].abs()
    }

    /// Sets the rate at which the motion dies away.
    pub fn set_damping(&mut self, rate: f64) {
        self.0[Term::Damping.numbers().start] = rate;
    }

    /// The rotation vector `s` after the first frame.
    pub fn rotation_vector(&self, s: f64) -> DVec3 {
        let swing = self.vector(Term::Swing) * self.swing(s);
        self.vector(Term::Spin) * even(self.damping(), s) + self.vector(Term::SpinUp) * (0.5 * s * s) + swing
    }

    fn swing(&self, s: f64) -> f64 {
        let (rate, phase) = self.oscillation();
        fading(self.damping(), s) * (rate * s + phase).sin() - phase.sin()
    }

    /// The pose `s` after the first frame of a body whose centre was at `first`.
    pub fn pose(&self, first: DVec3, s: f64) -> BodyPose {
        let rotation = DQuat::from_scaled_axis(self.rotation_vector(s));
        let translation = self.vector(Term::Velocity) * even(self.damping(), s)
            + self.vector(Term::Acceleration) * (0.5 * s * s)
            + self.vector(Term::Sway) * self.swing(s);
        let pivot = self.vector(Term::Pivot);
        BodyPose { rotation, centre: first + translation + pivot - rotation * pivot }
    }
}

/// The time in which an even motion goes as far as one goes in `s` that dies away at the rate `damping` from its begin
/// on; 0: it does not.
pub(super) fn even(damping: f64, s: f64) -> f64 {
    let rate = damping + DAMPING_FLOOR;
    if damping == 0.0 || s <= 0.0 { s } else { -(-rate * s).exp_m1() / rate }
}

/// The share of an amplitude that is left after `s`.
pub(super) fn fading(damping: f64, s: f64) -> f64 {
    if damping == 0.0 || s <= 0.0 { 1.0 } else { (-(damping + DAMPING_FLOOR) * s).exp() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_divide_the_numbers() {
        let mut seen = [0; NUMBERS];
        for term in Term::ALL {
            term.numbers().for_each(|number| seen[number] += 1);
        }
        assert_eq!(seen, [1; NUMBERS]);
    }

    #[test]
    fn laws_differ_and_have_words() {
        for (index, law) in Law::ALL.iter().enumerate() {
            assert!(!Law::ALL[..index].contains(law) && law.is_known() && !law.in_words().is_empty());
        }
        assert_eq!(Law::ALL[0].freedom(), 0);
        assert_eq!(Law::of(&[Term::Spin, Term::Pivot]).freedom(), 5);
        // An axis, a rate, an acceleration, and two numbers for the pivot.
        assert_eq!(Law::of(&[Term::Spin, Term::SpinUp, Term::Pivot]).freedom(), 6);
    }

    #[test]
    fn a_hinge_has_one_axis() {
        let law = Law::of(&[Term::Spin, Term::SpinUp, Term::Pivot]);
        for up in [DVec3::new(0.3, -2.0, 0.4), DVec3::new(-0.3, 2.0, -0.4), DVec3::ZERO] {
            let mut values = LawValues::REST;
            values.set(Term::Spin, DVec3::new(0.0, 1.0, 0.1));
            values.set(Term::SpinUp, up);
            let one = law.constrained(values, 0.75);
            assert!(one.vector(Term::Spin).cross(one.vector(Term::SpinUp)).length() < 1e-12);
            assert!(one.vector(Term::Spin).length() > 0.9 && one.vector(Term::SpinUp).dot(up) >= 0.9 * up.length());
            assert!(law.constrained(one, 0.75).vector(Term::Spin).distance(one.vector(Term::Spin)) < 1e-12);
        }
        let rest = law.constrained(LawValues::REST, 0.75);
        assert_eq!(rest, LawValues::REST);
        assert_eq!(Law::GENERAL.constrained(LawValues([1.0; NUMBERS]), 1.0), LawValues([1.0; NUMBERS]));
    }

    #[test]
    fn a_pivot_stays_where_it_is() {
        let mut values = LawValues::REST;
        values.set(Term::Swing, DVec3::new(0.2, 0.9, -0.1));
        values.set_oscillation(5.0, 0.4);
        values.set(Term::Pivot, DVec3::new(0.1, 0.0, 1.5));
        let first = DVec3::new(1.0, 2.0, 3.0);
        let pivot = first + values.vector(Term::Pivot);
        for s in [0.0, 0.2, 0.7, 1.9] {
            assert!(values.pose(first, s).apply(pivot, first).distance(pivot) < 1e-12);
        }
        assert!(values.pose(first, 0.0).centre.distance(first) < 1e-12);
    }
}

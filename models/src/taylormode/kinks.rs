//! Kinks: the remainder of Eq. 2 for an object that is hit. A contact is a stretch of time in which that happens; a
//! kink is the change of a Gaussian's velocity at a contact.
//!
//! `R(s) = sum_j a_j r_j(s)`, `a_j` `[3]` learned for each Gaussian. `r_j` is a ramp that begins on one side of `t0`
//! and is 0 from there on to `t0` and past it: 0, then a parabola while the contact lasts, then a straight line of
//! slope 1 (-1 where it lies before `t0`). Around `t0` it is zero, so it vanishes faster than every power of `|t -
//! t0|`: a true Peano remainder, of the kind no polynomial can follow. A contact with an even force is met exactly,
//! with a continuous velocity.
//!
//! An object is hit as a whole, at one time. So contact times are estimated once for the scene, and each Gaussian
//! learns only the jump of its own velocity.

use burn::module::{Module, Param, ParamId};
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use super::window::{FADE, Sample, TimeWindow, best_line, continued};
use crate::basis::{Form, Past, TimeFunction};

/// When a contact begins and ends, in window units; both on the same side of 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The end nearer to `t0`.
    #[serde(with = "crate::bits")]
    pub near: f64,
    /// The end farther from it, not equal.
    #[serde(with = "crate::bits")]
    pub far: f64,
}

impl Contact {
    /// The contact between two times of `window`; `None` when `t0` lies in it or at its end, or it takes no time.
    pub fn new(begin: f64, end: f64, window: &TimeWindow) -> Option<Self> {
        let (a, b) = (window.normalised(begin.min(end)), window.normalised(begin.max(end)));
        match (a > 0.0, b < 0.0) {
            _ if a == b => None,
            (true, _) => Some(Self { near: a, far: b }),
            (_, true) => Some(Self { near: b, far: a }),
            _ => None,
        }
    }

    /// Whether the two share any time.
    pub fn overlaps(&self, other: &Self) -> bool {
        let ends = |contact: &Self| (contact.near.min(contact.far), contact.near.max(contact.far));
        let ((a, b), (c, d)) = (ends(self), ends(other));
        a < d && c < b
    }

    /// The ramp at `s`.
    pub fn ramp(&self, s: f64) -> Sample {
        continued(s, || self.line(), |s| self.inside(s))
    }

    /// The ramp as a description for readers without this module.
    pub fn described(&self) -> TimeFunction {
        let past = Past { line: self.line(), fade: FADE };
        TimeFunction { form: Form::Ramp { near: self.near, far: self.far }, past: Some(past) }
    }

    fn line(&self) -> [f64; 2] {
        best_line(|s| self.inside(s).value)
    }

    fn inside(&self, s: f64) -> Sample {
        // Distances outwards from t0.
        let side = self.far.signum();
        let (near, far, s) = (self.near.abs(), self.far.abs(), s * side);
        let share = ((s - near) / (far - near)).clamp(0.0, 1.0);
        Sample { value: 0.5 * share * share * (far - near) + (s - far).max(0.0), slope: side * share }
    }
}

/// Kinks of `M` moving Gaussians, at all times.
#[derive(Module, Debug)]
pub struct Kinks {
    /// `[M, 3 J]`, a block of three per contact: the change of velocity, scene units per window unit of time.
    pub jumps: Param<Tensor<2>>,
    /// `J` contacts, the same for all Gaussians.
    #[module(skip)]
    pub contacts: Vec<Contact>,
}

impl Kinks {
    /// Kinks at `contacts`; `jumps` as at the field.
    ///
    /// # Panics
    /// When `jumps` has not three columns a contact.
    pub fn new(contacts: Vec<Contact>, jumps: Tensor<2>) -> Self {
        assert_eq!(jumps.dims()[1], 3 * contacts.len(), "a jump has three columns a contact");
        // A tensor that is already in a graph stays in it.
        let jumps =
            if jumps.is_tracked() { Param::initialized(ParamId::new(), jumps) } else { Param::from_tensor(jumps) };
        Self { jumps, contacts }
    }

    /// The ramps at `s` (window units), one per block of [`jumps`](Self::jumps).
    pub fn functions(&self, s: f64) -> Vec<Sample> {
        self.contacts.iter().map(|contact| contact.ramp(s)).collect()
    }
}

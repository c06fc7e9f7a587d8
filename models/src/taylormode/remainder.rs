//! The remainder `R_n(t)` of Eq. 2 in three dimensions: the part of a Gaussian's motion that its polynomial misses.
//!
//! `R(s) = s^(n+1) sum_j w_j phi_j(s)`, `phi = 1, cos(pi s), sin(pi s), cos(2 pi s), sin(2 pi s)`, with the vectors
//! `w_j` from one small network shared by all Gaussians, asked at the Gaussian's position at `t0`. The factor `s^(n+1)`
//! makes it a Peano remainder by construction: it vanishes faster than `|t - t0|^n` whatever the network says. Time
//! enters through fixed functions, so the velocity is analytic and exact, and the network runs once a step, not once a
//! time.
//!
//! The paper has only a network on the image's velocity map (Eq. 5, [`PeanoMap`](super::velocity_map::PeanoMap)); this
//! one corrects the Gaussians themselves and so is the same from every camera. Its last layer starts at zero.

use std::f64::consts::PI;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use super::velocity_map::row;
use super::window::{FADE, Sample, best_line, continued};
use crate::basis::{Form, Past, TimeFunction};
use crate::mlp::{Mlp, MlpConfig};

/// Oscillations in half a window that the time functions reach. More resolve shorter shocks and fit more noise.
const OCTAVES: usize = 2;
/// Time functions.
const FUNCTIONS: usize = 1 + 2 * OCTAVES;
/// Units of the two hidden layers.
const HIDDEN: usize = 32;

/// All of a [`RemainderNetwork`] that is not learned; as JSON to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RemainderFrame {
    /// Centre of the moving Gaussians, scene units.
    #[serde(with = "crate::bits")]
    pub centre: [f64; 3],
    /// Their extent, scene units, positive. Positions are divided by it and answers multiplied: a step of Adam changes
    /// each weight by its rate, so a rate of 1e-4 moves no Gaussian by more than a hundredth of the extent.
    #[serde(with = "crate::bits")]
    pub scale: f64,
    /// `n`, the highest power of the polynomial that the remainder completes.
    pub order: usize,
}

impl RemainderFrame {
    /// A remainder that is zero until it is trained.
    pub fn init(self, seed: u64, device: &Device) -> RemainderNetwork {
        let sizes = vec![3, HIDDEN, HIDDEN, 3 * FUNCTIONS];
        let mlp = MlpConfig::new(sizes).with_seed(seed).with_zero_last(true).init(device);
        RemainderNetwork { mlp, frame: self }
    }
}

/// The learned part: position at `t0` to the weights of the time functions.
#[derive(Module, Debug)]
pub struct RemainderNetwork {
    /// `[M, 3]` to `[M, 3 * 5]`.
    pub mlp: Mlp,
    /// Origin and unit of the positions.
    #[module(skip)]
    pub frame: RemainderFrame,
}

impl RemainderNetwork {
    /// The weights at `positions` `[M, 3]`, the moving centres at `t0`. No gradient reaches the positions: a Gaussian
    /// is not pulled to where the network happens to give a better answer.
    pub fn evaluate(&self, positions: Tensor<2>) -> Remainder {
        let RemainderFrame { centre, scale, order } = self.frame;
        let positions = positions.inner();
        let centre = row(centre, &positions);
        let input = (positions - centre) * (1.0 / scale);
        let weights = self.mlp.forward(input) * (scale / FUNCTIONS as f64);
        Remainder { weights, order }
    }
}

/// The remainder of each moving Gaussian, at all times.
#[derive(Debug, Clone)]
pub struct Remainder {
    /// `[M, 3 * 5]`, a block of three per time function, scene units.
    pub weights: Tensor<2>,
    /// `n`: it vanishes faster than `|s|^n`.
    pub order: usize,
}

impl Remainder {
    /// The time functions at `s` (window units), one per block of [`weights`](Self::weights).
    pub fn functions(&self, s: f64) -> Vec<Sample> {
        let functions = (0..FUNCTIONS).map(|j| {
            let function = |s: f64| self.function(j, s);
            continued(s, || best_line(|s| function(s).value), function)
        });
        functions.collect()
    }

    /// The time functions as descriptions for readers without this module.
    pub fn described(&self) -> Vec<TimeFunction> {
        let power = self.order as u32 + 1;
        let one = |j: usize| {
            let rate = rate(j);
            let form = if is_sine(j) { Form::Sine { power, rate } } else { Form::Cosine { power, rate } };
            let line = best_line(|s| self.function(j, s).value);
            TimeFunction { form, past: Some(Past { line, fade: FADE }) }
        };
        (0..FUNCTIONS).map(one).collect()
    }

    /// `s^(n+1) phi_j(s)`.
    fn function(&self, j: usize, s: f64) -> Sample {
        let rate = rate(j);
        let (sin, cos) = (rate * s).sin_cos();
        let phi = if is_sine(j) {
            Sample { value: sin, slope: rate * cos }
        } else {
            // j = 0 has rate 0: the constant.
            Sample { value: cos, slope: -rate * sin }
        };
        let n = self.order as i32 + 1;
        let (power, derivative) = (s.powi(n), f64::from(n) * s.powi(n - 1));
        Sample { value: power * phi.value, slope: derivative * phi.value + power * phi.slope }
    }
}

/// Radians a unit of `s` of `phi_j`.
fn rate(j: usize) -> f64 {
    PI * j.div_ceil(2) as f64
}

fn is_sine(j: usize) -> bool {
    j > 0 && j.is_multiple_of(2)
}

//! The remainder `R_n(t)` of Eq. 2 in three dimensions: what the polynomial of a Gaussian leaves over.
//!
//! `R(s) = s^(n+1) sum_j w_j phi_j(s)`, `phi = 1, cos(pi s), sin(pi s), cos(2 pi s), sin(2 pi s)`, with the vectors `w_j`
//! from one small network shared by all Gaussians, asked at the Gaussian's place at `t0`. The factor `s^(n+1)` makes it a
//! Peano remainder by construction: it vanishes faster than `|t - t0|^n` whatever the network says. Time enters through
//! fixed functions, so the velocity is analytic and exact, and the network runs once a step, not once a time.
//!
//! The paper has only a network on the image's velocity map (Eq. 5, [`PeanoMap`](super::velocity_map::PeanoMap)); this one corrects
//! the Gaussians themselves and so is the same from every camera. Its last layer starts at zero.

use std::f64::consts::PI;

use burn::tensor::{Device, Tensor, TensorData};

use super::window::{Sample, best_line, continued};
use crate::network::Mlp;

/// Oscillations in half a window that the time functions reach. More resolve shorter shocks and fit more noise.
const OCTAVES: usize = 2;
/// Time functions.
const FUNCTIONS: usize = 1 + 2 * OCTAVES;
/// Units of the two hidden layers.
const HIDDEN: usize = 32;

/// The learned part: place at `t0` to the weights of the time functions.
#[derive(Debug, Clone)]
pub struct RemainderNetwork {
    /// `[M, 3]` to `[M, 3 * 5]`.
    pub mlp: Mlp,
    /// `[1, 3]`, subtracted from places, scene units.
    pub centre: Tensor<2>,
    /// Places are divided by this, answers multiplied, scene units: about the size of what moves. A step of Adam
    /// changes each weight by its rate, so 1e-4 moves no Gaussian by more than a hundredth of it.
    pub scale: f64,
    /// `n`, the highest power of the polynomial that this completes.
    pub order: usize,
}

impl RemainderNetwork {
    /// A remainder that is zero until it is trained; `centre` and `scale` (scene units, positive) of what moves.
    pub fn new(order: usize, centre: [f64; 3], scale: f64, seed: u64, device: &Device) -> Self {
        Self {
            mlp: Mlp::new(&[3, HIDDEN, HIDDEN, 3 * FUNCTIONS], seed, true, device),
            centre: Tensor::from_data(TensorData::new(centre.to_vec(), [1, 3]), device),
            scale,
            order,
        }
    }

    /// The weights at `places` `[M, 3]`, the moving centres at `t0`. No gradient reaches the places: a Gaussian is not
    /// pulled to where the network happens to give a better answer.
    pub fn evaluate(&self, places: Tensor<2>) -> Remainder {
        let centre = self.centre.clone().cast(places.dtype());
        let input = (places.inner() - centre) * (1.0 / self.scale);
        let weights = self.mlp.forward(input) * (self.scale / FUNCTIONS as f64);
        Remainder { weights, order: self.order }
    }

    /// With `f` of every learned tensor.
    pub fn map(&self, f: impl FnMut(Tensor<2>) -> Tensor<2>) -> Self {
        Self { mlp: self.mlp.map(f), ..self.clone() }
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

    /// `s^(n+1) phi_j(s)`.
    fn function(&self, j: usize, s: f64) -> Sample {
        let rate = PI * j.div_ceil(2) as f64;
        let (sin, cos) = (rate * s).sin_cos();
        let phi = if j > 0 && j.is_multiple_of(2) {
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

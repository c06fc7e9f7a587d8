//! Motion as a sum of fixed functions of time, for readers that evaluate it without the model: [`MotionBasis`].
//!
//! `mean(t) = mean + sum_j f_j(s) p_j` and `quat(t) = exp(1/2 sum_k g_k(s) r_k) quat` with `s = (t - t0) / half`. The
//! functions are the same for all rows, the vectors `p_j` (scene units) and `r_k` (radians, world axes) are each row's
//! own.

use burn::tensor::Tensor;
use gs_burn::Gaussians;

/// The motion of a scene, exactly.
#[derive(Debug, Clone)]
pub struct MotionBasis {
    /// All `N` Gaussians as they are where every function is zero.
    pub base: Gaussians,
    /// `[M]`, the rows that move, each at most once.
    pub rows: Vec<u32>,
    /// Time of `s = 0`, the data set's unit.
    pub t0: f64,
    /// Time from `s = 0` to `s = 1`, the data set's unit, positive.
    pub half: f64,
    /// The functions `f_j` of the position.
    pub functions: Vec<TimeFunction>,
    /// The vectors `p_j`, `[M, 3 J]`, scene units.
    pub position: Tensor<2>,
    /// The functions `g_k` of the rotation vector.
    pub turns: Vec<TimeFunction>,
    /// The vectors `r_k`, `[M, 3 K]`, radians, world axes.
    pub rotation: Tensor<2>,
    /// Bodies whose vectors rows share; `None`: there are none. The vectors are whole all the same.
    pub carried: Option<Carried>,
}

/// Bodies that carry rows, and what rows have beside.
#[derive(Debug, Clone)]
pub struct Carried {
    /// `[M]`, the body of each row by its place in `bodies`; 255: none.
    pub body_of: Vec<u8>,
    /// `[M]`, how many of the first functions of position and rotation a row has vectors of its own for; the others are
    /// those of its body, or zero.
    pub own: Vec<[u16; 2]>,
    /// The bodies.
    pub bodies: Vec<Carrier>,
}

/// A body: the vectors of its rows are `W_j [1, (mean - centre) / scale]`.
#[derive(Debug, Clone)]
pub struct Carrier {
    /// Scene units.
    pub centre: [f64; 3],
    /// Scene units, positive.
    pub scale: f64,
    /// `[4, 3 J]`: `W_j` transposed, scene units.
    pub position: Tensor<2>,
    /// `[1, 3 K]`, radians.
    pub rotation: Tensor<2>,
}

/// A function of `s`, and its way on past the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeFunction {
    /// The function for `|s| <= 1`.
    pub form: Form,
    /// For `|s| > 1`: the straight line to which it returns within `fade`; `None`: `form` goes on.
    pub past: Option<Past>,
}

/// A function of `s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// `s^power cos(rate s)`; a power where the rate is 0.
    Cosine {
        /// Exponent.
        power: u32,
        /// Radians a unit of `s`.
        rate: f64,
    },
    /// `s^power sin(rate s)`.
    Sine {
        /// Exponent.
        power: u32,
        /// Radians a unit of `s`.
        rate: f64,
    },
    /// 0 up to `near`, then a parabola up to `far`, then a line of slope 1, outwards from `s = 0`; `near` and `far`
    /// have one sign.
    Ramp {
        /// End of the parabola nearer to 0.
        near: f64,
        /// Its other end.
        far: f64,
    },
}

/// How a function goes on past the window: value and slope join those of `form` at `|s| = 1` and, by Hermite's cubics,
/// those of the line at `|s| = 1 + fade`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// Value of the line at `s = 0`, and its slope.
    pub line: [f64; 2],
    /// Length of the return, units of `s`.
    pub fade: f64,
}

impl TimeFunction {
    /// `s^power` at all times.
    pub fn power(power: u32) -> Self {
        Self { form: Form::Cosine { power, rate: 0.0 }, past: None }
    }
}

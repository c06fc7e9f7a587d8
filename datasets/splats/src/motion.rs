//! How some Gaussians move: by series of functions of time, or by key frames.
//!
//! The Gaussians themselves are those of the time [`Motion::middle`], so that a program that knows no motion shows the
//! middle of the recording.

use crate::splats::unit;
use crate::{Carried, Splats};

/// The motion of `M` Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// First and last time of the recording, the data set's unit.
    pub span: [f64; 2],
    /// The time of the Gaussians that the motion is beside.
    pub middle: f64,
    /// `[M]`, which Gaussians move.
    pub rows: Vec<u32>,
    /// How.
    pub law: Law,
}

/// Where the moving Gaussians are at a time.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// By series: `mean(t) = mean + sum_j (f_j(s) - f_j(s_middle)) v_j`.
    Series(SeriesLaw),
    /// By poses at times, with straight lines between them.
    Keys(Keys),
}

/// Series of position and rotation in the time `s = (t - t0) / half`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeriesLaw {
    /// The time at which `s` is 0.
    pub t0: f64,
    /// How long `s` takes from 0 to 1.
    pub half: f64,
    /// Displacements, scene units.
    pub position: Series,
    /// Rotation vectors `r`, radians, world axes: `q(t) = exp(r(s) / 2) exp(-r(s_middle) / 2) q`.
    pub rotation: Series,
    /// Bodies whose vectors rows share, for files; `None`: there are none. The vectors are whole all the same.
    pub carried: Option<Carried>,
}

/// `sum_j f_j(s) v_j` for each of `M` Gaussians.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// `J` functions, the same for all Gaussians.
    pub functions: Vec<TimeFunction>,
    /// `[M, J]`.
    pub vectors: Vec<[f32; 3]>,
}

/// A function of `s`, and how it goes on where `|s| > 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeFunction {
    /// The function.
    pub shape: Shape,
    /// How it goes on beyond `|s| = 1`; `None`: as it is.
    pub beyond: Option<Beyond>,
}

/// Values of a function of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// `s^k`.
    Power(u32),
    /// 0 up to `near`, a parabola up to `far`, then a line of slope 1 outwards; both on one side of 0.
    Ramp {
        /// The end nearer to 0.
        near: f64,
        /// The end farther from 0.
        far: f64,
    },
    /// `s^power cos(pi n s)`, or with the sine.
    Wave {
        /// The power.
        power: u32,
        /// Half oscillations from 0 to 1.
        n: u32,
        /// Whether it is the sine.
        sine: bool,
    },
}

/// The return to a straight line within `fade` past the edge, by Hermite's cubic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beyond {
    /// Value at `s = 0` and slope of the line.
    pub line: [f64; 2],
    /// Value and slope of the function at `s = -1` and at `s = 1`.
    pub edges: [[f64; 2]; 2],
    /// How far past the edge it reaches the line.
    pub fade: f64,
}

/// Poses of `M` Gaussians at `T` times; before the first and after the last they rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Keys {
    /// `[T]`, rising.
    pub times: Vec<f64>,
    /// `[T, M]`, scene units.
    pub means: Vec<[f32; 3]>,
    /// `[T, M]`, w x y z.
    pub quats: Vec<[f32; 4]>,
    /// `[T, M]`, natural logarithms; empty where sizes stay.
    pub log_scales: Vec<[f32; 3]>,
}

impl TimeFunction {
    /// `shape`, which returns to `line` (value at `s = 0`, slope) within `fade` past the edge.
    pub fn returning(shape: Shape, line: [f64; 2], fade: f64) -> Self {
        let edges = [-1.0, 1.0].map(|edge| [shape.at(edge), shape.slope(edge)]);
        Self { shape, beyond: Some(Beyond { line, edges, fade }) }
    }

    /// The value at `s`.
    pub fn at(&self, s: f64) -> f64 {
        let Some(beyond) = self.beyond.filter(|_| s.abs() > 1.0) else { return self.shape.at(s) };
        let [offset, slope] = beyond.line;
        let (edge, line) = (s.signum(), offset + slope * s);
        let x = (s.abs() - 1.0) / beyond.fade;
        if x >= 1.0 {
            return line;
        }
        let [value, steepness] = beyond.edges[usize::from(s > 0.0)];
        let excess = value - (offset + slope * edge);
        let drift = (steepness - slope) * edge * beyond.fade;
        line + excess * (1.0 + x * x * (2.0 * x - 3.0)) + drift * x * (1.0 - x) * (1.0 - x)
    }
}

impl Shape {
    fn at(&self, s: f64) -> f64 {
        match *self {
            Self::Power(k) => s.powi(k as i32),
            Self::Ramp { near, far } => {
                let (s, near, far) = (s * far.signum(), near.abs(), far.abs());
                let share = ((s - near) / (far - near)).clamp(0.0, 1.0);
                0.5 * share * share * (far - near) + (s - far).max(0.0)
            }
            Self::Wave { power, n, sine } => {
                let (sin, cos) = (std::f64::consts::PI * f64::from(n) * s).sin_cos();
                s.powi(power as i32) * if sine { sin } else { cos }
            }
        }
    }

    fn slope(&self, s: f64) -> f64 {
        let power_slope = |k: u32| if k == 0 { 0.0 } else { f64::from(k) * s.powi(k as i32 - 1) };
        match *self {
            Self::Power(k) => power_slope(k),
            Self::Ramp { near, far } => {
                let side = far.signum();
                side * ((s * side - near.abs()) / (far.abs() - near.abs())).clamp(0.0, 1.0)
            }
            Self::Wave { power, n, sine } => {
                let rate = std::f64::consts::PI * f64::from(n);
                let (sin, cos) = (rate * s).sin_cos();
                let [wave, steepness] = if sine { [sin, rate * cos] } else { [cos, -rate * sin] };
                power_slope(power) * wave + s.powi(power as i32) * steepness
            }
        }
    }
}

impl Series {
    /// The vectors of the Gaussian `index` of `M`.
    fn of(&self, index: usize) -> &[[f32; 3]] {
        &self.vectors[index * self.functions.len()..][..self.functions.len()]
    }

    /// `sum_j (f_j(s) - f_j(from)) v_j` of the Gaussian `index` of `M`.
    fn sum(&self, index: usize, s: f64, from: Option<f64>) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (function, vector) in self.functions.iter().zip(self.of(index)) {
            let factor = function.at(s) - from.map_or(0.0, |from| function.at(from));
            sum.iter_mut().zip(vector).for_each(|(sum, v)| *sum += factor * f64::from(*v));
        }
        sum
    }
}

impl Motion {
    /// Checks that every row is one of `count` Gaussians, arrays are as long as they must be, and every number is
    /// finite.
    ///
    /// # Errors
    /// A sentence without the file's name.
    pub fn check(&self, count: usize) -> Result<(), String> {
        let m = self.rows.len();
        if let Some(row) = self.rows.iter().find(|row| **row as usize >= count) {
            return Err(format!("expected rows below {count} in the motion, found {row}"));
        }
        let [first, last] = self.span;
        if !(first.is_finite() && last.is_finite() && self.middle.is_finite() && first <= last) {
            return Err(format!("expected a span and a middle of the motion, found {first} to {last}"));
        }
        let vectors = |list: &[[f32; 3]]| list.iter().flatten().all(|x| x.is_finite());
        let is_right = match &self.law {
            Law::Series(law) => {
                let series = |s: &Series| s.vectors.len() == m * s.functions.len() && vectors(&s.vectors);
                law.half.is_finite()
                    && law.half > 0.0
                    && law.t0.is_finite()
                    && series(&law.position)
                    && series(&law.rotation)
                    && law.carried.as_ref().is_none_or(|carried| {
                        carried.is_right(m, [law.position.functions.len(), law.rotation.functions.len()])
                    })
            }
            Law::Keys(keys) => {
                let n = keys.times.len() * m;
                let rising = keys.times.windows(2).all(|pair| pair[0] < pair[1]);
                let finite =
                    keys.times.iter().all(|t| t.is_finite()) && vectors(&keys.means) && vectors(&keys.log_scales);
                let quats = keys.quats.iter().flatten().all(|x| x.is_finite());
                let sizes = keys.log_scales.is_empty() || keys.log_scales.len() == n;
                !keys.times.is_empty()
                    && rising
                    && finite
                    && quats
                    && sizes
                    && keys.means.len() == n
                    && keys.quats.len() == n
            }
        };
        if is_right {
            Ok(())
        } else {
            Err("expected a motion with whole arrays of finite numbers, found another".into())
        }
    }

    /// Velocities of the moving rows at `t`, `[M]`, scene units per unit of time.
    pub fn velocities(&self, t: f64) -> Vec<[f32; 3]> {
        match &self.law {
            Law::Series(law) => law.velocities(self.rows.len(), t),
            Law::Keys(keys) => keys.velocities(self.rows.len(), t),
        }
    }

    /// The motion of the Gaussians `kept` alone, in this order: row `kept[i]` becomes `i`.
    pub fn select(&self, kept: &[u32]) -> Self {
        let mut index_of: Vec<Option<u32>> =
            vec![None; self.rows.iter().chain(kept).max().map_or(0, |row| *row as usize + 1)];
        for (index, row) in kept.iter().enumerate() {
            index_of[*row as usize] = Some(index as u32);
        }
        let own: Vec<usize> =
            (0..self.rows.len()).filter(|index| index_of[self.rows[*index] as usize].is_some()).collect();
        let pick = |series: &Series| Series {
            vectors: own.iter().flat_map(|index| series.of(*index).iter().copied()).collect(),
            functions: series.functions.clone(),
        };
        let law = match &self.law {
            Law::Series(law) => {
                let (position, rotation) = (pick(&law.position), pick(&law.rotation));
                let carried = law.carried.as_ref().map(|carried| carried.select(&own));
                Law::Series(SeriesLaw { position, rotation, carried, ..*law })
            }
            Law::Keys(keys) => Law::Keys(keys.select(self.rows.len(), &own)),
        };
        let rows = own.iter().filter_map(|index| index_of[self.rows[*index] as usize]).collect();
        Self { rows, law, ..*self }
    }

    /// The Gaussians at `t`, from those of [`middle`](Self::middle).
    pub fn at(&self, middle: &Splats, t: f64) -> Splats {
        let mut splats = middle.clone();
        match &self.law {
            Law::Series(law) => law.apply(&mut splats, &self.rows, self.middle, t),
            Law::Keys(keys) => keys.apply(&mut splats, &self.rows, t),
        }
        splats
    }
}

/// Step of `s` for a difference quotient: its error is a third of the third derivative times the square, 1e-8.
const STEP: f64 = 1e-4;

impl SeriesLaw {
    fn velocities(&self, count: usize, t: f64) -> Vec<[f32; 3]> {
        let s = (t - self.t0) / self.half;
        let speed = 1.0 / (2.0 * STEP * self.half);
        (0..count).map(|i| self.position.sum(i, s + STEP, Some(s - STEP)).map(|x| (x * speed) as f32)).collect()
    }

    fn apply(&self, splats: &mut Splats, rows: &[u32], middle: f64, t: f64) {
        let (s, from) = ((t - self.t0) / self.half, (middle - self.t0) / self.half);
        for (index, row) in rows.iter().enumerate() {
            let shift = self.position.sum(index, s, Some(from));
            let mean = &mut splats.means[*row as usize];
            *mean = [0, 1, 2].map(|a| (f64::from(mean[a]) + shift[a]) as f32);
            if !self.rotation.functions.is_empty() {
                let turn = exp(self.rotation.sum(index, s, None));
                let [w, x, y, z] = exp(self.rotation.sum(index, from, None));
                let quat = &mut splats.quats[*row as usize];
                *quat = product(turn, product([w, -x, -y, -z], unit(*quat))).map(|x| x as f32);
            }
        }
    }
}

impl Keys {
    fn velocities(&self, count: usize, t: f64) -> Vec<[f32; 3]> {
        let (before, after) = self.around(t);
        let length = self.times[after] - self.times[before];
        let rests = length <= 0.0 || t < self.times[0] || t > self.times[self.times.len() - 1];
        let row = |i: usize| [0, 1, 2].map(|a| self.means[after * count + i][a] - self.means[before * count + i][a]);
        (0..count).map(|i| if rests { [0.0; 3] } else { row(i).map(|x| (f64::from(x) / length) as f32) }).collect()
    }

    /// The key frames before and after a time.
    fn around(&self, t: f64) -> (usize, usize) {
        let last = self.times.len() - 1;
        let after = self.times.partition_point(|time| *time <= t).clamp(usize::from(last > 0), last);
        (after.saturating_sub(1), after)
    }

    /// The rows `own` of `count`.
    fn select(&self, count: usize, own: &[usize]) -> Self {
        let places: Vec<usize> = (0..self.times.len()).flat_map(|k| own.iter().map(move |i| k * count + i)).collect();
        let sizes = if self.log_scales.is_empty() { &[][..] } else { &places };
        Self {
            times: self.times.clone(),
            means: places.iter().map(|place| self.means[*place]).collect(),
            quats: places.iter().map(|place| self.quats[*place]).collect(),
            log_scales: sizes.iter().map(|place| self.log_scales[*place]).collect(),
        }
    }

    fn apply(&self, splats: &mut Splats, rows: &[u32], t: f64) {
        let m = rows.len();
        let (before, after) = self.around(t);
        let length = self.times[after] - self.times[before];
        let share = if length > 0.0 { ((t - self.times[before]) / length).clamp(0.0, 1.0) } else { 0.0 };
        let mix = |a: f32, b: f32| (f64::from(a) * (1.0 - share) + f64::from(b) * share) as f32;
        for (index, row) in rows.iter().enumerate() {
            let (a, b, row) = (before * m + index, after * m + index, *row as usize);
            splats.means[row] = [0, 1, 2].map(|i| mix(self.means[a][i], self.means[b][i]));
            if !self.log_scales.is_empty() {
                splats.log_scales[row] = [0, 1, 2].map(|i| mix(self.log_scales[a][i], self.log_scales[b][i]));
            }
            // The shorter way round: q and -q are one rotation.
            let (p, q) = (unit(self.quats[a]), unit(self.quats[b]));
            let sign = if p.iter().zip(&q).map(|(p, q)| p * q).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
            let mixed = [0, 1, 2, 3].map(|i| (p[i] * (1.0 - share) + sign * q[i] * share) as f32);
            splats.quats[row] = unit(mixed).map(|x| x as f32);
        }
    }
}

/// `exp(r / 2)`, w x y z.
fn exp(r: [f64; 3]) -> [f64; 4] {
    let angle = r.iter().map(|x| x * x).sum::<f64>().sqrt();
    let factor = if angle > 1e-12 { (0.5 * angle).sin() / angle } else { 0.5 };
    [(0.5 * angle).cos(), factor * r[0], factor * r[1], factor * r[2]]
}

/// Hamilton's product.
fn product([a, b, c, d]: [f64; 4], [w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]
}

//! Motion as a page evaluates it: blocks of numbers for each moving row, and the weights that they have at a time.
//!
//! A moving row is `mean + sum_j w_j(t) position_j`, and likewise its rotation and its shape. The weights are tabulated
//! at knots that are spread evenly, value and slope; between knots they are Hermite's cubics. That is exact for key
//! frames and for powers up to 3.

use gs_burn::Gaussians;
use gs_models::DynamicScene;
use gs_models::basis::{self, MotionBasis};
use serde::Serialize;

use gs_train::fit::parameters::to_host;
use gs_train::run::exchange::time_function;

/// Most blocks of a row that have a weight at one time: as many as the page's shader has room for.
const BLOCKS_MAX: usize = 64;

/// Knots of the functions of a motion: a wave of three periods is off by a millionth, the sharpest kink by an eighth of
/// the distance of two.
const KNOTS: usize = 257;

/// Most key frames: 64 spans between them, doubled from [`KEYS_FIRST`].
const KEYS_MAX: usize = 65;

/// Key frames to begin with.
const KEYS_FIRST: usize = 9;

/// Numbers that the key frames of a scene may have, 32 MB: with more moving rows there are fewer key frames.
const KEY_NUMBERS_MAX: usize = 8 << 20;

/// Key frames are dense enough when a centre between two of them is off by less than this share of its Gaussian's
/// smallest size that is seen (see [`SIZE_FLOOR`]): no pixel notices a twentieth of a standard deviation.
const KEY_ERROR: f32 = 0.05;

/// Sizes below this share of the moving rows' median size count as this: a needle's thickness is widened by the
/// renderer anyway.
const SIZE_FLOOR: f32 = 0.3;

/// Share of the rows that may be off by more: single rows must not decide over all.
const KEY_OUTLIERS: f64 = 0.01;

/// A row moves when it differs between two key frames by more than this share of its scale or of a unit quaternion.
const REST: f32 = 1e-4;

/// The motion of the `M` rows that move, `J` blocks each.
#[derive(Debug, Clone)]
pub struct Motion {
    /// All Gaussians without the sums.
    pub base: Gaussians,
    /// `[M]`, the rows that move.
    pub rows: Vec<u32>,
    /// `[M, J, 3]`, scene units.
    pub position: Vec<f32>,
    /// `[M, J, 4]`, rotation vectors and a zero, or differences of quaternions; empty where nothing turns.
    pub turn: Vec<f32>,
    /// `[M, J, 4]`, differences of log scales and of the opacity's logit; empty where they stay.
    pub shape: Vec<f32>,
    /// The knots.
    pub clock: Clock,
    /// `[knots, J, 2]`: weight of each block, and its slope per distance of two knots.
    pub weights: Vec<f32>,
}

/// The knots of the weights, as the page's JSON has them.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Clock {
    /// Time of the first knot.
    first: f64,
    /// Time of the last.
    last: f64,
    /// How many.
    knots: usize,
    /// Blocks of a row.
    blocks: usize,
    /// Whether rotations are rotation vectors.
    vectors: bool,
}

impl Motion {
    /// The motion of a scene from the first to the last of the times that are shown, and half an `exposure` beyond;
    /// `None` where none of its rows moves.
    pub fn of(scene: &dyn DynamicScene, [first, last]: [f64; 2], exposure: f64) -> Option<Self> {
        match scene.basis().filter(|basis| basis.functions.len() + basis.turns.len() <= BLOCKS_MAX) {
            Some(basis) => Some(Self::of_basis(basis, [first - 0.5 * exposure, last + 0.5 * exposure])),
            None if last > first => key_frames(scene, [first, last]),
            None => None,
        }
    }

    fn of_basis(basis: MotionBasis, [first, last]: [f64; 2]) -> Self {
        let MotionBasis { base, rows, t0, half, functions, position, turns, rotation, .. } = basis;
        // At one moment every function is a number: any stretch of time about it will do.
        let [first, last] = if last > first { [first, last] } else { [first - half, last + half] };
        // A rotation goes into the block of the position with the same function.
        let mut all = functions.clone();
        let mut block_of = |turn: &basis::TimeFunction| {
            let known = all.iter().position(|function| function == turn);
            known.unwrap_or_else(|| {
                all.push(*turn);
                all.len() - 1
            })
        };
        let of_turns: Vec<usize> = turns.iter().map(&mut block_of).collect();
        let of_positions: Vec<usize> = (0..functions.len()).collect();
        let spread = |vectors: burn::tensor::Tensor<2>, places: &[usize], width: usize| -> Vec<f32> {
            let mut table = vec![0.0; rows.len() * all.len() * width];
            // Burn reads no tensor without columns.
            let values = if places.is_empty() { Vec::new() } else { to_host(vectors) };
            for (index, value) in values.into_iter().enumerate() {
                let (vector, axis) = (index / 3, index % 3);
                let (row, place) = (vector / places.len(), places[vector % places.len()]);
                table[width * (row * all.len() + place) + axis] += value;
            }
            table
        };
        let position = spread(position, &of_positions, 3);
        let turn = if turns.is_empty() { Vec::new() } else { spread(rotation, &of_turns, 4) };
        let weights = tabulated(&all, [first, last].map(|t| (t - t0) / half));
        let clock = Clock { first, last, knots: KNOTS, blocks: all.len(), vectors: true };
        Self { base, rows, position, turn, shape: Vec::new(), clock, weights }
    }

    /// How many rows move.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Keeps the motion of the rows `kept` of the scene (ascending), which become its rows 0, 1, 2, ...
    pub fn keep(&mut self, kept: &[u32]) {
        let own: Vec<(usize, u32)> = self
            .rows
            .iter()
            .enumerate()
            .filter_map(|(own, row)| Some((own, kept.binary_search(row).ok()? as u32)))
            .collect();
        let pick = |values: &[f32]| -> Vec<f32> {
            let width = values.len() / self.rows.len().max(1);
            own.iter().flat_map(|(row, _)| values[row * width..][..width].iter().copied()).collect()
        };
        (self.position, self.turn, self.shape) = (pick(&self.position), pick(&self.turn), pick(&self.shape));
        self.rows = own.into_iter().map(|(_, row)| row).collect();
    }
}

/// Values and slopes of functions at [`KNOTS`] knots from the first to the last `s`.
fn tabulated(functions: &[basis::TimeFunction], [first, last]: [f64; 2]) -> Vec<f32> {
    /// Slopes are differences over this share of the distance of two knots, to either side.
    const NEAR: f64 = 1e-3;
    let functions: Vec<_> = functions.iter().map(time_function).collect();
    let step = (last - first) / (KNOTS - 1) as f64;
    let sample = |index: usize| {
        let (function, s) = (&functions[index % functions.len()], first + step * (index / functions.len()) as f64);
        let slope = (function.at(s + NEAR * step) - function.at(s - NEAR * step)) / (2.0 * NEAR);
        [function.at(s) as f32, slope as f32]
    };
    (0..KNOTS * functions.len()).flat_map(sample).collect()
}

/// Makes a quaternion one of length 1.
pub(super) fn normalise(quat: &mut [f32; 4]) {
    let norm = quat.iter().map(|q| q * q).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    quat.iter_mut().for_each(|q| *q /= norm);
}

/// All numbers of a scene at one time that may change with it.
struct Frame {
    means: Vec<f32>,
    quats: Vec<f32>,
    log_scales: Vec<f32>,
    logits: Vec<f32>,
}

impl Frame {
    fn of(gaussians: &Gaussians) -> Self {
        let mut quats = to_host(gaussians.quats.val().inner());
        quats.as_chunks_mut().0.iter_mut().for_each(normalise);
        Self {
            means: to_host(gaussians.means.val().inner()),
            quats,
            log_scales: to_host(gaussians.log_scales.val().inner()),
            logits: to_host(gaussians.opacity_logits.val().inner()),
        }
    }

    fn scale(&self, row: usize) -> f32 {
        let scales = &self.log_scales[3 * row..][..3];
        (scales.iter().sum::<f32>() / 3.0).exp()
    }
}

/// The motion by key frames, as many as the scene's paths need.
fn key_frames(scene: &dyn DynamicScene, [first, last]: [f64; 2]) -> Option<Motion> {
    let times = |count: usize| -> Vec<f64> {
        (0..count).map(|i| first + (last - first) * i as f64 / (count - 1) as f64).collect()
    };
    let read = |count: usize| -> Vec<Frame> { scene.at_times(&times(count)).iter().map(Frame::of).collect() };
    let mut count = KEYS_FIRST;
    let mut frames = read(count);
    let rows = moving(&frames);
    if rows.is_empty() {
        return None;
    }
    while count < KEYS_MAX && 11 * rows.len() * (2 * count - 1) <= KEY_NUMBERS_MAX {
        let finer = read(2 * count - 1);
        let enough = suffices(&finer, &rows);
        (count, frames) = (2 * count - 1, finer);
        if enough {
            break;
        }
    }
    Some(assembled(scene.at(first), &frames, rows, [first, last]))
}

fn differs(a: &[f32], b: &[f32], width: usize, row: usize, by: f32) -> bool {
    let [a, b] = [a, b].map(|values| &values[width * row..][..width]);
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > by)
}

fn quats_differ(a: &Frame, b: &Frame, row: usize) -> bool {
    let [p, q] = [a, b].map(|frame| &frame.quats[4 * row..][..4]);
    // By entries: the product of nearly equal quaternions is 1 in f32 from 0.02 degrees on, and below 1 by rounding.
    let sign = p.iter().zip(q).map(|(p, q)| p * q).sum::<f32>().signum();
    p.iter().zip(q).any(|(p, q)| (p - sign * q).abs() > REST)
}

fn shapes_differ(a: &Frame, b: &Frame, row: usize) -> bool {
    differs(&a.log_scales, &b.log_scales, 3, row, REST) || differs(&a.logits, &b.logits, 1, row, REST)
}

/// The rows that are not the same in all frames.
fn moving(frames: &[Frame]) -> Vec<u32> {
    let begin = &frames[0];
    let moves = |row: usize| {
        let by = REST * begin.scale(row);
        frames[1..].iter().any(|frame| {
            differs(&begin.means, &frame.means, 3, row, by)
                || quats_differ(begin, frame, row)
                || shapes_differ(begin, frame, row)
        })
    };
    (0..begin.logits.len()).filter(|row| moves(*row)).map(|row| row as u32).collect()
}

/// Whether every second frame predicts those between.
fn suffices(frames: &[Frame], rows: &[u32]) -> bool {
    let mut sizes: Vec<f32> = rows.iter().map(|row| frames[0].scale(*row as usize)).collect();
    let sizes_of = sizes.clone();
    sizes.sort_by(f32::total_cmp);
    let floor = SIZE_FLOOR * sizes[sizes.len() / 2];
    let wrong = |(row, size): (&u32, &f32)| {
        let row = *row as usize;
        let bound = KEY_ERROR * size.max(floor);
        (1..frames.len()).step_by(2).any(|middle| {
            let [a, b] = [middle / 2, middle / 2 + 1];
            (0..3).any(|axis| {
                let at = |frame: usize| frames[frame].means[3 * row + axis];
                let slope = |key: usize| {
                    let [before, after] = neighbours(key, frames.len() / 2 + 1);
                    (at(2 * after) - at(2 * before)) / (after - before) as f32
                };
                // Hermite's cubic half-way.
                let found = 0.5 * (at(2 * a) + at(2 * b)) + 0.125 * (slope(a) - slope(b));
                (found - at(middle)).abs() > bound
            })
        })
    };
    let count = rows.iter().zip(&sizes_of).filter(|row| wrong(*row)).count();
    count as f64 <= KEY_OUTLIERS * rows.len() as f64
}

/// The keys whose difference gives the slope at one: as Catmull and Rom's, and in a straight line at both ends.
fn neighbours(key: usize, count: usize) -> [usize; 2] {
    [key.saturating_sub(1), (key + 1).min(count - 1)]
}

/// The weights of key frames: each counts 1 at its own time and 0 at those of the others.
fn of_keys(count: usize) -> Vec<f32> {
    let sample = |index: usize| {
        let (key, block) = (index / count, index % count);
        let [before, after] = neighbours(key, count);
        let is = |other: usize| f32::from(u8::from(block == other));
        [is(key), (is(after) - is(before)) / (after - before) as f32]
    };
    (0..count * count).flat_map(sample).collect()
}

/// The differences of the frames to the first one.
fn assembled(base: Gaussians, frames: &[Frame], rows: Vec<u32>, [first, last]: [f64; 2]) -> Motion {
    let begin = &frames[0];
    let any = |what: fn(&Frame, &Frame, usize) -> bool| {
        rows.iter().any(|row| frames[1..].iter().any(|frame| what(begin, frame, *row as usize)))
    };
    let (turns, shapes) = (any(quats_differ), any(shapes_differ));
    let (mut position, mut turn, mut shape) = (Vec::new(), Vec::new(), Vec::new());
    for row in rows.iter().map(|row| *row as usize) {
        let own = &begin.quats[4 * row..][..4];
        let mut last = [own[0], own[1], own[2], own[3]];
        for frame in frames {
            position.extend((0..3).map(|axis| frame.means[3 * row + axis] - begin.means[3 * row + axis]));
            if turns {
                // A quaternion and its negative are one rotation; a path of them must not jump.
                let next = &frame.quats[4 * row..][..4];
                let sign = if last.iter().zip(next).map(|(a, b)| a * b).sum::<f32>() < 0.0 { -1.0 } else { 1.0 };
                last = [0, 1, 2, 3].map(|i| sign * next[i]);
                turn.extend((0..4).map(|i| last[i] - own[i]));
            }
            if shapes {
                shape.extend((0..3).map(|axis| frame.log_scales[3 * row + axis] - begin.log_scales[3 * row + axis]));
                shape.push(frame.logits[row] - begin.logits[row]);
            }
        }
    }
    let clock = Clock { first, last, knots: frames.len(), blocks: frames.len(), vectors: false };
    Motion { base, rows, position, turn, shape, clock, weights: of_keys(frames.len()) }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use basis::{Form, Past, TimeFunction};

    use super::*;

    /// The weight of a block at `x` (0 at the first knot, 1 at the second), as the page's script takes it.
    fn weight(table: &[f32], blocks: usize, block: usize, x: f64) -> f64 {
        let knots = table.len() / (2 * blocks);
        let knot = (x.floor().max(0.0) as usize).min(knots - 2);
        let [a, c, b, d] =
            [0, 1, 2 * blocks, 2 * blocks + 1].map(|offset| f64::from(table[2 * (blocks * knot + block) + offset]));
        let u = x - knot as f64;
        a + u * (c + u * (3.0 * (b - a) - 2.0 * c - d + u * (2.0 * (a - b) + c + d)))
    }

    #[test]
    fn functions_come_back_between_knots() {
        let wave = Form::Sine { power: 1, rate: 3.0 * PI };
        let returning = TimeFunction { past: Some(Past { line: [0.0, 0.6], fade: 0.25 }), ..TimeFunction::power(3) };
        let of = |form| TimeFunction { form, past: None };
        let functions = [TimeFunction::power(3), of(wave), of(Form::Ramp { near: 0.2, far: 0.3 }), returning];
        let [first, last] = [-1.3, 1.3];
        let table = tabulated(&functions, [first, last]);
        let step = (last - first) / (KNOTS - 1) as f64;
        for (block, function) in functions.iter().enumerate() {
            let exact = time_function(function);
            let off = |x: f64| (weight(&table, functions.len(), block, x) - exact.at(first + step * x)).abs();
            let worst = (0..10 * KNOTS - 10).map(|i| off(0.1 * f64::from(i as u32))).fold(0.0, f64::max);
            // A parabola that begins within a stretch bends the cubic: by the step squared times the change of the
            // second derivative over 64.
            let bound = if block < 2 { 2e-6 } else { 0.02 * step };
            assert!(worst < bound, "{function:?}: {worst}");
        }
    }

    #[test]
    fn key_frames_are_met_and_sum_to_one() {
        let table = of_keys(9);
        for x in [0.0, 0.3, 1.0, 4.5, 7.7, 8.0] {
            let weights: Vec<f64> = (0..9).map(|block| weight(&table, 9, block, x)).collect();
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-6);
            // A straight path stays one, at its ends too.
            let place: f64 = weights.iter().enumerate().map(|(key, weight)| weight * key as f64).sum();
            assert!((place - x).abs() < 1e-6, "{place} at {x}");
        }
    }
}

//! Motion as a page evaluates it: blocks of numbers for each moving row, and the weights that they have at a time.

use gs_burn::Gaussians;
use gs_models::DynamicScene;
use gs_models::basis::{MotionBasis, TimeFunction};
use serde::Serialize;

use crate::fit::parameters::to_host;

/// Most blocks of one kind that the page's shader has weights for.
const BLOCKS_MAX: usize = 64;

/// Most key frames: 64 spans between them, doubled from [`KEYS_FIRST`].
const KEYS_MAX: usize = 65;

/// Key frames to begin with.
const KEYS_FIRST: usize = 9;

/// Numbers that the key frames of a scene may have, 32 MB: with more moving rows there are fewer key frames.
const KEY_NUMBERS_MAX: usize = 8 << 20;

/// Key frames are dense enough when a centre between two of them is off by less than this share of its Gaussian's smallest size
/// that is seen (see [`SIZE_FLOOR`]): no pixel notices a twentieth of a standard deviation.
const KEY_ERROR: f32 = 0.05;

/// Sizes below this share of the moving rows' median size count as this: a needle's thickness is widened by the renderer anyway.
const SIZE_FLOOR: f32 = 0.3;

/// Share of the rows that may be off by more: single rows must not decide over all.
const KEY_OUTLIERS: f64 = 0.01;

/// A row moves when it differs between two key frames by more than this share of its scale or of a unit quaternion.
const REST: f32 = 1e-4;

/// The motion of the rows that move.
#[derive(Debug, Clone)]
pub struct Motion {
    /// All Gaussians without the sums.
    pub base: Gaussians,
    /// `[M]`, the rows that move.
    pub rows: Vec<u32>,
    /// `[M, J, 3]`, scene units.
    pub position: Vec<f32>,
    /// `[M, K, 3]` rotation vectors, or `[M, K, 4]` differences of quaternions.
    pub turn: Vec<f32>,
    /// `[M, L, 4]` differences of log scales and of the opacity's logit.
    pub shape: Vec<f32>,
    /// The weights by time.
    pub clock: Clock,
}

/// The weights of the blocks at a time `t`.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// Each block has a function of `s = (t - t0) / half`; shapes do not change.
    Functions {
        /// Time of `s = 0`.
        t0: f64,
        /// Time from `s = 0` to `s = 1`.
        half: f64,
        /// One a position block.
        position: Vec<TimeFunction>,
        /// One a rotation block; these are rotation vectors.
        turn: Vec<TimeFunction>,
    },
    /// Each block is a key frame; between them Catmull and Rom's cubics. Rotations are differences of quaternions.
    Keys {
        /// Time of the first.
        first: f64,
        /// Time of the last.
        last: f64,
        /// How many, spread evenly.
        count: usize,
        /// Whether rotations have blocks.
        turns: bool,
        /// Whether shapes have blocks.
        shapes: bool,
    },
}

impl Motion {
    /// The motion of a scene from the first to the last of the times that are shown; `None` where none of its rows moves.
    pub fn of(scene: &dyn DynamicScene, [first, last]: [f64; 2]) -> Option<Self> {
        let basis = scene.basis().filter(|basis| basis.functions.len().max(basis.turns.len()) <= BLOCKS_MAX);
        match basis {
            Some(basis) => Some(Self::of_basis(basis)),
            None if last > first => key_frames(scene, [first, last]),
            None => None,
        }
    }

    fn of_basis(basis: MotionBasis) -> Self {
        let MotionBasis { base, rows, t0, half, functions, position, turns, rotation } = basis;
        let clock = Clock::Functions { t0, half, position: functions, turn: turns };
        let host = |tensor: burn::tensor::Tensor<2>| if tensor.dims()[1] == 0 { Vec::new() } else { to_host(tensor) };
        Self { base, rows, position: host(position), turn: host(rotation), shape: Vec::new(), clock }
    }

    /// How many rows move.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Numbers of position, rotation and shape blocks of a row.
    pub fn blocks(&self) -> [usize; 3] {
        match &self.clock {
            Clock::Functions { position, turn, .. } => [position.len(), turn.len(), 0],
            Clock::Keys { count, turns, shapes, .. } => {
                [*count, usize::from(*turns) * count, usize::from(*shapes) * count]
            }
        }
    }

    /// Keeps the motion of the rows `kept` of the scene (ascending), which become its rows 0, 1, 2, ...
    pub fn keep(&mut self, kept: &[u32]) {
        let [j, k, l] = self.blocks();
        let turn = if matches!(self.clock, Clock::Functions { .. }) { 3 } else { 4 };
        let own: Vec<(usize, u32)> = self
            .rows
            .iter()
            .enumerate()
            .filter_map(|(own, row)| Some((own, kept.binary_search(row).ok()? as u32)))
            .collect();
        let pick = |values: &[f32], width: usize| -> Vec<f32> {
            own.iter().flat_map(|(row, _)| values[row * width..][..width].iter().copied()).collect()
        };
        (self.position, self.turn, self.shape) =
            (pick(&self.position, 3 * j), pick(&self.turn, turn * k), pick(&self.shape, 4 * l));
        self.rows = own.into_iter().map(|(_, row)| row).collect();
    }
}

/// The rotations as unit quaternions, `[4 N]`, w x y z.
pub(super) fn unit_quats(gaussians: &Gaussians) -> Vec<f32> {
    let mut quats = to_host(gaussians.quats.val().inner());
    for quat in quats.as_chunks_mut::<4>().0 {
        let norm = quat.iter().map(|q| q * q).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        quat.iter_mut().for_each(|q| *q /= norm);
    }
    quats
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
        Self {
            means: to_host(gaussians.means.val().inner()),
            quats: unit_quats(gaussians),
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
    let coarse: Vec<&Frame> = frames.iter().step_by(2).collect();
    let wrong = |(row, size): (&u32, &f32)| {
        let row = *row as usize;
        let bound = KEY_ERROR * size.max(floor);
        (0..coarse.len() - 1).any(|span| {
            let weights = catmull_rom(span as f64 + 0.5, coarse.len());
            (0..3).any(|axis| {
                let at = |frame: &Frame| frame.means[3 * row + axis];
                let found: f32 = weights.iter().map(|(key, weight)| *weight as f32 * at(coarse[*key])).sum();
                (found - at(&frames[2 * span + 1])).abs() > bound
            })
        })
    };
    let count = rows.iter().zip(&sizes_of).filter(|row| wrong(*row)).count();
    count as f64 <= KEY_OUTLIERS * rows.len() as f64
}

/// The key frames with a weight at `x` (0 at the first key frame, 1 at the second) and their weights; beyond both ends a further key frame
/// is thought of in a straight line. As the page's script.
fn catmull_rom(x: f64, count: usize) -> Vec<(usize, f64)> {
    let span = (x.floor().max(0.0) as usize).min(count - 2);
    let u = x - span as f64;
    let (u2, u3) = (u * u, u * u * u);
    let [before, from, to, after] = [
        0.5 * (-u3 + 2.0 * u2 - u),
        0.5 * (3.0 * u3 - 5.0 * u2 + 2.0),
        0.5 * (-3.0 * u3 + 4.0 * u2 + u),
        0.5 * (u3 - u2),
    ];
    let mut weights = vec![(span, from), (span + 1, to)];
    match span {
        0 => [weights[0].1, weights[1].1] = [from + 2.0 * before, to - before],
        _ => weights.push((span - 1, before)),
    }
    match span + 2 == count {
        true => [weights[0].1, weights[1].1] = [weights[0].1 - after, weights[1].1 + 2.0 * after],
        false => weights.push((span + 2, after)),
    }
    weights
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
    let clock = Clock::Keys { first, last, count: frames.len(), turns, shapes };
    Motion { base, rows, position, turn, shape, clock }
}

//! Bodies as a Burn module: where Gaussians are at a time, by the nodes that bend a body, by its free motion, and by
//! its law.
//!
//! A Gaussian of a body is at `law(t) . free(t) . bend(t)` of where it was in the first frame. `bend` mixes the motions
//! of the body's nodes; `free` is a smooth motion of any kind until the law's time `since`; the law takes over there.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::basis::{EVEN, MOTION, free};
use super::law::{BodyPose, DAMPING_FLOOR, Law, LawValues, NUMBERS, Term};
use super::nodes::{NodeFrame, Skin, strain};
use super::rhythm::tied;
use super::transforms::{Turn, Way, constant};
use crate::rotation::product;
use crate::sparsedyn::state::State;
use crate::sparsedyn::turning::Factors;

/// Squared rotation rate that keeps a vanishing axis finite: far below any visible rotation, above the smallest `f32`
/// after division.
const AXIS_FLOOR: f64 = 1e-12;

/// A body's constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyFrame {
    /// The centre in the first frame, world, scene units.
    #[serde(with = "crate::bits")]
    pub centre: [f64; 3],
    /// The law.
    pub law: Law,
    /// The time from which the law holds. Before it the body moves freely.
    #[serde(with = "crate::bits")]
    pub since: f64,
    /// Oscillations of its nodes beside their free motion, which rests after the seen time.
    pub rhythms: u32,
    /// Their rates as multiples of the first, where they are one periodic motion; empty: each has its own rate.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub multiples: Vec<u32>,
    /// How sure the kind of law is among those that were compared, 0 to 1; `None` where none were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f32>,
}

/// The time that bodies were seen in, and the size of their tables.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// First and last observed time.
    #[serde(with = "crate::bits")]
    pub times: [f64; 2],
    /// Knots of a free motion.
    pub knots: usize,
    /// The unit of lengths, scene units.
    #[serde(with = "crate::bits")]
    pub length: f64,
}

impl Span {
    /// Functions of time of a free motion.
    pub fn columns(&self) -> usize {
        EVEN + self.knots
    }
}

/// The motions of `B` bodies and `K` nodes.
#[derive(Module, Debug)]
pub struct Bodies {
    /// `[B, 24]` numbers of the laws; lengths in units of `span.length`.
    pub numbers: Param<Tensor<2>>,
    /// `[B, 6 (P + 8)]` of the free motions, the last 8 unused: for each function of time a shift in units of
    /// `span.length` and a rotation vector, radians.
    pub free: Param<Tensor<2>>,
    /// `[K, 6 (P + 8)]` of the nodes: the same, in the body before its motion, and the sines and cosines of its
    /// oscillations. What these leave of the seen time is in the free motion, which rests after it.
    pub nodes: Param<Tensor<2>>,
    /// `[B, 4]` rates of these oscillations, radians per unit of time.
    pub rates: Param<Tensor<2>>,
    /// Constants of each body.
    #[module(skip)]
    pub frames: Vec<BodyFrame>,
    /// Constants of each node.
    #[module(skip)]
    pub node_frames: Vec<NodeFrame>,
    /// The time that bodies were seen in.
    #[module(skip)]
    pub span: Span,
}

/// Most oscillations of a body.
pub const RHYTHMS: usize = 4;

/// The numbers of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Its constants.
    pub frame: BodyFrame,
    /// The numbers of its law, scene units.
    pub values: LawValues,
    /// Its free motion by function of time, scene units and radians; empty: none.
    pub free: Vec<[f64; MOTION]>,
    /// Rates of its oscillations, radians per unit of time.
    pub rates: Vec<f64>,
    /// Its nodes with their motions by function of time.
    pub nodes: Vec<(NodeFrame, Vec<[f64; MOTION]>)>,
}

impl Bodies {
    /// The bodies `all`, whose nodes are numbered in their order.
    pub fn new(all: &[Body], span: Span, device: &Device) -> Self {
        let columns = MOTION * (span.columns() + 2 * RHYTHMS);
        let row = |motion: &[[f64; MOTION]]| {
            let scaled = motion.as_flattened().iter().zip(motion_scales(span.length).into_iter().cycle());
            let mut row: Vec<f32> = scaled.map(|(x, scale)| (x / scale) as f32).collect();
            row.resize(columns, 0.0);
            row
        };
        let nodes: Vec<_> = all.iter().flat_map(|body| &body.nodes).collect();
        let rates = all.iter().flat_map(|body| (0..RHYTHMS).map(|k| body.rates.get(k).map_or(0.0, |x| *x as f32)));
        let table = |values: Vec<f32>, rows: usize, columns: usize| {
            Param::from_tensor(Tensor::from_data(TensorData::new(values, [rows, columns]), device))
        };
        Self {
            numbers: Param::from_tensor(numbers(all.iter().map(|body| body.values), span.length, device)),
            free: table(all.iter().flat_map(|body| row(&body.free)).collect(), all.len(), columns),
            nodes: table(nodes.iter().flat_map(|(_, motion)| row(motion)).collect(), nodes.len(), columns),
            rates: table(rates.collect(), all.len(), RHYTHMS),
            frames: all.iter().map(|body| body.frame.clone()).collect(),
            node_frames: nodes.iter().map(|(frame, _)| frame.clone()).collect(),
            span,
        }
    }

    /// Bodies with these constants and all numbers zero.
    pub fn at_rest(frames: Vec<BodyFrame>, node_frames: Vec<NodeFrame>, span: Span, device: &Device) -> Self {
        let of = |(index, frame): (usize, BodyFrame)| Body {
            frame,
            values: LawValues::REST,
            free: Vec::new(),
            rates: Vec::new(),
            nodes: node_frames
                .iter()
                .filter(|node| node.body == index)
                .map(|node| (node.clone(), Vec::new()))
                .collect(),
        };
        let all: Vec<Body> = frames.into_iter().enumerate().map(of).collect();
        Self::new(&all, span, device)
    }

    /// The numbers of each body; reads them from the device.
    pub fn all(&self) -> Vec<Body> {
        let host = |table: &Param<Tensor<2>>| table.val().into_data().iter::<f64>().collect::<Vec<f64>>();
        let (frees, nodes, rates) = (host(&self.free), host(&self.nodes), host(&self.rates));
        let width = self.free.dims()[1];
        let motion = |table: &[f64], row: usize| -> Vec<[f64; MOTION]> {
            let row = &table[width * row..width * (row + 1)];
            let scale = motion_scales(self.span.length);
            row.as_chunks::<MOTION>().0.iter().map(|six| std::array::from_fn(|k| six[k] * scale[k])).collect()
        };
        let of_node = |body: usize| {
            let own = self.node_frames.iter().enumerate().filter(move |(_, node)| node.body == body);
            own.map(|(index, node)| (node.clone(), motion(&nodes, index))).collect()
        };
        let one = |((index, frame), values): ((usize, &BodyFrame), LawValues)| Body {
            frame: frame.clone(),
            values,
            free: motion(&frees, index),
            rates: tied(&frame.multiples, &rates[RHYTHMS * index..][..frame.rhythms as usize]),
            nodes: of_node(index),
        };
        self.frames.iter().enumerate().zip(self.values()).map(one).collect()
    }

    /// These bodies with other numbers of their laws, scene units.
    pub fn with_values(&self, values: &[LawValues]) -> Self {
        let device = self.numbers.val().device();
        let drawn = numbers(values.iter().copied(), self.span.length, &device);
        Self { numbers: Param::from_tensor(drawn), ..self.clone() }
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The numbers of each body's law, scene units; reads them from the device.
    pub fn values(&self) -> Vec<LawValues> {
        let data = self.numbers.val().into_data();
        let numbers: Vec<f64> = data.iter::<f64>().collect();
        let scale = scales(self.span.length);
        let of = |(row, frame): (&[f64], &BodyFrame)| {
            let mask = frame.law.mask();
            let values = LawValues(std::array::from_fn(|k| row[k] * scale[k] * mask[k]));
            frame.law.constrained(values, frame.law_span(&self.span))
        };
        numbers.chunks_exact(NUMBERS).zip(&self.frames).map(of).collect()
    }

    /// The Gaussians at `positions` `[M, 3]` in the first frame, each of the body that `labels` names.
    pub fn of<'a>(&'a self, positions: &Tensor<2>, labels: &[u32]) -> Followers<'a> {
        let device = positions.device();
        let rows: Vec<i64> = labels.iter().map(|label| i64::from(*label)).collect();
        Followers {
            bodies: self,
            positions: positions.clone(),
            labels: Tensor::from_data(TensorData::new(rows, [labels.len()]), &device),
            skin: (!self.node_frames.is_empty()).then(|| Skin::of(positions, labels, &self.node_frames)),
        }
    }

    /// How far neighbouring nodes of one body are from one rigid motion at `time`, `[1]`, where `unit`, scene units, is
    /// what tracking leaves; `None` without neighbours.
    pub fn strain(&self, time: f64, unit: f64) -> Option<Tensor<1>> {
        if self.node_frames.is_empty() {
            return None;
        }
        let like = self.nodes.val();
        strain(&self.node_way(&like, time), &self.node_frames, unit)
    }

    /// The motion of the nodes at `time` that their oscillations leave to the free one: the mean over nodes of bodies
    /// that oscillate of `sqrt(e^2 / u^2 + 1) - 1` with `u` = `unit`, scene units. `None` without such a body.
    pub fn unsaid(&self, time: f64, unit: f64) -> Option<Tensor<1>> {
        let on: Vec<usize> =
            (0..self.node_frames.len()).filter(|node| self.frames[self.node_frames[*node].body].rhythms > 0).collect();
        if on.is_empty() {
            return None;
        }
        let like = self.nodes.val();
        let width = like.dims()[1];
        let basis = padded(free(self.span.times, self.span.knots, time.min(self.span.times[1])), width / MOTION);
        let basis: Vec<f64> = basis.iter().flat_map(|x| [*x; MOTION]).collect();
        let rows: Vec<i64> = on.iter().map(|node| *node as i64).collect();
        let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [on.len()]), &like.device());
        let terms = like.clone().select(0, rows) * constant(&like, basis, [1, width]);
        let six = terms.reshape([on.len(), width / MOTION, MOTION]).sum_dim(1).reshape([on.len(), MOTION]);
        let unit_of = |node: &usize| {
            let turn = self.node_frames[*node].width / unit;
            let shift = self.span.length / unit;
            [shift, shift, shift, turn, turn, turn]
        };
        let units = constant(&like, on.iter().flat_map(unit_of).collect(), [on.len(), MOTION]);
        Some((((six * units).square().sum_dim(1) + 1.0).sqrt() - 1.0).mean())
    }

    /// The motions of the nodes at `time`.
    fn node_way(&self, like: &Tensor<2>, time: f64) -> Way {
        let [count, width] = self.nodes.dims();
        let columns = width / MOTION;
        let frame = |node: &NodeFrame| &self.frames[node.body];
        let own = padded(free(self.span.times, self.span.knots, time.min(self.span.times[1])), columns);
        let basis: Vec<f64> = self.node_frames.iter().flat_map(|_| own.clone()).collect();
        let mut basis = constant(like, basis, [count, columns]);
        if self.frames.iter().any(|frame| frame.rhythms > 0) {
            let rows: Vec<i64> = self.node_frames.iter().map(|node| node.body as i64).collect();
            let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [count]), &like.device());
            let table = |of: &dyn Fn(&BodyFrame, usize) -> f64| {
                let row = |node: &NodeFrame| (0..RHYTHMS).map(|k| of(frame(node), k)).collect::<Vec<f64>>();
                constant(like, self.node_frames.iter().flat_map(row).collect(), [count, RHYTHMS])
            };
            let on = table(&|frame, k| f64::from(u8::from(k < frame.rhythms as usize)));
            let own = table(&|frame, _| f64::from(u8::from(frame.multiples.is_empty())));
            let of_first = table(&|frame, k| frame.multiples.get(k).map_or(0.0, |k| f64::from(*k)));
            let rates = self.rates.val().select(0, rows);
            let angle = (rates.clone() * own + rates.narrow(1, 0, 1) * of_first) * (time - self.span.times[0]);
            let waves = Tensor::cat(vec![angle.clone().sin() * on.clone(), (angle.cos() - 1.0) * on], 1);
            basis = Tensor::cat(vec![basis.narrow(1, 0, columns - 2 * RHYTHMS), waves], 1);
        }
        let centres = self.node_frames.iter().flat_map(|node| node.centre).collect();
        Way::of(self.nodes.val(), basis, constant(like, centres, [count, 3]), self.span.length)
    }

    /// The free motions of the bodies at `time`.
    fn free_way(&self, like: &Tensor<2>, time: f64) -> Way {
        let [count, width] = self.free.dims();
        let columns = width / MOTION;
        let of = |frame: &BodyFrame| padded(free(self.span.times, self.span.knots, time.min(frame.since)), columns);
        let basis = constant(like, self.frames.iter().flat_map(of).collect(), [count, columns]);
        Way::of(self.free.val(), basis, self.constant(like, 3, |frame| frame.centre.to_vec()), self.span.length)
    }

    /// Whether a body moves freely at some time.
    fn has_free(&self) -> bool {
        self.frames.iter().any(|frame| frame.since > self.span.times[0])
    }

    /// The laws at `time`: `[B, 3]` rotation vectors, and `[B, 3]` shifts of the centres, scene units.
    fn laws(&self, like: &Tensor<2>, time: f64) -> Turn {
        let s = self.constant(like, 1, |frame| vec![frame.law_time(&self.span, time)]);
        let mask = self.constant(like, NUMBERS, |frame| frame.law.mask().to_vec());
        let numbers = self.numbers.val() * mask;
        let vector = |term: Term| numbers.clone().narrow(1, term.numbers().start, 3);
        let first = Term::Oscillation.numbers().start;
        let (rate, phase) = (numbers.clone().narrow(1, first, 1), numbers.clone().narrow(1, first + 1, 1));
        let half = s.clone().square() * 0.5;
        let wave = (rate * s.clone() + phase.clone()).sin();
        let (even, wave) = self.damped(&numbers, (s, wave), time);
        let swing = wave - phase.sin();
        let (spin, up) = self.on_one_axis(vector(Term::Spin), vector(Term::SpinUp));
        let rotation = spin * even.clone() + up * half.clone() + vector(Term::Swing) * swing.clone();
        let pivot = vector(Term::Pivot);
        // `-(R - 1) d`.
        let about = Factors::of(&rotation).turned_by(&rotation, &pivot);
        let shift =
            vector(Term::Velocity) * even + vector(Term::Acceleration) * half + vector(Term::Sway) * swing - about;
        Turn { rotation, shift: shift * self.span.length }
    }

    /// The time `s` of even terms, and the sine of oscillations, both `[B, 1]`, with what dies away, at `time`.
    fn damped(&self, numbers: &Tensor<2>, (s, wave): (Tensor<2>, Tensor<2>), time: f64) -> (Tensor<2>, Tensor<2>) {
        if !self.frames.iter().any(|frame| frame.law.has(Term::Damping)) {
            return (s, wave);
        }
        let fades = |frame: &BodyFrame| frame.law.has(Term::Damping) && frame.law_time(&self.span, time) > 0.0;
        let on = self.constant(&s, 1, |frame| vec![f64::from(u8::from(fades(frame)))]);
        let rate = numbers.clone().narrow(1, Term::Damping.numbers().start, 1).abs() + DAMPING_FLOOR;
        let angle = rate.clone() * s.clone() * on.clone();
        // `1 - exp(-x)` by the hyperbolic tangent, which keeps the digits of a small `x`.
        let half = (angle.clone() * 0.5).tanh();
        let moved = half.clone() * 2.0 / (half + 1.0) / rate;
        (s.clone() - s * on.clone() + moved * on, wave * (-angle).exp())
    }

    /// [`Law::constrained`] for all bodies, differentiable: `[B, 3]` rotations and angular accelerations.
    fn on_one_axis(&self, spin: Tensor<2>, up: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        if !self.frames.iter().any(|frame| frame.law.has_one_axis()) {
            return (spin, up);
        }
        let half = self.constant(&spin, 1, |frame| vec![0.5 * frame.law_span(&self.span)]);
        // 1 where both point the same way or one is zero, else -1; it has no gradient.
        let sign = (spin.clone() * up.clone()).sum_dim(1).detach().sign();
        let sign = sign.clone() + (sign.abs() - 1.0).abs();
        let sum = spin.clone() + up.clone() * sign * half;
        let squared = (sum.clone() * sum.clone()).sum_dim(1);
        // A rotation rate below the square root of this, radians per unit of time, has no axis to speak of.
        let axis = sum / (squared + AXIS_FLOOR).sqrt();
        let along = |vector: &Tensor<2>| axis.clone() * (vector.clone() * axis.clone()).sum_dim(1);
        let chosen = self.constant(&spin, 1, |frame| vec![f64::from(u8::from(frame.law.has_one_axis()))]);
        let mixed = |vector: Tensor<2>| {
            let along = along(&vector);
            (along - vector.clone()) * chosen.clone() + vector
        };
        (mixed(spin), mixed(up))
    }

    fn constant(&self, like: &Tensor<2>, columns: usize, of: impl Fn(&BodyFrame) -> Vec<f64>) -> Tensor<2> {
        constant(like, self.frames.iter().flat_map(of).collect(), [self.len(), columns])
    }
}

/// Gaussians of bodies.
#[derive(Debug, Clone)]
pub struct Followers<'a> {
    bodies: &'a Bodies,
    positions: Tensor<2>,
    labels: Tensor<1, Int>,
    skin: Option<Skin>,
}

impl Followers<'_> {
    /// Where they are at `time`; differentiable in positions and numbers.
    pub fn state(&self, time: f64) -> State {
        let bodies = self.bodies;
        let of = |rows: &Tensor<2>| rows.clone().select(0, self.labels.clone());
        let mut state = State::at_rest(self.positions.clone());
        if let Some(skin) = &self.skin {
            state = skin.bent(&bodies.node_way(&self.positions, time), &self.positions);
        }
        let firsts = bodies.constant(&self.positions, 3, |frame| frame.centre.to_vec());
        let mut centres = firsts.clone();
        if bodies.has_free() {
            let way = bodies.free_way(&self.positions, time);
            let offsets = state.positions - of(&firsts);
            let turned = offsets.clone() + way.turned(&self.labels, &offsets);
            let own = of(&way.shift) + of(&firsts);
            state = State { positions: turned + own, turns: product(of(&way.quaternions()), state.turns) };
            centres = firsts + way.shift;
        }
        let law = bodies.laws(&self.positions, time);
        let rotation = of(&law.rotation);
        let offsets = state.positions - of(&centres);
        let turned = offsets.clone() + Factors::of(&rotation).turned_by(&rotation, &offsets);
        let turns = state.turns.clone() + crate::rotation::turn(state.turns, rotation);
        State { positions: turned + of(&(centres + law.shift)), turns }
    }
}

/// The pose of a motion about `centre` for values `basis` of its functions of time.
fn pose(motion: &[[f64; MOTION]], basis: &[f64], centre: DVec3) -> BodyPose {
    let sum = |columns: std::ops::Range<usize>, from: usize| -> DVec3 {
        let terms = motion.iter().zip(basis).enumerate().filter(|(index, _)| columns.contains(index));
        terms.map(|(_, (six, x))| DVec3::from_slice(&six[from..from + 3]) * *x).sum()
    };
    let turn = |columns: std::ops::Range<usize>| DQuat::from_scaled_axis(sum(columns, 3));
    BodyPose { rotation: turn(EVEN..motion.len()) * turn(0..EVEN), centre: centre + sum(0..motion.len(), 0) }
}

/// `values` with zeros behind them.
fn padded(mut values: Vec<f64>, columns: usize) -> Vec<f64> {
    values.resize(columns, 0.0);
    values
}

/// `[B, 24]` numbers of laws in units of `length`.
fn numbers(all: impl ExactSizeIterator<Item = LawValues>, length: f64, device: &Device) -> Tensor<2> {
    let count = all.len();
    let scaled =
        |values: LawValues| std::array::from_fn::<f32, NUMBERS, _>(|k| (values.0[k] / scales(length)[k]) as f32);
    Tensor::from_data(TensorData::new(all.flat_map(scaled).collect::<Vec<f32>>(), [count, NUMBERS]), device)
}

/// The unit of each number of a motion by a function of time.
fn motion_scales(length: f64) -> [f64; MOTION] {
    [length, length, length, 1.0, 1.0, 1.0]
}

/// The unit of each number of a law.
fn scales(length: f64) -> [f64; NUMBERS] {
    let mut scales = [1.0; NUMBERS];
    for term in [Term::Velocity, Term::Acceleration, Term::Sway, Term::Pivot] {
        scales[term.numbers()].fill(length);
    }
    scales
}

impl BodyFrame {
    /// A body without oscillations that follows `law` from the time `since` on.
    pub fn of(centre: [f64; 3], law: Law, since: f64) -> Self {
        Self { centre, law, since, rhythms: 0, multiples: Vec::new(), confidence: None }
    }

    /// Time since the law holds; 0 before it, negative only before the first frame of a body that it moves all along.
    fn law_time(&self, span: &Span, time: f64) -> f64 {
        if self.since > span.times[0] { (time - self.since).max(0.0) } else { time - self.since }
    }

    /// The observed time in which the law holds.
    fn law_span(&self, span: &Span) -> f64 {
        (span.times[1] - self.since).max(0.0)
    }
}

impl Body {
    /// A body that a law alone moves.
    pub fn of(frame: BodyFrame, values: LawValues) -> Self {
        Self { frame, values, free: Vec::new(), rates: Vec::new(), nodes: Vec::new() }
    }

    /// The pose at `time` by the free motion and the law, without nodes.
    pub fn pose(&self, span: &Span, time: f64) -> BodyPose {
        let first = DVec3::from_array(self.frame.centre);
        let basis = free(span.times, span.knots, time.min(self.frame.since));
        let own = pose(&self.free, &basis, first);
        let law = self.values.pose(own.centre, self.frame.law_time(span, time));
        BodyPose { rotation: law.rotation * own.rotation, centre: law.centre }
    }

    /// The poses of the nodes at `time` by their own motion and the body's free one.
    pub fn node_poses(&self, span: &Span, time: f64) -> Vec<BodyPose> {
        let basis = free(span.times, span.knots, time.min(self.frame.since));
        let first = DVec3::from_array(self.frame.centre);
        let own = pose(&self.free, &basis, first);
        let of = |(node, motion): &(NodeFrame, Vec<[f64; MOTION]>)| {
            let bent = pose(motion, &basis, DVec3::from_array(node.centre));
            BodyPose { rotation: own.rotation * bent.rotation, centre: own.apply(bent.centre, first) }
        };
        self.nodes.iter().map(of).collect()
    }
}

//! The learned part of Eq. 2, as a Burn module: coefficients of position and rotation, kinks, the motion of bodies, and
//! the remainder's network.
//!
//! [`TaylorMotion`] holds it, [`MotionFrame`] everything beside it (which rows move, of which order, in which window of
//! time), and [`Paths`] are both, ready to be asked at any time.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::RowMap;
use gs_burn::ops::rows::take_rows;
use serde::{Deserialize, Serialize};

use super::bodies::{Body, BodyFrame, NO_BODY};
use super::kinks::{Contact, Kinks};
use super::paths::Paths;
use super::remainder::{RemainderFrame, RemainderNetwork};
use super::window::TimeWindow;

/// All of a [`TaylorMotion`] that is not learned: its configuration, and beside its tensors all that a checkpoint
/// needs. As JSON to the bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MotionFrame {
    /// The time of the expansion, and the stretch of time around it.
    pub window: TimeWindow,
    /// First and last time of the recording, the data set's unit. The window need not be centred on it.
    #[serde(with = "crate::bits")]
    pub recording: [f64; 2],
    /// Room for orders of the position, `K`, the same for all; may be 0.
    pub order: usize,
    /// Room for orders of the rotation, `Kr`; may be 0.
    pub rotation_order: usize,
    /// Rows of the `M` moving Gaussians in the scene, each at most once.
    pub rows: Vec<u32>,
    /// `[M]`, the highest order of its own that each position still has, at most `K`.
    pub orders: Vec<u8>,
    /// `[M]`, the highest order of its own that each rotation still has, at most `Kr`.
    pub rotation_orders: Vec<u8>,
    /// `[M]`, whether a row has jumps of its own.
    pub own_jumps: Vec<bool>,
    /// `[M]`, the body of each row, by its place in `bodies`; [`NO_BODY`]: none.
    pub body_of: Vec<u8>,
    /// Bodies, fewer than [`NO_BODY`].
    pub bodies: Vec<BodyFrame>,
    /// `J` contacts of the whole scene.
    pub contacts: Vec<Contact>,
    /// The frame of the remainder's network, if there is one.
    pub remainder: Option<RemainderFrame>,
}

impl MotionFrame {
    /// `rows` that may move at full `order` and `rotation_order` over `window`, without kinks or remainder. The
    /// recording is the window.
    pub fn new(rows: Vec<u32>, order: usize, rotation_order: usize, window: TimeWindow) -> Self {
        Self {
            window,
            recording: [window.t0 - window.half, window.t0 + window.half],
            order,
            rotation_order,
            orders: vec![order as u8; rows.len()],
            rotation_orders: vec![rotation_order as u8; rows.len()],
            own_jumps: vec![true; rows.len()],
            body_of: vec![NO_BODY; rows.len()],
            rows,
            bodies: Vec::new(),
            contacts: Vec::new(),
            remainder: None,
        }
    }

    /// A zero motion: all coefficients and jumps are zero, and so is the remainder, whose network is drawn from `seed`.
    /// A record or a checkpoint's tensors fill it.
    ///
    /// # Panics
    /// When there is not one order, and one body, a row.
    pub fn init(&self, seed: u64, device: &Device) -> TaylorMotion {
        let count = self.rows.len();
        assert!(self.is_consistent(), "one order and one body a moving row");
        let zeros = |blocks: usize| Tensor::zeros([count, 3 * blocks], device);
        let kinks = || Kinks::new(self.contacts.clone(), zeros(self.contacts.len()));
        let blocks = self.order + self.contacts.len();
        let body = |frame: &BodyFrame| Body::new(*frame, blocks, self.rotation_order, device);
        TaylorMotion {
            position: Param::from_tensor(zeros(self.order)),
            rotation: Param::from_tensor(zeros(self.rotation_order)),
            kinks: (!self.contacts.is_empty()).then(kinks),
            bodies: self.bodies.iter().map(body).collect(),
            remainder: self.remainder.map(|frame| frame.init(seed, device)),
            window: self.window,
            recording: self.recording,
            rows: self.rows.clone(),
            orders: self.orders.clone(),
            rotation_orders: self.rotation_orders.clone(),
            own_jumps: self.own_jumps.clone(),
            body_of: self.body_of.clone(),
        }
    }

    /// Whether every row has its entry in each list, and a body that is there.
    pub fn is_consistent(&self) -> bool {
        let lists = [self.orders.len(), self.rotation_orders.len(), self.own_jumps.len(), self.body_of.len()];
        let known = |body: &u8| *body == NO_BODY || usize::from(*body) < self.bodies.len();
        lists == [self.rows.len(); 4] && self.body_of.iter().all(known) && self.bodies.len() < usize::from(NO_BODY)
    }
}

/// How `M` of a scene's Gaussians move, as it is learned. The formula is in [`paths`](super::paths).
#[derive(Module, Debug)]
pub struct TaylorMotion {
    /// `[M, 3 K]`, blocks of three of the [polynomials](super::window::polynomials) of order 1 to `K`, scene units.
    pub position: Param<Tensor<2>>,
    /// `[M, 3 Kr]`, likewise for the rotation vector, radians, world axes.
    pub rotation: Param<Tensor<2>>,
    /// Sudden changes of velocity; `None` without contacts.
    pub kinks: Option<Kinks>,
    /// Bodies, whose motion rows follow above their own orders.
    pub bodies: Vec<Body>,
    /// The network for the rest of the motion, where one is learned.
    pub remainder: Option<RemainderNetwork>,
    /// See [`MotionFrame`], as all that follows.
    #[module(skip)]
    pub window: TimeWindow,
    /// First and last time of the recording.
    #[module(skip)]
    pub recording: [f64; 2],
    /// `[M]`, rows of the moving Gaussians.
    #[module(skip)]
    pub rows: Vec<u32>,
    /// `[M]`, highest order of each position.
    #[module(skip)]
    pub orders: Vec<u8>,
    /// `[M]`, highest order of each rotation.
    #[module(skip)]
    pub rotation_orders: Vec<u8>,
    /// `[M]`, whether a row has jumps of its own.
    #[module(skip)]
    pub own_jumps: Vec<bool>,
    /// `[M]`, the body of each row.
    #[module(skip)]
    pub body_of: Vec<u8>,
}

impl TaylorMotion {
    /// Paths, below the motion's own, of the parameters with one row per moving Gaussian; the others are of the
    /// network.
    pub const ROW_PARAMETERS: [&str; 3] = ["position", "rotation", "kinks.jumps"];

    /// All that is not learned.
    pub fn frame(&self) -> MotionFrame {
        MotionFrame {
            window: self.window,
            recording: self.recording,
            order: self.order(),
            rotation_order: self.rotation_order(),
            rows: self.rows.clone(),
            orders: self.orders.clone(),
            rotation_orders: self.rotation_orders.clone(),
            own_jumps: self.own_jumps.clone(),
            body_of: self.body_of.clone(),
            bodies: self.bodies.iter().map(|body| body.frame).collect(),
            contacts: self.contacts().to_vec(),
            remainder: self.remainder.as_ref().map(|network| network.frame),
        }
    }

    /// `M`, how many Gaussians move.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether none moves.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// `K`, the highest order that positions have room for.
    pub fn order(&self) -> usize {
        self.position.dims()[1] / 3
    }

    /// `Kr`, the highest order that rotations have room for.
    pub fn rotation_order(&self) -> usize {
        self.rotation.dims()[1] / 3
    }

    /// `J` contacts of the whole scene.
    pub fn contacts(&self) -> &[Contact] {
        self.kinks.as_ref().map_or(&[], |kinks| &kinks.contacts)
    }

    /// The moving rows as a tensor `[M]`.
    pub fn row_tensor(&self) -> Tensor<1, Int> {
        let rows: Vec<i32> = self.rows.iter().map(|row| *row as i32).collect();
        Tensor::from_data(TensorData::new(rows, [self.len()]), &self.position.device())
    }

    /// The paths of Gaussians whose centres at `t0` are `means` `[N, 3]`. Runs the remainder's network.
    pub fn paths(&self, means: &Tensor<2>) -> Paths {
        let rows = self.row_tensor();
        let remainder = self.remainder.as_ref().filter(|_| !self.is_empty());
        let remainder = remainder.map(|network| network.evaluate(take_rows(means.clone(), &rows)));
        let (position, rotation) = (self.position.val(), self.rotation.val());
        Paths { rows, position, rotation, window: self.window, remainder, kinks: self.kinks.clone() }
    }

    /// Follows the scene through a change of its rows; a copy of a moving Gaussian moves like it. The second answer is
    /// the change of the motion's own rows, for the moments of [`ROW_PARAMETERS`](Self::ROW_PARAMETERS).
    pub fn follow(mut self, scene: &RowMap) -> (Self, RowMap) {
        let mut index_of = vec![None; scene.from.iter().map(|row| *row as usize + 1).max().unwrap_or(0)];
        for (index, row) in self.rows.iter().enumerate() {
            if let Some(slot) = index_of.get_mut(*row as usize) {
                *slot = Some(index as u32);
            }
        }
        let (mut rows, mut own) = (Vec::new(), RowMap::default());
        for (row, (from, reset)) in scene.from.iter().zip(&scene.reset).enumerate() {
            if let Some(index) = index_of[*from as usize] {
                rows.push(row as u32);
                own.from.push(index);
                own.reset.push(*reset);
            }
        }
        self.rows = rows;
        (self.gather(&own), own)
    }

    /// Keeps the moving Gaussians `kept` (indices into [`rows`](Self::rows), ascending) and makes the others static.
    /// The second answer as in [`follow`](Self::follow).
    pub fn retain(mut self, kept: &[u32]) -> (Self, RowMap) {
        self.rows = kept.iter().map(|index| self.rows[*index as usize]).collect();
        let own = RowMap::keep(kept.to_vec());
        (self.gather(&own), own)
    }

    fn gather(self, own: &RowMap) -> Self {
        let orders = |orders: &[u8]| own.from.iter().map(|index| orders[*index as usize]).collect();
        let own_jumps = own.from.iter().map(|index| self.own_jumps[*index as usize]).collect();
        let kinks = self.kinks.map(|kinks| Kinks { jumps: own.apply(kinks.jumps), ..kinks });
        Self {
            orders: orders(&self.orders),
            rotation_orders: orders(&self.rotation_orders),
            body_of: orders(&self.body_of),
            own_jumps,
            position: own.apply(self.position),
            rotation: own.apply(self.rotation),
            kinks,
            ..self
        }
    }

    /// Bodies, and paths that do not follow one, of a lower order get `order`, at most all that there is room for.
    pub fn open(&mut self, order: usize) {
        let order = order.min(self.order()) as u8;
        let of_body = |body: &u8| self.bodies.get(usize::from(*body)).map_or(0, |body| body.frame.order);
        let free = self.orders.iter_mut().zip(&self.body_of).filter(|(own, body)| **own >= of_body(body));
        free.for_each(|(own, _)| *own = order.max(*own));
        self.bodies.iter_mut().for_each(|body| body.frame.order = order.max(body.frame.order));
    }

    /// Rows of bodies get all blocks of their bodies' paths as their own; they still turn as their bodies do.
    pub fn release(&mut self) {
        for row in 0..self.len() {
            let Some(body) = self.bodies.get(usize::from(self.body_of[row])) else { continue };
            self.orders[row] = body.frame.order.max(self.orders[row]);
            self.own_jumps[row] = true;
        }
    }

    /// Bodies turn as their blocks say; reads these back from the device.
    pub fn turn_bodies(&mut self) {
        if self.rotation_order() > 0 {
            self.bodies = std::mem::take(&mut self.bodies).into_iter().map(Body::turned).collect();
        }
    }

    /// The numbers of motion that a scene stores: blocks of rows up to their own orders and those of bodies that have a
    /// row, with centre and scale, and two times a contact.
    pub fn numbers(&self) -> usize {
        let blocks: usize = self.orders.iter().chain(&self.rotation_orders).map(|order| usize::from(*order)).sum();
        let contacts = self.contacts().len();
        let jumps = contacts * self.own_jumps.iter().filter(|own| **own).count();
        let bodies = self.bodies.iter().enumerate().filter(|(index, _)| !self.rows_of(*index).is_empty());
        let of_body = |body: &Body| 4 + 12 * (usize::from(body.frame.order) + contacts) + 3 * self.rotation_order();
        3 * (blocks + jumps) + 2 * contacts + bodies.map(|(_, body)| of_body(body)).sum::<usize>()
    }

    /// Rows that have nothing of their own and move as their body does.
    pub fn followers(&self) -> usize {
        let jumps = !self.contacts().is_empty();
        let follows = |row: &usize| {
            self.body_of[*row] != NO_BODY
                && self.orders[*row] + self.rotation_orders[*row] == 0
                && !(jumps && self.own_jumps[*row])
        };
        (0..self.len()).filter(follows).count()
    }

    /// For each of [`ROW_PARAMETERS`](Self::ROW_PARAMETERS), 1 in the blocks that are a row's own and 0 in the others,
    /// of the parameter's shape, or one row where all have one order; `None` where every Gaussian has all of its own.
    /// Adam's first moment needs the factor too: it would push the blocks on.
    pub fn order_masks(&self) -> [(&'static str, Option<Tensor<2>>); 3] {
        let mask = |parameter: &Param<Tensor<2>>, orders: &[u8]| {
            let columns = parameter.dims()[1];
            if columns == 0 || orders.iter().all(|order| usize::from(*order) >= columns / 3) {
                return None;
            }
            let are_equal = orders.iter().all(|order| *order == orders[0]);
            let orders = if are_equal { &orders[..1] } else { orders };
            Some(block_mask(orders, parameter))
        };
        let jumps = self.kinks.as_ref().and_then(|kinks| {
            let orders: Vec<u8> =
                self.own_jumps.iter().map(|own| if *own { kinks.contacts.len() as u8 } else { 0 }).collect();
            mask(&kinks.jumps, &orders)
        });
        let [position, rotation, kinks] = Self::ROW_PARAMETERS;
        [
            (position, mask(&self.position, &self.orders)),
            (rotation, mask(&self.rotation, &self.rotation_orders)),
            (kinks, jumps),
        ]
    }

    /// For each body, the [basis](BodyFrame::basis) of its rows at `positions` `[M, 3]`, zero at rows of others,
    /// `[M, 4]`.
    pub fn bases(&self, positions: &Tensor<2>) -> Vec<Tensor<2>> {
        let basis = |(body, member): (&Body, _)| of_members(body.frame.basis(positions), member);
        self.bodies.iter().zip(self.members(positions)).map(basis).collect()
    }

    /// The rows of a body, by their places in [`rows`](Self::rows).
    pub fn rows_of(&self, body: usize) -> Vec<usize> {
        (0..self.len()).filter(|row| usize::from(self.body_of[*row]) == body).collect()
    }

    /// For each body, 1 at its rows, `[M, 1]`; `None` where all rows are its own.
    fn members(&self, like: &Tensor<2>) -> Vec<Option<Tensor<2>>> {
        let member = |index: usize| {
            let is_own = |body: &u8| usize::from(*body) == index;
            let of_row = |body: &u8| f32::from(u8::from(is_own(body)));
            let values = || TensorData::new(self.body_of.iter().map(of_row).collect::<Vec<f32>>(), [self.len(), 1]);
            (!self.body_of.iter().all(is_own)).then(|| Tensor::from_data(values(), (&like.device(), like.dtype())))
        };
        (0..self.bodies.len()).map(member).collect()
    }

    /// Blocks above each Gaussian's order are those of its body, or zero where it has none; `means` `[N, 3]` are the
    /// centres at `t0`.
    pub fn hold_orders(self, means: &Tensor<2>) -> Self {
        let [(_, position), (_, rotation), (_, jumps)] = self.order_masks();
        if position.is_none() && rotation.is_none() && jumps.is_none() {
            return self;
        }
        // Most steps ask for turns alone.
        let carried = (position.is_some() || jumps.is_some()).then(|| {
            let bases = self.bases(&take_rows(means.clone(), &self.row_tensor()));
            self.bodies.iter().zip(bases).map(|(body, basis)| body.carried(basis)).reduce(|a, b| a + b)
        });
        let carried = carried.flatten();
        let turned = rotation.is_some().then(|| {
            let turn = |(body, member): (&Body, _)| of_members(body.turn.val(), member);
            self.bodies.iter().zip(self.members(means)).map(turn).reduce(|a, b| a + b)
        });
        let turned = turned.flatten();
        let columns = 3 * self.order();
        let part = |from: usize, to: usize| carried.clone().map(|all| all.slice([0..self.len(), from..to]));
        let held = |parameter: Param<Tensor<2>>, mask: Option<Tensor<2>>, body: Option<Tensor<2>>| match (mask, body) {
            (Some(mask), Some(body)) => parameter.map(|own| (own - body.clone()) * mask + body),
            (Some(mask), None) => parameter.map(|own| own * mask),
            (None, _) => parameter,
        };
        let of_paths = position.as_ref().and_then(|_| part(0, columns));
        let kinks = self.kinks.clone().map(|kinks| {
            let of_jumps = jumps.as_ref().and_then(|_| part(columns, columns + 3 * kinks.contacts.len()));
            Kinks { jumps: held(kinks.jumps, jumps, of_jumps), ..kinks }
        });
        let (paths, turns) = (self.position.clone(), self.rotation.clone());
        Self { position: held(paths, position, of_paths), rotation: held(turns, rotation, turned), kinks, ..self }
    }
}

/// `values` at the rows of a body, and zero at others; `member` as [`TaylorMotion::members`] says.
fn of_members(values: Tensor<2>, member: Option<Tensor<2>>) -> Tensor<2> {
    match member {
        Some(member) => values * member,
        None => values,
    }
}

/// A row for each of `orders`: 1 in the blocks of three up to it and 0 above, with the columns of `parameter`.
fn block_mask(orders: &[u8], parameter: &Param<Tensor<2>>) -> Tensor<2> {
    let columns = parameter.dims()[1];
    let one = |order: &u8| {
        let order = usize::from(*order);
        (0..columns).map(move |column| f32::from(u8::from(column / 3 < order)))
    };
    let values: Vec<f32> = orders.iter().flat_map(one).collect();
    let options = (&parameter.device(), parameter.dtype());
    Tensor::from_data(TensorData::new(values, [orders.len(), columns]), options)
}

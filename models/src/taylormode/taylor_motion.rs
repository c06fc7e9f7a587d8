//! The learned part of Eq. 2, as a Burn module: coefficients of position and rotation, kinks, and the remainder's
//! network.
//!
//! [`TaylorMotion`] holds it, [`MotionFrame`] everything beside it (which rows move, of which order, in which window of
//! time), and [`Paths`] are both, ready to be asked at any time.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::ops::rows::take_rows;
use gs_burn::{Gaussians, RowMap};
use serde::{Deserialize, Serialize};

use super::kinks::{Contact, Kinks};
use super::paths::{Paths, taylor_coefficients};
use super::remainder::{RemainderFrame, RemainderNetwork};
use super::window::{TimeWindow, described_powers};
use crate::DynamicScene;
use crate::basis::MotionBasis;

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
    /// `[M]`, the highest order that each position still has, at most `K`.
    pub orders: Vec<u8>,
    /// `[M]`, the highest order that each rotation still has, at most `Kr`.
    pub rotation_orders: Vec<u8>,
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
            rows,
            contacts: Vec::new(),
            remainder: None,
        }
    }

    /// A zero motion: all coefficients and jumps are zero, and so is the remainder, whose network is drawn from `seed`.
    /// A record or a checkpoint's tensors fill it.
    ///
    /// # Panics
    /// When there is not one order a row.
    pub fn init(&self, seed: u64, device: &Device) -> TaylorMotion {
        let count = self.rows.len();
        assert_eq!([self.orders.len(), self.rotation_orders.len()], [count; 2], "one order a moving row");
        let zeros = |blocks: usize| Tensor::zeros([count, 3 * blocks], device);
        let kinks = || Kinks::new(self.contacts.clone(), zeros(self.contacts.len()));
        TaylorMotion {
            position: Param::from_tensor(zeros(self.order)),
            rotation: Param::from_tensor(zeros(self.rotation_order)),
            kinks: (!self.contacts.is_empty()).then(kinks),
            remainder: self.remainder.map(|frame| frame.init(seed, device)),
            window: self.window,
            recording: self.recording,
            rows: self.rows.clone(),
            orders: self.orders.clone(),
            rotation_orders: self.rotation_orders.clone(),
        }
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
        let kinks = self.kinks.map(|kinks| Kinks { jumps: own.apply(kinks.jumps), ..kinks });
        Self {
            orders: orders(&self.orders),
            rotation_orders: orders(&self.rotation_orders),
            position: own.apply(self.position),
            rotation: own.apply(self.rotation),
            kinks,
            ..self
        }
    }

    /// Paths of a lower order get `order`, at most all that there is room for.
    pub fn open(&mut self, order: usize) {
        let order = order.min(self.order()) as u8;
        self.orders.iter_mut().for_each(|own| *own = order.max(*own));
    }

    /// `[1, 3 K]`, 1 in the blocks of the position that some path has and 0 above; `None` where one has all.
    pub fn learned_blocks(&self) -> Option<Tensor<2>> {
        let highest = self.orders.iter().max().copied().unwrap_or(0);
        (usize::from(highest) < self.order()).then(|| block_mask(&[highest], &self.position))
    }

    /// For each of `position` and `rotation`, 1 in the blocks up to each Gaussian's order and 0 above, of the
    /// parameter's shape, or one row where all have one order; `None` where every Gaussian has all orders. Adam's first
    /// moment needs the factor too: it would push the blocks on.
    pub fn order_masks(&self) -> [(&'static str, Option<Tensor<2>>); 2] {
        let mask = |parameter: &Param<Tensor<2>>, orders: &[u8]| {
            let columns = parameter.dims()[1];
            if columns == 0 || orders.iter().all(|order| usize::from(*order) >= columns / 3) {
                return None;
            }
            let are_equal = orders.iter().all(|order| *order == orders[0]);
            let orders = if are_equal { &orders[..1] } else { orders };
            Some(block_mask(orders, parameter))
        };
        [("position", mask(&self.position, &self.orders)), ("rotation", mask(&self.rotation, &self.rotation_orders))]
    }

    /// Blocks above each Gaussian's order are zero.
    pub fn hold_orders(self) -> Self {
        let [(_, position), (_, rotation)] = self.order_masks();
        let held = |parameter: Param<Tensor<2>>, mask: Option<Tensor<2>>| match mask {
            Some(mask) => parameter.map(|tensor| tensor * mask),
            None => parameter,
        };
        Self { position: held(self.position, position), rotation: held(self.rotation, rotation), ..self }
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

/// A scene some of whose Gaussians move.
#[derive(Module, Debug)]
pub struct TaylorScene {
    /// All Gaussians, as they are at `t0`.
    pub gaussians: Gaussians,
    /// How some of them move.
    pub motion: TaylorMotion,
}

impl TaylorScene {
    /// The paths of the moving Gaussians, for many questions.
    pub fn paths(&self) -> Paths {
        self.motion.paths(&self.gaussians.means.val())
    }
}

impl DynamicScene for TaylorScene {
    fn at(&self, t: f64) -> Gaussians {
        self.paths().moved(&self.gaussians, t)
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        self.paths().velocities(self.gaussians.len(), t)
    }

    fn span(&self) -> Option<[f64; 2]> {
        (!self.motion.is_empty()).then_some(self.motion.recording)
    }

    fn at_times(&self, times: &[f64]) -> Vec<Gaussians> {
        let paths = self.paths();
        times.iter().map(|t| paths.moved(&self.gaussians, *t)).collect()
    }

    fn basis(&self) -> Option<MotionBasis> {
        if self.motion.is_empty() {
            return None;
        }
        let paths = self.paths();
        let mut functions = described_powers(paths.order());
        let mut position = vec![taylor_coefficients(&paths.position.inner())];
        if let Some(remainder) = paths.remainder {
            functions.extend(remainder.described());
            position.push(remainder.weights.inner());
        }
        if let Some(kinks) = paths.kinks {
            functions.extend(kinks.contacts.iter().map(Contact::described));
            position.push(kinks.jumps.val().inner());
        }
        // A tensor without columns cannot be joined.
        position.retain(|part| part.dims()[1] > 0);
        let position = match position.len() {
            0 => Tensor::zeros([self.motion.len(), 0], &self.gaussians.device()),
            _ => Tensor::cat(position, 1),
        };
        Some(MotionBasis {
            base: self.gaussians.clone(),
            rows: self.motion.rows.clone(),
            t0: self.motion.window.t0,
            half: self.motion.window.half,
            functions,
            position,
            turns: described_powers(self.motion.rotation_order()),
            rotation: taylor_coefficients(&paths.rotation.inner()),
        })
    }
}

//! What moves, and everything that is learned about it beside the Gaussians themselves.

use burn::tensor::{Device, Int, Tensor};
use gs_burn::Gaussians;
use gs_burn::ops::adam::AdamConfig;
use gs_models::network::Mlp;
use gs_models::taylormode::{
    Contact, Exposure, Kinks, Remainder, RemainderNetwork, TaylorMotion, TaylorScene, TimeWindow,
};
use gs_models::{Motion, Static};

use crate::parameters::{from_host, indices};
use crate::taylormode::collective::{Collective, step_together};
use crate::taylormode::learned::{Learned, gradient_of};

/// The networks of the method, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Network {
    /// Eq. 5: the remainder on the velocity map.
    Peano,
    /// Eq. 11: the weights of the samples.
    Weights,
    /// The 3D remainder of Eq. 2.
    Remainder,
    /// Direct velocity, for the row "w/o Taylor Expansion" of Table 2.
    Velocity,
}

impl Network {
    /// The name in checkpoints.
    pub fn name(self) -> &'static str {
        match self {
            Self::Peano => "peano",
            Self::Weights => "weights",
            Self::Remainder => "remainder",
            Self::Velocity => "velocity",
        }
    }

    /// All networks.
    pub const ALL: [Self; 4] = [Self::Peano, Self::Weights, Self::Remainder, Self::Velocity];
}

/// The tensors of one network, weights first, then biases.
#[derive(Debug, Clone)]
pub struct LearnedNetwork {
    /// Which network.
    pub kind: Network,
    /// Its tensors in the order of `Mlp::tensors`.
    pub tensors: Vec<Learned>,
}

impl LearnedNetwork {
    /// A network with zero moments.
    pub fn new(kind: Network, mlp: &Mlp) -> Self {
        Self { kind, tensors: mlp.tensors().into_iter().map(Learned::new).collect() }
    }
}

/// Where the 3D remainder's network looks from, and what it completes; see [`RemainderNetwork`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RemainderFrame {
    /// Centre of what moves, scene units.
    pub centre: [f64; 3],
    /// Its size, scene units.
    pub scale: f64,
    /// Order of the polynomial it completes.
    pub order: usize,
}

/// Everything learned about motion and exposure.
#[derive(Debug, Clone)]
pub struct MotionState {
    /// The time the paths are expanded at, and half the length of the recording.
    pub window: TimeWindow,
    /// Rows of the moving Gaussians in the table, ascending.
    pub rows: Vec<u32>,
    /// Coefficients of the paths, `[M, 3 K]`: displacement at the window's edge by order, scene units.
    pub position: Learned,
    /// Coefficients of the rotations, `[M, 3 Kr]`, radians at the window's edge.
    pub rotation: Learned,
    /// Changes of velocity at each of `contacts`, `[M, 3 J]`, scene units per half window.
    pub kinks: Learned,
    /// When something is hit: `J` contacts for the whole scene.
    pub contacts: Vec<Contact>,
    /// Highest order each path still has, `[M]`.
    pub orders: Vec<u8>,
    /// Highest order each rotation still has, `[M]`.
    pub rotation_orders: Vec<u8>,
    /// Logarithm of the exposure, `[1, 1]`.
    pub log_exposure: Learned,
    /// The common motion of each body, where one is learned.
    pub bodies: Vec<Collective>,
    /// The first and the last time of the recording.
    pub recording: [f64; 2],
    /// Whether the exposure began as the data set says it is.
    pub exposure_said: bool,
    /// The networks in use.
    pub networks: Vec<LearnedNetwork>,
    /// For the 3D remainder, where it is in use.
    pub remainder: Option<RemainderFrame>,
    /// Updates so far.
    pub updates: u64,
}

/// The state lent to one step's graph.
#[derive(Debug, Clone)]
pub struct Lent {
    /// The motion, its coefficients tracked.
    pub motion: TaylorMotion,
    /// The exposure, tracked.
    pub exposure: Exposure,
    networks: Vec<(Network, Vec<Tensor<2>>)>,
}

impl Lent {
    /// A network, its tensors tracked; `None` when the recipe has it not.
    pub fn network(&self, kind: Network) -> Option<Mlp> {
        let (_, tensors) = self.networks.iter().find(|(found, _)| *found == kind)?;
        Some(Mlp::from_tensors(tensors.clone()))
    }
}

/// Gradients of what [`Lent`] lends, without autodiff.
#[derive(Debug)]
pub struct MotionGradients {
    position: Tensor<2>,
    rotation: Tensor<2>,
    kinks: Tensor<2>,
    log_exposure: Tensor<2>,
    networks: Vec<Vec<Tensor<2>>>,
}

/// Rates of one step.
#[derive(Debug, Clone, Copy)]
pub struct MotionRates {
    /// Of the paths' coefficients, scene units.
    pub position: f64,
    /// Of the rotations' coefficients, radians.
    pub rotation: f64,
    /// Of the exposure's logarithm.
    pub exposure: f64,
    /// Of the networks.
    pub network: f64,
    /// Of the 3D remainder's network.
    pub remainder: f64,
}

/// `gaussians` as something that has Gaussians at any time: moving as `motion` says, or standing still without one. Outside
/// autodiff.
pub fn model(gaussians: Gaussians, motion: Option<&MotionState>) -> Box<dyn Motion> {
    match motion {
        None => Box::new(Static::new(gaussians)),
        Some(state) => Box::new(state.scene(gaussians)),
    }
}

impl MotionState {
    /// `gaussians` with the motion, outside autodiff.
    pub fn scene(&self, gaussians: Gaussians) -> TaylorScene {
        TaylorScene { motion: self.motion(&gaussians), gaussians }
    }

    /// The motion of `gaussians`, outside autodiff.
    pub fn motion(&self, gaussians: &Gaussians) -> TaylorMotion {
        let tensors = |network: &LearnedNetwork| network.tensors.iter().map(|tensor| tensor.value.clone()).collect();
        let of = |learned: &Learned| learned.value.clone();
        self.build([&self.position, &self.rotation, &self.kinks].map(of), gaussians, tensors)
    }

    fn build(
        &self,
        [position, rotation, jumps]: [Tensor<2>; 3],
        gaussians: &Gaussians,
        tensors: impl Fn(&LearnedNetwork) -> Vec<Tensor<2>>,
    ) -> TaylorMotion {
        let rows = self.row_tensor();
        let network = self.networks.iter().find(|network| network.kind == Network::Remainder);
        let remainder = network.zip(self.remainder).filter(|_| !self.rows.is_empty()).map(|(network, frame)| {
            let shell = RemainderNetwork::new(frame.order, frame.centre, frame.scale, 0, &rows.device());
            let network = RemainderNetwork { mlp: Mlp::from_tensors(tensors(network)), ..shell };
            network.evaluate(gaussians.means.val().select(0, rows.clone())) as Remainder
        });
        let kinks = (!self.contacts.is_empty()).then(|| Kinks { contacts: self.contacts.clone(), jumps });
        TaylorMotion { rows, position, rotation, window: self.window, remainder, kinks }
    }

    /// A network, outside autodiff; `None` when the recipe has it not.
    pub fn network(&self, kind: Network) -> Option<Mlp> {
        let found = self.networks.iter().find(|network| network.kind == kind)?;
        Some(Mlp::from_tensors(found.tensors.iter().map(|tensor| tensor.value.clone()).collect()))
    }

    /// Highest order that paths have room for.
    pub fn order(&self) -> usize {
        self.position.value.dims()[1] / 3
    }

    /// The moving rows as a tensor `[M]`.
    pub fn row_tensor(&self) -> Tensor<1, Int> {
        indices(&self.rows, &self.position.value.device())
    }

    /// The exposure, in the data set's unit of time.
    pub fn exposure(&self) -> f64 {
        f64::from(self.log_exposure.value.clone().into_scalar::<f32>()).exp()
    }

    /// Everything as leaves of a new graph, for `gaussians` lent to it too.
    pub fn lend(&self, gaussians: &Gaussians) -> Lent {
        let networks: Vec<(Network, Vec<Tensor<2>>)> = self
            .networks
            .iter()
            .map(|network| (network.kind, network.tensors.iter().map(Learned::tracked).collect()))
            .collect();
        let tracked = |network: &LearnedNetwork| {
            let found = networks.iter().find(|(kind, _)| *kind == network.kind);
            found.map(|(_, tensors)| tensors.clone()).unwrap_or_default()
        };
        Lent {
            motion: self.build([&self.position, &self.rotation, &self.kinks].map(Learned::tracked), gaussians, tracked),
            exposure: Exposure { log_tau: self.log_exposure.tracked() },
            networks,
        }
    }

    /// Takes the gradients of `lent` out of a finished backward pass.
    pub fn take(lent: &Lent, gradients: &mut burn::tensor::Gradients) -> MotionGradients {
        MotionGradients {
            position: gradient_of(&lent.motion.position, gradients),
            rotation: gradient_of(&lent.motion.rotation, gradients),
            kinks: match &lent.motion.kinks {
                Some(kinks) => gradient_of(&kinks.jumps, gradients),
                None => Tensor::zeros([lent.motion.len(), 0], &lent.motion.rows.device()),
            },
            log_exposure: gradient_of(&lent.exposure.log_tau, gradients),
            networks: lent
                .networks
                .iter()
                .map(|(_, tensors)| tensors.iter().map(|tensor| gradient_of(tensor, gradients)).collect())
                .collect(),
        }
    }

    /// One Adam update of everything (paper: separate optimisers with moments 0.9 and 0.999).
    /// `means` `[N, 3]`.
    pub fn step(&mut self, gradients: MotionGradients, rates: &MotionRates, means: &Tensor<2>) {
        self.updates += 1;
        let adam = |lr| AdamConfig { lr, beta1: BETA1, beta2: BETA2, eps: EPS, step: self.updates };
        if !self.rows.is_empty() {
            if self.position.value.dims()[1] > 0 {
                let places = means.clone().select(0, self.row_tensor());
                let rate = adam(rates.position);
                let together = step_together(&mut self.bodies, places, gradients.position.clone(), &rate);
                self.position.step(gradients.position, &rate);
                if let Some(change) = together {
                    self.position.value = self.position.value.clone() + change;
                }
            }
            if self.rotation.value.dims()[1] > 0 {
                self.rotation.step(gradients.rotation, &adam(rates.rotation));
            }
            if !self.contacts.is_empty() {
                self.kinks.step(gradients.kinks, &adam(rates.position));
            }
        }
        // Held back, it has a rate of 0 and keeps its moments: begun anew later, Adam's first steps would be too long.
        self.log_exposure.step(gradients.log_exposure, &adam(rates.exposure));
        for (learned, gradients) in self.networks.iter_mut().zip(gradients.networks) {
            let network = adam(if learned.kind == Network::Remainder { rates.remainder } else { rates.network });
            for (tensor, gradient) in learned.tensors.iter_mut().zip(gradients) {
                tensor.step(gradient, &network);
            }
        }
        self.hold_orders();
    }

    /// Keeps the blocks above each Gaussian's order at zero: Adam's first moment would push them on.
    pub fn hold_orders(&mut self) {
        let device = self.position.value.device();
        for (learned, orders) in [(&mut self.position, &self.orders), (&mut self.rotation, &self.rotation_orders)] {
            let columns = learned.value.dims()[1];
            let full = columns / 3;
            if columns == 0 || orders.iter().all(|order| usize::from(*order) >= full) {
                continue;
            }
            let mask =
                orders.iter().flat_map(|order| (0..columns).map(move |c| (c / 3 < usize::from(*order)) as u8 as f32));
            let mask = from_host(mask.collect(), columns, &device);
            learned.value = learned.value.clone() * mask.clone();
            learned.first = learned.first.clone() * mask;
        }
    }

    /// Follows the table through a change: new row `i` comes from old row `source[i]`, and begins anew where `fresh[i]`. A
    /// copy of a moving Gaussian moves like it.
    pub fn follow(&mut self, source: &[u32], fresh: &[bool]) {
        let mut place = vec![None; source.iter().map(|row| *row as usize + 1).max().unwrap_or(0)];
        for (index, row) in self.rows.iter().enumerate() {
            if let Some(slot) = place.get_mut(*row as usize) {
                *slot = Some(index as u32);
            }
        }
        let moving: Vec<(u32, u32, bool)> = source
            .iter()
            .zip(fresh)
            .enumerate()
            .filter_map(|(row, (source, fresh))| place[*source as usize].map(|from| (row as u32, from, *fresh)))
            .collect();
        self.rows = moving.iter().map(|(row, ..)| *row).collect();
        self.gather(&moving.iter().map(|(_, from, _)| *from).collect::<Vec<_>>(), |i| !moving[i].2);
    }

    /// Keeps the moving Gaussians `kept` (indices into `rows`, ascending); the others become static.
    pub fn retain(&mut self, kept: &[u32]) {
        self.rows = kept.iter().map(|index| self.rows[*index as usize]).collect();
        self.gather(kept, |_| true);
    }

    fn gather(&mut self, from: &[u32], keeps_moments: impl Fn(usize) -> bool) {
        let device = self.position.value.device();
        let keep: Vec<f32> = (0..from.len()).map(|i| f32::from(u8::from(keeps_moments(i)))).collect();
        let (rows, keep) = (indices(from, &device), from_host(keep, 1, &device));
        for learned in [&mut self.position, &mut self.rotation, &mut self.kinks] {
            if learned.value.dims()[1] > 0 {
                learned.select(&rows, &keep);
            } else {
                *learned = Learned::new(Tensor::zeros([from.len(), 0], &device));
            }
        }
        self.orders = from.iter().map(|index| self.orders[*index as usize]).collect();
        self.rotation_orders = from.iter().map(|index| self.rotation_orders[*index as usize]).collect();
    }
}

impl MotionGradients {
    /// One number that is finite only if every gradient is, `[1]`.
    pub fn finiteness(&self) -> Tensor<1> {
        let all = [&self.position, &self.rotation, &self.kinks, &self.log_exposure]
            .into_iter()
            .chain(self.networks.iter().flatten());
        let sums = all.filter(|tensor| tensor.dims().iter().product::<usize>() > 0).map(|tensor| tensor.clone().sum());
        sums.reduce(|a, b| a + b).expect("the exposure has a gradient")
    }
}

/// A state in which `rows` move along nothing yet.
pub fn still(rows: Vec<u32>, window: TimeWindow, orders: [usize; 2], exposure: f64, device: &Device) -> MotionState {
    let count = rows.len();
    let zeros = |order: usize| Learned::new(Tensor::zeros([count, 3 * order], device));
    MotionState {
        window,
        rows,
        position: zeros(orders[0]),
        rotation: zeros(orders[1]),
        kinks: zeros(0),
        contacts: Vec::new(),
        orders: vec![orders[0] as u8; count],
        rotation_orders: vec![orders[1] as u8; count],
        log_exposure: Learned::new(from_host(vec![exposure.ln() as f32], 1, device)),
        bodies: Vec::new(),
        recording: [window.t0 - window.half, window.t0 + window.half],
        exposure_said: false,
        networks: Vec::new(),
        remainder: None,
        updates: 0,
    }
}

/// Moments of the paper's optimisers (section 4.1).
const BETA1: f64 = 0.9;
const BETA2: f64 = 0.999;

/// As for the Gaussians: gradients of a mean over pixels are tiny.
const EPS: f64 = 1e-15;

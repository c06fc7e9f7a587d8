//! The motion state in a checkpoint: which tensors, under which names, and what the metadata says beside them.

use burn::tensor::Tensor;
use gs_models::taylormode::{Contact, TimeWindow};
use serde::{Deserialize, Serialize};

use crate::parameters::{from_host, to_host};
use crate::taylormode::collective::Collective;
use crate::taylormode::learned::Learned;
use crate::taylormode::state::{LearnedNetwork, MotionState, Network, RemainderFrame};

/// Most Gaussians of a moving scene: row numbers are stored as f32, which counts exactly up to here.
pub const ROWS_MAX: usize = 1 << 24;

/// What the metadata of a checkpoint says about motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SavedMotion {
    /// As bits, because JSON numbers may lose the last one.
    t0_bits: u64,
    half_bits: u64,
    updates: u64,
    exposure_said: bool,
    /// The first and the last time of the recording, as bits.
    recording: [u64; 2],
    /// Centre and size of the frame of each body's common motion, as bits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    bodies: Vec<[u64; 4]>,
    /// Tensors of each network.
    networks: Vec<(String, usize)>,
    /// Centre and size (as bits) and order of the 3D remainder's frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    remainder: Option<([u64; 4], usize)>,
    /// Near and far end of each contact, as bits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    contacts: Vec<[u64; 2]>,
}

impl SavedMotion {
    /// The metadata of a state.
    pub fn of(state: &MotionState) -> Self {
        Self {
            t0_bits: state.window.t0.to_bits(),
            half_bits: state.window.half.to_bits(),
            updates: state.updates,
            exposure_said: state.exposure_said,
            recording: state.recording.map(f64::to_bits),
            bodies: state
                .bodies
                .iter()
                .map(|Collective { centre: [x, y, z], scale, .. }| [*x, *y, *z, *scale].map(f64::to_bits))
                .collect(),
            networks: state
                .networks
                .iter()
                .map(|network| (network.kind.name().into(), network.tensors.len()))
                .collect(),
            remainder: state.remainder.map(|frame| {
                let [x, y, z] = frame.centre;
                ([x, y, z, frame.scale].map(f64::to_bits), frame.order)
            }),
            contacts: state.contacts.iter().map(|contact| [contact.near, contact.far].map(f64::to_bits)).collect(),
        }
    }

    /// The state, its tensors read by name with `read`.
    ///
    /// # Errors
    /// As `read`; and a sentence when shapes do not fit.
    pub fn restore<E>(
        &self,
        mut read: impl FnMut(&str) -> Result<Tensor<2>, E>,
        damaged: impl Fn(String) -> E,
        gaussians: usize,
    ) -> Result<MotionState, E> {
        let mut learned = |name: &str| -> Result<Learned, E> {
            let [value, first, second] =
                [read(name)?, read(&format!("first.{name}"))?, read(&format!("second.{name}"))?];
            if value.dims() != first.dims() || value.dims() != second.dims() {
                return Err(damaged(format!("{name} and its moments have different shapes")));
            }
            Ok(Learned { value, first, second })
        };
        let (position, rotation) = (learned("motion.position")?, learned("motion.rotation")?);
        let log_exposure = learned("motion.log_exposure")?;
        let kinks = match self.contacts.len() {
            0 => Learned::new(Tensor::zeros([position.value.dims()[0], 0], &position.value.device())),
            _ => learned("motion.kinks")?,
        };
        if kinks.value.dims() != [position.value.dims()[0], 3 * self.contacts.len()] {
            return Err(damaged("the kinks do not fit the contacts".into()));
        }
        let mut bodies = Vec::new();
        for (index, bits) in self.bodies.iter().enumerate() {
            let [x, y, z, scale] = bits.map(f64::from_bits);
            bodies.push(Collective { sum: learned(&body_name(index))?, centre: [x, y, z], scale });
        }
        if bodies.iter().any(|body| body.sum.value.dims() != [4, position.value.dims()[1]]) {
            return Err(damaged("the common motion does not fit the paths".into()));
        }
        let mut networks = Vec::new();
        for (name, count) in &self.networks {
            let kind = Network::ALL.into_iter().find(|kind| kind.name() == name);
            let kind = kind.ok_or_else(|| damaged(format!("it holds a network called {name:?}")))?;
            let tensors = (0..*count).map(|i| learned(&format!("network.{name}.{i}"))).collect::<Result<_, E>>()?;
            networks.push(LearnedNetwork { kind, tensors });
        }
        let table = read("motion.rows")?;
        let [count, columns] = table.dims();
        let values = to_host(table);
        let fits = columns == 3 && position.value.dims()[0] == count && rotation.value.dims()[0] == count;
        let column = |c: usize| values.iter().skip(c).step_by(3).map(|x| *x as u32).collect::<Vec<u32>>();
        if !fits || column(0).iter().any(|row| *row as usize >= gaussians) || log_exposure.value.dims() != [1, 1] {
            return Err(damaged("the motion does not fit the Gaussians".into()));
        }
        Ok(MotionState {
            window: TimeWindow { t0: f64::from_bits(self.t0_bits), half: f64::from_bits(self.half_bits) },
            rows: column(0),
            orders: column(1).iter().map(|order| *order as u8).collect(),
            rotation_orders: column(2).iter().map(|order| *order as u8).collect(),
            position,
            rotation,
            kinks,
            contacts: self
                .contacts
                .iter()
                .map(|bits| bits.map(f64::from_bits))
                .map(|[near, far]| Contact { near, far })
                .collect(),
            log_exposure,
            exposure_said: self.exposure_said,
            recording: self.recording.map(f64::from_bits),
            bodies,
            networks,
            remainder: self.remainder.map(|(bits, order)| {
                let [x, y, z, scale] = bits.map(f64::from_bits);
                RemainderFrame { centre: [x, y, z], scale, order }
            }),
            updates: self.updates,
        })
    }
}

fn body_name(index: usize) -> String {
    format!("motion.body.{index}")
}

/// The tensors of a state by name.
pub fn columns(state: &MotionState) -> Vec<(String, Tensor<2>)> {
    let mut columns = Vec::new();
    let mut add = |name: String, learned: &Learned| {
        columns.push((format!("first.{name}"), learned.first.clone()));
        columns.push((format!("second.{name}"), learned.second.clone()));
        columns.push((name, learned.value.clone()));
    };
    add("motion.position".into(), &state.position);
    add("motion.rotation".into(), &state.rotation);
    if !state.contacts.is_empty() {
        add("motion.kinks".into(), &state.kinks);
    }
    for (index, body) in state.bodies.iter().enumerate() {
        add(body_name(index), &body.sum);
    }
    add("motion.log_exposure".into(), &state.log_exposure);
    for network in &state.networks {
        for (i, tensor) in network.tensors.iter().enumerate() {
            add(format!("network.{}.{i}", network.kind.name()), tensor);
        }
    }
    let table = state
        .rows
        .iter()
        .zip(&state.orders)
        .zip(&state.rotation_orders)
        .flat_map(|((row, order), rotation)| [*row as f32, f32::from(*order), f32::from(*rotation)]);
    columns.push(("motion.rows".into(), from_host(table.collect(), 3, &state.position.value.device())));
    columns
}

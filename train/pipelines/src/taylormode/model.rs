//! All learned quantities of motion and blur, as one Burn module.

use burn::module::Module;
use burn::tensor::Device;
use gs_burn::Gaussians;
use gs_models::taylormode::{
    BlurWeights, BlurWeightsConfig, DirectVelocity, DirectVelocityConfig, Exposure, MotionFrame, PeanoMap,
    PeanoMapConfig, TaylorMotion, TaylorScene, TimeWindow,
};
use serde::{Deserialize, Serialize};

use super::common_motion::CommonMotion;

/// The module of the method, beside the Gaussians.
#[derive(Module, Debug)]
pub struct Taylormode {
    /// Paths, rotations, kinks and the 3D remainder (Eq. 2).
    pub motion: TaylorMotion,
    /// The exposure (Eq. 7).
    pub exposure: Exposure,
    /// The remainder on the velocity map (Eq. 5).
    pub peano: Option<PeanoMap>,
    /// The weights of the exposure's samples (Eq. 11).
    pub weights: Option<BlurWeights>,
    /// Velocity by a network alone (Table 2, "w/o Taylor Expansion").
    pub velocity: Option<DirectVelocity>,
    /// The common motion of each object, if it is learned.
    pub objects: Vec<CommonMotion>,
    /// The exposure that the data set states, its unit of time, with which the learned one begins: the median where
    /// cameras differ.
    pub stated_exposure: Option<f64>,
    /// Units of depths (scene units) and speeds (scene units per unit of time) in the networks.
    #[module(skip)]
    pub units: Units,
}

/// Units of the networks' inputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// Unit of depths and positions, scene units.
    pub depth: f64,
    /// Unit of velocities, scene units per unit of time.
    pub velocity: f64,
}

impl Units {
    /// Units of the scene's extent, and of a tenth of it in half the recording.
    pub fn new(extent: f64, half_window: f64) -> Self {
        Self { depth: extent, velocity: 0.1 * extent / half_window }
    }
}

/// The networks that form the blur.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Networks {
    /// Peano remainder, Eq. 5.
    pub peano: bool,
    /// Number of samples that are weighted, Eq. 11; 0: none.
    pub weights: usize,
    /// Direct velocity, Table 2, "w/o Taylor Expansion".
    pub velocity: bool,
}

/// The constants of a [`Taylormode`]; exact to the bit as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    motion: MotionFrame,
    /// As bits.
    stated_exposure: Option<u64>,
    networks: Networks,
    /// Units of depth and velocity, as bits.
    units: [u64; 2],
    /// Centre and scale of each object's common motion, as bits.
    objects: Vec<[u64; 4]>,
}

/// Highest order and most samples that a frame may name: far above a configuration's limits, and small enough to
/// allocate.
const ORDERS_MAX: usize = 64;
const SAMPLES_MAX: usize = 4096;

impl Frame {
    /// Checks that the lists fit each other.
    ///
    /// # Errors
    /// A sentence when they do not.
    pub fn check(&self) -> Result<(), String> {
        let MotionFrame { rows, orders, rotation_orders, .. } = &self.motion;
        if orders.len() != rows.len() || rotation_orders.len() != rows.len() {
            return Err("the lists of moving Gaussians have different lengths".into());
        }
        if self.motion.order.max(self.motion.rotation_order) > ORDERS_MAX || self.networks.weights > SAMPLES_MAX {
            return Err("orders or samples beyond all that can be trained".into());
        }
        Ok(())
    }
}

impl Taylormode {
    /// A module with the motion of `frame`, all zero, an exposure of `exposure` (the data set's unit of time), and
    /// untrained networks.
    pub fn new(
        frame: &MotionFrame,
        exposure: f64,
        (networks, units): (Networks, Units),
        seed: u64,
        device: &Device,
    ) -> Self {
        let Units { depth, velocity } = units;
        let peano = || PeanoMapConfig::new(velocity).with_seed(seed).init(device);
        let weights = || BlurWeightsConfig::new(networks.weights, depth, velocity).with_seed(seed).init(device);
        let direct = || DirectVelocityConfig::new([0.0; 3], depth, velocity).with_seed(seed).init(device);
        Self {
            motion: frame.init(seed, device),
            exposure: Exposure::new(exposure, device),
            peano: networks.peano.then(peano),
            weights: (networks.weights > 0).then(weights),
            velocity: networks.velocity.then(direct),
            objects: Vec::new(),
            stated_exposure: None,
            units,
        }
    }

    /// A module without moving Gaussians, for a scene that is known at one time alone.
    pub fn at_rest(at: &super::Step, device: &Device) -> Self {
        let frame = MotionFrame::new(Vec::new(), 0, 0, TimeWindow { t0: 0.0, half: 1.0 });
        let exposure = at.config.method.blur.exposure;
        let exposure = if exposure > 0.0 { exposure } else { 1.0 };
        Self::new(&frame, exposure, (Networks::default(), Units::new(at.facts.extent, 1.0)), at.config.seed, device)
    }

    /// `gaussians` with the motion.
    pub fn moving_scene(&self, gaussians: Gaussians) -> TaylorScene {
        TaylorScene { gaussians, motion: self.motion.clone() }
    }

    /// The exposure, in the data set's unit of time; reads it back from the device.
    pub fn exposure_on_host(&self) -> f64 {
        self.exposure.tau_on_host()
    }

    /// The exposure of a photo, of which the data set says `stated`, both in its unit of time; reads the learned one
    /// back from the device.
    pub fn exposure_of(&self, stated: Option<f64>) -> f64 {
        self.exposure_on_host() * self.exposure_share(stated)
    }

    /// The share of the learned exposure for which the shutter of a photo was open; `stated` is what the data set says
    /// of that photo, its unit of time. Cameras of one rig may differ.
    pub fn exposure_share(&self, stated: Option<f64>) -> f64 {
        stated.zip(self.stated_exposure).map_or(1.0, |(own, usual)| own / usual)
    }

    /// The constants of the module.
    pub fn frame_data(&self) -> Frame {
        Frame {
            motion: self.motion.frame(),
            stated_exposure: self.stated_exposure.map(f64::to_bits),
            networks: Networks {
                peano: self.peano.is_some(),
                weights: self.weights.as_ref().map_or(0, BlurWeights::samples),
                velocity: self.velocity.is_some(),
            },
            units: [self.units.depth, self.units.velocity].map(f64::to_bits),
            objects: self.objects.iter().map(CommonMotion::frame_bits).collect(),
        }
    }

    /// A module of the structure that `frame` describes.
    pub fn of_frame(frame: &Frame, seed: u64, device: &Device) -> Self {
        let [depth, velocity] = frame.units.map(f64::from_bits);
        let order = frame.motion.order;
        let shell = Self::new(&frame.motion, 1.0, (frame.networks, Units { depth, velocity }), seed, device);
        let objects = frame.objects.iter().map(|bits| CommonMotion::of_bits(*bits, order, device)).collect();
        Self { objects, stated_exposure: frame.stated_exposure.map(f64::from_bits), ..shell }
    }

    /// Checks that the tensors fit each other and `gaussians` rows.
    ///
    /// # Errors
    /// A sentence about the mismatch.
    pub fn check_shapes(&self, gaussians: usize) -> Result<(), String> {
        let motion = &self.motion;
        let rows = motion.rows.len();
        let is_path = |dims: [usize; 2]| dims[0] == rows && dims[1].is_multiple_of(3);
        let lists = motion.orders.len() == rows && motion.rotation_orders.len() == rows;
        let ascending = motion.rows.windows(2).all(|pair| pair[0] < pair[1]);
        if !is_path(motion.position.dims()) || !is_path(motion.rotation.dims()) || !lists || !ascending {
            return Err("the paths do not fit the moving Gaussians".into());
        }
        if motion.rows.last().is_some_and(|row| *row as usize >= gaussians) {
            return Err("the motion does not fit the Gaussians".into());
        }
        if let Some(kinks) = &motion.kinks
            && kinks.jumps.dims() != [rows, 3 * kinks.contacts.len()]
        {
            return Err("the kinks do not fit the contacts".into());
        }
        if self.objects.iter().any(|object| object.sum.dims() != [4, motion.position.dims()[1]]) {
            return Err("the common motion does not fit the paths".into());
        }
        if self.exposure.log_tau.dims() != [1] {
            return Err("the exposure is not one number".into());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera whose shutter is open for half as long as the usual one's; a photo that says nothing has the usual.
    #[test]
    fn each_photo_has_its_own_shutter() {
        let device = gs_burn::device::select("auto").expect("a device");
        let frame = MotionFrame::new(Vec::new(), 0, 0, TimeWindow { t0: 0.0, half: 1.0 });
        let mut model = Taylormode::new(&frame, 0.2, (Networks::default(), Units::new(1.0, 1.0)), 1, &device);
        assert_eq!(model.exposure_share(Some(0.1)), 1.0, "an exposure that was configured holds for all");
        model.stated_exposure = Some(0.2);
        assert_eq!([Some(0.1), None, Some(0.0)].map(|own| model.exposure_share(own)), [0.5, 1.0, 0.0]);
        let restored = Taylormode::of_frame(&model.frame_data(), 1, &device);
        assert_eq!(restored.stated_exposure, Some(0.2));
    }
}

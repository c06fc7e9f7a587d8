//! All learned quantities of motion and blur, as one Burn module.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use gs_base::median;
use gs_burn::Gaussians;
use gs_datasets::View;
use gs_models::taylormode::{
    BlurWeights, BlurWeightsConfig, DirectVelocity, DirectVelocityConfig, Exposure, MotionFrame, PeanoMap,
    PeanoMapConfig, PhotoShutter, TaylorMotion, TaylorScene, TimeWindow,
};
use serde::{Deserialize, Serialize};

use super::Config;
use super::config::BlurMode;
use super::score::Score;

/// The module of the method, beside the Gaussians.
#[derive(Module, Debug)]
pub struct Taylormode {
    /// Paths, rotations, kinks and the 3D remainder (Eq. 2).
    pub motion: TaylorMotion,
    /// The exposure (Eq. 7), of all photos or of each of `cameras`.
    pub exposure: Exposure,
    /// The remainder on the velocity map (Eq. 5).
    pub peano: Option<PeanoMap>,
    /// The weights of the exposure's samples (Eq. 11).
    pub weights: Option<BlurWeights>,
    /// Velocity by a network alone (Table 2, "w/o Taylor Expansion").
    pub velocity: Option<DirectVelocity>,
    /// The test of motion beside that of bodies, where there are bodies.
    pub score: Option<Score>,
    /// The exposure that the data set states, its unit of time, with which the learned one begins: the median where
    /// cameras differ.
    pub stated_exposure: Option<f64>,
    /// Names of the cameras that have an exposure each; empty: there is one for all.
    #[module(skip)]
    pub cameras: Vec<String>,
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
    cameras: Vec<String>,
    /// Photos of the score test.
    scored: Option<usize>,
    networks: Networks,
    /// Units of depth and velocity, as bits.
    units: [u64; 2],
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
        if !self.motion.is_consistent() {
            return Err("the lists of moving Gaussians do not fit each other".into());
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
            exposure: Exposure::new(exposure, 1, device),
            peano: networks.peano.then(peano),
            weights: (networks.weights > 0).then(weights),
            velocity: networks.velocity.then(direct),
            score: None,
            stated_exposure: None,
            cameras: Vec::new(),
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

    /// The module with an exposure for each of `cameras`, all of the same length.
    pub fn with_cameras(self, cameras: Vec<String>) -> Self {
        let exposure = Exposure::new(self.exposure_on_host(), cameras.len().max(1), &self.exposure.log_tau.device());
        Self { exposure, cameras, ..self }
    }

    /// The exposure, in the data set's unit of time, the median where cameras have their own; reads it back from the
    /// device.
    pub fn exposure_on_host(&self) -> f64 {
        median(self.exposure.on_host()).unwrap_or(f64::NAN)
    }

    /// The exposure of a photo, in the data set's unit of time; reads the learned one back from the device. A camera
    /// that was not trained with has the median of the others.
    pub fn exposure_of(&self, view: &View) -> f64 {
        let PhotoShutter { exposure, share } = self.shutter_of(view.camera_id.as_deref(), view.exposure);
        let is_known = self.cameras.is_empty() || self.place_of(view.camera_id.as_deref()).is_some();
        share * if is_known { self.exposure.on_host()[exposure] } else { self.exposure_on_host() }
    }

    /// The shutter of a photo of `camera`, of which the data set says that it was open for `stated`, its unit of time:
    /// cameras of one rig may differ.
    pub fn shutter_of(&self, camera: Option<&str>, stated: Option<f64>) -> PhotoShutter {
        let share = stated.zip(self.stated_exposure).map_or(1.0, |(own, usual)| own / usual);
        PhotoShutter { exposure: self.place_of(camera).unwrap_or(0), share }
    }

    fn place_of(&self, camera: Option<&str>) -> Option<usize> {
        self.cameras.iter().position(|known| Some(known.as_str()) == camera)
    }

    /// Whether the exposure is ever learned, through a formed blur that is compared.
    pub fn learns_exposure(&self, config: &Config) -> bool {
        let blur = &config.method.blur;
        let is_compared = match blur.mode {
            BlurMode::None => false,
            BlurMode::Warp => config.method.prior.blur > 0.0,
            BlurMode::Integrate => true,
        };
        blur.learn_exposure && is_compared && !(self.stated_exposure.is_some() && blur.exposure_from >= 1.0)
    }

    /// The constants of the module.
    pub fn frame_data(&self) -> Frame {
        Frame {
            motion: self.motion.frame(),
            stated_exposure: self.stated_exposure.map(f64::to_bits),
            cameras: self.cameras.clone(),
            scored: self.score.as_ref().map(|score| score.photos),
            networks: Networks {
                peano: self.peano.is_some(),
                weights: self.weights.as_ref().map_or(0, BlurWeights::samples),
                velocity: self.velocity.is_some(),
            },
            units: [self.units.depth, self.units.velocity].map(f64::to_bits),
        }
    }

    /// A module of the structure that `frame` describes.
    pub fn of_frame(frame: &Frame, seed: u64, device: &Device) -> Self {
        let [depth, velocity] = frame.units.map(f64::from_bits);
        let shell = Self::new(&frame.motion, 1.0, (frame.networks, Units { depth, velocity }), seed, device);
        let shell = shell.with_cameras(frame.cameras.clone());
        let score = frame.scored.map(|photos| Score { photos, ..Score::new(&shell.motion, device) });
        Self { score, stated_exposure: frame.stated_exposure.map(f64::from_bits), ..shell }
    }

    /// Checks that the tensors fit each other and `gaussians` rows.
    ///
    /// # Errors
    /// A sentence about the mismatch.
    pub fn check_shapes(&self, gaussians: usize) -> Result<(), String> {
        let motion = &self.motion;
        let rows = motion.rows.len();
        let is_path = |dims: [usize; 2]| dims[0] == rows && dims[1].is_multiple_of(3);
        let ascending = motion.rows.windows(2).all(|pair| pair[0] < pair[1]);
        if !is_path(motion.position.dims())
            || !is_path(motion.rotation.dims())
            || !motion.frame().is_consistent()
            || !ascending
        {
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
        let (blocks, turns) = (3 * (motion.order() + motion.contacts().len()), motion.rotation.dims()[1]);
        if motion.bodies.iter().any(|body| body.blocks.dims() != [4, blocks] || body.turn.dims() != [1, turns]) {
            return Err("the motion of bodies does not fit the paths".into());
        }
        let scored = |table: &Param<Tensor<2>>| table.dims() == [rows, blocks];
        if self.score.as_ref().is_some_and(|score| !scored(&score.sum) || !scored(&score.square)) {
            return Err("the score test does not fit the paths".into());
        }
        if self.exposure.log_tau.dims() != [self.cameras.len().max(1)] {
            return Err("the exposures do not fit the cameras".into());
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
        let share = |model: &Taylormode, stated| model.shutter_of(None, stated).share;
        assert_eq!(share(&model, Some(0.1)), 1.0, "an exposure that was configured holds for all");
        model.stated_exposure = Some(0.2);
        assert_eq!([Some(0.1), None, Some(0.0)].map(|own| share(&model, own)), [0.5, 1.0, 0.0]);
        let restored = Taylormode::of_frame(&model.frame_data(), 1, &device);
        assert_eq!(restored.stated_exposure, Some(0.2));
    }

    /// Cameras learn exposures of their own; one that was not trained with has their median.
    #[test]
    fn each_camera_has_its_own_exposure() {
        let device = gs_burn::device::select("auto").expect("a device");
        let frame = MotionFrame::new(Vec::new(), 0, 0, TimeWindow { t0: 0.0, half: 1.0 });
        let model = Taylormode::new(&frame, 0.2, (Networks::default(), Units::new(1.0, 1.0)), 1, &device);
        let mut model = model.with_cameras(["a", "b", "c"].map(String::from).to_vec());
        let learned = [0.1_f64, 0.4, 0.3].map(|tau| tau.ln() as f32);
        model.exposure.log_tau = Param::from_tensor(Tensor::from_floats(learned, &device));
        let restored = Taylormode::of_frame(&model.frame_data(), 1, &device);
        assert_eq!(restored.cameras, model.cameras);
        assert!(restored.check_shapes(0).is_ok());
        let of = |name: &str| model.exposure_of(&View { camera_id: Some(name.into()), ..View::blank(1, 1) });
        for (name, expected) in [("a", 0.1), ("b", 0.4), ("unseen", 0.3)] {
            assert!((of(name) - expected).abs() < 1e-6, "{name}: {}", of(name));
        }
    }
}

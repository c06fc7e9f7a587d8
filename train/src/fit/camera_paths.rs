//! Poses that are learned: the path of each photo's camera while its shutter is open, and a correction of its mean pose
//! ([`gs_models::camera_path`]).
//!
//! All twists are in pixels: a turn by one pixel's angle, a shift by a pixel at the subject's distance. The corrections
//! of all photos have a mean of zero, because a scene that moves with all cameras looks the same.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use glam::DQuat;
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::{Camera, NamedGradients};
use gs_datasets::View;
use gs_models::camera_path::{Path, TWIST};
use gs_models::rotation::shortest;
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::facts::{SceneFacts, focal};
use super::parameters::to_host;
use super::random::{Purpose, stream};
use super::schedule::exponential;
use super::shutter::ShutterPath;
use crate::config::{CameraConfig, Config, READOUT_MAX};

/// The last learning rate, in first ones.
const LAST: f64 = 0.1;

/// Half of the way of the first paths, pixels: a path and its reverse form the same photo, so that a camera that stands
/// still has no direction in which it would begin to move.
const FIRST: f64 = 0.5;

/// Length of a path below which the camera stands still from then on, pixels: those of sharp photos shrink from the
/// first one to less than 0.4, and few of shaken ones are below 2.
const STILL: f64 = 0.5;

/// Shortest path by given poses that is used, pixels: below it their errors are larger than the path.
const STANDS: f64 = 0.1;

/// A path by given poses as long as this is of photos that do not follow each other, pixels.
const LEAPS: f64 = 80.0;

/// Share of the steps before which poses stay as they are given: first shapes need no more.
const BEGIN: f64 = 0.05;

/// Rate of the share of a frame in which a row is exposed, at the first step: all photos of a camera speak in most
/// steps, and a run of 1000 steps can reach any share.
const SHARE_LR: f64 = 2e-3;

/// The paths of all photos' cameras.
#[derive(Module, Debug)]
pub struct CameraPaths {
    /// `[photos, 6 K]`: the twists of each photo by degree, pixels.
    pub twists: Param<Tensor<2>>,
    /// `[1]`: the share of a frame in which a row is exposed ([`shutter`](super::shutter)); `None`: all of it.
    pub share: Option<Param<Tensor<1>>>,
    #[module(skip)]
    frame: PathFrame,
}

/// The structure of [`CameraPaths`], which a checkpoint holds beside its tensors.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PathFrame {
    photos: Vec<String>,
    degree: usize,
    /// The bits of the median focal length, pixels: a JSON number may lose the last one.
    focal: u64,
    /// Whether rows are exposed one after another.
    #[serde(default)]
    rolling: bool,
}

impl CameraPaths {
    /// The paths before the first step; `None` if none is learned.
    pub fn begin(views: &[View], facts: &SceneFacts, config: &Config, device: &Device) -> Option<Self> {
        let CameraConfig { motion: degree, refine, readout, learn_readout, .. } = config.camera;
        let focal = focal(views).filter(|_| degree > 0 || refine)?;
        let photos: Vec<String> = views.iter().map(|view| view.name.clone()).collect();
        let mut rng = stream(config.seed, Purpose::Shake, 0);
        let mut rows = vec![0.0_f32; photos.len() * TWIST * (degree + 1)];
        let distance = facts.distance();
        let rolling = degree > 0 && (readout > 0.0 || learn_readout);
        // A readout that is learned and not given begins at one exposure.
        let readout = if rolling && readout == 0.0 { 1.0 } else { readout };
        for (row, view) in rows.chunks_exact_mut(TWIST * (degree + 1)).zip(views).filter(|_| degree > 0) {
            let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
            let first = [FIRST * cos, FIRST * sin, 0.0, 0.0, 0.0, 0.0];
            let half = half_way(view, views, focal, distance).map_or(first, |half| half.map(|x| x * (1.0 + readout)));
            row[TWIST..2 * TWIST].iter_mut().zip(half).for_each(|(value, half)| *value = half as f32);
        }
        let shell = Self::of_frame(&PathFrame { photos, degree, focal: focal.to_bits(), rolling }, device);
        let twists = Tensor::from_data(TensorData::new(rows, shell.twists.dims()), device);
        let share = shell.share.map(|share| share.map(|share| share / (1.0 + readout)));
        Some(Self { twists: Param::from_tensor(twists), share, frame: shell.frame })
    }

    /// Cameras that stand still where they are given, with a shutter that all rows share.
    pub fn of_frame(frame: &PathFrame, device: &Device) -> Self {
        let zeros = Tensor::zeros([frame.photos.len(), TWIST * (frame.degree + 1)], device);
        let share = frame.rolling.then(|| Param::from_tensor(Tensor::ones([1], device)));
        Self { twists: Param::from_tensor(zeros), share, frame: frame.clone() }
    }

    /// Its structure.
    pub fn frame(&self) -> PathFrame {
        self.frame.clone()
    }

    /// The way of `camera`, the given one of a training photo, through its exposure; `None` for a photo that is not
    /// known.
    pub fn path(&self, view: &View, camera: &Camera, facts: &SceneFacts) -> Option<ShutterPath> {
        let row = self.frame.photos.iter().position(|name| *name == view.name)?;
        let own = self.twists.val().narrow(0, row, 1);
        let moves = self.frame.degree > 0;
        let length = moves.then(|| Path::of(&to_host(own.clone().inner())).longest(corner(view)));
        let length = length.filter(|length| *length >= STILL);
        let twists = self.of_mean_zero(own) / self.focal();
        let share = self.share.as_ref().map(|share| (share.val(), self.share_on_host().unwrap_or(1.0)));
        Some(ShutterPath { camera: camera.clone(), twists, distance: facts.distance(), length, share })
    }

    /// The share of a frame in which a row is exposed; `None`: all rows are at once. Reads it back from the device.
    fn share_on_host(&self) -> Option<f64> {
        self.share.as_ref().map(|share| f64::from(to_host(share.val().inner())[0]))
    }

    /// The median focal length, of whose pixels twists are, pixels.
    pub fn focal(&self) -> f64 {
        f64::from_bits(self.frame.focal)
    }

    /// Time from the first row's exposure to the last row's, in exposures; `None`: all rows are at once.
    pub fn readout(&self) -> Option<f64> {
        self.share_on_host().map(|share| 1.0 / share - 1.0)
    }

    /// A photo's twists `[1, 6 K]` less the mean correction of all.
    fn of_mean_zero(&self, own: Tensor<2>) -> Tensor<2> {
        let mean = self.twists.val().narrow(1, 0, TWIST).mean_dim(0);
        let further = own.dims()[1] - TWIST;
        match further {
            0 => own - mean,
            _ => own - Tensor::cat(vec![mean.clone(), Tensor::zeros([1, further], &mean.device())], 1),
        }
    }

    /// One step of its tensors, whose paths begin with `cameras.`.
    pub(super) fn updated(self, gradients: &mut NamedGradients, adam: &mut Adam, config: &Config, step: usize) -> Self {
        let begin = (BEGIN * config.steps as f64) as usize;
        if step <= begin {
            return self;
        }
        // A photo has a gradient once in as many steps as there are photos, and Adam divides by the root of the mean
        // square over all of them.
        let lr = config.camera.lr / (self.frame.photos.len() as f64).sqrt();
        let falling = |lr| AdamRate::new(exponential(lr, LAST * lr, step - begin, config.steps - begin));
        let rate = |path: &str| match path.ends_with(".share") {
            true => config.camera.learn_readout.then(|| falling(SHARE_LR)),
            false => Some(falling(lr)),
        };
        let updated = adam.update_under("cameras", self, gradients, rate);
        let within = |share: Param<Tensor<1>>| share.map(|share| share.clamp(1.0 / (1.0 + READOUT_MAX), 1.0));
        match config.camera.learn_readout {
            true => Self { share: updated.share.map(within), ..updated },
            false => updated,
        }
    }

    /// The paths by the photos' names.
    pub fn listed(&self) -> Vec<(String, Path)> {
        let rows = to_host(self.twists.val());
        let columns = TWIST * (self.frame.degree + 1);
        self.frame.photos.iter().cloned().zip(rows.chunks_exact(columns).map(Path::of)).collect()
    }
}

/// Half of the straight way of a photo's camera during its exposure, a twist in pixels, by the given poses of the
/// photos before and after it; `None` where times or the exposure are not known, or the poses say nothing.
fn half_way(view: &View, views: &[View], focal: f64, distance: f64) -> Option<[f64; TWIST]> {
    let (time, exposure) = (view.time?, view.exposure?);
    let timed = |other: &&View| other.camera_id == view.camera_id && other.time.is_some();
    let gap = |other: &View| other.time.unwrap_or(time) - time;
    let [before, after] = [-1.0, 1.0].map(|side| {
        let others = views.iter().filter(timed).filter(|other| side * gap(other) > 0.0);
        others.min_by(|a, b| gap(a).abs().total_cmp(&gap(b).abs())).unwrap_or(view)
    });
    let motion = after.c2w.inverse() * before.c2w;
    let share = 0.5 * exposure / (gap(after) - gap(before));
    let turn = shortest(DQuat::from_mat4(&motion));
    let shift = motion.w_axis.truncate();
    // The logarithm of a rigid motion, but for terms of the second order of the turn.
    let shift = (shift - 0.5 * turn.cross(shift)) / distance;
    let half = [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z].map(|x| x * share * focal);
    let row: Vec<f32> = [0.0; TWIST].iter().chain(&half).map(|x| *x as f32).collect();
    let length = Path::of(&row).longest(corner(view));
    // A shorter one would be taken to stand still.
    let longer = (2.0 * FIRST / length).max(1.0);
    (STANDS..LEAPS).contains(&length).then(|| half.map(|x| x * longer))
}

/// Direction of a corner of a photo, as if its principal point were in the middle.
fn corner(view: &View) -> [f64; 2] {
    let at = |pixels: usize, focal: f64| 0.5 * pixels as f64 / focal;
    [at(view.width, view.intrinsics.fx), at(view.height, view.intrinsics.fy)]
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};

    use super::*;

    const FOCAL: f64 = 100.0;
    const DISTANCE: f64 = 2.0;

    /// A view at `time` from `x` along the camera's axis to the right.
    fn view(time: f64, x: f64, exposure: Option<f64>) -> View {
        let c2w = DMat4::from_translation(DVec3::new(x, 0.0, 0.0));
        let mut view = View { time: Some(time), exposure, c2w, ..View::blank(60, 40) };
        (view.intrinsics.fx, view.intrinsics.fy) = (FOCAL, FOCAL);
        view
    }

    /// The camera goes 0.1 a unit of time to the right, so that the world goes to the left: by 0.05 in half of an
    /// exposure of one, which is 2.5 pixels.
    #[test]
    fn paths_begin_as_the_given_poses_move() {
        let exposure = Some(1.0);
        let views = [view(0.0, -0.1, exposure), view(1.0, 0.0, exposure), view(2.0, 0.1, exposure)];
        for view in &views {
            let half = half_way(view, &views, FOCAL, DISTANCE).expect("a way");
            let expected = [0.0, 0.0, 0.0, -2.5, 0.0, 0.0];
            assert!(half.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{half:?}");
        }
    }

    /// A path of the given poses that is short is made as long as the others begin, or it would stand still for good.
    #[test]
    fn short_ways_begin_as_long_as_unknown_ones() {
        let views = [view(0.0, 0.0, Some(0.1)), view(1.0, 0.05, Some(0.1))];
        let half = half_way(&views[0], &views, FOCAL, DISTANCE).expect("a way");
        assert!((half[3] + FIRST).abs() < 1e-6, "{half:?}");
    }

    #[test]
    fn what_is_not_known_is_left_out() {
        let still = [view(0.0, 0.0, Some(1.0)), view(1.0, 0.0, Some(1.0))];
        let alone = [view(0.0, 0.0, Some(1.0))];
        let (same, sharp) = ([view(0.0, 0.0, Some(1.0)), view(0.0, 1.0, Some(1.0))], [view(0.0, 0.0, None); 1]);
        for views in [&still[..], &alone, &same, &sharp] {
            assert_eq!(half_way(&views[0], views, FOCAL, DISTANCE), None);
        }
    }

    /// Paths of checkpoints from before rolling shutters.
    #[test]
    fn frames_without_a_shutter_are_read() {
        let frame: PathFrame = serde_json::from_str(r#"{"photos": ["a"], "degree": 1, "focal": 0}"#).expect("a frame");
        assert!(!frame.rolling);
    }
}

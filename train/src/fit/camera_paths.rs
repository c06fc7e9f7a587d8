//! Poses that are learned: the path of each photo's camera while its shutter is open, and a correction of its mean pose
//! ([`gs_models::camera_path`]).
//!
//! All twists are in pixels: a turn by one pixel's angle, a shift by a pixel at the subject's distance. The corrections
//! of all photos have a mean of zero, because a scene that moves with all cameras looks the same.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::{Camera, NamedGradients};
use gs_datasets::View;
use gs_models::camera_path::{Path, TWIST, instants, moved, twists};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::facts::{SceneFacts, focal};
use super::parameters::to_host;
use super::random::{Purpose, stream};
use super::schedule::exponential;
use crate::config::{CameraConfig, Config};

/// The last learning rate, in first ones.
const LAST: f64 = 0.1;

/// Half of the way of the first paths, pixels: a path and its reverse form the same photo, so that a camera that stands
/// still has no direction in which it would begin to move.
const FIRST: f64 = 0.5;

/// Pixels of a path from one instant to the next. Gaussians are at least half a pixel wide in the image
/// ([`RenderConfig::eps2d`](crate::config::RenderConfig)), so that instants that far apart show no steps.
const APART: f64 = 1.5;

/// Fewest and most instants of a photo's exposure: from fewer no path would grow, and each costs a rendering.
const INSTANTS: [usize; 2] = [3, 7];

/// Share of the steps before which poses stay as they are given: first shapes need no more.
const BEGIN: f64 = 0.05;

/// The paths of all photos' cameras.
#[derive(Module, Debug)]
pub struct CameraPaths {
    /// `[photos, 6 K]`: the twists of each photo by degree, pixels.
    pub twists: Param<Tensor<2>>,
    #[module(skip)]
    frame: PathFrame,
}

/// The structure of [`CameraPaths`], which a checkpoint holds beside its tensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PathFrame {
    photos: Vec<String>,
    degree: usize,
    /// The bits of the median focal length, pixels: a JSON number may lose the last one.
    focal: u64,
}

impl CameraPaths {
    /// The paths before the first step; `None` if none is learned.
    pub fn begin(views: &[View], config: &Config, device: &Device) -> Option<Self> {
        let CameraConfig { motion: degree, refine, .. } = config.camera;
        let focal = focal(views).filter(|_| degree > 0 || refine)?;
        let photos: Vec<String> = views.iter().map(|view| view.name.clone()).collect();
        let mut rng = stream(config.seed, Purpose::Shake, 0);
        let mut rows = vec![0.0_f32; photos.len() * TWIST * (degree + 1)];
        for row in rows.chunks_exact_mut(TWIST * (degree + 1)).filter(|_| degree > 0) {
            let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
            (row[TWIST], row[TWIST + 1]) = ((FIRST * cos) as f32, (FIRST * sin) as f32);
        }
        let shell = Self::of_frame(&PathFrame { photos, degree, focal: focal.to_bits() }, device);
        let twists = Tensor::from_data(TensorData::new(rows, shell.twists.dims()), device);
        Some(Self { twists: Param::from_tensor(twists), ..shell })
    }

    /// Cameras that stand still where they are given.
    pub fn of_frame(frame: &PathFrame, device: &Device) -> Self {
        let zeros = Tensor::zeros([frame.photos.len(), TWIST * (frame.degree + 1)], device);
        Self { twists: Param::from_tensor(zeros), frame: frame.clone() }
    }

    /// Its structure.
    pub fn frame(&self) -> PathFrame {
        self.frame.clone()
    }

    /// `camera` of a training photo at the instants of its exposure; as it is for a photo that is not known.
    pub fn cameras(&self, view: &View, camera: &Camera, facts: &SceneFacts) -> Vec<Camera> {
        let Some(row) = self.frame.photos.iter().position(|name| *name == view.name) else {
            return vec![camera.clone()];
        };
        let own = self.twists.val().narrow(0, row, 1);
        let path = Path::of(&to_host(own.clone().inner()));
        let count = match self.frame.degree {
            0 => 1,
            _ => ((path.length() / APART) as usize + 1).clamp(INSTANTS[0], INSTANTS[1]),
        };
        let unit = 1.0 / f64::from_bits(self.frame.focal);
        moved(camera, twists(self.of_mean_zero(own), &instants(count)) * unit, facts.distance())
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

    /// One step of its tensor, whose path begins with `cameras.`.
    pub(super) fn updated(self, gradients: &mut NamedGradients, adam: &mut Adam, config: &Config, step: usize) -> Self {
        let begin = (BEGIN * config.steps as f64) as usize;
        if step <= begin {
            return self;
        }
        // A photo has a gradient once in as many steps as there are photos, and Adam divides by the root of the mean
        // square over all of them.
        let lr = config.camera.lr / (self.frame.photos.len() as f64).sqrt();
        let rate = exponential(lr, LAST * lr, step - begin, config.steps - begin);
        adam.update_under("cameras", self, gradients, |_| Some(AdamRate::new(rate)))
    }

    /// The paths by the photos' names.
    pub fn listed(&self) -> Vec<(String, Path)> {
        let rows = to_host(self.twists.val());
        let columns = TWIST * (self.frame.degree + 1);
        self.frame.photos.iter().cloned().zip(rows.chunks_exact(columns).map(Path::of)).collect()
    }
}

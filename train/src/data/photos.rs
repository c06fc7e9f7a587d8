//! Views as tensors.

use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::{Camera, Intrinsics};
use gs_datasets::{DepthPrior, DepthSpace, View};
use gs_models::taylormode::Pixels;
use rayon::prelude::*;

use crate::taylormode::hints::Found;

/// One view on the device.
#[derive(Debug, Clone)]
pub struct Photo {
    /// Its camera.
    pub camera: Camera,
    /// `[H, W, 3]`, 0 to 1, encoded as the file is.
    pub image: Tensor<3>,
    /// `[H, W, 1]`: 1 = compare, 0 = ignore; `None` when every pixel counts.
    pub mask: Option<Tensor<3>>,
    /// Middle of the exposure, in the data set's unit; 0 where it has none.
    pub time: f64,
    /// How long the shutter was open, in the data set's unit, where it says so.
    pub exposure: Option<f64>,
    /// What is known or guessed about motion in the photo.
    pub hints: Hints,
}

/// What is known or guessed about motion in a photo; each is optional.
#[derive(Debug, Clone, Default)]
pub struct Hints {
    /// `[H, W, 1]`: 1 where something moves.
    pub moving: Option<Tensor<3>>,
    /// The pixels a formed blur is compared at, as a list: those of `moving` (all, where that is not known) that count. `None` when
    /// there are none, or all are.
    pub pixels: Option<Pixels>,
    /// The photo as a deblurring network would have it, `[H, W, 3]`.
    pub sharp: Option<Tensor<3>>,
    /// `[H * W]`, 0 where unknown, with what its values mean and whether they are in scene units; on the host, where priors
    /// are aligned.
    pub depth: Option<(Arc<Vec<f32>>, DepthSpace, bool)>,
    /// World velocity of the moving object's centre (Eq. 17), scene units per unit of time.
    pub guide: Option<[f64; 3]>,
}

impl Hints {
    /// Those of `view`, the `index`-th of the views that `found` is about.
    fn new(found: &Found, index: usize, view: &View, device: &Device) -> Self {
        // Where no motion was looked for (`motion.masks = "none"`) every Gaussian may move, but the pseudo-sharp photo still
        // stands only where the data set says that something does.
        let moving = found.masks.masks.get(index).unwrap_or(&view.priors.moving).as_deref();
        let depth = |prior: &DepthPrior| (Arc::new(prior.values.clone()), prior.space, prior.metric);
        // Pixels that do not count have no colour that a blurred one could be compared with.
        let compared = match (moving, view.mask.as_deref()) {
            (Some(moving), Some(counts)) => Some(moving.iter().zip(counts).map(|(a, b)| *a.min(b)).collect()),
            (one, None) | (None, one) => one.map(<[u8]>::to_vec),
        };
        Self {
            moving: moving.map(|mask| to_tensor(view, mask, 1, device)),
            pixels: compared.and_then(|mask: Vec<u8>| Pixels::masked(&mask, view.width, view.height, device)),
            sharp: view.priors.sharp.as_ref().map(|image| to_tensor(view, &image.data, 3, device)),
            depth: view.priors.depth.as_ref().map(depth),
            guide: found.guides.get(index).copied().flatten(),
        }
    }
}

/// Views as tensors, converted when asked for and kept while they fit the cache.
#[derive(Debug)]
pub struct Photos<'a> {
    views: &'a [View],
    device: Device,
    kept: Vec<Option<Photo>>,
    room: usize,
    motion: Option<Found>,
}

impl<'a> Photos<'a> {
    /// `views` for `device` (without autodiff), keeping at most `cache_bytes` of converted photos.
    pub fn new(views: &'a [View], device: &Device, cache_bytes: usize) -> Self {
        Self { views, device: device.clone(), kept: vec![None; views.len()], room: cache_bytes, motion: None }
    }

    /// The same photos with what was found about motion in them, one entry of `motion` per view; with `None`, photos come
    /// without hints.
    pub fn with_motion(self, motion: Option<Found>) -> Self {
        Self { motion, ..self }
    }

    /// The views themselves.
    pub fn views(&self) -> &'a [View] {
        self.views
    }

    /// View `index` on the device.
    pub fn get(&mut self, index: usize) -> Photo {
        if let Some(photo) = &self.kept[index] {
            return photo.clone();
        }
        let view = &self.views[index];
        let mut photo = upload(view, &self.device);
        if let Some(found) = &self.motion {
            photo.hints = Hints::new(found, index, view, &self.device);
        }
        let bytes = 4 * view.width * view.height * photo.channels();
        if bytes <= self.room {
            self.room -= bytes;
            self.kept[index] = Some(photo.clone());
        }
        photo
    }
}

/// The camera of a view.
pub fn camera(view: &View, device: &Device) -> Camera {
    Camera::from_c2w(view.c2w, intrinsics(&view.intrinsics), view.width, view.height, device)
}

/// Pinhole intrinsics in the words of `gs-burn`.
pub fn intrinsics(k: &gs_datasets::Intrinsics) -> Intrinsics {
    Intrinsics { fx: k.fx, fy: k.fy, cx: k.cx, cy: k.cy }
}

fn upload(view: &View, device: &Device) -> Photo {
    let tensor = |bytes: &[u8], channels| to_tensor(view, bytes, channels, device);
    Photo {
        camera: camera(view, device),
        image: tensor(&view.image.data, 3),
        mask: view.mask.as_ref().map(|mask| tensor(mask, 1)),
        time: view.time.unwrap_or(0.0),
        exposure: view.exposure,
        hints: Hints::default(),
    }
}

/// Bytes of an image of the view's size as floats from 0 to 1, `[H, W, channels]`.
pub fn to_tensor(view: &View, bytes: &[u8], channels: usize, device: &Device) -> Tensor<3> {
    let floats: Vec<f32> = bytes.par_iter().with_min_len(1 << 14).map(|b| f32::from(*b) / 255.0).collect();
    Tensor::from_data(TensorData::new(floats, [view.height, view.width, channels]), device)
}

impl Photo {
    /// Floats per pixel that it keeps.
    fn channels(&self) -> usize {
        let hints = &self.hints;
        let single = [self.mask.is_some(), hints.moving.is_some(), hints.depth.is_some()];
        3 + single.into_iter().map(usize::from).sum::<usize>() + 3 * usize::from(hints.sharp.is_some())
    }
}

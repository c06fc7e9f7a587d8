//! The data set as the trainer wants it: what to load ([`DataConfig`]), which view comes next ([`Sampler`]), and views
//! as tensors ([`Photos`]).

use std::path::PathBuf;
use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::{Camera, Intrinsics};
use gs_datasets::{DepthKind, DepthPrior, DepthSpace, Holdout, LoadOptions, MaskUse, PriorUse, View};
use gs_models::taylormode::Pixels;
use rand::Rng;
use rand::seq::SliceRandom;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::random::{Purpose, stream};
use crate::taylormode::hints::Found;

/// Which views are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HoldoutChoice {
    /// The data set's own split, or every 8th view where it has none.
    Dataset,
    /// Every `holdout_every`-th view by name.
    Every,
    /// The views of `holdout_names`.
    Names,
    /// None; the result is then measured on training views.
    None,
}

/// How mask files are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MaskChoice {
    /// By the rules of the data set's format.
    Auto,
    /// No mask is read.
    Ignore,
    /// Masks keep what is white.
    KeepWhite,
    /// Masks keep what is black.
    KeepBlack,
}

/// A guess that another program made about the photos.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PriorKind {
    /// Depth maps.
    Depth,
    /// Masks of what moves.
    Masks,
    /// Pseudo-sharp photos.
    Sharp,
}

/// What the numbers in depth files mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DepthChoice {
    /// As the data set says.
    Auto,
    /// Camera z in scene units.
    MetricZ,
    /// Camera z, up to a scale and a shift per photo.
    Depth,
    /// One over camera z, up to a scale and a shift per photo.
    InverseDepth,
}

/// How the data set is read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataConfig {
    /// Wider photos are downscaled to this width, pixels; 0 keeps the full size.
    pub max_width: usize,
    /// Which views are held out.
    pub holdout: HoldoutChoice,
    /// Every how many views one is held out, for `holdout = "every"`.
    pub holdout_every: usize,
    /// The views held out, by name or file stem, for `holdout = "names"`.
    pub holdout_names: Vec<String>,
    /// Image folder of a COLMAP model where it is not a usual one; empty: found by itself.
    pub images: String,
    /// Colour behind the scene and behind transparent pixels, 0 to 1 per channel.
    pub background: [f32; 3],
    /// How mask files are used.
    pub masks: MaskChoice,
    /// Priors that are read where the data set has them: "depth", "masks", "sharp". A still scene uses, and reads, masks alone:
    /// moving parts are measured by them.
    pub priors: Vec<PriorKind>,
    /// What depth files mean, whatever the data set says; "auto" goes by the data set.
    pub depth_kind: DepthChoice,
    /// Photos are kept as floats up to this many MB in all; the rest is converted from 8 bits in each step.
    pub cache_mb: usize,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            max_width: 0,
            holdout: HoldoutChoice::Dataset,
            holdout_every: gs_datasets::DEFAULT_HOLDOUT,
            holdout_names: Vec::new(),
            images: String::new(),
            background: [0.0; 3],
            masks: MaskChoice::Auto,
            priors: vec![PriorKind::Depth, PriorKind::Masks, PriorKind::Sharp],
            depth_kind: DepthChoice::Auto,
            cache_mb: 64,
        }
    }
}

impl DataConfig {
    /// The same choices in the words of the readers.
    pub fn options(&self) -> LoadOptions {
        LoadOptions {
            max_width: (self.max_width > 0).then_some(self.max_width),
            background: self.background,
            holdout: match self.holdout {
                HoldoutChoice::Dataset => Holdout::Dataset,
                HoldoutChoice::Every => Holdout::Every(self.holdout_every),
                HoldoutChoice::Names => Holdout::Names(self.holdout_names.clone()),
                HoldoutChoice::None => Holdout::None,
            },
            images: (!self.images.is_empty()).then(|| PathBuf::from(&self.images)),
            masks: match self.masks {
                MaskChoice::Auto => MaskUse::Auto,
                MaskChoice::Ignore => MaskUse::Ignore,
                MaskChoice::KeepWhite => MaskUse::KeepWhite,
                MaskChoice::KeepBlack => MaskUse::KeepBlack,
            },
            priors: PriorUse {
                depth: self.priors.contains(&PriorKind::Depth),
                masks: self.priors.contains(&PriorKind::Masks),
                sharp: self.priors.contains(&PriorKind::Sharp),
            },
            depth_kind: match self.depth_kind {
                DepthChoice::Auto => None,
                DepthChoice::MetricZ => Some(DepthKind::MetricZ),
                DepthChoice::Depth => Some(DepthKind::Depth),
                DepthChoice::InverseDepth => Some(DepthKind::InverseDepth),
            },
            ..LoadOptions::default()
        }
    }
}

/// Which view each step uses: every view once an epoch, in an order drawn from the seed. Step `s` has the same view
/// whether the run was interrupted or not.
#[derive(Debug, Clone)]
pub struct Sampler {
    seed: u64,
    count: usize,
    epoch: Option<u64>,
    order: Vec<usize>,
}

impl Sampler {
    /// A sampler over `count` views, at least one.
    pub fn new(seed: u64, count: usize) -> Self {
        assert!(count > 0, "a scene without training views is refused when it is loaded");
        Self { seed, count, epoch: None, order: (0..count).collect() }
    }

    /// The index of the view of `step` (from 1).
    pub fn pick(&mut self, step: usize) -> usize {
        let epoch = ((step - 1) / self.count) as u64;
        if self.epoch != Some(epoch) {
            self.order = (0..self.count).collect();
            self.order.shuffle(&mut stream(self.seed, Purpose::Views, epoch));
            self.epoch = Some(epoch);
        }
        self.order[(step - 1) % self.count]
    }
}

/// Which views a step may use while the recording is still being opened, from its middle to its ends.
#[derive(Debug, Clone)]
pub struct Curriculum {
    /// Indices of views by distance of their time from the middle.
    by_distance: Vec<(f64, usize)>,
    steps: usize,
    seed: u64,
}

impl Curriculum {
    /// Opens `views` around `middle` over the first `steps` steps; `None` when there is nothing to open.
    pub fn new(views: &[View], middle: f64, steps: usize, seed: u64) -> Option<Self> {
        let mut by_distance: Vec<(f64, usize)> =
            views.iter().enumerate().map(|(i, view)| ((view.time.unwrap_or(middle) - middle).abs(), i)).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let farthest = by_distance.last()?.0;
        (farthest > 0.0 && steps > 0).then_some(Self { by_distance, steps, seed })
    }

    /// The view of `step` (from 1); `None` once the whole recording is open. Each is drawn by itself, so that a resumed run
    /// draws the same.
    pub fn pick(&self, step: usize) -> Option<usize> {
        if step > self.steps {
            return None;
        }
        let farthest = self.by_distance.last()?.0;
        let nearest_other = self.by_distance.iter().map(|(distance, _)| *distance).find(|d| *d > 1e-9)?;
        // Never the middle alone: one blurry frame does not tell the direction of its motion.
        let limit = (farthest * step as f64 / self.steps as f64).max(nearest_other * (1.0 + 1e-6));
        let open = self.by_distance.partition_point(|(distance, _)| *distance <= limit);
        let mut rng = stream(self.seed, Purpose::Views, (1 << 40) | step as u64);
        Some(self.by_distance[rng.random_range(0..open)].1)
    }
}

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
    /// The same pixels as a list; `None` when there are none.
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
        Self {
            moving: moving.map(|mask| to_tensor(view, mask, 1, device)),
            pixels: moving.and_then(|mask| Pixels::masked(mask, view.width, view.height, device)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_holds_every_view_once() {
        let mut sampler = Sampler::new(3, 10);
        let first: Vec<usize> = (1..=10).map(|step| sampler.pick(step)).collect();
        let second: Vec<usize> = (11..=20).map(|step| sampler.pick(step)).collect();
        let sorted = |mut order: Vec<usize>| {
            order.sort_unstable();
            order
        };
        assert_eq!(sorted(first.clone()), (0..10).collect::<Vec<_>>());
        assert_eq!(sorted(second.clone()), (0..10).collect::<Vec<_>>());
        assert_ne!(first, second);
    }

    #[test]
    fn a_curriculum_opens_from_the_middle() {
        let view = |time: f64| View {
            name: String::new(),
            image_path: PathBuf::new(),
            c2w: glam::DMat4::IDENTITY,
            intrinsics: gs_datasets::Intrinsics { fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5 },
            width: 1,
            height: 1,
            time: Some(time),
            camera_id: None,
            image: gs_datasets::RgbImage8 { width: 1, height: 1, data: vec![0; 3] },
            mask: None,
            exposure: None,
            priors: gs_datasets::Priors::default(),
            truth: gs_datasets::Truth::default(),
        };
        let views: Vec<View> = (0..=10).map(|i| view(f64::from(i) / 10.0)).collect();
        let curriculum = Curriculum::new(&views, 0.5, 100, 1).expect("times differ");
        for step in 1..=100 {
            let distance = views[curriculum.pick(step).expect("open")].time.map_or(0.0, |t| (t - 0.5).abs());
            assert!(distance <= (0.5 * step as f64 / 100.0).max(0.1) + 1e-6, "step {step}: {distance}");
        }
        assert_eq!(curriculum.pick(101), None);
        assert!(Curriculum::new(&views[..1], 0.0, 100, 1).is_none(), "one time has nothing to open");
    }

    #[test]
    fn a_resumed_sampler_continues() {
        let mut whole = Sampler::new(3, 7);
        let order: Vec<usize> = (1..=30).map(|step| whole.pick(step)).collect();
        let mut resumed = Sampler::new(3, 7);
        assert_eq!((17..=30).map(|step| resumed.pick(step)).collect::<Vec<_>>(), order[16..]);
    }
}

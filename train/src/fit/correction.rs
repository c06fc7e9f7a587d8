//! Exposure and white balance of the photos: a learned change of a rendering's colours before it is compared.
//!
//! ```text
//! taken = seen exp(g) + seen M + b
//! ```
//!
//! with the rendering's colours `seen` `[pixels, 3]`, and a gain `g` `[3]`, a mix `M` `[3, 3]` and an offset `b` `[3]`
//! of the photo or its camera, each less its mean over all of them: a brighter scene under darker photos looks the
//! same. Gains begin at what photos say of the points they share ([`gs_multiview::gains`]), which decides too whether
//! anything is learned.

use std::collections::{BTreeMap, BTreeSet};

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::NamedGradients;
use gs_burn::adam::{Adam, AdamRate};
use gs_datasets::{View, surveyed};
use gs_multiview::{Gains, gains};
use serde::{Deserialize, Serialize};

use super::schedule::exponential;
use crate::config::{Config, CorrectionConfig, CorrectionMode, CorrectionPer};

/// Most of the disagreement of photos that gains may leave, at points that did not determine them, and least root mean
/// square of the gains, for any to be learned. Sets of one exposure leave 0.98 to 1.01 and have 0.004; a phone's
/// automatic exposure (fox) leaves 0.85 and has 0.07, the cameras of a hall 0.60 and 0.09. A gain that is wrong by
/// 0.015 limits a photo of mean grey to 42 dB.
const DISAGREE: (f64, f64) = (0.95, 0.015);

/// Photos have their own gains where these leave less than this share of what those of their cameras do.
const OWN: f64 = 0.9;

/// Most photos of a set for which gains of single photos are looked for.
const PHOTOS: usize = 1000;

/// The last learning rate, in first ones.
const LAST: f64 = 0.1;

/// Photos of which the mean is taken for one that is held out. Automatic exposure follows what a camera sees, so that
/// neighbours have nearly the same.
const NEAREST: usize = 3;

/// Share of the farthest one's distance that is added to all in their weights, so that none has all of it.
const SOFT: f64 = 0.1;

/// Columns of the mix and the offset.
const AFFINE: usize = 12;

/// How far other photos are from a view: in time where all have one, else the distance of their cameras over its mean,
/// and the angle between their axes, radians.
fn apart(view: &View, others: &[&View]) -> Vec<f64> {
    let in_time: Option<Vec<f64>> = others.iter().map(|other| Some((other.time? - view.time?).abs())).collect();
    if let Some(in_time) = in_time {
        return in_time;
    }
    let [centre, axis] = [view.c2w.w_axis.truncate(), view.c2w.z_axis.truncate()];
    let distances: Vec<f64> = others.iter().map(|other| other.c2w.w_axis.truncate().distance(centre)).collect();
    let mean = (distances.iter().sum::<f64>() / distances.len().max(1) as f64).max(f64::MIN_POSITIVE);
    let angle = |other: &View| other.c2w.z_axis.truncate().angle_between(axis);
    others.iter().zip(distances).map(|(other, distance)| distance / mean + angle(other)).collect()
}

/// A photo, with its camera if that is known, or a camera: each has a correction of its own.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Source {
    /// The photo's name; `None`: all photos of the camera.
    pub photo: Option<String>,
    /// The camera.
    pub camera: Option<String>,
}

/// The corrections of all sources.
#[derive(Module, Debug)]
pub struct Correction {
    /// `[sources, 3]`, natural logarithms.
    pub gains: Param<Tensor<2>>,
    /// `[sources, 12]`: the mix by rows, and the offset; `None`: gains alone.
    pub affine: Option<Param<Tensor<2>>>,
    #[module(skip)]
    sources: Vec<Source>,
}

/// The structure of a [`Correction`], which a checkpoint holds beside its tensors.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CorrectionFrame {
    sources: Vec<Source>,
    affine: bool,
}

impl Correction {
    /// The corrections before the first step, of photos that show `points`; `None` if none is learned.
    pub fn begin(views: &[View], points: &[[f32; 3]], config: &CorrectionConfig, device: &Device) -> Option<Self> {
        let affine = match config.mode {
            CorrectionMode::None => return None,
            CorrectionMode::Affine => true,
            CorrectionMode::Auto | CorrectionMode::Gain => false,
        };
        let [camera, photo] =
            [CorrectionPer::Camera, CorrectionPer::Photo].map(|per| Found::of(views, points, per, config));
        let chosen = match (camera, photo) {
            (Some(camera), Some(photo)) if photo.left() < OWN * camera.left() => photo,
            (Some(camera), _) => camera,
            (None, photo) => photo?,
        };
        if config.mode == CorrectionMode::Auto && !chosen.disagree() {
            return None;
        }
        let correction = Self::of_frame(&CorrectionFrame { sources: chosen.sources, affine }, device);
        let Some(gains) = chosen.gains else { return Some(correction) };
        let values: Vec<f32> = gains.logarithms.iter().flatten().map(|gain| *gain as f32).collect();
        let gains = Tensor::from_data(TensorData::new(values, correction.gains.dims()), device);
        Some(Self { gains: Param::from_tensor(gains), ..correction })
    }

    /// Corrections that change nothing.
    pub fn of_frame(frame: &CorrectionFrame, device: &Device) -> Self {
        let zeros = |columns| Param::from_tensor(Tensor::zeros([frame.sources.len(), columns], device));
        Self { gains: zeros(3), affine: frame.affine.then(|| zeros(AFFINE)), sources: frame.sources.clone() }
    }

    /// Its structure.
    pub fn frame(&self) -> CorrectionFrame {
        CorrectionFrame { sources: self.sources.clone(), affine: self.affine.is_some() }
    }

    /// The change of colours of a training photo; `None` if it has none.
    pub fn of(&self, view: &View) -> Option<ColorChange> {
        Some(self.change(&[(self.row(view)?, 1.0)]))
    }

    /// The change of colours of a photo that may be held out: its own, or the mean over the nearest of `train`, in time
    /// or by their cameras' poses. `None` if nothing is known, which is the mean over all.
    pub fn near(&self, view: &View, train: &[View]) -> Option<ColorChange> {
        if let Some(own) = self.of(view) {
            return Some(own);
        }
        // A camera that no training photo is of has an exposure of its own.
        let same: Vec<&View> = train.iter().filter(|other| other.camera_id == view.camera_id).collect();
        let apart = apart(view, &same);
        let mut rows: Vec<(f64, usize)> =
            same.iter().zip(apart).filter_map(|(other, apart)| Some((apart, self.row(other)?))).collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.truncate(NEAREST);
        let farthest = rows.last()?.0;
        let weight = |apart: f64| 1.0 / (apart + SOFT * farthest).max(f64::MIN_POSITIVE);
        let total: f64 = rows.iter().map(|(apart, _)| weight(*apart)).sum();
        let shares: Vec<(usize, f64)> = rows.iter().map(|(apart, row)| (*row, weight(*apart) / total)).collect();
        Some(self.change(&shares))
    }

    fn row(&self, view: &View) -> Option<usize> {
        let is_of = |source: &Source| match &source.photo {
            Some(photo) => *photo == view.name,
            None => source.camera == view.camera_id,
        };
        self.sources.iter().position(is_of)
    }

    /// The sum of some rows with their weights.
    fn change(&self, rows: &[(usize, f64)]) -> ColorChange {
        let device = self.gains.device();
        let indices: Vec<i32> = rows.iter().map(|(row, _)| *row as i32).collect();
        let weights: Vec<f32> = rows.iter().map(|(_, weight)| *weight as f32).collect();
        let indices = Tensor::from_data(TensorData::from(indices.as_slice()), &device);
        let weights = Tensor::<2>::from_data(TensorData::new(weights, [rows.len(), 1]), &device);
        let sum = |table: Tensor<2>| (centred(table).select(0, indices.clone()) * weights.clone()).sum_dim(0);
        ColorChange { gain: sum(self.gains.val()).exp(), affine: self.affine.as_ref().map(|affine| sum(affine.val())) }
    }

    /// The mean square of all corrections, `[1]`.
    pub fn size(&self) -> Tensor<1> {
        let gains = mean_square(self.gains.val());
        self.affine.as_ref().map_or(gains.clone(), |affine| gains + mean_square(affine.val()))
    }

    /// One step of its tensors, whose paths begin with `correction.`.
    pub(super) fn updated(self, gradients: &mut NamedGradients, adam: &mut Adam, config: &Config, step: usize) -> Self {
        let lr = config.correction.gain_lr;
        let rate = exponential(lr, LAST * lr, step, config.steps);
        adam.update_under("correction", self, gradients, |_| Some(AdamRate::new(rate)))
    }

    /// Root mean square of the gains over sources and channels, a share.
    pub fn spread(&self) -> f64 {
        f64::from(mean_square(self.gains.val()).into_scalar::<f32>()).sqrt()
    }

    /// A line about it for people.
    pub fn described(&self) -> String {
        let what = match (&self.affine, self.sources.iter().all(|source| source.photo.is_none())) {
            (None, true) => "a gain of each channel for each camera",
            (None, false) => "a gain of each channel for each photo",
            (Some(_), true) => "a change of colours for each camera",
            (Some(_), false) => "a change of colours for each photo",
        };
        format!("{what}, which differ by {:.1} % (root mean square)", 100.0 * self.spread())
    }
}

/// A table less the mean of its rows.
fn centred(table: Tensor<2>) -> Tensor<2> {
    table.clone() - table.mean_dim(0)
}

/// The mean square of [`centred`], `[1]`.
fn mean_square(table: Tensor<2>) -> Tensor<1> {
    centred(table).powi_scalar(2).mean()
}

/// The change of a rendering's colours to those of a photo.
#[derive(Debug, Clone)]
pub struct ColorChange {
    /// `[1, 3]`.
    gain: Tensor<2>,
    /// `[1, 12]`.
    affine: Option<Tensor<2>>,
}

impl ColorChange {
    /// The colours `[H, W, 3]` as the photo shows them.
    pub fn of(&self, seen: Tensor<3>) -> Tensor<3> {
        let [height, width, _] = seen.dims();
        let taken = seen.clone() * self.gain.clone().reshape([1, 1, 3]);
        let Some(affine) = &self.affine else { return taken };
        let (mix, offset) = (affine.clone().narrow(1, 0, 9).reshape([3, 3]), affine.clone().narrow(1, 9, 3));
        let mixed = seen.reshape([height * width, 3]).matmul(mix) + offset;
        taken + mixed.reshape([height, width, 3])
    }
}

/// Sources of a set, and what points say of their gains.
struct Found {
    sources: Vec<Source>,
    gains: Option<Gains>,
}

impl Found {
    /// `None` where the set has no such sources, or `config` excludes them.
    fn of(views: &[View], points: &[[f32; 3]], per: CorrectionPer, config: &CorrectionConfig) -> Option<Self> {
        let is_asked = config.per == per;
        if !(is_asked || config.per == CorrectionPer::Auto) {
            return None;
        }
        let source = |view: &View| match per {
            CorrectionPer::Camera => Source { photo: None, camera: view.camera_id.clone() },
            _ => Source { photo: Some(view.name.clone()), camera: view.camera_id.clone() },
        };
        let mut indices = BTreeMap::new();
        for view in views {
            if per == CorrectionPer::Camera && view.camera_id.is_none() {
                return None;
            }
            indices.entry(source(view)).or_insert(0);
        }
        indices.values_mut().enumerate().for_each(|(i, index)| *index = i);
        let too_many = per == CorrectionPer::Photo && indices.len() > PHOTOS;
        if indices.len() < 2 || (too_many && !is_asked) {
            return None;
        }
        let shown = surveyed(views);
        let of_shown: Vec<usize> = shown.iter().map(|view| indices[&source(view)]).collect();
        // Of a set larger than memory, nothing is known of sources without a surveyed photo.
        let are_shown = of_shown.iter().collect::<BTreeSet<_>>().len() == indices.len();
        let gains = are_shown.then(|| gains(shown, &of_shown, points)).flatten();
        Some(Self { gains, sources: indices.into_keys().collect() })
    }

    /// The share of the disagreement that gains leave.
    fn left(&self) -> f64 {
        self.gains.as_ref().map_or(1.0, |gains| gains.left)
    }

    fn disagree(&self) -> bool {
        let disagree = |gains: &Gains| gains.left <= DISAGREE.0 && gains.spread() >= DISAGREE.1;
        self.gains.as_ref().is_some_and(disagree)
    }
}

#[cfg(test)]
mod tests {
    use super::super::parameters::to_host;
    use super::*;

    fn device() -> Device {
        Device::default()
    }

    fn view(name: &str, camera: Option<&str>, x: f64) -> View {
        let c2w = glam::DMat4::from_translation(glam::DVec3::new(x, 0.0, 0.0));
        View { name: name.into(), camera_id: camera.map(Into::into), c2w, ..View::blank(2, 1) }
    }

    fn of(sources: &[(Option<&str>, Option<&str>)], gains: &[f32]) -> Correction {
        let text = |text: &Option<&str>| text.map(String::from);
        let sources =
            sources.iter().map(|(photo, camera)| Source { photo: text(photo), camera: text(camera) }).collect();
        let correction = Correction::of_frame(&CorrectionFrame { sources, affine: false }, &device());
        let rows: Vec<f32> = gains.iter().flat_map(|gain| [*gain; 3]).collect();
        let gains = Tensor::from_data(TensorData::new(rows, [gains.len(), 3]), &device());
        Correction { gains: Param::from_tensor(gains), ..correction }
    }

    /// The logarithm of the factor on white.
    fn log_gain(change: Option<ColorChange>) -> Option<f32> {
        let white = Tensor::<3>::ones([1, 2, 3], &device());
        change.map(|change| to_host(change.of(white))[0].ln())
    }

    /// A held-out photo lies between its neighbours; one of a camera that is not known has the mean of all, which is no
    /// change.
    #[test]
    fn held_out_photos_follow_their_neighbours() {
        let train = [view("a", None, 0.0), view("b", None, 1.0), view("c", None, 5.0), view("d", None, 6.0)];
        let sources = [Some("a"), Some("b"), Some("c"), Some("d")].map(|photo| (photo, None));
        let correction = of(&sources, &[0.2, 0.4, -0.2, -0.4]);
        let near = |x: f64| log_gain(correction.near(&view("e", None, x), &train)).expect("neighbours");
        assert!((log_gain(correction.of(&train[0])).expect("its own") - 0.2).abs() < 1e-6);
        assert!((0.2..0.35).contains(&near(0.5)), "{}", near(0.5));
        assert!((-0.35..-0.2).contains(&near(5.5)), "{}", near(5.5));
        assert!(correction.near(&view("e", Some("other"), 0.5), &train).is_none());
        assert!(correction.near(&view("e", None, 0.5), &[]).is_none(), "another data set");
    }

    /// The gains' mean over the sources is taken out: 0.3 and -0.1 are 0.2 and -0.2.
    #[test]
    fn cameras_have_one_gain_at_all_times() {
        let train = [view("a", Some("left"), 0.0), view("b", Some("right"), 1.0)];
        let correction = of(&[(None, Some("left")), (None, Some("right"))], &[0.3, -0.1]);
        let held_out = view("c", Some("right"), 0.0);
        assert!((log_gain(correction.near(&held_out, &train)).expect("its camera") + 0.2).abs() < 1e-6);
        assert!((correction.spread() - 0.2).abs() < 1e-6);
        assert!((f64::from(correction.size().into_scalar::<f32>()) - 0.04).abs() < 1e-6);
    }

    #[test]
    fn a_mix_and_an_offset_add_to_the_gains() {
        let mix = [0.0, 0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0];
        let values: Vec<f32> = mix.into_iter().chain([0.01, 0.02, 0.03]).collect();
        let affine = Tensor::<2>::from_data(TensorData::new(values, [1, AFFINE]), &device());
        let change = ColorChange { gain: Tensor::<2>::full([1, 3], 2.0, &device()), affine: Some(affine) };
        let seen = Tensor::<1>::from_data([0.1, 0.2, 0.3], &device()).reshape([1, 1, 3]);
        let taken = to_host(change.of(seen));
        // Red takes a fifth of green, green a tenth of red.
        let expected = [0.2 + 0.04 + 0.01, 0.4 + 0.01 + 0.02, 0.6 + 0.03];
        assert!(
            taken.iter().zip(expected).all(|(taken, expected): (&f32, f32)| (taken - expected).abs() < 1e-6),
            "{taken:?}"
        );
    }

    #[test]
    fn nothing_is_learned_without_evidence() {
        let train = [view("a", None, 0.0), view("b", None, 1.0)];
        let begin = |mode| {
            let config = CorrectionConfig { mode, ..CorrectionConfig::default() };
            Correction::begin(&train, &[[0.0, 0.0, 2.0]; 9], &config, &device()).map(|it| it.frame())
        };
        assert_eq!(begin(CorrectionMode::Auto), None);
        assert_eq!(begin(CorrectionMode::None), None);
        let frame = begin(CorrectionMode::Affine).expect("asked for");
        assert!(frame.affine && frame.sources.len() == 2);
    }
}

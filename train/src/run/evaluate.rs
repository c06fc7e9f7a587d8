//! Measurement of a scene: held-out views are rendered and compared.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor};
use gs_base::counted;
use gs_burn::Gaussians;
use gs_datasets::{Scene, View};
use serde::{Deserialize, Serialize};

use super::metrics::{
    Perceptual, is_of_equal_images, ms_ssim, mse_of_psnr, psnr, psnr_masked, psnr_of_mse, shown_psnr, ssim, ssim_masked,
};
use crate::config::EvalConfig;
use crate::fit::figure::{Figure, FigureTable, Prominence};
use crate::fit::method::Step;
use crate::fit::photos::{Photo, Photos, to_tensor};
use crate::fit::saved::Saved;
use crate::fit::told::{Compared, MOVING, Region, Told, given_regions};
use crate::fit::trainer::Model;
use crate::run::resources::release_freed_memory;

/// Times at which a scene is held at once: a rollout is integrated once for all of them, and each holds its Gaussians.
pub const TIMES_AT_ONCE: usize = 16;

/// Image quality of one view, or the mean over several.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
    /// Structural similarity, 11x11 Gaussian window.
    pub ssim: f64,
    /// Multi-scale SSIM; `None` when not measured (images under 176 pixels).
    pub ms_ssim: Option<f64>,
    /// LPIPS; `None` when not measured.
    pub lpips: Option<f64>,
}

/// The scores of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewScores {
    /// The view's name.
    pub name: String,
    /// Its scores.
    #[serde(flatten)]
    pub scores: Scores,
    /// Its scores over single regions, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub regions: BTreeMap<String, Scores>,
}

/// Image quality over some views.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// The mean over views.
    #[serde(flatten)]
    pub mean: Scores,
    /// PSNR of the mean squared error over all views, dB: the number that NVFi, TRACE and FreeGave report. It is never
    /// above `psnr`, the mean of the views' own; 0 in files of before.
    #[serde(default)]
    pub psnr_of_mean_error: f64,
    /// The mean over the views in which a region has pixels, by the region's name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub regions: BTreeMap<String, Scores>,
    /// Whether a region was inferred from the photos, because the data set does not mark it.
    #[serde(default)]
    pub regions_inferred: bool,
    /// The comparison that was made: a sharp rendering with the "photo", with the "sharp truth" of a blurry photo, or
    /// the "formed blur" of the scene over each photo's exposure with the blurry photo.
    pub compared: String,
    /// The network of LPIPS: "vgg", "alex" or "squeeze".
    pub lpips_network: Option<String>,
    /// The reason why LPIPS is missing.
    pub lpips_reason: Option<String>,
    /// The reason why MS-SSIM is missing.
    pub ms_ssim_reason: Option<String>,
    /// Each view.
    pub views: Vec<ViewScores>,
}

/// The size of a scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelSize {
    /// Gaussians.
    pub gaussians: usize,
    /// Bytes of every number, as f32, that is needed to draw the scene.
    pub bytes: usize,
}

/// The cost of a training so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Training time, seconds, without measuring and saving.
    pub seconds: f64,
    /// Processor time of training, seconds, all threads; `None` if the system does not report it.
    pub cpu_seconds: Option<f64>,
    /// Peak resident memory, bytes; `None` if the system does not report it.
    pub peak_memory_bytes: Option<u64>,
}

/// A scene measured on one split.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Name of the split: "test", "validation"; "train" if nothing is held out, which says little about new views.
    pub split: String,
    /// Image quality.
    #[serde(flatten)]
    pub quality: Quality,
    /// The size of the scene.
    #[serde(flatten)]
    pub size: ModelSize,
    /// Figures of the method.
    #[serde(default)]
    pub figures: Vec<Figure>,
    /// Tables of the method.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<FigureTable>,
}

/// A measurement after a step.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Steps taken.
    pub step: usize,
    /// The measurement.
    #[serde(flatten)]
    pub measured: Measured,
    /// The cost up to the step.
    #[serde(flatten)]
    pub cost: Cost,
}

/// A view's photo and rendering, `[H, W, 3]` from 0 to 1.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// The view's name.
    pub name: String,
    /// The photo with which the rendering is compared.
    pub truth: Tensor<3>,
    /// The rendering.
    pub image: Tensor<3>,
    /// `[H, W, 1]`: 0 where the photo is masked; `None` if every pixel counts.
    pub mask: Option<Tensor<3>>,
    /// The blurry photo, if `truth` is sharp and both are known, `[H, W, 3]`.
    pub blurry: Option<Tensor<3>>,
    /// The rendering's PSNR, dB.
    pub psnr: f64,
    /// Pictures beside these, `[H, W, 3]`, with their names.
    pub more: Vec<(&'static str, Tensor<3>)>,
}

/// Views of one split with the regions that are scored separately.
pub struct HeldOut<'a> {
    /// Name of the split.
    pub split: &'a str,
    /// Its views.
    pub views: &'a [View],
    /// The regions of each.
    pub regions: Vec<Vec<Region>>,
}

impl<'a> HeldOut<'a> {
    /// The split called `name` ("train" for the training views). Without a name: the split on which figures are
    /// reported, which is the test views, or the training views if nothing is held out. `None` if there is no such
    /// split.
    pub fn of<M: Told>(scene: &'a Scene, name: Option<&str>) -> Option<Self> {
        let (split, views) = match name {
            Some("train") => ("train", scene.train.as_slice()),
            Some(name) => {
                scene.held_out.iter().find(|split| split.name == name).map(|s| (s.name.as_str(), s.views.as_slice()))?
            }
            None => {
                scene.reported().map_or(("train", scene.train.as_slice()), |s| (s.name.as_str(), s.views.as_slice()))
            }
        };
        let regions = match M::blur() {
            Some(blur) => blur.regions(views),
            None => views.iter().map(given_regions).collect(),
        };
        Some(Self { split, views, regions })
    }

    /// Whether the data set does not give one of the regions.
    fn has_inferred(&self) -> bool {
        let inferred = |(view, regions): (&View, &Vec<Region>)| {
            let given = given_regions(view);
            regions.iter().any(|region| !given.contains(region))
        };
        self.views.iter().zip(&self.regions).any(inferred)
    }
}

/// Measures scenes. LPIPS weights are searched for once.
#[derive(Debug)]
pub struct Evaluator {
    perceptual: Result<Perceptual, String>,
    ms_ssim: bool,
    device: Device,
}

impl Evaluator {
    /// An evaluator for tensors on `device`.
    pub fn new(config: &EvalConfig, device: &Device) -> Self {
        let perceptual = match config.lpips {
            true => Perceptual::from_cache(device),
            false => Err("no LPIPS: switched off (eval.lpips = false)".into()),
        };
        Self { perceptual, ms_ssim: config.ms_ssim, device: device.clone() }
    }

    /// Renders and measures a model on some views; also returns the pictures of `kept` views, spread evenly over all.
    pub fn measure<M: Told + Saved>(
        &self,
        model: &Model<M>,
        scene: &Scene,
        held_out: &HeldOut,
        at: &Step<M>,
        kept: usize,
    ) -> (Measured, Vec<Comparison>) {
        release_freed_memory();
        let (quality, comparisons) = self.quality(model, held_out, at, kept);
        let (method, gaussians) = (&model.method, &model.gaussians);
        let figures = method.figures(gaussians, scene, held_out.views, at);
        let measured = Measured {
            split: held_out.split.into(),
            quality,
            size: ModelSize { gaussians: gaussians.len(), bytes: method.bytes(gaussians, at.config) },
            figures: figures.numbers,
            tables: figures.tables,
        };
        (measured, comparisons)
    }

    fn quality<M: Told>(
        &self,
        model: &Model<M>,
        held_out: &HeldOut,
        at: &Step<M>,
        kept: usize,
    ) -> (Quality, Vec<Comparison>) {
        let (scene, blur) = (model.method.scene(model.gaussians.clone()), M::blur());
        let views = held_out.views;
        let keep_every = views.len().div_ceil(kept.clamp(1, views.len().max(1))).max(1);
        let mut photos = Photos::plain(views, &self.device);
        let (mut scores, mut comparisons, mut compared) = (Vec::new(), Vec::new(), Compared::Sharp);
        for together in by_time(views).chunks(TIMES_AT_ONCE) {
            let times: Vec<f64> = together.iter().map(|(time, _)| *time).collect();
            let mut shared: Option<Vec<Gaussians>> = None;
            for (at_time, (_, indices)) in together.iter().enumerate() {
                for index in indices.iter().copied() {
                    let view = &views[index];
                    let photo = photos.get(index);
                    let formed = blur.and_then(|blur| blur.formed(&model.method, &model.gaussians, view, at));
                    let image = match formed {
                        Some(formed) => {
                            compared = Compared::FormedBlur;
                            formed
                        }
                        None => {
                            let gaussians = &shared.get_or_insert_with(|| scene.at_times(&times))[at_time];
                            let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
                            gs_burn::render(gaussians, &photo.camera, &options).color.clamp(0.0, 1.0)
                        }
                    };
                    let Some(whole) = self.scores(image.clone(), photo.image.clone(), photo.mask.clone()) else {
                        tracing::warn!(view = view.name, "no pixel counts: the view is not measured");
                        continue;
                    };
                    let regions = held_out.regions[index].iter().filter_map(|region| {
                        let scores = self.region(image.clone(), &photo, view, region)?;
                        Some((region.name.to_string(), scores))
                    });
                    let regions = regions.collect();
                    if kept > 0 && index % keep_every == 0 {
                        comparisons.push((index, self.comparison(view, photo, image, whole.psnr)));
                    }
                    scores.push((index, ViewScores { name: view.name.clone(), scores: whole, regions }));
                }
            }
        }
        scores.sort_by_key(|(index, _)| *index);
        comparisons.sort_by_key(|(index, _)| *index);
        let scores = scores.into_iter().map(|(_, scores)| scores).collect();
        let comparisons = comparisons.into_iter().map(|(_, comparison)| comparison).collect();
        let has_truth = views.iter().any(|view| view.truth.blurry.is_some());
        let summary = self.summary(scores, described_comparison(compared, has_truth));
        let regions_inferred = !summary.regions.is_empty() && held_out.has_inferred();
        (Quality { regions_inferred, ..summary }, comparisons)
    }

    fn comparison(&self, view: &View, photo: Photo<()>, image: Tensor<3>, psnr: f64) -> Comparison {
        let blurry = view.truth.blurry.as_ref().map(|blurry| to_tensor(view, &blurry.data, 3, &self.device));
        Comparison {
            name: view.name.clone(),
            truth: photo.image,
            image,
            mask: photo.mask,
            blurry,
            psnr,
            more: Vec::new(),
        }
    }

    /// The scores over the pixels at which `counts`, `[H, W, 1]`, is 1; `None` without such a pixel. The other pixels
    /// are black in both images. LPIPS alone is a mean over these as well, since its network gives one number for an
    /// image.
    pub fn scores(&self, image: Tensor<3>, truth: Tensor<3>, counts: Option<Tensor<3>>) -> Option<Scores> {
        let (within, image, truth) = match counts.clone() {
            None => (
                Scores {
                    psnr: psnr(image.clone(), truth.clone()),
                    ssim: ssim(image.clone(), truth.clone()),
                    ..Scores::default()
                },
                image,
                truth,
            ),
            Some(counts) => {
                let [image, truth] = [image, truth].map(|image| image * counts.clone());
                (scores_within(image.clone(), truth.clone(), counts)?, image, truth)
            }
        };
        Some(Scores {
            ms_ssim: self.ms_ssim.then(|| ms_ssim(image.clone(), truth.clone(), counts)).flatten(),
            lpips: self.perceptual.as_ref().ok().map(|network| network.distance(image, truth)),
            ..within
        })
    }

    /// The scores over the pixels of a region that count; `None` if there is none.
    fn region(&self, image: Tensor<3>, photo: &Photo<()>, view: &View, region: &Region) -> Option<Scores> {
        let inside = to_tensor(view, &region.mask, 1, &image.device());
        let truth = photo.image.clone();
        match photo.mask.clone() {
            None => scores_within(image, truth, inside),
            Some(mask) => scores_within(image * mask.clone(), truth * mask.clone(), inside * mask),
        }
    }

    /// The mean over views, their regions, and why a measure is missing; `compared` says with what they were compared.
    pub fn summary(&self, views: Vec<ViewScores>, compared: &str) -> Quality {
        let mean = mean(views.iter().map(|view| &view.scores)).unwrap_or_default();
        let mut names: Vec<&String> = views.iter().flat_map(|view| view.regions.keys()).collect();
        names.sort();
        names.dedup();
        let of = |name: &String| self::mean(views.iter().filter_map(|view| view.regions.get(name)));
        let regions = names.into_iter().filter_map(|name| Some((name.clone(), of(name)?))).collect();
        let ms_ssim_reason = match (mean.ms_ssim, self.ms_ssim) {
            (Some(_), _) => None,
            (None, true) => Some("no MS-SSIM: an image side is under 176 pixels".into()),
            (None, false) => Some("no MS-SSIM: switched off (eval.ms_ssim = false)".into()),
        };
        Quality {
            psnr_of_mean_error: psnr_of_mean_error(&views),
            mean,
            regions,
            regions_inferred: false,
            compared: compared.into(),
            lpips_network: self.perceptual.as_ref().ok().map(|network| network.name.into()),
            lpips_reason: self.perceptual.as_ref().err().cloned(),
            ms_ssim_reason,
            views,
        }
    }
}

/// PSNR of the mean over views of the squared error, dB; 0 without a view.
fn psnr_of_mean_error(views: &[ViewScores]) -> f64 {
    if views.is_empty() {
        return 0.0;
    }
    let errors = views.iter().map(|view| mse_of_psnr(view.scores.psnr));
    psnr_of_mse(errors.sum::<f64>() / views.len() as f64)
}

/// The views of each time by index, times ascending; 0 for a view without a time.
fn by_time(views: &[View]) -> Vec<(f64, Vec<usize>)> {
    let mut order: Vec<(f64, usize)> =
        views.iter().enumerate().map(|(index, view)| (view.time.unwrap_or(0.0), index)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut groups: Vec<(f64, Vec<usize>)> = Vec::new();
    for (time, index) in order {
        match groups.last_mut() {
            Some((last, indices)) if *last == time => indices.push(index),
            _ => groups.push((time, vec![index])),
        }
    }
    groups
}

/// The mean of each score that all views have; `None` without a view.
fn mean<'a>(scores: impl Iterator<Item = &'a Scores> + Clone) -> Option<Scores> {
    let of = |value: fn(&Scores) -> Option<f64>| -> Option<f64> {
        let values: Vec<f64> = scores.clone().map(value).collect::<Option<_>>()?;
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    Some(Scores {
        psnr: of(|scores| Some(scores.psnr))?,
        ssim: of(|scores| Some(scores.ssim))?,
        ms_ssim: of(|scores| scores.ms_ssim),
        lpips: of(|scores| scores.lpips),
    })
}

impl Quality {
    /// The reason why the figures say nothing, where the renderings equal the photos.
    pub fn nothing_to_tell(&self) -> Option<&'static str> {
        is_of_equal_images(self.mean.psnr).then_some("the photos hold nothing to tell: renderings equal them")
    }

    /// The scores over moving pixels, if they were measured.
    pub fn moving(&self) -> Option<&Scores> {
        self.regions.get(MOVING)
    }
}

impl Evaluation {
    /// The scores over the whole images.
    pub fn mean(&self) -> &Scores {
        &self.measured.quality.mean
    }

    /// The scores over moving pixels, if they were measured.
    pub fn moving(&self) -> Option<&Scores> {
        self.measured.quality.moving()
    }

    /// Without single views and tables, which are kept for the last measurement of a run alone.
    pub fn without_details(&self) -> Self {
        let mut evaluation = self.clone();
        evaluation.measured.quality.views.clear();
        evaluation.measured.tables.clear();
        evaluation
    }

    /// A figure of the method by its key.
    pub fn figure(&self, key: &str) -> Option<f64> {
        self.measured.figures.iter().find(|figure| figure.key == key).map(|figure| figure.value)
    }

    /// The measurement in one line.
    pub fn line(&self) -> String {
        let optional = |name: &str, value: Option<f64>| value.map_or(String::new(), |v| format!(", {name} {v:.4}"));
        let Measured { split, quality, size, .. } = &self.measured;
        let regions: String = quality
            .regions
            .iter()
            .map(|(name, scores)| format!(", {name} parts {}", shown_psnr(scores.psnr)))
            .collect();
        format!(
            "step {}: PSNR {}{}, SSIM {:.4}{}{}{regions} over {}; {}, {:.1} s",
            self.step,
            shown_psnr(quality.mean.psnr),
            quality.nothing_to_tell().map_or(String::new(), |why| format!(" ({why})")),
            quality.mean.ssim,
            optional("MS-SSIM", quality.mean.ms_ssim),
            optional("LPIPS", quality.mean.lpips),
            described_split(split, quality.views.len()),
            counted(size.gaussians, "Gaussian"),
            self.cost.seconds
        )
    }
}

impl Measured {
    /// The method's headline figures in one line; `None` without any.
    pub fn figures_line(&self) -> Option<String> {
        let headlines = self.figures.iter().filter(|figure| figure.prominence == Prominence::Headline);
        let parts: Vec<String> = headlines
            .map(|figure| {
                let note = if figure.note.is_empty() { String::new() } else { format!(" ({})", figure.note) };
                format!("{} {}{note}", figure.name, figure.shown())
            })
            .collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// The word for sharp renderings that are compared with photos.
pub const PHOTO: &str = "photo";

/// A comparison in a word; `has_truth`: the sharp truth of blurry photos is known.
fn described_comparison(compared: Compared, has_truth: bool) -> &'static str {
    match (compared, has_truth) {
        (Compared::FormedBlur, _) => "formed blur",
        (Compared::Sharp, true) => "sharp truth",
        (Compared::Sharp, false) => PHOTO,
    }
}

/// The `count` views of a split in words.
pub fn described_split(split: &str, count: usize) -> String {
    match split {
        "test" => counted(count, "held-out view"),
        "train" => counted(count, "training view"),
        other => format!("{} of the split {other}", counted(count, "view")),
    }
}

/// PSNR and SSIM over the pixels at which `inside`, `[H, W, 1]`, is 1; `None` without such a pixel. The windows of SSIM
/// see the pixels around these too. MS-SSIM and LPIPS look at neighbourhoods that are larger than a region.
pub fn scores_within(image: Tensor<3>, truth: Tensor<3>, inside: Tensor<3>) -> Option<Scores> {
    let ssim = ssim_masked(image.clone(), truth.clone(), inside.clone())?;
    Some(Scores { psnr: psnr_masked(image, truth, inside), ssim, ms_ssim: None, lpips: None })
}

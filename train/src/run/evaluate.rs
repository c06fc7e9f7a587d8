//! Measurement of a scene: held-out views are rendered and compared.

use std::borrow::Cow;

use burn::tensor::{Device, Tensor};
use gs_burn::Gaussians;
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;

use super::measured::{Measured, ModelSize, Quality, Scores, ViewScores};
use super::metrics::color_fit::psnr_after_color_fit;
use super::metrics::{self, Perceptual, ms_ssim, mse_of_psnr, psnr, psnr_masked, psnr_of_mse, ssim, ssim_masked};
use crate::config::EvalConfig;
use crate::fit::align::aligned;
use crate::fit::camera_paths::CameraPaths;
use crate::fit::correction::Correction;
use crate::fit::figure::{Better, Figure};
use crate::fit::method::Step;
use crate::fit::photos::{Photo, Photos, to_tensor};
use crate::fit::saved::Saved;
use crate::fit::times::{TIMES_AT_ONCE, by_time};
use crate::fit::told::{Compared, Region, Told, given_regions};
use crate::fit::trainer::Model;
use crate::run::resources::release_freed_memory;

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

    /// The regions of view `index`, which has its pixels: those given, where it has them only when it is asked for.
    fn regions_of(&self, index: usize, view: &View) -> Cow<'_, [Region]> {
        match self.views[index].source {
            Some(_) => Cow::Owned(given_regions(view)),
            None => Cow::Borrowed(&self.regions[index]),
        }
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

/// Most views, spread evenly, whose poses are looked for: each takes as long as 60 steps of training.
const ALIGNED: usize = 12;

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
        let (quality, Further { fitted, aligned }, comparisons) = self.quality(model, scene, held_out, at, kept);
        let (method, gaussians) = (&model.method, &model.gaussians);
        let mut figures = method.figures(gaussians, scene, held_out.views, at);
        figures.numbers.extend(model.cameras.iter().flat_map(|it| of_poses(it, &aligned)));
        figures.numbers.extend(model.correction.iter().flat_map(|it| of_correction(it, &fitted)));
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
        data: &Scene,
        held_out: &HeldOut,
        at: &Step<M>,
        kept: usize,
    ) -> (Quality, Further, Vec<Comparison>) {
        let (scene, blur) = (model.method.scene(model.gaussians.clone()), M::blur());
        let views = held_out.views;
        let keep_every = views.len().div_ceil(kept.clamp(1, views.len().max(1))).max(1);
        let mut photos = Photos::plain(views, &self.device).within(at.facts.region);
        let (mut scores, mut comparisons, mut compared) = (Vec::new(), Vec::new(), Compared::Sharp);
        let (mut further, mut has_truth) = (Further::default(), false);
        for together in by_time(views).chunks(TIMES_AT_ONCE) {
            let times: Vec<f64> = together.iter().map(|(time, _)| *time).collect();
            let mut shared: Option<Vec<Gaussians>> = None;
            for (at_time, (_, indices)) in together.iter().enumerate() {
                for index in indices.iter().copied() {
                    let view = &views[index];
                    let color = model.correction.as_ref().and_then(|it| it.near(view, &data.train));
                    let shown = photos.view(index);
                    photos.prefetch((index + 1..views.len()).take(1));
                    let photo = Photo { color, ..photos.of(&shown, index) };
                    has_truth |= shown.truth.blurry.is_some();
                    let formed = blur.and_then(|blur| blur.formed(&model.method, &model.gaussians, view, at));
                    let image = match formed {
                        Some(formed) => {
                            compared = Compared::FormedBlur;
                            formed
                        }
                        None => {
                            let gaussians = &shared.get_or_insert_with(|| scene.at_times(&times))[at_time];
                            let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
                            gs_burn::render(gaussians, &photo.camera, &options).color
                        }
                    };
                    let image = photo.taken(image).clamp(0.0, 1.0);
                    let Some(whole) = self.scores(image.clone(), photo.image.clone(), photo.mask.clone()) else {
                        tracing::warn!(view = view.name, "no pixel counts: the view is not measured");
                        continue;
                    };
                    if model.correction.is_some() {
                        let (image, truth) = (image.clone(), photo.image.clone());
                        further.fitted.extend(psnr_after_color_fit(image, truth, photo.mask.clone()));
                    }
                    if model.cameras.is_some() && index % views.len().div_ceil(ALIGNED) == 0 {
                        further.aligned.extend(self.aligned(&*scene, &photo, view, at));
                    }
                    let regions = held_out.regions_of(index, &shown);
                    let regions = regions.iter().filter_map(|region| {
                        let scores = self.region(image.clone(), &photo, view, region)?;
                        Some((region.name.to_string(), scores))
                    });
                    let regions = regions.collect();
                    if kept > 0 && index % keep_every == 0 {
                        comparisons.push((index, self.comparison(&shown, photo, image, whole.psnr)));
                    }
                    scores.push((index, ViewScores { name: view.name.clone(), scores: whole, regions }));
                }
            }
        }
        scores.sort_by_key(|(index, _)| *index);
        comparisons.sort_by_key(|(index, _)| *index);
        let scores = scores.into_iter().map(|(_, scores)| scores).collect();
        let comparisons = comparisons.into_iter().map(|(_, comparison)| comparison).collect();
        let summary = self.summary(scores, described_comparison(compared, has_truth));
        let regions_inferred = !summary.regions.is_empty() && held_out.has_inferred();
        (Quality { regions_inferred, ..summary }, further, comparisons)
    }

    /// The scores of a view from the pose that its photo speaks for; `None` where no pixel counts.
    fn aligned<M: Told>(
        &self,
        scene: &dyn DynamicScene,
        photo: &Photo<()>,
        view: &View,
        at: &Step<M>,
    ) -> Option<Scores> {
        let gaussians = scene.at(view.time.unwrap_or(0.0));
        let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
        let camera = aligned(&gaussians, photo, &options, at.facts.distance());
        let image = photo.taken(gs_burn::render(&gaussians, &camera, &options).color).clamp(0.0, 1.0);
        self.scores(image, photo.image.clone(), photo.mask.clone())
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
        let mean = mean_scores(views.iter().map(|view| &view.scores)).unwrap_or_default();
        let mut names: Vec<&String> = views.iter().flat_map(|view| view.regions.keys()).collect();
        names.sort();
        names.dedup();
        let of = |name: &String| mean_scores(views.iter().filter_map(|view| view.regions.get(name)));
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

/// Figures of views beside the scores by which they are compared.
#[derive(Default)]
struct Further {
    /// PSNR after a fit of colours.
    fitted: Vec<f64>,
    /// Scores from poses that the photos speak for.
    aligned: Vec<Scores>,
}

/// Figures of the cameras' paths, and of held-out views from poses of their own.
fn of_poses(cameras: &CameraPaths, aligned: &[Scores]) -> Vec<Figure> {
    let lengths = cameras.listed().iter().map(|(_, path)| path.length()).collect();
    let length = gs_base::median(lengths)
        .filter(|length| *length > 0.0)
        .map(|length| Figure::new("camera_path", "median path of a camera", length, "pixels").digits(1).column());
    let better = |id, name, value, unit| Figure::new(id, name, value, unit).better(Better::Higher).headline();
    let aligned = mean_scores(aligned.iter()).map(|Scores { psnr, ssim, .. }| {
        [
            better("psnr_aligned", "PSNR from aligned poses", psnr, "dB").digits(2),
            better("ssim_aligned", "SSIM from aligned poses", ssim, "").digits(4),
        ]
    });
    let readout =
        cameras.readout().map(|readout| Figure::new("readout", "readout", readout, "exposures").digits(2).headline());
    aligned.into_iter().flatten().chain(length).chain(readout).collect()
}

/// Figures of the photos' corrections; `fitted`: PSNR of views after a fit of colours.
fn of_correction(correction: &Correction, fitted: &[f64]) -> Vec<Figure> {
    let spread = Figure::new("gains_spread", "differences in exposure", 100.0 * correction.spread(), "%");
    let fitted = metrics::mean(fitted.iter().copied()).map(|mean| {
        let figure = Figure::new("psnr_after_color_fit", "PSNR after a fit of colours", mean, "dB");
        figure.digits(2).better(Better::Higher).headline()
    });
    fitted.into_iter().chain([spread.digits(1).column()]).collect()
}

/// PSNR of the mean over views of the squared error, dB; 0 without a view.
fn psnr_of_mean_error(views: &[ViewScores]) -> f64 {
    metrics::mean(views.iter().map(|view| mse_of_psnr(view.scores.psnr))).map_or(0.0, psnr_of_mse)
}

/// The mean of each score that all views have; `None` without a view.
fn mean_scores<'a>(scores: impl Iterator<Item = &'a Scores> + Clone) -> Option<Scores> {
    let of = |value: fn(&Scores) -> Option<f64>| -> Option<f64> {
        metrics::mean(scores.clone().map(value).collect::<Option<Vec<f64>>>()?)
    };
    Some(Scores {
        psnr: of(|scores| Some(scores.psnr))?,
        ssim: of(|scores| Some(scores.ssim))?,
        ms_ssim: of(|scores| scores.ms_ssim),
        lpips: of(|scores| scores.lpips),
    })
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

/// PSNR and SSIM over the pixels at which `inside`, `[H, W, 1]`, is 1; `None` without such a pixel. The windows of SSIM
/// see the pixels around these too. MS-SSIM and LPIPS look at neighbourhoods that are larger than a region.
pub fn scores_within(image: Tensor<3>, truth: Tensor<3>, inside: Tensor<3>) -> Option<Scores> {
    let ssim = ssim_masked(image.clone(), truth.clone(), inside.clone())?;
    Some(Scores { psnr: psnr_masked(image, truth, inside), ssim, ms_ssim: None, lpips: None })
}

//! How good the scene is: every held-out view rendered and measured.

use gs_burn::{Gaussians, render};
use gs_datasets::View;
use gs_models::Motion;
use serde::{Deserialize, Serialize};

use burn::tensor::Tensor;

use crate::data::{Photo, Photos, to_tensor};
use crate::experiment::Config;
use crate::metrics::{Perceptual, ms_ssim, psnr, psnr_masked, ssim};
use crate::taylormode::measure::MotionScores;

/// When and how the result is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvalConfig {
    /// Steps after which the held-out views are measured; the last step always is.
    pub at: Vec<usize>,
    /// Held-out views kept as side-by-side pictures at the end.
    pub images: usize,
    /// Whether MS-SSIM is measured (some seconds a view on a CPU).
    pub ms_ssim: bool,
    /// Whether LPIPS is measured where Burn's cache has its weights.
    pub lpips: bool,
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self { at: Vec::new(), images: 4, ms_ssim: true, lpips: true }
    }
}

/// The figures of one view or the mean of several.
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

/// One view's figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewScores {
    /// The view's name.
    pub name: String,
    /// Its figures.
    #[serde(flatten)]
    pub scores: Scores,
    /// The same over moving pixels alone, where the data set says which they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<Scores>,
}

/// The scene measured after a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Steps taken.
    pub step: usize,
    /// "test" for held-out views; "train" where none are held out, which says little about new views.
    pub split: String,
    /// The mean over views.
    #[serde(flatten)]
    pub mean: Scores,
    /// The mean over the moving pixels of views that have some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<Scores>,
    /// Blur, velocities, exposure and what motion costs; `None` in a static scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionScores>,
    /// The network of LPIPS: "vgg", "alex" or "squeeze".
    pub lpips_network: Option<String>,
    /// Why LPIPS is missing.
    pub lpips_reason: Option<String>,
    /// Why MS-SSIM is missing.
    pub ms_ssim_reason: Option<String>,
    /// Gaussians.
    pub gaussians: usize,
    /// Bytes of their parameters, as f32.
    pub bytes: usize,
    /// Training time so far, seconds, measuring and saving left out.
    pub seconds: f64,
    /// Processor time of training so far, seconds, all threads together; `None` where the system does not say.
    pub cpu_seconds: Option<f64>,
    /// Largest resident memory so far, bytes; `None` where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// Each view.
    pub views: Vec<ViewScores>,
}

/// Measures a scene. LPIPS weights are looked for once.
#[derive(Debug)]
pub struct Evaluator {
    perceptual: Result<Perceptual, String>,
    ms_ssim: bool,
}

/// A view's truth and rendering, `[H, W, 3]` from 0 to 1.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// The view's name.
    pub name: String,
    /// The photo.
    pub truth: Tensor<3>,
    /// The rendering.
    pub image: Tensor<3>,
    /// `[H, W, 1]`: 0 where the photo says nothing; `None` when every pixel counts.
    pub mask: Option<Tensor<3>>,
    /// The blurry photo, where the truth is sharp and both are known, `[H, W, 3]`.
    pub blurry: Option<Tensor<3>>,
    /// The rendering's PSNR, dB.
    pub psnr: f64,
}

impl Evaluator {
    /// An evaluator for tensors on `device`.
    pub fn new(config: &EvalConfig, device: &burn::tensor::Device) -> Self {
        let perceptual = match config.lpips {
            true => Perceptual::from_cache(device),
            false => Err("no LPIPS: switched off (eval.lpips = false)".into()),
        };
        Self { perceptual, ms_ssim: config.ms_ssim }
    }

    /// Renders and measures every view; the pictures of `kept` views spread over all are returned too. Fields about the run
    /// (step, time, memory) are left for the caller.
    pub fn evaluate(
        &self,
        model: &dyn Motion,
        photos: &mut Photos,
        config: &Config,
        kept: usize,
    ) -> (Evaluation, Vec<Comparison>) {
        let views = photos.views();
        let keep_every = views.len().div_ceil(kept.clamp(1, views.len().max(1))).max(1);
        let (mut scores, mut comparisons) = (Vec::new(), Vec::new());
        for (index, view) in views.iter().enumerate() {
            let gaussians = model.at(view.time.unwrap_or(0.0));
            let photo = photos.get(index);
            let image = render_view(&gaussians, &photo, config);
            let Some(measured) = self.measure(image.clone(), photo.image.clone(), photo.mask.clone()) else {
                tracing::warn!(view = view.name, "no pixel counts: the view is not measured");
                continue;
            };
            let moving = self.measure_moving(image.clone(), &photo, view);
            if kept > 0 && index % keep_every == 0 {
                let (psnr, device) = (measured.psnr, image.device());
                comparisons.push(Comparison {
                    name: view.name.clone(),
                    truth: photo.image,
                    image,
                    mask: photo.mask,
                    blurry: view.truth.blurry.as_ref().map(|blurry| to_tensor(view, &blurry.data, 3, &device)),
                    psnr,
                });
            }
            scores.push(ViewScores { name: view.name.clone(), scores: measured, moving });
        }
        let gaussians = model.at(0.0);
        (self.summarise(scores, &gaussians), comparisons)
    }

    /// The scores over the pixels at which `counts`, `[H, W, 1]`, is 1; `None` without such a pixel. Others are black in both images for
    /// the measures that look at neighbourhoods.
    fn measure(&self, image: Tensor<3>, truth: Tensor<3>, counts: Option<Tensor<3>>) -> Option<Scores> {
        let share = counts.as_ref().map_or(1.0, |counts| f64::from(counts.clone().mean().into_scalar::<f32>()));
        if share == 0.0 {
            return None;
        }
        let (psnr, image, truth) = match counts {
            None => (psnr(image.clone(), truth.clone()), image, truth),
            Some(counts) => {
                let psnr = psnr_masked(image.clone(), truth.clone(), counts.clone());
                (psnr, image * counts.clone(), truth * counts)
            }
        };
        Some(Scores {
            psnr,
            ssim: ssim_of_share(image.clone(), truth.clone(), share),
            ms_ssim: self.ms_ssim.then(|| ms_ssim(image.clone(), truth.clone())).flatten(),
            lpips: self.perceptual.as_ref().ok().map(|network| network.distance(image, truth)),
        })
    }

    /// The scores over the pixels that count and where something truly moves (the paper's dynamic region); `None` where that is not
    /// known or nothing does.
    fn measure_moving(&self, image: Tensor<3>, photo: &Photo, view: &View) -> Option<Scores> {
        let moving = view.truth.moving.as_ref().or(view.priors.moving.as_ref())?;
        let moving = to_tensor(view, moving, 1, &image.device());
        let counts = photo.mask.iter().fold(moving, |moving, mask| moving * mask.clone());
        Some(Scores { ms_ssim: None, ..self.measure(image, photo.image.clone(), Some(counts))? })
    }

    fn summarise(&self, views: Vec<ViewScores>, gaussians: &Gaussians) -> Evaluation {
        let mean = |value: &dyn Fn(&Scores) -> Option<f64>| -> Option<f64> {
            let values: Option<Vec<f64>> = views.iter().map(|view| value(&view.scores)).collect();
            values.filter(|values| !values.is_empty()).map(|values| values.iter().sum::<f64>() / values.len() as f64)
        };
        let mean = Scores {
            psnr: mean(&|scores| Some(scores.psnr)).unwrap_or(0.0),
            ssim: mean(&|scores| Some(scores.ssim)).unwrap_or(0.0),
            ms_ssim: mean(&|scores| scores.ms_ssim),
            lpips: mean(&|scores| scores.lpips),
        };
        let coefficients = gaussians.sh.val().dims()[1];
        let ms_ssim_reason = match (mean.ms_ssim, self.ms_ssim) {
            (Some(_), _) => None,
            (None, true) => Some("no MS-SSIM: an image side is under 176 pixels".into()),
            (None, false) => Some("no MS-SSIM: switched off (eval.ms_ssim = false)".into()),
        };
        Evaluation {
            step: 0,
            split: "test".into(),
            mean,
            moving: mean_moving(&views),
            motion: None,
            lpips_network: self.perceptual.as_ref().ok().map(|network| network.name.into()),
            lpips_reason: self.perceptual.as_ref().err().cloned(),
            ms_ssim_reason,
            gaussians: gaussians.len(),
            bytes: 4 * gaussians.len() * (11 + 3 * coefficients),
            seconds: 0.0,
            cpu_seconds: None,
            peak_memory_bytes: None,
            views,
        }
    }
}

fn mean_moving(views: &[ViewScores]) -> Option<Scores> {
    let moving: Vec<&Scores> = views.iter().filter_map(|view| view.moving.as_ref()).collect();
    let count = moving.len() as f64;
    let lpips: Option<Vec<f64>> = moving.iter().map(|scores| scores.lpips).collect();
    (!moving.is_empty()).then(|| Scores {
        psnr: moving.iter().map(|scores| scores.psnr).sum::<f64>() / count,
        ssim: moving.iter().map(|scores| scores.ssim).sum::<f64>() / count,
        ms_ssim: None,
        lpips: lpips.map(|values| values.iter().sum::<f64>() / count),
    })
}

/// One view rendered as `config` says, `[H, W, 3]`, clamped to 0 to 1.
fn render_view(gaussians: &Gaussians, photo: &Photo, config: &Config) -> Tensor<3> {
    let options = config.render.options(gaussians.sh_degree(), config.data.background.color());
    render(gaussians, &photo.camera, &options).color.clamp(0.0, 1.0)
}

impl Evaluation {
    /// The figures in one line.
    pub fn line(&self) -> String {
        let optional = |name: &str, value: Option<f64>| value.map_or(String::new(), |v| format!(", {name} {v:.4}"));
        format!(
            "step {}: PSNR {:.2} dB, SSIM {:.4}{}{}{} over {} {} views; {} Gaussians, {:.1} s",
            self.step,
            self.mean.psnr,
            self.mean.ssim,
            optional("MS-SSIM", self.mean.ms_ssim),
            optional("LPIPS", self.mean.lpips),
            self.moving.as_ref().map_or(String::new(), |scores| format!(", moving parts {:.2} dB", scores.psnr)),
            self.views.len(),
            if self.split == "test" { "held-out" } else { "training" },
            self.gaussians,
            self.seconds
        )
    }
}

/// SSIM of the `share` of the pixels that a mask kept, where both images are black outside of it: SSIM is 1 there, but for windows (of
/// 11 pixels) that reach into the mask. What differs in those counts against the mask, so the value is that of the mask or lower.
fn ssim_of_share(image: Tensor<3>, truth: Tensor<3>, share: f64) -> f64 {
    1.0 - (1.0 - ssim(image, truth)) / share.max(f64::MIN_POSITIVE)
}

//! A measurement: the scores of views and regions, the size of the scene, its cost.

use std::collections::BTreeMap;

use gs_base::counted;
use serde::{Deserialize, Serialize};

use super::metrics::{is_of_equal_images, shown_psnr};
use crate::fit::figure::{Figure, FigureTable, Prominence};
use crate::fit::told::MOVING;

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

/// The `count` views of a split in words.
pub fn described_split(split: &str, count: usize) -> String {
    match split {
        "test" => counted(count, "held-out view"),
        "train" => counted(count, "training view"),
        other => format!("{} of the split {other}", counted(count, "view")),
    }
}

//! `[data]`: which parts of a data set are loaded, and how.

use std::path::PathBuf;

use gs_datasets::{DepthKind, Holdout, LoadOptions, MaskUse, PoseConvention, PriorUse, RowOrder, SparseViews};
use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check};

/// The choice of held-out views.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HoldoutChoice {
    /// The data set's own split. A data set without one holds out one of 8 static cameras that film, or every 8th view.
    Dataset,
    /// Every `holdout_every`-th view by name.
    Every,
    /// The views of `holdout_names`.
    Names,
    /// No view; the result is then measured on training views.
    None,
}

/// The use of mask files.
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
    /// Masks are white where something moves.
    Moving,
}

/// A kind of prior: an estimate that another program made from the photos.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PriorKind {
    /// Depth maps.
    Depth,
    /// Masks of moving objects.
    Masks,
    /// Pseudo-sharp photos.
    Sharp,
}

/// The meaning of the values in depth files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DepthChoice {
    /// As the data set says.
    Auto,
    /// Camera z in scene units.
    #[serde(alias = "metric_z")]
    MetricZ,
    /// Camera z, up to a scale and a shift per photo.
    Depth,
    /// One over camera z, up to a scale and a shift per photo.
    #[serde(alias = "inverse_depth")]
    InverseDepth,
}

/// The order of an LLFF set's files that goes with the rows of its poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowChoice {
    /// Names as text, or by number where the cameras' path is then half as long or less.
    Auto,
    /// Names as text: "IMG_10" before "IMG_2".
    Text,
    /// By the numbers in names.
    Number,
}

/// The colour behind the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected \"auto\" or three numbers from 0 to 1")]
pub enum Background {
    /// A colour, 0 to 1 per channel.
    Color([f32; 3]),
    /// Estimated from the photos.
    Found(Auto),
}

/// The value "auto".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Auto {
    /// As stated by the data set, or estimated from it.
    Auto,
}

impl Background {
    /// The colour; black until one is estimated.
    pub fn color(self) -> [f32; 3] {
        match self {
            Self::Color(color) => color,
            Self::Found(Auto::Auto) => [0.0; 3],
        }
    }
}

/// The value of `data.poses` that goes by the format.
const AUTO: &str = "auto";

/// The value of `data.levels` that changes nothing.
const FULL_RANGE: [f64; 2] = [0.0, 1.0];

/// Options for reading the data set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataConfig {
    /// Wider photos are downscaled to this width, pixels; 0 keeps the full size.
    pub max_width: usize,
    /// The choice of held-out views.
    pub holdout: HoldoutChoice,
    /// Every so many views one is held out, for `holdout = "every"`.
    pub holdout_every: usize,
    /// The views held out, by name or file stem, for `holdout = "names"`.
    pub holdout_names: Vec<String>,
    /// Cameras that train; 0: by `holdout`. With fewer than the data set has, the others are held out: `validation_cameras` of them, of which
    /// about half lie between training cameras and half outside.
    pub train_cameras: usize,
    /// Cameras that are held out, for `train_cameras` above 0 or `seen` below 1.
    pub validation_cameras: usize,
    /// Share of the recording that is seen, for data sets without a list of future frames; later frames are held out. 1: all of it.
    pub seen: f64,
    /// Image folder of a COLMAP model, an LLFF or a RealityScan set if it is not a usual one; empty: found
    /// automatically.
    pub images: String,
    /// The convention of the poses: "auto" is the format's own; `c2w-` (camera to world) or `w2c-`, then `opencv`,
    /// `opengl` or the directions of the camera's three axes, as in `c2w-right-down-forward`.
    pub poses: String,
    /// Factor on the coordinates of the points to start from, for points in another unit than the poses.
    pub points_scale: f64,
    /// The order of the files of an LLFF set.
    pub row_order: RowChoice,
    /// The levels that become black and white, as shares of the photos' full range, for photos that use little of it.
    pub levels: [f64; 2],
    /// Colour behind the scene and behind transparent pixels.
    pub background: Background,
    /// The use of mask files.
    pub masks: MaskChoice,
    /// Priors that are read if the data set has them: "depth", "masks", "sharp". A static scene reads masks alone, to measure
    /// moving parts.
    pub priors: Vec<PriorKind>,
    /// Meaning of depth files; "auto" uses the meaning that the data set states.
    pub depth_kind: DepthChoice,
    /// Share of the run in which photos are compared at a reduced width, 0 to 1: a half, or a quarter and then a half where a quarter still
    /// has 200 pixels, for at most 210 steps; photos of fewer than 400 pixels width stay as they are. 0: never.
    pub coarse_share: f64,
    /// Photos are kept as floats up to this many MB in all; the others are converted from 8 bits in each step.
    pub cache_mb: usize,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            max_width: 0,
            holdout: HoldoutChoice::Dataset,
            holdout_every: gs_datasets::DEFAULT_HOLDOUT,
            holdout_names: Vec::new(),
            train_cameras: 0,
            validation_cameras: 5,
            seen: 1.0,
            images: String::new(),
            poses: AUTO.into(),
            points_scale: 1.0,
            row_order: RowChoice::Auto,
            levels: FULL_RANGE,
            background: Background::Found(Auto::Auto),
            masks: MaskChoice::Auto,
            priors: vec![PriorKind::Depth, PriorKind::Masks, PriorKind::Sharp],
            depth_kind: DepthChoice::Auto,
            coarse_share: 0.07,
            cache_mb: 64,
        }
    }
}

impl DataConfig {
    /// The same choices as options of the readers.
    pub fn options(&self) -> LoadOptions {
        LoadOptions {
            max_width: (self.max_width > 0).then_some(self.max_width),
            background: self.background.color(),
            holdout: match self.holdout {
                HoldoutChoice::Dataset => Holdout::Dataset,
                HoldoutChoice::Every => Holdout::Every(self.holdout_every),
                HoldoutChoice::Names => Holdout::Names(self.holdout_names.clone()),
                HoldoutChoice::None => Holdout::None,
            },
            sparse: (self.train_cameras > 0 || self.seen < 1.0).then_some(SparseViews {
                train: self.train_cameras,
                validation: self.validation_cameras,
                seen: self.seen,
            }),
            images: (!self.images.is_empty()).then(|| PathBuf::from(&self.images)),
            masks: match self.masks {
                MaskChoice::Auto => MaskUse::Auto,
                MaskChoice::Ignore => MaskUse::Ignore,
                MaskChoice::KeepWhite => MaskUse::KeepWhite,
                MaskChoice::KeepBlack => MaskUse::KeepBlack,
                MaskChoice::Moving => MaskUse::Moving,
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
            poses: self.poses.parse().ok(),
            points_scale: self.points_scale,
            row_order: match self.row_order {
                RowChoice::Auto => RowOrder::Auto,
                RowChoice::Text => RowOrder::Text,
                RowChoice::Number => RowOrder::Number,
            },
            levels: (self.levels != FULL_RANGE).then_some(self.levels),
            ..LoadOptions::default()
        }
    }

    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("data.holdout_every", self.holdout_every, self.holdout_every >= 2, "at least 2")?;
        let named = self.holdout != HoldoutChoice::Names || !self.holdout_names.is_empty();
        check("data.holdout_names", "[]", named, "a list of view names when data.holdout = \"names\"")?;
        check("data.seen", self.seen, self.seen > 0.0 && self.seen <= 1.0, "above 0 and at most 1")?;
        check("data.coarse_share", self.coarse_share, (0.0..=1.0).contains(&self.coarse_share), "from 0 to 1")?;
        let is_known = self.poses == AUTO || self.poses.parse::<PoseConvention>().is_ok();
        check("data.poses", &self.poses, is_known, "auto, or as c2w-opencv, w2c-opengl, c2w-right-down-forward")?;
        let scale = self.points_scale;
        check("data.points_scale", scale, scale > 0.0 && scale.is_finite(), "above 0")?;
        let [black, white] = self.levels;
        let ordered = (0.0..1.0).contains(&black) && white > black && white <= 1.0;
        check("data.levels", format!("{:?}", self.levels), ordered, "two shares, 0 <= black < white <= 1")?;
        let color = self.background.color();
        let in_range = color.iter().all(|c| (0.0..=1.0).contains(c));
        check("data.background", format!("{color:?}"), in_range, "three numbers from 0 to 1")
    }
}

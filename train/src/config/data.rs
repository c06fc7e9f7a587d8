//! `[data]`: which parts of a data set are loaded, and how.

use std::path::PathBuf;

use gs_datasets::{DepthKind, Holdout, LoadOptions, MaskUse, PoseConvention, PriorUse, RowOrder, SparseViews};
use serde::{Deserialize, Serialize};

use super::declare::Declared;
use super::error::{ConfigError, check};
use super::ranges::{NOT_NEGATIVE, Only, SHARE, is_box};
use crate::{choice, section};

choice! {
    /// The choice of held-out views.
    pub enum HoldoutChoice {
        /// The data set's own split; without one, one of 8 static cameras that film, or every 8th view.
        Dataset,
        /// Every `holdout_every`-th view by name.
        Every,
        /// The views of `holdout_names`.
        Names,
        /// No view; training views are measured.
        None,
    }
}

choice! {
    /// The use of mask files.
    pub enum MaskChoice {
        /// By the rules of the data set's format.
        Auto,
        /// No mask is read.
        Ignore,
        /// White is kept.
        KeepWhite,
        /// Black is kept.
        KeepBlack,
        /// White moves.
        Moving,
    }
}

choice! {
    /// A kind of prior: an estimate that another program made from the photos.
    pub enum PriorKind {
        /// Depth maps.
        Depth,
        /// Masks of moving objects.
        Masks,
        /// Pseudo-sharp photos.
        Sharp,
    }
}

choice! {
    /// The meaning of the values in depth files.
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
}

choice! {
    /// The order of an LLFF set's files that goes with the rows of its poses.
    pub enum RowChoice {
        /// By number where the cameras' path is then half as long or less, else as text.
        Auto,
        /// As text: "IMG_10" before "IMG_2".
        Text,
        /// By the numbers in names.
        Number,
    }
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

choice! {
    /// The value "auto".
    pub enum Auto {
        /// As stated by the data set, or estimated from it.
        Auto,
    }
}

impl Declared for Background {}

impl Background {
    /// The colour; black until one is estimated.
    pub fn color(self) -> [f32; 3] {
        match self {
            Self::Color(color) => color,
            Self::Found(Auto::Auto) => [0.0; 3],
        }
    }

    fn is_in_range(&self) -> bool {
        self.color().iter().all(|channel| (0.0..=1.0).contains(channel))
    }
}

/// The value of `data.poses` that goes by the format.
const AUTO: &str = "auto";

/// The value of `data.levels` that changes nothing.
const FULL_RANGE: [f64; 2] = [0.0, 1.0];

section! {
    /// Options for reading the data set.
    pub struct DataConfig {
        /// Width to which wider photos are downscaled, pixels; 0: full size.
        max_width: usize = 0;
        /// The choice of held-out views.
        holdout: HoldoutChoice = HoldoutChoice::Dataset;
        /// One of so many views is held out, for `holdout = "every"`.
        holdout_every: usize = gs_datasets::DEFAULT_HOLDOUT, in 2..;
        /// Views held out, by name or file stem, for `holdout = "names"`.
        holdout_names: Vec<String> = Vec::new();
        /// Cameras that train; 0: by `holdout`. Of the others `validation_cameras` are held out, about half of them
        /// between training cameras.
        train_cameras: usize = 0;
        /// Cameras held out, for `train_cameras` above 0 or `seen` below 1.
        validation_cameras: usize = 5;
        /// Share of the recording that is seen, for data sets without a list of future frames; later frames are held
        /// out.
        seen: f64 = 1.0, in Only("above 0 and at most 1", |share| *share > 0.0 && *share <= 1.0);
        /// Image folder of a COLMAP, LLFF or RealityScan set if it is not a usual one; empty: found automatically.
        images: String = String::new();
        /// Frames a second of a video whose photos have no times: these are the numbers in their names over it. 0:
        /// none.
        fps: f64 = 0.0, in NOT_NEGATIVE;
        /// Convention of the poses: "auto" is the format's own, or what photos speak for; else `c2w-` or `w2c-`, then
        /// `opencv`, `opengl` or three axes, as in `c2w-right-down-forward`.
        poses: String = AUTO.into(),
            in Only("auto, or as c2w-opencv, w2c-opengl, c2w-right-down-forward", is_convention);
        /// Factor on the first points' coordinates.
        points_scale: f64 = 1.0, in Only("above 0", |scale: &f64| *scale > 0.0 && scale.is_finite());
        /// The order of the files of an LLFF set.
        row_order: RowChoice = RowChoice::Auto;
        /// Levels that become black and white, shares of the full range, for photos that use little of it; of photos
        /// in linear light, shares of 1, and white may be above.
        levels: [f64; 2] = FULL_RANGE, in Only("two shares, 0 <= black < 1 and black < white", are_levels);
        /// Colour behind the scene and behind transparent pixels.
        background: Background = Background::Found(Auto::Auto),
            in Only("three numbers from 0 to 1", Background::is_in_range);
        /// The use of mask files.
        masks: MaskChoice = MaskChoice::Auto;
        /// A box in the data set's world, for `static`: pixels whose rays miss it do not count, and `export` writes the
        /// Gaussians inside. Gaussians that only such pixels show fade, also those of `init.scene`. Empty: everywhere.
        region: Vec<f64> = Vec::new(),
            in Only("[] or a box [x0, y0, z0, x1, y1, z1] with x0 < x1, y0 < y1, z0 < z1", is_region);
        /// Priors that are read. A static scene reads no pseudo-sharp photos, and masks only to measure moving parts.
        priors: Vec<PriorKind> = vec![PriorKind::Depth, PriorKind::Masks, PriorKind::Sharp];
        /// Meaning of depth files.
        depth_kind: DepthChoice = DepthChoice::Auto;
        /// Share of the run in which photos have half their width (a quarter first, from 200 pixels on), for at most
        /// 70 steps and from 400 pixels on. 0: never.
        coarse_share: f64 = 0.07, in SHARE;
        /// Memory for photos, MB. Those of a static scene that take more are decoded when they are asked for, and at
        /// most 128 of them are looked at before training.
        memory_mb: usize = 4096;
        /// Photos kept as floats, MB in all; the others are converted from 8 bits in each step.
        cache_mb: usize = 64;
    }
    also check_names;
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
            fps: (self.fps > 0.0).then_some(self.fps),
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
}

#[allow(clippy::ptr_arg)] // the type of the key
fn is_region(region: &Vec<f64>) -> bool {
    region.is_empty() || is_box(region)
}

fn is_convention(poses: &String) -> bool {
    poses == AUTO || poses.parse::<PoseConvention>().is_ok()
}

fn are_levels([black, white]: &[f64; 2]) -> bool {
    (0.0..1.0).contains(black) && white > black && white.is_finite()
}

fn check_names(data: &DataConfig) -> Result<(), ConfigError> {
    let named = data.holdout != HoldoutChoice::Names || !data.holdout_names.is_empty();
    check("data.holdout_names", "[]", named, "a list of view names when data.holdout = \"names\"")
}

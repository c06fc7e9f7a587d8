//! Choices of the user about loading: [`LoadOptions`].

use std::path::PathBuf;

use crate::convention::PoseConvention;

/// The views that are held out of training. Except by [`Holdout::Dataset`], they are held out as
/// [`Split::TEST`](crate::Split::TEST).
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Holdout {
    /// Every n-th of all views sorted by name, beginning with the first (index % n == 0).
    Every(usize),
    /// The data set's own split where it has one, otherwise one camera in 8 of static cameras that film, or every 8th
    /// view.
    ///
    /// A split of its own is transforms_test.json and transforms_val.json, or the lists `test_filenames` and
    /// `val_filenames` of nerfstudio. Beside `train_filenames` any other list `NAME_filenames` holds its frames out
    /// under its name.
    Dataset,
    /// These views, by file stem ("0012") or whole name ("images/0012"); each must exist.
    Names(Vec<String>),
    /// None: all views train.
    None,
}

/// The held-out splits that are loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SplitUse {
    /// All of them.
    All,
    /// The one that figures are quoted on ([`Scene::reported`](crate::Scene::reported)). Views of other lists are left
    /// out, as if the data set did not have them. A D-NeRF set has 20 validation and 20 test views beside 50 to 200
    /// training views, and a view of 800 x 800 pixels is 2 MB.
    Reported,
}

/// The cameras that train, those that are held out, and the times that are seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SparseViews {
    /// Cameras that train; 0: all that the data set's split trains on.
    pub train: usize,
    /// Cameras that are held out, at most; about half of them look from between training cameras.
    pub validation: usize,
    /// Share of the recording that is seen, above 0 and at most 1. A data set with a list of later frames keeps its own
    /// last time.
    pub seen: f64,
}

impl Default for SparseViews {
    fn default() -> Self {
        Self { train: 5, validation: 7, seen: 1.0 }
    }
}

/// The literature's held-out share for photo sets without a split of their own (Mip-NeRF 360 and everything after it).
pub const DEFAULT_HOLDOUT: usize = 8;

/// How mask files are used. White means any pixel that is not black.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaskUse {
    /// By the rules of the format: `mask_path` (nerfstudio) and COLMAP's `masks` folder ignore where black;
    /// instant-ngp's `dynamic_mask_<stem>.png` ignores where white. A transforms.json that says `"mask_meaning":
    /// "dynamic"` marks moving objects, and so do the masks of a Panoptic set (`seg`): they become
    /// [`Priors::moving`](crate::Priors::moving), and every pixel counts. So do, with a warning, masks without a stated
    /// meaning in a set with `exposure`, and a `masks` folder that no frame of a set with times names.
    Auto,
    /// No mask file is read.
    Ignore,
    /// `mask_path` and `masks` files mark moving objects in white, whatever `mask_meaning` says.
    Moving,
    /// `mask_path` and `masks` files keep what is white, whatever `mask_meaning` says.
    KeepWhite,
    /// `mask_path` and `masks` files keep what is black: for masks of moving objects in a static reconstruction.
    KeepBlack,
}

/// The priors that are read where a data set has them. Truth is always read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PriorUse {
    /// [`Priors::depth`](crate::Priors::depth).
    pub depth: bool,
    /// [`Priors::moving`](crate::Priors::moving).
    pub masks: bool,
    /// [`Priors::sharp`](crate::Priors::sharp).
    pub sharp: bool,
}

impl PriorUse {
    /// Every prior there is.
    pub const ALL: Self = Self { depth: true, masks: true, sharp: true };
    /// None.
    pub const NONE: Self = Self { depth: false, masks: false, sharp: false };
}

/// The order of an LLFF set's files that goes with the rows of its poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowOrder {
    /// Names as text, as LLFF's script writes them, or by number where the cameras' path says so.
    Auto,
    /// Names as text: `IMG_10` before `IMG_2`.
    Text,
    /// By the numbers in names: `IMG_2` before `IMG_10`.
    Number,
}

/// Meaning of the numbers in depth files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthKind {
    /// Camera z in scene units as it is (`"metric_z"` in JSON). 16-bit files count thousandths of a unit, as
    /// nerfstudio's do, or `integer_depth_scale` units.
    MetricZ,
    /// Camera z, up to a scale and shift that differ from photo to photo (`"depth"`).
    Depth,
    /// One over camera z, likewise (`"inverse_depth"`).
    InverseDepth,
}

/// How to load a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadOptions {
    /// Wider images are downscaled to this width, pixels, with an area filter; `None` keeps the full size.
    pub max_width: Option<usize>,
    /// The colour that transparent pixels show, 0 to 1 per channel (encoded as the images are). Default black.
    pub background: [f32; 3],
    /// The views that are held out. Default [`Holdout::Dataset`].
    pub holdout: Holdout,
    /// The held-out splits that are loaded. Default [`SplitUse::All`].
    pub splits: SplitUse,
    /// Few training cameras, and the times that are seen, in place of the split; `None` (the default) goes by
    /// `holdout`.
    pub sparse: Option<SparseViews>,
    /// The image folder of a COLMAP model, where it is not one of the usual ones; absolute, or relative to the scene.
    pub images: Option<PathBuf>,
    /// Whether a scene far from its world's origin is moved to the origin. See
    /// [`RECENTRE_DISTANCE`](gs_base::local::RECENTRE_DISTANCE). Default yes.
    pub recentre: bool,
    /// How mask files are used. Default [`MaskUse::Auto`].
    pub masks: MaskUse,
    /// The priors that are read. Default all.
    pub priors: PriorUse,
    /// Whether the truth of training views is read where views are held out. Nobody measures by it there, and velocity
    /// maps alone are twelve bytes a pixel. Default no. The truth of held-out views is always read, and where nothing
    /// is held out the truth of all views.
    pub training_truth: bool,
    /// Meaning of depth files, whatever the data set says; `None` (the default) goes by the data set.
    pub depth_kind: Option<DepthKind>,
    /// How long the shutter was open in every view, in the unit of time, whatever the data set says; above 0. `None`
    /// (the default) goes by the data set.
    pub exposure: Option<f64>,
    /// Frames a second of a set whose photos have no times, above 0: the times are the numbers in their names, from the
    /// least, over it, seconds. `None` (the default): such photos have no times.
    pub fps: Option<f64>,
    /// The convention of the poses, whatever the format's is; `None` (the default) goes by the format.
    pub poses: Option<PoseConvention>,
    /// Factor on the coordinates of the points to start from, for points in another unit than the poses. Default 1.
    pub points_scale: f64,
    /// The levels that become black and white, as shares of a photo's full range, 0 to 1. A 16-bit photo is stretched
    /// before it is rounded to 8 bits. `None` (the default): 0 and 1.
    pub levels: Option<[f64; 2]>,
    /// The order of the files of an LLFF set in its rows. Default [`RowOrder::Auto`].
    pub row_order: RowOrder,
    /// Memory for all photos, bytes. Those of a set that takes more are decoded when they are asked for
    /// ([`View::decoded`](crate::View::decoded)); `None` (the default): all are decoded at once.
    pub memory: Option<usize>,
    /// Whether later frames are held out on purpose, so that their times are no mistake. Default no.
    pub predicts: bool,
}

impl LoadOptions {
    /// Whether held-out frames may be later than all that train.
    pub(crate) fn expects_later_frames(&self) -> bool {
        self.predicts || self.sparse.is_some()
    }
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            max_width: None,
            background: [0.0; 3],
            holdout: Holdout::Dataset,
            splits: SplitUse::All,
            sparse: None,
            images: None,
            recentre: true,
            masks: MaskUse::Auto,
            priors: PriorUse::ALL,
            training_truth: false,
            depth_kind: None,
            exposure: None,
            fps: None,
            poses: None,
            points_scale: 1.0,
            levels: None,
            row_order: RowOrder::Auto,
            memory: None,
            predicts: false,
        }
    }
}

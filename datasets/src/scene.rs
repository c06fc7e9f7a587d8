//! A loaded data set: [`Scene`].

use std::fmt;

use glam::{DMat4, DVec3};
use gs_base::mean;

use crate::convention::{LLFF, OPENCV, OPENGL, PoseConvention};
use crate::frame::View;
use crate::subject::{subject_distance, without_strays};

/// The layout that a scene was described in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneFormat {
    /// The transforms.json family: instant-ngp, nerfstudio, Blender/NeRF, D-NeRF, NVFi.
    Transforms,
    /// A COLMAP sparse model in text files.
    ColmapText,
    /// A COLMAP sparse model in binary files.
    ColmapBinary,
    /// train_meta.json and test_meta.json of Dynamic 3D Gaussians (PanopticSports).
    Panoptic,
    /// LLFF's poses_bounds.npy with the frames of several cameras in folders (N3DV), or with photos.
    Llff,
    /// A table of cameras by RealityScan (RealityCapture), with points as PLY.
    RealityScan,
    /// A text for each photo with its camera, as OmniVGGT takes it.
    CameraTexts,
    /// A COLMAP model of static cameras beside the frames that they filmed (multipleview of 4DGaussians).
    Filmed,
    /// A JSON file for each camera, as Nerfies and HyperNeRF write them.
    Nerfies,
}

impl fmt::Display for SceneFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Transforms => "transforms.json",
            Self::ColmapText => "COLMAP text",
            Self::ColmapBinary => "COLMAP binary",
            Self::Panoptic => "Panoptic (train_meta.json)",
            Self::Llff => "LLFF (poses_bounds.npy)",
            Self::RealityScan => "RealityScan (CSV)",
            Self::CameraTexts => "cameras/NAME.txt",
            Self::Filmed => "multipleview (sparse_)",
            Self::Nerfies => "Nerfies (camera/NAME.json)",
        })
    }
}

impl PoseConvention {
    /// The convention of a format's own files.
    pub fn of(format: SceneFormat) -> Self {
        let (world_to_camera, axes) = match format {
            SceneFormat::Transforms | SceneFormat::RealityScan => (false, OPENGL),
            SceneFormat::ColmapText | SceneFormat::ColmapBinary | SceneFormat::Filmed | SceneFormat::Panoptic => {
                (true, OPENCV)
            }
            SceneFormat::Llff => (false, LLFF),
            SceneFormat::CameraTexts | SceneFormat::Nerfies => (false, OPENCV),
        };
        Self { world_to_camera, axes }
    }
}

/// Coloured points on the scene's surfaces. All are finite.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointCloud {
    /// `[N]` positions in the world of [`View::c2w`] (scene origin subtracted), scene units.
    pub positions: Vec<[f32; 3]>,
    /// `[N]` colours, sRGB; mid grey where the file has none.
    pub colors: Vec<[u8; 3]>,
}

impl PointCloud {
    /// The number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

/// Views that are held out of training under one name.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// [`Split::TEST`], [`Split::VALIDATION`], or the name of the data set's own list. It can name a file.
    pub name: String,
    /// Sorted by name; not empty after [`load`](crate::load).
    pub views: Vec<View>,
}

impl Split {
    /// The views to learn from, [`Scene::train`].
    pub const TRAIN: &'static str = "train";
    /// The data set's test list, and all views that a rule of the user's holds out.
    pub const TEST: &'static str = "test";
    /// The data set's validation list.
    pub const VALIDATION: &'static str = "validation";
    /// Training cameras at times that are not seen, see [`SparseViews`](crate::SparseViews).
    pub const TEST_SEEN: &'static str = "test-seen";
}

/// A posed photo set, undistorted, resized and split, in memory. No view is in two splits.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Views to learn from, sorted by name; never empty after [`load`](crate::load).
    pub train: Vec<View>,
    /// Views held out: test views first, then validation views, then other lists by name.
    pub held_out: Vec<Split>,
    /// Points to start from, where the data set has them.
    pub points: Option<PointCloud>,
    /// The vector that was subtracted from every position, in the file's world; added, it leads back.
    pub origin: DVec3,
    /// The layout that was read.
    pub format: SceneFormat,
    /// The convention by which the poses of its files were read.
    pub poses: PoseConvention,
    /// Repairs and omissions, in sentences. They are also logged.
    pub warnings: Vec<String>,
    /// Smallest and largest [`View::time`] over training and held-out views; `None` in a static scene.
    pub time_range: Option<(f64, f64)>,
}

impl Scene {
    /// The views of a split by its name ([`Split::TRAIN`] among them); `None` where the scene has no such split.
    pub fn split(&self, name: &str) -> Option<&[View]> {
        if name == Split::TRAIN {
            return Some(&self.train);
        }
        self.held_out.iter().find(|split| split.name == name).map(|split| &split.views[..])
    }

    /// The held-out split that figures are quoted on: test, else validation, else the first. `None` where nothing is
    /// held out.
    pub fn reported(&self) -> Option<&Split> {
        self.held_out.get(reported(self.held_out.iter().map(|split| split.name.as_str()))?)
    }

    /// All held-out views, split by split.
    pub fn held_out_views(&self) -> impl Iterator<Item = &View> {
        self.held_out.iter().flat_map(|split| &split.views)
    }

    /// The scene's size as 3D Gaussian Splatting measures it: 1.1 times the largest distance of a training camera from
    /// the mean of all training cameras, scene units. Learning rates and density thresholds are relative to it. A
    /// camera ten times farther out than three quarters of them is a mistake and does not count. 0 when there is one
    /// camera only.
    pub fn extent(&self) -> f64 {
        let centres: Vec<DVec3> = self.train.iter().map(|view| view.c2w.w_axis.truncate()).collect();
        let centres = without_strays(&centres);
        let Some(mean) = mean(&centres) else { return 0.0 };
        1.1 * centres.iter().map(|centre| centre.distance(mean)).fold(0.0, f64::max)
    }

    /// [`subject_distance`](crate::subject_distance) of the training cameras, scene units.
    pub fn subject_distance(&self) -> Option<f64> {
        subject_distance(&self.train.iter().map(|view| view.c2w).collect::<Vec<DMat4>>())
    }
}

/// The index of the split that figures are quoted on in a list of held-out splits, see [`Scene::reported`].
pub(crate) fn reported<'a>(names: impl Iterator<Item = &'a str>) -> Option<usize> {
    let rank = |name: &str| [Split::TEST, Split::VALIDATION].iter().position(|first| *first == name).unwrap_or(2);
    // `min_by_key` returns the first of equal minima.
    names.enumerate().min_by_key(|(_, name)| rank(name)).map(|(index, _)| index)
}

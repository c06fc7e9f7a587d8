//! A loaded data set: [`Scene`].

use std::fmt;

use glam::{DMat4, DVec3};

use crate::consistency;
use crate::frame::View;

/// Where a scene's description came from.
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
}

impl fmt::Display for SceneFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Transforms => "transforms.json",
            Self::ColmapText => "COLMAP text",
            Self::ColmapBinary => "COLMAP binary",
            Self::Panoptic => "Panoptic (train_meta.json)",
            Self::Llff => "LLFF (poses_bounds.npy)",
        })
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

/// A posed photo set, undistorted, resized and split, in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Views to learn from, sorted by name; never empty after [`load`](crate::load).
    pub train: Vec<View>,
    /// Views held out, sorted by name.
    pub test: Vec<View>,
    /// Points to start from, where the data set has them.
    pub points: Option<PointCloud>,
    /// What was subtracted from every position, in the file's world; add it to go back.
    pub origin: DVec3,
    /// The layout that was read.
    pub format: SceneFormat,
    /// What was repaired or left out, in sentences. They are also logged.
    pub warnings: Vec<String>,
    /// Smallest and largest [`View::time`] over train and test; `None` in a static scene.
    pub time_range: Option<(f64, f64)>,
}

impl Scene {
    /// The scene's size as 3D Gaussian Splatting measures it: 1.1 times the largest distance of a training camera from
    /// the mean of all training cameras, scene units. Learning rates and density thresholds are relative to it.
    /// 0 when there is one camera only.
    pub fn extent(&self) -> f64 {
        let centres: Vec<DVec3> = self.train.iter().map(|view| view.c2w.w_axis.truncate()).collect();
        let Some(mean) = mean(&centres) else { return 0.0 };
        1.1 * centres.iter().map(|centre| centre.distance(mean)).fold(0.0, f64::max)
    }

    /// The median distance of the training cameras from what they all look at, scene units; `None` where they look at no
    /// one thing.
    pub fn subject_distance(&self) -> Option<f64> {
        consistency::subject_distance(&self.train.iter().map(|view| view.c2w).collect::<Vec<DMat4>>())
    }
}

/// The mean of points; `None` if there are none.
pub fn mean(points: &[DVec3]) -> Option<DVec3> {
    (!points.is_empty()).then(|| points.iter().sum::<DVec3>() / points.len() as f64)
}

//! A COLMAP sparse model in memory, and its camera models.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::lens::Lens;
use crate::projection::Projection;

/// COLMAP's camera models by id: name and number of parameters. All must be known to read past them in binary files.
const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

/// The models of which pinhole views are made here.
pub(super) const SUPPORTED: &str = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, FOV, \
    SIMPLE_FISHEYE, FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, OPENCV_FISHEYE, THIN_PRISM_FISHEYE or \
    EQUIRECTANGULAR (colmap image_undistorter makes PINHOLE of the others)";

/// Angles of FOV that are a lens's, radians: below the first its formula has no digits left.
const FOV: Range<f64> = 1e-6..PI;

/// Name and number of parameters of a model by its number in binary files.
pub(super) fn model_by_id(id: i32) -> Option<(&'static str, usize)> {
    usize::try_from(id).ok().and_then(|id| MODELS.get(id)).copied()
}

/// Name and number of parameters of a model by its name in text files.
pub(super) fn model_by_name(name: &str) -> Option<(&'static str, usize)> {
    MODELS.iter().find(|(known, _)| *known == name).copied()
}

/// A camera as stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Camera {
    pub model: &'static str,
    pub width: u64,
    pub height: u64,
    pub params: Vec<f64>,
}

/// A camera by its id; an error of its own where its line does not describe it.
pub(super) type Listed = (u32, Result<Camera, DatasetError>);

/// Where an image shows a point: pixels and the point's id.
pub(crate) type Observation = (f64, f64, u64);

/// An image as stored: world-to-camera pose.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Image {
    pub q: [f64; 4],
    pub t: [f64; 3],
    pub camera_id: u32,
    pub name: String,
    /// The observations with a point; empty unless asked for.
    pub observations: Vec<Observation>,
}

/// A point as stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Point {
    pub position: DVec3,
    pub color: [u8; 3],
    /// Mean reprojection error, pixels.
    pub error: f64,
}

/// The three lists. Images and points keep the file's order.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Model {
    pub cameras: HashMap<u32, Camera>,
    /// Cameras that their line does not describe: a sentence for each.
    pub broken: HashMap<u32, String>,
    pub images: Vec<Image>,
    pub points: Vec<(u64, Point)>,
}

impl Camera {
    /// The lens in this crate's terms; an error names a model that is none of [`SUPPORTED`].
    pub fn lens(&self, id: u32, file: &Path) -> Result<Lens, DatasetError> {
        let k = |k: [f64; 4]| Distortion { k, ..Distortion::default() };
        let none = Distortion::default();
        let (pinhole, fisheye) = (Projection::Pinhole, Projection::Fisheye);
        let (projection, focal, centre, distortion) = match (self.model, self.params.as_slice()) {
            ("SIMPLE_PINHOLE", &[f, cx, cy]) => (pinhole, [f, f], [cx, cy], none),
            ("PINHOLE", &[fx, fy, cx, cy]) => (pinhole, [fx, fy], [cx, cy], none),
            ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => (pinhole, [f, f], [cx, cy], k([k1, 0.0, 0.0, 0.0])),
            ("RADIAL", &[f, cx, cy, k1, k2]) => (pinhole, [f, f], [cx, cy], k([k1, k2, 0.0, 0.0])),
            ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
                (pinhole, [fx, fy], [cx, cy], Distortion { p: [p1, p2], ..k([k1, k2, 0.0, 0.0]) })
            }
            ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let distortion = Distortion { d: [k4, k5, k6], p: [p1, p2], ..k([k1, k2, k3, 0.0]) };
                (pinhole, [fx, fy], [cx, cy], distortion)
            }
            ("FOV", &[fx, fy, cx, cy, w]) => (Projection::Fov(w), [fx, fy], [cx, cy], none),
            ("SIMPLE_FISHEYE", &[f, cx, cy]) => (fisheye, [f, f], [cx, cy], none),
            ("FISHEYE", &[fx, fy, cx, cy]) => (fisheye, [fx, fy], [cx, cy], none),
            ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k1]) => (fisheye, [f, f], [cx, cy], k([k1, 0.0, 0.0, 0.0])),
            ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => (fisheye, [f, f], [cx, cy], k([k1, k2, 0.0, 0.0])),
            ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => (fisheye, [fx, fy], [cx, cy], k([k1, k2, k3, k4])),
            ("THIN_PRISM_FISHEYE", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, s1, s2]) => {
                let distortion = Distortion { p: [p1, p2], s: [s1, s2], ..k([k1, k2, k3, k4]) };
                (fisheye, [fx, fy], [cx, cy], distortion)
            }
            // Its width and height, which are the camera's.
            ("EQUIRECTANGULAR", &[w, h]) => (Projection::Equirectangular, [w, h], [0.0; 2], none),
            _ => {
                return Err(DatasetError::Unsupported {
                    path: file.to_path_buf(),
                    what: format!("the camera model {} of camera {id}", self.model),
                    expected: SUPPORTED.to_string(),
                });
            }
        };
        let sound = focal.iter().all(|f| f.is_finite() && *f > 0.0)
            && centre.iter().all(|c| c.is_finite())
            && distortion.is_finite()
            && !matches!(projection, Projection::Fov(w) if !FOV.contains(&w))
            && (1..=1_000_000).contains(&self.width)
            && (1..=1_000_000).contains(&self.height);
        if !sound {
            return Err(DatasetError::malformed(
                file,
                format!("camera {id} ({})", self.model),
                "sides of 1 to 1000000 pixels, focal lengths above 0 and finite parameters",
                format!("{} x {}, {:?}", self.width, self.height, self.params),
            ));
        }
        let [[fx, fy], [cx, cy]] = [focal, centre];
        let lens = Lens::of([fx, fy, cx, cy], (self.width as f64, self.height as f64), distortion);
        Ok(Lens { projection, ..lens })
    }
}

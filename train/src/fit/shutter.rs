//! A photo as a moving camera forms it: the mean of the light at some instants, each in the image rows that are exposed
//! then.
//!
//! A frame lasts from `u = -1`, where its first row's exposure begins, to `u = 1`, where its last row's ends. A row at
//! height `y` from -1 to 1 is exposed from `(1 - e) y - e` to `(1 - e) y + e`: `e = 1` is a shutter that all rows share,
//! and a rolling one has `e = exposure / (exposure + readout)`. The frame is divided into equal parts, each with the
//! camera's pose at its middle, and a part is rendered in the rows that are exposed in it, by a camera that has these
//! rows alone.

use burn::tensor::{Tensor, TensorData};
use gs_base::Intrinsics;
use gs_burn::{Camera, Rendering};
use gs_models::camera_path::{Part, instants, moved, parts, twists};
use gs_models::light::{to_encoded, to_linear};

use crate::config::CameraConfig;

/// Pixels of a path from one instant to the next. Gaussians are at least half a pixel wide in the image
/// ([`RenderConfig::eps2d`](crate::config::RenderConfig)), so that instants that far apart show no steps.
const APART: f64 = 1.5;

/// Fewest and most instants of an exposure: from fewer no path would grow, and each costs a rendering.
const INSTANTS: [usize; 2] = [3, 7];

/// Most parts of a frame whose rows have times of their own; each is rendered in some rows alone.
const PARTS: usize = 16;

/// Most renderings of a photo.
pub fn most_instants(config: &CameraConfig) -> usize {
    match (config.motion, config.readout > 0.0 || config.learn_readout) {
        (0, _) => 1,
        (_, true) => PARTS,
        (_, false) => INSTANTS[1],
    }
}

/// The way of a camera through one frame, in a step's graph.
#[derive(Debug, Clone)]
pub struct ShutterPath {
    /// The given pose.
    pub camera: Camera,
    /// Twists by degree, `[1, 6 K]`, radians and shares of `distance`.
    pub twists: Tensor<2>,
    /// Distance of the subject, scene units.
    pub distance: f64,
    /// Length of the way of the image's middle, pixels; `None`: the camera stands still.
    pub length: Option<f64>,
    /// A row's share `e` of the frame, `[1]`, with its value; `None`: all rows at once.
    pub share: Option<(Tensor<1>, f64)>,
}

/// A part of a frame.
#[derive(Debug, Clone)]
pub struct Instant {
    /// Its time, `u`.
    pub at: f64,
    /// The camera then, with the rows that are exposed.
    pub camera: Camera,
    rows: Option<Rows>,
}

/// The rows of an instant.
#[derive(Debug, Clone)]
struct Rows {
    /// The first one.
    first: usize,
    /// Shares of the rows' exposures, `[h, 1, 1]`.
    shares: Tensor<3>,
}

impl ShutterPath {
    /// The camera in the middle of the frame.
    pub fn middle(&self) -> Camera {
        moved(&self.camera, twists(self.twists.clone(), &[0.0]), self.distance).remove(0)
    }

    /// At least `least` instants, as many as the path's length asks for.
    pub fn instants(&self, least: usize) -> Vec<Instant> {
        let steps = |most| self.length.map_or(1, |length| ((length / APART) as usize + 1).clamp(INSTANTS[0], most));
        let count = steps(self.share.as_ref().map_or(INSTANTS[1], |_| PARTS)).max(least);
        let times = instants(count);
        let cameras = moved(&self.camera, twists(self.twists.clone(), &times), self.distance);
        let whole = times.into_iter().zip(cameras).map(|(at, camera)| Instant { at, camera, rows: None });
        match &self.share {
            None => whole.collect(),
            Some((share, value)) => {
                let parts = parts(count, self.camera.height, *value);
                let exposed = |(instant, part): (Instant, Option<Part>)| Some(instant.in_rows(&part?, share, *value));
                whole.zip(parts).filter_map(exposed).collect()
            }
        }
    }
}

impl Instant {
    /// The whole exposure of a camera that stands still.
    pub fn still(camera: Camera) -> Self {
        Self { at: 0.0, camera, rows: None }
    }

    /// Whether all rows are exposed then.
    pub fn is_whole(&self) -> bool {
        self.rows.is_none()
    }

    /// The same in some rows; `share` is the tensor of `value`.
    fn in_rows(self, part: &Part, share: &Tensor<1>, value: f64) -> Self {
        let Camera { viewmat, intrinsics, width, .. } = self.camera;
        let height = part.shares.len();
        let column = |values: &[f64]| {
            let data = TensorData::new(values.to_vec(), [height, 1, 1]);
            Tensor::<3>::from_data(data, (&share.device(), share.dtype()))
        };
        // The share's value is in `shares`, and its gradient in the change of zero beside it.
        let change = (share.clone() - value).reshape([1, 1, 1]);
        let shares = column(&part.shares) + column(&part.slopes) * change;
        let intrinsics = Intrinsics { cy: intrinsics.cy - part.first as f64, ..intrinsics };
        Self {
            at: self.at,
            camera: Camera { viewmat, intrinsics, width, height },
            rows: Some(Rows { first: part.first, shares }),
        }
    }
}

impl Rows {
    /// `image` of these rows, `[h, W, 3]`, with zeros in the other rows of an image of `height`.
    fn pasted(&self, image: Tensor<3>, height: usize) -> Tensor<3> {
        let [own, width, channels] = image.dims();
        let zeros =
            |rows: usize| (rows > 0).then(|| Tensor::zeros([rows, width, channels], (&image.device(), image.dtype())));
        let [above, below] = [zeros(self.first), zeros(height - self.first - own)];
        Tensor::cat(above.into_iter().chain([image.clone()]).chain(below).collect(), 0)
    }
}

/// The image of a photo of `height` rows from the renderings of its instants, `[H, W, 3]`: mean light, encoded.
pub fn formed(instants: &[Instant], renderings: &[Rendering], height: usize) -> Tensor<3> {
    if let [rendering] = renderings {
        return rendering.color.clone();
    }
    let light = instants.iter().zip(renderings).map(|(instant, rendering)| {
        let light = to_linear(rendering.color.clone());
        match &instant.rows {
            None => light / instants.len() as f64,
            Some(rows) => rows.pasted(light * rows.shares.clone(), height),
        }
    });
    to_encoded(light.reduce(|sum, light| sum + light).expect("at least one instant"))
}

//! A photo as a moving camera forms it: the mean of the light at some instants, each in the image rows that are exposed
//! then.
//!
//! A frame lasts from `u = -1`, where its first row's exposure begins, to `u = 1`, where its last row's ends. A row at
//! height `y` from -1 to 1 is exposed from `(1 - e) y - e` to `(1 - e) y + e`: `e = 1` is a shutter that all rows
//! share, and a rolling one has `e = exposure / (exposure + readout)`. The frame is divided into equal parts, each with
//! the camera's pose at its middle, and a part is rendered in the rows that are exposed in it, by a camera that has
//! these rows alone.

use burn::tensor::{Tensor, TensorData};
use gs_base::Intrinsics;
use gs_burn::{Camera, RenderOptions, Rendering};
use gs_models::camera_path::{Part, instants, moved, parts, twists};
use gs_models::light::Mixing;

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
    /// Length of the longest way of a place in the image, pixels; `None`: the camera stands still.
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
    /// The first one, which is the number of rows above.
    first: usize,
    /// Rows below the last one.
    below: usize,
    /// Shares of the rows' exposures, `[h, 1, 1]`.
    shares: Tensor<3>,
}

impl ShutterPath {
    /// Whether the camera stands still, with a shutter that all rows share.
    pub fn is_still(&self) -> bool {
        self.length.is_none() && self.share.is_none()
    }

    /// The camera in the middle of the frame.
    pub fn middle(&self) -> Camera {
        moved(&self.camera, twists(self.twists.clone(), &[0.0]), self.distance).remove(0)
    }

    /// At least `least` instants, as many as the path's length asks for.
    pub fn instants(&self, least: usize) -> Vec<Instant> {
        // A row is exposed in the same number of parts as a photo has instants at most, if there is room for the
        // others.
        let of_row = |share: f64| ((INSTANTS[1] as f64 / share) as usize).min(PARTS);
        let most = self.share.as_ref().map_or(INSTANTS[1], |(_, share)| of_row(*share));
        let steps = |length: f64| ((length / APART) as usize + 1).clamp(INSTANTS[0], most);
        let count = self.length.map_or(1, steps).max(least);
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
        let Camera { viewmat, intrinsics, width, height: whole } = self.camera;
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
            rows: Some(Rows { first: part.first, below: whole - part.first - height, shares }),
        }
    }

    /// The options by which its camera renders.
    pub fn options(&self, options: &RenderOptions) -> RenderOptions {
        let beyond = self.rows.as_ref().map_or([0; 2], |rows| [rows.first, rows.below]);
        RenderOptions { beyond, ..*options }
    }
}

impl Rows {
    /// `image` of these rows, `[h, W, 3]`, with zeros in the other rows.
    fn pasted(&self, image: Tensor<3>) -> Tensor<3> {
        let [_, width, channels] = image.dims();
        let zeros =
            |rows: usize| (rows > 0).then(|| Tensor::zeros([rows, width, channels], (&image.device(), image.dtype())));
        let [above, below] = [zeros(self.first), zeros(self.below)];
        Tensor::cat(above.into_iter().chain([image.clone()]).chain(below).collect(), 0)
    }
}

/// The image of a photo from the renderings of its instants, `[H, W, 3]`: their mean by `mixing`.
pub fn formed(instants: &[Instant], renderings: &[Rendering], mixing: Mixing) -> Tensor<3> {
    if let [rendering] = renderings {
        return rendering.color.clone();
    }
    let light = instants.iter().zip(renderings).map(|(instant, rendering)| {
        let light = mixing.decode(rendering.color.clone());
        match &instant.rows {
            None => light / instants.len() as f64,
            Some(rows) => rows.pasted(light * rows.shares.clone()),
        }
    });
    mixing.encode(light.reduce(|sum, light| sum + light).expect("at least one instant"))
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};
    use gs_burn::{Gaussians, device, render};

    use super::*;

    const WIDTH: usize = 24;
    const HEIGHT: usize = 20;

    /// Gaussians as wide as several rows, all over the image and beyond it.
    fn gaussians(device: &burn::tensor::Device) -> Gaussians {
        const COUNT: usize = 40;
        let wave = |columns: usize, step: f64, size: f64| -> Vec<f64> {
            (0..COUNT * columns).map(|i| size * (step * i as f64).sin()).collect()
        };
        let of = |values: Vec<f64>, columns: usize| {
            Tensor::<2>::from_data(TensorData::new(values, [COUNT, columns]), device)
        };
        let scales = wave(3, 0.7, 0.3).into_iter().map(|x| x - 1.6).collect();
        let opacities = of(wave(1, 1.1, 2.0), 1).squeeze_dim(1);
        let sh = of(wave(3, 2.3, 1.0), 3).reshape([COUNT, 1, 3]);
        Gaussians::from_tensors(of(wave(3, 1.7, 0.9), 3), of(wave(4, 0.9, 1.0), 4), of(scales, 3), opacities, sh)
    }

    fn path(share: f64, device: &burn::tensor::Device) -> ShutterPath {
        let intrinsics = Intrinsics { fx: 20.0, fy: 20.0, cx: 12.0, cy: 10.0 };
        let c2w = DMat4::from_translation(DVec3::new(0.0, 0.0, -2.5));
        ShutterPath {
            camera: Camera::from_c2w(c2w, intrinsics, WIDTH, HEIGHT, device),
            twists: Tensor::zeros([1, 12], device),
            distance: 2.5,
            length: Some(20.0),
            share: Some((Tensor::from_floats([share as f32], device), share)),
        }
    }

    /// Where nothing moves, the rows that are exposed one after another are those of one rendering: bands are projected
    /// as the whole image is. Light is decoded and encoded in between: 1e-5.
    #[test]
    fn a_still_camera_forms_the_whole_rendering() {
        let device = device::select("auto").expect("a device");
        let (scene, options) = (gaussians(&device), RenderOptions::default());
        for share in [0.1, 0.4, 1.0] {
            let path = path(share, &device);
            let instants = path.instants(1);
            assert!(instants.len() > 4 && (share == 1.0 || instants.iter().any(|it| it.camera.height < HEIGHT)));
            let rendered = |it: &Instant| render(&scene, &it.camera, &it.options(&options));
            let renderings: Vec<Rendering> = instants.iter().map(rendered).collect();
            let whole = render(&scene, &path.camera, &options).color;
            let off: f32 = (formed(&instants, &renderings, Mixing::Linear) - whole).abs().max().into_scalar();
            assert!(off < 1e-5, "{off} at {share}");
        }
    }
}

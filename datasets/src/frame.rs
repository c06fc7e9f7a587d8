//! One photo with its camera: [`View`], and the camera alone: [`CameraPose`].

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use gs_base::Intrinsics;

use crate::error::DatasetError;

/// An RGB image with 8 bits a channel, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbImage8 {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height, width, 3]`, as the file encodes colour (sRGB, no conversion to linear light).
    pub data: Vec<u8>,
}

/// Steps of the rests of [`rounded`] to one of the bytes: half a step of a byte on either side is all that a signed
/// byte holds. It is a step of 16 bits within 2 %.
const RESTS: f32 = 254.0;

/// Values of 0 to 255 as bytes, and the rests that rounding leaves, [`RESTS`] to a step of the bytes.
pub(crate) fn rounded(values: &[f32]) -> (Vec<u8>, Vec<i8>) {
    let byte = |value: f32| value.round().clamp(0.0, 255.0);
    values.iter().map(|value| (byte(*value) as u8, (RESTS * (value - byte(*value))).round() as i8)).unzip()
}

/// One undistorted photo at training size with the camera that took it. Every field is given by the data set; nothing
/// that was inferred from photos (masks, tracks, depth) is ever written into a view.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Path of the image relative to the scene, without extension, separated by `/`; unique in the scene and free of
    /// `..`, so that it can name output files.
    pub name: String,
    /// The image file.
    pub image_path: PathBuf,
    /// Camera to world, OpenCV camera axes (x right, y down, z forward), in scene units, scene origin subtracted.
    pub c2w: glam::DMat4,
    /// Intrinsics of `image` (after undistortion and resizing).
    pub intrinsics: Intrinsics,
    /// Width of `image`, pixels.
    pub width: usize,
    /// Height of `image`, pixels.
    pub height: usize,
    /// Time as the file gives it (D-NeRF: 0 to 1); `None` in a static scene.
    pub time: Option<f64>,
    /// The physical camera, by the name in the file. Where the file names none and poses return at other times, cameras
    /// are told apart by pose ("pose00" and on). `None` where neither tells.
    pub camera_id: Option<String>,
    /// The photo; RGBA is already composited on the chosen background. Empty where it is decoded when it is asked for:
    /// [`decoded`](View::decoded) has it.
    pub image: RgbImage8,
    /// `[height, width, 3]` the rests that rounding to the bytes of `image` left: the photo has the level
    /// `image + fine / 254` of 255, within half a step of 16 bits. `None` where the file has 8 bits a channel.
    pub fine: Option<Vec<i8>>,
    /// `[height, width]` the photo file's own alpha: 0 where it is transparent, 255 where it is opaque. `None` where
    /// the file has none or is opaque everywhere.
    pub alpha: Option<Vec<u8>>,
    /// `[height, width]`: 255 = compare this pixel, 0 = ignore it; `None` when every pixel counts.
    pub mask: Option<Vec<u8>>,
    /// How long the shutter was open around [`time`](View::time), in the unit of `time`: light was gathered over
    /// `[time - exposure / 2, time + exposure / 2]`. `None` where the data set does not say.
    pub exposure: Option<f64>,
    /// Guesses about the photo that the data set brings along, made by other programs.
    pub priors: Priors,
    /// Ground truth that the data set brings along, of synthetic worlds. It is for measuring only, never for training.
    pub truth: Truth,
    /// Where the photo comes from when it is asked for, with its alpha, mask, priors and truth; `None` where the view
    /// has them.
    pub source: Option<PhotoSource>,
}

impl View {
    /// A photo and its camera, with nothing else known: no name, time, camera, alpha, mask, exposure, prior or truth.
    /// Width and height are the image's. Further fields are set by struct update, `View { time: Some(0.5),
    /// ..View::new(..) }`.
    pub fn new(c2w: glam::DMat4, intrinsics: Intrinsics, image: RgbImage8) -> Self {
        Self {
            name: String::new(),
            image_path: PathBuf::new(),
            c2w,
            intrinsics,
            width: image.width,
            height: image.height,
            time: None,
            camera_id: None,
            image,
            fine: None,
            alpha: None,
            mask: None,
            exposure: None,
            priors: Priors::default(),
            truth: Truth::default(),
            source: None,
        }
    }

    /// Memory that the view takes, bytes: its own fields and its buffers as they were allocated.
    pub fn bytes(&self) -> usize {
        let image = |image: &Option<RgbImage8>| image.as_ref().map_or(0, |image| image.data.capacity());
        let mask = |mask: &Option<Vec<u8>>| mask.as_ref().map_or(0, Vec::capacity);
        let map = |map: &Option<Vec<f32>>| map.as_ref().map_or(0, |map| map.capacity() * size_of::<f32>());
        let depth = self.priors.depth.as_ref().map_or(0, |depth| depth.values.capacity() * size_of::<f32>());
        let Truth { sharp, blurry, depth: true_depth, velocity, moving, moving_union } = &self.truth;
        let texts =
            self.name.capacity() + self.image_path.capacity() + self.camera_id.as_ref().map_or(0, String::capacity);
        size_of::<Self>()
            + texts
            + self.image.data.capacity()
            + self.fine.as_ref().map_or(0, Vec::capacity)
            + mask(&self.alpha)
            + mask(&self.mask)
            + depth
            + map(&self.priors.confidence)
            + mask(&self.priors.moving)
            + image(&self.priors.sharp)
            + image(sharp)
            + image(blurry)
            + map(true_depth)
            + map(velocity)
            + mask(moving)
            + mask(moving_union)
    }

    /// The level of a channel of a pixel, 0 to 255, by its index in `image`, at the depth of the file.
    pub fn level(&self, index: usize) -> f32 {
        let rest = self.fine.as_ref().map_or(0.0, |fine| f32::from(fine[index]) / RESTS);
        f32::from(self.image.data[index]) + rest
    }

    /// The point that a pixel, by its index row by row, shows at a depth (camera z, scene units), and its colour.
    pub fn point_at(&self, pixel: usize, depth: f64) -> ([f32; 3], [u8; 3]) {
        let ray = self.intrinsics.ray((pixel % self.width) as f64 + 0.5, (pixel / self.width) as f64 + 0.5);
        let position = self.c2w.transform_point3(ray * depth).as_vec3().to_array();
        (position, [0, 1, 2].map(|channel| self.image.data[3 * pixel + channel]))
    }

    /// A black photo by a camera at the world's origin that looks along z, with a focal length of one image width and
    /// its principal point in the middle; for tests.
    pub fn blank(width: usize, height: usize) -> Self {
        let (w, h) = (width as f64, height as f64);
        let intrinsics = Intrinsics { fx: w, fy: w, cx: 0.5 * w, cy: 0.5 * h };
        let data = vec![0; 3 * width * height];
        Self::new(glam::DMat4::IDENTITY, intrinsics, RgbImage8 { width, height, data })
    }
}

/// Guesses about a photo that were computed beforehand and lie in the data set, at the size of [`View::image`]. Each is
/// optional.
///
/// Priors are given, not inferred: a mask or a depth that a program finds itself while it trains or evaluates belongs
/// to that program. Otherwise a later step could not tell it from a file of the data set.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Priors {
    /// Depth or inverse depth.
    pub depth: Option<DepthPrior>,
    /// `[height, width]` how sure each depth is, 1 (not at all) and above, as VGGT gives it (`1 + exp(.)`).
    pub confidence: Option<Vec<f32>>,
    /// `[height, width]`: 255 where an object moves at the exposure's centre, 0 elsewhere.
    pub moving: Option<Vec<u8>>,
    /// A deblurring network's image of the photo; same size and encoding as [`View::image`].
    pub sharp: Option<RgbImage8>,
}

/// Meaning of the values of a depth prior.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthSpace {
    /// Camera z, in any affine relation to scene units unless `metric`.
    Depth,
    /// One over camera z (disparity), likewise; larger is nearer.
    InverseDepth,
}

/// A depth map.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthPrior {
    /// `[height, width]`; 0 or not finite where unknown.
    pub values: Vec<f32>,
    /// Meaning of `values`.
    pub space: DepthSpace,
    /// Whether `values` are in scene units as they are; otherwise scale and shift are unknown and differ from photo to
    /// photo.
    pub metric: bool,
}

/// Ground truth of a synthetic world, at the size of [`View::image`]. It is given by the data set, never inferred.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// The image of a shutter of no duration at the exposure's centre. In held-out views it is [`View::image`] itself,
    /// and this is `None`.
    pub sharp: Option<RgbImage8>,
    /// The blurry photo, where [`View::image`] is sharp (held-out views).
    pub blurry: Option<RgbImage8>,
    /// `[height, width]` camera z, scene units; 0 where the ray hits nothing.
    pub depth: Option<Vec<f32>>,
    /// `[height, width, 3]` velocity of the visible surface at the exposure's centre, world axes, scene units per unit
    /// of [`View::time`].
    pub velocity: Option<Vec<f32>>,
    /// `[height, width]`: 255 where a moving surface is visible at the exposure's centre.
    pub moving: Option<Vec<u8>>,
    /// `[height, width]`: 255 where a moving surface is visible at any time of the exposure.
    pub moving_union: Option<Vec<u8>>,
}

/// Photos of a set that are decoded when they are asked for.
pub(crate) trait PhotoSet: Send + Sync {
    /// The view of a frame with its pixels.
    fn decode(&self, index: usize) -> Result<Arc<View>, DatasetError>;

    /// See [`surveyed`](crate::surveyed).
    fn survey(&self) -> &[View];
}

/// Where the photo of a view comes from when it is asked for.
#[derive(Clone)]
pub struct PhotoSource {
    pub(crate) set: Arc<dyn PhotoSet>,
    /// Of the frame in the set.
    pub(crate) index: usize,
    /// The width that it is reduced to after decoding, pixels; `None`: none.
    pub(crate) width: Option<usize>,
}

impl PartialEq for PhotoSource {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.set, &other.set) && (self.index, self.width) == (other.index, other.width)
    }
}

impl fmt::Debug for PhotoSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PhotoSource({})", self.index)
    }
}

/// A camera without an image, for rendering.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPose {
    /// Name for output files, as [`View::name`]; unique in the list.
    pub name: String,
    /// Camera to world, OpenCV camera axes, in the file's world: no scene origin is subtracted.
    pub c2w: glam::DMat4,
    /// Pinhole intrinsics for `width` x `height`; a lens distortion in the file is left out.
    pub intrinsics: Intrinsics,
    /// Width to render, pixels.
    pub width: usize,
    /// Height to render, pixels.
    pub height: usize,
    /// Time as the file gives it.
    pub time: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blank_view_is_a_black_photo_of_what_is_before_the_origin() {
        let view = View { time: Some(0.5), ..View::blank(6, 4) };
        assert_eq!((view.width, view.height, view.image.data.len()), (6, 4, 72));
        assert_eq!(view.intrinsics.project(glam::DVec3::new(0.0, 0.0, 2.0)), glam::DVec2::new(3.0, 2.0));
        assert_eq!(view.intrinsics.project(glam::DVec3::new(1.0, 0.0, 2.0)).x, 6.0, "half a focal length to the right");
        assert_eq!((view.time, view.mask, view.priors), (Some(0.5), None, Priors::default()));
    }
}

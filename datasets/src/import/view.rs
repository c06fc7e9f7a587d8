//! A predicted view on the pixels of its photo, with the known camera: [`MappedView`].

use glam::{DMat3, DVec2, DVec3};
use gs_base::Intrinsics;
use image::DynamicImage;
use image::imageops::FilterType;

use super::prediction::PredictedView;
use super::similarity::Placed;
use super::window::Window;
use crate::error::DatasetError;
use crate::pixels;
use crate::raw::RawFrame;

/// Depths of four neighbours that differ by more than this share lie on several surfaces and are not averaged.
const EDGE: f32 = 0.05;

/// Alpha of 255 from which a pixel is taken for opaque: photos are resized, which leaves opaque pixels a few steps below 255.
const OPAQUE: u8 = 250;

/// A view at the resolution of the prediction and the proportions of the photo.
#[derive(Debug, Clone)]
pub(super) struct MappedView {
    pub name: String,
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// Known intrinsics at this size.
    pub intrinsics: Intrinsics,
    /// Known camera to world.
    pub placed: Placed,
    /// `[height, width, 3]` the photo, encoded; transparent pixels in whatever colour they have.
    pub color: Vec<[u8; 3]>,
    /// `[height, width]` whether nothing is there: the photo is transparent.
    pub transparent: Vec<bool>,
    /// `[height, width]` predicted camera z in the reconstructor's unit, later in scene units; 0 where unknown or transparent.
    pub depth: Vec<f32>,
    /// `[height, width]`, at least 1; 1 where the depth is unknown.
    pub confidence: Vec<f32>,
}

/// A frame's photo and known camera.
pub(super) struct Photo {
    pub image: DynamicImage,
    pub intrinsics: Intrinsics,
}

impl Photo {
    /// Opens the photo of a frame.
    ///
    /// # Errors
    /// When it cannot be read, contradicts its intrinsics, or has lens distortion, since no prior of such a photo can be used.
    pub fn open(frame: &RawFrame) -> Result<Self, DatasetError> {
        if !frame.lens.distortion.is_none() {
            return Err(DatasetError::Unsupported {
                path: frame.image_path.clone(),
                what: "depth for a photo with lens distortion".to_string(),
                expected: "an undistorted data set (colmap image_undistorter), from which the prediction is then made"
                    .to_string(),
            });
        }
        let image = pixels::decode(&frame.image_path)?;
        let resolved = frame.lens.resolve((image.width(), image.height()), &frame.image_path, &frame.file)?;
        Ok(Self { image, intrinsics: resolved.intrinsics })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.image.width() as usize, self.image.height() as usize)
    }
}

impl MappedView {
    /// Brings a prediction to the photo's proportions, at the prediction's resolution or the photo's if that is lower.
    pub fn new(
        frame: &RawFrame,
        photo: &Photo,
        predicted: &PredictedView,
        processed: (usize, usize),
        window: Window,
    ) -> Self {
        let full = photo.size();
        let shrink = window.scale.0.min(1.0);
        let side = |length: usize| ((length as f64 * shrink).round() as usize).max(1);
        let size = (side(full.0), side(full.1));
        let step = (full.0 as f64 / size.0 as f64, full.1 as f64 / size.1 as f64);
        let small = photo.image.resize_exact(size.0 as u32, size.1 as u32, FilterType::Triangle).to_rgba8();
        let source = Source { view: predicted, size: processed };
        let mut view = Self {
            name: frame.name.clone(),
            size,
            intrinsics: photo.intrinsics.scaled(1.0 / step.0, 1.0 / step.1),
            placed: Placed { rotation: DMat3::from_mat4(frame.c2w), centre: frame.c2w.w_axis.truncate() },
            color: Vec::with_capacity(size.0 * size.1),
            transparent: Vec::with_capacity(size.0 * size.1),
            depth: Vec::with_capacity(size.0 * size.1),
            confidence: Vec::with_capacity(size.0 * size.1),
        };
        for (x, y, pixel) in small.enumerate_pixels() {
            let (u, v) = window.to_processed((f64::from(x) + 0.5) * step.0, (f64::from(y) + 0.5) * step.1);
            let (depth, confidence) = if pixel[3] >= OPAQUE { source.at(u, v) } else { (0.0, 1.0) };
            view.color.push([pixel[0], pixel[1], pixel[2]]);
            view.transparent.push(pixel[3] < OPAQUE);
            view.depth.push(depth);
            view.confidence.push(if depth > 0.0 { confidence } else { 1.0 });
        }
        view
    }

    /// Position in the image of a pixel, from the corner.
    pub fn middle(&self, index: usize) -> DVec2 {
        DVec2::new((index % self.size.0) as f64 + 0.5, (index / self.size.0) as f64 + 0.5)
    }

    /// The pixel that a position in the image lies in; `None` outside.
    pub fn pixel(&self, position: DVec2) -> Option<usize> {
        // The comparison is false for NaN.
        let inside = position.x >= 0.0
            && position.y >= 0.0
            && position.x < self.size.0 as f64
            && position.y < self.size.1 as f64;
        inside.then(|| position.y as usize * self.size.0 + position.x as usize)
    }

    /// The world position at camera z `depth` on the ray of an image position.
    pub fn world(&self, position: DVec2, depth: f64) -> DVec3 {
        self.placed.rotation * (self.intrinsics.ray(position.x, position.y) * depth) + self.placed.centre
    }

    /// Camera axes of a world position.
    pub fn camera(&self, world: DVec3) -> DVec3 {
        self.placed.rotation.transpose() * (world - self.placed.centre)
    }
}

/// A prediction on its own pixels.
struct Source<'a> {
    view: &'a PredictedView,
    size: (usize, usize),
}

impl Source<'_> {
    /// Depth and confidence at a position, pixels from the corner; 0 and 1 outside. Depth is interpolated within a surface and that of
    /// the nearest pixel at edges, because the mean of two surfaces is a depth where nothing is.
    fn at(&self, u: f64, v: f64) -> (f32, f32) {
        let (width, height) = self.size;
        if !(u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
            return (0.0, 1.0);
        }
        let nearest = v as usize * width + u as usize;
        let confidence = self.view.confidence[nearest];
        let (left, top) = ((u - 0.5).max(0.0), (v - 0.5).max(0.0));
        let (x, y) = (left as usize, top as usize);
        let (x1, y1) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
        let corners = [(x, y), (x1, y), (x, y1), (x1, y1)].map(|(x, y)| self.view.depth[y * width + x]);
        let (low, high) = corners.iter().fold((f32::MAX, 0.0_f32), |(low, high), z| (low.min(*z), high.max(*z)));
        if high - low > EDGE * low {
            return (self.view.depth[nearest], confidence);
        }
        let (a, b) = (left.fract() as f32, top.fract() as f32);
        let row = |from: f32, to: f32| from + a * (to - from);
        let (above, below) = (row(corners[0], corners[1]), row(corners[2], corners[3]));
        (above + b * (below - above), confidence)
    }
}

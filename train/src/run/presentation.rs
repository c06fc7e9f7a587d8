//! How a scene is shown: its renderer, its times, and cameras with their photos.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DMat4;
use gs_burn::RenderOptions;
use gs_datasets::{Scene, View};
use gs_models::{DynamicScene, Shutter};
use image::codecs::jpeg::JpegEncoder;
use image::imageops::FilterType;
use image::{ExtendedColorType, ImageEncoder, RgbImage};
use serde::Serialize;

/// Most cameras of a split that have a button: more buttons are looked through by nobody.
const VIEWS_MAX: usize = 12;

/// Longest side of an embedded photo, pixels: 24 photos of 640 pixels take about 1.5 MB.
const PHOTO_SIDE: u32 = 640;

/// Quality of embedded photos, 1 to 100: no block shows beside a rendering.
const PHOTO_QUALITY: u8 = 90;

/// How a scene is shown.
#[derive(Debug, Clone)]
pub struct Presentation {
    /// The name of the scene.
    pub name: String,
    /// The options of its renderer.
    pub options: RenderOptions,
    /// The time to begin with.
    pub middle: f64,
    /// Its cameras; may be empty.
    pub cameras: Vec<Camera>,
    /// Distance of the subject from its cameras, scene units.
    pub distance: Option<f64>,
    /// How an exposure is formed, if the scene has a blur model.
    pub shutter: Option<Shutter>,
    /// From the scene's world to that of its data set, for key frames.
    pub world: DMat4,
}

/// A scene, and how it is shown.
pub struct PresentedScene {
    /// The scene.
    pub scene: Box<dyn DynamicScene>,
    /// How it is shown.
    pub presentation: Presentation,
}

/// A camera, as the JSON of a page has it.
#[derive(Debug, Clone, Serialize)]
pub struct Camera {
    /// Name of the view.
    pub name: String,
    /// Name of its split; empty for a camera that no data set has.
    pub split: String,
    /// Its time, the data set's unit.
    pub time: Option<f64>,
    /// Camera to world, column by column, OpenCV axes, the scene's world.
    pub c2w: [f64; 16],
    /// Focal lengths and principal point, pixels: fx, fy, cx, cy.
    pub k: [f64; 4],
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// The photo as a data URL.
    pub photo: Option<String>,
}

/// The cameras of a data set: of the split on which figures are reported, then of training, each spread evenly over its
/// views.
pub fn cameras(photos: &Scene) -> Vec<Camera> {
    let held_out = photos.reported().map(|split| (split.name.as_str(), split.views.as_slice()));
    let splits = held_out.into_iter().chain([("training", photos.train.as_slice())]);
    splits.flat_map(|(name, views)| spread(views).map(move |view| camera(view, name))).collect()
}

/// At most [`VIEWS_MAX`] views, first and last among them.
fn spread(views: &[View]) -> impl Iterator<Item = &View> {
    let count = views.len().min(VIEWS_MAX);
    let index = move |i: usize| if count < 2 { 0 } else { i * (views.len() - 1) / (count - 1) };
    (0..count).map(move |i| &views[index(i)])
}

/// The camera of a view of a split, with its photo.
pub fn camera(view: &View, split: &str) -> Camera {
    let k = &view.intrinsics;
    Camera {
        name: view.name.clone(),
        split: if split == "test" { "held out" } else { split }.into(),
        time: view.time,
        c2w: view.c2w.to_cols_array(),
        k: [k.fx, k.fy, k.cx, k.cy],
        size: [view.width, view.height],
        photo: photo(view),
    }
}

/// The photo as a data URL, at most [`PHOTO_SIDE`] pixels a side; `None` where it cannot be encoded.
fn photo(view: &View) -> Option<String> {
    let (width, height) = (view.width as u32, view.height as u32);
    let whole = RgbImage::from_raw(width, height, view.decoded().image.data.clone())?;
    let scale = f64::from(PHOTO_SIDE) / f64::from(width.max(height));
    let shown = match scale < 1.0 {
        true => {
            let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).max(1);
            image::imageops::resize(&whole, side(width), side(height), FilterType::Triangle)
        }
        false => whole,
    };
    let mut jpeg = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut jpeg, PHOTO_QUALITY);
    encoder.write_image(&shown, shown.width(), shown.height(), ExtendedColorType::Rgb8).ok()?;
    Some(format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_spread_over_all() {
        let views: Vec<View> = (0..100).map(|i| View { name: i.to_string(), ..View::blank(4, 3) }).collect();
        let names: Vec<&str> = spread(&views).map(|view| view.name.as_str()).collect();
        assert_eq!((names.len(), names[0], names[11]), (12, "0", "99"));
        assert_eq!(spread(&views[..1]).count(), 1);
        assert_eq!(spread(&[]).count(), 0);
    }

    #[test]
    fn photos_are_small() {
        let shown = photo(&View::blank(1280, 300)).expect("a photo");
        let jpeg = STANDARD.decode(shown.strip_prefix("data:image/jpeg;base64,").expect("a data URL")).expect("base64");
        let read = image::load_from_memory(&jpeg).expect("a JPEG");
        assert_eq!((read.width(), read.height()), (640, 150));
    }
}

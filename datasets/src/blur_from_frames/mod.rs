//! [`blur_from_frames`]: a blurry data set from sharp multi-view video, whose frames are its truth.
//!
//! A window of consecutive frames, averaged in linear light, is what an open shutter records over as many frame times;
//! the window's middle frame is sharp truth. Steps between frames show in the blur where things move by more than a
//! pixel from frame to frame.

mod camera;
mod window;

use std::path::Path;

use gs_base::write_atomic;
use serde_json::{Value, json};

use self::camera::{StaticCamera, cameras};
use self::window::blur_camera;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats;
use crate::names::some_names;
use crate::options::{LoadOptions, MaskUse};
use crate::raw::RawPoints;

/// How [`blur_from_frames`] blurs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BlurFromFrames {
    /// Consecutive frames that make a blurry one; odd, at least 3.
    pub window: usize,
    /// Frames from one window to the next, at least 1. Below `window` the exposures overlap.
    pub stride: usize,
    /// Wider images are downscaled to this width, pixels, in linear light.
    pub max_width: Option<usize>,
    /// The source's mask files show what moves in white. They become mask priors (the middle frame's) and truth (also
    /// the union over the window).
    pub moving_masks: bool,
}

impl Default for BlurFromFrames {
    fn default() -> Self {
        Self { window: 5, stride: 5, max_width: None, moving_masks: false }
    }
}

/// A summary of the data set written by [`blur_from_frames`].
#[derive(Debug, Clone, PartialEq)]
pub struct BlurSummary {
    /// Cameras with blurry photos to learn from.
    pub train_cameras: usize,
    /// Cameras with sharp photos to compare with.
    pub test_cameras: usize,
    /// Windows, over all cameras.
    pub photos: usize,
    /// How long the shutter seems to be open, in the source's unit of time.
    pub exposure: f64,
    /// Warnings about what was left out.
    pub warnings: Vec<String>,
}

/// Reads multi-view video from static cameras at `source` (any layout [`load`](crate::load) reads that gives times) and
/// writes a set in the layout of the blurry worlds of the crate `gs-worlds` to `out`: blurry photos of training cameras
/// with their sharp counterparts as truth; sharp photos of held-out cameras with blurry counterparts.
///
/// The source's own split decides which cameras are held out, otherwise one in 8 is. Lenses keep their distortion.
///
/// # Errors
/// When the window is not odd or longer than every camera's video, a stride is 0, a camera moves or changes its lens, a
/// frame has no time or the time of another, images differ in size, or a file cannot be read or written.
pub fn blur_from_frames(source: &Path, out: &Path, options: &BlurFromFrames) -> Result<BlurSummary, DatasetError> {
    check(source, options)?;
    let mut findings = Findings::default();
    let masks = if options.moving_masks { MaskUse::KeepWhite } else { MaskUse::Ignore };
    let raw = formats::read(source, &LoadOptions { masks, ..LoadOptions::default() }, &mut findings)?;
    let cameras = cameras(source, raw.frames)?;
    let mut written = Vec::new();
    let mut gaps = Vec::new();
    for camera in &cameras {
        let windows = camera.windows(options);
        if windows.skipped > 0 {
            gaps.push(format!("{} of camera {}", windows.skipped, camera.id));
        }
        written.push(blur_camera(out, camera, &windows, options)?);
    }
    if options.moving_masks && cameras.iter().all(|camera| camera.frames.iter().all(|frame| frame.masks.is_empty())) {
        findings.warn(format!("{}: masks of what moves were asked for, and no frame has one", source.display()));
    }
    if !gaps.is_empty() {
        findings.warn(format!(
            "{}: windows with missing frames were left out ({})",
            source.display(),
            some_names(&gaps)
        ));
    }
    finish(source, out, &cameras, written, raw.points.as_ref(), findings.take_warnings())
}

fn check(source: &Path, options: &BlurFromFrames) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: &str, found: usize| {
        let (path, expected) = (source.to_path_buf(), expected.to_string());
        Err(DatasetError::Option { path, option, expected, found: found.to_string() })
    };
    if options.window < 3 || options.window.is_multiple_of(2) {
        return wrong("window", "an odd number of frames of at least 3, so that one is in the middle", options.window);
    }
    if options.stride == 0 {
        return wrong("stride", "at least 1 frame", 0);
    }
    if options.max_width == Some(0) {
        return wrong("max_width", "a width of at least 1 pixel", 0);
    }
    Ok(())
}

/// Writes points and, last, the JSON.
fn finish(
    source: &Path,
    out: &Path,
    cameras: &[StaticCamera],
    written: Vec<Vec<Value>>,
    points: Option<&RawPoints>,
    warnings: Vec<String>,
) -> Result<BlurSummary, DatasetError> {
    let photos = written.iter().map(Vec::len).sum();
    let (mut train, mut test, mut summary) = (Vec::new(), Vec::new(), None);
    let (mut train_cameras, mut test_cameras) = (0, 0);
    for (camera, entries) in cameras.iter().zip(written).filter(|(_, entries)| !entries.is_empty()) {
        let (list, count) =
            if camera.is_test { (&mut test, &mut test_cameras) } else { (&mut train, &mut train_cameras) };
        *count += 1;
        summary = summary.or(entries[0]["exposure"].as_f64());
        list.extend(entries);
    }
    let Some(exposure) = summary.filter(|_| !train.is_empty()) else {
        let longest = cameras.iter().map(|camera| camera.frames.len()).max().unwrap_or(0);
        return Err(DatasetError::Option {
            path: source.to_path_buf(),
            option: "window",
            expected: "a window that fits into the video of a training camera without missing frames".to_string(),
            found: format!("cameras with at most {longest} frames"),
        });
    };
    if let Some(points) = points {
        write_atomic(&out.join("points3d.ply"), ply(points).as_bytes())?;
    }
    for (part, frames) in [("test", test), ("train", train)] {
        if frames.is_empty() {
            continue;
        }
        let mut top = json!({
            "exposure": exposure,
            "blur_space": "linear",
            "mask_meaning": "dynamic",
            "frames": frames,
        });
        if points.is_some() {
            top["ply_file_path"] = json!("points3d.ply");
        }
        write_atomic(&out.join(format!("transforms_{part}.json")), format!("{top:#}\n").as_bytes())?;
    }
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    Ok(BlurSummary { train_cameras, test_cameras, photos, exposure, warnings })
}

fn ply(points: &RawPoints) -> String {
    let lines = points.positions.iter().zip(&points.colors).map(|(position, [r, g, b])| {
        // As many digits as the source may have: coordinates can be large.
        format!("{} {} {} {r} {g} {b}\n", position.x, position.y, position.z)
    });
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        points.positions.len()
    );
    lines.fold(header, |text, line| text + &line)
}

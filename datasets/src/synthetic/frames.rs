//! [`blur_from_frames`]: a blurry data set from sharp multi-view video, whose frames are its truth.
//!
//! A window of consecutive frames, averaged in linear light, is what an open shutter records over as many frame times;
//! the window's middle frame is sharp truth. Steps between frames show in the blur where things move by more than a
//! pixel from frame to frame.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;
use serde_json::{Value, json};

use crate::error::DatasetError;
use crate::formats;
use crate::frame::Intrinsics;
use crate::image_io::{write_atomic, write_png};
use crate::light::{linear_of_bytes, to_byte, to_linear};
use crate::mask::Mask;
use crate::names;
use crate::options::{DEFAULT_HOLDOUT, LoadOptions, MaskUse};
use crate::pixels::{self, Photo};
use crate::pose::opencv_from_opengl;
use crate::raw::{Findings, MaskFile, Part, RawFrame, RawPoints, White, some_names};
use crate::resize::{AreaResampler, target_size};

/// Poses of one camera may differ by this much (rotation entries; translations likewise, relative to 1 scene unit)
/// before it counts as moving: room for numbers printed with six digits.
const STATIC_TOLERANCE: f64 = 1e-5;

/// Frames follow each other when the time between them is within this share of the camera's usual one.
const SPACING_TOLERANCE: f64 = 0.1;

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

/// What [`blur_from_frames`] wrote.
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
    /// What was left out, in sentences.
    pub warnings: Vec<String>,
}

/// Reads multi-view video from static cameras at `source` (any layout [`load`](crate::load) reads that gives times) and
/// writes a set in the layout of [`deblur::write`](super::deblur::write) to `out`: blurry photos of training cameras with
/// their sharp counterparts as truth; sharp photos of held-out cameras with blurry counterparts.
///
/// The source's own split decides which cameras are held out, otherwise every 8th is. Lenses keep their distortion.
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
    if !gaps.is_empty() {
        findings.warn(format!(
            "{}: windows with missing frames were left out ({})",
            source.display(),
            some_names(&gaps)
        ));
    }
    finish(source, out, &cameras, written, raw.points.as_ref(), findings.warnings)
}

fn check(source: &Path, options: &BlurFromFrames) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: &str, found: usize| {
        let (path, expected) = (source.to_path_buf(), expected.to_string());
        Err(DatasetError::Option { path, option, expected, found: found.to_string() })
    };
    if options.window < 3 || options.window % 2 == 0 {
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

/// A camera that stands still, its frames in order of time.
struct Still {
    id: String,
    /// A name for folders.
    folder: String,
    is_test: bool,
    frames: Vec<RawFrame>,
    /// Usual time between frames.
    spacing: f64,
}

/// The first frames of windows.
struct Windows {
    starts: Vec<usize>,
    skipped: usize,
}

/// Groups frames by camera and checks that each camera stands still.
fn cameras(source: &Path, frames: Vec<RawFrame>) -> Result<Vec<Still>, DatasetError> {
    let mut groups: BTreeMap<(usize, String), Vec<RawFrame>> = BTreeMap::new();
    for frame in frames {
        // Without a name a camera is known by where it stands.
        let id = frame.camera_id.clone().unwrap_or_else(|| format!("at {}", frame.c2w.w_axis.truncate()));
        // By length first: "2" before "10".
        groups.entry((id.len(), id)).or_default().push(frame);
    }
    let has_split = groups.values().flatten().any(|frame| frame.part == Some(Part::Test));
    let is_lone = groups.len() == 1;
    let mut cameras = Vec::new();
    for (index, ((_, id), frames)) in groups.into_iter().enumerate() {
        let is_test = match has_split {
            true => frames.iter().any(|frame| frame.part == Some(Part::Test)),
            false => !is_lone && index % DEFAULT_HOLDOUT == DEFAULT_HOLDOUT / 2,
        };
        let folder = match id.parse::<usize>() {
            Ok(number) => format!("cam{number:02}"),
            Err(_) if id.starts_with("at ") => format!("cam{index:02}"),
            Err(_) => names::view_name(Path::new(""), &id).replace(['/', ' '], "_"),
        };
        cameras.push(still(source, id, folder, is_test, frames)?);
    }
    names::make_unique(cameras.iter_mut().map(|camera| &mut camera.folder));
    if cameras.iter().all(|camera| camera.is_test) {
        let found = format!("{} held-out cameras", cameras.len());
        return Err(DatasetError::NoTrainingViews { path: source.to_path_buf(), found });
    }
    Ok(cameras)
}

fn still(
    source: &Path,
    id: String,
    folder: String,
    is_test: bool,
    mut frames: Vec<RawFrame>,
) -> Result<Still, DatasetError> {
    let timeless = |frame: &&RawFrame| !frame.time.is_some_and(f64::is_finite);
    if let Some(frame) = frames.iter().find(timeless) {
        let location = format!("frame {:?}", frame.name);
        return Err(DatasetError::malformed(&frame.file, location, "a time in every frame", "none"));
    }
    let time = |frame: &RawFrame| frame.time.unwrap_or(f64::NAN);
    frames.sort_by(|a, b| time(a).total_cmp(&time(b)));
    let first = &frames[0];
    for pair in frames.windows(2) {
        let (before, frame) = (&pair[0], &pair[1]);
        let wrong = |expected: &str, found: String| {
            DatasetError::malformed(&frame.file, format!("frame {:?} of camera {id}", frame.name), expected, found)
        };
        if time(frame) == time(before) {
            return Err(wrong("one frame at a time", format!("the time of {:?} again", before.name)));
        }
        let moved = (frame.c2w - first.c2w).to_cols_array().iter().fold(0.0_f64, |most, d| most.max(d.abs()));
        if moved > STATIC_TOLERANCE {
            let expected = "a camera that stands still (the frames of a moving one cannot be averaged)";
            return Err(wrong(expected, format!("a pose that differs by {moved:.2e} from {:?}", first.name)));
        }
        if frame.lens != first.lens {
            return Err(wrong("one lens per camera", format!("another than that of {:?}", first.name)));
        }
    }
    let mut gaps: Vec<f64> = frames.windows(2).map(|pair| time(&pair[1]) - time(&pair[0])).collect();
    gaps.sort_by(f64::total_cmp);
    let spacing = gaps.get(gaps.len() / 2).copied().ok_or_else(|| {
        let (location, expected) = (format!("camera {id}"), "video, that is several frames with different times");
        DatasetError::malformed(source, location, expected, "one frame")
    })?;
    Ok(Still { id, folder, is_test, frames, spacing })
}

impl Still {
    /// Windows of frames that follow each other without gaps.
    fn windows(&self, options: &BlurFromFrames) -> Windows {
        let mut windows = Windows { starts: Vec::new(), skipped: 0 };
        let mut start = 0;
        while start + options.window <= self.frames.len() {
            let times = self.frames[start..start + options.window].iter().map(|frame| frame.time.unwrap_or(f64::NAN));
            let times: Vec<f64> = times.collect();
            let is_even = |pair: &[f64]| ((pair[1] - pair[0]) / self.spacing - 1.0).abs() <= SPACING_TOLERANCE;
            if times.windows(2).all(is_even) {
                windows.starts.push(start)
            } else {
                windows.skipped += 1
            }
            start += options.stride;
        }
        windows
    }
}

/// The JSON entries of a camera's photos.
fn blur_camera(
    out: &Path,
    camera: &Still,
    windows: &Windows,
    options: &BlurFromFrames,
) -> Result<Vec<Value>, DatasetError> {
    let entries: Vec<Result<Value, DatasetError>> = windows
        .starts
        .par_iter()
        .enumerate()
        .map(|(index, start)| {
            let frames = &camera.frames[*start..start + options.window];
            let part = if camera.is_test { "test" } else { "train" };
            blur_window(out, camera, frames, &format!("{part}/{}/{index:04}", camera.folder), options)
        })
        .collect();
    entries.into_iter().collect()
}

/// Averages one window and writes its files.
fn blur_window(
    out: &Path,
    camera: &Still,
    frames: &[RawFrame],
    stem: &str,
    options: &BlurFromFrames,
) -> Result<Value, DatasetError> {
    let middle = &frames[frames.len() / 2];
    let photo = pixels::open(&middle.image_path, [0.0; 3])?;
    let size = photo.size();
    let target = target_size(size, options.max_width);
    let sharp = linear(&photo, target);
    let mut sum = vec![0.0; sharp.len()];
    for frame in frames {
        let photo = pixels::open(&frame.image_path, [0.0; 3])?;
        if photo.size() != size {
            let (width, height) = photo.size();
            let found = format!("{width} x {height} pixels where {:?} has {} x {}", middle.name, size.0, size.1);
            return Err(DatasetError::Image { path: frame.image_path.clone(), found });
        }
        for (sum, value) in sum.iter_mut().zip(linear(&photo, target)) {
            *sum += value;
        }
    }
    let count = frames.len() as f32;
    let blurry: Vec<u8> = sum.iter().map(|sum| to_byte(sum / count)).collect();
    let sharp: Vec<u8> = sharp.into_iter().map(to_byte).collect();
    let other = if camera.is_test { format!("truth/blurry/{stem}.png") } else { format!("truth/sharp/{stem}.png") };
    let own = format!("{stem}.png");
    let (sharp_path, blurry_path) = if camera.is_test { (&own, &other) } else { (&other, &own) };
    let png = |path: &str, data: &[u8]| write_png(&out.join(path), target.0, target.1, data);
    png(sharp_path, &sharp)?;
    png(blurry_path, &blurry)?;
    let resolved = middle.lens.resolve((size.0 as u32, size.1 as u32), &middle.image_path, &middle.file)?;
    let scale = (target.0 as f64 / size.0 as f64, target.1 as f64 / size.1 as f64);
    // The change of axes is its own inverse.
    let c2w = opencv_from_opengl(middle.c2w);
    let rows = [0, 1, 2, 3].map(|row| c2w.row(row).to_array());
    let mut entry = json!({
        "file_path": own,
        "time": middle.time,
        "exposure": camera.spacing * frames.len() as f64,
        "camera_id": camera.id,
        "transform_matrix": rows,
        "truth": { "sharp_path": sharp_path, "blurry_path": blurry_path },
    });
    add_lens(&mut entry, middle, resolved.intrinsics.scaled(scale.0, scale.1), target)?;
    if let Some((moving, union)) = masks(frames, size, target)? {
        let (path, union_path) = (format!("truth/masks/{stem}.png"), format!("truth/masks_union/{stem}.png"));
        png(&path, &moving)?;
        png(&union_path, &union)?;
        entry["truth"]["mask_path"] = json!(path);
        entry["truth"]["mask_union_path"] = json!(union_path);
        if !camera.is_test {
            let path = format!("priors/masks/{stem}.png");
            png(&path, &moving)?;
            entry["mask_path"] = json!(path);
        }
    }
    Ok(entry)
}

/// A photo in linear light at a smaller size, `[height, width, 3]`. A camera with larger pixels would have gathered the
/// light of those it covers, so downscaling comes after linearising.
fn linear(photo: &Photo, target: (usize, usize)) -> Vec<f32> {
    let (width, height) = photo.size();
    let table = linear_of_bytes();
    let is_bytes = matches!(photo, Photo::Rgb8(_));
    let mut resampler = AreaResampler::<3>::new((width, height), target);
    let mut row = vec![0.0; 3 * width];
    for y in 0..height {
        photo.copy_row(y, &mut row);
        for value in &mut row {
            *value = if is_bytes { table[*value as usize] } else { to_linear(*value / 255.0) };
        }
        resampler.push_row(&row);
    }
    resampler.finish()
}

fn add_lens(
    entry: &mut Value,
    frame: &RawFrame,
    intrinsics: Intrinsics,
    size: (usize, usize),
) -> Result<(), DatasetError> {
    let Intrinsics { fx, fy, cx, cy } = intrinsics;
    let lens = [("fl_x", fx), ("fl_y", fy), ("cx", cx), ("cy", cy), ("w", size.0 as f64), ("h", size.1 as f64)];
    let distortion = &frame.lens.distortion;
    if distortion.d != [0.0; 3] {
        return Err(DatasetError::Unsupported {
            path: frame.file.clone(),
            what: "a lens of the kind FULL_OPENCV".to_string(),
            expected: "at most k1 to k4, p1 and p2, which transforms.json can say".to_string(),
        });
    }
    let [k1, k2, k3, k4] = distortion.k;
    let [p1, p2] = distortion.p;
    let bend = [("k1", k1), ("k2", k2), ("k3", k3), ("k4", k4), ("p1", p1), ("p2", p2)];
    for (key, value) in lens.into_iter().chain(bend.into_iter().filter(|(_, value)| *value != 0.0)) {
        entry[key] = json!(value);
    }
    Ok(())
}

/// Where something moves in the middle frame and in any frame of a window, `[height, width]` each; `None` when a frame
/// has no mask.
fn masks(
    frames: &[RawFrame],
    size: (usize, usize),
    target: (usize, usize),
) -> Result<Option<(Vec<u8>, Vec<u8>)>, DatasetError> {
    let mut moving = Vec::new();
    let mut union = vec![0; target.0 * target.1];
    for (index, frame) in frames.iter().enumerate() {
        let Some(MaskFile { path, .. }) = frame.masks.first() else { return Ok(None) };
        let mask = Mask::open(&MaskFile { path: path.clone(), white: White::Keep }, size)?;
        let one: Vec<u8> = (0..union.len())
            .map(|i| {
                let (u, v) = ((i % target.0) as f64 + 0.5, (i / target.0) as f64 + 0.5);
                if mask.keeps(u, v, target) { 255 } else { 0 }
            })
            .collect();
        for (any, one) in union.iter_mut().zip(&one) {
            *any |= one;
        }
        if index == frames.len() / 2 {
            moving = one;
        }
    }
    Ok(Some((moving, union)))
}

/// Writes points and, last, the JSON.
fn finish(
    source: &Path,
    out: &Path,
    cameras: &[Still],
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
    let lines = points.positions.iter().zip(&points.colors).map(|(place, [r, g, b])| {
        // As many digits as the source may have: coordinates can be large.
        format!("{} {} {} {r} {g} {b}\n", place.x, place.y, place.z)
    });
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        points.positions.len()
    );
    lines.fold(header, |text, line| text + &line)
}

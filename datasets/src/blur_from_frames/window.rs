//! One window of frames: its average in linear light, its middle frame, its masks, and its entry in the JSON.

use std::path::Path;

use gs_base::Intrinsics;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::BlurFromFrames;
use super::camera::{StaticCamera, Windows};
use crate::behind::Behind;
use crate::error::DatasetError;
use crate::image_io::write_png;
use crate::light::{linear_of_bytes, to_byte, to_linear};
use crate::mask::Mask;
use crate::mask::{MaskFile, White};
use crate::pixels::{self, Photo};
use crate::pose::opencv_from_opengl;
use crate::projection::Projection;
use crate::raw::RawFrame;
use crate::resize::{AreaResampler, target_size};

/// Behind transparent pixels of the frames, which are averaged as light.
const BLACK: Behind = Behind { is_light: true, ..Behind::BLACK };

/// The JSON entries of a camera's photos.
pub(super) fn blur_camera(
    out: &Path,
    camera: &StaticCamera,
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
    camera: &StaticCamera,
    frames: &[RawFrame],
    stem: &str,
    options: &BlurFromFrames,
) -> Result<Value, DatasetError> {
    let middle = &frames[frames.len() / 2];
    let (width, height) = pixels::size_of(&middle.image_path)?;
    let size = (width as usize, height as usize);
    let target = target_size(size, options.max_width);
    let (mut sum, mut sharp) = (vec![0.0; 3 * target.0 * target.1], Vec::new());
    for (index, frame) in frames.iter().enumerate() {
        let photo = pixels::open(&frame.image_path, BLACK)?;
        if photo.size() != size {
            let (width, height) = photo.size();
            let found = format!("{width} x {height} pixels where {:?} has {} x {}", middle.name, size.0, size.1);
            return Err(DatasetError::Image { path: frame.image_path.clone(), found });
        }
        let light = linear(&photo, target);
        for (sum, value) in sum.iter_mut().zip(&light) {
            *sum += value;
        }
        if index == frames.len() / 2 {
            sharp = light;
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
    let resolved = middle.lens.resolve((width, height), &middle.image_path, &middle.file)?;
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
    if let Some(Moving { middle: moving, union }) = masks(frames, size, target)? {
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
    let kind = match frame.lens.projection {
        Projection::Pinhole => (distortion.d != [0.0; 3]).then_some("FULL_OPENCV"),
        other => Some(other.kind()),
    };
    if let Some(kind) = kind {
        return Err(DatasetError::Unsupported {
            path: frame.file.clone(),
            what: format!("a lens of the kind {kind}"),
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

/// Masks of a window, `[height, width]`, 255 where something moves.
struct Moving {
    middle: Vec<u8>,
    /// In any of the frames.
    union: Vec<u8>,
}

/// Reads a window's masks; `None` when a frame has none.
fn masks(frames: &[RawFrame], size: (usize, usize), target: (usize, usize)) -> Result<Option<Moving>, DatasetError> {
    let mut moving = Moving { middle: Vec::new(), union: vec![0; target.0 * target.1] };
    for (index, frame) in frames.iter().enumerate() {
        let Some(MaskFile { path, .. }) = frame.masks.first() else { return Ok(None) };
        let mask = Mask::open(&MaskFile { path: path.clone(), white: White::Keep }, size)?;
        let one: Vec<u8> = (0..moving.union.len())
            .map(|i| {
                let (u, v) = ((i % target.0) as f64 + 0.5, (i / target.0) as f64 + 0.5);
                if mask.keeps(u, v, target) { 255 } else { 0 }
            })
            .collect();
        for (any, one) in moving.union.iter_mut().zip(&one) {
            *any |= one;
        }
        if index == frames.len() / 2 {
            moving.middle = one;
        }
    }
    Ok(Some(moving))
}

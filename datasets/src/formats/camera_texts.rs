//! The folder that OmniVGGT takes as input: `images/NAME.png`, and `cameras/NAME.txt` with the camera of each photo.
//! Depth in `depths/NAME.npy` is read by [`import`](crate::import).
//!
//! A text holds three rows of camera to world (3 x 4, OpenCV axes) and three rows of intrinsics (3 x 3, pixels of the
//! photo); `#` begins a comment.

use std::path::{Path, PathBuf};

use glam::DMat4;
use gs_base::{counted, guarded};

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{entries, has_extension, stem};
use crate::lens::Lens;
use crate::names;
use crate::options::LoadOptions;
use crate::pixels;
use crate::pose;
use crate::priors::sources;
use crate::raw::{RawFrame, RawScene};
use crate::scene::SceneFormat;

/// Longest text, bytes: 21 numbers and comments.
const TEXT_MAX: u64 = 1 << 16;

/// Most texts that are looked at.
const TEXTS_MAX: usize = 1 << 16;

/// A folder with a text for each camera.
#[derive(Debug, Clone)]
pub(crate) struct CameraTexts {
    /// The folder that holds `images` and `cameras`.
    pub folder: PathBuf,
    /// The texts by name, sorted.
    pub files: Vec<PathBuf>,
}

/// A camera as its text gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WrittenCamera {
    /// Camera to world, OpenCV axes.
    pub c2w: DMat4,
    /// fx, fy, cx, cy, pixels of the photo.
    pub intrinsics: [f64; 4],
}

/// The texts in a folder; `None` where there is no `cameras/NAME.txt` with a camera beside a folder of photos.
pub(crate) fn find(path: &Path) -> Option<CameraTexts> {
    if !path.join("images").is_dir() {
        return None;
    }
    let is_text = |file: &PathBuf| has_extension(file, &["txt"]);
    let files: Vec<PathBuf> = entries(&path.join("cameras")).into_iter().filter(is_text).take(TEXTS_MAX).collect();
    let first = files.first()?;
    camera(first).is_ok().then(|| CameraTexts { folder: path.to_path_buf(), files })
}

/// Reads one text.
///
/// # Errors
/// When it cannot be read, holds no 21 finite numbers, or its pose is no rotation with a position.
pub(crate) fn camera(file: &Path) -> Result<WrittenCamera, DatasetError> {
    let text = guarded::read_to_string(file, TEXT_MAX)?;
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect();
    let wrong = |found: String| {
        let expected = "three rows of camera to world and three of intrinsics, 21 numbers";
        DatasetError::malformed(file, "content", expected, found)
    };
    let numbers = numbers.ok_or_else(|| wrong("other words".into()))?;
    let &[fx, _, cx, _, fy, cy, _, _, _] = numbers.get(12..).unwrap_or_default() else {
        return Err(wrong(counted(numbers.len(), "number")));
    };
    let row = |row: usize| std::array::from_fn(|column| numbers[4 * row + column]);
    let rows = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
    let c2w = pose::orthonormal(&rows, file, &stem(file))?.c2w;
    Ok(WrittenCamera { c2w, intrinsics: [fx, fy, cx, cy] })
}

/// Reads the description of a scene. A text without a photo is left out with a warning.
pub(crate) fn read(
    texts: &CameraTexts,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let root = texts.folder.join("images");
    let (mut frames, mut missing) = (Vec::new(), Vec::new());
    for file in &texts.files {
        let Some(image_path) = names::find_image(&root, &stem(file)) else {
            missing.push(stem(file));
            continue;
        };
        let frame = frame(file, &root, image_path);
        frames.extend(findings.take_posed(frame)?);
    }
    if !missing.is_empty() {
        let (count, names) = (counted(missing.len(), "camera"), names::some_names(&missing));
        findings.warn(format!("{}: {count} without a photo left out ({names})", root.display()));
    }
    let found = || format!("none of the photos of {}", counted(texts.files.len(), "camera"));
    findings.need_frames(&frames, &texts.folder, found)?;
    sources::search_depth(&mut frames, &texts.folder, options, findings);
    Ok(RawScene { format: SceneFormat::CameraTexts, frames, points: None })
}

fn frame(file: &Path, root: &Path, image_path: PathBuf) -> Result<RawFrame, DatasetError> {
    let WrittenCamera { c2w, intrinsics } = camera(file)?;
    let (width, height) = pixels::size_of(&image_path)?;
    let lens = Lens::of(intrinsics, (f64::from(width), f64::from(height)), Distortion::default());
    let name = names::output_name(root, &stem(file), file)?;
    Ok(RawFrame::posed(name, image_path, c2w, lens, file.to_path_buf()))
}

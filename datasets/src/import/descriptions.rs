//! The JSON of a data set with priors in another folder than its photos.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use gs_base::write_atomic;
use serde_json::{Map, Value, json};

use crate::error::DatasetError;
use crate::formats::json as reading;
use crate::formats::transforms::Sources;
use crate::names;
use crate::pixels;
use crate::pose::opencv_from_opengl;
use crate::priors::sources::FRAME_KEYS;
use crate::raw::{RawFrame, SplitName};
use crate::side_files::Kind;

/// The priors of a frame, relative to the new folder.
#[derive(Debug, Clone)]
pub(super) struct PriorFiles {
    pub depth: String,
    pub confidence: String,
}

/// Priors by the image file that they belong to.
pub(super) type ByImage = BTreeMap<PathBuf, PriorFiles>;

/// Name of the points in the new folder.
pub(super) const POINTS: &str = "points3d.ply";

/// Copies each JSON file of a set to `out`. Paths of files lead back to where they are; depth and confidence of an earlier prediction are
/// left out, because one `depth_kind` is said for all.
///
/// # Errors
/// When a file cannot be read or written.
pub(super) fn copy(sources: &Sources, out: &Path, priors: &ByImage) -> Result<(), DatasetError> {
    // The file of training comes first in the list and is written last: a folder without it is not finished.
    for (file, _) in sources.files.iter().rev() {
        let root = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let back = way(out, root)?;
        let mut top = reading::read(file)?;
        top.remove("integer_depth_scale");
        for (key, value) in &mut top {
            if key == "frames" {
                value.as_array_mut().into_iter().flatten().for_each(|frame| rewrite(frame, root, &back, priors));
            } else if key.ends_with("_filenames") {
                value.as_array_mut().into_iter().flatten().for_each(|path| rebase(path, &back));
            }
        }
        let name = file.file_name().unwrap_or_default();
        write(top, &out.join(name))?;
    }
    Ok(())
}

/// Writes a transforms.json for a set in another layout: poses, pinhole intrinsics, times, cameras and split. Masks are not carried over.
///
/// # Errors
/// When the size of a photo cannot be read or the file cannot be written.
pub(super) fn make(frames: &[RawFrame], out: &Path, priors: &ByImage) -> Result<(), DatasetError> {
    let mut top = Map::new();
    let mut entries = Vec::new();
    let mut lists: BTreeMap<&str, Vec<Value>> = BTreeMap::new();
    for frame in frames.iter().filter(|frame| frame.lens.distortion.is_none()) {
        let (width, height) = pixels::size_of(&frame.image_path)?;
        let k = frame.lens.resolve((width, height), &frame.image_path, &frame.file)?.intrinsics;
        let c2w = opencv_from_opengl(frame.c2w);
        let rows = [0, 1, 2, 3].map(|row| c2w.row(row).to_array());
        let folder = frame.image_path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let name = frame.image_path.file_name().unwrap_or_default().to_string_lossy();
        let path = format!("{}/{name}", way(out, folder.unwrap_or(Path::new(".")))?);
        let mut entry = json!({
            "file_path": path, "w": width, "h": height, "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy,
            "transform_matrix": rows,
        });
        let optional = [("time", frame.time), ("exposure", frame.exposure)];
        for (key, value) in optional.into_iter().filter_map(|(key, value)| Some((key, value?))) {
            entry[key] = json!(value);
        }
        if let Some(camera) = &frame.camera_id {
            entry["camera_id"] = json!(camera);
        }
        name_priors(&mut entry, priors.get(&frame.image_path));
        let list = match &frame.split {
            Some(SplitName::Validation) => "val",
            Some(split) => split.name(),
            None => "train",
        };
        lists.entry(list).or_default().push(json!(path));
        entries.push(entry);
    }
    if frames.iter().any(|frame| frame.split.is_some()) {
        lists.into_iter().for_each(|(name, list)| drop(top.insert(format!("{name}_filenames"), json!(list))));
    }
    top.insert("frames".to_string(), json!(entries));
    write(top, &out.join("transforms.json"))
}

/// Adds what the priors mean and writes the file.
fn write(mut top: Map<String, Value>, path: &Path) -> Result<(), DatasetError> {
    top.insert("depth_kind".to_string(), json!("metric_z"));
    top.insert("ply_file_path".to_string(), json!(POINTS));
    Ok(write_atomic(path, format!("{:#}\n", Value::Object(top)).as_bytes())?)
}

/// Leads the paths of one frame back and names its priors.
fn rewrite(frame: &mut Value, root: &Path, back: &str, priors: &ByImage) {
    let image = frame.get("file_path").and_then(Value::as_str).and_then(|path| names::find_image(root, path));
    if let Some(object) = frame.as_object_mut() {
        for (key, _) in FRAME_KEYS.iter().filter(|(_, kind)| matches!(kind, Kind::Depth | Kind::Confidence)) {
            object.remove(*key);
        }
    }
    rebase_all(frame, back);
    name_priors(frame, image.and_then(|image| priors.get(&image)));
}

fn name_priors(frame: &mut Value, priors: Option<&PriorFiles>) {
    if let (Some(object), Some(priors)) = (frame.as_object_mut(), priors) {
        object.insert("depth_file_path".to_string(), json!(priors.depth));
        object.insert("confidence_file_path".to_string(), json!(priors.confidence));
    }
}

/// Rebases every path of a frame, those of its truth among them.
fn rebase_all(value: &mut Value, back: &str) {
    for (key, value) in value.as_object_mut().into_iter().flatten() {
        match value {
            Value::Object(_) => rebase_all(value, back),
            Value::String(_) if key.ends_with("_path") => rebase(value, back),
            _ => {}
        }
    }
}

fn rebase(path: &mut Value, back: &str) {
    if let Value::String(text) = path {
        let slashed = names::with_slashes(text);
        if !Path::new(&slashed).is_absolute() {
            *text = format!("{back}/{slashed}");
        }
    }
}

/// The way from one folder to another, with `/` and without a slash at the end. Both must exist.
fn way(from: &Path, to: &Path) -> Result<String, DatasetError> {
    let whole = |path: &Path| path.canonicalize().map_err(|error| DatasetError::read(path, error));
    let (from, to) = (whole(from)?, whole(to)?);
    let (from, to): (Vec<Component>, Vec<Component>) = (from.components().collect(), to.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let mut parts = vec!["..".to_string(); from.len() - common];
    parts.extend(to[common..].iter().map(|part| part.as_os_str().to_string_lossy().into_owned()));
    Ok(if parts.is_empty() { ".".to_string() } else { parts.join("/") })
}

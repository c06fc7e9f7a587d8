//! The frames of one transforms.json file: flat, or nested by camera as NVFi writes them.

use std::path::Path;

use glam::DMat4;
use gs_base::sentence::number;
use gs_base::{agree, counted, printable};
use serde_json::{Map, Value};

use super::lens;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats::json::{self, Keys};
use crate::lens::Lens;
use crate::pose;
use crate::priors::sources::{FRAME_KEYS, TRUTH_KEYS};
use crate::side_files::Kind;

/// One frame as written, checked but without its image.
pub(super) struct Entry {
    /// `file_path` as written; `None` in camera paths.
    pub file_path: Option<String>,
    /// Camera to world, OpenCV axes.
    pub c2w: DMat4,
    pub lens: Lens,
    pub time: Option<f64>,
    pub camera_id: Option<String>,
    pub mask_path: Option<String>,
    /// Finite and not negative.
    pub exposure: Option<f64>,
    /// Files beside the photo, as written.
    pub sides: Vec<(Kind, String)>,
}

/// Reads all frames of a file in file order.
pub(super) fn read(top: &Map<String, Value>, file: &Path, findings: &mut Findings) -> Result<Vec<Entry>, DatasetError> {
    let mut scaled = Vec::new();
    let mut entries = Vec::new();
    for (frame, camera) in listed(top, file)? {
        let entry = read_entry(frame, camera, top, file, &mut scaled);
        entries.extend(findings.take_posed(entry)?);
    }
    if let Some((name, scale)) = scaled.first() {
        findings.warn(format!(
            "{}: the {} of {} a scale, which was divided out ({scale:.5} in frame {name:?})",
            file.display(),
            agree(scaled.len(), "rotation", "rotations"),
            counted(scaled.len(), "frame") + agree(scaled.len(), " has", " have")
        ));
    }
    Ok(entries)
}

type Object = Map<String, Value>;

/// A camera of the nested layout: its key and its object.
type Camera<'a> = (&'a str, &'a Object);

/// The frames with the camera they are nested in, if any.
fn listed<'a>(top: &'a Object, file: &Path) -> Result<Vec<(&'a Object, Option<Camera<'a>>)>, DatasetError> {
    let object = |value: &'a Value, location: String| {
        value.as_object().ok_or_else(|| DatasetError::malformed(file, location, "an object", json::kind(value)))
    };
    let frames_of = |holder: &'a Object, location: &str| -> Result<Vec<&'a Object>, DatasetError> {
        let frames = holder.get("frames").unwrap_or(&Value::Null);
        let list = frames.as_array().ok_or_else(|| {
            DatasetError::malformed(file, format!("{location}, key `frames`"), "a list of frames", json::kind(frames))
        })?;
        list.iter().enumerate().map(|(i, value)| object(value, format!("{location}, frame {i}"))).collect()
    };
    match top.get("data") {
        Some(Value::Object(cameras)) if !top.contains_key("frames") => {
            let mut all = Vec::new();
            for (key, camera) in cameras {
                let location = format!("camera {key:?}");
                let camera = object(camera, location.clone())?;
                all.extend(
                    frames_of(camera, &location)?.into_iter().map(|frame| (frame, Some((key.as_str(), camera)))),
                );
            }
            Ok(all)
        }
        _ => Ok(frames_of(top, "top level")?.into_iter().map(|frame| (frame, None)).collect()),
    }
}

fn read_entry(
    frame: &Object,
    camera: Option<Camera>,
    top: &Object,
    file: &Path,
    scaled: &mut Vec<(String, f64)>,
) -> Result<Entry, DatasetError> {
    let mut objects = vec![frame];
    objects.extend(camera.map(|(_, object)| object));
    let mut own = Keys { file, location: "a frame".to_string(), objects: objects.clone() };
    let file_path = path(&own, "file_path")?;
    let label = file_path.clone().unwrap_or_else(|| "without file_path".to_string());
    own.location = format!("frame {label:?}");

    let rows = matrix(&own, "transform_matrix")?;
    let rigid = pose::orthonormal(&rows, file, &label)?;
    scaled.extend(rigid.scale.map(|scale| (label, scale)));

    objects.push(top);
    let all = Keys { file, location: own.location.clone(), objects };
    let camera_id = match own.get("camera_id") {
        Some(Value::String(id)) => Some(printable(id).into_owned()),
        Some(Value::Number(id)) => Some(id.to_string()),
        _ => camera.map(|(key, _)| printable(key).into_owned()),
    };
    let time = own.number("time")?;
    Ok(Entry {
        file_path,
        c2w: pose::opencv_from_opengl(rigid.c2w),
        lens: lens::read(&all)?,
        time,
        camera_id,
        mask_path: path(&own, "mask_path")?,
        exposure: if time.is_some() { exposure(&all)? } else { None },
        sides: sides(&own)?,
    })
}

/// A path as written; an empty one is none.
fn path(keys: &Keys, key: &str) -> Result<Option<String>, DatasetError> {
    Ok(keys.text(key)?.filter(|path| !path.trim().is_empty()).map(str::to_string))
}

/// How long the shutter was open around the frame's time. Photos without a time may say other things under this key.
fn exposure(keys: &Keys) -> Result<Option<f64>, DatasetError> {
    match keys.number("exposure")? {
        Some(value) if value < 0.0 => {
            Err(keys.wrong("exposure", "a duration above 0, in the unit of `time`", number(value)))
        }
        other => Ok(other),
    }
}

/// The files that a frame's keys and its `truth` object name; the first key of a kind wins.
fn sides(keys: &Keys) -> Result<Vec<(Kind, String)>, DatasetError> {
    let mut found: Vec<(Kind, String)> = Vec::new();
    let mut add = |keys: &Keys, table: &[(&str, Kind)]| -> Result<(), DatasetError> {
        for (key, kind) in table {
            if let Some(path) = path(keys, key)?.filter(|_| found.iter().all(|(known, _)| known != kind)) {
                found.push((*kind, path));
            }
        }
        Ok(())
    };
    add(keys, FRAME_KEYS)?;
    match keys.get("truth") {
        None => {}
        Some(Value::Object(truth)) => {
            let location = format!("{}, key `truth`", keys.location);
            add(&Keys { file: keys.file, location, objects: vec![truth] }, TRUTH_KEYS)?;
        }
        Some(other) => return Err(keys.wrong("truth", "an object with paths", json::kind(other))),
    }
    Ok(found)
}

/// A 4 x 4 matrix, or 3 x 4 with the last row understood. Non-finite entries pass: the pose check names them.
fn matrix(keys: &Keys, key: &str) -> Result<[[f64; 4]; 4], DatasetError> {
    let value = keys.get(key).unwrap_or(&Value::Null);
    let three = || json::matrix(value).map(|[a, b, c]: [[f64; 4]; 3]| [a, b, c, [0.0, 0.0, 0.0, 1.0]]);
    json::matrix(value).or_else(three).ok_or_else(|| {
        let found = match value {
            Value::Array(rows) => no_number(rows).unwrap_or_else(|| row_lengths(rows)),
            Value::Null => "nothing".to_string(),
            other => json::kind(other),
        };
        keys.wrong(key, "4 (or 3) rows of 4 numbers", found)
    })
}

/// The first entry that is no number, of rows that are as many and as long as they should be.
fn no_number(rows: &[Value]) -> Option<String> {
    let whole = |row: &Value| row.as_array().is_some_and(|row| row.len() == 4);
    if ![3, 4].contains(&rows.len()) || !rows.iter().all(whole) {
        return None;
    }
    let mut entries = rows.iter().filter_map(Value::as_array).flatten().enumerate();
    let (index, value) = entries.find(|(_, value)| json::as_f64(value).is_none())?;
    Some(format!("{} in row {}, column {}", json::kind(value), index / 4, index % 4))
}

fn row_lengths(rows: &[Value]) -> String {
    let lengths: Vec<String> = rows
        .iter()
        .take(5)
        .map(|row| row.as_array().map_or_else(|| json::kind(row), |row| row.len().to_string()))
        .collect();
    format!("rows of {}", lengths.join(", "))
}

//! JSON files of a sequence: poses, time stamps, intrinsics.

use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use gs_datasets::guarded::{DESCRIPTION_MAX, read_to_string};
use gs_datasets::{DatasetError, Intrinsics};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::error::malformed;

/// Farthest an ego vehicle or a camera may be from the origin of its world, metres: twice the circumference of the Earth.
const POSITION_MAX: f64 = 8.0e7;

/// How far a heading's length may be from 1. Files keep 16 digits; more is no rotation.
const NORM_SLACK: f64 = 1e-2;

#[derive(Debug, Deserialize)]
struct Pose {
    position: Position,
    heading: Heading,
}

#[derive(Debug, Deserialize)]
struct Position {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Debug, Deserialize)]
struct Heading {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Debug, Deserialize)]
struct Pinhole {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

fn parse<T: DeserializeOwned>(path: &Path, expected: &str) -> Result<T, DatasetError> {
    let text = read_to_string(path, DESCRIPTION_MAX)?;
    serde_json::from_str(&text).map_err(|error| malformed(path, "the JSON", expected, error.to_string()))
}

/// Sensor to world, one pose a frame of the whole sequence.
pub(crate) fn poses(path: &Path) -> Result<Vec<DMat4>, DatasetError> {
    let list: Vec<Pose> = parse(path, "a list of poses with position and heading")?;
    list.iter()
        .enumerate()
        .map(|(index, Pose { position, heading })| {
            let position = DVec3::new(position.x, position.y, position.z);
            let heading = DQuat::from_xyzw(heading.x, heading.y, heading.z, heading.w);
            let wrong = |expected: &str, found: String| Err(malformed(path, format!("pose {index}"), expected, found));
            if !(position.is_finite() && position.abs().max_element() <= POSITION_MAX) {
                return wrong("a position in metres", position.to_string());
            }
            let off = (heading.length() - 1.0).abs();
            if off.is_nan() || off > NORM_SLACK {
                return wrong("a heading of length 1", format!("a length of {}", heading.length()));
            }
            Ok(DMat4::from_rotation_translation(heading.normalize(), position))
        })
        .collect()
}

/// Unix seconds, one a frame of the whole sequence.
pub(crate) fn timestamps(path: &Path) -> Result<Vec<f64>, DatasetError> {
    let list: Vec<f64> = parse(path, "a list of seconds")?;
    match list.iter().position(|time| !time.is_finite()) {
        Some(index) => Err(malformed(path, format!("entry {index}"), "seconds", list[index].to_string())),
        None => Ok(list),
    }
}

/// Intrinsics at the full size of the images.
pub(crate) fn intrinsics(path: &Path) -> Result<Intrinsics, DatasetError> {
    let Pinhole { fx, fy, cx, cy } = parse(path, "fx, fy, cx and cy")?;
    if !(fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0 && cx.is_finite() && cy.is_finite()) {
        let found = format!("fx {fx}, fy {fy}, cx {cx}, cy {cy}");
        return Err(malformed(path, "the intrinsics", "focal lengths above 0 and a finite centre", found));
    }
    Ok(Intrinsics { fx, fy, cx, cy })
}

//! JSON files of a sequence: poses, time stamps, intrinsics.

use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use gs_base::Intrinsics;
use gs_base::guarded::{DESCRIPTION_MAX, read_to_string};
use gs_datasets::DatasetError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};

/// Farthest an ego vehicle or a camera may be from the origin of its world, metres: twice the circumference of the
/// Earth.
const POSITION_MAX: f64 = 8.0e7;

/// Latest time, Unix seconds: in the year 5138.
const TIME_MAX: f64 = 1e11;

/// How far a heading's length may be from 1. Files keep 16 digits; more is no rotation.
const NORM_SLACK: f64 = 1e-2;

#[derive(Debug, Deserialize)]
struct Pose {
    position: Position,
    heading: Heading,
}

#[derive(Debug, Deserialize)]
struct Position {
    #[serde(deserialize_with = "or_nan")]
    x: f64,
    #[serde(deserialize_with = "or_nan")]
    y: f64,
    #[serde(deserialize_with = "or_nan")]
    z: f64,
}

#[derive(Debug, Deserialize)]
struct Heading {
    #[serde(deserialize_with = "or_nan")]
    w: f64,
    #[serde(deserialize_with = "or_nan")]
    x: f64,
    #[serde(deserialize_with = "or_nan")]
    y: f64,
    #[serde(deserialize_with = "or_nan")]
    z: f64,
}

#[derive(Debug, Deserialize)]
struct Pinhole {
    #[serde(deserialize_with = "or_nan")]
    fx: f64,
    #[serde(deserialize_with = "or_nan")]
    fy: f64,
    #[serde(deserialize_with = "or_nan")]
    cx: f64,
    #[serde(deserialize_with = "or_nan")]
    cy: f64,
}

/// Programs write NaN and infinities, which are no JSON. As null they are numbers that are not finite, and the error
/// names their entry.
fn parse<T: DeserializeOwned>(path: &Path, expected: &str) -> Result<T, DatasetError> {
    let text = read_to_string(path, DESCRIPTION_MAX)?;
    let wrong = |error: serde_json::Error| DatasetError::malformed(path, "the JSON", expected, error.to_string());
    serde_json::from_str(&text).or_else(|_| serde_json::from_str(&without_nan(&text))).map_err(wrong)
}

/// JSON with null in place of the words that Python, C and Windows write for numbers that are not finite.
fn without_nan(text: &str) -> String {
    const WORDS: [&str; 7] = ["-Infinity", "Infinity", "NaN", "-nan(ind)", "nan", "-inf", "inf"];
    let parts = text.split('"').enumerate();
    // Every second part is inside quotes. No name in these files has one.
    let part = |(index, part): (usize, &str)| match index % 2 {
        0 => WORDS.iter().fold(part.to_string(), |part, word| part.replace(word, "null")),
        _ => part.to_string(),
    };
    parts.map(part).collect::<Vec<_>>().join("\"")
}

fn or_nan<'de, D: Deserializer<'de>>(number: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(number)?.unwrap_or(f64::NAN))
}

/// Sensor to world, one pose a frame of the whole sequence.
pub(crate) fn poses(path: &Path) -> Result<Vec<DMat4>, DatasetError> {
    let list: Vec<Pose> = parse(path, "a list of poses with position and heading")?;
    list.iter()
        .enumerate()
        .map(|(index, Pose { position, heading })| {
            let position = DVec3::new(position.x, position.y, position.z);
            let heading = DQuat::from_xyzw(heading.x, heading.y, heading.z, heading.w);
            let wrong = |expected: &str, found: String| {
                Err(DatasetError::malformed(path, format!("pose {index}"), expected, found))
            };
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
    let list: Vec<Option<f64>> = parse(path, "a list of seconds")?;
    let second = |(index, time): (usize, Option<f64>)| {
        let time = time.unwrap_or(f64::NAN);
        let wrong = || DatasetError::malformed(path, format!("entry {index}"), "Unix seconds", format!("{time:e}"));
        // Also refuses NaN.
        if time.abs() <= TIME_MAX { Ok(time) } else { Err(wrong()) }
    };
    list.into_iter().enumerate().map(second).collect()
}

/// Intrinsics at the full size of the images.
pub(crate) fn intrinsics(path: &Path) -> Result<Intrinsics, DatasetError> {
    let Pinhole { fx, fy, cx, cy } = parse(path, "fx, fy, cx and cy")?;
    if !(fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0 && cx.is_finite() && cy.is_finite()) {
        let found = format!("fx {fx}, fy {fy}, cx {cx}, cy {cy}");
        return Err(DatasetError::malformed(
            path,
            "the intrinsics",
            "focal lengths above 0 and a finite centre",
            found,
        ));
    }
    Ok(Intrinsics { fx, fy, cx, cy })
}

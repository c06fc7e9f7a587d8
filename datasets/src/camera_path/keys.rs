//! Key frames: a JSON file with some cameras, and the path through them.
//!
//! ```json
//! {"keyframes": [
//!    {"position": [0, 1, -4], "look_at": [0, 0, 0], "up": [0, 1, 0], "time": 0.0, "fov": 50},
//!    {"position": [2, 1, -3], "rotation": [1, 0, 0, 0], "time": 1.0}],
//!  "width": 1024, "height": 768, "images": 120, "closed": false}
//! ```
//!
//! Positions are in the data set's own world. `rotation` is w x y z, camera to world, OpenCV axes; `look_at` with `up`
//! (else up is -y, as in COLMAP's worlds) stands for one. `fov` is the vertical angle of view in degrees; `time` is in
//! the data set's unit. Only `keyframes` and `position` with a `rotation` or `look_at` are needed.

use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use gs_base::Intrinsics;
use serde_json::{Map, Value};

use super::looking;
use crate::error::DatasetError;
use crate::formats::json::{self, Keys};
use crate::frame::CameraPose;

/// Size and angle of view where the file says nothing.
const SIZE: [f64; 2] = [1024.0, 768.0];
const FOV: f64 = 50.0;
/// Images from one key frame to the next where the file says nothing: two seconds of film.
const IMAGES: usize = 48;
/// Most images of a path, and longest side of one, pixels.
pub(super) const IMAGES_MAX: f64 = 100_000.0;
pub(super) const SIDE_MAX: f64 = 16_384.0;
/// Least and largest angle of view, degrees.
pub(super) const FOVS: [f64; 2] = [0.1, 179.0];
/// Farthest position: squares stay within what an f32 holds.
const FARTHEST: f64 = 1e15;

/// A file of key frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct KeyFrames {
    keys: Vec<Key>,
    width: usize,
    height: usize,
    images: usize,
    closed: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Key {
    position: DVec3,
    rotation: DQuat,
    time: Option<f64>,
    fov: f64,
}

impl KeyFrames {
    /// The key frames of a file; `None` where it is another one.
    ///
    /// # Errors
    /// When it has `keyframes` that are not as they must be.
    pub(super) fn find(top: &Map<String, Value>, file: &Path) -> Result<Option<Self>, DatasetError> {
        let Some(list) = top.get("keyframes") else { return Ok(None) };
        let keys = Keys { file, location: "top level".into(), objects: vec![top] };
        let list = list.as_array().filter(|list| !list.is_empty());
        let list = list.ok_or_else(|| keys.wrong("keyframes", "a list of key frames", "another value".into()))?;
        let read = |(index, value): (usize, &Value)| key(value, index, file);
        let found = list.iter().enumerate().map(read).collect::<Result<Vec<_>, _>>()?;
        let closed = top.get("closed").and_then(Value::as_bool).unwrap_or(false);
        let stretches = if closed { found.len() } else { (found.len() - 1).max(1) };
        let images = ranged(&keys, "images", (IMAGES * stretches) as f64, [1.0, IMAGES_MAX])?;
        Ok(Some(Self {
            width: ranged(&keys, "width", SIZE[0], [1.0, SIDE_MAX])? as usize,
            height: ranged(&keys, "height", SIZE[1], [1.0, SIDE_MAX])? as usize,
            images: images as usize,
            keys: found,
            closed,
        }))
    }

    /// The path: positions on a smooth curve through the key frames, orientations by the shortest turn from one to the
    /// next.
    pub fn cameras(&self) -> Vec<CameraPose> {
        (0..self.images).map(|index| self.camera(index)).collect()
    }

    fn camera(&self, index: usize) -> CameraPose {
        let last = self.keys.len() - 1;
        let (stretches, steps) =
            if self.closed { (self.keys.len(), self.images) } else { (last, self.images.max(2) - 1) };
        let along = stretches as f64 * index as f64 / steps as f64;
        let from = (along.floor() as usize).min(stretches.saturating_sub(1));
        let share = along - from as f64;
        let at = |offset: isize| {
            let place = from as isize + offset;
            let place =
                if self.closed { place.rem_euclid(self.keys.len() as isize) } else { place.clamp(0, last as isize) };
            self.keys[place as usize]
        };
        let (before, a, b, after) = (at(-1), at(0), at(1), at(2));
        let mix = |a: f64, b: f64| a + share * (b - a);
        let height = self.height as f64;
        let focal = 0.5 * height / (0.5 * mix(a.fov, b.fov).to_radians()).tan();
        CameraPose {
            name: format!("path_{index:04}"),
            c2w: DMat4::from_rotation_translation(
                a.rotation.slerp(b.rotation, share),
                curve([before, a, b, after].map(|key| key.position), share),
            ),
            intrinsics: Intrinsics { fx: focal, fy: focal, cx: 0.5 * self.width as f64, cy: 0.5 * height },
            width: self.width,
            height: self.height,
            time: a.time.zip(b.time).map(|(a, b)| mix(a, b)),
        }
    }
}

/// Catmull and Rom's curve from the second to the third point.
fn curve([a, b, c, d]: [DVec3; 4], x: f64) -> DVec3 {
    0.5 * (2.0 * b + (c - a) * x + (2.0 * a - 5.0 * b + 4.0 * c - d) * x * x + (3.0 * b - 3.0 * c + d - a) * x * x * x)
}

pub(super) fn ranged(keys: &Keys, name: &str, otherwise: f64, [least, most]: [f64; 2]) -> Result<f64, DatasetError> {
    let found = keys.number(name)?.unwrap_or(otherwise);
    if (least..=most).contains(&found) {
        return Ok(found);
    }
    Err(keys.wrong(name, &format!("a number from {least} to {most}"), found.to_string()))
}

fn key(value: &Value, index: usize, file: &Path) -> Result<Key, DatasetError> {
    let location = format!("key frame {index}");
    let object = value
        .as_object()
        .ok_or_else(|| DatasetError::malformed(file, location.clone(), "an object", json::kind(value)))?;
    let keys = Keys { file, location, objects: vec![object] };
    let numbers = |name: &str, count: usize| -> Result<Option<Vec<f64>>, DatasetError> {
        let Some(value) = keys.get(name) else { return Ok(None) };
        let sound = |list: &Vec<f64>| list.len() == count && list.iter().all(|x| x.is_finite() && x.abs() <= FARTHEST);
        let wrong = || keys.wrong(name, &format!("{count} finite numbers"), json::kind(value));
        json::numbers(value).filter(sound).map(Some).ok_or_else(wrong)
    };
    let vector = |name: &str| Ok::<_, DatasetError>(numbers(name, 3)?.map(|v| DVec3::new(v[0], v[1], v[2])));
    let position = vector("position")?.ok_or_else(|| keys.wrong("position", "3 numbers", "nothing".into()))?;
    let (rotation, target) = (numbers("rotation", 4)?, vector("look_at")?);
    let rotation = match (rotation, target) {
        (Some(q), _) => {
            let q = DQuat::from_xyzw(q[1], q[2], q[3], q[0]);
            (q.length() > 0.0).then(|| q.normalize()).filter(|q| q.is_finite())
        }
        (None, Some(target)) => {
            let up = vector("up")?.unwrap_or(DVec3::NEG_Y);
            looking(position, target, up).map(|c2w| super::orientation(&c2w))
        }
        (None, None) => None,
    };
    let rotation = rotation.ok_or_else(|| {
        let expected = "a rotation (w x y z), or a point to look at that is not above or below";
        keys.wrong("rotation", expected, "none".into())
    })?;
    Ok(Key { position, rotation, time: keys.number("time")?, fov: ranged(&keys, "fov", FOV, FOVS)? })
}

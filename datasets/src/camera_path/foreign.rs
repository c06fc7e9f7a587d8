//! Cameras as other programs write them for their viewers.
//!
//! The trainer of 3D Gaussian Splatting (Inria) and its kin leave a `cameras.json`: a list of cameras with `img_name`,
//! `width`, `height`, `fx`, `fy`, `position`, and `rotation`, the rows of camera to world in OpenCV axes. The principal
//! point is the middle.
//!
//! nerfstudio's viewer saves a `camera_path.json`: `render_width`, `render_height` and a list `camera_path`, each with
//! `camera_to_world` (16 numbers, row by row, OpenGL axes), `fov` (vertical, degrees) and perhaps `render_time`. Its
//! world is that of nerfstudio's scene, which may be turned and scaled against the data set's.

use std::path::Path;

use gs_base::Intrinsics;
use serde_json::{Map, Value};

use super::keys::{FOVS, IMAGES_MAX, SIDE_MAX, ranged};
use crate::error::DatasetError;
use crate::formats::json::{self, Keys};
use crate::frame::CameraPose;
use crate::names;
use crate::pose::{opencv_from_opengl, rigid};

/// Largest focal length, pixels: a side of [`SIDE_MAX`] seen at a ten-thousandth of a degree.
const FOCAL_MAX: f64 = 1e10;

/// The cameras of a list as Inria's trainer writes it.
pub(super) fn of_list(list: &[Value], file: &Path) -> Result<Vec<CameraPose>, DatasetError> {
    let entries = entries(list, "cameras", file)?;
    let mut cameras = entries.iter().map(inria).collect::<Result<Vec<_>, _>>()?;
    names::make_unique(cameras.iter_mut().map(|camera| &mut camera.name));
    Ok(cameras)
}

/// The cameras of a path as nerfstudio's viewer writes it; `None` for another file.
pub(super) fn of_path(top: &Map<String, Value>, file: &Path) -> Result<Option<Vec<CameraPose>>, DatasetError> {
    let Some(list) = top.get("camera_path") else { return Ok(None) };
    let keys = Keys { file, location: "top level".into(), objects: vec![top] };
    let kind = keys.text("camera_type")?.unwrap_or("perspective");
    if !kind.eq_ignore_ascii_case("perspective") {
        return Err(keys.wrong("camera_type", "perspective, which is the one that is rendered", format!("{kind:?}")));
    }
    let list = list.as_array().ok_or_else(|| keys.wrong("camera_path", "a list of cameras", json::kind(list)))?;
    let size = |name: &str| -> Result<usize, DatasetError> { Ok(wanted(&keys, name, [1.0, SIDE_MAX])? as usize) };
    let (width, height) = (size("render_width")?, size("render_height")?);
    let entries = entries(list, "camera_path", file)?;
    let times = entries.iter().map(|keys| keys.number("render_time")).collect::<Result<Option<Vec<f64>>, _>>()?;
    let camera = |(index, keys): (usize, &Keys)| {
        let fov = wanted(keys, "fov", FOVS)?;
        let focal = 0.5 * height as f64 / (0.5 * fov.to_radians()).tan();
        let c2w = rigid(&matrix(keys)?, file, &keys.location)?.c2w;
        Ok(CameraPose {
            name: format!("path_{index:04}"),
            c2w: opencv_from_opengl(c2w),
            intrinsics: Intrinsics { fx: focal, fy: focal, cx: 0.5 * width as f64, cy: 0.5 * height as f64 },
            width,
            height,
            time: times.as_ref().map(|times| times[index]),
        })
    };
    entries.iter().enumerate().map(camera).collect::<Result<Vec<_>, _>>().map(Some)
}

fn entries<'a>(list: &'a [Value], name: &str, file: &'a Path) -> Result<Vec<Keys<'a>>, DatasetError> {
    if list.is_empty() || list.len() as f64 > IMAGES_MAX {
        let expected = format!("1 to {IMAGES_MAX} cameras");
        return Err(DatasetError::malformed(file, name, expected, format!("a list of {}", list.len())));
    }
    let entry = |(index, value): (usize, &'a Value)| {
        let location = format!("camera {index}");
        match value.as_object() {
            Some(object) => Ok(Keys { file, location, objects: vec![object] }),
            None => Err(DatasetError::malformed(file, location, "an object", json::kind(value))),
        }
    };
    list.iter().enumerate().map(entry).collect()
}

fn inria(keys: &Keys) -> Result<CameraPose, DatasetError> {
    let name = match keys.text("img_name")? {
        Some(name) => names::output_name(Path::new(""), name, keys.file)?,
        None => keys.location.replace(' ', "_"),
    };
    let size = |name: &str| -> Result<usize, DatasetError> { Ok(wanted(keys, name, [1.0, SIDE_MAX])? as usize) };
    let (width, height) = (size("width")?, size("height")?);
    let focal = |name: &str| wanted(keys, name, [f64::MIN_POSITIVE, FOCAL_MAX]);
    let position = numbers::<3>(keys, "position", keys.get("position"))?;
    let rows = keys.get("rotation").and_then(Value::as_array).map(Vec::as_slice);
    let Some([a, b, c]) = rows else {
        return Err(keys.wrong(
            "rotation",
            "3 rows of 3 numbers",
            keys.get("rotation").map_or("none".into(), json::kind),
        ));
    };
    let row = |value: &Value, last: f64| -> Result<[f64; 4], DatasetError> {
        let [x, y, z] = numbers(keys, "rotation", Some(value))?;
        Ok([x, y, z, last])
    };
    let rows = [row(a, position[0])?, row(b, position[1])?, row(c, position[2])?, [0.0, 0.0, 0.0, 1.0]];
    Ok(CameraPose {
        c2w: rigid(&rows, keys.file, &name)?.c2w,
        name,
        intrinsics: Intrinsics { fx: focal("fx")?, fy: focal("fy")?, cx: 0.5 * width as f64, cy: 0.5 * height as f64 },
        width,
        height,
        time: None,
    })
}

/// A number that must be there, within a range.
fn wanted(keys: &Keys, name: &str, range: [f64; 2]) -> Result<f64, DatasetError> {
    if keys.get(name).is_none() {
        return Err(keys.wrong(name, "a number", "none".into()));
    }
    ranged(keys, name, 0.0, range)
}

fn matrix(keys: &Keys) -> Result<[[f64; 4]; 4], DatasetError> {
    let flat: [f64; 16] = numbers(keys, "camera_to_world", keys.get("camera_to_world"))?;
    Ok([0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| flat[4 * row + column])))
}

fn numbers<const N: usize>(keys: &Keys, name: &str, value: Option<&Value>) -> Result<[f64; N], DatasetError> {
    let list = value.and_then(json::numbers);
    let found = || value.map_or("none".into(), json::kind);
    list.and_then(|list| list.try_into().ok()).ok_or_else(|| keys.wrong(name, &format!("{N} numbers"), found()))
}

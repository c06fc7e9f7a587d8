//! Camera paths for films: round a subject, a spiral before it, between two cameras, and through key frames that a
//! viewer saved.
//!
//! All are cameras in the data set's own world, OpenCV axes, and are named after the path and their number.

mod foreign;
mod keys;
mod ring;
#[cfg(test)]
mod tests;

use std::path::Path;

use glam::{DMat3, DMat4, DQuat, DVec3};
use gs_base::Intrinsics;

use serde_json::Value;

use crate::error::DatasetError;
use crate::formats::json;
use crate::frame::CameraPose;

use keys::KeyFrames;
pub use ring::{orbit, spiral};

/// The cameras of a JSON file of key frames, of Inria's cameras.json or of nerfstudio's camera_path.json; `None` for
/// another JSON file.
///
/// # Errors
/// When it is no JSON, or one of these and not as it must be.
pub fn in_file(file: &Path) -> Result<Option<Vec<CameraPose>>, DatasetError> {
    let top = match json::read_value(file)? {
        Value::Array(list) => return foreign::of_list(&list, file).map(Some),
        Value::Object(top) => top,
        _ => return Ok(None),
    };
    // A path of nerfstudio has key frames of its own beside it.
    if let Some(cameras) = foreign::of_path(&top, file)? {
        return Ok(Some(cameras));
    }
    Ok(KeyFrames::find(&top, file)?.map(|path| path.cameras()))
}

/// Up of the world by its cameras, a unit vector: people hold cameras upright. `None` where they cancel.
pub fn up(cameras: &[CameraPose]) -> Option<DVec3> {
    cameras.iter().map(|camera| -camera.c2w.y_axis.truncate()).sum::<DVec3>().try_normalize()
}

/// `count` cameras from `first` to `last`, both included: positions on a straight line, orientations by the shortest
/// turn.
pub fn between(first: &CameraPose, last: &CameraPose, count: usize) -> Vec<CameraPose> {
    let (from, to) = (orientation(&first.c2w), orientation(&last.c2w));
    let camera = |index: usize| {
        let share = index as f64 / (count.max(2) - 1) as f64;
        let centre = first.c2w.w_axis.truncate().lerp(last.c2w.w_axis.truncate(), share);
        let mix = |a: f64, b: f64| a + share * (b - a);
        // Focal lengths and principal points are of each camera's own size: they go from one to the other in image
        // sides.
        let (a, b) = (in_sides(first), in_sides(last));
        let [width, height] = [first.width as f64, first.height as f64];
        let intrinsics = Intrinsics {
            fx: mix(a[0], b[0]) * width,
            fy: mix(a[1], b[1]) * height,
            cx: mix(a[2], b[2]) * width,
            cy: mix(a[3], b[3]) * height,
        };
        let time = first.time.zip(last.time).map(|(a, b)| mix(a, b));
        CameraPose {
            name: format!("between_{index:04}"),
            c2w: DMat4::from_rotation_translation(from.slerp(to, share), centre),
            intrinsics,
            time,
            ..first.clone()
        }
    };
    (0..count).map(camera).collect()
}

/// Spreads times over a path, both ends included.
pub fn spread_times(cameras: &mut [CameraPose], [first, last]: [f64; 2]) {
    let step = (last - first) / (cameras.len().max(2) - 1) as f64;
    cameras.iter_mut().enumerate().for_each(|(index, camera)| camera.time = Some(first + step * index as f64));
}

fn in_sides(camera: &CameraPose) -> [f64; 4] {
    let Intrinsics { fx, fy, cx, cy } = camera.intrinsics;
    let (width, height) = (camera.width as f64, camera.height as f64);
    [fx / width, fy / height, cx / width, cy / height]
}

fn orientation(c2w: &DMat4) -> DQuat {
    DQuat::from_mat3(&DMat3::from_mat4(*c2w)).normalize()
}

/// A camera at `centre` that looks at `target`; `None` where it is there, or `up` is along the line of sight.
fn looking(centre: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let z = (target - centre).try_normalize()?;
    let x = z.cross(up).try_normalize()?;
    let rotation = DMat3::from_cols(x, z.cross(x), z);
    Some(DMat4::from_cols(x.extend(0.0), rotation.y_axis.extend(0.0), z.extend(0.0), centre.extend(1.0)))
}

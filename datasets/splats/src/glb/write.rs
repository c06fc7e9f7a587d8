//! Writing.

use std::path::Path;

use gs_base::{FileError, write_atomic};
use serde_json::{Map, Value, json};

use super::arrays::Arrays;
use super::{BIN_CHUNK, JSON_CHUNK, MAGIC, MOTION, SPLATS, harmonic_name, motion};
use crate::splats::{sigmoid, unit_xyzw};
use crate::turn::{flip, flip_motion};
use crate::{MARK, Motion, Splats};

/// Writes a scene, and its motion if it moves; `linear` says that colours are linear light and not as a display takes
/// them.
///
/// # Errors
/// When the file cannot be written, there is no Gaussian, a value is not finite, a row of the motion is none of the
/// scene, or the file would be longer than 4 GiB, which glTF cannot say.
pub fn write(path: &Path, splats: &Splats, motion: Option<&Motion>, linear: bool) -> Result<(), FileError> {
    let bytes = encode(splats, motion, linear);
    write_atomic(path, &bytes.map_err(|message| FileError::wrong(path, message))?)
}

/// The bytes of [`write()`].
///
/// # Errors
/// A sentence without the file's name.
pub fn encode(splats: &Splats, motion: Option<&Motion>, linear: bool) -> Result<Vec<u8>, String> {
    splats.check()?;
    if splats.is_empty() {
        return Err("expected Gaussians for glTF, which knows no empty arrays, found none".into());
    }
    motion.map_or(Ok(()), |motion| motion.check(splats.len()))?;
    let splats = flip(splats);
    let mut arrays = Arrays::default();
    let attributes = attributes(&splats, &mut arrays, linear);
    let mut used = vec![SPLATS];
    let space = if linear { "lin_rec709_display" } else { "srgb_rec709_display" };
    let mut extensions = Map::new();
    extensions.insert(SPLATS.into(), json!({"kernel": "ellipse", "colorSpace": space}));
    if let Some(motion) = motion.filter(|motion| !motion.rows.is_empty()) {
        used.push(MOTION);
        extensions.insert(MOTION.into(), motion::to_json(&flip_motion(motion), &splats.means, &mut arrays));
    }
    let mut extras = splats.antialiased.map_or(json!({}), |antialiased| json!({"antialiased": antialiased}));
    if splats.offset != [0.0; 3] {
        extras["offset"] = json!(splats.offset);
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": MARK},
        "extensionsUsed": used,
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"mode": 0, "attributes": attributes, "extensions": extensions, "extras": extras}]}],
        "accessors": arrays.accessors,
        "bufferViews": arrays.views,
        "buffers": [{"byteLength": arrays.bytes.len()}],
    });
    container(&document, arrays.bytes)
}

fn attributes(splats: &Splats, arrays: &mut Arrays, linear: bool) -> Value {
    let mut attributes = Map::new();
    let mut set = |name: String, accessor: usize| drop(attributes.insert(name, accessor.into()));
    let position = arrays.floats(splats.means.iter().copied());
    let corner = |start: f32, choose: fn(f32, f32) -> f32| {
        splats.means.iter().fold([start; 3], |best, mean| [0, 1, 2].map(|a| choose(best[a], mean[a])))
    };
    arrays.accessors[position]["min"] = json!(corner(f32::INFINITY, f32::min));
    arrays.accessors[position]["max"] = json!(corner(f32::NEG_INFINITY, f32::max));
    set("POSITION".into(), position);
    set(format!("{SPLATS}:ROTATION"), arrays.floats(splats.quats.iter().map(|q| unit_xyzw(*q))));
    set(format!("{SPLATS}:SCALE"), arrays.floats(splats.log_scales.iter().map(|s| s.map(f32::exp))));
    let opacity = |logit: &f32| sigmoid(*logit) as f32;
    set(format!("{SPLATS}:OPACITY"), arrays.floats(splats.opacity_logits.iter().map(|x| [opacity(x)])));
    let s = splats.coefficients();
    for i in 0..s {
        set(harmonic_name(i), arrays.floats(splats.sh.iter().skip(i).step_by(s).copied()));
    }
    // For programs that know no Gaussians: points with the colour of the first harmonic, which is linear light in glTF.
    let colour = |i: usize| {
        let [r, g, b] = splats.sh[i * s].map(|x| {
            let display = (0.282_094_8 * x + 0.5).clamp(0.0, 1.0);
            if linear { display } else { linear_light(display) }
        });
        [r, g, b, opacity(&splats.opacity_logits[i])]
    };
    set("COLOR_0".into(), arrays.floats((0..splats.len()).map(colour)));
    Value::Object(attributes)
}

/// The sRGB curve, decoded.
fn linear_light(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Header, JSON and buffer, each padded to four bytes.
pub(super) fn container(document: &Value, mut buffer: Vec<u8>) -> Result<Vec<u8>, String> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let total = 12 + 8 + text.len() + 8 + buffer.len();
    let length =
        u32::try_from(total).map_err(|_| format!("expected a file below 4 GiB for glTF, found {total} bytes"))?;
    let mut bytes = Vec::with_capacity(total);
    for number in [MAGIC, 2, length, text.len() as u32, JSON_CHUNK] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(&text);
    for number in [buffer.len() as u32, BIN_CHUNK] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(buffer);
    Ok(bytes)
}

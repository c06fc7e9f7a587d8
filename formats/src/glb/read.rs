//! Reading. Every offset and count is held against the bytes there are.

use std::path::Path;

use serde_json::Value;

use super::arrays::Accessors;
use super::json::{at, list};
use super::{BIN_CHUNK, JSON_CHUNK, MAGIC, MOTION, OPACITY_LEAST, SPLATS, harmonic_name, motion};
use crate::bounded::Bytes;
use crate::splats::logit;
use crate::turn::{flip, flip_motion};
use crate::{COUNT_MAX, FormatError, Motion, Splats, read_file};

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// The Gaussians, at the middle of the recording if they move.
    pub splats: Splats,
    /// How they move, if they do.
    pub motion: Option<Motion>,
    /// Whether colours are linear light.
    pub linear: bool,
}

/// Reads the first primitive of Gaussians. Transforms of nodes are not applied.
///
/// # Errors
/// When the file cannot be read, is no binary glTF with Gaussians of floats, or is cut short.
pub fn read(path: &Path) -> Result<Contents, FormatError> {
    decode(&read_file(path)?).map_err(|message| FormatError::Wrong { path: path.to_owned(), message })
}

/// [`read`] of bytes.
///
/// # Errors
/// A sentence without the file's name.
pub fn decode(file: &[u8]) -> Result<Contents, String> {
    let mut rest = Bytes(file);
    let (magic, version, _) = (rest.u32()?, rest.u32()?, rest.u32()?);
    if magic != MAGIC || version != 2 {
        return Err("expected binary glTF of version 2, found another file".into());
    }
    let text = chunk(&mut rest, JSON_CHUNK)?;
    let buffer = if rest.0.is_empty() { &[] } else { chunk(&mut rest, BIN_CHUNK)? };
    let document: Value = serde_json::from_slice(text).map_err(|error| format!("expected JSON in glTF: {error}"))?;
    let primitives = list(&document, "/meshes")?.iter().filter_map(|mesh| mesh.get("primitives")?.as_array()).flatten();
    let primitive = primitives
        .into_iter()
        .find(|primitive| primitive.pointer(&format!("/extensions/{SPLATS}")).is_some())
        .ok_or_else(|| format!("expected a primitive with {SPLATS}, found none"))?;
    let extension = at(primitive, &format!("/extensions/{SPLATS}"))?;
    if extension.get("extensions").and_then(Value::as_object).is_some_and(|more| !more.is_empty()) {
        return Err(format!("expected plain accessors of {SPLATS}, found a compressed form of it"));
    }
    let accessors = Accessors { document: &document, buffer };
    let splats = splats(primitive, &accessors)?;
    splats.check()?;
    let moving = primitive.pointer(&format!("/extensions/{MOTION}"));
    let motion = moving.map(|value| motion::of_json(value, &accessors)).transpose()?;
    motion.as_ref().map_or(Ok(()), |motion| motion.check(splats.len()))?;
    Ok(Contents {
        splats: flip(&splats),
        motion: motion.as_ref().map(flip_motion),
        linear: extension.get("colorSpace").and_then(Value::as_str) == Some("lin_rec709_display"),
    })
}

fn chunk<'a>(rest: &mut Bytes<'a>, kind: u32) -> Result<&'a [u8], String> {
    let (length, found) = (rest.u32()? as usize, rest.u32()?);
    if found != kind {
        return Err(format!("expected the chunk {kind:#010x} of glTF, found {found:#010x}"));
    }
    rest.take(length)
}

fn splats(primitive: &Value, accessors: &Accessors) -> Result<Splats, String> {
    let named = |name: &str| primitive.get("attributes").and_then(|attributes| attributes.get(name)?.as_u64());
    let wanted = |name: &str| {
        named(name).map(|index| index as usize).ok_or_else(|| format!("expected the attribute {name}, found none"))
    };
    let means = accessors.floats::<3>(wanted("POSITION")?)?;
    if means.len() > COUNT_MAX {
        return Err(format!("expected at most {COUNT_MAX} Gaussians, found {}", means.len()));
    }
    let quats = accessors.floats::<4>(wanted(&format!("{SPLATS}:ROTATION"))?)?;
    let scales = accessors.floats::<3>(wanted(&format!("{SPLATS}:SCALE"))?)?;
    let opacities = accessors.floats::<1>(wanted(&format!("{SPLATS}:OPACITY"))?)?;
    let degree = (0..=3).rev().find(|degree: &usize| named(&harmonic_name(degree * degree)).is_some()).unwrap_or(0);
    let s = (degree + 1) * (degree + 1);
    let mut sh = vec![[0.0; 3]; means.len() * s];
    for i in 0..s {
        let values = accessors.floats::<3>(wanted(&harmonic_name(i))?)?;
        if values.len() != means.len() {
            return Err(format!("expected {} values of {}, found {}", means.len(), harmonic_name(i), values.len()));
        }
        sh.iter_mut().skip(i).step_by(s).zip(values).for_each(|(to, from)| *to = from);
    }
    Ok(Splats {
        means,
        quats: quats.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect(),
        log_scales: scales.into_iter().map(|s| s.map(f32::ln)).collect(),
        opacity_logits: opacities.into_iter().map(|[p]| logit(f64::from(p), OPACITY_LEAST)).collect(),
        degree,
        sh,
        antialiased: primitive.pointer("/extras/antialiased").and_then(Value::as_bool),
    })
}

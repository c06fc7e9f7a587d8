//! Reading. Every offset and count is held against the bytes there are.

use std::path::Path;

use glam::DVec3;
use gs_base::local::{is_offset, localised};
use gs_base::{FileError, guarded};
use serde_json::Value;

use super::arrays::Accessors;
use super::nodes::{Shown, shown};
use super::placed::Place;
use super::{BIN_CHUNK, JSON_CHUNK, MAGIC, MOTION, SPLATS, motion, primitive};
use crate::bounded::Bytes;
use crate::json::{at, list};
use crate::turn::{flip, flip_motion, moved};
use crate::{COUNT_MAX, FILE_MAX, Law, Motion, Splats};

/// The content of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// The Gaussians, at the middle of the recording if they move.
    pub splats: Splats,
    /// How they move, if they do.
    pub motion: Option<Motion>,
    /// Whether colours are linear light.
    pub linear: bool,
}

/// Floats of Gaussians that a file may become for each of its bytes: nodes may show a mesh again and again, and 64
/// times is a crowd.
const SHOWN_MAX: usize = 64;

/// Most primitives that are shown, empty ones too.
const PRIMITIVES_MAX: usize = 1 << 16;

/// Reads all primitives of Gaussians that the scene shows, in the places of their nodes.
///
/// # Errors
/// When the file cannot be read, is no binary glTF with plain Gaussians, or is cut short.
pub fn read(path: &Path) -> Result<Contents, FileError> {
    decode(&guarded::read(path, FILE_MAX)?).map_err(|message| FileError::wrong(path, message))
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
    let accessors = Accessors { document: &document, buffer };
    let found = primitives(&document)?;
    check_count(&found, &accessors, file.len())?;
    let mut merged = Merged::default();
    for (value, node) in &found {
        merged.add(value, &Place::of(&node.to_world)?, &accessors)?;
    }
    let is_linear = |(value, _): &(&Value, Shown)| {
        let space = primitive::extension(value).and_then(|extension| extension.get("colorSpace")?.as_str());
        space == Some("lin_rec709_display")
    };
    merged.contents(found.iter().any(is_linear))
}

fn chunk<'a>(rest: &mut Bytes<'a>, kind: u32) -> Result<&'a [u8], String> {
    let (length, found) = (rest.u32()? as usize, rest.u32()?);
    if found != kind {
        return Err(format!("expected the chunk {kind:#010x} of glTF, found {found:#010x}"));
    }
    rest.take(length)
}

/// The primitives of Gaussians that the scene shows, each with its node.
fn primitives(document: &Value) -> Result<Vec<(&Value, Shown)>, String> {
    let mut found = Vec::new();
    for node in shown(document)? {
        let mesh = at(document, &format!("/meshes/{}", node.mesh))?;
        let own = list(mesh, "/primitives")?.iter().filter(|value| primitive::extension(value).is_some());
        found.extend(own.take(PRIMITIVES_MAX + 1).map(|value| (value, Shown { ..node })));
        if found.len() > PRIMITIVES_MAX {
            return Err(format!("expected at most {PRIMITIVES_MAX} primitives of Gaussians, found more"));
        }
    }
    if found.is_empty() {
        let is_there = |mesh: &Value| {
            list(mesh, "/primitives").is_ok_and(|all| all.iter().any(|p| primitive::extension(p).is_some()))
        };
        let elsewhere = list(document, "/meshes")?.iter().any(is_there);
        let found = if elsewhere { "one that no node of the scene shows" } else { "none" };
        return Err(format!("expected a primitive with {SPLATS}, found {found}"));
    }
    Ok(found)
}

/// Refuses more Gaussians than a file of this length has use for.
fn check_count(found: &[(&Value, Shown)], accessors: &Accessors, length: usize) -> Result<(), String> {
    let mut count = 0_usize;
    for (value, _) in found {
        count = count.saturating_add(primitive::promised(value, accessors)?);
    }
    // Of degree 0, whose 14 floats are the least that a Gaussian becomes.
    let most = COUNT_MAX.min(length.saturating_mul(SHOWN_MAX) / 14);
    if count > most {
        return Err(format!("expected at most {most} Gaussians in a file of {length} bytes, found {count}"));
    }
    Ok(())
}

/// Primitives that were read and brought to their places.
#[derive(Default)]
struct Merged {
    splats: Vec<Splats>,
    /// Positions relative to the `hint`.
    positions: Vec<[f64; 3]>,
    /// Added to all positions: where the first primitive is.
    hint: Option<DVec3>,
    motion: Option<Motion>,
}

impl Merged {
    fn add(&mut self, value: &Value, place: &Place, accessors: &Accessors) -> Result<(), String> {
        let mut splats = primitive::read(value, accessors)?;
        let whole = place.shift(splats.offset);
        let shift = whole - *self.hint.get_or_insert(whole);
        if let Some(moving) = value.pointer(&format!("/extensions/{MOTION}")) {
            let mut own = motion::of_json(moving, &splats.means, accessors)?;
            own.check(splats.len())?;
            if self.motion.is_some() {
                return Err(format!("expected one primitive with {MOTION}, found more"));
            }
            own = place.motion(&own, shift)?;
            let before = self.positions.len() as u32;
            own.rows.iter_mut().for_each(|row| *row += before);
            self.motion = Some(own);
        }
        self.positions.extend(place.positions(&splats).map(|position| (position + shift).to_array()));
        place.shape(&mut splats);
        splats.means = Vec::new();
        self.splats.push(splats);
        Ok(())
    }

    fn contents(self, linear: bool) -> Result<Contents, String> {
        let hint = self.hint.unwrap_or(DVec3::ZERO);
        let is_within = |x: &f64| x.abs() <= f64::from(f32::MAX);
        if !is_offset(hint.to_array()) || !self.positions.iter().flatten().all(is_within) {
            return Err(
                "expected positions that numbers of 32 bits hold, found larger ones after the nodes' transforms".into(),
            );
        }
        let (means, offset) = localised(&self.positions, hint.to_array());
        let degree = self.splats.iter().map(|part| part.degree).max().unwrap_or(0);
        let antialiased = self.splats.iter().find_map(|part| part.antialiased);
        let mut splats = Splats { means, offset, degree, antialiased, ..Splats::default() };
        for part in self.splats {
            let part = part.padded(degree);
            splats.quats.extend(part.quats);
            splats.log_scales.extend(part.log_scales);
            splats.opacity_logits.extend(part.opacity_logits);
            splats.sh.extend(part.sh);
        }
        splats.check()?;
        let mut motion = self.motion;
        if let Some(Motion { law: Law::Keys(keys), .. }) = &mut motion {
            // Key frames are where the Gaussians are.
            let shift = hint - DVec3::from_array(offset);
            keys.means.iter_mut().for_each(|mean| *mean = moved(*mean, shift));
        }
        motion.as_ref().map_or(Ok(()), |motion| motion.check(splats.len()))?;
        Ok(Contents { splats: flip(&splats), motion: motion.as_ref().map(flip_motion), linear })
    }
}

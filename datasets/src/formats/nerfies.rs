//! Captures of Nerfies and HyperNeRF: one or two moving cameras before a scene that moves.
//!
//! ```text
//! dataset.json                 { ids, train_ids, val_ids }
//! metadata.json                of each id: { time_id or warp_id, camera_id }
//! camera/ID.json               orientation (world to camera, OpenCV axes), position, focal_length, principal_point,
//!                              pixel_aspect_ratio, radial_distortion, tangential_distortion, image_size
//! rgb/1x/ID.png  rgb/2x/...    photos, in full size and reduced; the largest are read
//! points.npy                   [N, 3], without colours
//! ```
//!
//! Time is the time's number over the largest, 0 to 1.

use std::path::{Path, PathBuf};

use glam::DVec3;
use gs_base::{counted, npy, printable};
use serde_json::{Map, Value};

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{entries, file_name};
use crate::formats::json::{self, Keys};
use crate::lens::Lens;
use crate::options::LoadOptions;
use crate::order::natural;
use crate::ply::NO_COLOR;
use crate::priors::sources;
use crate::raw::{RawFrame, RawPoints, RawScene, SplitName};
use crate::scene::SceneFormat;
use crate::{names, pose};

/// The lists of ids.
const DATASET: &str = "dataset.json";

/// A capture's folder.
pub(crate) struct Captured {
    pub folder: PathBuf,
}

/// The capture in a folder.
pub(crate) fn find(path: &Path) -> Option<Captured> {
    let is_one = path.join(DATASET).is_file() && path.join("camera").is_dir() && path.join("rgb").is_dir();
    is_one.then(|| Captured { folder: path.to_path_buf() })
}

/// Reads the description. An id without a photo is left out with a warning.
pub(crate) fn read(
    captured: &Captured,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let folder = &captured.folder;
    let file = folder.join(DATASET);
    let top = json::read(&file)?;
    let keys = Keys { file: &file, location: "top level".to_string(), objects: vec![&top] };
    let list = |key: &str| Ok::<_, DatasetError>(keys.texts(key)?.unwrap_or_default());
    let (ids, train, validation) = (list("ids")?, list("train_ids")?, list("val_ids")?);
    let metadata_file = folder.join("metadata.json");
    let metadata = findings.take(json::read(&metadata_file))?.unwrap_or_default();
    let said = |id: &str| Said::of(&metadata, id);
    let last = ids.iter().filter_map(|id| said(id).time).fold(0.0, f64::max).max(1.0);
    let photos = photos(folder, &ids);
    let (mut frames, mut missing) = (Vec::new(), Vec::new());
    for id in &ids {
        let Some(image_path) = names::find_image(&photos, id) else {
            missing.push(*id);
            continue;
        };
        let Some(name) = findings.take(names::output_name(&photos, id, &file))? else { continue };
        let camera_file = folder.join("camera").join(format!("{name}.json"));
        let Some(frame) = findings.take_posed(frame(&camera_file, name, image_path))? else { continue };
        let Said { time, camera } = said(id);
        let split = match (train.contains(id), validation.contains(id)) {
            _ if train.is_empty() => None,
            (true, _) => Some(SplitName::Train),
            (false, true) => Some(SplitName::Validation),
            // Listed for neither.
            (false, false) => continue,
        };
        frames.push(RawFrame { time: time.map(|time| time / last), camera_id: camera, split, ..frame });
    }
    findings.warn_of(folder, &missing, ["photo", "does", "do"], |do_, names| {
        format!("{do_} not exist in {}; left out ({names})", photos.display())
    });
    findings.need_frames(&frames, folder, || format!("none of {}", counted(ids.len(), "photo")))?;
    sources::search_depth(&mut frames, folder, options, findings);
    let points = folder.join("points.npy");
    let points = if points.is_file() { findings.take(points_of(&points))? } else { None };
    Ok(RawScene { format: SceneFormat::Nerfies, frames, points })
}

/// The metadata of a photo.
struct Said {
    time: Option<f64>,
    camera: Option<String>,
}

impl Said {
    fn of(metadata: &Map<String, Value>, id: &str) -> Self {
        let number = |key: &str| metadata.get(id)?.get(key)?.as_u64();
        let time = number("time_id").or_else(|| number("warp_id")).map(|time| time as f64);
        Self { time, camera: number("camera_id").map(|camera| camera.to_string()) }
    }
}

/// The folder of the largest photos: the first of 1x, 2x, ... with one of them.
fn photos(folder: &Path, ids: &[&str]) -> PathBuf {
    let root = folder.join("rgb");
    let mut sizes: Vec<PathBuf> = entries(&root).into_iter().filter(|size| size.is_dir()).collect();
    sizes.sort_by(|a, b| natural(&file_name(a), &file_name(b)));
    let holds = |size: &PathBuf| ids.iter().any(|id| names::find_image(size, id).is_some());
    sizes.into_iter().find(holds).unwrap_or(root)
}

/// A photo with its camera.
fn frame(file: &Path, name: String, image_path: PathBuf) -> Result<RawFrame, DatasetError> {
    let top = json::read(file)?;
    let keys = Keys { file, location: "top level".to_string(), objects: vec![&top] };
    let numbers = |key: &str, count: usize| -> Result<Vec<f64>, DatasetError> {
        let value = keys.get(key).unwrap_or(&Value::Null);
        let found = json::numbers(value).filter(|numbers| numbers.len() == count);
        found.ok_or_else(|| keys.wrong(key, &counted(count, "number"), json::kind(value)))
    };
    let focal = keys.number("focal_length")?.ok_or_else(|| keys.wrong("focal_length", "a number", "nothing".into()))?;
    let aspect = keys.number("pixel_aspect_ratio")?.unwrap_or(1.0);
    let (centre, size, position) = (numbers("principal_point", 2)?, numbers("image_size", 2)?, numbers("position", 3)?);
    let value = keys.get("orientation").unwrap_or(&Value::Null);
    let rows: [[f64; 3]; 3] =
        json::matrix(value).ok_or_else(|| keys.wrong("orientation", "3 rows of 3 numbers", json::kind(value)))?;
    // The rows are the camera's axes in the world.
    let row = |i: usize| [rows[0][i], rows[1][i], rows[2][i], position[i]];
    let c2w = pose::orthonormal(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]], file, &printable(&name))?.c2w;
    let mut distortion = Distortion::default();
    if keys.get("radial_distortion").is_some() {
        distortion.k[..3].copy_from_slice(&numbers("radial_distortion", 3)?);
    }
    // Older captures have `tangential`.
    for key in ["tangential_distortion", "tangential"] {
        if keys.get(key).is_some() {
            distortion.p.copy_from_slice(&numbers(key, 2)?);
        }
    }
    let lens = Lens::of([focal, focal * aspect, centre[0], centre[1]], (size[0], size[1]), distortion);
    Ok(RawFrame::posed(name, image_path, c2w, lens, file.to_path_buf()))
}

/// Positions without colours.
fn points_of(file: &Path) -> Result<RawPoints, DatasetError> {
    let array = npy::read(file)?;
    if array.shape.len() != 2 || array.shape[1] != 3 {
        return Err(DatasetError::malformed(file, "shape", "(N, 3)", format!("{:?}", array.shape)));
    }
    let positions: Vec<DVec3> = array.values.as_chunks::<3>().0.iter().copied().map(DVec3::from_array).collect();
    let positions: Vec<DVec3> = positions.into_iter().filter(|position| position.is_finite()).collect();
    Ok(RawPoints { colors: vec![NO_COLOR; positions.len()], positions })
}

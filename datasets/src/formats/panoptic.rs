//! PanopticSports as Dynamic 3D Gaussians published it: many static cameras, all of whose frames two JSON files list.
//!
//! ```text
//! train_meta.json  test_meta.json    { w, h, k[t][c] 3x3, w2c[t][c] 4x4 (OpenCV), fn[t][c] "cam/0.jpg", cam_id[t][c] }
//! ims/<cam>/000000.jpg               photos
//! seg/<cam>/000000.png               masks: white is what moves
//! ```
//!
//! Time is the index in the list over the last index, 0 to 1, of the training list: test times are on the same axis.

use std::path::{Path, PathBuf};

use gs_base::sentence::number;
use gs_base::{agree, counted, guarded, printable};
use serde_json::{Map, Value};

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::folder_of;
use crate::formats::json::{self, Keys};
use crate::lens::Lens;
use crate::mask::{MaskFile, White};
use crate::options::{LoadOptions, MaskUse};
use crate::priors::sources;
use crate::raw::{RawFrame, RawScene, SplitName};
use crate::scene::SceneFormat;
use crate::side_files::{DepthMeaning, Kind, SideFile, SideFiles};
use crate::{names, pose};

/// The file that makes a folder a Panoptic set.
pub(crate) const TRAIN_FILE: &str = "train_meta.json";
const TEST_FILE: &str = "test_meta.json";

/// Folders of photos and masks.
const IMAGE_FOLDER: &str = "ims";
pub(crate) const MASK_FOLDER: &str = "seg";

/// Points of the original sets, in a container that is not read.
const POINTS_FILE: &str = "init_pt_cld.npz";

/// The descriptions of a set.
pub(crate) struct MetaFiles {
    scene: PathBuf,
    folder: PathBuf,
    pub files: Vec<(PathBuf, SplitName)>,
}

/// The set in a folder.
pub(crate) fn find(path: &Path) -> Option<MetaFiles> {
    let files: Vec<(PathBuf, SplitName)> = [(TRAIN_FILE, SplitName::Train), (TEST_FILE, SplitName::Test)]
        .map(|(name, split)| (path.join(name), split))
        .into_iter()
        .filter(|(file, _)| file.exists())
        .collect();
    let trains = files.iter().any(|(_, split)| *split == SplitName::Train);
    trains.then(|| MetaFiles { scene: path.to_path_buf(), folder: path.to_path_buf(), files })
}

/// The set whose train_meta.json was given by name.
pub(crate) fn find_named(path: &Path) -> Option<MetaFiles> {
    if path.file_name()? != TRAIN_FILE || !path.exists() {
        return None;
    }
    find(folder_of(path))
}

/// Reads the description of a set.
pub(crate) fn read(
    files: &MetaFiles,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let mut frames = Vec::new();
    let mut last_time = None;
    let mut missing = Vec::new();
    for (file, split) in &files.files {
        let Some(top) = findings.take(json::read(file))? else { continue };
        let meta = Meta::read(&top, file);
        let Some(meta) = findings.take(meta)? else { continue };
        let last = *last_time.get_or_insert(meta.times.len().saturating_sub(1).max(1));
        for (t, cameras) in meta.times.iter().enumerate() {
            for shot in cameras {
                let written = format!("{IMAGE_FOLDER}/{}", names::with_slashes(shot.image));
                let c2w = shot.c2w(file);
                let Some(c2w) = findings.take_posed(c2w)? else { continue };
                let name = names::output_name(&files.folder, &written, file);
                let Some(name) = findings.take(name)? else { continue };
                let Some(image_path) = names::find_image(&files.folder, &written) else {
                    missing.push(written);
                    continue;
                };
                let (masks, sides) = masks(files, &name, options);
                frames.push(RawFrame {
                    time: Some(t as f64 / last as f64),
                    camera_id: Some(shot.camera.clone()),
                    masks,
                    sides,
                    split: (files.files.len() > 1).then(|| split.clone()),
                    ..RawFrame::posed(name, image_path, c2w, meta.lens(shot.k), file.clone())
                });
            }
        }
    }
    let frames_were = agree(missing.len(), "its frame was", "their frames were");
    findings.warn_of(&files.scene, &missing, ["image", "does", "do"], |do_, names| {
        format!("{do_} not exist; {frames_were} left out ({names})")
    });
    if files.folder.join(POINTS_FILE).exists() {
        findings.warn(format!("{}: the points in {POINTS_FILE} are not read", files.scene.display()));
    }
    findings.need_frames(&frames, &files.scene, || format!("none of {}", counted(missing.len(), "image")))?;
    let kinds = [Kind::Depth, Kind::Confidence, Kind::Sharp];
    let description = files.folder.join(TRAIN_FILE);
    sources::search(&mut frames, &files.folder, &description, &kinds, options.priors, findings);
    sources::note_gaps(&mut frames);
    Ok(RawScene { format: SceneFormat::Panoptic, frames, points: None })
}

/// The mask of a view, `seg/1/000000.png` for `ims/1/000000`, as the user wants it read. Held-out cameras have none.
fn masks(files: &MetaFiles, name: &str, options: &LoadOptions) -> (Vec<MaskFile>, SideFiles) {
    let depth = DepthMeaning { kind: options.depth_kind, ..DepthMeaning::default() };
    let mut sides = SideFiles { files: Vec::new(), depth };
    let relative = name.strip_prefix(IMAGE_FOLDER).unwrap_or(name).trim_start_matches('/');
    let path = files.folder.join(MASK_FOLDER).join(format!("{relative}.png"));
    if !guarded::is_there(&path) || options.masks == MaskUse::Ignore {
        return (Vec::new(), sides);
    }
    let counting = |white| vec![MaskFile { path: path.clone(), white }];
    match options.masks {
        MaskUse::KeepWhite => (counting(White::Keep), sides),
        MaskUse::KeepBlack => (counting(White::Ignore), sides),
        _ => {
            if options.priors.masks {
                sides.files.push(SideFile { kind: Kind::Moving, path: Some(path) });
            }
            (Vec::new(), sides)
        }
    }
}

/// One photo of one camera, as listed.
struct Shot<'a> {
    image: &'a str,
    camera: String,
    k: [[f64; 3]; 3],
    w2c: [[f64; 4]; 4],
}

impl Shot<'_> {
    fn c2w(&self, file: &Path) -> Result<glam::DMat4, DatasetError> {
        pose::orthonormal(&self.w2c, file, self.image).map(|rigid| rigid.c2w.inverse())
    }
}

struct Meta<'a> {
    width: f64,
    height: f64,
    /// `[times][cameras]`.
    times: Vec<Vec<Shot<'a>>>,
}

impl<'a> Meta<'a> {
    fn read(top: &'a Map<String, Value>, file: &'a Path) -> Result<Self, DatasetError> {
        let keys = Keys { file, location: "top level".to_string(), objects: vec![top] };
        let side = |key: &str| match keys.number(key)? {
            Some(value) if (1.0..=1e6).contains(&value) => Ok(value),
            Some(value) => Err(keys.wrong(key, "an image side of 1 to 1000000 pixels", number(value))),
            None => Err(keys.wrong(key, "an image side in pixels", "nothing".to_string())),
        };
        let (width, height) = (side("w")?, side("h")?);
        let names = table(&keys, "fn")?;
        let (k, w2c, ids) = (table(&keys, "k")?, table(&keys, "w2c")?, table(&keys, "cam_id")?);
        for (key, other) in [("k", &k), ("w2c", &w2c), ("cam_id", &ids)] {
            let sizes = |table: &[&[Value]]| table.iter().map(|row| row.len()).collect::<Vec<_>>();
            if sizes(other) != sizes(&names) {
                let count = |table: &[&[Value]]| {
                    format!("{} entries at {} times", sizes(table).iter().sum::<usize>(), table.len())
                };
                return Err(keys.wrong(key, &format!("as many as `fn`, {}", count(&names)), count(other)));
            }
        }
        let mut times = Vec::with_capacity(names.len());
        for t in 0..names.len() {
            let mut cameras = Vec::with_capacity(names[t].len());
            for c in 0..names[t].len() {
                let at = |key: &str, expected: &str, value: &Value| {
                    DatasetError::malformed(
                        file,
                        format!("key `{key}`, time {t}, camera {c}"),
                        expected,
                        json::kind(value),
                    )
                };
                let image = names[t][c].as_str().ok_or_else(|| at("fn", "a file name", &names[t][c]))?;
                let camera = match &ids[t][c] {
                    Value::String(id) => printable(id).into_owned(),
                    Value::Number(id) => id.to_string(),
                    other => return Err(at("cam_id", "a number or a name", other)),
                };
                let k: [[f64; 3]; 3] =
                    json::matrix(&k[t][c]).ok_or_else(|| at("k", "3 rows of 3 numbers", &k[t][c]))?;
                let w2c = json::matrix(&w2c[t][c]).ok_or_else(|| at("w2c", "4 rows of 4 numbers", &w2c[t][c]))?;
                if !(k[0][0] > 0.0 && k[1][1] > 0.0 && k.iter().flatten().all(|value| value.is_finite())) {
                    return Err(at("k", "finite focal lengths above 0", &Value::String(format!("{k:?}"))));
                }
                cameras.push(Shot { image, camera, k, w2c });
            }
            times.push(cameras);
        }
        Ok(Self { width, height, times })
    }

    fn lens(&self, k: [[f64; 3]; 3]) -> Lens {
        Lens::of([k[0][0], k[1][1], k[0][2], k[1][2]], (self.width, self.height), Distortion::default())
    }
}

/// A list of lists.
fn table<'a>(keys: &Keys<'a>, key: &str) -> Result<Vec<&'a [Value]>, DatasetError> {
    let value = keys.get(key).unwrap_or(&Value::Null);
    let rows = value
        .as_array()
        .and_then(|rows| rows.iter().map(|row| row.as_array().map(Vec::as_slice)).collect::<Option<Vec<_>>>());
    rows.ok_or_else(|| keys.wrong(key, "a list over times of lists over cameras", json::kind(value)))
}

//! The transforms.json family: instant-ngp, nerfstudio, Blender/NeRF, D-NeRF and NVFi, and sets of blurred photos in
//! the same layout with `exposure`, priors and truth.

mod attach;
mod frames;
mod lens;

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use gs_base::{clause, counted};
use serde_json::{Map, Value};

use self::frames::Entry;
use crate::convention::PoseConvention;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{folder_of, has_extension};
use crate::formats::json::{self, Keys};
use crate::frame::CameraPose;
use crate::names;
use crate::names::some_names;
use crate::options::LoadOptions;
use crate::raw::{RawFrame, RawPoints, RawScene, SplitName};
use crate::scene::{SceneFormat, Split};
use crate::{pixels, ply, pose};

/// The JSON files of a scene, each with the split that it lists.
pub(crate) struct Sources {
    pub scene: PathBuf,
    pub files: Vec<(PathBuf, Option<SplitName>)>,
}

/// The JSON files at `path`: the file itself, or in a folder transforms_{train,val,test}.json, else transforms.json.
pub(crate) fn find(path: &Path, is_folder: bool) -> Option<Sources> {
    let files = if is_folder {
        let parts = [("train", SplitName::Train), ("val", SplitName::Validation), ("test", SplitName::Test)];
        let split: Vec<(PathBuf, Option<SplitName>)> = parts
            .into_iter()
            .map(|(name, split_name)| (path.join(format!("transforms_{name}.json")), Some(split_name)))
            .filter(|(file, _)| file.exists())
            .collect();
        let whole = path.join("transforms.json");
        if split.iter().any(|(_, split_name)| *split_name == Some(SplitName::Train)) || !whole.exists() {
            split
        } else {
            vec![(whole, None)]
        }
    } else if has_extension(path, &["json"]) {
        vec![(path.to_path_buf(), None)]
    } else {
        Vec::new()
    };
    (!files.is_empty()).then(|| Sources { scene: path.to_path_buf(), files })
}

/// Reads all files of a scene.
pub(crate) fn read(
    sources: &Sources,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let mut scene = RawScene { format: SceneFormat::Transforms, frames: Vec::new(), points: None };
    let (mut listed, mut hint) = (0, String::new());
    // A lone train file is a whole data set that has yet to be split.
    let splits = sources.files.len() > 1;
    for (file, split_name) in &sources.files {
        let Some(top) = findings.take(json::read(file))? else { continue };
        let root = folder_of(file);
        let parsed = frames::read(&top, file, findings);
        let Some(entries) = findings.take(parsed)? else { continue };
        listed += entries.len();
        let (found, more) = attach::images(entries, &top, root, file, options, findings)?;
        hint += &more;
        let found = assign_splits(found, &top, file, split_name.clone().filter(|_| splits), findings)?;
        scene.frames.extend(found);
        if scene.points.is_none() {
            let points = read_points(&top, root, file);
            scene.points = findings.take(points)?.flatten();
        }
    }
    findings.need_frames(&scene.frames, &sources.scene, || match listed {
        0 => "an empty list of frames".to_string(),
        _ => format!("none of {}{hint}", counted(listed, "image")),
    })?;
    Ok(scene)
}

/// Files whose cameras are rendered, in the order in which they are looked for in a folder.
const CAMERA_FILES: [&str; 4] =
    ["transforms_render.json", "transforms.json", "transforms_test.json", "transforms_train.json"];

/// The file of cameras in a folder.
pub(crate) fn cameras_in(folder: &Path) -> Option<PathBuf> {
    CAMERA_FILES.iter().map(|name| folder.join(name)).find(|file| file.exists())
}

/// Reads the cameras of a JSON file, or of the first of transforms_render.json, transforms.json, transforms_test.json
/// and transforms_train.json in a folder; poses by a convention, or `None` by the format's. Images are only opened for
/// their size, where the file gives none.
pub(crate) fn read_cameras(path: &Path, poses: Option<PoseConvention>) -> Result<Vec<CameraPose>, DatasetError> {
    let metadata = std::fs::metadata(path).map_err(|error| DatasetError::read(path, error))?;
    let file = if metadata.is_dir() {
        cameras_in(path).ok_or_else(|| DatasetError::UnknownFormat {
            path: path.to_path_buf(),
            expected: format!("one of {}, or a COLMAP model", CAMERA_FILES.join(", ")),
            found: "none of them".to_string(),
        })?
    } else {
        path.to_path_buf()
    };
    let top = json::read(&file)?;
    let root = folder_of(&file);
    let mut findings = Findings::default();
    let entries = frames::read(&top, &file, &mut findings)?;
    findings.settle_poses(0)?;
    // Of one file, all cameras are of one hand.
    let mirrored = entries.iter().position(|entry| entry.c2w.determinant() < 0.0);
    if let Some(index) = mirrored
        && entries.iter().any(|entry| entry.c2w.determinant() > 0.0)
    {
        let name = entries[index].file_path.clone().unwrap_or_else(|| format!("{index:05}"));
        return Err(pose::reflection(&file, &name));
    }
    if entries.is_empty() {
        return Err(DatasetError::NoFrames { path: file, found: "an empty list of frames".to_string() });
    }
    let cameras = entries.iter().enumerate().map(|(index, entry)| {
        let own = PoseConvention::of(SceneFormat::Transforms);
        Ok(CameraPose { c2w: own.reread(poses, entry.c2w), ..camera(index, entry, root, &file)? })
    });
    let mut cameras = cameras.collect::<Result<Vec<_>, DatasetError>>()?;
    names::make_unique(cameras.iter_mut().map(|camera| &mut camera.name));
    findings.log();
    Ok(cameras)
}

fn camera(index: usize, entry: &Entry, root: &Path, file: &Path) -> Result<CameraPose, DatasetError> {
    let name = match &entry.file_path {
        Some(path) => names::output_name(root, path, file)?,
        None => format!("{index:05}"),
    };
    let declared = match (entry.lens.width, entry.lens.height) {
        (Some(width), Some(height)) => (width.round() as u32, height.round() as u32),
        _ => {
            let image = entry.file_path.as_ref().and_then(|path| names::find_image(root, path));
            let image = image.ok_or_else(|| {
                let location = format!("frame {name:?}");
                DatasetError::malformed(file, location, "w and h, or an image to take the size from", "neither")
            })?;
            pixels::size_of(&image)?
        }
    };
    Ok(CameraPose {
        name,
        c2w: entry.c2w,
        intrinsics: entry.lens.pinhole(declared, file)?,
        width: declared.0 as usize,
        height: declared.1 as usize,
        time: entry.time,
    })
}

/// Marks frames by the file they are in, or by nerfstudio's lists.
fn assign_splits(
    mut found: Vec<RawFrame>,
    top: &Map<String, Value>,
    file: &Path,
    split_name: Option<SplitName>,
    findings: &mut Findings,
) -> Result<Vec<RawFrame>, DatasetError> {
    if split_name.is_some() {
        found.iter_mut().for_each(|frame| frame.split = split_name.clone());
        return Ok(found);
    }
    let keys = Keys { file, location: "top level".to_string(), objects: vec![top] };
    let root = folder_of(file);
    let lists = split_lists(&keys, root, &found)?;
    if lists.is_empty() {
        return Ok(found);
    }
    let train_listed = lists.contains_key(&SplitName::Train);
    let mut twice = Vec::new();
    for frame in &mut found {
        let mut listed = lists.iter().filter(|(_, list)| list.contains(&frame.name)).map(|(split_name, _)| split_name);
        frame.split = listed.next().cloned().or((!train_listed).then_some(SplitName::Train));
        twice.extend(listed.next().map(|_| frame.name.clone()));
    }
    if !twice.is_empty() {
        findings.fact(format!(
            "{}: {} in several of the split's lists; each counts once, as training before test before other lists \
             ({}).",
            file.display(),
            clause(twice.len(), "frame", "is", "are"),
            some_names(&twice)
        ));
    }
    let before = found.len();
    found.retain(|frame| frame.split.is_some());
    if found.is_empty() && before > 0 {
        let expected = "a list with the file_path of a frame";
        return Err(keys.wrong("train_filenames", expected, format!("none of the {}", counted(before, "frame"))));
    }
    if found.len() < before {
        let left_out = before - found.len();
        findings.warn(format!(
            "{}: {} in none of the split's lists and left out",
            file.display(),
            clause(left_out, "frame", "is", "are")
        ));
    }
    Ok(found)
}

/// The names of frames in nerfstudio's `train_filenames`, `val_filenames` and `test_filenames`. Beside
/// `train_filenames` other keys `NAME_filenames` are lists of a split too, if they list frames: alone they may be lists
/// of anything.
fn split_lists(
    keys: &Keys,
    root: &Path,
    found: &[RawFrame],
) -> Result<BTreeMap<SplitName, HashSet<String>>, DatasetError> {
    const ENDING: &str = "_filenames";
    let name = |path: &str| names::view_name(root, names::moved_here(root, path).as_deref().unwrap_or(path));
    let named = |list: Vec<&str>| -> HashSet<String> { list.into_iter().map(name).collect() };
    let mut lists = BTreeMap::new();
    for (list_name, split_name) in
        [("train", SplitName::Train), ("val", SplitName::Validation), ("test", SplitName::Test)]
    {
        if let Some(list) = keys.texts(&format!("{list_name}{ENDING}"))? {
            lists.insert(split_name, named(list));
        }
    }
    if !lists.contains_key(&SplitName::Train) {
        return Ok(lists);
    }
    let written = keys.objects.iter().flat_map(|object| object.keys());
    for key in written.filter(|key| !["train_filenames", "val_filenames", "test_filenames"].contains(&key.as_str())) {
        let Some(name) = key.strip_suffix(ENDING) else { continue };
        let Ok(Some(list)) = keys.texts(key) else { continue };
        let list = named(list);
        if found.iter().any(|frame| list.contains(&frame.name)) {
            let split_name = match names::output_name(Path::new(""), name, keys.file)?.replace('/', "_").as_str() {
                Split::TRAIN => SplitName::Train,
                Split::TEST => SplitName::Test,
                Split::VALIDATION => SplitName::Validation,
                other => SplitName::Other(other.into()),
            };
            lists.entry(split_name).or_insert_with(HashSet::new).extend(list);
        }
    }
    Ok(lists)
}

/// The points of `ply_file_path`. They are in the saved world, as the poses are; `applied_transform` concerns neither.
fn read_points(top: &Map<String, Value>, root: &Path, file: &Path) -> Result<Option<RawPoints>, DatasetError> {
    let keys = Keys { file, location: "top level".to_string(), objects: vec![top] };
    let Some(written) = keys.text("ply_file_path")? else { return Ok(None) };
    let path = root.join(names::with_slashes(written));
    let path = if path.exists() { path } else { names::moved_here(root, written).map_or(path, |here| root.join(here)) };
    if !path.exists() {
        let expected = "a file of points, or no such key: training then finds points of its own";
        return Err(keys.wrong("ply_file_path", expected, format!("no file {}", path.display())));
    }
    ply::read(&path).map(Some)
}

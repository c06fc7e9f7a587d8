//! COLMAP sparse models, text and binary. `rigs` and `frames` files of newer versions are not needed: images carry their
//! full pose.

mod binary;
pub(crate) mod model;
mod text;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use self::model::Model;
use super::renamed::Renamed;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::frame::CameraPose;
use crate::guarded;
use crate::lens::Lens;
use crate::mask::{MaskFile, White};
use crate::names::some_names;
use crate::options::{LoadOptions, MaskUse};
use crate::plural::{agree, counted};
use crate::raw::{RawFrame, RawPoints, RawScene};
use crate::scene::SceneFormat;
use crate::side_files::{Kind, SideFile, SideFiles};
use crate::{names, pose};

/// Where models lie below a scene's folder; the last two are for a path to the models and to the model itself.
const MODEL_FOLDERS: [&str; 8] =
    ["sparse/0", "sparse", "colmap/sparse/0", "sparse_bin/0", "dense/sparse", "dense/sparse/0", "0", ""];

/// How many images are looked for to tell which folder holds them.
const PROBED: usize = 50;

/// A model's files.
pub(crate) struct ModelFiles {
    /// What the user gave.
    pub scene: PathBuf,
    /// Where cameras, images and points3D are.
    pub folder: PathBuf,
    pub format: SceneFormat,
}

impl ModelFiles {
    pub fn file(&self, stem: &str) -> PathBuf {
        let extension = if self.format == SceneFormat::ColmapBinary { "bin" } else { "txt" };
        self.folder.join(format!("{stem}.{extension}"))
    }
}

/// The model at or below `path`. Binary wins where a folder has both, as in COLMAP.
pub(crate) fn find(path: &Path) -> Option<ModelFiles> {
    for below in MODEL_FOLDERS {
        let folder = path.join(below);
        for (extension, format) in [("bin", SceneFormat::ColmapBinary), ("txt", SceneFormat::ColmapText)] {
            let has = |stem: &str| folder.join(format!("{stem}.{extension}")).exists();
            if has("cameras") && has("images") {
                return Some(ModelFiles { scene: path.to_path_buf(), folder, format });
            }
        }
    }
    None
}

/// Reads the three files. Observations are kept only when asked for: they are most of a model.
pub(crate) fn read_model(
    files: &ModelFiles,
    keep_observations: bool,
    findings: &mut Findings,
) -> Result<Model, DatasetError> {
    let is_binary = files.format == SceneFormat::ColmapBinary;
    let (path, mut model) = (files.file("cameras"), Model::default());
    let cameras = if is_binary { binary::cameras(&path) } else { text::cameras(&path) };
    for (id, camera) in findings.take(cameras)?.unwrap_or_default() {
        if model.cameras.insert(id, camera).is_some() {
            let twice = DatasetError::malformed(&path, format!("camera {id}"), "each camera id once", "it twice");
            findings.take::<()>(Err(twice))?;
        }
    }
    let path = files.file("images");
    let images =
        if is_binary { binary::images(&path, keep_observations) } else { text::images(&path, keep_observations) };
    model.images = findings.take(images)?.unwrap_or_default();
    let path = files.file("points3D");
    if !path.exists() {
        findings.warn(format!("{}: there are no points ({} is missing)", files.folder.display(), path.display()));
        return Ok(model);
    }
    let points = if is_binary { binary::points(&path) } else { text::points(&path) };
    model.points = findings.take(points)?.unwrap_or_default();
    let broken = model
        .points
        .iter()
        .find(|(_, point)| !point.position.is_finite() || point.position.abs().max_element() > f64::from(f32::MAX));
    if let Some((id, point)) = broken {
        let found = point.position.to_string();
        let error = DatasetError::malformed(&path, format!("point {id}"), "a finite position", found);
        findings.take::<()>(Err(error))?;
        model.points.retain(|(_, point)| point.position.is_finite());
    }
    Ok(model)
}

/// Reads a scene.
pub(crate) fn read(
    files: &ModelFiles,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let model = read_model(files, false, findings)?;
    scene(files, model, options, findings)
}

/// The cameras of a model, one for each image, by name; no photo needs to exist. A lens distortion is left out.
pub(crate) fn cameras(files: &ModelFiles) -> Result<Vec<CameraPose>, DatasetError> {
    let (cameras_file, images_file) = (files.file("cameras"), files.file("images"));
    let is_binary = files.format == SceneFormat::ColmapBinary;
    let cameras = if is_binary { binary::cameras(&cameras_file)? } else { text::cameras(&cameras_file)? };
    let cameras: HashMap<u32, model::Camera> = cameras.into_iter().collect();
    let images = if is_binary { binary::images(&images_file, false)? } else { text::images(&images_file, false)? };
    let pose = |image: &model::Image| {
        let camera = cameras.get(&image.camera_id).ok_or_else(|| {
            let expected = format!("a camera that {} lists", cameras_file.display());
            let found = format!("camera {}", image.camera_id);
            DatasetError::malformed(&images_file, format!("image {:?}", image.name), expected, found)
        })?;
        let size = (camera.width.try_into().unwrap_or(u32::MAX), camera.height.try_into().unwrap_or(u32::MAX));
        let lens = camera.lens(image.camera_id, &cameras_file)?;
        Ok(CameraPose {
            name: names::output_name(Path::new(""), &image.name, &images_file)?,
            c2w: pose::from_world_to_camera(image.q, image.t, &images_file, &image.name)?,
            intrinsics: lens.resolve(size, &cameras_file, &cameras_file)?.intrinsics,
            width: size.0 as usize,
            height: size.1 as usize,
            time: None,
        })
    };
    let mut poses = images.iter().map(pose).collect::<Result<Vec<_>, DatasetError>>()?;
    poses.sort_by(|a, b| a.name.cmp(&b.name));
    names::make_unique(poses.iter_mut().map(|pose| &mut pose.name));
    if poses.is_empty() {
        let found = format!("no image in {}", images_file.display());
        return Err(DatasetError::NoFrames { path: files.scene.clone(), found });
    }
    Ok(poses)
}

/// The scene of a model that was read.
pub(crate) fn scene(
    files: &ModelFiles,
    model: Model,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let (cameras_file, images_file) = (files.file("cameras"), files.file("images"));
    let image_folder = image_folder(files, &model, options)?;
    let mask_folder = mask_folder(&image_folder, options.masks);
    let mut lenses: HashMap<u32, Lens> = HashMap::new();
    let (mut frames, mut missing, mut elsewhere) = (Vec::new(), Vec::new(), Vec::new());
    let mut renamed = None;
    let total = model.images.len();
    for image in &model.images {
        let name = names::output_name(&image_folder, &image.name, &images_file);
        let Some(name) = findings.take(name)? else { continue };
        let image_path = names::find_image(&image_folder, &image.name).or_else(|| {
            // The folder is listed once, and only if a photo is not where it should be.
            let renamed = renamed.get_or_insert_with(|| Renamed::of(&image_folder));
            let path = renamed.find(&image.name)?;
            elsewhere.push(format!("{} as {}", image.name, renamed.shown(&path)));
            Some(path)
        });
        let Some(image_path) = image_path else {
            missing.push(image.name.as_str());
            continue;
        };
        let camera = model.cameras.get(&image.camera_id).ok_or_else(|| {
            DatasetError::malformed(
                &images_file,
                format!("image {:?}", image.name),
                format!("a camera that {} lists", cameras_file.display()),
                format!("camera {}", image.camera_id),
            )
        });
        let lens = match lenses.get(&image.camera_id) {
            Some(lens) => Ok(lens.clone()),
            None => camera.and_then(|camera| camera.lens(image.camera_id, &cameras_file)),
        };
        let c2w = pose::from_world_to_camera(image.q, image.t, &images_file, &image.name);
        let (Some(lens), Some(c2w)) = (findings.take(lens)?, findings.take(c2w)?) else { continue };
        lenses.insert(image.camera_id, lens.clone());
        let mask = mask(mask_folder.as_deref(), &image.name, options.masks);
        let mut sides = SideFiles::default();
        if options.masks == MaskUse::Moving && options.priors.masks && mask_folder.is_some() {
            sides.files.push(SideFile { kind: Kind::Moving, path: mask.as_ref().map(|mask| mask.path.clone()) });
        }
        frames.push(RawFrame {
            name,
            masks: mask.filter(|_| options.masks != MaskUse::Moving).into_iter().collect(),
            exposure: None,
            sides,
            image_path,
            c2w,
            lens,
            time: None,
            camera_id: Some(image.camera_id.to_string()),
            split: None,
            file: cameras_file.clone(),
        });
    }
    if !elsewhere.is_empty() {
        findings.warn(format!(
            "{}: {} {} found under another name below {} ({})",
            images_file.display(),
            counted(elsewhere.len(), "image"),
            agree(elsewhere.len(), "was", "were"),
            image_folder.display(),
            some_names(&elsewhere)
        ));
    }
    if !missing.is_empty() {
        findings.warn(format!(
            "{}: {} of {} {} not exist in {}; {} left out ({})",
            images_file.display(),
            missing.len(),
            counted(total, "image"),
            agree(missing.len(), "does", "do"),
            image_folder.display(),
            agree(missing.len(), "it was", "they were"),
            some_names(&missing)
        ));
    }
    if frames.is_empty() && !findings.is_lenient() {
        let found = match total {
            0 => format!("no image in {}", images_file.display()),
            _ => format!("none of the {} in {}", counted(total, "image"), image_folder.display()),
        };
        return Err(DatasetError::NoFrames { path: files.scene.clone(), found });
    }
    let points = (!model.points.is_empty()).then(|| RawPoints {
        positions: model.points.iter().map(|(_, point)| point.position).collect(),
        colors: model.points.iter().map(|(_, point)| point.color).collect(),
    });
    Ok(RawScene { format: files.format, frames, points })
}

/// The folder that holds most of the images: `images` of the scene or near the model, or one of those folders itself.
fn image_folder(files: &ModelFiles, model: &Model, options: &LoadOptions) -> Result<PathBuf, DatasetError> {
    if let Some(chosen) = &options.images {
        let below = files.scene.join(chosen);
        let folder = if below.is_dir() { below } else { chosen.clone() };
        return if folder.is_dir() {
            Ok(folder)
        } else {
            Err(DatasetError::Option {
                path: files.scene.clone(),
                option: "images",
                expected: "a folder with images".to_string(),
                found: format!("{}, which is no folder", chosen.display()),
            })
        };
    }
    let mut candidates = Vec::new();
    let near = [Some(files.scene.as_path()), Some(files.folder.as_path())];
    let above = files.folder.ancestors().skip(1).take(3).map(Some);
    for base in near.into_iter().chain(above).flatten() {
        candidates.push(base.join("images"));
        candidates.push(base.to_path_buf());
    }
    let found = |folder: &Path| {
        model.images.iter().take(PROBED).filter(|image| names::find_image(folder, &image.name).is_some()).count()
    };
    let mut best = (0, files.scene.join("images"));
    for folder in candidates.into_iter().filter(|folder| folder.is_dir()) {
        let count = found(&folder);
        if count > best.0 {
            best = (count, folder);
        }
    }
    Ok(best.1)
}

/// COLMAP's masks: `masks/<image name>.png` (or with the image's own extension replaced), black = ignore.
fn mask_folder(image_folder: &Path, masks: MaskUse) -> Option<PathBuf> {
    let folder = image_folder.parent()?.join("masks");
    (masks != MaskUse::Ignore && folder.is_dir()).then_some(folder)
}

fn mask(folder: Option<&Path>, image: &str, masks: MaskUse) -> Option<MaskFile> {
    let folder = folder?;
    let whole = names::with_slashes(image);
    let stem = whole.rsplit_once('.').map_or(whole.as_str(), |(stem, _)| stem);
    let path = [folder.join(format!("{whole}.png")), folder.join(format!("{stem}.png"))]
        .into_iter()
        .find(|path| guarded::is_there(path))?;
    let white = if masks == MaskUse::KeepBlack { White::Ignore } else { White::Keep };
    Some(MaskFile { path, white })
}

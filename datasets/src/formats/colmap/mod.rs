//! COLMAP sparse models, text and binary. `rigs` and `frames` files of newer versions are not needed: images carry
//! their full pose.

mod binary;
pub(crate) mod filmed;
mod find;
mod lenses;
pub(crate) mod model;
mod photos;
mod text;

use std::collections::HashMap;
use std::path::Path;

use gs_base::counted;

use self::lenses::Lenses;
use self::model::Model;
use super::lookup::{Lookup, Reach};
use crate::convention::PoseConvention;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::frame::CameraPose;
use crate::options::LoadOptions;
use crate::priors::sources;
use crate::raw::{RawFrame, RawPoints, RawScene};
use crate::{names, pose};

pub(crate) use self::find::{ModelFiles, find};

/// Reads the three files. Observations are kept only when asked for: they are most of a model.
pub(crate) fn read_model(
    files: &ModelFiles,
    keep_observations: bool,
    findings: &mut Findings,
) -> Result<Model, DatasetError> {
    let mut model = Model::default();
    read_cameras(files, &mut model, findings)?;
    model.images = findings.take(files.images(keep_observations))?.unwrap_or_default();
    let path = files.file("points3D");
    if !path.exists() {
        findings.warn(format!("{}: there are no points ({} is missing)", files.folder.display(), path.display()));
        return Ok(model);
    }
    model.points = findings.take(files.points())?.unwrap_or_default();
    let broken = model
        .points
        .iter()
        .find(|(_, point)| !point.position.is_finite() || point.position.abs().max_element() > f64::from(f32::MAX));
    if let Some((id, point)) = broken {
        let found = format!("{:?}", point.position.to_array());
        let error = DatasetError::malformed(&path, format!("point {id}"), "a finite position", found);
        findings.take::<()>(Err(error))?;
        model.points.retain(|(_, point)| point.position.is_finite());
    }
    Ok(model)
}

/// Reads the cameras. A broken one is kept as a sentence: most images may be of others.
fn read_cameras(files: &ModelFiles, model: &mut Model, findings: &mut Findings) -> Result<(), DatasetError> {
    for (id, camera) in findings.take(files.cameras())?.unwrap_or_default() {
        let is_twice = match camera {
            Ok(camera) => model.cameras.insert(id, camera).is_some(),
            Err(error) => model.broken.insert(id, error.to_string()).is_some(),
        };
        if is_twice {
            let twice = DatasetError::malformed(
                &files.file("cameras"),
                format!("camera {id}"),
                "each camera id once",
                "it twice",
            );
            findings.take::<()>(Err(twice))?;
        }
    }
    Ok(())
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

/// The cameras of a model, one for each image, by name; poses by a convention, or `None` by COLMAP's. No photo needs to
/// exist. A lens distortion is left out.
pub(crate) fn cameras(files: &ModelFiles, poses: Option<PoseConvention>) -> Result<Vec<CameraPose>, DatasetError> {
    let (cameras_file, images_file) = (files.file("cameras"), files.file("images"));
    let cameras = files.cameras()?.into_iter().map(|(id, camera)| Ok((id, camera?)));
    let cameras = cameras.collect::<Result<HashMap<u32, model::Camera>, DatasetError>>()?;
    let images = files.images(false)?;
    let own = PoseConvention::of(files.format);
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
            c2w: own.reread(poses, pose::from_world_to_camera(image.q, image.t, &images_file, &image.name)?),
            intrinsics: lens.pinhole(size, &cameras_file)?,
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
    files.say_others(model.images.len(), findings);
    let (cameras_file, images_file) = (files.file("cameras"), files.file("images"));
    let root = photos::folder(files, &model, options)?;
    let mut lenses = Lenses::of(&model, files);
    let mut photos = Lookup::of(&root, model.images.iter().map(|image| image.name.as_str()), Reach::Anywhere);
    let mut frames = Vec::new();
    for image in &model.images {
        let name = names::output_name(&root, &image.name, &images_file);
        let Some(name) = findings.take(name)? else { continue };
        let Some(image_path) = photos.find(&image.name) else { continue };
        let c2w = pose::from_world_to_camera(image.q, image.t, &images_file, &image.name);
        let (Some(lens), Some(c2w)) = (lenses.lens(image), findings.take_posed(c2w)?) else { continue };
        frames.push(RawFrame {
            camera_id: Some(image.camera_id.to_string()),
            ..RawFrame::posed(name, image_path, c2w, lens, cameras_file.clone())
        });
    }
    lenses.report(findings)?;
    let mut hint = photos.hint();
    if !photos.missing().is_empty() {
        hint += &photos::other_folder(files, &model, &root);
    }
    photos.warn(&images_file, &hint, findings);
    photos::say_unregistered(files, &root, &photos.files(), findings);
    findings.need_frames(&frames, &files.scene, || match photos.total() {
        0 => format!("no image in {}", images_file.display()),
        total if photos.missing().is_empty() => format!("no sound camera of {}", counted(total, "image")),
        total => format!("none of the {} in {}{hint}", counted(total, "image"), root.display()),
    })?;
    sources::search_depth(&mut frames, &files.scene, options, findings);
    Ok(RawScene { format: files.format, frames, points: points_of(&model) })
}

/// The points of a model; `None` where it has none.
fn points_of(model: &Model) -> Option<RawPoints> {
    (!model.points.is_empty()).then(|| RawPoints {
        positions: model.points.iter().map(|(_, point)| point.position).collect(),
        colors: model.points.iter().map(|(_, point)| point.color).collect(),
    })
}

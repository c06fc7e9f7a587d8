//! One reader per layout on disk; [`read`] tells which one a path holds.

pub(crate) mod camera_texts;
pub(crate) mod colmap;
pub(crate) mod json;
pub(crate) mod llff;
mod lookup;
pub(crate) mod masks;
pub(crate) mod nerfies;
pub(crate) mod panoptic;
mod poseless;
pub(crate) mod realityscan;
mod renamed;
mod rows;
pub(crate) mod transforms;
mod unicode;

use std::path::Path;

use crate::error::DatasetError;
use crate::findings::Findings;
use crate::options::LoadOptions;
use crate::raw::RawScene;

/// The recognised format of a path.
pub(crate) enum Layout {
    Transforms(transforms::Sources),
    Colmap(colmap::ModelFiles),
    Panoptic(panoptic::MetaFiles),
    Llff(llff::PoseFile),
    RealityScan(realityscan::CameraTable),
    CameraTexts(camera_texts::CameraTexts),
    Filmed(colmap::filmed::Filmed),
    Nerfies(nerfies::Captured),
}

/// Recognises the layout. JSON wins over a COLMAP model beside it: converters that write both (nerfstudio) put the
/// poses that belong to their images into the JSON. For the same reason transforms.json wins over train_meta.json,
/// which can be given as a file instead. Poses of LLFF with frames of several cameras win over a COLMAP model, which
/// then is of one time only; with mere photos they are made from the model and lose to it. A model of cameras beside
/// their frames, and a capture of Nerfies, win over a COLMAP model likewise.
pub(crate) fn detect(path: &Path) -> Result<Layout, DatasetError> {
    let metadata = std::fs::metadata(path).map_err(|error| DatasetError::read(path, error))?;
    if let Some(files) = panoptic::find_named(path) {
        return Ok(Layout::Panoptic(files));
    }
    if let Some(sources) = transforms::find(path, metadata.is_dir()) {
        return Ok(Layout::Transforms(sources));
    }
    if let Some(files) = panoptic::find(path) {
        return Ok(Layout::Panoptic(files));
    }
    let poses = llff::find(path);
    if let Some(poses) = poses.as_ref().filter(|poses| poses.has_cameras()) {
        return Ok(Layout::Llff(poses.clone()));
    }
    if let Some(filmed) = colmap::filmed::find(path) {
        return Ok(Layout::Filmed(filmed));
    }
    if let Some(captured) = nerfies::find(path) {
        return Ok(Layout::Nerfies(captured));
    }
    if let Some(files) = colmap::find(path) {
        return Ok(Layout::Colmap(files));
    }
    if let Some(poses) = poses {
        return Ok(Layout::Llff(poses));
    }
    if let Some(table) = realityscan::find(path) {
        return Ok(Layout::RealityScan(table));
    }
    if let Some(texts) = camera_texts::find(path) {
        return Ok(Layout::CameraTexts(texts));
    }
    let layouts = "transforms.json, transforms_train.json, a .json file, train_meta.json, poses_bounds.npy, a .csv of \
        RealityScan, cameras/NAME.txt beside images, dataset.json beside camera, or a COLMAP \
                   model (cameras, images and points3D as .bin or .txt) in sparse/0, sparse, colmap/sparse/0, \
                   sparse_bin/0, dense/sparse or distorted/sparse/0";
    let (expected, found) = match poseless::found(path, metadata.is_dir()) {
        Some(found) => ("photos with their camera poses (a COLMAP model in sparse/0, or transforms.json)", found),
        None => (layouts, contents(path, metadata.is_dir())),
    };
    Err(DatasetError::UnknownFormat { path: path.to_path_buf(), expected: expected.to_string(), found })
}

/// Reads the description of a scene; images are looked for but not opened.
pub(crate) fn read(path: &Path, options: &LoadOptions, findings: &mut Findings) -> Result<RawScene, DatasetError> {
    detect(path)?.read(options, findings)
}

impl Layout {
    /// Reads the description.
    pub fn read(&self, options: &LoadOptions, findings: &mut Findings) -> Result<RawScene, DatasetError> {
        match self {
            Self::Transforms(sources) => transforms::read(sources, options, findings),
            Self::Colmap(files) => colmap::read(files, options, findings),
            Self::Panoptic(files) => panoptic::read(files, options, findings),
            Self::Llff(poses) => llff::read(poses, options, findings),
            Self::RealityScan(table) => realityscan::read(table, options, findings),
            Self::CameraTexts(texts) => camera_texts::read(texts, options, findings),
            Self::Filmed(filmed) => colmap::filmed::read(filmed, findings),
            Self::Nerfies(captured) => nerfies::read(captured, options, findings),
        }
    }
}

fn contents(path: &Path, is_folder: bool) -> String {
    if !is_folder {
        return "a file with another extension".to_string();
    }
    let Ok(entries) = std::fs::read_dir(path) else { return "a folder that cannot be listed".to_string() };
    let mut names: Vec<String> =
        entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    if names.is_empty() {
        return "an empty folder".to_string();
    }
    names.sort();
    let more = if names.len() > 6 { format!(" and {} more", names.len() - 6) } else { String::new() };
    names.truncate(6);
    format!("{}{more}", names.join(", "))
}

//! One reader per layout on disk; [`read`] tells which one a path holds.

pub(crate) mod colmap;
pub(crate) mod transforms;

use std::path::Path;

use crate::error::DatasetError;
use crate::options::LoadOptions;
use crate::raw::{Findings, RawScene};

/// What a path was recognised as.
pub(crate) enum Layout {
    Transforms(transforms::Sources),
    Colmap(colmap::ModelFiles),
}

/// Recognises the layout. JSON wins over a COLMAP model beside it: converters that write both (nerfstudio) put the
/// poses that belong to their images into the JSON.
pub(crate) fn detect(path: &Path) -> Result<Layout, DatasetError> {
    let metadata = std::fs::metadata(path).map_err(|error| DatasetError::read(path, error))?;
    if let Some(sources) = transforms::find(path, metadata.is_dir()) {
        return Ok(Layout::Transforms(sources));
    }
    if let Some(files) = colmap::find(path) {
        return Ok(Layout::Colmap(files));
    }
    Err(DatasetError::UnknownFormat {
        path: path.to_path_buf(),
        expected: "transforms.json, transforms_train.json, a .json file, or a COLMAP model (cameras, images and \
                   points3D as .bin or .txt) in sparse/0, sparse, colmap/sparse/0, sparse_bin/0 or dense/sparse"
            .to_string(),
        found: contents(path, metadata.is_dir()),
    })
}

/// Reads the description of a scene; images are looked for but not opened.
pub(crate) fn read(path: &Path, options: &LoadOptions, findings: &mut Findings) -> Result<RawScene, DatasetError> {
    match detect(path)? {
        Layout::Transforms(sources) => transforms::read(&sources, options, findings),
        Layout::Colmap(files) => colmap::read(&files, options, findings),
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

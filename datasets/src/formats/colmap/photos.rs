//! Where the photos of a model lie.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use gs_base::{agree, counted};

use super::find::ModelFiles;
use super::model::Model;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{entries, file_name};
use crate::formats::renamed::photos_below;
use crate::names::{self, some_names};
use crate::options::LoadOptions;

/// How many images are looked for to tell which folder holds them.
const PROBED: usize = 50;

/// A model with less than this share of the photos is warned about: COLMAP leaves out a few photos of most captures,
/// and most of them where the capture fell apart.
const FEW: f64 = 0.5;

/// The folder that holds most of the images: `images` of the scene or near the model, or one of those folders itself;
/// `input` for a model with its lens distortion.
pub(super) fn folder(files: &ModelFiles, model: &Model, options: &LoadOptions) -> Result<PathBuf, DatasetError> {
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
    let is_distorted = files.folder.components().any(|part| part.as_os_str() == "distorted");
    let near = [Some(files.scene.as_path()), Some(files.folder.as_path())];
    let above = files.folder.ancestors().skip(1).take(3).map(Some);
    let bases: Vec<&Path> = near.into_iter().chain(above).flatten().collect();
    let inputs = bases.iter().filter(|_| is_distorted).map(|base| base.join("input"));
    let images = bases.iter().flat_map(|base| [base.join("images"), base.to_path_buf()]);
    let best = fullest(inputs.chain(images), model);
    // Some captures come with reduced photos alone, as images_4.
    let reduced = entries(&files.scene).into_iter().filter(|folder| file_name(folder).starts_with("images_"));
    let best = best.or_else(|| fullest(reduced, model));
    Ok(best.map_or_else(|| files.scene.join("images"), |(folder, _)| folder))
}

/// The first of the folders with the most of the images, and how many of those probed; `None` where none has any.
fn fullest(folders: impl Iterator<Item = PathBuf>, model: &Model) -> Option<(PathBuf, usize)> {
    let found = |folder: &Path| {
        model.images.iter().take(PROBED).filter(|image| names::find_image(folder, &image.name).is_some()).count()
    };
    let mut best: Option<(PathBuf, usize)> = None;
    for folder in folders.filter(|folder| folder.is_dir()) {
        let count = found(&folder);
        if count > best.as_ref().map_or(0, |(_, count)| *count) {
            best = Some((folder, count));
        }
    }
    best
}

/// The key that helps where photos are missing in `folder` and another folder of the scene holds more of them, as
/// `images_4` does; the end of a sentence.
pub(super) fn other_folder(files: &ModelFiles, model: &Model, folder: &Path) -> String {
    let here = fullest(std::iter::once(folder.to_path_buf()), model).map_or(0, |(_, count)| count);
    let below = entries(&files.scene).into_iter().filter(|other| other != folder);
    match fullest(below, model).filter(|(_, count)| *count > here) {
        Some((other, _)) => {
            let name = file_name(&other);
            format!("; images of these names are in {name}: --set data.images={name}")
        }
        None => String::new(),
    }
}

/// Says how many photos of the folder are in no image of the model.
pub(super) fn say_unregistered(files: &ModelFiles, folder: &Path, used: &HashSet<&Path>, findings: &mut Findings) {
    // Below a scene's own folder lie other images than its photos.
    let is_own = *folder != files.scene && *folder != files.folder;
    let photos: Vec<PathBuf> = photos_below(folder, is_own);
    let others: Vec<String> =
        photos.iter().filter(|path| !used.contains(path.as_path())).map(|path| file_name(path)).collect();
    if others.is_empty() || used.is_empty() {
        return;
    }
    let sentence = format!(
        "{} of {} in {} {} not in the model ({})",
        others.len(),
        counted(photos.len(), "photo"),
        folder.display(),
        agree(others.len(), "is", "are"),
        some_names(&others)
    );
    if (photos.len() - others.len()) as f64 >= FEW * photos.len() as f64 {
        findings.fact(format!("{sentence}."));
    } else {
        findings.warn(sentence);
    }
}

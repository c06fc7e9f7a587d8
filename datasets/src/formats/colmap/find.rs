//! Where a model lies, and which of several.

use std::io::Read;
use std::path::{Path, PathBuf};

use gs_base::{agree, counted, guarded};

use super::model::{Image, Listed, Point};
use super::{binary, text};
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{entries, file_name};
use crate::names::some_names;
use crate::scene::SceneFormat;

/// Where models lie below a scene's folder, in a folder there or in the folder itself; the last is for a path
/// to the models and to the model itself. `distorted` is of the scripts of 3DGS, which keep the photos of this model in
/// `input`.
const MODEL_FOLDERS: [&str; 6] = ["sparse", "colmap/sparse", "sparse_bin", "dense/sparse", "distorted/sparse", ""];

/// Fewest bytes of an image in images.bin.
const IMAGE_BYTES: u64 = 4 + 7 * 8 + 4 + 2 + 8;

/// A model's files.
pub(crate) struct ModelFiles {
    /// The path as the user gave it.
    pub scene: PathBuf,
    /// Where cameras, images and points3D are.
    pub folder: PathBuf,
    pub format: SceneFormat,
    /// Smaller models of the same capture, each with the number of its images.
    others: Vec<(PathBuf, usize)>,
}

impl ModelFiles {
    pub fn file(&self, stem: &str) -> PathBuf {
        let extension = if self.format == SceneFormat::ColmapBinary { "bin" } else { "txt" };
        self.folder.join(format!("{stem}.{extension}"))
    }

    /// The cameras of its file.
    pub fn cameras(&self) -> Result<Vec<Listed>, DatasetError> {
        let read = if self.format == SceneFormat::ColmapBinary { binary::cameras } else { text::cameras };
        read(&self.file("cameras"))
    }

    /// The images of its file.
    pub fn images(&self, keep_observations: bool) -> Result<Vec<Image>, DatasetError> {
        let read = if self.format == SceneFormat::ColmapBinary { binary::images } else { text::images };
        read(&self.file("images"), keep_observations)
    }

    /// The points of its file.
    pub fn points(&self) -> Result<Vec<(u64, Point)>, DatasetError> {
        let read = if self.format == SceneFormat::ColmapBinary { binary::points } else { text::points };
        read(&self.file("points3D"))
    }

    /// The model in a folder. Binary wins where a folder has both, as in COLMAP.
    fn of(scene: &Path, folder: PathBuf) -> Option<Self> {
        let has = |stem: &str, extension: &str| folder.join(format!("{stem}.{extension}")).exists();
        let formats = [("bin", SceneFormat::ColmapBinary), ("txt", SceneFormat::ColmapText)];
        let (_, format) = formats.into_iter().find(|(end, _)| has("cameras", end) && has("images", end))?;
        Some(Self { scene: scene.to_path_buf(), folder, format, others: Vec::new() })
    }

    /// The number of images; 0 where the file cannot be read.
    fn count(&self) -> usize {
        if self.format == SceneFormat::ColmapText {
            return self.images(false).map_or(0, |images| images.len());
        }
        let count = || -> Option<usize> {
            let mut opened = guarded::open_regular(&self.file("images"), guarded::MODEL_MAX).ok()?;
            let (length, mut count) = (opened.metadata().ok()?.len(), [0; 8]);
            opened.read_exact(&mut count).ok()?;
            let count = u64::from_le_bytes(count);
            usize::try_from(count).ok().filter(|_| count <= length / IMAGE_BYTES)
        };
        count().unwrap_or(0)
    }

    /// Says which of several models is read. COLMAP makes several where photos do not hang together.
    pub fn say_others(&self, images: usize, findings: &mut Findings) {
        let Some((first, _)) = self.others.first() else { return };
        let others: Vec<String> =
            self.others.iter().map(|(folder, count)| format!("{} with {count}", file_name(folder))).collect();
        findings.warn(format!(
            "{}: of {} the largest is read, {} with {}; the {} {} not ({}); to read another, give its folder, as {}",
            self.folder.parent().unwrap_or(&self.folder).display(),
            counted(others.len() + 1, "model"),
            file_name(&self.folder),
            counted(images, "image"),
            agree(others.len(), "other", "others"),
            agree(others.len(), "is", "are"),
            some_names(&others),
            first.display()
        ));
    }
}

/// The model at or below `path`. Of several the one with the most images, and of these the first.
pub(crate) fn find(path: &Path) -> Option<ModelFiles> {
    MODEL_FOLDERS.iter().find_map(|below| {
        let base = if below.is_empty() { path.to_path_buf() } else { path.join(below) };
        largest(path, &base)
    })
}

/// The largest model in a folder and right below it. Below the folder of a scene only numbered folders are models of
/// one capture.
fn largest(scene: &Path, base: &Path) -> Option<ModelFiles> {
    let is_number = |folder: &PathBuf| file_name(folder).bytes().all(|byte| byte.is_ascii_digit());
    let folders = entries(base).into_iter().filter(|folder| base != scene || is_number(folder));
    let mut models: Vec<ModelFiles> = folders.filter_map(|folder| ModelFiles::of(scene, folder)).collect();
    models.extend(ModelFiles::of(scene, base.to_path_buf()));
    if models.len() < 2 {
        return models.pop();
    }
    let number = |model: &ModelFiles| file_name(&model.folder).parse::<u64>().unwrap_or(u64::MAX);
    let mut models: Vec<(usize, ModelFiles)> = models.into_iter().map(|model| (model.count(), model)).collect();
    models.sort_by_key(|(images, model)| (std::cmp::Reverse(*images), number(model)));
    let mut models = models.into_iter();
    let (_, mut largest) = models.next()?;
    largest.others = models.map(|(images, model)| (model.folder, images)).collect();
    Some(largest)
}

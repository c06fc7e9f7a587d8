//! The lenses of a model's images. A camera that cannot be used is one sentence, however many images it took.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::PathBuf;

use gs_base::{agree, clause, counted};

use super::find::ModelFiles;
use super::model::{Image, Model, SUPPORTED};
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::lens::Lens;
use crate::names::some_names;

/// Lenses by camera, and the images without one.
pub(super) struct Lenses<'a> {
    model: &'a Model,
    cameras_file: PathBuf,
    images_file: PathBuf,
    /// Of the cameras that were asked for.
    known: HashMap<u32, Option<Lens>>,
    /// Cameras whose numbers are broken: a sentence.
    broken: BTreeMap<u32, String>,
    /// Cameras of each camera model that is not read.
    unsupported: BTreeMap<&'static str, BTreeSet<u32>>,
    unlisted: BTreeSet<u32>,
    left_out: Vec<(u32, &'a str)>,
}

impl<'a> Lenses<'a> {
    pub fn of(model: &'a Model, files: &ModelFiles) -> Self {
        Self {
            model,
            cameras_file: files.file("cameras"),
            images_file: files.file("images"),
            known: HashMap::new(),
            broken: BTreeMap::new(),
            unsupported: BTreeMap::new(),
            unlisted: BTreeSet::new(),
            left_out: Vec::new(),
        }
    }

    /// The lens of an image; `None` is counted.
    pub fn lens(&mut self, image: &'a Image) -> Option<Lens> {
        let id = image.camera_id;
        if !self.known.contains_key(&id) {
            let lens = self.resolve(id);
            self.known.insert(id, lens);
        }
        let lens = self.known.get(&id).cloned().flatten();
        if lens.is_none() {
            self.left_out.push((id, &image.name));
        }
        lens
    }

    fn resolve(&mut self, id: u32) -> Option<Lens> {
        let Some(camera) = self.model.cameras.get(&id) else {
            match self.model.broken.get(&id) {
                Some(sentence) => drop(self.broken.insert(id, sentence.clone())),
                None => drop(self.unlisted.insert(id)),
            }
            return None;
        };
        match camera.lens(id, &self.cameras_file) {
            Ok(lens) => return Some(lens),
            Err(DatasetError::Unsupported { .. }) => {
                self.unsupported.entry(camera.model).or_default().insert(id);
            }
            Err(error) => drop(self.broken.insert(id, error.to_string())),
        }
        None
    }

    /// Warns about broken cameras, whose images are left out, and refuses cameras that are not read or not listed.
    pub fn report(&self, findings: &mut Findings) -> Result<(), DatasetError> {
        if let Some(sentence) = self.broken.values().next() {
            let images = self.images_of(|id| self.broken.contains_key(&id));
            let more = match self.broken.len() - 1 {
                0 => String::new(),
                more => format!(", and {} likewise", clause(more, "more camera", "is", "are")),
            };
            findings.warn(format!(
                "{sentence}{more}; {} of {} {} left out ({})",
                counted(images.len(), "image"),
                agree(self.broken.len(), "this camera", "these cameras"),
                agree(images.len(), "was", "were"),
                some_names(&images)
            ));
        }
        for (model, ids) in &self.unsupported {
            let images = self.images_of(|id| ids.contains(&id)).len();
            let error = DatasetError::Unsupported {
                path: self.cameras_file.clone(),
                what: format!("the camera model {model} of {} ({})", counted(images, "image"), cameras(ids)),
                expected: SUPPORTED.to_string(),
            };
            findings.take::<()>(Err(error))?;
        }
        // Where the list of cameras could not be read, that has been said.
        let is_unread = self.model.cameras.is_empty() && !findings.errors.is_empty();
        if !self.unlisted.is_empty() && !is_unread {
            let images = self.images_of(|id| self.unlisted.contains(&id));
            let expected = format!("cameras that {} lists", self.cameras_file.display());
            let found =
                format!("{} of {} ({})", cameras(&self.unlisted), counted(images.len(), "image"), some_names(&images));
            findings.take::<()>(Err(DatasetError::malformed(&self.images_file, "camera ids", expected, found)))?;
        }
        Ok(())
    }

    fn images_of(&self, of: impl Fn(u32) -> bool) -> Vec<&'a str> {
        self.left_out.iter().filter(|(id, _)| of(*id)).map(|(_, name)| *name).collect()
    }
}

/// "camera 1", "cameras 1, 2, 3, ...".
fn cameras(ids: &BTreeSet<u32>) -> String {
    let names: Vec<String> = ids.iter().map(u32::to_string).collect();
    format!("{} {}", agree(names.len(), "camera", "cameras"), some_names(&names))
}

//! [`RawScene`]: a data set as a reader of [`formats`](crate::formats) describes it, with no image opened.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use crate::face::Face;
use crate::lens::Lens;
use crate::mask::MaskFile;
use crate::pixels;
use crate::scene::{SceneFormat, Split};
use crate::side_files::SideFiles;

/// The list of the data set's own split that a frame is in. A frame in several lists is in the least of them: training
/// on it cannot be undone, and figures are quoted on the test list before any other.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum SplitName {
    Train,
    Test,
    Validation,
    /// A list of the data set's own, by its name, which can name a file.
    Other(Arc<str>),
}

impl SplitName {
    /// The name of the split in a [`Scene`](crate::Scene).
    pub fn name(&self) -> &str {
        match self {
            Self::Train => Split::TRAIN,
            Self::Test => Split::TEST,
            Self::Validation => Split::VALIDATION,
            Self::Other(name) => name,
        }
    }

    /// Whether a frame trains where no rule of the user's holds it out. Frames without a list train.
    pub fn trains(name: Option<&Self>) -> bool {
        name.is_none_or(|name| *name == Self::Train)
    }
}

/// One frame as its file describes it.
#[derive(Debug, Clone)]
pub(crate) struct RawFrame {
    /// See [`View::name`](crate::View::name).
    pub name: String,
    pub image_path: PathBuf,
    /// Camera to world, OpenCV axes, in the file's world.
    pub c2w: DMat4,
    /// The photo's.
    pub lens: Lens,
    /// The pinhole view of the photo that the frame is of; `None` where it is of the whole photo. Readers leave it out.
    pub face: Option<Face>,
    pub time: Option<f64>,
    pub camera_id: Option<String>,
    pub masks: Vec<MaskFile>,
    /// See [`View::exposure`](crate::View::exposure). Finite and not negative;
    /// `None` without a time.
    pub exposure: Option<f64>,
    /// Priors and truth.
    pub sides: SideFiles,
    /// `None` where the data set does not split.
    pub split: Option<SplitName>,
    /// The file with the intrinsics, for messages.
    pub file: PathBuf,
}

impl RawFrame {
    /// A photo with its camera, of which nothing more is said.
    pub fn posed(name: String, image_path: PathBuf, c2w: DMat4, lens: Lens, file: PathBuf) -> Self {
        Self {
            name,
            image_path,
            c2w,
            lens,
            face: None,
            time: None,
            camera_id: None,
            masks: Vec::new(),
            exposure: None,
            sides: SideFiles::default(),
            split: None,
            file,
        }
    }

    /// The frame of a view of the photo that this frame is of.
    pub fn seen_by(&self, face: Face) -> Self {
        let name = format!("{}{}", self.name, face.ending);
        let c2w = self.c2w * DMat4::from_mat3(face.rotation);
        Self { name, c2w, face: Some(face), ..self.clone() }
    }

    /// Bytes of a pixel of its view in memory: colour by the header of its file, mask, priors and truth.
    pub fn bytes_per_pixel(&self) -> usize {
        let is_masked = !self.masks.is_empty() || !self.lens.distortion.is_none() || self.face.is_some();
        let sides = self.sides.files.iter().filter(|file| file.path.is_some());
        let colors = if pixels::is_deep(&self.image_path) { 6 } else { 3 };
        colors + usize::from(is_masked) + sides.map(|file| file.kind.bytes()).sum::<usize>()
    }
}

/// Points as the file gives them.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RawPoints {
    pub positions: Vec<DVec3>,
    pub colors: Vec<[u8; 3]>,
}

/// A scene as its files describe it. Images of all frames exist; they have not been opened.
#[derive(Debug, Clone)]
pub(crate) struct RawScene {
    pub format: SceneFormat,
    pub frames: Vec<RawFrame>,
    pub points: Option<RawPoints>,
}

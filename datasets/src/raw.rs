//! What a format reader hands to the loader: frames that are described but not yet loaded.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat4, DVec3};

use crate::error::DatasetError;
use crate::lens::Lens;
use crate::priors::SideFiles;
use crate::scene::{SceneFormat, Split};

/// Which list of the data set's own split a frame is in. A frame in several lists is in the least of them: training on it cannot
/// be undone, and figures are quoted on the test list before any other.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Part {
    Train,
    Test,
    Validation,
    /// A list of the data set's own, by its name, which can name a file.
    Other(Arc<str>),
}

impl Part {
    /// The name that the split has in a [`Scene`](crate::Scene).
    pub fn name(&self) -> &str {
        match self {
            Self::Train => Split::TRAIN,
            Self::Test => Split::TEST,
            Self::Validation => Split::VALIDATION,
            Self::Other(name) => name,
        }
    }

    /// Whether a frame is learned from unless a rule of the user's holds it out: frames without a list are.
    pub fn trains(part: Option<&Self>) -> bool {
        part.is_none_or(|part| *part == Self::Train)
    }
}

/// What white (any pixel that is not black) means in a mask file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum White {
    Keep,
    Ignore,
}

/// A mask file that exists or is at least named by the data set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MaskFile {
    pub path: PathBuf,
    pub white: White,
}

/// One frame as its file describes it.
#[derive(Debug, Clone)]
pub(crate) struct RawFrame {
    /// See [`View::name`](crate::View::name).
    pub name: String,
    pub image_path: PathBuf,
    /// Camera to world, OpenCV axes, in the file's world.
    pub c2w: DMat4,
    pub lens: Lens,
    pub time: Option<f64>,
    pub camera_id: Option<String>,
    pub masks: Vec<MaskFile>,
    /// See [`View::exposure`](crate::View::exposure). Finite and not negative;
    /// `None` without a time.
    pub exposure: Option<f64>,
    /// Priors and truth.
    pub sides: SideFiles,
    /// `None` where the data set does not split.
    pub part: Option<Part>,
    /// The file with the intrinsics, for messages.
    pub file: PathBuf,
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

/// Collects what is wrong while a scene is read. `load` stops at the first error; `check` goes on and lists them all.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    /// Keep reading after an error.
    pub lenient: bool,
    /// What was found, where that is worth a sentence.
    pub facts: Vec<String>,
    pub warnings: Vec<String>,
    pub errors: Vec<DatasetError>,
}

impl Findings {
    /// Notes something that was repaired or left out.
    pub fn warn(&mut self, text: impl Into<String>) {
        self.warnings.push(text.into());
    }

    /// Passes a value on. An error is returned, or noted and turned into `None` when reading goes on.
    pub fn take<T>(&mut self, result: Result<T, DatasetError>) -> Result<Option<T>, DatasetError> {
        match result {
            Ok(value) => Ok(Some(value)),
            Err(error) if self.lenient => {
                self.errors.push(error);
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

/// At most three names, "a, b, c, ...", for a warning about many.
pub fn some_names<S: AsRef<str>>(names: &[S]) -> String {
    let shown: Vec<&str> = names.iter().take(3).map(AsRef::as_ref).collect();
    let more = if names.len() > shown.len() { ", ..." } else { "" };
    format!("{}{more}", shown.join(", "))
}

//! [`Findings`]: facts, warnings and errors, collected while a data set is read.

use std::path::Path;

use gs_base::{clause, printable};

use crate::error::DatasetError;
use crate::names::some_names;
use crate::raw::RawFrame;

/// Collects what is wrong while a scene is read. `load` stops at the first error; `check` goes on and lists them all.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    /// Whether reading goes on after an error.
    lenient: bool,
    /// See [`fact`](Findings::fact).
    facts: Vec<String>,
    /// See [`warn`](Findings::warn).
    warnings: Vec<String>,
    pub errors: Vec<DatasetError>,
    /// Poses that are none, of frames that are left out if they are few.
    unsound: Vec<DatasetError>,
}

/// Largest share of the frames whose poses may be none. More say that the file means something else.
const UNSOUND: f64 = 0.1;

impl Findings {
    /// Of a reader that goes on after an error.
    pub fn lenient() -> Self {
        Self { lenient: true, ..Self::default() }
    }

    /// Refuses a scene without frames, of which `found` says what is there instead, and one of whose poses too many are
    /// none. A lenient reader goes on.
    pub fn need_frames(
        &mut self,
        frames: &[RawFrame],
        scene: &Path,
        found: impl FnOnce() -> String,
    ) -> Result<(), DatasetError> {
        self.settle_poses(frames.len())?;
        if !frames.is_empty() || self.lenient {
            return Ok(());
        }
        Err(DatasetError::NoFrames { path: scene.to_path_buf(), found: found() })
    }

    /// Says which frames were left out because their poses are none, beside `sound` ones.
    ///
    /// # Errors
    /// The first of these poses, where they are too many.
    pub fn settle_poses(&mut self, sound: usize) -> Result<(), DatasetError> {
        let unsound = std::mem::take(&mut self.unsound);
        let count = unsound.len();
        if count as f64 > UNSOUND * (count + sound) as f64 {
            return unsound.into_iter().try_for_each(|error| self.take(Err(error)).map(|_: Option<()>| ()));
        }
        if let Some(first) = unsound.first() {
            self.warn(format!("{} left out: {first}", clause(count, "frame without a sound pose", "was", "were")));
        }
        Ok(())
    }

    /// Passes a frame on. One whose pose is none is left out, of which [`settle_poses`](Self::settle_poses) speaks.
    pub fn take_posed<T>(&mut self, result: Result<T, DatasetError>) -> Result<Option<T>, DatasetError> {
        match result {
            Err(error @ DatasetError::Pose { .. }) => {
                self.unsound.push(error);
                Ok(None)
            }
            other => self.take(other),
        }
    }

    /// Notes something that was repaired or left out. Names in the sentence are made [`printable`].
    pub fn warn(&mut self, text: impl AsRef<str>) {
        self.warnings.push(printable(text.as_ref()).into_owned());
    }

    /// Notes some sentences about what was repaired or left out.
    pub fn warn_all(&mut self, sentences: impl IntoIterator<Item = impl AsRef<str>>) {
        sentences.into_iter().for_each(|text| self.warn(text));
    }

    /// Notes something about what `names` are of, below or in `place`, if there are any. `sentence` is given the
    /// [`clause`] that begins it and some of the names.
    pub fn warn_of<S: AsRef<str>>(
        &mut self,
        place: &Path,
        names: &[S],
        [noun, one, many]: [&str; 3],
        sentence: impl FnOnce(String, String) -> String,
    ) {
        if !names.is_empty() {
            let text = sentence(clause(names.len(), noun, one, many), some_names(names));
            self.warn(format!("{}: {text}", place.display()));
        }
    }

    /// Notes what was found, where that is worth a sentence. Names in it are made [`printable`].
    pub fn fact(&mut self, text: impl AsRef<str>) {
        self.facts.push(printable(text.as_ref()).into_owned());
    }

    /// The facts since the last call.
    pub fn take_facts(&mut self) -> Vec<String> {
        std::mem::take(&mut self.facts)
    }

    /// The warnings since the last call.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Writes facts and warnings to the log of the program.
    pub fn log(&self) {
        self.facts.iter().for_each(|fact| tracing::info!("{fact}"));
        self.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
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

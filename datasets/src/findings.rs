//! [`Findings`]: facts, warnings and errors, collected while a data set is read.

use crate::error::DatasetError;

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

    /// Writes facts and warnings to the log of the program.
    pub fn log(&self) {
        for fact in &self.facts {
            tracing::info!("{fact}");
        }
        for warning in &self.warnings {
            tracing::warn!("{warning}");
        }
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

//! Errors of a configuration, and the range checks.

use std::path::PathBuf;

/// Files that may be stacked by `base`; more is taken for a circle.
pub const MAX_BASES: usize = 8;

/// An error of a configuration; the message is one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read, or is no file that a configuration can be in.
    #[error("{source}{}", recipe.as_ref().map_or(String::new(), |name| format!("; it is compiled in: --recipe {name}")))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of reading it.
        source: Box<gs_base::FileError>,
        /// The compiled-in recipe of its name, where it is missing and there is one.
        recipe: Option<String>,
    },
    /// The file is not TOML.
    #[error("{origin}: expected TOML, found: {found}")]
    Syntax {
        /// The file or argument.
        origin: String,
        /// The parser's complaint on one line.
        found: String,
    },
    /// A key that does not exist.
    #[error("{origin}: unknown key `{key}`; {hint}")]
    UnknownKey {
        /// The file or argument.
        origin: String,
        /// The key as written, with its sections.
        key: String,
        /// The valid key most like it, or where valid keys are found.
        hint: String,
    },
    /// A value of the wrong type.
    #[error("{origin}: {found}")]
    Type {
        /// The file or argument.
        origin: String,
        /// Expected and found type, and the position.
        found: String,
    },
    /// A value outside its range.
    #[error("configuration: `{key}` must be {expected}, found {found}")]
    Range {
        /// The key with its sections.
        key: String,
        /// The range, as a phrase.
        expected: String,
        /// The value.
        found: String,
    },
    /// A former key with another value than the constant that took its place.
    #[error("{origin}: `{key}` is no key any more, its value is {value} throughout; found {found}")]
    Retired {
        /// The file or argument.
        origin: String,
        /// The key as written, with its sections.
        key: String,
        /// The constant.
        value: f64,
        /// The value.
        found: String,
    },
    /// `base` files that form a cycle.
    #[error("{origin}: more than {MAX_BASES} `base` files are stacked here; is there a circle?")]
    Circle {
        /// The file or recipe at which it was detected.
        origin: String,
    },
    /// A key of another pipeline.
    #[error("{origin}: `{key}` is a key of the pipeline {owner}; this configuration's pipeline is {pipeline}")]
    OtherPipeline {
        /// The file or argument.
        origin: String,
        /// The key as written, with its sections.
        key: String,
        /// The pipeline that has it.
        owner: String,
        /// The configuration's pipeline.
        pipeline: String,
    },
    /// A key of a density strategy that is not chosen.
    #[error("{origin}: `{key}` is a key of the strategy {owner}; `density.strategy` is {strategy}")]
    OtherStrategy {
        /// The file or argument.
        origin: String,
        /// The key as written, with its sections.
        key: String,
        /// The strategy that has it.
        owner: String,
        /// The configuration's strategy.
        strategy: String,
    },
    /// A pipeline that does not exist.
    #[error("{origin}: expected a pipeline ({valid}), found `{found}`")]
    Pipeline {
        /// The file or argument.
        origin: String,
        /// The value.
        found: String,
        /// The pipelines there are.
        valid: String,
    },
    /// A recipe that does not exist.
    #[error("--recipe {found}: there is no such recipe{} (`gsburn recipes` lists all)",
        nearest.as_ref().map_or(String::new(), |name| format!("; the nearest is {name}")))]
    Recipe {
        /// The name as written.
        found: String,
        /// The name most like it, if one is like it.
        nearest: Option<String>,
    },
}

/// `Ok` when `holds`, otherwise the sentence "`key` must be `expected`, found `found`".
pub fn check(key: &str, found: impl ToString, holds: bool, expected: &str) -> Result<(), ConfigError> {
    if holds {
        return Ok(());
    }
    let text = found.to_string();
    let found = text.parse::<f64>().map_or(text, brief);
    Err(ConfigError::Range { key: key.into(), expected: expected.into(), found })
}

/// Size from which on numbers are written with an exponent: nobody counts more zeros, and 1e308 has 308.
const EXPONENT_FROM: f64 = 1e9;

/// A number for people.
pub fn brief(number: f64) -> String {
    match number.is_finite() && number.abs() >= EXPONENT_FROM {
        true => format!("{number:e}"),
        false => number.to_string(),
    }
}

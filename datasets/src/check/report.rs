//! The result of [`check`](crate::check), for people and for programs.

use std::fmt;
use std::path::PathBuf;

use gs_base::counted;
use gs_base::sentence::shown;

use crate::scene::SceneFormat;

/// Contents and mistakes of a data set. `Display` prints it whole, one sentence a line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CheckReport {
    /// The path that was examined.
    pub path: PathBuf,
    /// The layout; `None` if none was recognised.
    pub format: Option<SceneFormat>,
    /// Views that would train.
    pub train: usize,
    /// Views in which no pixel counts, by their masks.
    pub blank: usize,
    /// Name and number of views of each split that would be held out.
    pub held_out: Vec<(String, usize)>,
    /// Views that would train and have a time.
    pub timed: usize,
    /// Views of both kinds that have no time although others do.
    pub without_time: usize,
    /// See [`Scene::subject_distance`](crate::Scene::subject_distance).
    pub subject_distance: Option<f64>,
    /// Points to start from.
    pub points: usize,
    /// Median distance between where a COLMAP model's points are seen and where they project, pixels of the full-size,
    /// distorted image.
    pub reprojection_median: Option<f64>,
    /// Contents, in sentences.
    pub facts: Vec<String>,
    /// Repairs and omissions of loading, in sentences.
    pub warnings: Vec<String>,
    /// Mistakes that keep the data set from loading, in sentences.
    pub errors: Vec<String>,
}

impl CheckReport {
    /// Views that would be loaded.
    pub fn views(&self) -> usize {
        self.train + self.held_out.iter().map(|(_, count)| count).sum::<usize>()
    }

    /// Whether the data set would load.
    pub fn is_ok(&self) -> bool {
        self.errors.is_empty()
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.format {
            Some(format) => writeln!(f, "{}: {format}", shown(&self.path))?,
            // What another reader recognised.
            None if self.errors.is_empty() => writeln!(f, "{}:", shown(&self.path))?,
            None => writeln!(f, "{}: not recognised", shown(&self.path))?,
        }
        write_findings(f, &self.facts, &self.warnings, &self.errors)
    }
}

/// Writes the sentences of a report, one a line, and whether the data can be loaded.
///
/// # Errors
/// As of the formatter.
pub fn write_findings(
    f: &mut fmt::Formatter<'_>,
    facts: &[String],
    warnings: &[String],
    errors: &[String],
) -> fmt::Result {
    for (label, sentences) in [("", facts), ("warning: ", warnings), ("error: ", errors)] {
        sentences.iter().try_for_each(|sentence| writeln!(f, "  {label}{sentence}"))?;
    }
    match (errors.len(), warnings.len()) {
        (0, 0) => write!(f, "Good to load."),
        (0, count) => write!(f, "Good to load, with {}.", counted(count, "warning")),
        (count, _) => write!(f, "Cannot be loaded: {}.", counted(count, "error")),
    }
}

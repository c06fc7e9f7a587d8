//! Input from outside that the model cannot use, one sentence each.

use thiserror::Error;

/// Largest magnitude of a coordinate, metres. `f32` has steps of 8 mm at this distance, about the noise of a LiDAR; a
/// log is centred before it comes here and is a few kilometres long.
pub const COORDINATE_MAX: f32 = 1e5;

/// Input that the model cannot use.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FluxError {
    /// Fewer rows than the computation needs.
    #[error("the number of points for {what} is {found}; {needed} or more is expected")]
    TooFew {
        /// The computation.
        what: &'static str,
        /// The smallest number of points it is defined for.
        needed: usize,
        /// The number given.
        found: usize,
    },
    /// Two arrays that describe the same points differ in length.
    #[error("there must be one of {what} for each of {expected} points, {found} were given")]
    Lengths {
        /// The second array.
        what: &'static str,
        /// The number of points.
        expected: usize,
        /// The length of the second array.
        found: usize,
    },
    /// A coordinate is not a number, infinite, or beyond [`COORDINATE_MAX`].
    #[error("point {index} has the coordinates {point:?}; metres within 100000 of the origin are expected")]
    Coordinate {
        /// The row.
        index: usize,
        /// Its coordinates.
        point: [f32; 3],
    },
    /// A number is outside its range.
    #[error("{what} is {value}; {expected} is expected")]
    Range {
        /// The number.
        what: String,
        /// Its value.
        value: f64,
        /// The range.
        expected: &'static str,
    },
    /// A loss or a gradient is not finite.
    #[error("{what} of pass {pass} is not finite, so the step cannot be taken")]
    NotFinite {
        /// The quantity.
        what: &'static str,
        /// The pass of the refinement, from 0.
        pass: usize,
    },
    /// An edit names an actor that is not in the list.
    #[error("the edit names actor {actor}, the scene has actors 0 to {last}")]
    NoActor {
        /// The number in the script.
        actor: usize,
        /// The last number of the list.
        last: usize,
    },
    /// An edit names an actor that an earlier edit removed.
    #[error("the edit names actor {actor}, which an earlier edit removed")]
    Removed {
        /// The number in the script.
        actor: usize,
    },
    /// An edit names an actor of a scene without actors.
    #[error("the edit names actor {actor}, the scene has no actors")]
    NoActors {
        /// The number in the script.
        actor: usize,
    },
}

/// Each point has coordinates that the model can use.
///
/// # Errors
/// Names the first point whose coordinates are not finite or beyond [`COORDINATE_MAX`].
pub fn check_points(points: &[[f32; 3]]) -> Result<(), FluxError> {
    let bad = |point: &[f32; 3]| !point.iter().all(|x| x.abs() <= COORDINATE_MAX);
    match points.iter().position(bad) {
        Some(index) => Err(FluxError::Coordinate { index, point: points[index] }),
        None => Ok(()),
    }
}

/// `what` has one entry for each of `expected` points.
///
/// # Errors
/// When `found` is another number.
pub fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), FluxError> {
    if expected == found { Ok(()) } else { Err(FluxError::Lengths { what, expected, found }) }
}

/// `value` is finite and in `low..=high`; `expected` says so in words.
///
/// # Errors
/// When it is not.
pub fn check_range(what: &str, value: f64, [low, high]: [f64; 2], expected: &'static str) -> Result<(), FluxError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(FluxError::Range { what: what.to_owned(), value, expected })
}

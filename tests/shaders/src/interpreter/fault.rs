//! The faults of a shader.

use std::fmt;

/// The kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// A word is read that nobody has written.
    Unwritten,
    /// Two units touch a word between two barriers, or two cubes touch it, one of them writes, and not both are atomic.
    Race,
    /// Some units of a cube wait at a barrier at which others do not arrive.
    Divergence,
    /// An index is beyond the end of its array.
    Bounds,
    /// A unit does not end.
    Endless,
    /// The interpreter does not know a construct; the shader may be right.
    Unknown(&'static str),
}

/// A fault and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Its kind.
    pub wrong: Wrong,
    /// Number of the cube.
    pub cube: u32,
    /// Number of the unit in the cube.
    pub unit: u32,
    /// The line of the shader's text.
    pub line: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { wrong, cube, unit, line } = self;
        write!(f, "{wrong:?} in unit {unit} of cube {cube} at `{line}`")
    }
}

//! The schedule of a training over its steps, as data that anything may draw.

/// The schedule of a training over its steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timetable {
    /// Label and unit of the curves' values.
    pub y: String,
    /// Values over steps.
    pub curves: Vec<Curve>,
    /// Steps at which something happens.
    pub marks: Vec<Mark>,
}

/// A value over steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Step, from 1, and value.
    pub points: Vec<(f64, f64)>,
    /// Whether a line joins the points; otherwise they are single draws.
    pub joined: bool,
}

/// Events of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mark {
    /// Their name.
    pub name: String,
    /// The steps after which they happen.
    pub steps: Vec<usize>,
}

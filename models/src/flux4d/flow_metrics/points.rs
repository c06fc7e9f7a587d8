//! The points of a frame with predicted and true flow.

use serde::{Deserialize, Serialize};

use crate::flux4d::error::{FluxError, check_length};

/// Class of a point (Bucketed Scene Flow Eval's five).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FlowClass {
    /// No object.
    Background,
    /// Passenger car.
    Car,
    /// Bus, truck, trailer and the like.
    OtherVehicle,
    /// Pedestrian.
    Pedestrian,
    /// Cyclist, motorcyclist, wheelchair and the like (vulnerable road user).
    WheeledVru,
}

impl FlowClass {
    /// All classes, background first.
    pub const ALL: [Self; 5] = [Self::Background, Self::Car, Self::OtherVehicle, Self::Pedestrian, Self::WheeledVru];
}

/// The evaluated points of a frame, one entry each; points without a valid label are left out by the caller.
#[derive(Debug, Clone, Copy)]
pub struct FlowFrame<'a> {
    /// Metres per frame.
    pub predicted: &'a [[f32; 3]],
    /// Metres per frame.
    pub truth: &'a [[f32; 3]],
    /// The class of each.
    pub classes: &'a [FlowClass],
}

/// Flow, truth, class.
pub(super) type Point = ([f64; 3], [f64; 3], FlowClass);

impl FlowFrame<'_> {
    /// The points.
    ///
    /// # Errors
    /// When lengths differ or a flow is not finite.
    pub(super) fn points(&self) -> Result<impl Iterator<Item = Point> + '_, FluxError> {
        let count = self.truth.len();
        check_length("predicted flows", count, self.predicted.len())?;
        check_length("classes", count, self.classes.len())?;
        let finite = |flow: &[f32; 3]| flow.iter().all(|x| x.is_finite());
        for (what, flows) in [("a predicted flow", self.predicted), ("a true flow", self.truth)] {
            if let Some(bad) = flows.iter().find(|flow| !finite(flow)) {
                let value = bad.iter().copied().find(|x| !x.is_finite()).map_or(f64::NAN, f64::from);
                let expected = "a finite number of metres per frame";
                return Err(FluxError::Range { what: what.to_owned(), value, expected });
            }
        }
        let wide = |flow: [f32; 3]| flow.map(f64::from);
        let points = self.predicted.iter().zip(self.truth).zip(self.classes);
        Ok(points.map(move |((predicted, truth), class)| (wide(*predicted), wide(*truth), *class)))
    }
}

pub(super) fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The end-point error.
pub(super) fn end_point_error(predicted: [f64; 3], truth: [f64; 3]) -> f64 {
    norm([0, 1, 2].map(|axis| predicted[axis] - truth[axis]))
}

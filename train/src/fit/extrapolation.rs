//! The future of a scene beside the Gaussians at any time: its parts, an ensemble, its integration step.

use glam::DVec3;
use gs_models::DynamicScene;

/// A group of Gaussians with one motion: a rigid body, the field's, or the static rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its name, which can name a file: "body_0", "field", "static".
    pub name: String,
    /// Its motion in words.
    pub words: String,
    /// How sure the kind of its law is among those that were compared, 0 to 1; `None` where none were.
    pub confidence: Option<f32>,
    /// The time from which its law was seen; `None` without a law.
    pub since: Option<f64>,
    /// The terms of its law of motion by name, scene units, radians and the data set's unit of time; empty without a
    /// law.
    pub terms: Vec<(String, Vec<f64>)>,
    /// Where its centre is at the first frame, scene units, scene origin subtracted; `None` without a law.
    pub centre: Option<DVec3>,
    /// Its Gaussians, by row.
    pub rows: Vec<u32>,
}

/// A motion in words, with how sure it is, 0 to 1.
pub fn with_confidence(words: &str, confidence: Option<f32>) -> String {
    confidence.map_or(words.into(), |share| format!("{words}, {:.0} % sure", 100.0 * share))
}

/// The future of a scene, as its method extrapolates it.
pub trait Extrapolation {
    /// The scene at any time.
    fn scene(&self) -> Box<dyn DynamicScene>;

    /// The latest time that can be reached.
    fn last(&self) -> f64;

    /// The parts of the scene; each Gaussian is in one.
    fn parts(&self) -> Vec<Part>;

    /// `count` scenes that the recording does not tell from this one; the same arguments give the same scenes.
    ///
    /// # Errors
    /// A sentence, when the method has no such scenes.
    fn members(&self, count: usize) -> Result<Vec<Box<dyn DynamicScene>>, String>;

    /// Standard deviation of a position's coordinate in the recording, scene units, from which
    /// [`members`](Self::members) are drawn.
    fn noise(&self) -> f64;

    /// The same future with integration steps of `frames` frames.
    ///
    /// # Errors
    /// A sentence, when that is no usable length.
    fn with_step(&self, frames: f64) -> Result<Box<dyn Extrapolation>, String>;
}

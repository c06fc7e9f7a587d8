//! Rigid parts of the scene, each as a PLY file, and their laws of motion.

use std::collections::BTreeMap;

use anyhow::Result;
use gs_base::counted;
use serde::Serialize;

use super::Work;
use super::plan::Files;
use crate::commands::print;
use gs_train::fit::extrapolation::{Extrapolation, Part, with_confidence};
use gs_train::fit::parameters::rows_of;
use gs_train::run::outputs::{self, MARK, write_json};
use gs_train::run::scene::write_ply;

/// The list of the parts.
const JSON: &str = "bodies/bodies.json";

/// A part in bodies.json.
#[derive(Debug, Clone, Serialize)]
pub struct PartFigures {
    /// Its name.
    pub name: String,
    /// Its Gaussians.
    pub gaussians: usize,
    /// Its motion in words.
    pub law: String,
    /// How sure the kind of its law is, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f32>,
    /// The terms of its law: scene units, radians and the data set's unit of time, since the first time seen.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub terms: BTreeMap<String, Vec<f64>>,
    /// Its centre at the first time, in the data set's world, scene units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre: Option<[f64; 3]>,
}

/// The content of bodies.json.
#[derive(Debug, Serialize)]
struct File<'a> {
    program: &'static str,
    /// The time at which the PLY files show the parts.
    time: f64,
    parts: &'a [PartFigures],
}

impl Work<'_> {
    /// Lists the parts and, if they are asked for, writes each.
    pub(super) fn parts(&self, future: &dyn Extrapolation) -> Result<Vec<PartFigures>> {
        let parts = future.parts();
        let origin = self.loaded.origin;
        let described = |part: &Part| PartFigures {
            name: part.name.clone(),
            gaussians: part.rows.len(),
            law: part.words.clone(),
            confidence: part.confidence,
            terms: part.terms.iter().cloned().collect(),
            centre: part.centre.map(|centre| (centre + origin).to_array()),
        };
        let figures: Vec<PartFigures> = parts.iter().map(described).collect();
        for part in &parts {
            let words = with_confidence(&part.words, part.confidence);
            print(format!("{}: {}, {words}", part.name, counted(part.rows.len(), "Gaussian")));
            let (asked, seen) = (self.args.to - self.span[1], part.since.map(|since| self.span[1] - since));
            if let Some(seen) = seen.filter(|seen| asked > *seen) {
                print(format!("{}: its law was seen for {seen:.3}, and is asked for {asked:.3} more", part.name));
            }
        }
        if !self.args.bodies {
            return Ok(figures);
        }
        let paths_of = |files: &Files| -> Vec<_> { parts.iter().map(|part| files.part(&part.name)).collect() };
        outputs::check(&[paths_of(&self.placed), vec![self.placed.at(JSON)]].concat(), &[])?;
        let paths = paths_of(&self.files);
        let whole = self.predicted.scene.at(self.span[0]);
        for (part, path) in parts.iter().zip(&paths) {
            write_ply(path, &rows_of(&whole, &part.rows), origin)?;
        }
        write_json(&self.files.at(JSON), &File { program: MARK, time: self.span[0], parts: &figures })?;
        Ok(figures)
    }
}

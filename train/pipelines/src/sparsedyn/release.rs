//! Parts of a body that photos show at rest leave it: for the field, and at the last examination for what is static.
//! Early paths of a slow motion are near those of what rests beside it, so that a body begins with Gaussians that do
//! not belong to it.

use gs_burn::Gaussians;
use gs_datasets::View;
use gs_models::sparsedyn::bodies::parts::divided;

use super::judges::{Judges, with_rest};
use super::{Sparsedyn, Step};

/// Most parts of a body that are judged: each costs a rendering per photo.
const PARTS: usize = 16;

/// Fewest Gaussians of such a part.
const FEWEST: usize = 6;

/// Least share of the photos' error by which it must fall for a part to be at rest: a part has learned to fit the
/// photos where its body takes it.
const CLEARLY: f64 = 0.005;

/// The moving Gaussians, by index, that the photos of `times` show at rest although a body moves them.
pub fn resting_parts(model: &Sparsedyn, gaussians: &Gaussians, times: &[f64], views: &[View], at: &Step) -> Vec<usize> {
    if model.bodies.is_none() || model.frame.rows.is_empty() {
        return Vec::new();
    }
    let judges = Judges::of(times, views, gaussians, at);
    let (parts, of) = divided(&model.first_places(gaussians), &model.frame.labels, PARTS, FEWEST);
    let (mut model, mut resting) = (model.clone(), Vec::new());
    let Some(mut least) = judges.error(&model) else { return resting };
    for part in 0..of.len() {
        let members: Vec<usize> = (0..parts.len()).filter(|i| parts[*i] == part as i32).collect();
        let trial = with_rest(&model, &members);
        match judges.error(&trial) {
            Some(error) if error < (1.0 - CLEARLY) * least => {
                (model, least) = (trial, error);
                resting.extend(members);
            }
            _ => {}
        }
    }
    resting
}

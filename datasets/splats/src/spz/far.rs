//! Gaussians so far from all others that a file is better without them: one distant Gaussian coarsens the positions of
//! all.

use super::FRACTIONAL_BITS;
use super::write::{bits_of, largest};
use crate::Splats;

/// Share of the Gaussians that are near by definition: a cloud of broken ones is smaller than the rest.
const NEAR: f64 = 0.95;

/// A Gaussian is far from the others beyond this many times the distance within which [`NEAR`] of them lie: a sky round
/// a captured place ends before.
const FAR_TIMES: f64 = 20.0;

/// The Gaussian whose size counts as small: five in a hundred are smaller.
const SMALL: f64 = 0.05;

/// Steps of positions up to this share of a small Gaussian's size lose nothing that is seen: half a step is a sixteenth
/// of it.
const STEP_SHARE: f64 = 0.125;

/// Gaussians that are left out of a file for the sake of the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Far {
    /// Which, in rising order.
    pub rows: Vec<u32>,
    /// The least distance of them from the middle of the scene, scene units.
    pub distance: f64,
    /// The distance from it within which 95 % of all Gaussians lie.
    pub reach: f64,
}

/// The Gaussians to be left out: none where all positions are as fine without them, or fine enough with them.
pub fn far(splats: &Splats) -> Option<Far> {
    let (all, step) = (largest(splats, None), step_wanted(splats));
    let bits = bits_of(all);
    if bits == Some(FRACTIONAL_BITS) || bits.is_some_and(|bits| 0.5_f64.powi(bits as i32) <= step) {
        return None;
    }
    let distances = distances(splats);
    let reach = quantile(distances.clone(), NEAR)?;
    let is_far = |row: &u32| distances[*row as usize] > FAR_TIMES * reach;
    let mut rows: Vec<u32> = (0..splats.len() as u32).filter(is_far).collect();
    // The step is that of all others, or one that is fine enough; of the far ones those stay that it can hold.
    let finest = bits_of(largest(splats, Some(&rows)))?;
    let enough = (0..=finest).find(|bits| 0.5_f64.powi(*bits as i32) <= step).unwrap_or(finest);
    rows.retain(|row| splats.means[*row as usize].iter().any(|x| bits_of(f64::from(x.abs())) < Some(enough)));
    let distance = rows.iter().map(|row| distances[*row as usize]).fold(f64::INFINITY, f64::min);
    let gains = bits_of(largest(splats, Some(&rows))) > bits;
    gains.then_some(Far { rows, distance, reach })
}

/// The coarsest step of positions that loses nothing that is seen.
fn step_wanted(splats: &Splats) -> f64 {
    let sizes = splats.log_scales.iter().map(|s| s.map(f64::from).iter().sum::<f64>() / 3.0).collect();
    quantile(sizes, SMALL).map_or(0.0, |size| STEP_SHARE * size.exp())
}

/// How far each Gaussian is from the middle of the scene, the median along each axis.
fn distances(splats: &Splats) -> Vec<f64> {
    let axis = |axis: usize| splats.means.iter().map(|mean| f64::from(mean[axis])).collect();
    let middle = [0, 1, 2].map(|a| quantile(axis(a), 0.5).unwrap_or(0.0));
    let of = |mean: &[f32; 3]| (0..3).map(|a| (f64::from(mean[a]) - middle[a]).powi(2)).sum::<f64>().sqrt();
    splats.means.iter().map(of).collect()
}

fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let index = (share * values.len() as f64) as usize;
    (index < values.len()).then(|| *values.select_nth_unstable_by(index, f64::total_cmp).1)
}

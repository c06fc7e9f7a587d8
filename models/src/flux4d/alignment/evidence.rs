//! The points that are evident to have moved.

use rayon::prelude::*;

use super::clock::Clock;
use super::free_space::RangeImage;
use super::ground::Ground;
use super::{AlignedSweep, in_plan};

/// Heights above the ground, metres, between which bodies are looked for: below is road and kerb, above are crowns of
/// trees and bridges.
const BODY_HEIGHTS: [f32; 2] = [0.3, 3.0];
/// Points nearer to the LiDAR than this, metres from above, may be on the ego vehicle: no evidence of a body, but
/// points of one that is found by others, as a car in the next lane.
const EGO_RADIUS: f64 = 3.0;
/// Points beyond this, metres, do not move: few things have enough of them there, and the plans of all sweeps grow with
/// its square.
const RANGE: f64 = 150.0;
/// Sweeps whose rays pass through a place before it is evident that something moved there; one where no more others see
/// it than the second.
const PASSES: usize = 2;
const SEEN_BY_FEW: usize = 2;

/// Heights above the ground; 0 beyond the range.
pub fn heights(sweep: &AlignedSweep, ground: &Ground) -> Vec<f32> {
    let height = |point| if distance(sweep, point) < RANGE { ground.above(point) } else { 0.0 };
    sweep.points.iter().map(height).collect()
}

/// Distance from the LiDAR as seen from above, metres.
fn distance(sweep: &AlignedSweep, point: &[f32; 3]) -> f64 {
    let [x, y, _] = sweep.origin;
    (f64::from(point[0]) - x).hypot(f64::from(point[1]) - y)
}

/// The points at the heights of bodies.
pub fn standing(heights: &[f32]) -> Vec<usize> {
    (0..heights.len()).filter(|index| (BODY_HEIGHTS[0]..BODY_HEIGHTS[1]).contains(&heights[*index])).collect()
}

/// The points of each sweep above the ground.
pub fn images(sweeps: &[AlignedSweep], heights: &[Vec<f32>]) -> Vec<RangeImage> {
    let image = |(sweep, heights): (&AlignedSweep, &Vec<f32>)| {
        RangeImage::new(sweep, |index| heights[index] >= BODY_HEIGHTS[0])
    };
    sweeps.par_iter().zip(heights).map(image).collect()
}

/// The standing points of each sweep through whose places rays of other sweeps passed.
pub fn evident(
    sweeps: &[AlignedSweep],
    clocks: &[Clock],
    images: &[RangeImage],
    standing: &[Vec<usize>],
) -> Vec<Vec<usize>> {
    let of_sweep = |sweep: usize| {
        let points = sweeps[sweep].points;
        let moved = |index: &usize| {
            let point = &points[*index];
            let others = || {
                images.iter().zip(clocks).filter(|(_, clock)| clock.is_apart(&clocks[sweep])).map(|(image, _)| image)
            };
            if distance(&sweeps[sweep], point) < EGO_RADIUS {
                return false;
            }
            let passed = others().filter(|image| image.passed(point)).count();
            let seen_by_few =
                || others().filter(|image| image.covers(point) && !image.hides(point)).count() <= SEEN_BY_FEW;
            passed >= PASSES || passed > 0 && seen_by_few()
        };
        standing[sweep].par_iter().copied().filter(moved).collect()
    };
    (0..sweeps.len()).map(of_sweep).collect()
}

/// Some points of a sweep from above.
pub fn places(sweep: &AlignedSweep<'_>, points: &[usize]) -> impl Iterator<Item = [f64; 2]> {
    points.iter().map(|point| in_plan(&sweep.points[*point]))
}

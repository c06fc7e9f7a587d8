//! The motions of all points of a snippet: bodies of many points first, then those of few among what is left.

use std::collections::HashSet;

use rayon::prelude::*;

use super::aligned::Aligned;
use super::claims::OWN_HEIGHTS;
use super::clock::Clock;
use super::evidence::{evident, heights, images, places, standing};
use super::ground::Ground;
use super::plan::Extent;
use super::search::PlanarMotion;
use super::shadow::Shadow;
use super::sweeps::{Before, COARSE, FINE, Seen, Snippet};
use super::{AlignedSweep, in_plan};

/// Closeness at rest from which on a point is of no body of the coarse scale.
const REST_CLOSENESS: f64 = 0.4;
/// Edge of the cells in which, and beside which, a point above the road next to a body's may belong to it, metres.
const BESIDE: f64 = 0.5;

/// The motions of all points. Sweeps without points are left out. The same for any thread count.
pub fn align(sweeps: &[AlignedSweep]) -> Aligned {
    let ground = Ground::of(&sweeps.iter().map(|sweep| sweep.points).collect::<Vec<_>>());
    let heights: Vec<Vec<f32>> = sweeps.par_iter().map(|sweep| heights(sweep, &ground)).collect();
    let standing: Vec<Vec<usize>> = heights.iter().map(|heights| standing(heights)).collect();
    let extent = Extent::of(sweeps.iter().zip(&standing).flat_map(|(sweep, standing)| places(sweep, standing)));
    let images = images(sweeps, &heights);
    let clocks: Vec<Clock> = sweeps.par_iter().map(Clock::of).collect();
    let evident = evident(sweeps, &clocks, &images, &standing);
    let shadows: Vec<Shadow> = images.par_iter().map(|image| Shadow::new(image, extent, &ground)).collect();
    let together = |own: &Clock| clocks.iter().filter(|clock| !clock.is_apart(own)).count();
    let weights: Vec<f32> = clocks.iter().map(|clock| 1.0 / together(clock) as f32).collect();
    let seen = Seen { sweeps, heights: &heights, clocks: &clocks, weights: &weights, shadows: &shadows };
    let fine = Snippet::new(seen, (FINE, extent), &standing);
    let mut found = fine.bodies(&evident);
    let moving = of_sweeps(&evident, |sweep, point| !rests(&fine, sweep, point));
    let mut coarse = Snippet::new(seen, (COARSE, extent), &moving);
    coarse.complete(&mut found);
    let left = of_sweeps(&moving, |sweep, point| found.of_point[sweep][point].is_none());
    coarse.before = Some(Before { snippet: &fine, found: &found });
    let more = coarse.bodies(&left);
    let mut found = found.with(more);
    found.is_known = (0..sweeps.len()).into_par_iter().map(|sweep| known(&fine, &found, &standing, sweep)).collect();
    found
}

/// Whether the sweeps show how each point of a sweep moves.
fn known(snippet: &Snippet, found: &Aligned, standing: &[Vec<usize>], sweep: usize) -> Vec<bool> {
    let (points, of_point) = (snippet.seen.sweeps[sweep].points, &found.of_point[sweep]);
    let cell = |point: usize| in_plan(&points[point]).map(|x| (x / BESIDE).floor() as i32);
    let bodies = (0..points.len()).filter(|point| of_point[*point].is_some());
    let around = |[x, y]: [i32; 2]| (-1..=1).flat_map(move |i| (-1..=1).map(move |j| [x + i, y + j]));
    let beside: HashSet<[i32; 2]> = bodies.flat_map(|point| around(cell(point))).collect();
    let mut known = vec![true; points.len()];
    for point in standing[sweep].iter().copied().filter(|point| of_point[*point].is_none()) {
        known[point] = rests(snippet, sweep, point);
    }
    for (point, known) in known.iter_mut().enumerate().filter(|(point, _)| of_point[*point].is_none()) {
        *known &= snippet.seen.heights[sweep][point] < OWN_HEIGHTS[0] || !beside.contains(&cell(point));
    }
    known
}

/// The points of each sweep that a rule keeps, which is given the sweep and the point.
fn of_sweeps(points: &[Vec<usize>], keeps: impl Fn(usize, usize) -> bool + Sync) -> Vec<Vec<usize>> {
    let of_sweep =
        |(sweep, points): (usize, &Vec<usize>)| points.iter().copied().filter(|point| keeps(sweep, *point)).collect();
    points.par_iter().enumerate().map(of_sweep).collect()
}

/// Whether the other sweeps show a surface where a point is.
fn rests(snippet: &Snippet, sweep: usize, point: usize) -> bool {
    let at = in_plan(&snippet.seen.sweeps[sweep].points[point]);
    let time = snippet.seen.clocks[sweep].at(at);
    snippet.score(&[at], &PlanarMotion::rest(time, at), &snippet.others(sweep)) >= REST_CLOSENESS
}

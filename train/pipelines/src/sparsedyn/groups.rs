//! Groups of Gaussians that move alike: connected neighbours, and parts of one rigid motion.

use gs_base::median;
use gs_burn::glam::DVec3;
use gs_models::sparsedyn::bodies::fit::Poses;
use gs_models::sparsedyn::bodies::{SegmentOptions, segment};

use super::poses::{members, nearest, poses_of, rests};

/// Fewest Gaussians of a group: fewer do not determine a rotation in the noise of their positions.
pub const FEWEST: usize = 12;

/// Gaussians of one body lie within this many times the median distance to the nearest one.
const LINK: f64 = 3.0;

/// Times at which paths are compared with a rigid motion.
const PATH_TIMES: usize = 12;

/// Share of a Gaussian's distance from where it began that is added to the tolerance of a rigid group: the error of a
/// path grows with its length.
const TOLERANCE_SHARE: f64 = 0.08;

/// Most rigid groups.
const MOST: usize = 12;

/// Smallest share of a rigid group among the Gaussians that move.
const SHARE_LEAST: f64 = 0.02;

/// Difference of the ways of two such Gaussians that is allowed, as a share of the longer one, beside the noise of
/// both: paths of the field err by a tenth of their length, and neighbours in a body that bends move nearly alike; what
/// one of them leaves behind differs by the way itself.
const UNLIKE_SHARE: f64 = 0.25;

/// Largest distance of a path from the motion of its rigid group, pixels, where the path begins.
const GROUP_PIXELS: f64 = 2.0;

/// Lengths, scene units.
pub struct Lengths {
    /// A pixel.
    pub pixel: f64,
    /// Root mean square distance from where it began up to which a thing rests.
    pub still: f64,
    /// Error of a path.
    pub noise: f64,
}

/// The group of each Gaussian, from 0 on: neighbours that move alike along `paths` of the frames at `times`, and
/// Gaussians of one rigid motion. `known` names the body of each, -1 for none; a body is in one group. What rests is
/// in a group with what moves only as part of a body or of one rigid motion. Fewer than [`FEWEST`] are no group.
pub fn alike(paths: &[Vec<DVec3>], weights: &[f64], times: &[f64], known: &[i32], of: &Lengths) -> Vec<Option<u32>> {
    let groups = rigid_groups(paths, weights, times, known, of);
    let squares = |i: usize| paths.iter().map(|now| now[i].distance_squared(paths[0][i])).sum::<f64>();
    // What rests near the axis of a body would link it with all that rests beside it.
    let rests = |i: usize| groups[i].is_none() && squares(i) <= of.still.powi(2) * paths.len() as f64;
    let rest: Vec<bool> = (0..groups.len()).map(rests).collect();
    linked(paths, &groups, &rest, 2.0 * of.noise)
}

/// The rigid group of each Gaussian that moves along `paths`: its body, where `known` names one; for others `None` for
/// what rests, which is no evidence of one body, and for what follows no rigid motion.
fn rigid_groups(paths: &[Vec<DVec3>], weights: &[f64], times: &[f64], known: &[i32], of: &Lengths) -> Vec<Option<u32>> {
    let step = paths.len().div_ceil(PATH_TIMES).max(1);
    let free = members(known, -1);
    let of_free = |now: &Vec<DVec3>| free.iter().map(|i| now[*i]).collect::<Vec<DVec3>>();
    let sampled: Vec<Vec<DVec3>> = paths.iter().step_by(step).map(of_free).collect();
    let options = SegmentOptions {
        tolerance: GROUP_PIXELS * of.pixel,
        relative: TOLERANCE_SHARE,
        most: MOST,
        fewest: FEWEST,
        share: SHARE_LEAST,
    };
    let found = segment(&sampled, &free.iter().map(|i| weights[*i]).collect::<Vec<f64>>(), &options);
    let mut groups: Vec<Option<u32>> = known.iter().map(|label| u32::try_from(*label).ok()).collect();
    let bodies = groups.iter().flatten().max().map_or(0, |most| *most + 1);
    for group in 0..found.iter().flatten().max().map_or(0, |most| *most + 1) {
        let own: Vec<usize> = members(&found, Some(group)).into_iter().map(|i| free[i]).collect();
        if own.is_empty() {
            continue;
        }
        let poses = poses_of(paths, &own, weights, times);
        if !rests(&poses, of.still) {
            let within = own.into_iter().filter(|i| !is_beside(paths, *i, &poses, of.still));
            within.for_each(|i| groups[i] = Some(bodies + group));
        }
    }
    groups
}

/// Whether the path of Gaussian `i` is nearer to rest than to a motion, by which it would move. A group's tolerance
/// holds what rests beside it while its way is short.
fn is_beside(paths: &[Vec<DVec3>], i: usize, motion: &Poses, still: f64) -> bool {
    let first = paths[0][i];
    let (mut from_rest, mut from_motion, mut way) = (0.0, 0.0, 0.0);
    for ((_, pose), now) in motion.poses.iter().zip(paths) {
        let there = pose.apply(first, motion.first);
        from_rest += now[i].distance_squared(first);
        from_motion += now[i].distance_squared(there);
        way += there.distance_squared(first);
    }
    from_rest < from_motion && way > still * still * paths.len() as f64
}

/// The group of each Gaussian, from 0 on: the connected groups of neighbours that move alike along `paths`,
/// which err by `noise`, scene units, and of Gaussians of one rigid group. What rests is not linked with what moves.
/// Fewer than [`FEWEST`] are no group.
fn linked(paths: &[Vec<DVec3>], groups: &[Option<u32>], rest: &[bool], noise: f64) -> Vec<Option<u32>> {
    let Some(first) = paths.first() else { return Vec::new() };
    let count = first.len();
    let next = |i: usize| Some(first[i].distance(first[nearest(first, first[i], (0..count).filter(|j| *j != i))?]));
    let link = LINK * median((0..count).filter_map(next).collect()).unwrap_or(0.0);
    let move_alike = |now: &[DVec3], i: usize, j: usize| {
        let way = now[i].distance(first[i]).max(now[j].distance(first[j]));
        (now[i] - first[i]).distance(now[j] - first[j]) <= noise + UNLIKE_SHARE * way
    };
    let are_linked = |i: usize, j: usize| {
        let is_near = first[i].distance(first[j]) <= link && rest[i] == rest[j];
        groups[i].is_some() && groups[i] == groups[j] || is_near && paths.iter().all(|now| move_alike(now, i, j))
    };
    let mut labels: Vec<Option<usize>> = vec![None; count];
    let mut sizes: Vec<usize> = Vec::new();
    for start in 0..count {
        if labels[start].is_some() {
            continue;
        }
        let (own, mut open) = (sizes.len(), vec![start]);
        labels[start] = Some(own);
        sizes.push(0);
        while let Some(i) = open.pop() {
            sizes[own] += 1;
            for j in (0..count).filter(|j| labels[*j].is_none() && are_linked(i, *j)).collect::<Vec<_>>() {
                labels[j] = Some(own);
                open.push(j);
            }
        }
    }
    let large: Vec<usize> = (0..sizes.len()).filter(|label| sizes[*label] >= FEWEST).collect();
    labels.iter().map(|label| large.binary_search(&(*label)?).ok().map(|number| number as u32)).collect()
}

/// `labels` in which what has none goes with the nearest of `places` that has one.
pub fn all_labelled(labels: &[Option<u32>], places: &[DVec3]) -> Vec<u32> {
    let labelled = || (0..labels.len()).filter(|i| labels[*i].is_some());
    let near = |i: usize| nearest(places, places[i], labelled()).and_then(|near| labels[near]).unwrap_or(0);
    (0..labels.len()).map(|i| labels[i].unwrap_or_else(|| near(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of Gaussians, one of which begins to move away, and a stray one.
    #[test]
    fn neighbours_that_keep_their_distance_are_one_body() {
        let row = |y: f64| (0..20).map(move |i| DVec3::new(0.1 * f64::from(i), y, 0.0));
        let first: Vec<DVec3> = row(0.0).chain(row(0.1)).chain([DVec3::new(0.5, 3.0, 0.0)]).collect();
        let moved = |by: f64| -> Vec<DVec3> {
            let shift = |i: usize| DVec3::Y * if (20..40).contains(&i) { by } else { 0.0 };
            first.iter().enumerate().map(|(i, at)| *at + shift(i)).collect()
        };
        let (alone, rest) = ([None; 41], [false; 41]);
        let together = linked(&[first.clone(), moved(0.01)], &alone, &rest, 0.01);
        assert!(together[..40] == [Some(0); 40] && together[40].is_none(), "a stray: {together:?}");
        assert_eq!(all_labelled(&together, &first), [0; 41]);
        let paths = [first.clone(), moved(0.01), moved(0.5)];
        let apart = linked(&paths, &alone, &rest, 0.01);
        assert!(apart[..20] == [Some(0); 20] && apart[20..40] == [Some(1); 20] && apart[40].is_none(), "{apart:?}");
        assert_eq!(linked(&paths, &[Some(3); 41], &rest, 0.01), [Some(0); 41], "one rigid group");
        assert!(linked(&[], &[], &[], 0.01).is_empty());
        assert_eq!(linked(&[first[..3].to_vec()], &alone[..3], &rest[..3], 0.01), [None; 3], "few are no body");
        assert_eq!(all_labelled(&[None; 3], &first[..3]), [0; 3]);
    }
}

//! Rigid bodies among the paths of Gaussians: the largest set of paths that share one rigid motion is a body, then the
//! largest of the rest.
//!
//! A rigid motion is proposed by a Gaussian and its neighbours, and judged by how many paths follow it at all times.

use gs_burn::glam::DVec3;

use super::law::BodyPose;
use super::rigid::rigid_motion;

/// Options of [`segment`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentOptions {
    /// Largest distance of a path from its body's motion at any time, scene units, while the path is where it began.
    pub tolerance: f64,
    /// Share of the distance from where the path began that is added to `tolerance`: errors of a learned motion grow
    /// with it.
    pub relative: f64,
    /// Most bodies.
    pub most: usize,
    /// Fewest Gaussians of a body.
    pub fewest: usize,
    /// Smallest share of all Gaussians in a body.
    pub share: f64,
}

/// Proposals for each body. A body with a tenth of the Gaussians is missed by all of them with a probability of 0.2 %.
const TRIALS: usize = 60;

/// Neighbours that propose a motion: enough to span a volume, few enough to lie in one body.
const NEIGHBOURS: usize = 12;

/// Rounds in which a proposal is fitted to the paths that follow it.
const ROUNDS: usize = 3;

/// The body of each path, numbered from the largest on; `None` for a path that belongs to no rigid body. `paths[j][i]`
/// is the position of Gaussian `i` at time `j`, the first time first; `weights[i]` says how much it counts. The same
/// arguments give the same bodies.
pub fn segment(paths: &[Vec<DVec3>], weights: &[f64], options: &SegmentOptions) -> Vec<Option<u32>> {
    let count = weights.len();
    let mut labels: Vec<Option<u32>> = vec![None; count];
    let Some(first) = paths.first() else { return labels };
    let total: f64 = weights.iter().sum();
    let mut state = 1_u64;
    let mut motions: Vec<Vec<BodyPose>> = Vec::new();
    while motions.len() < options.most {
        let free: Vec<usize> = (0..count).filter(|i| labels[*i].is_none()).collect();
        if free.len() < options.fewest.max(3) {
            break;
        }
        let mut best: Option<(f64, Vec<usize>)> = None;
        for _ in 0..TRIALS {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let seed = free[(state >> 33) as usize % free.len()];
            let mut members = neighbours(first, &free, seed);
            for _ in 0..ROUNDS {
                let motion = motion_of(paths, &members);
                members = followers(paths, &free, &motion, options);
                if members.len() < 3 {
                    break;
                }
            }
            let weight: f64 = members.iter().map(|i| weights[*i]).sum();
            if best.as_ref().is_none_or(|(most, _)| weight > *most) {
                best = Some((weight, members));
            }
        }
        let Some((weight, members)) = best else { break };
        if members.len() < options.fewest.max(3) || weight < options.share * total {
            break;
        }
        let number = motions.len() as u32;
        members.iter().for_each(|i| labels[*i] = Some(number));
        motions.push(motion_of(paths, &members));
    }
    // Each path goes with the motion that it follows best.
    let all: Vec<usize> = (0..count).collect();
    for i in all {
        let misfits = motions.iter().map(|motion| misfit(paths, motion, i, options));
        let nearest = misfits.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        labels[i] = nearest.filter(|(_, misfit)| *misfit <= 1.0).map(|(number, _)| number as u32);
    }
    labels
}

/// The centre in the first frame that motions are given about.
const ORIGIN: DVec3 = DVec3::ZERO;

/// The rigid motion of some paths, a pose for each time.
fn motion_of(paths: &[Vec<DVec3>], members: &[usize]) -> Vec<BodyPose> {
    let at = |time: &Vec<DVec3>| members.iter().map(|i| time[*i]).collect::<Vec<_>>();
    let before = at(&paths[0]);
    paths.iter().map(|time| rigid_motion(&before, &at(time), ORIGIN)).collect()
}

/// The largest distance over time of a path from a motion, in tolerances.
fn misfit(paths: &[Vec<DVec3>], motion: &[BodyPose], i: usize, options: &SegmentOptions) -> f64 {
    let first = paths[0][i];
    let at = |(time, pose): (&Vec<DVec3>, &BodyPose)| {
        let tolerance = options.tolerance + options.relative * time[i].distance(first);
        pose.apply(first, ORIGIN).distance(time[i]) / tolerance
    };
    paths.iter().zip(motion).map(at).fold(0.0, f64::max)
}

fn followers(paths: &[Vec<DVec3>], free: &[usize], motion: &[BodyPose], options: &SegmentOptions) -> Vec<usize> {
    free.iter().copied().filter(|i| misfit(paths, motion, *i, options) <= 1.0).collect()
}

fn neighbours(first: &[DVec3], free: &[usize], seed: usize) -> Vec<usize> {
    let mut near: Vec<(f64, usize)> = free.iter().map(|i| (first[*i].distance_squared(first[seed]), *i)).collect();
    let count = NEIGHBOURS.min(near.len());
    near.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(count);
    near.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::super::law::{LawValues, Term};
    use super::*;

    /// Three bodies side by side and some paths of their own.
    fn world() -> (Vec<Vec<DVec3>>, Vec<Option<u32>>) {
        let mut state = 3_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut spin = LawValues::REST;
        spin.set(Term::Spin, DVec3::new(0.0, 0.5, 5.0));
        let mut fall = LawValues::REST;
        fall.set(Term::Acceleration, DVec3::new(0.0, 0.0, -4.0));
        let bodies =
            [(DVec3::new(-1.0, 0.0, 0.0), 300, spin), (DVec3::ZERO, 200, fall), (DVec3::X, 100, LawValues::REST)];
        let mut paths = vec![Vec::new(); 9];
        let mut truth = Vec::new();
        for (number, (centre, count, law)) in bodies.into_iter().enumerate() {
            for _ in 0..count {
                let own = centre + DVec3::new(draw(), draw(), draw()) * 0.6;
                for (j, time) in paths.iter_mut().enumerate() {
                    let noise = DVec3::new(draw(), draw(), draw()) * 0.004;
                    time.push(law.pose(centre, j as f64 / 10.0).apply(own, centre) + noise);
                }
                truth.push(Some(number as u32));
            }
        }
        for _ in 0..20 {
            let (own, way) = (DVec3::new(draw(), draw(), draw()) * 3.0, DVec3::new(draw(), draw(), draw()) * 9.0);
            paths.iter_mut().enumerate().for_each(|(j, time)| time.push(own + way * (j as f64 / 10.0)));
            truth.push(None);
        }
        (paths, truth)
    }

    #[test]
    fn bodies_are_told_apart_by_their_motion() {
        let (paths, truth) = world();
        let options = SegmentOptions { tolerance: 0.02, relative: 0.0, most: 8, fewest: 20, share: 0.02 };
        let labels = segment(&paths, &vec![1.0; truth.len()], &options);
        let right = labels.iter().zip(&truth).filter(|(a, b)| a == b).count();
        assert!(right as f64 > 0.99 * truth.len() as f64, "{right} of {}", truth.len());
        assert_eq!(labels, segment(&paths, &vec![1.0; truth.len()], &options), "the same again");
    }

    #[test]
    fn no_paths_and_few_paths_are_no_bodies() {
        let options = SegmentOptions { tolerance: 0.02, relative: 0.0, most: 8, fewest: 20, share: 0.02 };
        assert!(segment(&[], &[], &options).is_empty());
        assert_eq!(segment(&[vec![DVec3::ZERO; 4]], &[1.0; 4], &options), [None; 4]);
    }
}

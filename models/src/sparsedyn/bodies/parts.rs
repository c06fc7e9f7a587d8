//! Bodies in parts: a body is divided to test whether its parts move alike, and parts that do are one body again.
//!
//! Bodies are found in a field's paths over the first frames, where parts that slide or swing against each other still
//! move much alike. While divided, each part follows its own photos; what was one body comes back together, what was
//! not stays apart.

use gs_burn::glam::DVec3;

use super::rigid::rigid_motion;

/// Rounds of k-means: assignments of a few hundred positions hardly change after ten.
const ROUNDS: usize = 12;

/// Most Gaussians of a part whose paths are compared: a pose has six numbers, and these give hundreds of coordinates.
const COMPARED: usize = 64;

/// Divides each body of `labels` (-1: of none) into compact parts by its Gaussians' `positions`: at most `most`, of
/// `fewest` Gaussians or more. Gives the part of each Gaussian and the body that each part is of. The same arguments
/// give the same parts.
pub fn divided(positions: &[DVec3], labels: &[i32], most: usize, fewest: usize) -> (Vec<i32>, Vec<usize>) {
    let bodies = labels.iter().max().map_or(0, |most| (*most + 1).max(0) as usize);
    let (mut parts, mut of) = (vec![-1; labels.len()], Vec::new());
    for body in 0..bodies {
        let members: Vec<usize> = (0..labels.len()).filter(|i| labels[*i] == body as i32).collect();
        let count = (members.len() / fewest.max(1)).clamp(1, most.max(1));
        let own = clusters(&members.iter().map(|i| positions[*i]).collect::<Vec<_>>(), count);
        // Clusters that came out too small go to the largest of the body.
        let sizes: Vec<usize> = (0..count).map(|k| own.iter().filter(|own| **own == k).count()).collect();
        let largest = (0..count).max_by_key(|k| (sizes[*k], usize::MAX - k)).unwrap_or(0);
        let kept: Vec<usize> = (0..count).filter(|k| sizes[*k] >= fewest || *k == largest).collect();
        for (i, own) in members.iter().zip(own) {
            let place = kept.iter().position(|k| *k == own);
            let place = place.or_else(|| kept.iter().position(|k| *k == largest)).unwrap_or(0);
            parts[*i] = (of.len() + place) as i32;
        }
        of.extend(kept.iter().map(|_| body));
    }
    (parts, of)
}

/// The cluster of each position: k-means from starts that lie far from each other.
fn clusters(positions: &[DVec3], count: usize) -> Vec<usize> {
    let Some(first) = positions.first() else { return Vec::new() };
    let mut centres = vec![*first];
    let nearest = |centres: &[DVec3], at: DVec3| {
        let distances = centres.iter().map(|centre| centre.distance_squared(at)).enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    };
    while centres.len() < count {
        let far = positions.iter().max_by(|a, b| nearest(&centres, **a).1.total_cmp(&nearest(&centres, **b).1));
        centres.push(*far.unwrap_or(first));
    }
    let mut own = vec![0; positions.len()];
    for _ in 0..ROUNDS {
        own = positions.iter().map(|at| nearest(&centres, *at).0).collect();
        for (k, centre) in centres.iter_mut().enumerate() {
            let members: Vec<DVec3> =
                positions.iter().zip(&own).filter(|(_, own)| **own == k).map(|(at, _)| *at).collect();
            if !members.is_empty() {
                *centre = members.iter().sum::<DVec3>() / members.len() as f64;
            }
        }
    }
    own
}

/// Joins parts whose Gaussians follow one rigid motion, the most alike first, until any two left differ by more than
/// `tolerance`, scene units, and the share `relative` of their way (each as root mean square over members and times:
/// errors of a learned motion grow with the way). `paths[j][i]` is the position of Gaussian `i` at time `j`. Gives
/// labels from 0 on; -1 stays.
pub fn joined(paths: &[Vec<DVec3>], labels: &[i32], tolerance: f64, relative: f64) -> Vec<i32> {
    let mut labels = labels.to_vec();
    let count = labels.iter().max().map_or(0, |most| (*most + 1).max(0) as usize);
    if paths.is_empty() || count == 0 {
        return labels;
    }
    let members = |labels: &[i32], part: i32| -> Vec<usize> {
        let all: Vec<usize> = (0..labels.len()).filter(|i| labels[*i] == part).collect();
        let step = all.len().div_ceil(COMPARED).max(1);
        all.into_iter().step_by(step).collect()
    };
    loop {
        let parts: Vec<(i32, Vec<usize>)> =
            (0..count as i32).map(|part| (part, members(&labels, part))).filter(|(_, own)| !own.is_empty()).collect();
        let mut best: Option<(f64, i32, i32)> = None;
        for (index, (a, of_a)) in parts.iter().enumerate() {
            for (b, of_b) in &parts[index + 1..] {
                let Difference { apart, way } = difference(paths, of_a, of_b);
                if apart <= tolerance + relative * way && best.is_none_or(|(least, ..)| apart < least) {
                    best = Some((apart, *a, *b));
                }
            }
        }
        let Some((_, a, b)) = best else { break };
        labels.iter_mut().filter(|label| **label == b).for_each(|label| *label = a);
    }
    numbered(&labels)
}

/// How far two parts are from one motion: root mean squares over members and times, scene units.
struct Difference {
    /// Distance of the members from the one rigid motion that fits both best.
    apart: f64,
    /// Distance of the members from where they began.
    way: f64,
}

/// The difference of two parts. Both count alike: a small part is not outvoted by a large one.
fn difference(paths: &[Vec<DVec3>], a: &[usize], b: &[usize]) -> Difference {
    let at = |time: &[DVec3], part: &[usize]| part.iter().map(|i| time[*i]).collect::<Vec<_>>();
    let even = a.len().min(b.len());
    let thin = |part: &[usize]| -> Vec<usize> { (0..even).map(|k| part[k * part.len() / even]).collect() };
    let both: Vec<usize> = thin(a).into_iter().chain(thin(b)).collect();
    let before = at(&paths[0], &both);
    let centre = before.iter().sum::<DVec3>() / before.len().max(1) as f64;
    let (mut misfit, mut moved) = (0.0, 0.0);
    for time in paths {
        let after = at(time, &both);
        let pose = rigid_motion(&before, &after, centre);
        misfit += before.iter().zip(&after).map(|(x, y)| pose.apply(*x, centre).distance_squared(*y)).sum::<f64>();
        moved += before.iter().zip(&after).map(|(x, y)| x.distance_squared(*y)).sum::<f64>();
    }
    let count = (both.len().max(1) * paths.len()) as f64;
    Difference { apart: (misfit / count).sqrt(), way: (moved / count).sqrt() }
}

/// Labels renumbered from 0 in the order of their first appearance; -1 stays.
pub fn numbered(labels: &[i32]) -> Vec<i32> {
    let mut seen: Vec<i32> = Vec::new();
    let mut number = |label: &i32| {
        if *label < 0 {
            return -1;
        }
        let known = seen.iter().position(|other| other == label);
        known.unwrap_or_else(|| {
            seen.push(*label);
            seen.len() - 1
        }) as i32
    };
    labels.iter().map(&mut number).collect()
}

#[cfg(test)]
mod tests {
    use super::super::law::{LawValues, Term};
    use super::*;

    /// Two rods end to end; the second turns at the joint if `hinged`.
    fn rods(hinged: bool) -> (Vec<Vec<DVec3>>, Vec<i32>) {
        let points: Vec<DVec3> = (0..200)
            .map(|i| DVec3::new(f64::from(i) * 0.01, f64::from(i % 5) * 0.02, f64::from(i % 7) * 0.02))
            .collect();
        let mut turn = LawValues::REST;
        turn.set(Term::Spin, DVec3::new(0.0, 0.0, 1.0));
        let joint = DVec3::new(1.0, 0.0, 0.0);
        let at = |j: usize, x: &DVec3| {
            let s = j as f64 * 0.1;
            let own = if hinged && x.x > 1.0 { turn.pose(joint, s).apply(*x, joint) } else { *x };
            own + DVec3::new(0.3, -0.2, 0.1) * s
        };
        let paths = (0..8).map(|j| points.iter().map(|x| at(j, x)).collect()).collect();
        (paths, vec![0; 200])
    }

    #[test]
    fn parts_of_one_body_come_together_and_parts_of_two_stay_apart() {
        for (hinged, bodies) in [(false, 1), (true, 2)] {
            let (paths, labels) = rods(hinged);
            let (parts, of) = divided(&paths[0], &labels, 4, 20);
            assert!(of.len() >= 3 && of.iter().all(|body| *body == 0), "{of:?}");
            let joined = joined(&paths, &parts, 0.02, 0.0);
            assert_eq!(joined.iter().max().map(|most| most + 1), Some(bodies), "hinged: {hinged}");
        }
    }

    #[test]
    fn small_bodies_are_not_divided_and_loose_gaussians_stay_loose() {
        let (paths, mut labels) = rods(false);
        labels[..50].fill(-1);
        let (parts, of) = divided(&paths[0], &labels, 4, 100);
        assert_eq!((of, parts.iter().filter(|part| **part == -1).count()), (vec![0], 50));
        assert_eq!(divided(&[], &[], 4, 20), (Vec::new(), Vec::new()));
        assert!(joined(&[], &[], 1.0, 0.0).is_empty());
        assert_eq!(numbered(&[4, -1, 2, 4]), [0, -1, 1, 0]);
    }
}

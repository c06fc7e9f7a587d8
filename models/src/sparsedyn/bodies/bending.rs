//! The law of a body that bends: a law of its whole, and oscillations of its nodes in the frame that the law moves.

use gs_burn::glam::DVec3;

use super::basis::MOTION;
use super::fit::{Poses, fit_law};
use super::law::{BodyPose, Law, LawValues, Term};
use super::least_squares::descent;
use super::motion::{Body, BodyFrame, RHYTHMS, Span};
use super::nodes::NodeFrame;
use super::rhythm::{self, Rhythm};
use crate::rotation::shortest;

/// Share of the observed time from which on the rest is foreseen to compare laws: the future of a recording is about a
/// third of what was seen.
const KNOWN: f64 = 0.75;

/// Largest order of the polynomials beside which oscillations are first looked for.
const DRIFTS: usize = 2;

/// Share of the misfit by which a step of law and oscillations together must gain to go on.
const CONVERGED: f64 = 1e-4;

/// Scores that differ by less are alike: on the scale of BIC 10 is very strong evidence.
const TIE: f64 = 10.0;

/// Lead in the score that a law of the whole needs before one of fewer numbers: it goes on for good, while half an
/// oscillation looks like an even motion. A rotation led rest by 1 to 21 for a tube that is held at one end, by 18 an
/// even motion for a block that slides, and by 69 for a swimmer that goes along an arc.
const LEAD: f64 = 30.0;

/// Laws of the whole: what goes to and fro is the nodes'.
const WHOLE: [Law; 6] = [
    Law::of(&[]),
    Law::of(&[Term::Velocity]),
    Law::of(&[Term::Velocity, Term::Acceleration]),
    Law::of(&[Term::Spin, Term::Pivot]),
    Law::of(&[Term::Velocity, Term::Spin]),
    Law::of(&[Term::Velocity, Term::Acceleration, Term::Spin]),
];

/// A body that bends, with its law.
#[derive(Debug, Clone)]
pub struct Bent {
    /// The body.
    pub body: Body,
    /// Root mean square distance of the nodes in the last part of the seen time from where the law has them that was
    /// fitted to the part before, scene units.
    pub foreseen: f64,
    /// Every law that was compared: that of the whole, the number of oscillations, and the score.
    pub compared: Vec<(Law, usize, f64)>,
}

/// The law of the body `own`, whose Gaussians as one rigid body have `poses`: of the laws of its whole whose scores are
/// near the least the one of fewest numbers, with the fewest oscillations whose score is near the least of that law.
pub fn bent(own: &Body, poses: &Poses, span: &Span) -> Bent {
    let seen: Vec<(f64, Vec<BodyPose>)> =
        poses.poses.iter().map(|(s, _)| (*s, own.node_poses(span, span.times[0] + s))).collect();
    let mut all = candidates(own, poses, &seen);
    let compared = all.iter().map(|one| (one.law, one.settled.rhythm.rates.len(), one.score)).collect();
    all.sort_by(|a, b| a.score.total_cmp(&b.score));
    let near = |all: &[Candidate], apart: f64| all.iter().take_while(|one| one.score <= all[0].score + apart).count();
    let law = all[..near(&all, LEAD)].iter().map(|one| one.law).min_by_key(|law| law.freedom());
    all.retain(|one| Some(one.law) == law);
    all.truncate(near(&all, TIE));
    let chosen = all.into_iter().min_by_key(|one| numbers(one.law, &one.settled.rhythm));
    let rests = || {
        let settled = Settled { values: LawValues::REST, rhythm: Rhythm::default(), left: f64::INFINITY };
        Candidate { score: 0.0, foreseen: f64::INFINITY, law: Law::of(&[]), settled }
    };
    let Candidate { foreseen, law, settled: Settled { values, rhythm, .. }, .. } = chosen.unwrap_or_else(rests);
    let rhythms = rhythm.rates.len() as u32;
    let multiples = rhythm.multiples.clone();
    let frame = BodyFrame { rhythms, multiples, ..BodyFrame::of(poses.first.to_array(), law, span.times[0]) };
    let of = |(index, (node, _)): (usize, &(NodeFrame, _))| (node.clone(), columns(&rhythm, span, node, index));
    let nodes = own.nodes.iter().enumerate().map(of).collect();
    Bent { body: Body { frame, values, free: Vec::new(), rates: rhythm.rates, nodes }, foreseen, compared }
}

/// A law of the whole with oscillations, how far it foresees the nodes, and its [`score`].
struct Candidate {
    score: f64,
    foreseen: f64,
    law: Law,
    settled: Settled,
}

/// The laws of the whole with each number of oscillations, fitted to the nodes of `own` as they were `seen`.
fn candidates(own: &Body, poses: &Poses, seen: &[(f64, Vec<BodyPose>)]) -> Vec<Candidate> {
    let known = ((KNOWN * seen.len() as f64) as usize).clamp(1, seen.len());
    let early = Poses { poses: poses.poses[..known].to_vec(), ..poses.clone() };
    let mut all = Vec::new();
    for law in WHOLE {
        let (Some(values), Some(before)) = (values_of(poses, law), values_of(&early, law)) else { continue };
        let mut last = f64::INFINITY;
        for count in 0..=RHYTHMS {
            let settled = |(values, seen)| settled(&own.nodes, poses.first, (law, values), count, seen);
            let (whole, before) = (settled((values, seen)), settled((before, &seen[..known])));
            let late = within(&own.nodes, before.values, poses.first, &seen[known - 1..]);
            let foreseen = apart(&before.rhythm, &late);
            let score = score(poses, numbers(law, &whole.rhythm), [whole.left, foreseen]);
            if score.is_finite() {
                all.push(Candidate { score, foreseen, law, settled: whole });
            }
            // A first oscillation may do nothing without a second; beyond, each says less than the one before.
            if count > 1 && score > last {
                break;
            }
            last = score;
        }
    }
    all
}

/// A law of the whole, and oscillations in its frame.
struct Settled {
    values: LawValues,
    rhythm: Rhythm,
    /// Root mean square distance of the nodes from where both have them, scene units.
    left: f64,
}

/// The law of the whole, `values` of which the poses say, and `count` oscillations of the nodes in its frame, fitted
/// together: in turn each would keep what the first fit of the other left it.
///
/// Poses of a whole that bends go to and fro with it, and over about a period an oscillation is not told from an even
/// or an accelerated motion. So the search begins with the rates that are found beside each of these, and the best end
/// counts.
fn settled(
    nodes: &[(NodeFrame, Vec<[f64; MOTION]>)],
    first: DVec3,
    (law, values): (Law, LawValues),
    count: usize,
    seen: &[(f64, Vec<BodyPose>)],
) -> Settled {
    let (s, data) = quantities(&within(nodes, values, first, seen));
    let of_law = law.free_numbers(&values);
    let parts = |numbers: &[f64]| {
        let values = law.with_free(&numbers[..of_law.len()]);
        (values, within(nodes, values, first, seen))
    };
    let held = |numbers: Vec<f64>| {
        let (law, rates) = numbers.split_at(of_law.len());
        [law.to_vec(), rhythm::held(rates.to_vec(), rhythm::range(&s))].concat()
    };
    let end = |drift: usize| {
        let begun = Rhythm::fit(&s, &data, count, drift);
        let left = |numbers: &[f64]| {
            let rates = begun.rates_of(&numbers[of_law.len()..]);
            rhythm::rest(&s, &quantities(&parts(numbers).1).1, &rates)
        };
        let numbers = descent([of_law.clone(), begun.numbers()].concat(), held, left, CONVERGED);
        (left(&numbers).iter().map(|x| x * x).sum::<f64>(), numbers, begun)
    };
    let drifts = if count > 0 && law != Law::of(&[]) { DRIFTS } else { 0 };
    let others = (1..=drifts).map(end);
    let (_, numbers, begun) = others.fold(end(0), |best, other| if other.0 < best.0 { other } else { best });
    let (values, rows) = parts(&numbers);
    let rhythm = begun.refitted(&s, &quantities(&rows).1, &numbers[of_law.len()..]);
    Settled { values, left: apart(&rhythm, &rows), rhythm }
}

/// The criterion by which laws are compared; lower is better: BIC over the seen time, and twice the negative
/// logarithm of the likelihood of what is foreseen. A body that bends counts as the six numbers of one rigid body at
/// each independent pose, and so do the sine and the cosine of an oscillation: neighbouring nodes move much alike.
fn score(poses: &Poses, numbers: usize, [left, foreseen]: [f64; 2]) -> f64 {
    let independent = MOTION as f64 * poses.independent.max(1.0);
    // Squared distances are of three coordinates.
    let likelihood = |rms: f64| (rms * rms / 3.0 + poses.noise * poses.noise).max(f64::MIN_POSITIVE).ln();
    independent * (likelihood(left) + (1.0 - KNOWN) * likelihood(foreseen)) + numbers as f64 * independent.ln()
}

/// Numbers of a law of the whole and of oscillations.
fn numbers(law: Law, rhythm: &Rhythm) -> usize {
    law.freedom() + rhythm.rates.len() * 2 * MOTION + rhythm.numbers().len()
}

fn values_of(poses: &Poses, law: Law) -> Option<LawValues> {
    if law == Law::of(&[]) { Some(LawValues::REST) } else { fit_law(poses, law).map(|fitted| fitted.values) }
}

/// Times since the first frame, and shifts and rotation vectors of the nodes there in the frame of a law.
type Within = [(f64, Vec<f64>)];

/// `seen` in the frame of the law of the whole, whose centre was at `first`; rotations are in scene units, by the width
/// of a node.
fn within(
    nodes: &[(NodeFrame, Vec<[f64; MOTION]>)],
    values: LawValues,
    first: DVec3,
    seen: &[(f64, Vec<BodyPose>)],
) -> Vec<(f64, Vec<f64>)> {
    let at = |(s, poses): &(f64, Vec<BodyPose>)| {
        let law = values.pose(first, *s);
        let back = law.rotation.inverse();
        let of = |(pose, (node, _)): (&BodyPose, &(NodeFrame, _))| {
            let place = back * (pose.centre - law.centre) + first;
            let turn = shortest(back * pose.rotation) * node.width;
            [(place - DVec3::from_array(node.centre)).to_array(), turn.to_array()].concat()
        };
        (*s, poses.iter().zip(nodes).flat_map(of).collect())
    };
    seen.iter().map(at).collect()
}

/// The times, and each quantity over them less its first value.
fn quantities(rows: &Within) -> (Vec<f64>, Vec<Vec<f64>>) {
    let of = |k: usize| rows.iter().map(|(_, row)| row[k] - rows[0].1[k]).collect();
    let count = rows.first().map_or(0, |(_, row)| row.len());
    (rows.iter().map(|(s, _)| *s).collect(), (0..count).map(of).collect())
}

/// Root mean square distance of the nodes from where `rhythm` has them, which goes on from the first of `late`.
fn apart(rhythm: &Rhythm, late: &Within) -> f64 {
    let Some((start, from)) = late.first() else { return f64::INFINITY };
    let left = less(from, &rhythm.at(*start));
    // Six quantities are one node's.
    let nodes = (late.len() * from.len()) as f64 / MOTION as f64;
    let of = |(s, row): &(f64, Vec<f64>)| less(&less(row, &rhythm.at(*s)), &left).iter().map(|x| x * x).sum::<f64>();
    (late.iter().map(of).sum::<f64>() / nodes.max(1.0)).sqrt()
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// The motion of a node by function of time: its sines and its cosines. The free steps beside them begin at zero: what
/// these say of seen frames the oscillations do not learn, and rates would keep the error of the tracking.
fn columns(rhythm: &Rhythm, span: &Span, node: &NodeFrame, index: usize) -> Vec<[f64; MOTION]> {
    let mut columns = vec![[0.0; MOTION]; span.columns() + 2 * RHYTHMS];
    let (count, waves) = (rhythm.rates.len(), span.columns());
    for k in 0..MOTION {
        let scale = if k < 3 { 1.0 } else { node.width };
        let Some(own) = rhythm.amplitudes.get(MOTION * index + k) else { continue };
        for rate in 0..count {
            columns[waves + rate][k] = own[rate] / scale;
            columns[waves + RHYTHMS + rate][k] = own[count + rate] / scale;
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use gs_burn::glam::DQuat;

    use super::super::basis::free;
    use super::super::least_squares::damped;
    use super::super::rigid::rigid_motion;
    use super::*;

    const SPAN: Span = Span { times: [0.0, 44.0 / 59.0], knots: 14, length: 0.5 };

    /// Where a swimmer's place `x`, 0 to 1, is at `s`: it goes on evenly, straight or along an arc of the rate `arc`
    /// about a point beside it, and bends by a wave of 1.5 periods a unit.
    fn swimmer(x: f64, s: f64, [speed, arc]: [f64; 2]) -> DVec3 {
        let wave = |s: f64| 0.2 * x * (std::f64::consts::TAU * (1.5 * s - 0.8 * x)).sin();
        let pivot = DVec3::new(0.5, 1.0, 0.0);
        let place = DVec3::new(x + speed * s, wave(s) - wave(0.0), 0.0);
        DQuat::from_rotation_z(arc * s) * (place - pivot) + pivot
    }

    /// Eight nodes that follow it and turn with the arc, and the poses of the whole.
    fn swims(speed: [f64; 2]) -> (Body, Poses) {
        let s: Vec<f64> = (0..45).map(|k| f64::from(k) / 59.0).collect();
        let columns: Vec<Vec<f64>> =
            (0..SPAN.columns()).map(|k| s.iter().map(|s| free(SPAN.times, SPAN.knots, *s)[k]).collect()).collect();
        let node = |k: usize| {
            let x = k as f64 / 7.0;
            let first = swimmer(x, 0.0, speed);
            let mut motion = vec![[0.0; MOTION]; SPAN.columns()];
            for axis in 0..3 {
                let values: Vec<f64> = s.iter().map(|s| (swimmer(x, *s, speed) - first)[axis]).collect();
                let solved = damped(&columns, &values, 1e-12).expect("a solution");
                motion.iter_mut().zip(solved).for_each(|(six, x)| six[axis] = x);
            }
            let turned: Vec<f64> = s.iter().map(|s| speed[1] * s).collect();
            let solved = damped(&columns, &turned, 1e-12).expect("a solution");
            motion.iter_mut().zip(solved).for_each(|(six, x)| six[5] = x);
            (NodeFrame { centre: first.to_array(), width: 0.1, body: 0 }, motion)
        };
        let frame = BodyFrame::of([0.5, 0.0, 0.0], Law::of(&[]), SPAN.times[1]);
        let body = Body { nodes: (0..8).map(node).collect(), ..Body::of(frame, LawValues::REST) };
        let at = |s: f64| (0..8).map(|k| swimmer(f64::from(k) / 7.0, s, speed)).collect::<Vec<DVec3>>();
        let first = at(0.0).iter().sum::<DVec3>() / 8.0;
        let poses = Poses {
            first,
            size: 0.3,
            poses: s.iter().map(|s| (*s, rigid_motion(&at(0.0), &at(*s), first))).collect(),
            independent: 11.0,
            noise: 1e-3,
        };
        (body, poses)
    }

    #[test]
    fn a_wave_and_the_way_of_the_whole_are_found() {
        let arc = Law::of(&[Term::Spin, Term::Pivot]);
        for (speed, law) in [([0.0; 2], Law::of(&[])), ([0.8, 0.0], Law::of(&[Term::Velocity])), ([0.0, 1.2], arc)] {
            let (own, poses) = swims(speed);
            let found = bent(&own, &poses, &SPAN);
            let off = |s: f64| {
                let law = found.body.values.pose(poses.first, s);
                let place = |(node, motion): &(NodeFrame, Vec<[f64; MOTION]>)| {
                    let mut place = DVec3::from_array(node.centre);
                    for (k, rate) in found.body.rates.iter().enumerate() {
                        let (sine, cosine) = (motion[SPAN.columns() + k], motion[SPAN.columns() + RHYTHMS + k]);
                        place += DVec3::from_slice(&sine) * (rate * s).sin();
                        place += DVec3::from_slice(&cosine) * ((rate * s).cos() - 1.0);
                    }
                    law.apply(place, poses.first)
                };
                let far = |(k, node)| swimmer(k as f64 / 7.0, s, speed).distance_squared(place(node));
                (found.body.nodes.iter().enumerate().map(far).sum::<f64>() / 8.0).sqrt()
            };
            assert_eq!(found.body.frame.law, law, "{:?}", found.body.rates);
            let wave = std::f64::consts::TAU * 1.5;
            assert!(matches!(found.body.rates[..], [rate] if (rate - wave).abs() < 1e-3), "{:?}", found.body.rates);
            // A third of the seen time after it; nothing but the knots of the free motion is between.
            assert!(found.foreseen < 1e-3, "{} of an amplitude of 0.2", found.foreseen);
            assert!(off(1.0) < 1e-3, "{} of an amplitude of 0.2", off(1.0));
        }
    }
}

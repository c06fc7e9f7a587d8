//! Motions that change at a time: a body moves freely until then, and follows a law from there on.

use gs_burn::glam::{DQuat, DVec3};

use super::fit::{Fitted, Poses, compare_laws, fit_law, select_law};
use super::law::{BodyPose, Law};
use crate::rotation::shortest;

/// Fewest poses that a law is fitted to: a third of them is foreseen from the others.
const FEWEST: usize = 9;

/// Changes that are tried at most: every second frame of a recording as long as the paper's.
const TRIED: usize = 24;

/// Rounds in which the first pose and the law are fitted in turn.
const ROUNDS: usize = 2;

/// A law from a time on.
#[derive(Debug, Clone)]
pub struct Phase {
    /// The pose with which it begins; 0: the law holds all the time.
    pub from: usize,
    /// The poses from there on, about the centre there.
    pub poses: Poses,
    /// The law.
    pub fitted: Fitted,
    /// The cost of the poses before the change, at rest or by a free motion without an error, and of those behind it by
    /// the law, in twice the negative logarithm of the likelihood; lower is better.
    pub cost: f64,
}

/// The laws of `laws` that say `poses` from some pose on to the last, best of each change first.
pub fn phases(poses: &Poses, laws: &[Law]) -> Vec<Phase> {
    let count = poses.poses.len();
    let last = count.saturating_sub(FEWEST);
    let every = count.div_ceil(TRIED).max(1);
    let mut found: Vec<Phase> = (0..=last).step_by(every).flat_map(|from| of(poses, laws, from)).collect();
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found
}

/// The laws from pose `from` on.
fn of(poses: &Poses, laws: &[Law], from: usize) -> Vec<Phase> {
    let own = settled(suffix(poses, from), laws, from);
    let all = 6.0 * poses.independent.max(1.0);
    let free = all * from as f64 / poses.poses.len().max(1) as f64;
    let freely = free * ((poses.noise * poses.noise).max(f64::MIN_POSITIVE).ln() + all.ln());
    let before = at_rest(poses, from).map_or(freely, |cost| cost.min(freely));
    // What is foreseen of the last third of all poses and of these counts alike.
    let whole = poses.poses.len() as f64 / own.poses.len().max(1) as f64;
    let phase = |fitted: Fitted| Phase {
        from,
        poses: own.clone(),
        fitted,
        cost: before + fitted.bic + fitted.surprise * whole,
    };
    compare_laws(&own, laws).into_iter().map(phase).collect()
}

/// The cost of the poses before pose `from` of a body that rests until then, which has no number. (The best of all laws
/// in its place divided what swings into two laws, each of which took a part of the poses' common error.)
fn at_rest(poses: &Poses, from: usize) -> Option<f64> {
    if from < FEWEST {
        return None;
    }
    let share = from as f64 / poses.poses.len() as f64;
    let own = Poses { poses: poses.poses[..from].to_vec(), independent: poses.independent * share, ..poses.clone() };
    fit_law(&own, Law::of(&[])).map(|fitted| fitted.bic)
}

/// The poses from `from` on, as of a body that begins there.
fn suffix(poses: &Poses, from: usize) -> Poses {
    let Some((start, begin)) = poses.poses.get(from).copied().filter(|_| from > 0) else { return poses.clone() };
    let back = begin.rotation.inverse();
    let own =
        |(s, pose): &(f64, BodyPose)| (s - start, BodyPose { rotation: pose.rotation * back, centre: pose.centre });
    let share = (poses.poses.len() - from) as f64 / poses.poses.len() as f64;
    Poses {
        first: begin.centre,
        poses: poses.poses[from..].iter().map(own).collect(),
        independent: poses.independent * share,
        ..poses.clone()
    }
}

/// `poses` about the first of them as a law of the others has it: a smooth free motion is bent where a motion changes,
/// and a law would begin with its error. The first pose of a recording is the scene's own and stays.
fn settled(mut poses: Poses, laws: &[Law], from: usize) -> Poses {
    for _ in 0..if from > 0 { ROUNDS } else { 0 } {
        let Some(fitted) = select_law(&poses, laws) else { break };
        let mut turn = DVec3::ZERO;
        let mut place = DVec3::ZERO;
        for (s, pose) in &poses.poses {
            let law = fitted.values.pose(poses.first, *s);
            let back = law.rotation.inverse();
            turn += shortest(back * pose.rotation);
            place += back * (pose.centre - law.centre);
        }
        let count = poses.poses.len().max(1) as f64;
        let off = DQuat::from_scaled_axis(turn / count);
        poses.first += place / count;
        poses.poses.iter_mut().for_each(|(_, pose)| pose.rotation *= off.inverse());
    }
    poses
}

impl Phase {
    /// The free motion until the law holds, and the law's own poses behind: of `poses`, all of the body's.
    pub fn before(&self, poses: &Poses) -> Poses {
        let Some((start, begin)) = poses.poses.get(self.from).copied() else { return poses.clone() };
        // Where the body is turned to at the change, by the settled first pose.
        let first = self.poses.poses.first().map_or(DQuat::IDENTITY, |(_, pose)| pose.rotation.inverse());
        let turned = first * begin.rotation;
        let mut all = poses.clone();
        for (s, pose) in &mut all.poses[self.from..] {
            let law = self.fitted.values.pose(self.poses.first, *s - start);
            *pose = BodyPose { rotation: law.rotation * turned, centre: law.centre };
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparsedyn::bodies::basis;
    use crate::sparsedyn::bodies::fit::fit_free;
    use crate::sparsedyn::bodies::{Body, BodyFrame, LawValues, Span, Term};

    const FLIGHT: Law = Law::of(&[Term::Velocity, Term::Acceleration, Term::Spin]);

    /// A block that slides evenly, is pushed after `pushed` of 45 frames, and falls turning.
    fn pushed(pushed: usize, noise: f64) -> Poses {
        let first = DVec3::new(-0.5, -0.3, 1.6);
        let mut state = 7_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12.0_f64.sqrt() * noise
        };
        let slide = DVec3::new(1.4, 0.0, 0.0);
        let start = pushed as f64 / 59.0;
        let mut fall = LawValues::REST;
        fall.set(Term::Velocity, DVec3::new(1.35, -0.12, 0.2));
        fall.set(Term::Acceleration, DVec3::new(0.0, 0.0, -5.0));
        fall.set(Term::Spin, DVec3::new(0.5, 3.8, 0.8));
        let one = |frame: usize| {
            let s = frame as f64 / 59.0;
            let mut pose = match frame < pushed {
                true => BodyPose { rotation: DQuat::IDENTITY, centre: first + slide * s },
                false => fall.pose(first + slide * start, s - start),
            };
            pose.centre += DVec3::new(draw(), draw(), draw());
            pose.rotation = DQuat::from_scaled_axis(DVec3::new(draw(), draw(), draw()) / 0.3) * pose.rotation;
            (s, pose)
        };
        Poses { first, size: 0.3, poses: (0..45).map(one).collect(), independent: 11.0, noise: 0.006 }
    }

    #[test]
    fn a_push_is_found_with_the_law_behind_it() {
        for noise in [1e-4, 0.01] {
            let poses = pushed(21, noise);
            let best = phases(&poses, &Law::ALL).into_iter().next().expect("a phase");
            assert_eq!(best.fitted.law, FLIGHT, "noise {noise}, from {}", best.from);
            assert!((20..=26).contains(&best.from), "noise {noise}: from {}", best.from);
            // The future, from the pose that the law begins with.
            let start = best.from as f64 / 59.0;
            let (truth, own) =
                (pushed(21, 0.0).poses[44].1, best.fitted.values.pose(best.poses.first, 44.0 / 59.0 - start));
            assert!(own.centre.distance(truth.centre) < 0.02, "noise {noise}: {}", own.centre.distance(truth.centre));
        }
        let whole = phases(&pushed(0, 1e-4), &Law::ALL).into_iter().next().expect("a phase");
        assert_eq!((whole.fitted.law, whole.from), (FLIGHT, 0));
        assert!(phases(&Poses { poses: Vec::new(), ..pushed(0, 0.0) }, &Law::ALL).is_empty());
    }

    /// A block that rests for 30 of 45 frames and then turns about a fixed axis, as a spline of few knots followed it:
    /// bent before the push, so that an accelerated rotation which began earlier says as much.
    #[test]
    fn what_rests_until_it_is_pushed_has_the_law_behind_the_push() {
        let mut turn = LawValues::REST;
        turn.set(Term::Spin, DVec3::new(-1.5, 0.0, 0.0));
        turn.set(Term::Pivot, DVec3::new(0.0, 0.1, 0.2));
        let span = Span { times: [0.0, 44.0 / 59.0], knots: 14, length: 1.0 };
        let rest = pushed(0, 0.0);
        let pose = |frame: usize| {
            let s = frame as f64 / 59.0;
            (s, turn.pose(rest.first, (s - 30.0 / 59.0).max(0.0)))
        };
        let exact = Poses { poses: (0..45).map(pose).collect(), ..rest };
        let frame = BodyFrame::of(exact.first.to_array(), Law::of(&[]), span.times[1]);
        let body = Body { free: fit_free(&exact, &span), ..Body::of(frame, LawValues::REST) };
        let followed = |(s, _): &(f64, BodyPose)| (*s, body.pose(&span, *s));
        let poses = Poses { poses: exact.poses.iter().map(followed).collect(), ..exact };
        let best = phases(&poses, &Law::ALL).into_iter().next().expect("a phase");
        assert_eq!(best.fitted.law, Law::of(&[Term::Spin, Term::Pivot]), "from {}", best.from);
        assert!((28..=34).contains(&best.from), "from {}", best.from);
    }

    /// The free motion before a law leads to the pose with which the law begins.
    #[test]
    fn a_free_motion_leads_to_its_law() {
        let poses = pushed(21, 0.0);
        let best = phases(&poses, &[FLIGHT]).into_iter().find(|phase| phase.from == 22).expect("a change at 22");
        let span = Span { times: [0.0, 44.0 / 59.0], knots: 14, length: 1.0 };
        let free = fit_free(&best.before(&poses), &span);
        let values = basis::free(span.times, span.knots, 22.0 / 59.0);
        let shift: DVec3 = free.iter().zip(values).map(|(six, x)| DVec3::from_slice(&six[..3]) * x).sum();
        assert!((poses.first + shift).distance(best.poses.first) < 0.02, "a knot is four frames long");
    }
}

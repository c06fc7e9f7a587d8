//! The choice of a body's law: poses bring candidates into an order, photos judge the best of them after their numbers
//! were fitted to these, and of laws that are alike the one of fewest numbers is taken, of equals the one that holds
//! longest.

use gs_models::sparsedyn::bodies::Body;
use gs_models::sparsedyn::bodies::phases::Phase;

use super::judges::said;

/// Laws whose score is worse than the best by more than this are not shown to the photos. Poses of a tracked body err
/// together: of a pushed block whose poses were 2 pixels off the right law was worse by more than 40.
const CANDIDATE_MARGIN: f64 = 100.0;

/// Most motions of a body that photos judge with numbers from the poses: each costs a rendering per photo.
const CANDIDATES_MAX: usize = 24;

/// Most of them whose numbers are then fitted to the photos: each costs as much as some dozen steps of training. With 6
/// in place of 4, and that margin in place of 40, the future of the pushed block gained 1.1 dB.
const REFINED: usize = 6;

/// Most of these by one law from different times on: others are left room.
const OF_LAW: usize = 2;

/// Laws whose costs differ by less are alike: 3 % of the error of the photos. Of these one from the first frame on is
/// taken before others, then the one of fewest numbers, then the one that holds longest. A box that slows down, by one
/// law from the second frame on, was ahead by 2 as one that turns about a far pivot from the seventh on.
const TIE: f64 = 5.0;

/// The difference of costs that makes a law `e` times as likely as another. Were all errors independent, it would be 2.
/// Of 51 bodies of random worlds laws that were ahead by up to 5 were right in 9 of 11 cases, by 5 to 20 in 12 of 14,
/// by more in 25 of 26.
const CALIBRATION: f64 = 10.0;

/// Least share of a recording between two changes to the same law that photos judge: poses that err together put a
/// change some frames off.
pub const CHANGES_APART: f64 = 0.08;

/// A law that was chosen.
pub struct Chosen {
    pub phase: Phase,
    pub body: Body,
    /// How sure its kind is among those that photos judged, 0 to 1; `None` where they judged no other.
    pub confidence: Option<f64>,
}

/// A candidate: its cost by poses and photos together, its motion, and the body that moves so.
type Candidate = (f64, Phase, Body);

/// The law of `phases`, in the order of their cost, that poses and photos bear out together. `with` gives the body of a
/// phase, `refine` fits its numbers to the photos, `judge` gives their errors.
pub fn chosen(
    phases: Vec<Phase>,
    with: impl Fn(&Phase) -> Body,
    refine: impl Fn(Body) -> Body,
    judge: impl Fn(&[Body]) -> Vec<Option<f64>>,
) -> Option<Chosen> {
    let all = candidates(phases).into_iter().map(|phase| (with(&phase), phase));
    let mut all = shortlisted(ordered(all.collect(), &judge));
    if all.len() > 1 {
        all = ordered(all.into_iter().map(|(_, phase, body)| (refine(body), phase)).collect(), &judge);
    }
    let least = all.first()?.0;
    // A change costs its time and the free motion before it.
    let freedom = |(_, phase, _): &Candidate| (phase.from > 0, phase.fitted.law.freedom(), phase.from);
    let near = all.iter().enumerate().take_while(|(_, (cost, ..))| *cost <= least + TIE);
    let best = near.min_by_key(|(_, candidate)| freedom(candidate)).map_or(0, |(index, _)| index);
    let law = |(_, phase, _): &Candidate| phase.fitted.law;
    let is_first = |(index, one): &(usize, &Candidate)| all[..*index].iter().all(|other| law(other) != law(one));
    let weight = |(cost, ..): &Candidate| (-(cost - least) / CALIBRATION).exp();
    let kinds: Vec<&Candidate> = all.iter().enumerate().filter(is_first).map(|(_, kind)| kind).collect();
    let total: f64 = kinds.iter().map(|kind| weight(kind)).sum();
    let own = kinds.iter().find(|kind| law(kind) == law(&all[best])).map_or(0.0, |kind| weight(kind));
    let confidence = (kinds.len() > 1 && least.is_finite()).then_some(own / total);
    let (_, phase, body) = all.swap_remove(best);
    Some(Chosen { phase, body, confidence })
}

/// The first of `all`, few of each kind of law.
fn shortlisted(all: Vec<Candidate>) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for one in all {
        let same = kept.iter().filter(|other| other.1.fitted.law == one.1.fitted.law).count();
        if kept.len() < REFINED && same < OF_LAW {
            kept.push(one);
        }
    }
    kept
}

/// The phases, of `phases` in the order of their cost, that are shown to the photos.
fn candidates(phases: Vec<Phase>) -> Vec<Phase> {
    let least = phases.first().map_or(0.0, |phase| phase.cost);
    let mut candidates: Vec<Phase> = Vec::new();
    for phase in phases.into_iter().take_while(|phase| phase.cost <= least + CANDIDATE_MARGIN) {
        let frames = phase.from + phase.poses.poses.len();
        let is_near = |other: &Phase| phase.from.abs_diff(other.from) as f64 <= CHANGES_APART * frames as f64;
        let is_new = candidates.iter().all(|other| other.fitted.law != phase.fitted.law || !is_near(other));
        if candidates.len() < CANDIDATES_MAX && is_new {
            candidates.push(phase);
        }
    }
    candidates
}

/// Candidates in the order in which poses and photos together bear them out.
fn ordered(all: Vec<(Body, Phase)>, judge: impl Fn(&[Body]) -> Vec<Option<f64>>) -> Vec<Candidate> {
    let bodies: Vec<Body> = all.iter().map(|(body, _)| body.clone()).collect();
    let errors = if all.len() > 1 { judge(&bodies) } else { vec![None] };
    let costed = |((body, phase), error): ((Body, Phase), Option<f64>)| {
        let (law, deviation) = (phase.fitted.law.in_words(), phase.fitted.deviation);
        tracing::info!(
            law,
            from = phase.from,
            cost = phase.cost,
            error,
            deviation,
            "a law before photos of late times"
        );
        (phase.cost + said(error), phase, body)
    };
    let mut all: Vec<Candidate> = all.into_iter().zip(errors).map(costed).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

#[cfg(test)]
mod tests {
    use gs_burn::glam::DVec3;
    use gs_models::sparsedyn::bodies::fit::Poses;
    use gs_models::sparsedyn::bodies::phases::phases;
    use gs_models::sparsedyn::bodies::{BodyFrame, Law, LawValues, Term};

    use super::super::judges::PHOTOS_WEIGHT;
    use super::*;

    /// Poses of an even rotation about a pivot, as 46 frames show it.
    fn turning() -> Poses {
        let mut values = LawValues::REST;
        values.set(Term::Spin, DVec3::new(0.0, 0.0, 2.0));
        values.set(Term::Pivot, DVec3::new(0.5, 0.0, 0.0));
        let first = DVec3::new(0.2, -0.1, 0.3);
        let poses = (0..46).map(|frame| f64::from(frame) / 60.0).map(|s| (s, values.pose(first, s))).collect();
        Poses { first, size: 0.3, poses, independent: 11.0, noise: 0.01 }
    }

    #[test]
    fn photos_overrule_the_poses_only_where_they_are_clear() {
        let even = Law::of(&[Term::Spin, Term::Pivot]);
        let faster = Law::of(&[Term::Spin, Term::SpinUp, Term::Pivot]);
        let with = |phase: &Phase| Body::of(BodyFrame::of([0.0; 3], phase.fitted.law, 0.0), phase.fitted.values);
        let law = |judge: &dyn Fn(&[Body]) -> Vec<Option<f64>>| {
            chosen(phases(&turning(), &Law::ALL), with, |body| body, judge)
                .map(|it| (it.phase.fitted.law, it.phase.from))
        };
        // The error of `faster` in units of that of the law which the poses bear out best: a number costs 4.2.
        for (factor, expected) in [(1.0, even), (0.99, even), (0.5, faster)] {
            let error = |body: &Body| Some(if body.frame.law == faster { factor } else { 1.0 });
            let found = law(&|bodies: &[Body]| bodies.iter().map(error).collect());
            assert_eq!(found.map(|(law, _)| law), Some(expected), "{factor}");
        }
        // Laws that are alike leave the choice to their numbers, and neither is sure.
        let all = phases(&turning(), &[even, faster]);
        let ahead = all.iter().find(|phase| phase.fitted.law == faster).expect("fitted").cost - all[0].cost;
        let factor = (-(ahead + 0.5 * TIE) / PHOTOS_WEIGHT).exp();
        let error = |body: &Body| Some(if body.frame.law == faster { factor } else { 1.0 });
        let judge = |bodies: &[Body]| bodies.iter().map(error).collect();
        let near = chosen(all, with, |body| body, judge).expect("a law");
        assert_eq!(near.phase.fitted.law, even);
        assert!((near.confidence.expect("two kinds") - 1.0 / (1.0 + (0.5 * TIE / CALIBRATION).exp())).abs() < 1e-9);
        // A law that looks no better with numbers from the poses, and is right with its own.
        let refine = |body: Body| match body.frame.law == faster {
            true => Body { values: LawValues::REST, ..body },
            false => body,
        };
        let error = |body: &Body| Some(if body.values == LawValues::REST { 0.5 } else { 1.0 });
        let judge = |bodies: &[Body]| bodies.iter().map(error).collect();
        let right = chosen(phases(&turning(), &Law::ALL), with, refine, judge).expect("a law");
        assert_eq!((right.phase.fitted.law, right.body.values), (faster, LawValues::REST));
        // Of equals the one that holds longest.
        let base = phases(&turning(), &[even]).swap_remove(0);
        let from = |from: usize, cost: f64| Phase { from, cost, ..base.clone() };
        let both = vec![from(12, base.cost - 0.5 * TIE), from(4, base.cost)];
        let longest = chosen(both, with, |body| body, |bodies| vec![None; bodies.len()]).expect("a law");
        assert_eq!(longest.phase.from, 4);
        // Photos that say nothing leave the choice to the poses.
        assert_eq!(law(&|bodies: &[Body]| vec![None; bodies.len()]), Some((even, 0)));
    }
}

//! The law of each body: parts that moved alike are one body again; the poses of each bear out some laws, and photos of
//! later times choose among these.

use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_datasets::View;
use gs_models::sparsedyn::bodies::fit::Poses;
use gs_models::sparsedyn::bodies::parts::joined;
use gs_models::sparsedyn::bodies::{Bodies, BodyFrame, Fitted, Law, LawValues, compare_laws, fit_law};

use super::config::BodiesConfig;
use super::judges::{Judges, with_one, with_rest};
use super::poses::{middle, paths, pixel_size, poses_of, weights_of};
use super::update::forget;
use super::{Sparsedyn, Step};

/// Largest difference of two parts' motions that is one motion, in the noise of a pose. By BIC a second free motion
/// costs six numbers a knot, each worth the logarithm of some hundred coordinates, 4.6; the misfit that pays for it is
/// `sqrt(2 * 4.6)` of the noise.
const MERGE_SIGMA: f64 = 3.0;

/// Share of the way of two parts that may be added to that difference. Gaussians of one pendulum that had been taken
/// for three bodies differed by 3 pixels on a way of 100; bodies that move on their own differ by the way itself.
const JOINED_SHARE: f64 = 0.04;

/// Laws whose score is worse than the best by more than this are not shown to the photos. The score adds two terms of
/// BIC's scale, on which 10 is very strong evidence; poses of a tracked body err together, so that each term may
/// mislead by that much.
const CANDIDATE_MARGIN: f64 = 40.0;

/// Most laws of a body that photos judge: each costs a rendering per photo.
const CANDIDATES_MAX: usize = 6;

/// Largest excess over the least error of the photos at which a law with a better score is preferred. Most of the error
/// is that of the first frame: right laws have had errors 5 and 10 % above richer ones, and wrong ones have had 20 to
/// 70 % more than the right one.
const ERROR_TOLERANCE: f64 = 0.2;

/// Shares of the poses, from the first on, to which the laws of a lost body are fitted: it may have been lost early,
/// and fewer poses determine less.
const PREFIX_SHARES: [f64; 4] = [0.25, 0.4, 0.65, 1.0];

/// Fewest poses that determine a law of second order in their noise.
const FEWEST_POSES: usize = 6;

/// Excess over the least error of the photos at which a lost body takes a law of fewer numbers. The body may be small
/// in the photos, so that much of its motion is a small share of their error; equal laws fitted to one sequence differ
/// by less than this.
const TIE_TOLERANCE: f64 = 0.005;

/// Joins parts that moved alike, gives each body its law, and drops the free motion.
pub fn with_laws(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    let config = &at.config.method.bodies;
    if model.bodies.is_none() {
        return model;
    }
    let times = &at.cues.times;
    let all = paths(&model, &model.first_positions(gaussians), times);
    let everything: Vec<usize> = (0..model.frame.rows.len()).collect();
    let weights = weights_of(&model, gaussians, &everything);
    let pixel = pixel_size(views, middle(&all[0], &weights));
    let labels = joined(&all, &model.frame.labels, MERGE_SIGMA * config.noise_pixels * pixel, JOINED_SHARE);
    let judges = Judges::of(times, views, gaussians, at);
    let whole = Judges::of_all(times, views, gaussians, at);
    let count = labels.iter().max().map_or(0, |most| *most + 1);
    let lawful = |body: i32| {
        let members: Vec<usize> = (0..labels.len()).filter(|i| labels[*i] == body).collect();
        let own = poses_of(&all, &members, &weights, times, 0.0);
        let pixel = pixel_size(views, own.first);
        let sequence =
            Poses { independent: times.len() as f64 / config.knot_frames, noise: config.noise_pixels * pixel, ..own };
        let frame = |law: Law| BodyFrame { centre: sequence.first.to_array(), law };
        let judge = |law: Law, values: LawValues| judges.error(&with_one(&model, &members, frame(law), values));
        let fitted = chosen(&sequence, judge).or_else(|| fit_law(&sequence, Law::GENERAL));
        let pixels = fitted.map_or(f64::INFINITY, |fitted| fitted.deviation / pixel);
        let foreseen = fitted.map(|fitted| fitted.foreseen / pixel);
        let fitted = match is_lost(pixels, config) {
            true => {
                let judge = |law: Law, values: LawValues| whole.error(&with_one(&model, &members, frame(law), values));
                recovered(&sequence, fitted, judge)
            }
            false => fitted,
        };
        let (law, values) = fitted.map_or((Law::of(&[]), LawValues::REST), |fitted| (fitted.law, fitted.values));
        tracing::info!(
            step = at.step,
            body,
            gaussians = members.len(),
            law = law.in_words(),
            deviation_pixels = pixels,
            foreseen_pixels = foreseen,
            "law of a body"
        );
        Lawful { frame: frame(law), members, values, pixels }
    };
    let lawful: Vec<Lawful> = (0..count).map(lawful).collect();
    let of = assigned(&model, &lawful, config, |model| judges.error(model));
    let kept: Vec<usize> = (0..lawful.len()).filter(|body| of.contains(&Some(*body))).collect();
    let number = |body: usize| kept.iter().position(|kept| *kept == body);
    model.frame.labels = vec![-1; labels.len()];
    let mut resting = Vec::new();
    for (body, of) in lawful.iter().zip(&of) {
        match of.and_then(number) {
            Some(number) => body.members.iter().for_each(|i| model.frame.labels[*i] = number as i32),
            None => resting.extend_from_slice(&body.members),
        }
    }
    let frames: Vec<BodyFrame> = kept.iter().map(|body| lawful[*body].frame.clone()).collect();
    let values: Vec<LawValues> = kept.iter().map(|body| lawful[*body].values).collect();
    model.frame.knots = 0;
    model.frame.bodies = frames.clone();
    model.bodies = (!frames.is_empty())
        .then(|| Bodies::new(frames, &values, model.frame.span, (model.frame.length, 0), &gaussians.device()));
    model.make_static(&resting);
    forget(adam);
    model
}

/// A body with its law.
struct Lawful {
    frame: BodyFrame,
    members: Vec<usize>,
    values: LawValues,
    /// Root mean square distance of its markers from its poses, of the law that these bear out, pixels.
    pixels: f64,
}

/// Whether a body's poses follow no law: their deviation from the nearest one, pixels, is above the tolerance of a
/// body.
fn is_lost(pixels: f64, config: &BodiesConfig) -> bool {
    pixels.is_nan() || pixels > config.tolerance_pixels
}

/// The body whose law each body takes: its own, or where its poses follow none, that of the body, or the rest (`None`),
/// with which late photos have no larger error. Such a body is a part that was lost while it was followed.
fn assigned(
    model: &Sparsedyn,
    lawful: &[Lawful],
    config: &BodiesConfig,
    error: impl Fn(&Sparsedyn) -> Option<f64>,
) -> Vec<Option<usize>> {
    let judged = |members: &[usize], of: &Lawful| {
        error(&with_one(model, members, of.frame.clone(), of.values)).unwrap_or(f64::INFINITY)
    };
    let taken = |(index, body): (usize, &Lawful)| {
        if !is_lost(body.pixels, config) {
            return Some(index);
        }
        let at_rest = error(&with_rest(model, &body.members)).unwrap_or(f64::INFINITY);
        let own = (Some(index), judged(&body.members, body));
        let others = lawful.iter().enumerate().filter(|(other, _)| *other != index);
        let others = others.map(|(other, of)| (Some(other), judged(&body.members, of)));
        // The first of equals is taken: the simplest.
        let all = std::iter::once((None, at_rest)).chain(others).chain(std::iter::once(own));
        let (of, least) = all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(own);
        tracing::info!(body = index, of, own = own.1, least, "a body that follows no law");
        of
    };
    lawful.iter().enumerate().map(taken).collect()
}

/// The law that the poses bear out. Where they leave several, that which, fitted to the first two thirds of the poses,
/// has the least error in photos of the last third; of laws as good as that one, the one that the poses bear out best.
/// `judge` gives the error of a law.
fn chosen(sequence: &Poses, judge: impl Fn(Law, LawValues) -> Option<f64>) -> Option<Fitted> {
    let mut fits = compare_laws(sequence, &Law::ALL);
    fits.sort_by(|a, b| a.score().total_cmp(&b.score()));
    let best = *fits.first()?;
    fits.retain(|fitted| fitted.score() <= best.score() + CANDIDATE_MARGIN);
    fits.truncate(CANDIDATES_MAX);
    if fits.len() == 1 {
        return Some(best);
    }
    let judged: Vec<(Fitted, f64)> =
        fits.into_iter().filter_map(|fitted| Some((fitted, judge(fitted.law, fitted.early?)?))).collect();
    let least = judged.iter().map(|(_, error)| *error).fold(f64::INFINITY, f64::min);
    for (fitted, error) in &judged {
        let (law, score) = (fitted.law.in_words(), fitted.score() - best.score());
        tracing::info!(law, score, error, deviation = fitted.deviation, "a law before photos of later times");
    }
    // The scores ascend, so the first one that is as good has the best.
    judged
        .into_iter()
        .find(|(_, error)| *error <= (1.0 + ERROR_TOLERANCE) * least)
        .map(|(fitted, _)| fitted)
        .or(Some(best))
}

/// The law of a body that was lost while it was followed: of `fitted` and all laws fitted to all poses or to those
/// before it may have been lost, the one with fewest numbers among those with which photos of all times have nearly the
/// least error. `judge` gives the error of a law.
fn recovered(
    sequence: &Poses,
    fitted: Option<Fitted>,
    judge: impl Fn(Law, LawValues) -> Option<f64>,
) -> Option<Fitted> {
    let until = |share: f64| {
        let count = (share * sequence.poses.len() as f64).ceil() as usize;
        Poses { poses: sequence.poses[..count.min(sequence.poses.len())].to_vec(), ..sequence.clone() }
    };
    let parts: Vec<Poses> =
        PREFIX_SHARES.into_iter().map(until).filter(|part| part.poses.len() >= FEWEST_POSES).collect();
    let fits = parts.iter().flat_map(|part| Law::ALL.into_iter().filter_map(|law| fit_law(part, law)));
    let judged: Vec<(f64, Fitted)> =
        fitted.into_iter().chain(fits).filter_map(|fitted| Some((judge(fitted.law, fitted.values)?, fitted))).collect();
    let least = judged.iter().map(|(error, _)| *error).fold(f64::INFINITY, f64::min);
    let near = judged.into_iter().filter(|(error, _)| *error <= (1.0 + TIE_TOLERANCE) * least);
    let found = near.min_by(|a, b| a.1.law.freedom().cmp(&b.1.law.freedom()).then(a.0.total_cmp(&b.0)));
    if let Some((error, found)) = &found {
        tracing::info!(error, least, law = found.law.in_words(), "a law for a body that was lost");
    }
    found.map(|(_, found)| found).or(fitted)
}

#[cfg(test)]
mod tests {
    use gs_burn::glam::DVec3;
    use gs_models::sparsedyn::bodies::{BodyPose, Term};

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
        // The error of `faster` in units of that of the law which the poses bear out best.
        for (factor, expected) in [(1.0, even), (0.9, even), (0.5, faster)] {
            let judge = |law: Law, _: LawValues| Some(if law == faster { factor } else { 1.0 });
            assert_eq!(chosen(&turning(), judge).map(|fitted| fitted.law), Some(expected), "{factor}");
        }
        // Photos that say nothing leave the choice to the poses.
        assert_eq!(chosen(&turning(), |_, _| None).map(|fitted| fitted.law), Some(even));
    }

    /// A body that turns evenly and is taken to stand still from its eighteenth pose on.
    #[test]
    fn a_lost_body_gets_the_law_of_the_time_before() {
        let truth = turning();
        let mut lost = truth.clone();
        let stuck = lost.poses[17].1;
        lost.poses[18..].iter_mut().for_each(|(_, pose)| *pose = stuck);
        let photos = |_: Law, values: LawValues| {
            let apart = |(s, pose): &(f64, BodyPose)| values.pose(truth.first, *s).centre.distance(pose.centre);
            // What the first frame's own error leaves.
            Some(0.1 + truth.poses.iter().map(apart).sum::<f64>())
        };
        let of_poses = chosen(&lost, |_, _| None);
        let found = recovered(&lost, of_poses, photos).expect("a law");
        assert_eq!(found.law, Law::of(&[Term::Spin, Term::Pivot]));
        assert!((found.values.vector(Term::Spin) - DVec3::new(0.0, 0.0, 2.0)).length() < 1e-3, "{found:?}");
        // Where no law is better, that of the poses stays.
        let kept =
            recovered(&lost, of_poses, |law, _| Some(if Some(law) == of_poses.map(|of| of.law) { 0.0 } else { 1.0 }));
        assert_eq!(kept.map(|fitted| fitted.law), of_poses.map(|fitted| fitted.law));
        assert_eq!(recovered(&lost, of_poses, |_, _| None), of_poses);
        // Of laws that photos do not tell apart, the one of fewest numbers.
        let simplest = recovered(&lost, of_poses, |_, _| Some(1.0)).expect("a law");
        assert_eq!(simplest.law, Law::of(&[]));
    }
}

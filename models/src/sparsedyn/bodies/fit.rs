//! The law of a sequence of poses: least squares for one law; among laws BIC and what each foresees of later poses.

use gs_burn::glam::{DMat3, DQuat, DVec3};

use super::basis::{EVEN, MOTION, free};
use super::law::{BodyPose, Law, LawValues, Term, even, fading};
use super::least_squares::{damped, descent, linear};
use super::motion::{Body, Span};
use crate::rotation::{nearest, shortest};

/// A fitted law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitted {
    /// The law.
    pub law: Law,
    /// Its numbers.
    pub values: LawValues,
    /// Root mean square distance of the body's markers from the poses, scene units.
    pub deviation: f64,
    /// The numbers of the law fitted to the poses before the last third; `None` where nothing finite fits, or before
    /// laws are compared.
    pub early: Option<LawValues>,
    /// `deviation` at the last third of the poses, for the law fitted to the others.
    pub foreseen: f64,
    /// Twice the negative logarithm of the likelihood of the last third of the poses, given the law fitted to the
    /// others, up to a constant: a law that takes the noise of early poses for motion misses later ones, and a smooth
    /// error of all poses, which BIC takes for evidence, helps no law to foresee.
    pub surprise: f64,
    /// The criterion by which laws are compared; lower is better.
    pub bic: f64,
}

impl Fitted {
    /// The criterion by which laws are compared, from their poses alone; lower is better.
    pub fn score(&self) -> f64 {
        self.bic + self.surprise
    }
}

/// The first of the last third of `count` poses.
pub fn late_from(count: usize) -> usize {
    2 * count / 3
}

/// Poses of one body, and how well they are known.
#[derive(Debug, Clone)]
pub struct Poses {
    /// The body's centre in the first frame, world, scene units.
    pub first: DVec3,
    /// The size of the body, scene units: the distance of the markers from its centre.
    pub size: f64,
    /// Time since the first frame, and the pose.
    pub poses: Vec<(f64, BodyPose)>,
    /// Poses among them that are independent of each other: those of a smooth motion with few knots are not.
    pub independent: f64,
    /// Standard deviation of a marker's coordinate, scene units: smaller misfits tell nothing.
    pub noise: f64,
}

/// Share of the misfit by which a step towards the best numbers must gain to go on.
const CONVERGED: f64 = 1e-10;

/// Least share of a period over the poses of what goes to and fro: less of one is not told from an even acceleration.
const PERIODS_LEAST: f64 = 0.3;

/// Rates tried for an oscillation, from the least to one period in four poses.
const RATES: usize = 48;

/// Rates tried for what dies away, per time that the poses cover: from a quarter lost to a twentieth left.
const DAMPINGS: [f64; 3] = [0.3, 1.0, 3.0];

/// Largest such rate: what has died away within the first tenth of the poses is a jump, and no law of their motion.
const DAMPING_MOST: f64 = 10.0;

/// Cost of a law by which few things move, on the scale of BIC: 10 is very strong evidence there, and laws are compared
/// by two terms of that scale. A block that falls and turns is nearly one that turns about a point off its
/// middle without falling.
const RARE: f64 = 20.0;

/// Samples of a motion for each of its functions of time, to which these are fitted.
const SAMPLES_A_KNOT: usize = 4;

/// Markers of a body: four points that determine a pose, in sizes of the body from its centre.
pub const MARKERS: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

/// The law among `laws` that says most of the poses with fewest numbers, and foresees their last third best; `None`
/// without poses.
pub fn select_law(poses: &Poses, laws: &[Law]) -> Option<Fitted> {
    compare_laws(poses, laws).into_iter().min_by(|a, b| a.score().total_cmp(&b.score()))
}

/// The best numbers of a law; `None` without poses, or when nothing finite fits.
pub fn fit_law(poses: &Poses, law: Law) -> Option<Fitted> {
    if poses.poses.is_empty() {
        return None;
    }
    let rotations = unwrapped(poses.poses.iter().map(|(_, pose)| pose.rotation));
    let dampings: &[f64] = if law.has(Term::Damping) { &DAMPINGS } else { &[0.0] };
    let dampings = dampings.iter().map(|share| share / span_of(poses));
    let starts: Vec<LawValues> = match law.has(Term::Oscillation) {
        true => oscillation_starts(poses, &rotations, law, &dampings.collect::<Vec<f64>>()),
        false => dampings.map(|damping| polynomial_start(poses, &rotations, law, damping)).collect(),
    };
    let refined = starts.into_iter().map(|values| refine(poses, law, values));
    let least = PERIODS_LEAST * std::f64::consts::TAU / span_of(poses);
    let stands = |values: &LawValues| {
        (!law.has(Term::Oscillation) || values.oscillation().0.abs() >= least)
            && values.damping() * span_of(poses) <= DAMPING_MOST
    };
    let usable = refined.filter(|(values, sum)| sum.is_finite() && stands(values));
    let (values, sum) = usable.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let count = (3 * MARKERS.len() * poses.poses.len()) as f64;
    // Coordinates of one pose are not independent of each other: six numbers determine it.
    let independent = 6.0 * poses.independent.max(1.0);
    let variance = sum / count + poses.noise * poses.noise;
    let rare = if law.is_rare() { RARE } else { 0.0 };
    let bic = independent * variance.max(f64::MIN_POSITIVE).ln() + law.freedom() as f64 * independent.ln() + rare;
    let deviation = (sum / count * 3.0).sqrt();
    Some(Fitted { law, values, deviation, early: None, foreseen: f64::INFINITY, surprise: 0.0, bic })
}

/// Every law of `laws` that fits, with what it foresees.
pub fn compare_laws(poses: &Poses, laws: &[Law]) -> Vec<Fitted> {
    let (early, late) = poses.poses.split_at(late_from(poses.poses.len()));
    let part = |part: &[(f64, BodyPose)]| Poses { poses: part.to_vec(), ..poses.clone() };
    let (early, late) = (part(early), part(late));
    let tested = |fitted: Fitted| {
        let Some(before) = fit_law(&early, fitted.law) else { return fitted };
        let count = (3 * MARKERS.len() * late.poses.len()).max(1) as f64;
        let variance = misfit(&late, &before.values) / count;
        let independent = 6.0 * poses.independent * late.poses.len() as f64 / poses.poses.len() as f64;
        let surprise = independent * (variance + poses.noise * poses.noise).max(f64::MIN_POSITIVE).ln();
        Fitted { early: Some(before.values), foreseen: (3.0 * variance).sqrt(), surprise, ..fitted }
    };
    laws.iter().filter_map(|law| fit_law(poses, *law)).map(tested).collect()
}

/// The free motion that follows `poses` best, whose first is at time `span.times[0]`: for each function of time a
/// shift, scene units, and a rotation vector.
pub fn fit_free(poses: &Poses, span: &Span) -> Vec<[f64; MOTION]> {
    let basis: Vec<Vec<f64>> =
        poses.poses.iter().map(|(s, _)| free(span.times, span.knots, span.times[0] + s)).collect();
    let columns: Vec<Vec<f64>> = (0..span.columns()).map(|k| basis.iter().map(|values| values[k]).collect()).collect();
    let even = linear(&columns[..EVEN], &unwrapped(poses.poses.iter().map(|(_, pose)| pose.rotation)));
    let turned = |values: &[f64]| DQuat::from_scaled_axis(even.iter().zip(values).map(|(w, x)| *w * *x).sum());
    let rest = poses.poses.iter().zip(&basis).map(|((_, pose), values)| pose.rotation * turned(values).inverse());
    let spline = linear(&columns[EVEN..], &unwrapped(rest));
    let shifts: Vec<DVec3> = poses.poses.iter().map(|(_, pose)| pose.centre - poses.first).collect();
    let shifts = linear(&columns, &shifts);
    let six = |(shift, turn): (&DVec3, &DVec3)| [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z];
    shifts.iter().zip(even.iter().chain(&spline)).map(six).collect()
}

/// The free motion of `body` until the time `until`, and from there on an even one, by its last knot before.
///
/// Functions of time that were learned from seen frames say anything of later ones: a swing's acceleration goes on
/// after it was let go, and the spline has to undo it in the few steps in which a frame is among the newest.
pub fn even_after(body: &Body, span: &Span, until: f64) -> Vec<[f64; MOTION]> {
    let [begin, end] = span.times;
    let knot = (end - begin) / span.knots.max(1) as f64;
    let from = (until - knot).max(begin);
    if from >= until {
        return body.free.clone();
    }
    let [before, last] = [from, until].map(|time| body.pose(span, time));
    let turn = shortest(last.rotation * before.rotation.inverse()) / (until - from);
    let shift = (last.centre - before.centre) / (until - from);
    let pose = |time: f64| match time - until {
        beyond if beyond > 0.0 => {
            let rotation = DQuat::from_scaled_axis(turn * beyond) * last.rotation;
            BodyPose { rotation, centre: last.centre + shift * beyond }
        }
        _ => body.pose(span, time),
    };
    let count = SAMPLES_A_KNOT * span.columns();
    let times = (0..=count).map(|k| (end - begin) * k as f64 / count as f64);
    let poses = times.map(|s| (s, pose(begin + s))).collect();
    let first = DVec3::from_array(body.frame.centre);
    fit_free(&Poses { first, size: 0.0, poses, independent: 1.0, noise: 0.0 }, span)
}

/// Sum of squared coordinates of the markers' misfits, scene units squared.
fn misfit(poses: &Poses, values: &LawValues) -> f64 {
    residuals(poses, values).iter().map(|x| x * x).sum()
}

fn residuals(poses: &Poses, values: &LawValues) -> Vec<f64> {
    let mut residuals = Vec::with_capacity(3 * MARKERS.len() * poses.poses.len());
    for (s, pose) in &poses.poses {
        let own = values.pose(poses.first, *s);
        for marker in MARKERS {
            let at = poses.first + poses.size * marker;
            residuals.extend((own.apply(at, poses.first) - pose.apply(at, poses.first)).to_array());
        }
    }
    residuals
}

/// Rotation vectors of the poses, continued over whole turns.
fn unwrapped(rotations: impl Iterator<Item = DQuat>) -> Vec<DVec3> {
    let mut vectors: Vec<DVec3> = Vec::new();
    for rotation in rotations {
        let expected = match vectors.as_slice() {
            [.., before, last] => 2.0 * *last - *before,
            [last] => *last,
            [] => DVec3::ZERO,
        };
        vectors.push(nearest(rotation, expected));
    }
    vectors
}

/// The numbers of the terms without oscillation, which die away at a rate, by linear least squares.
fn polynomial_start(poses: &Poses, rotations: &[DVec3], law: Law, damping: f64) -> LawValues {
    let times: Vec<f64> = poses.poses.iter().map(|(s, _)| even(damping, *s)).collect();
    let mut values = LawValues::REST;
    values.set_damping(damping);
    let spin = [(Term::Spin, 1), (Term::SpinUp, 2)];
    set_polynomial(&mut values, &times, rotations, law, spin);
    let shifts: Vec<DVec3> = poses.poses.iter().map(|(_, pose)| pose.centre - poses.first).collect();
    set_polynomial(&mut values, &times, &shifts, law, [(Term::Velocity, 1), (Term::Acceleration, 2)]);
    match (law.has(Term::Pivot), law.has(Term::Velocity)) {
        (true, true) => set_flight(&mut values, poses, law),
        (true, false) => values.set(Term::Pivot, pivot_of(poses)),
        (false, _) => {}
    }
    values
}

fn set_polynomial(values: &mut LawValues, times: &[f64], data: &[DVec3], law: Law, terms: [(Term, i32); 2]) {
    let used: Vec<(Term, i32)> = terms.into_iter().filter(|(term, _)| law.has(*term)).collect();
    let basis = |s: f64, power: i32| if power == 2 { 0.5 * s * s } else { s };
    let columns: Vec<Vec<f64>> =
        used.iter().map(|(_, power)| times.iter().map(|s| basis(*s, *power)).collect()).collect();
    for (found, (term, _)) in linear(&columns, data).into_iter().zip(used) {
        values.set(term, found);
    }
}

/// The even and accelerated motion of a pivot and its offset `d` from the centre: the best in `centre(s) - first = v
/// s + a s^2 / 2 - (R(s) - 1) d`.
fn set_flight(values: &mut LawValues, poses: &Poses, law: Law) {
    let terms = [Term::Velocity, Term::Acceleration, Term::Pivot].into_iter().filter(|term| law.has(*term));
    let terms: Vec<Term> = terms.collect();
    let column = |term: Term, axis: usize| -> Vec<f64> {
        let of = |(s, pose): &(f64, BodyPose)| match term {
            Term::Velocity => DVec3::AXES[axis] * *s,
            Term::Acceleration => DVec3::AXES[axis] * (0.5 * s * s),
            _ => DVec3::AXES[axis] - pose.rotation * DVec3::AXES[axis],
        };
        poses.poses.iter().flat_map(|pose| of(pose).to_array()).collect()
    };
    let columns: Vec<Vec<f64>> = terms.iter().flat_map(|term| (0..3).map(|axis| column(*term, axis))).collect();
    let shifts: Vec<f64> = poses.poses.iter().flat_map(|(_, pose)| (pose.centre - poses.first).to_array()).collect();
    // Along the axis every offset does: this share of a column picks a short one.
    let Some(found) = damped(&columns, &shifts, 1e-6) else { return };
    for (term, vector) in terms.into_iter().zip(found.as_chunks::<3>().0) {
        values.set(term, DVec3::from_array(*vector));
    }
}

/// The offset of the pivot from the centre: the best `d` in `centre(s) - first = -(R(s) - 1) d`, the shortest along the
/// axis.
fn pivot_of(poses: &Poses) -> DVec3 {
    let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (_, pose) in &poses.poses {
        let matrix = DMat3::IDENTITY - DMat3::from_quat(pose.rotation);
        normal += matrix.transpose() * matrix;
        right += matrix.transpose() * (pose.centre - poses.first);
    }
    // Along the axis every offset does: this share of the largest entry picks the shortest.
    let ridge = 1e-6 * normal.to_cols_array().iter().fold(0.0_f64, |most, x| most.max(x.abs())) + f64::MIN_POSITIVE;
    (normal + DMat3::from_diagonal(DVec3::splat(ridge))).inverse() * right
}

/// The time that poses cover.
fn span_of(poses: &Poses) -> f64 {
    poses.poses.iter().fold(0.0_f64, |most, (s, _)| most.max(s.abs())).max(f64::MIN_POSITIVE)
}

/// For several rates the best amplitudes and phase by linear least squares, with the best of the rates `dampings` at
/// which the motion dies away; the three best of them.
fn oscillation_starts(poses: &Poses, rotations: &[DVec3], law: Law, dampings: &[f64]) -> Vec<LawValues> {
    let times: Vec<f64> = poses.poses.iter().map(|(s, _)| *s).collect();
    let span = span_of(poses);
    let least = PERIODS_LEAST * std::f64::consts::TAU / span;
    let most = 0.25 * std::f64::consts::TAU * times.len() as f64 / span;
    let shifts: Vec<DVec3> = poses.poses.iter().map(|(_, pose)| pose.centre - poses.first).collect();
    let start = |rate: f64, plain: &LawValues| {
        let damping = plain.damping();
        let sine: Vec<f64> = times.iter().map(|s| fading(damping, *s) * (rate * s).sin()).collect();
        let cosine: Vec<f64> = times.iter().map(|s| fading(damping, *s) * (rate * s).cos() - 1.0).collect();
        let mut values = *plain;
        for (term, data, steady) in [
            (Term::Swing, rotations, [Term::Spin, Term::SpinUp]),
            (Term::Sway, shifts.as_slice(), [Term::Velocity, Term::Acceleration]),
        ] {
            if !law.has(term) {
                continue;
            }
            let mut columns = vec![sine.clone(), cosine.clone()];
            let used: Vec<Term> = steady.into_iter().filter(|term| law.has(*term)).collect();
            for other in &used {
                let second = *other == steady[1];
                columns.push(times.iter().map(|s| if second { 0.5 * s * s } else { *s }).collect());
            }
            let found = linear(&columns, data);
            let (amplitude, phase) = joined(found[0], found[1]);
            values.set(term, amplitude);
            values.set_oscillation(rate, phase);
            for (other, found) in used.into_iter().zip(&found[2..]) {
                values.set(other, *found);
            }
        }
        (misfit(poses, &values), values)
    };
    let plain: Vec<LawValues> = dampings.iter().map(|k| polynomial_start(poses, rotations, law, *k)).collect();
    let of_rate = |index: usize| {
        let rate = least * (most / least).max(1.0).powf(index as f64 / (RATES - 1) as f64);
        plain.iter().map(|plain| start(rate, plain)).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut starts: Vec<(f64, LawValues)> = (0..RATES).filter_map(of_rate).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts.into_iter().take(3).map(|(_, values)| values).collect()
}

/// `sine sin(x) + cosine (cos(x) - 1)` as `amplitude (sin(x + phase) - sin(phase))`, along the larger of the two
/// directions.
fn joined(sine: DVec3, cosine: DVec3) -> (DVec3, f64) {
    let direction = if sine.length() >= cosine.length() { sine } else { cosine };
    let Some(direction) = direction.try_normalize() else { return (DVec3::ZERO, 0.0) };
    let (a, b) = (sine.dot(direction), cosine.dot(direction));
    (direction * a.hypot(b), b.atan2(a))
}

/// The law's own numbers where the misfit is least, from `values` on, and that misfit.
fn refine(poses: &Poses, law: Law, values: LawValues) -> (LawValues, f64) {
    let duration = poses.poses.iter().fold(0.0_f64, |most, (s, _)| most.max(s.abs()));
    let held = |numbers: Vec<f64>| law.free_numbers(&law.constrained(law.with_free(&numbers), duration));
    let of = |numbers: &[f64]| residuals(poses, &law.with_free(numbers));
    let values = law.with_free(&descent(law.free_numbers(&values), held, of, CONVERGED));
    (values, misfit(poses, &values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparsedyn::bodies::BodyFrame;

    fn poses(values: &LawValues, frames: usize, noise: f64) -> Poses {
        let first = DVec3::new(0.3, -0.2, 0.5);
        let mut state = 7_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12.0_f64.sqrt() * noise
        };
        let mut one = |frame: usize| {
            let s = frame as f64 / 60.0;
            let mut pose = values.pose(first, s);
            pose.centre += DVec3::new(draw(), draw(), draw());
            pose.rotation =
                gs_burn::glam::DQuat::from_scaled_axis(DVec3::new(draw(), draw(), draw()) / 0.3) * pose.rotation;
            (s, pose)
        };
        Poses {
            first,
            size: 0.3,
            poses: (0..frames).map(&mut one).collect(),
            independent: frames as f64,
            noise: noise.max(1e-4),
        }
    }

    fn values(law: Law) -> LawValues {
        let mut values = LawValues::REST;
        for (term, vector) in [
            (Term::Velocity, DVec3::new(0.8, -0.3, 0.2)),
            (Term::Acceleration, DVec3::new(0.2, 0.1, -3.0)),
            (Term::Spin, DVec3::new(0.3, 0.1, 6.0)),
            (Term::SpinUp, DVec3::new(0.2, 0.1, 4.0)),
            (Term::Swing, DVec3::new(0.0, 0.9, 0.1)),
            (Term::Sway, DVec3::new(0.1, 0.5, 0.0)),
            (Term::Pivot, DVec3::new(0.4, 0.1, 0.9)),
        ] {
            if law.has(term) {
                values.set(term, vector);
            }
        }
        values = law.constrained(values, 0.75);
        if law.has(Term::Oscillation) {
            values.set_oscillation(7.0, 1.1);
        }
        if law.has(Term::Damping) {
            values.set_damping(1.7);
        }
        values
    }

    /// The observed time is 0 to 0.75, the future 1; markers are 0.3 from the centre.
    #[test]
    fn every_law_is_found_again_and_tells_the_future() {
        for law in Law::ALL {
            let truth = values(law);
            let poses = poses(&truth, 46, 0.0);
            let fitted = fit_law(&poses, law).expect("poses");
            assert!(fitted.deviation < 1e-5, "{}: {}", law.in_words(), fitted.deviation);
            let (there, own) = (truth.pose(poses.first, 1.0), fitted.values.pose(poses.first, 1.0));
            assert!(there.centre.distance(own.centre) < 1e-3, "{}: centre", law.in_words());
            assert!(there.rotation.angle_between(own.rotation) < 1e-3, "{}: rotation", law.in_words());
        }
    }

    #[test]
    fn bic_chooses_the_law_that_made_the_poses() {
        for law in Law::ALL {
            let poses = poses(&values(law), 46, 2e-3);
            let chosen = select_law(&poses, &Law::ALL).expect("poses");
            let same = chosen.law == law;
            // A richer law that says the same is no error; a poorer one is.
            let reaches = chosen.deviation < 3.0 * 2e-3 && chosen.law.freedom() <= law.freedom();
            assert!(same || reaches, "{} was taken for {}", law.in_words(), chosen.law.in_words());
        }
    }

    #[test]
    fn a_motion_goes_on_evenly_after_what_was_seen() {
        let span = Span { times: [0.0, 0.75], knots: 14, length: 1.0 };
        let law = Law::of(&[Term::Swing, Term::Oscillation, Term::Pivot]);
        let swing = poses(&values(law), 46, 0.0);
        let frame = BodyFrame::of(swing.first.to_array(), Law::of(&[]), span.times[1]);
        let mut body = Body { free: fit_free(&swing, &span), ..Body::of(frame, LawValues::REST) };
        let before = body.clone();
        body.free = even_after(&body, &span, 0.4);
        let apart = |time: f64| {
            let [a, b] = [&body, &before].map(|body| body.pose(&span, time));
            a.centre.distance(b.centre) + a.rotation.angle_between(b.rotation)
        };
        // A spline cannot bend at once: within two knots of the change it is off by some share of the acceleration
        // there, 40 radians per squared unit of time, times a squared knot, 0.05.
        for time in [0.1, 0.2, 0.3, 0.35] {
            assert!(apart(time) < 0.01, "{} at {time}", apart(time));
        }
        let [a, b, c] = [0.5, 0.6, 0.7].map(|time| body.pose(&span, time).centre);
        assert!((a - 2.0 * b + c).length() < 0.01, "{a} {b} {c}");
        assert!(apart(0.75) > 0.2, "the swing went on otherwise");
    }

    /// Quaternions of poses have either sign. The spline follows the swing to 1e-2 radians, and a whole turn too many
    /// would be off by more than one.
    #[test]
    fn a_free_motion_follows_quaternions_of_either_sign() {
        let span = Span { times: [0.0, 0.75], knots: 14, length: 1.0 };
        let truth = values(Law::of(&[Term::Swing, Term::Oscillation, Term::Pivot]));
        let mut swing = poses(&truth, 46, 0.0);
        swing.poses.iter_mut().skip(20).for_each(|(_, pose)| pose.rotation = -pose.rotation);
        let frame = BodyFrame::of(swing.first.to_array(), Law::of(&[]), span.times[1]);
        let body = Body { free: fit_free(&swing, &span), ..Body::of(frame, LawValues::REST) };
        for (s, pose) in &swing.poses {
            let apart = shortest(body.pose(&span, *s).rotation * pose.rotation.inverse()).length();
            assert!(apart < 1e-2, "{apart} at {s}");
        }
    }

    #[test]
    fn whole_turns_are_counted() {
        let law = Law::of(&[Term::Spin, Term::Pivot]);
        let mut truth = values(law);
        truth.set(Term::Spin, DVec3::new(0.0, 0.0, 20.0));
        let fitted = fit_law(&poses(&truth, 46, 1e-3), law).expect("poses");
        assert!(fitted.values.vector(Term::Spin).distance(DVec3::new(0.0, 0.0, 20.0)) < 0.05);
    }

    #[test]
    fn nothing_to_fit_is_none_and_one_pose_is_rest() {
        let law = Law::GENERAL;
        assert!(fit_law(&poses(&values(law), 0, 0.0), law).is_none());
        let one = fit_law(&poses(&values(law), 1, 0.0), law).expect("a pose");
        assert!(one.values.0.iter().all(|x| x.is_finite()));
    }
}

//! The law of each body, once all frames are seen: what is rigid gets the law of its poses, from the time on at which
//! they follow one; what bends gets a law of its whole and oscillations of its nodes.

use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sparsedyn::bodies::bending::bent;
use gs_models::sparsedyn::bodies::fit::{Poses, fit_free, late_from};
use gs_models::sparsedyn::bodies::parts::joined;
use gs_models::sparsedyn::bodies::phases::{Phase, phases};
use gs_models::sparsedyn::bodies::{Body, BodyFrame, Law, LawValues, SegmentOptions, segment};

use super::choice::{CHANGES_APART, Chosen, chosen};
use super::groups::{FEWEST, all_labelled};
use super::judges::Judges;
use super::poses::{members, middle, paths, pixel_size, poses_of, rests, weights_of};
use super::update::forget;
use super::{Sparsedyn, Step};

/// Largest difference of two parts' motions that is one motion, in the noise of a pose. By BIC a second free motion
/// costs six numbers a knot, each worth the logarithm of some hundred coordinates, 4.6; the misfit that pays for it is
/// `sqrt(2 * 4.6)` of the noise.
const MERGE_SIGMA: f64 = 3.0;

/// Share of the way of two parts that may be added to that difference. Gaussians of one pendulum that had been taken
/// for three bodies differed by 3 pixels on a way of 100; bodies that move on their own differ by the way itself.
const JOINED_SHARE: f64 = 0.04;

/// Share of the seen time after which a law begins late: what is pushed earlier is seen to move for most of it.
const LATE: f64 = 1.0 / 3.0;

/// Root mean square distance of the Gaussians of a rigid body from its motion, pixels: that of tracking.
const RIGID_PIXELS: f64 = 1.0;

/// Share of their way that may be added. 27 rigid bodies of foreign sets and random worlds, 8 of them at rest, were
/// apart by at most 0.5 pixels, on ways of up to 55; a ribbon that bent by 1.6 on a way of 20 was rigid at 0.03.
const RIGID_SHARE: f64 = 0.01;

/// Most rigid parts of a body that is no rigid one; more are a body that bends.
const PARTS: usize = 3;

/// Share of a body's Gaussians that its rigid parts must hold.
const IN_PARTS: f64 = 0.85;

/// Times at which paths are compared with a rigid motion.
const PATH_TIMES: usize = 16;

/// Gives each body its law. What rests becomes static.
pub fn with_laws(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    let Some(bodies) = &model.bodies else { return model };
    let free = bodies.all();
    let seen = Seen::of(&model, gaussians, views, at);
    let (wholes, labels) = seen.parts(&model.frame.labels);
    let mut of = vec![-1; labels.len()];
    let (mut all, mut resting): (Vec<Body>, Vec<usize>) = (Vec::new(), Vec::new());
    for whole in 0..count_of(&wholes) {
        let together = members(&wholes, whole);
        let Some(first) = together.first() else { continue };
        let own = &free[model.frame.labels[*first].max(0) as usize];
        for (body, members) in seen.bodies(own, &together, &labels) {
            let Some(body) = body else {
                resting.extend(members);
                continue;
            };
            members.iter().for_each(|i| of[*i] = all.len() as i32);
            all.push(body);
        }
    }
    for (number, body) in all.iter_mut().enumerate() {
        body.nodes.iter_mut().for_each(|(node, _)| node.body = number);
    }
    model.frame.labels = of;
    let mut model = model.with_all(&all, &gaussians.device());
    model.make_static(&resting);
    forget(adam);
    model
}

/// The moving Gaussians over the seen times.
struct Seen<'a> {
    model: Sparsedyn,
    gaussians: &'a Gaussians,
    views: &'a [View],
    at: &'a Step<'a>,
    /// Their positions in each frame.
    paths: Vec<Vec<DVec3>>,
    /// Their opacities.
    weights: Vec<f64>,
    /// A pixel at their middle, scene units.
    pixel: f64,
}

impl<'a> Seen<'a> {
    fn of(model: &Sparsedyn, gaussians: &'a Gaussians, views: &'a [View], at: &'a Step<'a>) -> Self {
        let paths = paths(model, &model.first_positions(gaussians), &at.cues.times);
        let weights = weights_of(model, gaussians);
        let pixel = pixel_size(views, middle(&paths[0], &weights));
        Self { model: model.clone(), gaussians, views, at, paths, weights, pixel }
    }

    /// The bodies, with their members, that the Gaussians `together` become, which moved as `own` did and belong to the
    /// parts `labels`; `None` for those that rest.
    fn bodies(&self, own: &Body, together: &[usize], labels: &[i32]) -> Vec<(Option<Body>, Vec<usize>)> {
        let mut numbers: Vec<i32> = together.iter().map(|i| labels[*i]).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let of = |part: &i32| -> Vec<usize> { together.iter().copied().filter(|i| labels[*i] == *part).collect() };
        let still = self.at.config.method.moving.still_pixels * self.pixel;
        let lawful = |members: Vec<usize>| {
            let poses = self.poses(&members);
            let bends = !self.is_rigid(&members) && own.nodes.len() > 1;
            let body = || if bends { self.bent(own, &poses) } else { self.lawful(&members, &poses) };
            ((!rests(&poses, still)).then(body), members)
        };
        let parts: Vec<(Option<Body>, Vec<usize>)> = numbers.iter().map(of).map(lawful).collect();
        let changes: Option<Vec<f64>> = parts.iter().map(|(body, _)| Some(body.as_ref()?.frame.since)).collect();
        let bends = own.nodes.len() > 1 && changes.is_some_and(|changes| is_a_wave(&changes, &self.at.cues.times));
        if bends { vec![(Some(self.bent(own, &self.poses(together))), together.to_vec())] } else { parts }
    }

    /// The wholes and the parts anew, from the bodies of `labels`: those that moved alike are one, and those of few
    /// rigid parts are these.
    fn parts(&self, labels: &[i32]) -> (Vec<i32>, Vec<i32>) {
        let noise = self.at.config.method.bodies.noise_pixels * self.pixel;
        let joined = joined(&self.paths, labels, MERGE_SIGMA * noise, JOINED_SHARE);
        let mut parts = joined.clone();
        let count = count_of(&joined);
        let mut next = count;
        for label in 0..count {
            let whole = members(&joined, label);
            let Some(own) = (!self.is_rigid(&whole)).then(|| self.rigid_parts(&whole)).flatten() else { continue };
            // The first part keeps the number.
            for (i, part) in whole.iter().zip(&own).filter(|(_, part)| **part > 0) {
                parts[*i] = next + *part as i32 - 1;
            }
            next += own.iter().max().copied().unwrap_or(0) as i32;
        }
        (joined, parts)
    }

    /// The rigid part of each of the Gaussians `members`, where few parts hold nearly all of them.
    fn rigid_parts(&self, members: &[usize]) -> Option<Vec<u32>> {
        let step = self.paths.len().div_ceil(PATH_TIMES).max(1);
        let at = |time: &Vec<DVec3>| members.iter().map(|i| time[*i]).collect::<Vec<DVec3>>();
        let paths: Vec<Vec<DVec3>> = self.paths.iter().step_by(step).map(at).collect();
        let weights: Vec<f64> = members.iter().map(|i| self.weights[*i]).collect();
        let options = SegmentOptions {
            tolerance: 2.0 * RIGID_PIXELS * self.pixel,
            relative: 2.0 * RIGID_SHARE,
            most: PARTS,
            fewest: FEWEST,
            share: 1.0 - IN_PARTS,
        };
        let labels = segment(&paths, &weights, &options);
        let held: f64 = labels.iter().zip(&weights).filter(|(label, _)| label.is_some()).map(|(_, x)| x).sum();
        if held < IN_PARTS * weights.iter().sum::<f64>() {
            return None;
        }
        let parts = all_labelled(&labels, &paths[0]);
        let of = |part: u32| -> Vec<usize> {
            members.iter().zip(&parts).filter(|(_, own)| **own == part).map(|(i, _)| *i).collect()
        };
        let count = parts.iter().max().map_or(0, |most| *most + 1);
        (0..count).all(|part| self.is_rigid(&of(part))).then_some(parts)
    }

    /// Whether the Gaussians `members` moved as one rigid body.
    fn is_rigid(&self, members: &[usize]) -> bool {
        let poses = self.poses(members);
        let (mut apart, mut way, mut total) = (0.0, 0.0, 0.0);
        for ((_, pose), now) in poses.poses.iter().zip(&self.paths) {
            for i in members {
                let first = self.paths[0][*i];
                apart += self.weights[*i] * pose.apply(first, poses.first).distance_squared(now[*i]);
                way += self.weights[*i] * first.distance_squared(now[*i]);
                total += self.weights[*i];
            }
        }
        let rms = |sum: f64| (sum / f64::max(total, f64::MIN_POSITIVE)).sqrt();
        tracing::debug!(
            gaussians = members.len(),
            apart = rms(apart) / self.pixel,
            way = rms(way) / self.pixel,
            "rigid?"
        );
        rms(apart) <= RIGID_PIXELS * self.pixel + RIGID_SHARE * rms(way)
    }

    /// The poses of the Gaussians `members` as one body.
    fn poses(&self, members: &[usize]) -> Poses {
        let (config, times) = (&self.at.config.method.bodies, &self.at.cues.times);
        let own = poses_of(&self.paths, members, &self.weights, times);
        let pixel = pixel_size(self.views, own.first);
        Poses { independent: times.len() as f64 / config.knot_frames, noise: config.noise_pixels * pixel, ..own }
    }

    /// The body of rigid `members` with its law, and its free motion before that holds.
    fn lawful(&self, members: &[usize], poses: &Poses) -> Body {
        let times = &self.at.cues.times;
        let span = self.model.frame.bodies_span();
        let with = |phase: &Phase| {
            let (law, from) = (phase.fitted.law, phase.from);
            let free = if from > 0 { fit_free(&phase.before(poses), &span) } else { Vec::new() };
            let frame = BodyFrame::of(poses.first.to_array(), law, times[from]);
            Body { free, ..Body::of(frame, phase.fitted.values) }
        };
        let judges = Judges::after(late_from(times.len()), times, self.views, self.gaussians, self.at);
        let all_times = Judges::of_all_times(times, self.views, self.gaussians, self.at);
        let judge = |bodies: &[Body]| judges.errors_of(&self.model, members, bodies.iter().cloned());
        let refine = |body: Body| all_times.refined(&self.model, members, body);
        let Some(Chosen { phase, body, confidence }) = chosen(phases(poses, &Law::ALL), with, refine, judge) else {
            return Body::of(BodyFrame::of(poses.first.to_array(), Law::of(&[]), times[0]), LawValues::REST);
        };
        tracing::info!(
            step = self.at.step,
            gaussians = members.len(),
            law = phase.fitted.law.in_words(),
            since = times[phase.from],
            deviation_pixels = phase.fitted.deviation / self.pixel,
            foreseen_pixels = phase.fitted.foreseen / self.pixel,
            confidence = confidence.unwrap_or(f64::NAN),
            "law of a body"
        );
        Body { frame: BodyFrame { confidence: confidence.map(|share| share as f32), ..body.frame }, ..body }
    }

    /// The body `own`, which bends, with its law.
    fn bent(&self, own: &Body, poses: &Poses) -> Body {
        let found = bent(own, poses, &self.model.frame.bodies_span());
        for (law, oscillations, score) in &found.compared {
            tracing::debug!(law = law.in_words(), oscillations, score, "a law of a body that bends was compared");
        }
        tracing::info!(
            step = self.at.step,
            nodes = own.nodes.len(),
            law = found.body.frame.law.in_words(),
            rates = ?found.body.rates,
            foreseen_pixels = found.foreseen / self.pixel,
            "law of a body that bends"
        );
        found.body
    }
}

/// The number of labels.
fn count_of(labels: &[i32]) -> i32 {
    labels.iter().max().map_or(0, |most| *most + 1)
}

/// Whether laws of parts of one body that hold from the times `changes` on are pieces of a bending motion: all begin
/// late, one after another. What is pushed changes at once, and of two bodies that were taken for one either may have a
/// law from the first frame on.
fn is_a_wave(changes: &[f64], times: &[f64]) -> bool {
    let (first, last) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let late = changes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let early = changes.iter().copied().fold(f64::INFINITY, f64::min);
    late - early > CHANGES_APART * (last - first) && early - first > LATE * (last - first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_comes_to_one_part_after_another() {
        let times: Vec<f64> = (0..45).map(|frame| f64::from(frame) / 59.0).collect();
        let wave = |changes: &[f64]| is_a_wave(changes, &times);
        // Parts of an eel by one seed; a block that is pushed beside a spinner; parts that are pushed together.
        assert!(wave(&[0.44, 0.54]));
        assert!(!wave(&[0.1, 0.24]) && !wave(&[0.37, 0.0]) && !wave(&[0.4, 0.4]) && !wave(&[0.4]) && !wave(&[]));
    }
}

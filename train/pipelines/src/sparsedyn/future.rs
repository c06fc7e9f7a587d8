//! The future of a run: its parts, an ensemble of perturbed dynamics, and other steps of integration.

use anyhow::Result as Outcome;
use burn::tensor::Device;
use glam::DVec3;
use gs_base::mean;
use gs_burn::Gaussians;
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;
use gs_models::sparsedyn::bodies::{Bodies, LawValues, Term};
use gs_models::sparsedyn::uncertainty::{LawUncertainty, Observed, field_draw, field_numbers};
use gs_models::sparsedyn::{DynamicsField, RolloutOptions, State};

use super::clock::Clock;
use super::config::MotionModel;
use super::cues::frames;
use super::poses::pixel_size;
use super::scene::RolledScene;
use super::{Config, Sparsedyn};
use crate::fit::read_model;
use gs_train::fit::extrapolation::{Extrapolation, Part};
use gs_train::fit::parameters::{indices, to_host};
use gs_train::fit::random::{Purpose, normal_pair, stream};
use gs_train::run::checkpoint::Checkpoint;

/// Lengths of a step that can be asked for, frames: as `dynamics.step_frames`.
const STEP_FRAMES: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// Times at which the spread of the perturbed field is held against the noise.
const CALIBRATED_TIMES: usize = 12;

/// Gaussians over which it is measured at most: the mean of so many is known to a few per cent.
const CALIBRATED_ROWS: usize = 512;

/// Corrections of the field's scale: the spread is nearly linear in it, each round leaves a few per cent of the misfit.
const ROUNDS: usize = 5;

/// Largest change of the scale in a round: far from the answer the spread is not linear.
const LARGEST_CHANGE: f64 = 30.0;

/// The stream of random numbers with which the field's scale is found; members have the streams below it.
const CALIBRATION: u64 = 1 << 32;

/// The future of a scene of this pipeline; see [`Extrapolate`](crate::Extrapolate).
///
/// # Errors
/// A sentence when the checkpoint is damaged.
pub fn extrapolate(checkpoint: &Checkpoint, photos: &Scene, device: &Device) -> Outcome<Box<dyn Extrapolation>> {
    let (model, config, _) = read_model::<Sparsedyn>(checkpoint, device)?;
    Ok(Box::new(RolledFuture::new(&model.method, &model.gaussians, &photos.train, &config)))
}

/// The future of a scene.
#[derive(Debug, Clone)]
pub struct RolledFuture {
    scene: RolledScene,
    /// Times of the frames that were seen, by the clock.
    seen: Vec<f64>,
    /// Standard deviation of a coordinate, scene units.
    noise: f64,
    /// Frames that one independent pose takes.
    frames_per_pose: f64,
    /// Length of a frame, by the clock.
    frame: f64,
    seed: u64,
}

impl RolledFuture {
    /// The future of `gaussians`, whose dynamics were learned from `views`.
    pub fn new(method: &Sparsedyn, gaussians: &Gaussians, views: &[View], config: &Config) -> Self {
        let bodies = &config.method.bodies;
        let middle = mean(&method.first_places(gaussians)).unwrap_or(DVec3::ZERO);
        Self {
            scene: RolledScene { gaussians: gaussians.clone(), method: method.clone() },
            seen: frames(views).0.into_iter().map(|time| method.frame.clock.inner(time)).collect(),
            noise: bodies.noise_pixels * pixel_size(views, middle),
            frames_per_pose: bodies.knot_frames,
            frame: method.frame.step / config.method.dynamics.step_frames,
            seed: config.seed,
        }
    }

    fn method(&self) -> &Sparsedyn {
        &self.scene.method
    }

    /// The moving Gaussians that the field moves, as indices among them.
    fn of_field(&self) -> Vec<u32> {
        let labels = self.method().frame.labels.iter().enumerate();
        let has_bodies = self.method().bodies.is_some();
        labels.filter(|(_, label)| !has_bodies || **label < 0).map(|(index, _)| index as u32).collect()
    }

    /// The uncertainty of each body's law.
    fn laws(&self, bodies: &Bodies) -> Vec<LawUncertainty> {
        let first = self.method().first_places(&self.scene.gaussians);
        let all = bodies.all();
        let of = |(body, frame): (usize, &gs_models::sparsedyn::bodies::BodyFrame)| {
            let (own, span) = (&all[body], &bodies.span);
            let centre = own.pose(span, frame.since).centre;
            let first_centre = DVec3::from_array(frame.centre);
            let members = self.method().frame.labels.iter().zip(&first).filter(|(label, _)| **label == body as i32);
            let squares: Vec<f64> = members.map(|(_, position)| position.distance_squared(first_centre)).collect();
            let spread = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
            let times: Vec<f64> = self.seen.iter().map(|time| time - frame.since).filter(|s| *s >= 0.0).collect();
            let observed = Observed {
                first: centre,
                size: spread.sqrt(),
                independent: times.len() as f64 / self.frames_per_pose,
                times,
                noise: self.noise,
            };
            LawUncertainty::of(frame.law, own.values, observed)
        };
        bodies.frames.iter().enumerate().map(of).collect()
    }

    /// The perturbation scale whose ensemble spread over the observed times equals the pose noise.
    fn field_scale(&self, field: &DynamicsField, rows: &[u32], count: usize) -> f64 {
        let (method, every) = (self.method(), rows.len().div_ceil(CALIBRATED_ROWS).max(1));
        let rows: Vec<u32> = rows.iter().copied().step_by(every).collect();
        let first = method.first_positions(&self.scene.gaussians);
        let first = first.clone().select(0, indices(&rows, &first.device()));
        let times: Vec<f64> = self.seen.iter().copied().step_by(self.seen.len().div_ceil(CALIBRATED_TIMES)).collect();
        let paths = |field: DynamicsField| -> Vec<f64> {
            let method = Sparsedyn { field: Some(field), ..method.clone() };
            let states = method.rolled(&State::at_rest(first.clone()), method.options, &times);
            states.into_iter().flat_map(|state| to_host(state.positions)).map(f64::from).collect()
        };
        let own = paths(field.clone());
        let mut scale = 1e-2;
        for _ in 0..ROUNDS {
            let squares = (0..count as u64).map(|member| {
                let moved = paths(field_draw(field, &self.normals(CALIBRATION + member, field), scale));
                moved.iter().zip(&own).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / own.len().max(1) as f64
            });
            let spread = (squares.sum::<f64>() / count as f64).sqrt();
            let change = self.noise / spread;
            scale *= if change.is_finite() { change.clamp(1.0 / LARGEST_CHANGE, LARGEST_CHANGE) } else { 0.1 };
        }
        scale
    }

    fn normals(&self, index: u64, field: &DynamicsField) -> Vec<f64> {
        let mut rng = stream(self.seed, Purpose::Ensemble, index);
        (0..field_numbers(field)).map(|_| normal_pair(&mut rng)[0]).collect()
    }

    /// A member: every law drawn, then the field.
    fn member(&self, index: u64, laws: &[LawUncertainty], scale: Option<f64>) -> Sparsedyn {
        let mut method = self.method().clone();
        if let Some(bodies) = &method.bodies {
            // Beside the streams of the field.
            let mut rng = stream(self.seed, Purpose::Ensemble, (2 << 32) + index);
            let values: Vec<LawValues> = laws.iter().map(|law| law.draw(|| normal_pair(&mut rng)[0])).collect();
            method.bodies = Some(bodies.with_values(&values));
        }
        if let (Some(field), Some(scale)) = (&method.field, scale) {
            method.field = Some(field_draw(field, &self.normals(index, field), scale));
        }
        method
    }
}

impl Extrapolation for RolledFuture {
    fn scene(&self) -> Box<dyn DynamicScene> {
        Box::new(self.scene.clone())
    }

    fn last(&self) -> f64 {
        self.method().frame.clock.outer(self.method().options.reach()[1])
    }

    fn parts(&self) -> Vec<Part> {
        let (method, count) = (self.method(), self.scene.gaussians.len() as u32);
        let frame = &method.frame;
        let labelled = |wanted: i32| -> Vec<u32> {
            let rows = frame.rows.iter().zip(&frame.labels);
            rows.filter(|(_, label)| **label == wanted).map(|(row, _)| *row).collect()
        };
        let values = method.bodies.as_ref().map(Bodies::values).unwrap_or_default();
        let mut parts: Vec<Part> = Vec::new();
        for (body, (constants, values)) in frame.bodies.iter().zip(&values).enumerate() {
            let terms = Term::ALL.into_iter().filter(|term| constants.law.has(*term));
            parts.push(Part {
                name: format!("body_{body}"),
                words: frame.words(constants),
                confidence: constants.confidence,
                since: (constants.since < frame.span[1]).then(|| frame.clock.outer(constants.since)),
                terms: terms
                    .map(|term| (named(term), in_unit(term, &values.0[term.numbers()], &frame.clock)))
                    .collect(),
                centre: Some(DVec3::from_array(constants.centre)),
                rows: labelled(body as i32),
            });
        }
        let plain = |name: &str, words: &str, rows: Vec<u32>| Part {
            name: name.into(),
            words: words.into(),
            confidence: None,
            since: None,
            terms: Vec::new(),
            centre: None,
            rows,
        };
        parts.push(plain("field", "moved by the dynamics field, no rigid body", labelled(-1)));
        let still = (0..count).filter(|row| frame.rows.binary_search(row).is_err()).collect();
        parts.push(plain("static", "rests", still));
        parts.retain(|part| !part.rows.is_empty());
        parts
    }

    fn members(&self, count: usize) -> Result<Vec<Box<dyn DynamicScene>>, String> {
        let method = self.method();
        if !matches!(method.model, MotionModel::Rollout | MotionModel::Hybrid) {
            return Err(
                "the ensemble perturbs the field of a rollout, and this run's motion is that of a baseline".into()
            );
        }
        let laws = method.bodies.as_ref().map(|bodies| self.laws(bodies)).unwrap_or_default();
        let rows = self.of_field();
        let scale = match &method.field {
            Some(field) if !rows.is_empty() && self.seen.len() > 1 => Some(self.field_scale(field, &rows, count)),
            _ => None,
        };
        let scene = |index: usize| -> Box<dyn DynamicScene> {
            let method = self.member(index as u64, &laws, scale);
            Box::new(RolledScene { gaussians: self.scene.gaussians.clone(), method })
        };
        Ok((0..count).map(scene).collect())
    }

    fn noise(&self) -> f64 {
        self.noise
    }

    fn with_step(&self, frames: f64) -> Result<Box<dyn Extrapolation>, String> {
        if !STEP_FRAMES.contains(&frames) {
            let (least, most) = (STEP_FRAMES.start(), STEP_FRAMES.end());
            return Err(format!("expected a step of {least} to {most} frames, found {frames}"));
        }
        let mut other = self.clone();
        let options = RolloutOptions { step: frames * self.frame, ..self.method().options };
        other.scene.method.options = options;
        Ok(Box::new(other))
    }
}

/// The numbers of a term in the data set's unit of time.
fn in_unit(term: Term, numbers: &[f64], clock: &Clock) -> Vec<f64> {
    let per = match term {
        Term::Velocity | Term::Spin | Term::Damping => clock.unit,
        Term::Acceleration | Term::SpinUp => clock.unit * clock.unit,
        // The rate; the phase has no unit of time.
        Term::Oscillation => return numbers.iter().zip([clock.unit, 1.0]).map(|(x, per)| x / per).collect(),
        Term::Swing | Term::Sway | Term::Pivot => 1.0,
    };
    numbers.iter().map(|x| x / per).collect()
}

/// The name of a term in a file.
fn named(term: Term) -> String {
    match term {
        Term::Velocity => "velocity",
        Term::Acceleration => "acceleration",
        Term::Spin => "angular_velocity",
        Term::SpinUp => "angular_acceleration",
        Term::Swing => "swing",
        Term::Sway => "sway",
        Term::Oscillation => "rate_and_phase",
        Term::Pivot => "pivot_from_centre",
        Term::Damping => "damping_rate",
    }
    .into()
}

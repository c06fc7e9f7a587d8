//! How many of the moving objects are found as actors, and how many actors are moving objects, by labelled LiDAR
//! points.
//!
//! A labelled point belongs to the actor of its nearest Gaussian. An object of a snippet counts if its points move by
//! [`MOVING`] or more on average and some sweep has ten of them.

use std::collections::BTreeMap;

use gs_models::flux4d::FluxScene;
use gs_models::flux4d::actors::Actor;

use super::flow::{FlowOfSweep, norm};
use super::moving::MOVING;
use gs_train::fit::figure::{Better, Figure};

/// Points of an object in the sweep that shows most of it: what Algorithm 3 asks of a core point.
const FEWEST: usize = 10;
/// Share of its points from which on an object is found and an actor is a moving object.
const SHARE: f64 = 0.5;

/// Counts over snippets.
#[derive(Debug, Clone, Copy, Default)]
pub struct ActorScores {
    found: usize,
    objects: usize,
    right: usize,
    actors: usize,
}

/// Points of an object.
#[derive(Default)]
struct Object {
    points: usize,
    /// Most points in one sweep.
    most: usize,
    motion: f64,
    of_actor: BTreeMap<usize, usize>,
}

impl ActorScores {
    /// Adds the actors of a snippet; `sweeps` are its labelled points, whose rows are those before resting and moving
    /// Gaussians of the `scene` were parted.
    pub fn add(&mut self, scene: &FluxScene, actors: &[Actor], sweeps: &[FlowOfSweep]) {
        let mut actor_of = vec![None; scene.gaussians.len()];
        for (number, actor) in actors.iter().enumerate() {
            for row in &actor.rows {
                actor_of[scene.rows[scene.resting() + *row as usize] as usize] = Some(number);
            }
        }
        let mut objects: BTreeMap<&str, Object> = BTreeMap::new();
        let mut points_of = vec![[0_usize; 2]; actors.len()];
        for sweep in sweeps {
            let mut in_sweep = vec![0; sweep.tracks.len()];
            for ((truth, row), object) in sweep.truth.iter().zip(&sweep.rows).zip(&sweep.objects) {
                let motion = norm(*truth);
                let actor = actor_of[*row as usize];
                if let Some(actor) = actor {
                    points_of[actor][0] += 1;
                    points_of[actor][1] += usize::from(motion >= f64::from(MOVING));
                }
                let Some(place) = object.map(|object| object as usize) else { continue };
                let object = objects.entry(&sweep.tracks[place]).or_default();
                in_sweep[place] += 1;
                object.most = object.most.max(in_sweep[place]);
                object.points += 1;
                object.motion += motion;
                if let Some(actor) = actor {
                    *object.of_actor.entry(actor).or_default() += 1;
                }
            }
        }
        let counts =
            |object: &&Object| object.most >= FEWEST && object.motion / object.points as f64 >= f64::from(MOVING);
        let enough = |part: usize, whole: usize| part as f64 >= SHARE * whole as f64;
        for object in objects.values().filter(counts) {
            self.objects += 1;
            let most = object.of_actor.values().max().copied().unwrap_or(0);
            self.found += usize::from(enough(most, object.points));
        }
        for [points, moving] in points_of.into_iter().filter(|[points, _]| *points > 0) {
            self.actors += 1;
            self.right += usize::from(enough(moving, points));
        }
    }

    /// The figures; none without a moving object.
    pub fn figures(&self) -> Vec<Figure> {
        let share = |part: usize, whole: usize| part as f64 / whole as f64;
        let figure = |key: &str, name: &str, (part, whole): (usize, usize)| {
            let figure = Figure::new(key, name, share(part, whole), "").digits(2).better(Better::Higher);
            (whole > 0).then(|| figure.note(format!("{part} of {whole}")))
        };
        let found = [
            figure("actor_recall", "moving objects found as actors", (self.found, self.objects)),
            figure("actor_precision", "actors that are moving objects", (self.right, self.actors)),
        ];
        found.into_iter().flatten().collect()
    }
}

//! The actors of a reconstruction as JSON: number in the snippet, track over snippets, box, speed and path.

use std::path::Path;

use anyhow::Result;
use glam::{DMat4, DVec3};
use gs_models::flux4d::actors::{Actor, LinkConfig, link_actors};
use serde::Serialize;

use gs_train::run::outputs::{MARK, write_json};

/// The actors of all snippets.
#[derive(Debug, Default)]
pub struct ActorList {
    names: Vec<String>,
    actors: Vec<Vec<Actor>>,
    /// Time of the log's first frame, seconds.
    begin: f64,
}

#[derive(Debug, Serialize)]
struct File {
    program: &'static str,
    /// Units for readers.
    units: &'static str,
    snippets: Vec<OfSnippet>,
}

#[derive(Debug, Serialize)]
struct OfSnippet {
    name: String,
    actors: Vec<OfActor>,
}

#[derive(Debug, Serialize)]
struct OfActor {
    /// Number in the snippet, as edits name it.
    actor: usize,
    /// The same for one object in all snippets.
    track: usize,
    centre: [f64; 3],
    /// Length along the motion, width, height.
    size: [f64; 3],
    yaw: f64,
    speed: f64,
    gaussians: usize,
    /// Degree of its velocity in time: 0 is constant.
    degree: usize,
    path: Vec<OfTime>,
}

#[derive(Debug, Serialize)]
struct OfTime {
    time: f64,
    centre: [f64; 3],
    velocity: [f64; 3],
}

impl ActorList {
    /// Adds a snippet's actors; `to_world` leads from its axes to the world, `begin` is the time of the log's first
    /// frame.
    pub fn add(&mut self, name: &str, mut actors: Vec<Actor>, to_world: &DMat4, begin: f64) {
        let moved = |point: [f64; 3]| to_world.transform_point3(DVec3::from_array(point)).to_array();
        let turned = |vector: [f64; 3]| to_world.transform_vector3(DVec3::from_array(vector)).to_array();
        for actor in &mut actors {
            actor.bounds.centre = moved(actor.bounds.centre);
            let [x, y, _] = turned([actor.bounds.yaw.cos(), actor.bounds.yaw.sin(), 0.0]);
            actor.bounds.yaw = y.atan2(x);
            for point in &mut actor.track {
                (point.centre, point.velocity) = (moved(point.centre), turned(point.velocity));
            }
        }
        self.names.push(name.into());
        self.actors.push(actors);
        self.begin = begin;
    }

    /// Objects: one in several snippets counts once.
    pub fn count(&self) -> usize {
        link_actors(&self.actors, &LinkConfig::default()).count
    }

    /// Writes the list.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let tracks = link_actors(&self.actors, &LinkConfig::default());
        let of_actor = |(number, (actor, track)): (usize, (&Actor, &usize))| OfActor {
            actor: number,
            track: *track,
            centre: actor.bounds.centre,
            size: actor.bounds.size,
            yaw: actor.bounds.yaw,
            speed: actor.speed,
            gaussians: actor.rows.len(),
            degree: actor.degree,
            path: actor
                .track
                .iter()
                .map(|p| OfTime { time: p.time - self.begin, centre: p.centre, velocity: p.velocity })
                .collect(),
        };
        let snippets = self.names.iter().zip(&self.actors).zip(&tracks.numbers).map(|((name, actors), numbers)| {
            OfSnippet { name: name.clone(), actors: actors.iter().zip(numbers).enumerate().map(of_actor).collect() }
        });
        let units = "metres in the world of the log, radians, metres per second, seconds from the log's first frame";
        write_json(path, &File { program: MARK, units, snippets: snippets.collect() })
    }
}

//! JSON records of a synthetic log: poses, actors, the options.

use glam::{DMat4, DQuat, DVec2};
use serde_json::{Value, json};

use super::rig::Rig;
use super::street::Thing;
use gs_driving::layout::track;

/// A pose as PandaSet writes it.
pub(super) fn pose(matrix: &DMat4) -> Value {
    let (_, DQuat { x, y, z, w }, position) = matrix.to_scale_rotation_translation();
    json!({
        "position": { "x": position.x, "y": position.y, "z": position.z },
        "heading": { "w": w, "x": x, "y": y, "z": z },
    })
}

/// A vehicle or person at a time, world axes.
pub(super) struct Placed {
    pub position: DVec2,
    /// Heading from the world's x axis, radians.
    pub yaw: f64,
    /// Metres per second.
    pub speed: f64,
}

/// Where a thing is at street seconds `time`.
pub(super) fn placed(rig: &Rig<'_>, thing: &Thing, time: f64) -> Placed {
    let stand = thing.path.at(time);
    let position = rig.world().transform_point3(stand.position.extend(0.0)).truncate();
    Placed { position, yaw: stand.yaw + rig.street.heading, speed: thing.path.driven(time).1 }
}

/// `truth/actors.json`: vehicles and people with their place at the middle of each sweep.
pub(super) fn actors(rig: &Rig<'_>) -> Value {
    let actors = rig.street.things.iter().filter(|thing| thing.number > 0);
    let list: Vec<Value> = actors
        .map(|thing| {
            let states: Vec<Value> = (0..rig.options.frames)
                .map(|frame| {
                    let time = middle(rig, frame);
                    let Placed { position, yaw, speed } = placed(rig, thing, time);
                    let position = [position.x, position.y, 0.0];
                    json!({ "time": rig.clock(time), "position": position, "yaw": yaw, "speed": speed })
                })
                .collect();
            json!({
                "number": thing.number,
                "track": track(thing.number),
                "label": thing.body.label,
                "class": thing.body.class().name(),
                "size": thing.body.size().to_array(),
                "moves": thing.path.moves(),
                "states": states,
            })
        })
        .collect();
    json!({ "flow_interval": super::rig::TURN, "seed": rig.options.seed, "actors": list })
}

/// Street seconds at which the boxes of a frame are written: the middle of its sweep.
pub(super) fn middle(rig: &Rig<'_>, frame: usize) -> f64 {
    rig.sweep_end(frame) - 0.5 * super::rig::TURN
}

/// The classes that streets have, as `annotations/semseg/classes.json` names them.
pub(super) fn classes() -> Value {
    json!({
        "5": "Vegetation", "6": "Ground", "7": "Road", "10": "Other Road Marking", "11": "Sidewalk", "13": "Car",
        "23": "Bus", "26": "Bicycle", "30": "Pedestrian", "41": "Building", "42": "Other Static Object",
    })
}

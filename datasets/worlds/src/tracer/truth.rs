//! The truth about moving objects, as JSON.

use glam::DQuat;
use serde_json::{Value, json};

use super::stage::{MovingObject, Stage};

/// The pose (metres), velocity (metres per unit of time) and angular velocity (radians per unit of time, world axes) of every moving
/// object at each of `times`: the truth for motion models.
pub(crate) fn movers(stage: &Stage, times: impl Iterator<Item = f64> + Clone) -> Value {
    let list = |object: &MovingObject| {
        let poses: Vec<Value> = times
            .clone()
            .map(|time| {
                let (pose, twist) = (object.motion.pose(time), object.motion.twist(time));
                let DQuat { x, y, z, w } = pose.rotation;
                json!({
                    "time": time,
                    "position": pose.position.to_array(),
                    "quaternion_wxyz": [w, x, y, z],
                    "velocity": twist.velocity.to_array(),
                    "angular_velocity": twist.angular.to_array(),
                })
            })
            .collect();
        json!({ "name": object.name, "radius": object.solid.radius, "poses": poses })
    };
    stage.objects.iter().map(list).collect()
}

//! Actors of a scene: clusters of its fast rows.
//!
//! Algorithm 3 clusters `G.means`, in which each point of an object is where it was at its own time, so that a fast
//! object is smeared over its path, and it clusters all rows. Here the moving rows alone are clustered, and all are
//! brought to one time first.

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use super::dbscan::dbscan;
use crate::flux4d::error::FluxError;
use crate::flux4d::far::extremes;
use crate::flux4d::scene::FluxScene;

/// Rows of a cluster up to which it may be a part of a body: two beams of a LiDAR on a car 40 m away have as many each,
/// and meet its bumper and its window.
const PART_ROWS: usize = 40;
/// Distance of such parts, metres: from the bumper of a car to its window.
const PART_GAP: f64 = 1.6;
/// Difference of their velocities, metres per second and as a share.
const PART_VELOCITY: [f64; 2] = [1.0, 0.15];

/// The configuration of the search for actors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ActorConfig {
    /// Slowest speed of an actor's Gaussians, metres per second. The paper's 5 has no unit; in metres per second it
    /// would leave pedestrians out, so this is the limit between static and dynamic of the flow labels, 0.05 m a frame.
    pub speed: f64,
    /// Radius of the clustering, metres (Algorithm 3).
    pub eps: f64,
    /// Points within the radius that make a core point (Algorithm 3).
    pub min_points: usize,
}

impl Default for ActorConfig {
    fn default() -> Self {
        Self { speed: 0.5, eps: 0.4, min_points: 10 }
    }
}

/// An upright box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ActorBox {
    /// World, metres.
    pub centre: [f64; 3],
    /// Length along the motion, width, height, metres.
    pub size: [f64; 3],
    /// Direction of the motion from the x axis, radians, counter-clockwise seen from above.
    pub yaw: f64,
}

/// The position of an actor at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// Seconds.
    pub time: f64,
    /// Mean of its Gaussians' centres, world, metres.
    pub centre: [f64; 3],
    /// Mean velocity, metres per second.
    pub velocity: [f64; 3],
}

/// A moving object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Actor {
    /// Its rows among the scene's moving Gaussians, ascending.
    pub rows: Vec<u32>,
    /// Its box at the time of the clustering.
    pub bounds: ActorBox,
    /// Its speed then, metres per second.
    pub speed: f64,
    /// The degree of its velocity; that of the scene's motion until a lower one is chosen.
    pub degree: usize,
    /// Its positions at the times asked for.
    pub track: Vec<TrackPoint>,
}

/// The actors of `scene`, clustered at the time `t` and followed over `times`, all in seconds; in the order of their
/// first rows.
///
/// # Errors
/// When a setting is out of range or a moved Gaussian has no usable position.
pub fn find_actors(scene: &FluxScene, t: f64, times: &[f64], config: &ActorConfig) -> Result<Vec<Actor>, FluxError> {
    Ok(described(scene, clustered(scene, t, config)?, t, times))
}

/// The moving rows of each actor of `scene`, clustered at the time `t`, seconds; in the order of their first rows.
///
/// # Errors
/// As [`find_actors`].
pub fn clustered(scene: &FluxScene, t: f64, config: &ActorConfig) -> Result<Vec<Vec<u32>>, FluxError> {
    if scene.moving() == 0 {
        return Ok(Vec::new());
    }
    let (means, velocities) = (rows(&scene.moving_means(t)), rows(&scene.moving_velocity(t)));
    let fast: Vec<u32> =
        (0..means.len() as u32).filter(|row| norm(velocities[*row as usize]) >= config.speed).collect();
    let points: Vec<[f32; 3]> = fast.iter().map(|row| means[*row as usize].map(|x| x as f32)).collect();
    let labels = dbscan(&points, config.eps, config.min_points)?;
    let count = labels.iter().flatten().max().map_or(0, |last| *last as usize + 1);
    let mut members = vec![Vec::new(); count];
    for (row, label) in fast.iter().zip(labels) {
        if let Some(label) = label {
            members[label as usize].push(*row);
        }
    }
    Ok(joined(members, &means, &velocities))
}

/// Clusters of few rows, each with the clusters beside it that move as it does.
fn joined(mut members: Vec<Vec<u32>>, means: &[[f64; 3]], velocities: &[[f64; 3]]) -> Vec<Vec<u32>> {
    let difference = |a: [f64; 3], b: [f64; 3]| norm([0, 1, 2].map(|axis| a[axis] - b[axis]));
    let is_one = |one: &[u32], two: &[u32]| {
        let (v, w) = (mean(velocities, one), mean(velocities, two));
        let near =
            |row: &u32| two.iter().any(|other| difference(means[*row as usize], means[*other as usize]) <= PART_GAP);
        one.len().min(two.len()) <= PART_ROWS
            && difference(v, w) <= PART_VELOCITY[0] + PART_VELOCITY[1] * norm(v).max(norm(w))
            && one.iter().any(near)
    };
    let mut cluster = 0;
    while cluster < members.len() {
        let part = (cluster + 1..members.len()).find(|other| is_one(&members[cluster], &members[*other]));
        match part {
            Some(other) => {
                let rows = members.remove(other);
                members[cluster].extend(rows);
                members[cluster].sort_unstable();
                // The larger cluster may touch one that was passed over.
            }
            None => cluster += 1,
        }
    }
    members
}

/// Actors of the moving rows `members` of each, at the time `t` and over `times`, seconds.
pub fn described(scene: &FluxScene, members: Vec<Vec<u32>>, t: f64, times: &[f64]) -> Vec<Actor> {
    if members.is_empty() {
        return Vec::new();
    }
    let (means, velocities) = (rows(&scene.moving_means(t)), rows(&scene.moving_velocity(t)));
    let moments: Vec<_> = times
        .iter()
        .map(|time| (*time, rows(&scene.moving_means(*time)), rows(&scene.moving_velocity(*time))))
        .collect();
    let actor = |rows: Vec<u32>| {
        let velocity = mean(&velocities, &rows);
        let at = |(time, means, velocities): &(f64, Vec<[f64; 3]>, Vec<[f64; 3]>)| TrackPoint {
            time: *time,
            centre: mean(means, &rows),
            velocity: mean(velocities, &rows),
        };
        let track = moments.iter().map(at).collect();
        let degree = scene.motion.degree();
        Actor { bounds: bounds(&means, &rows, velocity), speed: norm(velocity), degree, track, rows }
    };
    members.into_iter().map(actor).collect()
}

fn bounds(means: &[[f64; 3]], rows: &[u32], velocity: [f64; 3]) -> ActorBox {
    let yaw = velocity[1].atan2(velocity[0]);
    let (sin, cos) = yaw.sin_cos();
    let turned = |[x, y, z]: [f64; 3]| [cos * x + sin * y, cos * y - sin * x, z];
    let [low, high] = extremes(rows.iter().map(|row| turned(means[*row as usize])));
    let [x, y, z] = [0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis]));
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    ActorBox { centre: [cos * x - sin * y, sin * x + cos * y, z], size, yaw }
}

fn mean(values: &[[f64; 3]], rows: &[u32]) -> [f64; 3] {
    let sum = rows.iter().fold([0.0; 3], |sum, row| [0, 1, 2].map(|axis| sum[axis] + values[*row as usize][axis]));
    sum.map(|x| x / rows.len() as f64)
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn rows(tensor: &Tensor<2>) -> Vec<[f64; 3]> {
    let values: Vec<f64> = tensor.to_data().iter::<f64>().collect();
    values.chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect()
}

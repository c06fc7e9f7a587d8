//! The same actor in overlapping snippets: positions at a common time and velocities, matched nearest first.

use serde::{Deserialize, Serialize};

use super::found::{Actor, TrackPoint};

/// When two actors of different snippets may be one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkConfig {
    /// Largest distance of the centres, metres. The visible part of a car changes its mean centre by up to a metre.
    pub distance: f64,
    /// Largest difference of the velocities, metres per second.
    pub velocity: f64,
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self { distance: 2.0, velocity: 5.0 }
    }
}

/// A number for each actor of each snippet; equal numbers are one object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tracks {
    /// Numbers of the objects by snippet and actor.
    pub numbers: Vec<Vec<usize>>,
    /// Number of objects.
    pub count: usize,
}

/// Links the actors of consecutive snippets. Each one's track is carried to the next snippet's first time at constant
/// velocity from its nearest point in time; pairs are taken in the order of their distance, each actor once.
pub fn link_actors(snippets: &[Vec<Actor>], config: &LinkConfig) -> Tracks {
    let mut tracks = Tracks { numbers: Vec::new(), count: 0 };
    for (index, actors) in snippets.iter().enumerate() {
        let mut numbers = vec![None; actors.len()];
        if index > 0 {
            for (before, now) in pairs(&snippets[index - 1], actors, config) {
                numbers[now] = Some(tracks.numbers[index - 1][before]);
            }
        }
        let count = &mut tracks.count;
        let number = |known: Option<usize>| {
            known.unwrap_or_else(|| {
                *count += 1;
                *count - 1
            })
        };
        tracks.numbers.push(numbers.into_iter().map(number).collect());
    }
    tracks
}

fn pairs(before: &[Actor], now: &[Actor], config: &LinkConfig) -> Vec<(usize, usize)> {
    let mut candidates = Vec::new();
    for (i, old) in before.iter().enumerate() {
        for (j, new) in now.iter().enumerate() {
            let Some(seen) = new.track.first() else { continue };
            let Some(predicted) = at(&old.track, seen.time) else { continue };
            let (gap, turn) = (distance(predicted.centre, seen.centre), distance(predicted.velocity, seen.velocity));
            if gap <= config.distance && turn <= config.velocity {
                candidates.push((gap, i, j));
            }
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut used, mut taken, mut pairs) = (vec![false; before.len()], vec![false; now.len()], Vec::new());
    for (_, i, j) in candidates {
        if !used[i] && !taken[j] {
            (used[i], taken[j]) = (true, true);
            pairs.push((i, j));
        }
    }
    pairs
}

/// The track at a time, by constant velocity from its nearest point.
fn at(track: &[TrackPoint], time: f64) -> Option<TrackPoint> {
    let nearest = track.iter().min_by(|a, b| (a.time - time).abs().total_cmp(&(b.time - time).abs()))?;
    let dt = time - nearest.time;
    let centre = [0, 1, 2].map(|axis| nearest.centre[axis] + dt * nearest.velocity[axis]);
    Some(TrackPoint { time, centre, velocity: nearest.velocity })
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

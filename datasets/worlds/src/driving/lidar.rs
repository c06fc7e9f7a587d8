//! Sweeps of the street.

use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::instant::Instant;
use super::rig::{Rig, TURN};
use crate::random::gaussian;
use crate::tracer::shape::Ray;

/// Nearest and farthest return, metres.
const RANGE: (f64, f64) = (1.5, 120.0);

/// Beams that graze a surface at a smaller sine than this do not return.
const GRAZING: f64 = 0.02;

/// One return.
#[derive(Debug, Clone, Copy)]
pub(super) struct Return {
    /// Street axes, metres.
    pub position: DVec3,
    /// Street seconds.
    pub time: f64,
    /// 0 to 255.
    pub intensity: f64,
    /// Metres in the next 0.1 s, street axes.
    pub flow: DVec3,
    pub instance: u32,
    pub class: u8,
    pub semantic: u8,
    /// The LiDAR.
    pub sensor: u8,
}

/// The returns of one turn of each LiDAR.
pub(super) fn sweep(rig: &Rig<'_>, frame: usize) -> Vec<Return> {
    (0..rig.options.lidars).flat_map(|lidar| turn(rig, frame, lidar)).collect()
}

/// The returns of one turn, column by column: each column sees the street at its own time.
fn turn(rig: &Rig<'_>, frame: usize, lidar: usize) -> Vec<Return> {
    let mut rng = ChaCha8Rng::seed_from_u64(rig.options.seed ^ ((frame as u64 + 1) << 32));
    rng.set_stream(lidar as u64);
    let angles = rig.beam_angles();
    let mut returns = Vec::new();
    for column in 0..rig.options.columns {
        let (time, origin, azimuth) = rig.beam_column((frame, lidar), column);
        let instant = Instant::new(rig.street, time);
        let candidates = instant.in_fan(origin, azimuth);
        for angle in &angles {
            let (sin, cos) = angle.sin_cos();
            let ray = Ray { origin, direction: DVec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin) };
            // Drawn for every beam, so that one return more does not change the noise of all that follow.
            let (noise, luck) = (gaussian(&mut rng), rng.random::<f64>());
            let Some(hit) = instant.meet(&ray, &candidates) else { continue };
            let facing = hit.normal.dot(ray.direction).abs();
            if hit.t < RANGE.0 || hit.t > RANGE.1 || facing < GRAZING || luck < hit.swallows() {
                continue;
            }
            let albedo = instant.albedo(&hit, 0.0);
            returns.push(Return {
                position: ray.at(hit.t + rig.options.range_noise * noise),
                time,
                intensity: (255.0 * albedo.element_sum() / 3.0 * facing.sqrt()).clamp(0.0, 255.0).round(),
                flow: instant.flow(&hit, TURN),
                instance: hit.instance(),
                class: hit.on.filter(|(thing, _)| thing.number > 0).map_or(0, |(thing, _)| thing.body.class() as u8),
                semantic: instant.semantic(&hit),
                sensor: lidar as u8,
            });
        }
    }
    returns
}

#[cfg(test)]
mod tests {
    use gs_base::median;

    use super::*;
    use crate::driving::StreetOptions;
    use crate::driving::street::Street;

    /// The second LiDAR sees what is ahead or behind half a turn before or after the first, whose returns are those of
    /// a rig without it.
    #[test]
    fn two_lidars_see_a_body_half_a_turn_apart() {
        let one = StreetOptions { beams: 16, columns: 180, ..StreetOptions::default() };
        let two = StreetOptions { lidars: 2, ..one.clone() };
        let street = Street::new(&one);
        let sweep = |options: &StreetOptions| sweep(&Rig { street: &street, options: options.clone() }, 3);
        let (alone, both) = (sweep(&one), sweep(&two));
        let first: Vec<&Return> = both.iter().filter(|r| r.sensor == 0).collect();
        assert_eq!(first.len(), alone.len());
        assert!(first.iter().zip(&alone).all(|(a, b)| a.position == b.position && a.time == b.time));
        assert!(both.len() > 3 * alone.len() / 2, "{} returns of two, {} of one", both.len(), alone.len());
        let mut compared = 0;
        for instance in 1..=both.iter().map(|r| r.instance).max().expect("a body") {
            let time = |sensor| {
                let own = both.iter().filter(|r| r.instance == instance && r.sensor == sensor).map(|r| r.time);
                let times: Vec<f64> = own.collect();
                // A body where a turn begins is seen at both of its ends.
                let spread = times.iter().fold(f64::NEG_INFINITY, |high, t| high.max(*t)) - times.first()?;
                (spread < 0.02).then(|| median(times)).flatten()
            };
            let Some((a, b)) = time(0).zip(time(1)) else { continue };
            compared += 1;
            assert!(((a - b).abs() - 0.05).abs() < 0.01, "body {instance} at {a} and {b} s");
        }
        assert!(compared >= 3, "{compared} bodies are seen by both");
    }
}

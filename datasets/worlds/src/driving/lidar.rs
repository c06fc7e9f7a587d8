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
}

/// The returns of one turn, column by column: each column sees the street at its own time.
pub(super) fn sweep(rig: &Rig<'_>, frame: usize) -> Vec<Return> {
    let mut rng = ChaCha8Rng::seed_from_u64(rig.options.seed ^ ((frame as u64 + 1) << 32));
    let angles = rig.beam_angles();
    let mut returns = Vec::new();
    for column in 0..rig.options.columns {
        let (time, origin, azimuth) = rig.beam_column(frame, column);
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
            });
        }
    }
    returns
}

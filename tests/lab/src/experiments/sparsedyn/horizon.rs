//! Predictions at four times the time that was seen. A rollout that runs away shows as Gaussians far outside of the
//! scene.

use anyhow::Result;
use glam::DVec3;
use gs_datasets::View;
use gs_worlds::extrapolation::{ExtrapolationOptions, World};

use super::trial::{Film, Score, means, over_time, positions, scores, small, time, trial};
use crate::experiments::{Findings, Lab, Series, largest};

/// Worlds: a box that slows down, a rotor that turns steadily, a thrown ball beside a drifting box.
const WORLDS: [World; 3] = [World::Slider, World::Fan, World::Duo];

/// The last time that is seen.
const SEEN: f64 = 0.2;

/// The last time that is predicted: four times that.
const UNTIL: f64 = 0.8;

/// Frames of the recording, so that 13 of them are seen.
const FRAMES: usize = 60;

/// Every so many frames of the future are measured.
const EVERY: usize = 3;

/// Ways to move the Gaussians.
const MODES: [(&str, &str); 2] = [("bodies", "bodies.mode=bodies"), ("field alone", "bodies.mode=field")];

/// Size of the box that no Gaussian may leave, times that of the scene: what is farther away was thrown there by the
/// rollout.
const BOX: f64 = 2.0;

/// Share of Gaussians at either end of each axis that do not count for the scene's box: single strays would make it
/// wide.
const STRAYS: f64 = 0.01;

/// Least mean gain over a scene that stops, dB: a motion that is predicted worse than none should not be predicted.
const GAIN_BOUND: f64 = 0.0;

/// Most that bodies may lose against the field alone in moving parts, dB: the bound on the spread of seeds.
const BODIES_BOUND: f64 = -0.3;

/// The scene's box at the first frame.
struct Bounds {
    middle: DVec3,
    half: DVec3,
}

impl Bounds {
    fn of(positions: &[DVec3]) -> Self {
        let ends = |axis: usize| {
            let mut values: Vec<f64> = positions.iter().map(|position| position[axis]).collect();
            values.sort_by(f64::total_cmp);
            let stray = (STRAYS * values.len() as f64) as usize;
            let at = |index: usize| values.get(index).copied().unwrap_or(0.0);
            (at(stray), at(values.len().saturating_sub(1 + stray)))
        };
        let [x, y, z] = [0, 1, 2].map(ends);
        let (low, high) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        Self { middle: (low + high) / 2.0, half: (high - low) / 2.0 }
    }

    /// Share of positions outside of the box made larger.
    fn outside(&self, positions: &[DVec3]) -> f64 {
        let is_outside = |position: &&DVec3| (**position - self.middle).abs().cmpgt(BOX * self.half).any();
        positions.iter().filter(is_outside).count() as f64 / positions.len().max(1) as f64
    }
}

/// A run over the horizon.
struct Rolled {
    scores: Vec<Score>,
    /// The same photos against the scene of the last seen time.
    stopped: Vec<Score>,
    /// Share of Gaussians outside of the box by time.
    outside: Vec<(f64, f64)>,
    not_numbers: usize,
    /// The bodies found, with their laws.
    bodies: String,
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let (mut outside, mut not_numbers) = (Vec::new(), 0);
    for world in lab.either(&WORLDS[..], &WORLDS[..1]) {
        let film = Film::of(lab, &ExtrapolationOptions { frames: FRAMES, ..small(*world) })?;
        let runs = MODES.map(|(_, mode)| rolled(lab, &film, mode));
        let [bodies, field] = runs;
        let (bodies, field) = (bodies?, field?);
        for ((name, _), run) in MODES.iter().zip([&bodies, &field]) {
            let gain = means(&run.scores)[1] - means(&run.stopped)[1];
            let what = format!("{world}, {name}: mean PSNR of moving parts above that of a scene that stops");
            found.at_least(what, gain, GAIN_BOUND, "dB");
            outside.extend(run.outside.iter().map(|(_, share)| 100.0 * share));
            not_numbers += run.not_numbers;
            let [own, stopped] = [&run.scores, &run.stopped].map(|scores| means(scores)[1]);
            let last = run.outside.last().map_or(0.0, |(_, share)| 100.0 * share);
            found.note(format!(
                "{world}, {name}: {own:.2} dB in moving parts, {stopped:.2} dB if it stops; at the end {last:.2} % of \
                 the Gaussians are outside of twice the box; {}.",
                run.bodies
            ));
        }
        let gain = means(&bodies.scores)[1] - means(&field.scores)[1];
        let what = format!("{world}: mean PSNR of moving parts, bodies above the field alone");
        found.at_least(what, gain, BODIES_BOUND, "dB");
        chart(found, world.name(), &bodies, &field);
    }
    let what = "Gaussians outside of twice the scene's box, the worst time";
    found.zero(what, largest(outside), "%");
    let what = "positions that are not finite";
    found.zero(what, not_numbers as f64, "");
    Ok(())
}

fn rolled(lab: &Lab, film: &Film, mode: &str) -> Result<Rolled> {
    let trial = trial(lab, film.until(SEEN), &[mode])?;
    let session = trial.trained(lab)?;
    let frame = |view: &View| (time(view) * FRAMES as f64).round() as usize;
    let mut future = film.future(SEEN, UNTIL);
    future.retain(|view| frame(view) % EVERY == 0);
    let scored = scores(lab, &session, &future);
    let stopped: Vec<View> = future.iter().map(|view| View { time: Some(SEEN), ..view.clone() }).collect();
    // The scores come in the order of the photos, so each gets its own time back.
    let mut stopped = scores(lab, &session, &stopped);
    stopped.iter_mut().zip(&future).for_each(|(score, view)| score.time = time(view));
    let times: Vec<f64> = over_time(&scored, |_| 0.0).into_iter().map(|(time, _)| time).collect();
    let first = positions(&session, &[0.0]).remove(0);
    let bounds = Bounds::of(&first);
    let later = positions(&session, &times);
    let not_numbers = later.iter().flatten().filter(|position| !position.is_finite()).count();
    let outside = times.iter().zip(&later).map(|(time, positions)| (*time, bounds.outside(positions))).collect();
    let bodies = match session.fit.trainer.method().body_lines() {
        none if none.is_empty() => "no body".into(),
        lines => lines.join("; "),
    };
    Ok(Rolled { scores: scored, stopped, outside, not_numbers, bodies })
}

fn chart(found: &mut Findings, world: &'static str, bodies: &Rolled, field: &Rolled) {
    let curve = |scores: &[Score]| -> Vec<(f64, f64)> {
        over_time(scores, |score| score.moving).into_iter().map(|(time, psnr)| (time / SEEN, psnr)).collect()
    };
    let series = [
        Series::line_and_dots(MODES[0].0, curve(&bodies.scores)),
        Series::line_and_dots(MODES[1].0, curve(&field.scores)),
        Series::line("stops where it was last seen", curve(&bodies.stopped)),
    ];
    let title = format!("{world}: seen until 1, predicted until 4");
    found.chart(world, title, ["time / time seen", "PSNR of moving parts, dB"], series);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hundred positions evenly from -1 to 1 and a stray: the box goes from -1 to 1, twice of it to 2.
    #[test]
    fn strays_make_no_box_wide() {
        let even = (0..100).map(|i| DVec3::splat(f64::from(i) / 49.5 - 1.0));
        let positions: Vec<DVec3> = even.chain([DVec3::new(50.0, 0.0, 0.0)]).collect();
        let bounds = Bounds::of(&positions);
        assert_eq!(bounds.outside(&positions), 1.0 / 101.0, "the stray alone");
        assert_eq!(bounds.outside(&[DVec3::new(1.9, 0.0, 0.0), DVec3::new(0.0, 2.1, 0.0)]), 0.5);
    }
}

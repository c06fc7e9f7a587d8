//! A future with a stop, a bounce or another speed. Nothing in the photos tells of it, so no smooth
//! motion can foresee it; the error that remains is shown.

use anyhow::Result;
use gs_datasets::View;
use gs_worlds::extrapolation::{ExtrapolationOptions, World};

use super::trial::{Film, SAME_TIME, SEEN, Score, mean, over_time, scores, small, time, trial};
use crate::experiments::{Findings, Lab, Series};

/// When the motion changes.
const EVENT: f64 = 0.85;

/// Frames of the recording, one of them at the event.
const FRAMES: usize = 40;

/// Largest loss of PSNR in moving parts after the event, dB. A method that foresaw the event would lose nothing; this
/// is not expected to be kept, and stands here so that the loss is shown as a miss.
const LOSS_BOUND: f64 = 1.0;

/// A change of the motion: the time at which the undisturbed world looks as the changed one does so long after the
/// event. A world that stops, runs backwards or runs at half its speed is exactly that.
type Event = (&'static str, fn(since: f64) -> f64);

const EVENTS: [Event; 3] =
    [("stops", |_| EVENT), ("bounces back", |since| EVENT - since), ("half its speed", |since| EVENT + 0.5 * since)];

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let film = Film::of(lab, &ExtrapolationOptions { frames: FRAMES, ..small(World::Slider) })?;
    let trial = trial(lab, film.until(SEEN), &[])?;
    let session = trial.trained(lab)?;
    let usual = scores(lab, &session, &film.future(SEEN, 1.0));
    let curve = |scores: &[Score]| over_time(scores, |score| score.moving);
    let mut series = vec![Series::line_and_dots("undisturbed", curve(&usual))];
    for (name, source) in EVENTS {
        let changed = scores(lab, &session, &changed(&film, source));
        let after = |scores: &[Score]| -> f64 {
            let times: Vec<f64> =
                changed.iter().map(|score| score.time).filter(|time| *time > EVENT + SAME_TIME).collect();
            let is_after = |score: &&Score| times.iter().any(|time| (time - score.time).abs() < SAME_TIME);
            mean(scores.iter().filter(is_after).map(|score| score.moving))
        };
        let (expected, met) = (after(&usual), after(&changed));
        let what = format!("{name}: PSNR of moving parts lost after the event, which nothing foresees");
        found.at_most(what, expected - met, LOSS_BOUND, "dB");
        let last = curve(&changed).last().map_or(f64::NAN, |(_, psnr)| *psnr);
        found.note(format!(
            "{name}: {met:.2} dB in moving parts after the event, against {expected:.2} dB undisturbed; {last:.2} dB \
             at the end."
        ));
        series.push(Series::line_and_dots(name, curve(&changed)));
    }
    found.note(
        "These are no failures that more training repairs: until the event all four futures have the same photos. \
         Recordings must go on past a contact for it to be learned.",
    );
    found.chart("", "A change at 0.85 that no photo tells of", ["time", "PSNR of moving parts, dB"], series);
    Ok(())
}

/// The photos of the future with the change; times are left out at which the undisturbed world was not filmed.
fn changed(film: &Film, source: fn(f64) -> f64) -> Vec<View> {
    let one = |view: View| {
        let since = time(&view) - EVENT;
        if since <= SAME_TIME {
            return Some(view);
        }
        let same = |other: &&View| other.camera_id == view.camera_id && (time(other) - source(since)).abs() < SAME_TIME;
        let other = film.test.iter().find(same)?;
        Some(View { image: other.image.clone(), mask: other.mask.clone(), truth: other.truth.clone(), ..view })
    };
    film.future(SEEN, 1.0).into_iter().filter_map(one).collect()
}

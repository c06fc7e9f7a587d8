//! How much of a motion must be seen? Runs that see less of it predict the same later photos.

use anyhow::Result;
use gs_worlds::extrapolation::{ExtrapolationOptions, World};

use super::trial::{Film, mean, means, scores, small, trial};
use crate::experiments::{Findings, Lab, Series, largest};

/// Worlds: a box that slows down, and a body that turns ever faster, whose law must be told from a steady turn.
const WORLDS: [World; 2] = [World::Slider, World::Spinner];

/// The last times that are seen.
const ENDS: [f64; 4] = [0.5, 0.6, 0.7, 0.75];

/// Frames of the recording: a frame at every one of these times.
const FRAMES: usize = 20;

/// Seeds over which is averaged: single runs differ by the law that they find.
const SEEDS: [u64; 3] = [42, 43, 44];

/// Most that may be lost in moving parts by seeing more, dB: twice the 0.6 dB that seeds may spread by.
const LOSS_BOUND: f64 = 1.2;

/// Least PSNR in moving parts over that of a run that saw up to 0.5 only, dB.
const GAIN_BOUND: f64 = 0.0;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let mut series = Vec::new();
    for world in lab.either(&WORLDS[..], &WORLDS[..1]) {
        let film = Film::of(lab, &ExtrapolationOptions { frames: FRAMES, ..small(*world) })?;
        let future = film.future(ENDS[3], 1.0);
        let (mut whole, mut moving) = (Vec::new(), Vec::new());
        for seen in lab.either(&ENDS[..], &[ENDS[0], ENDS[3]]) {
            let (mut images, mut parts) = (Vec::new(), Vec::new());
            for seed in lab.either(&SEEDS[..], &SEEDS[..1]) {
                let trial = trial(lab, film.until(*seen), &[&format!("seed={seed}")])?;
                let session = trial.trained(lab)?;
                let [of_image, of_moving] = means(&scores(lab, &session, &future));
                images.push(of_image);
                parts.push(of_moving);
                let lines = session.fit.trainer.method().body_lines().join("; ");
                found.note(format!(
                    "{world}, seen up to {seen}, seed {seed}: {of_moving:.2} dB in moving parts; {lines}."
                ));
            }
            whole.push((*seen, mean(images)));
            moving.push((*seen, mean(parts)));
        }
        let lost = moving.windows(2).map(|pair| pair[0].1 - pair[1].1);
        let what = format!("{world}: PSNR of moving parts lost by seeing more");
        found.at_most(what, largest(lost), LOSS_BOUND, "dB");
        let gain = moving.last().zip(moving.first()).map(|(last, first)| last.1 - first.1);
        let what = format!("{world}: PSNR of moving parts, seen up to 0.75 above up to 0.5");
        found.at_least(what, gain, GAIN_BOUND, "dB");
        series.push(Series::line_and_dots(&format!("{world}, image"), whole));
        series.push(Series::line_and_dots(&format!("{world}, moving parts"), moving));
    }
    found.chart(
        "",
        "Photos from 0.75 on by what was seen, mean of three seeds",
        ["last time seen", "PSNR, dB"],
        series,
    );
    Ok(())
}

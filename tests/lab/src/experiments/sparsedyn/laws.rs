//! Random worlds, whose bodies move by laws that the seed draws: is the right kind of law found from photos alone?

use std::collections::BTreeMap;

use anyhow::Result;
use gs_burn::glam::DVec3;
use gs_datasets::Priors;
use gs_models::sparsedyn::bodies::BodyFrame;
use gs_pipelines::sparsedyn::Sparsedyn;
use gs_worlds::extrapolation::{ExtrapolationOptions, Planted, World, planted};

use super::trial::{Film, SEEN};
use crate::experiments::lab::{Session, Trial, figure};
use crate::experiments::{Findings, Lab, Series};

const WORLDS: usize = 24;
const WORLDS_QUICK: usize = 2;

/// The first world's seed: thresholds were set on those of 1 to 30.
const FIRST: u64 = 100;

/// Least share of bodies whose law is of the planted kind.
const RIGHT: f64 = 0.95;

/// Least mean gain of the future over the last state seen, dB.
const GAIN: f64 = 8.0;

/// A body of the model is a planted one if their middles are as near as this, metres: the radius of the larger ones.
const NEAR: f64 = 0.35;

/// Image width and height, pixels, and cameras, three of which are held out.
const SIZE: usize = 160;
const CAMERAS: (usize, usize) = (8, 3);

/// A law that holds from this time on holds all the time: three frames, by which the first positions may be off.
const UNCHANGED: f64 = 0.05;

/// The words for a planted body that none of the model's bodies is.
const NONE: &str = "no body";

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let mut kinds: BTreeMap<&str, BTreeMap<String, usize>> = BTreeMap::new();
    let (mut right, mut all, mut gains) = (0, 0, Vec::new());
    for seed in (FIRST..).take(lab.either(WORLDS, WORLDS_QUICK)) {
        let options = options(seed);
        let mut scene = Film::of(lab, &options)?.until(SEEN);
        scene.train.iter_mut().for_each(|view| view.priors = Priors::default());
        let changes = ["eval.ms_ssim=false", "eval.lpips=false", "data.cache_mb=256"];
        let trial = Trial::<Sparsedyn>::new(lab, scene, &changes)?;
        let session = trial.trained(lab)?;
        gains.push((seed as f64, figure(&session.measure(), "gain").unwrap_or(f64::NAN)));
        for (law, middle) in planted(&options) {
            let (words, since) = motion_at(&session, middle);
            all += 1;
            right += usize::from(is_right(law, &words, since));
            *kinds.entry(law.name()).or_default().entry(words).or_default() += 1;
        }
    }
    found.at_least("share of bodies with the right kind of law", right as f64 / f64::from(all), RIGHT, "");
    let mean = gains.iter().map(|(_, gain)| gain).sum::<f64>() / gains.len() as f64;
    found.at_least("mean gain of the future over the last state seen", mean, GAIN, "dB");
    for (law, of) in kinds {
        let counts: Vec<String> = of.iter().map(|(words, count)| format!("{count} {words}")).collect();
        found.note(format!("{law}: {}.", counts.join(", ")));
    }
    found.chart("", "Gain of the future by world", ["seed", "dB"], [Series::line_and_dots("gain", gains)]);
    Ok(())
}

fn options(seed: u64) -> ExtrapolationOptions {
    let (cameras, held_out) = CAMERAS;
    ExtrapolationOptions {
        width: SIZE,
        height: SIZE,
        cameras,
        held_out,
        truth_every: 1000,
        seed,
        ..ExtrapolationOptions::of(World::Random)
    }
}

/// The motion of the model's body at a place of the first frame, and the time from which it holds.
fn motion_at(session: &Session<Sparsedyn>, middle: DVec3) -> (String, f64) {
    let frame = &session.fit.trainer.method().frame;
    let away = |body: &BodyFrame| DVec3::from(body.centre).distance(middle);
    let nearest = frame.bodies.iter().min_by(|a, b| away(a).total_cmp(&away(b))).filter(|body| away(body) < NEAR);
    let Some(body) = nearest else { return (NONE.into(), f64::NAN) };
    let words = if body.rhythms > 0 { frame.words(body) } else { body.law.in_words().into() };
    (words, frame.clock.outer(body.since))
}

/// Whether a motion is of the planted kind; a push must be seen, a law that holds from later on is no other kind. What
/// flies may turn about a point off the middle of its Gaussians: planted bodies turn about their origin, beside which
/// they have parts, and a middle is that of what cameras see.
fn is_right(law: Planted, words: &str, since: f64) -> bool {
    let own = match law {
        Planted::Slide => "moves evenly",
        Planted::Brake | Planted::Throw => "accelerates evenly",
        Planted::Tumble | Planted::Pushed | Planted::Lopsided => "accelerates and rotates evenly",
        Planted::Drift => "moves and rotates evenly",
        Planted::Spin | Planted::Orbit => "rotates evenly about a pivot",
        Planted::SpinUp | Planted::Hinge => "rotates about a pivot, ever faster or slower",
        Planted::SpinDown => "rotates about a pivot and spins down",
        Planted::Pendulum => "swings about a pivot",
        Planted::DyingPendulum => "swings about a pivot, ever less",
        Planted::Spring => "sways",
    };
    words.trim_end_matches(" about a point off its middle") == own && (law != Planted::Pushed || since > UNCHANGED)
}

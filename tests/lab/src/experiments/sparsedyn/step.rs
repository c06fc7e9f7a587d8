//! May frame rate and integration step change after training? A motion is a property of the scene and not of the step
//! with which it was learned.

use anyhow::Result;
use glam::DVec3;
use gs_models::sparsedyn::RolloutOptions;
use gs_pipelines::sparsedyn::Sparsedyn;
use gs_worlds::extrapolation::World;

use super::trial::{Film, SEEN, means, positions, scores, small, trial};
use crate::experiments::lab::Session;
use crate::experiments::{Findings, Lab, Series, largest};

/// Ways to move: rigid bodies with laws; the field asked once; the field asked at every stage by the midpoint rule (Eq.
/// 4).
const MODES: [(&str, &[&str]); 3] = [
    ("bodies", &["bodies.mode=bodies"]),
    ("field, asked once", &["bodies.mode=field"]),
    ("field, asked at every stage", &["bodies.mode=field", "dynamics.ask=stage", "dynamics.integrator=rk2"]),
];

/// Factors of the step.
const FACTORS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

/// Largest change of a position at the end with half or twice the step, shares of the distance that the fastest
/// Gaussian goes: the 1 % of the step rule.
const POSITION_BOUND: f64 = 0.01;

/// Largest change of PSNR likewise, dB: it shows in no comparison.
const PSNR_BOUND: f64 = 0.1;

/// Every so many frames are asked for at a lower frame rate.
const SLOWER: usize = 4;

/// Times asked for.
const TIMES: usize = 24;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let film = Film::of(lab, &small(World::Fan))?;
    let future = film.future(SEEN, 1.0);
    let (mut by_position, mut by_psnr, mut by_rate) = (Vec::new(), Vec::new(), Vec::new());
    for (name, changes) in MODES {
        let trial = trial(lab, film.until(SEEN), changes)?;
        let mut session = trial.trained(lab)?;
        by_rate.push(rate_changes(&session));
        let own = session.fit.trainer.method().options;
        let (mut ends, mut psnr) = (Vec::new(), Vec::new());
        for factor in FACTORS {
            set(&mut session, RolloutOptions { step: factor * own.step, ..own });
            ends.push(positions(&session, &[1.0]).remove(0));
            psnr.push(means(&scores(lab, &session, &future))[0]);
        }
        set(&mut session, own);
        let first = positions(&session, &[0.0]).remove(0);
        let way = farthest(&first, &ends[2]);
        let moved: Vec<f64> = ends.iter().map(|end| farthest(end, &ends[2]) / way).collect();
        let changed: Vec<f64> = psnr.iter().map(|value| (value - psnr[2]).abs()).collect();
        let what =
            format!("{name}: largest change of a position with half or twice the step, shares of the farthest way");
        found.at_most(what, moved[1].max(moved[3]), POSITION_BOUND, "");
        let what = format!("{name}: change of PSNR with half or twice the step");
        found.at_most(what, changed[1].max(changed[3]), PSNR_BOUND, "dB");
        let [quarter, four] = [0, 4].map(|index| (moved[index], psnr[index]));
        found.note(format!(
            "{name}: {:.2} dB with its own step; a quarter of it {:.2} dB and positions off by {:.1e}, four times \
             {:.2} dB and {:.1e}.",
            psnr[2], quarter.1, quarter.0, four.1, four.0
        ));
        let points = |values: &[f64]| -> Vec<(f64, f64)> {
            FACTORS.iter().map(|f| f.log2()).zip(values.iter().copied()).collect()
        };
        let logs: Vec<f64> = moved.iter().map(|share| share.max(1e-7).log10()).collect();
        by_position.push(Series::line_and_dots(name, points(&logs)));
        by_psnr.push(Series::line_and_dots(name, points(&psnr)));
    }
    let what = format!("largest change of a position when every {SLOWER}th frame is asked for alone");
    found.zero(what, largest(by_rate), "");
    let x = "log2 of the step, steps of training";
    let y = "log10 of the change, shares of the way";
    found.chart("position", "Another step after training: positions at the end", [x, y], by_position);
    found.chart("psnr", "Another step after training: photos of the future", [x, "PSNR, dB"], by_psnr);
    Ok(())
}

fn set(session: &mut Session<Sparsedyn>, options: RolloutOptions) {
    session.fit.trainer.change_method(|method| Sparsedyn { options, ..method });
}

/// The largest change of a position at the times of a lower frame rate.
fn rate_changes(session: &Session<Sparsedyn>) -> f64 {
    let times: Vec<f64> = (0..TIMES).map(|frame| frame as f64 / TIMES as f64).collect();
    let slower: Vec<f64> = times.iter().copied().step_by(SLOWER).collect();
    let (all, few) = (positions(session, &times), positions(session, &slower));
    all.iter().step_by(SLOWER).zip(&few).map(|(all, few)| farthest(all, few)).fold(0.0, f64::max)
}

/// The largest distance between two positions of one Gaussian.
fn farthest(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

//! Experiments at the edge of the method. Each criterion keeps its bound or is a *known miss*, listed here with the experiment's bound; a
//! miss that is repaired fails its test until it is taken off the list, so the list stays true.
//!
//! Tests run the small version of an experiment, some of which are too short to say what the experiment asks. The full ones take minutes:
//! `cargo test --release -p gs-train --test stability -- --ignored`; docs/stability has their figures.

use std::path::Path;

use super::device;
use crate::experiments::taylormode::EXPERIMENTS;
use crate::experiments::{Criterion, Outcome, Request, run};

fn experiment(folder: &Path, name: &str, quick: bool) -> Outcome {
    run("taylormode", &EXPERIMENTS, &request(folder, name, quick)).expect("the experiment runs").remove(0)
}

fn request(folder: &Path, name: &str, quick: bool) -> Request {
    Request { out: folder.into(), only: vec![name.into()], data: None, quick, device: device(), quiet: true }
}

/// A small version, whose files nobody looks at.
fn quick(name: &str) -> Outcome {
    let folder = tempfile::tempdir().expect("a folder");
    experiment(folder.path(), name, true)
}

/// The experiment itself.
fn full(name: &str) -> Outcome {
    let folder = tempfile::tempdir().expect("a folder");
    experiment(folder.path(), name, false)
}

/// A bound that an experiment does not keep.
struct KnownMiss<'a> {
    /// Part of the criterion's description.
    what: &'a str,
    /// The bound that the experiment asks.
    bound: &'static str,
    /// How far off it may be: what was measured when it was listed, with some room. It guards against worse and is no aim.
    no_worse: f64,
}

fn known_miss<'a>(what: &'a str, bound: &'static str, no_worse: f64) -> KnownMiss<'a> {
    KnownMiss { what, bound, no_worse }
}

/// Every criterion keeps its bound but the known misses, which miss it.
fn holds(outcome: &Outcome, misses: &[KnownMiss]) {
    let mut listed = vec![false; misses.len()];
    for criterion in &outcome.criteria {
        let Criterion { what, bound, passed, .. } = criterion;
        let (name, shown) = (&outcome.name, criterion.shown());
        let Some(at) = misses.iter().position(|miss| what.contains(miss.what)) else {
            assert!(passed, "{name}: {what}: expected {bound}, found {shown}");
            continue;
        };
        let KnownMiss { bound: known, no_worse, .. } = &misses[at];
        listed[at] = true;
        assert_eq!(bound, known, "{name}: {what}: the experiment asks something else now");
        assert!(!passed, "{name}: {what}: {shown} keeps {bound}: no miss any more, take it off the list");
        let value = criterion.value.unwrap_or_else(|| panic!("{name}: {what} was not measured"));
        let is_worse = if bound.starts_with("at most") { value > *no_worse } else { value < *no_worse };
        assert!(!is_worse, "{name}: {what}: {shown} is worse than the known miss of {no_worse}");
    }
    for (miss, listed) in misses.iter().zip(listed) {
        assert!(listed, "{}: no criterion on {:?}", outcome.name, miss.what);
    }
}

/// The value of the first criterion whose description contains `part`.
fn value(outcome: &Outcome, part: &str) -> f64 {
    let criterion = outcome.criteria.iter().find(|criterion| criterion.what.contains(part));
    let criterion = criterion.unwrap_or_else(|| panic!("{}: no criterion on {part:?}", outcome.name));
    criterion.value.unwrap_or_else(|| panic!("{}: {part:?} was not measured", outcome.name))
}

/// Arithmetic alone, so the small version is the full one.
#[test]
fn no_order_leaves_its_window_worse_than_a_line() {
    holds(
        &quick("divergence"),
        &[
            // 1.7 % of the object: it turns round in no time, and the shortest contact that frames show is an eighth of their interval.
            known_miss("bounce: largest error inside the window", "at most 0.01", 0.018),
            // 1.62 times, by the bounce at order 5: eleven unknowns for sixteen frames. Every other path keeps 1.1.
            known_miss("the same with the remainder", "at most 1.1", 1.7),
        ],
    );
}

#[test]
fn the_report_is_one_file_that_says_what_was_missed() {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = experiment(folder.path(), "divergence", true);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("written");
    let page = read("stability.html");
    assert!(page.contains("<svg") && !page.contains("src=\"http"), "figures are inside, and nothing is fetched");
    let missed = outcome.criteria.iter().any(|criterion| !criterion.passed);
    assert_eq!(page.contains("(a bound is missed)"), missed);
    assert_eq!(read("divergence-bounce.svg").contains("(a bound is missed)"), missed);
    // Its own files may be written over.
    experiment(folder.path(), "divergence", true);
    let json: serde_json::Value = serde_json::from_str(&read("results.json")).expect("JSON");
    assert_eq!(json["experiments"][0]["criteria"].as_array().map(Vec::len), Some(outcome.criteria.len()));
}

#[test]
fn nothing_is_thrown_away_at_any_scale() {
    let outcome = quick("thrown");
    holds(&outcome, &[]);
    assert!(value(&outcome, "farthest") > 0.0, "nothing moved");
}

#[test]
fn enough_instants_form_the_exposure() {
    let outcome = quick("samples");
    holds(&outcome, &[]);
    assert!(value(&outcome, "mean difference") > 0.0, "nothing is blurred");
}

/// The points of a figure's series.
fn points(outcome: &Outcome, figure: &str, series: &str) -> Vec<(f64, f64)> {
    let figure = outcome.figures.iter().find(|found| found.file == figure).expect("the figure is drawn");
    let series = figure.chart.series.iter().find(|found| found.name() == series);
    series.unwrap_or_else(|| panic!("a series of {}", figure.file)).points().to_vec()
}

/// In a hundred steps from minus the velocity; with two frames most turn round, with one it is the start that decides.
#[test]
fn one_frame_has_no_direction_and_two_have() {
    // 74 % here; a hundred steps are a tenth of what the experiment takes.
    holds(&quick("direction"), &[known_miss("two or more frames", "at least 99", 60.0)]);
}

#[test]
#[ignore = "trains fifteen times: minutes"]
fn two_frames_tell_the_direction_and_one_does_not() {
    holds(
        &full("direction"),
        &[
            // 97.5 % at worst, with five frames; one frame leaves 38 % after the same start.
            known_miss("0.8 pixels a frame", "at least 99", 90.0),
            known_miss("1.7 pixels a frame", "at least 99", 90.0),
            // 60 %: the nearest match of the texture is the wrong one.
            known_miss("3.3 pixels a frame", "at least 99", 50.0),
        ],
    );
}

/// Sixty steps find no exposure; but they go towards it from either side, and along constant exposure times speed it is the other
/// frames that object, as the method assumes.
#[test]
fn neighbouring_frames_tell_exposure_from_speed() {
    let outcome = quick("exposure");
    let found = points(&outcome, "exposure-found.svg", "exposure");
    // From above it is slow to begin with: what is formed too blurry is first met by a sharper scene.
    assert!(found[0].1 > 0.55 && found[1].1 < 2.0, "exposures over truth, begun at 0.5 and 2: {found:?}");
    let ends = |series: &str| {
        let valley = points(&outcome, "exposure-valley.svg", series);
        [valley[0].1, valley[valley.len() - 1].1]
    };
    let (one, all) = (ends("the frame at t0 alone"), ends("all frames"));
    // An octave off, first-order blur is the same in one frame; two frames are misplaced by half the motion.
    assert!(one.iter().all(|ratio| *ratio <= 1.02), "one frame, an octave off: {one:?} times the least difference");
    assert!(all.iter().all(|ratio| *ratio >= 1.1), "all frames, an octave off: {all:?} times the least difference");
    holds(
        &outcome,
        &[
            // 49 and 75 %, from starts that are 50 and 100 % off.
            known_miss("error of exposure times speed", "at most 2", 60.0),
            known_miss("error of the exposure over all starts", "at most 5", 95.0),
        ],
    );
}

#[test]
#[ignore = "trains five times: minutes"]
fn the_exposure_is_found_from_any_start() {
    holds(
        &full("exposure"),
        &[
            // 8.9 %: speeds are 4 % low, and exposures 3 % short, because a scene of few Gaussians is a little blurry itself.
            known_miss("error of exposure times speed", "at most 2", 11.0),
            // 7.4 % from four times the truth, for which 1600 steps are too few; at most 4.8 % from the other starts.
            known_miss("error of the exposure over all starts", "at most 5", 9.0),
        ],
    );
}

/// Photos that were sharp stay sharp for sixty steps. These are too few for a blur model to eat a scene; see the full version.
#[test]
fn sharp_photos_stay_sharp_at_first() {
    let outcome = quick("absorb");
    // Sixty steps make no scene sharp enough for blur to matter: 0.1 dB is noise.
    let blurry = known_miss("integrate: sharp PSNR of moving parts", "at least 0", -0.2);
    // 0.13 dB, as in the full version: the exact formation has to find that the exposure is none.
    let sharp = known_miss("integrate, sharp photos: PSNR of moving parts", "at least -0.1", -0.25);
    holds(&outcome, &[blurry, sharp]);
}

#[test]
#[ignore = "trains six times: a minute or more"]
fn no_blur_model_eats_a_sharp_scene() {
    // 0.86 dB, and 0.34 at the published rates: the exact formation has to find there that the exposure is none.
    let miss = known_miss("integrate, sharp photos: PSNR of moving parts", "at least -0.1", -1.0);
    holds(&full("absorb"), &[miss]);
}

/// Scale and shift of a depth prior do not show where they are fitted; believed as they are, they show more.
#[test]
fn affine_errors_of_depth_are_fitted_away() {
    let outcome = quick("depth");
    holds(&outcome, &[]);
    let aligned = value(&outcome, "affine error");
    let believed = points(&outcome, "depth.svg", "affine in depth, not aligned");
    let change = (believed[1].1 - believed[0].1).abs();
    assert!(change > aligned, "believed, wrong depth changes PSNR by {change} dB, aligned by {aligned}");
}

#[test]
fn masks_may_be_two_pixels_wrong() {
    holds(&quick("masks"), &[]);
}

/// Of two speeds, none and one, after forty steps: too few to lose much. The full version climbs to 75 pixels.
#[test]
fn forming_blur_harms_neither_moving_nor_still_things_at_first() {
    holds(&quick("speed"), &[]);
}

#[test]
#[ignore = "trains twelve times: minutes"]
fn forming_blur_harms_neither_moving_nor_still_things() {
    // 0.6 dB at 50 pixels, where neither model finds the moving parts; it gains 2.2 dB at 6 and 1.6 at 13.
    let miss = known_miss("gain over no blur model in moving parts", "at least -0.1", -0.8);
    holds(&full("speed"), &[miss]);
}

/// Resets come after 60 and 120 steps, and looks every 15: before the next reset a scene is as good again as it was before the last.
#[test]
fn opacities_recover_from_a_reset() {
    let mut outcome = quick("opacity");
    // The final quality of so short a run scatters by 0.3 dB from backend to backend; the full version judges it.
    outcome.criteria.retain(|criterion| !criterion.what.contains("PSNR with decay"));
    holds(&outcome, &[]);
    for scene in ["moving", "sharp", "still"] {
        let fall = value(&outcome, &format!("{scene}: longest fall"));
        assert!(fall > 0.0 && fall <= 45.0, "{scene}: down for {fall} steps of the 60 from one reset to the next");
        let curve = points(&outcome, &format!("opacity-{scene}.svg"), "reset");
        let at = |step: f64| curve.iter().find(|(x, _)| *x == step).expect("a look").1;
        for (before, reset, after) in [(45.0, 60.0, 105.0), (105.0, 120.0, 165.0)] {
            let [was, low, is] = [before, reset, after].map(at);
            assert!(low < was - 10.0, "{scene}: {was} dB at step {before}, {low} dB after the reset at {reset}");
            // Single looks scatter by 0.2 dB.
            assert!(is > was - 0.5, "{scene}: {was} dB at step {before}, {is} dB again at {after}");
        }
    }
}

#[test]
#[ignore = "trains nine times: minutes"]
fn no_opacity_policy_costs_more_than_resets() {
    holds(
        &full("opacity"),
        &[
            // 0.29 dB in the moving scene, 0.45 in the still one; none lets a scene fall for long.
            known_miss("moving: PSNR with decay", "at least -0.1", -0.5),
            known_miss("still: PSNR with decay", "at least -0.1", -0.7),
        ],
    );
}

#[test]
fn a_name_that_is_none_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let request = request(folder.path(), "directions", true);
    let message = run("taylormode", &EXPERIMENTS, &request).expect_err("unknown").to_string();
    assert!(message.contains("directions") && message.contains("direction"), "{message}");
}

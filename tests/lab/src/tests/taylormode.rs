//! Experiments at the limits of TaylorMoDe-GS.

use super::misses::{QUICK, holds};
use super::{all_hold, experiment, points, quick, value};

/// Experiments with tests of their own.
const OWN: [&str; 5] = ["thrown", "samples", "exposure", "depth", "opacity"];

#[test]
fn small_versions_keep_their_bounds() {
    all_hold("taylormode", &OWN);
}

#[test]
fn the_report_is_one_file_that_says_what_was_missed() {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = experiment(folder.path(), ("taylormode", "divergence"), true).expect("it runs");
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("written");
    let page = read("stability.html");
    assert!(page.contains("<svg") && !page.contains("src=\"http"), "figures are inside, and nothing is fetched");
    let missed = outcome.criteria.iter().any(|criterion| !criterion.passed);
    assert_eq!(page.contains("(a bound is missed)"), missed);
    assert_eq!(read("divergence-bounce.svg").contains("(a bound is missed)"), missed);
    // Its own files may be written over.
    experiment(folder.path(), ("taylormode", "divergence"), true).expect("it runs");
    let json: serde_json::Value = serde_json::from_str(&read("results.json")).expect("JSON");
    assert_eq!(json["experiments"][0]["criteria"].as_array().map(Vec::len), Some(outcome.criteria.len()));
}

#[test]
fn steps_move_little_and_blur_needs_few_instants() {
    for (name, part) in [("thrown", "farthest"), ("samples", "mean difference")] {
        let outcome = quick("taylormode", name);
        holds(&outcome, QUICK);
        assert!(value(&outcome, part) > 0.0, "{name}: nothing moved or is blurred");
    }
}

/// Sixty steps find no exposure; but they go towards it from either side, and along constant exposure times speed it is
/// the other frames that object, as the method assumes.
#[test]
fn neighbouring_frames_tell_exposure_from_speed() {
    let outcome = quick("taylormode", "exposure");
    let found = points(&outcome, "exposure-found.svg", "exposure");
    // From above it is slow to begin with: what is formed too blurry is first met by a sharper scene.
    assert!(found[0].1 > 0.65 && found[1].1 < 1.75, "exposures over truth, begun at 0.5 and 2: {found:?}");
    let ends = |series: &str| {
        let valley = points(&outcome, "exposure-valley.svg", series);
        [valley[0].1, valley[valley.len() - 1].1]
    };
    let (one, all) = (ends("the frame at t0 alone"), ends("all frames"));
    // An octave off, first-order blur is the same in one frame; two frames are misplaced by half the motion.
    assert!(one.iter().all(|ratio| *ratio <= 1.02), "one frame, an octave off: {one:?} times the least difference");
    assert!(all.iter().all(|ratio| *ratio >= 1.1), "all frames, an octave off: {all:?} times the least difference");
    holds(&outcome, QUICK);
}

/// Scale and shift of a depth prior do not show where they are fitted; believed as they are, they show more.
#[test]
fn affine_errors_of_depth_are_fitted_away() {
    let outcome = quick("taylormode", "depth");
    holds(&outcome, QUICK);
    let aligned = value(&outcome, "affine error");
    let believed = points(&outcome, "depth.svg", "affine in depth, not aligned");
    let change = (believed[1].1 - believed[0].1).abs();
    assert!(change > aligned, "believed, wrong depth changes PSNR by {change} dB, aligned by {aligned}");
}

/// Resets come after 60 and 120 steps, and looks every 15: before the next reset a scene is as good again as it was
/// before the last.
#[test]
fn opacities_recover_from_a_reset() {
    let outcome = quick("taylormode", "opacity");
    holds(&outcome, QUICK);
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

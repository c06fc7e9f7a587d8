//! `gsburn bench --launches`: what a training step asks of a GPU, counted on a software one.
#![cfg(any(feature = "wgpu", feature = "vulkan"))]

use std::process::Command;

/// Most launches of a step of `static`: each takes 5 to 15 microseconds on CUDA and up to 40 through wgpu, and a step of 100,000
/// Gaussians at 640 x 480 has about one millisecond of work.
const MOST: usize = 80;

/// Classic density control also gathers the gradients on the screen.
const MOST_WITH_SCREEN: usize = 92;

#[test]
fn a_step_has_few_launches_and_no_serial_one() {
    let device = if cfg!(feature = "wgpu") { "wgpu" } else { "vulkan" };
    let arguments = ["bench", "--launches", "--gaussians", "100000", "--device", device];
    let output = Command::new(env!("CARGO_BIN_EXE_gsburn")).args(arguments).output().expect("the program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    for (strategy, most) in [("mcmc", MOST), ("default", MOST_WITH_SCREEN)] {
        let heading = format!("density.strategy = {strategy}: ");
        let (_, counts) = text.split_once(&heading).unwrap_or_else(|| panic!("no `{heading}` in\n{text}"));
        let mut words = counts.split_whitespace();
        let launches: usize = words.next().and_then(|n| n.parse().ok()).expect("a number of launches");
        let serial = words.nth(1).expect("a number of serial launches");
        assert!((20..=most).contains(&launches), "{launches} launches, at most {most}:\n{text}");
        assert_eq!(serial, "0", "{text}");
    }
}

//! `gsburn bench --launches`: what a training step asks of a GPU, counted on a software one.

use std::process::Command;

/// Most launches of a step of `static`, MCMC or classic: each takes 5 to 15 microseconds on CUDA and up to 40 through
/// wgpu, and a step of 100,000 Gaussians at 640 x 480 has about one millisecond of work.
const MOST: usize = 80;

/// The exact exposure: motion, rows, copies and their backward as tensors of all instants, whatever their number. It
/// had 865 when each instant had its own, and 246 when the lists of tiles were made on the host, for which the GPU
/// waited; the kernels that make them are 45 launches.
const MOST_INTEGRATED: usize = 291;

/// The paper's warp: depth, velocity, path and weights at the moving pixels.
const MOST_WARPED: usize = 459;

/// A product of small matrices and a sum in the warp's networks, whose launches have one and two cubes.
const SERIAL_WARPED: usize = 2;

#[test]
fn a_step_has_few_launches_and_no_serial_one() {
    let device = if cfg!(feature = "wgpu") { "wgpu" } else { "vulkan" };
    let arguments = ["bench", "--launches", "--gaussians", "100000", "--device", device];
    let output = Command::new(env!("CARGO_BIN_EXE_gsburn")).args(arguments).output().expect("the program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    for (step, most, most_serial) in [
        ("density.strategy = mcmc", MOST, 0),
        ("density.strategy = default", MOST, 0),
        ("blur.mode = integrate", MOST_INTEGRATED, 0),
        ("blur.mode = warp", MOST_WARPED, SERIAL_WARPED),
    ] {
        let heading = format!("{step}: ");
        let (_, counts) = text.split_once(&heading).unwrap_or_else(|| panic!("no `{heading}` in\n{text}"));
        let mut words = counts.split_whitespace();
        let launches: usize = words.next().and_then(|n| n.parse().ok()).expect("a number of launches");
        let serial: usize = words.nth(1).and_then(|n| n.parse().ok()).expect("a number of serial launches");
        let waits: usize = words.nth(1).and_then(|n| n.parse().ok()).expect("a number of waits");
        assert_eq!(waits, 0, "{step}: a step waits for a list:\n{text}");
        assert!((20..=most).contains(&launches), "{step}: {launches} launches, at most {most}:\n{text}");
        assert!(serial <= most_serial, "{step}: {serial} serial launches, at most {most_serial}:\n{text}");
    }
}

//! Training does not grow: tensors that never reach a backward pass, or a graph that outlives its step, would add up.

use std::process::Command;

use gs_burn::render;
use gs_tests::devices::singles;
use gs_tests::fit::{Fit, RATES};
use gs_tests::scenes::Scene;
use gs_tests::tolerance::values;

const STEPS: usize = 2000;
/// Steps until allocator, threads and caches have what they need.
const WARM_UP: usize = 500;
/// Growth allowed over the rest, bytes. A step handles about 100 kB, so a leak of a twentieth of it would exceed this.
const ALLOWED: i64 = 8 << 20;

/// Resident memory of this process, bytes; none where the system does not tell.
fn resident() -> Option<i64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<i64>().ok()? << 10)
}

/// In a process of its own, because other tests would show in its memory.
#[test]
fn two_thousand_steps_take_no_more_memory_than_five_hundred() {
    if resident().is_none() {
        println!("skipped: no /proc/self/status on this system");
        return;
    }
    let program = std::env::current_exe().expect("this program");
    let alone = ["--ignored", "--exact", "--nocapture", "memory::steps_alone"];
    let output = Command::new(program).args(alone).output().expect("the program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(text.contains("1 passed"), "the test was not found:\n{text}");
}

#[test]
#[ignore = "run by the test above, alone in a process"]
fn steps_alone() {
    // A GPU's memory is not the process's, and software GPUs need minutes for this many steps.
    for place in singles().iter().filter(|place| ["flex", "ndarray"].iter().any(|cpu| place.name.starts_with(cpu))) {
        let scene = Scene::random(60, 1);
        let leaves = scene.leaves(place);
        let camera = scene.camera(leaves.viewmat.clone().inner());
        let options = scene.options(false);
        let target = render(&leaves.gaussians(), &camera, &options).color.inner() * 0.5 + 0.25;
        let mut fit = Fit::new(&leaves.gaussians(), RATES);
        let mut start = 0;
        for step in 0..STEPS {
            if step == WARM_UP {
                start = resident().unwrap();
            }
            let loss = fit.step(&camera, &options, &target);
            if step % 100 == 0 {
                assert!(values(&loss)[0].is_finite());
            }
        }
        let growth = resident().unwrap() - start;
        println!("{}: {} kB more after {} steps", place.name, growth >> 10, STEPS - WARM_UP);
        assert!(growth < ALLOWED, "{}: {} kB more after {} steps", place.name, growth >> 10, STEPS - WARM_UP);
    }
}

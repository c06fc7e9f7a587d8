//! It resumes to the same bits.

use std::path::Path;

use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_train::parameters::to_host;
use gs_train::run::{Ending, RunRequest, run};

use crate::{STEPS, common, request, tiny_world, written};

/// Interrupted twice, and on one thread: the same checkpoint.
fn resumes_to_the_same_bits(more: &[&str]) {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    resumes_on(&tiny_world(folder), folder, more);
}

/// The folder is left with the runs in it.
fn resumes_on(world: &Path, folder: &Path, more: &[&str]) {
    let checkpoint =
        |request: &RunRequest| std::fs::read(request.folder.checkpoint(STEPS)).expect("the last checkpoint");
    let whole = request(world, &folder.join("whole"), more);
    common::finish(&whole);

    let mut resumed = request(world, &folder.join("resumed"), more);
    for stop in [13, 27] {
        resumed.stop_at = Some(stop);
        assert!(matches!(run(&resumed), Ok(Ending::Interrupted(step)) if step == stop));
        resumed.resume = true;
    }
    resumed.stop_at = None;
    common::finish(&resumed);
    assert!(checkpoint(&whole) == checkpoint(&resumed), "the resumed run differs");

    let one_thread = request(world, &folder.join("one"), more);
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool").install(|| common::finish(&one_thread));
    assert!(checkpoint(&whole) == checkpoint(&one_thread), "one thread gives other bits");
}

#[test]
fn the_exact_formation_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["motion.remainder=on"]);
}

#[test]
fn the_warp_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["blur.mode=warp", "blur.decouple=true"]);
}

/// A bounce, with its contact, the common motion, and interruptions on both sides of where the exposure begins to be learned.
#[test]
fn a_bounce_resumes_to_the_same_bits() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = folder.join("bounce");
    let options = DeblurOptions {
        world: World::Sphere,
        width: 96,
        height: 72,
        cameras: 6,
        held_out: 1,
        frames: 14,
        subframes: 16,
        ..DeblurOptions::default()
    };
    deblur::write(&world, &options, |_, _| {}).expect("the world is written");
    resumes_on(&world, folder, &["blur.exposure_from=0.6"]);
    let loaded = gs_train::export::load_scene(&folder.join("whole"), &common::device()).expect("a scene");
    let state = loaded.motion.as_ref().expect("a moving scene");
    assert!(!state.contacts.is_empty() && state.bodies.len() == 1 && state.exposure_said);
    let jumps = to_host(state.kinks.value.clone());
    assert_eq!(jumps.len(), 3 * state.contacts.len() * state.rows.len());
    assert!(jumps.iter().any(|jump| *jump != 0.0), "nothing jumps");
    assert!((state.exposure() - options.exposure_time()).abs() > 1e-6, "the exposure was never learned");
    let times = loaded.times(3);
    assert!(times[0] == 0.0 && times[2] == 1.0, "the recording is from 0 to 1, not {times:?}");
}

/// Two bodies that move apart have a path and a common motion each.
#[test]
fn a_pair_resumes_to_the_same_bits() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = written(folder, DeblurOptions { world: World::Pair, ..DeblurOptions::default() });
    resumes_on(&world, folder, &[]);
    let loaded = gs_train::export::load_scene(&folder.join("whole"), &common::device()).expect("a scene");
    let bodies = loaded.motion.expect("a moving scene").bodies;
    assert_eq!(bodies.len(), 2);
    let moved = |body: &gs_train::taylormode::collective::Collective| to_host(body.sum.value.clone());
    assert!(bodies.iter().all(|body| moved(body).iter().any(|x| *x != 0.0)), "a body never moved as one");
    assert_ne!(moved(&bodies[0]), moved(&bodies[1]));
}

//! It resumes to the same bits.

use std::path::Path;

use gs_models::taylormode::Body;
use gs_pipelines::fit::read_model;
use gs_pipelines::load_scene;
use gs_pipelines::taylormode::Taylormode;
use gs_train::fit::parameters::to_host;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::watch::Job;
use gs_worlds::deblur::{self, DeblurOptions, World};

use crate::common;
use crate::taylormode::{STEPS, job, tiny_world, written};

/// Interrupted twice, and on one thread: the same checkpoint.
fn resumes_to_the_same_bits(more: &[&str]) {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    resumes_on(&tiny_world(folder), folder, more);
}

/// The folder is left with the runs in it.
fn resumes_on(world: &Path, folder: &Path, more: &[&str]) {
    let whole = job(world, &folder.join("whole"), more);
    common::finish(&whole);
    let resumed = job(world, &folder.join("resumed"), more);
    common::finish_interrupted(&resumed, &[13, 27]);
    assert!(last_checkpoint(&whole) == last_checkpoint(&resumed), "the resumed run differs");

    let one_thread = job(world, &folder.join("one"), more);
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool").install(|| common::finish(&one_thread));
    assert!(last_checkpoint(&whole) == last_checkpoint(&one_thread), "one thread gives other bits");
}

fn last_checkpoint(job: &Job) -> Vec<u8> {
    std::fs::read(job.folder.checkpoint(STEPS)).expect("the last checkpoint")
}

/// The tensors that the run in `folder` learned beside the Gaussians.
fn learned(folder: &Path) -> Taylormode {
    let run = gs_train::run::folder::RunFolder::at(folder);
    let file = Checkpoint::load(&run.checkpoint(STEPS)).expect("loads");
    read_model::<Taylormode>(&file, &common::device()).expect("a moving scene").0.method
}

#[test]
fn the_exact_formation_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["motion.remainder=on"]);
}

#[test]
fn the_warp_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["blur.mode=warp", "blur.decouple=true"]);
}

/// A bounce, with its contact, the common motion, and interruptions on both sides of where the exposure begins to be
/// learned.
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
    let state = learned(&folder.join("whole"));
    let motion = &state.motion;
    assert!(!motion.contacts().is_empty() && motion.bodies.len() == 1 && state.stated_exposure.is_some());
    let jumps = to_host(motion.kinks.as_ref().expect("kinks").jumps.val());
    assert_eq!(jumps.len(), 3 * motion.contacts().len() * motion.rows.len());
    assert!(jumps.iter().any(|jump| *jump != 0.0), "nothing jumps");
    assert!((state.exposure_on_host() - options.exposure_time()).abs() > 1e-6, "the exposure was never learned");
    let times = load_scene(&folder.join("whole"), &common::device()).expect("a scene").times(3);
    assert!(times[0] == 0.0 && times[2] == 1.0, "the recording is from 0 to 1, not {times:?}");
}

/// Two bodies that move apart have a path and a common motion each.
#[test]
fn a_pair_resumes_to_the_same_bits() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = written(folder, DeblurOptions { world: World::Pair, ..DeblurOptions::default() });
    resumes_on(&world, folder, &[]);
    let bodies = learned(&folder.join("whole")).motion.bodies;
    assert_eq!(bodies.len(), 2);
    let moved = |body: &Body| to_host(body.blocks.val());
    assert!(bodies.iter().all(|body| moved(body).iter().any(|x| *x != 0.0)), "a body never moved as one");
    assert_ne!(moved(&bodies[0]), moved(&bodies[1]));
}

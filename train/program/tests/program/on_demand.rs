//! Photos larger than `data.memory_mb` are decoded when they are asked for, and train the same bits.

use std::fs;
use std::path::Path;

use crate::common;

/// The finished scene and its figures of runs with all photos in memory and with none; photos have half their width in
/// the first steps.
fn assert_same_bits(folder: &Path, scene: &Path, more: &[&str]) {
    let run = |name: &str, memory: &str| {
        let keys = ["data.coarse_share=0.3", "density.start=4", "density.every=10", memory];
        let job = common::job(scene, &folder.join(name), &common::config(30, &[&keys[..], more].concat()));
        let eval = common::finish(&job);
        let views = format!("{:?}", eval.last.measured.quality.views);
        (fs::read(job.folder.ply()).expect("scene.ply"), views)
    };
    let (whole, asked) = (run("whole", "data.memory_mb=100"), run("asked", "data.memory_mb=0"));
    assert!(whole.0 == asked.0, "the scene differs");
    assert_eq!(whole.1, asked.1);
}

#[test]
fn photos_that_are_decoded_when_asked_for_train_the_same_bits() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = common::still_scene(folder, (400, 60));
    assert_same_bits(folder, &scene, &["init.dense_share=0.9", "density.cap=400", "density.prune_share=0.01"]);
}

/// Depth priors are read with the photo, pixels that show a region are found then, and moving parts of held-out photos
/// are measured by masks of theirs.
#[test]
fn priors_and_regions_come_with_the_photo() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = common::video(folder);
    let region = "data.region=[-0.6, -0.6, -0.6, 0.6, 0.6, 0.6]";
    assert_same_bits(folder, &scene, &["correction.mode=gain", "correction.per=camera", region]);
}

//! Checkpoints: what is read is what was written, and what is damaged says so in one sentence.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use gs_datasets::synthetic::deblur::{self, DeblurOptions};
use gs_train::checkpoint::Checkpoint;
use gs_train::data::Fingerprint;
use gs_train::parameters::Group;
use gs_train::step::Trainer;

/// A checkpoint on disk and what it holds.
fn saved(folder: &Path) -> (PathBuf, Checkpoint) {
    let config = common::config(10, &["density.strategy=default"]);
    let dataset = common::tiny_scene(folder);
    let scene = config.load(&dataset).expect("loads");
    let mut trainer = Trainer::begin(&scene, None, &config, &common::device());
    let photo = gs_train::data::Photos::new(&scene.train, &common::device(), 0).get(0);
    trainer.step(&photo, &config);
    trainer.extent = 1.0 / 3.0;
    let views = Some(Fingerprint::of(&scene));
    let checkpoint = Checkpoint { trainer, config, dataset, origin: glam::DVec3::new(0.1, 1e9, -7.0), views };
    let path = folder.join("a.safetensors");
    checkpoint.save(&path).expect("saved");
    (path, checkpoint)
}

#[test]
fn what_is_read_is_what_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, before) = saved(folder.path());
    let after = Checkpoint::load(&path, &common::device()).expect("loads");
    assert_eq!(before.config, after.config);
    assert_eq!((before.origin, &before.dataset, before.views), (after.origin, &after.dataset, after.views));
    let (before, after) = (before.trainer, after.trainer);
    assert_eq!((before.step, before.skipped, before.extent), (after.step, after.skipped, after.extent));
    for group in Group::ALL {
        assert_eq!(before.parameters.read(group), after.parameters.read(group), "{}", group.name());
    }
    assert_eq!(
        fs::read_dir(folder.path()).expect("read").count(),
        2,
        "nothing but the scene and the checkpoint is left"
    );
}

/// Tensors without columns are written too: paths and rotations of order 0.
#[test]
fn motion_of_order_0_is_saved() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let options =
        DeblurOptions { width: 32, height: 24, cameras: 4, held_out: 1, frames: 3, ..DeblurOptions::default() };
    deblur::write(&folder.join("world"), &options, |_, _| {}).expect("the world is written");
    let orders = ["pipeline=taylormode", "motion.order=0", "motion.order_max=0", "motion.rotation_order=0"];
    let config =
        common::config(2, &[&orders[..], &["motion.kinks=0", "motion.remainder=off", "blur.samples=3"]].concat());
    common::finish(&common::request(&folder.join("world"), &folder.join("run"), &config));
    let saved = gs_train::run_folder::RunFolder::at(folder.join("run")).saved();
    let after = Checkpoint::load(&saved[0].1, &common::device()).expect("loads").trainer.motion.expect("it moves");
    assert_eq!((after.position.value.dims()[1], after.rotation.value.dims()[1]), (0, 0));
}

/// The sentence for a file of these bytes.
fn complaint(folder: &Path, bytes: &[u8]) -> String {
    let path = folder.join("bad.safetensors");
    fs::write(&path, bytes).expect("written");
    let error = Checkpoint::load(&path, &common::device()).expect_err("refused").to_string();
    assert!(error.contains("bad.safetensors") && !error.contains('\n'), "{error}");
    error
}

#[test]
fn damage_is_said_in_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, _) = saved(folder.path());
    let bytes = fs::read(path).expect("read");

    for length in [0, 4, 8, 100, bytes.len() / 2, bytes.len() - 1] {
        let error = complaint(folder.path(), &bytes[..length]);
        assert!(error.contains("damaged") || error.contains("expected a gsburn checkpoint"), "{length}: {error}");
    }
    let (whole, half) = (bytes.len(), bytes.len() / 2);
    let said = complaint(folder.path(), &bytes[..half]);
    assert!(said.contains(&format!("damaged: it is cut short, expected {whole} bytes, found {half}")), "{said}");
    assert!(complaint(folder.path(), &[0xff; 5000]).contains("another kind of file"));
    assert!(complaint(folder.path(), b"ply\nformat ascii 1.0\nend_header\n").contains("expected a gsburn checkpoint"));

    let mut flipped = bytes.clone();
    let last = flipped.len() - 1;
    flipped[last] ^= 1;
    assert!(complaint(folder.path(), &flipped).contains("checksum"));

    let mut newer = bytes.clone();
    let (from, to) = (br#"\"version\":\"3\""#, br#"\"version\":\"9\""#);
    let place = newer.windows(from.len()).position(|window| window == from).expect("the version");
    newer[place..place + to.len()].copy_from_slice(to);
    let error = complaint(folder.path(), &newer);
    assert!(error.contains("format 9") && error.contains("another version"), "{error}");
}

#[test]
fn a_write_that_fails_leaves_the_old_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, checkpoint) = saved(folder.path());
    let before = fs::read(&path).expect("read");
    // A folder in the way of the temporary file stands for a disk that refuses.
    fs::create_dir(path.with_extension("part")).expect("made");
    fs::write(path.with_extension("part").join("x"), "x").expect("written");
    let error = checkpoint.save(&path).expect_err("refused").to_string();
    assert!(error.contains("a.safetensors: cannot write the checkpoint"), "{error}");
    assert_eq!(before, fs::read(&path).expect("read"));
}

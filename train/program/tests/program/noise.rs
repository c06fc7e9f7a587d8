//! No held-out pixel reaches what is learned: with noise in their place each pipeline ends with the same bytes.

use std::fs;
use std::path::{Path, PathBuf};

use gs_train::run::watch::Job;
use gs_worlds::extrapolation::World;
use gs_worlds::still::{self, StillOptions};
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::{self, read_json, streets};

const STEPS: usize = 40;

/// Replaces the pixels of the images at `paths` by noise, alpha too.
fn drown(paths: &[PathBuf]) {
    assert!(!paths.is_empty(), "held-out images");
    let mut noise = ChaCha8Rng::seed_from_u64(7);
    for path in paths {
        let mut image = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        match &mut image {
            image::DynamicImage::ImageRgba8(image) => noise.fill_bytes(image),
            image::DynamicImage::ImageRgb8(image) => noise.fill_bytes(image),
            other => panic!("{}: {:?}", path.display(), other.color()),
        }
        image.save(path).expect("written");
    }
}

/// The images that the splits of held-out views name: photos and sharp or blurry truth.
fn held_out_images(set: &Path) -> Vec<PathBuf> {
    let mut paths = Vec::new();
    for split in ["transforms_val.json", "transforms_test.json"].map(|name| set.join(name)) {
        if !split.exists() {
            continue;
        }
        for frame in read_json(&split)["frames"].as_array().expect("frames") {
            let truth = frame["truth"].as_object().into_iter().flatten();
            let named = truth.filter(|(key, _)| key.ends_with("blurry_path")).map(|(_, path)| path);
            let all = named.chain([&frame["file_path"]]).filter_map(|path| path.as_str());
            paths.extend(all.map(|path| set.join(path)).map(|path| match path.extension() {
                Some(_) => path,
                None => path.with_extension("png"),
            }));
        }
    }
    paths
}

/// The checkpoint of a run.
fn learned(job: &Job) -> Vec<u8> {
    common::finish(job);
    fs::read(job.folder.checkpoint(STEPS)).expect("saved")
}

/// Trains on a set, and once more with noise for `images`.
fn same_with_noise(set: &Path, images: impl Fn(&Path) -> Vec<PathBuf>, job: impl Fn(&Path) -> Job) {
    let seen = learned(&job(&set.with_extension("seen")));
    drown(&images(set));
    let blind = learned(&job(&set.with_extension("blind")));
    assert!(seen == blind, "{}: the checkpoints differ", set.display());
}

fn trained(set: &Path, run: &Path, overrides: &[&str]) -> Job {
    let small = ["density.cap=800", "density.start=10", "density.every=10"];
    let all: Vec<&str> = small.into_iter().chain(overrides.iter().copied()).collect();
    common::job(set, run, &common::config(STEPS, &all))
}

#[test]
fn held_out_pixels_reach_no_still_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let set = temporary.path().join("photos");
    let options = StillOptions {
        train_views: 8,
        test_views: 3,
        width: 48,
        height: 36,
        points: 300,
        seed: 1,
        ..StillOptions::default()
    };
    still::write(&set, &options, |_, _| ()).expect("written");
    same_with_noise(&set, held_out_images, |run| trained(&set, run, &[]));
}

#[test]
fn held_out_pixels_reach_no_blurry_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let set = common::video(temporary.path());
    let keys = ["pipeline=taylormode", "motion.points=300", "motion.select_every=10", "data.priors=[]"];
    same_with_noise(&set, held_out_images, |run| trained(&set, run, &keys));
}

#[test]
fn held_out_pixels_reach_no_future() {
    let temporary = tempfile::tempdir().expect("a folder");
    let set = common::future(temporary.path(), World::Duo, (40, 16), 5);
    let keys = ["pipeline=sparsedyn", "data.background=[1.0,1.0,1.0]", "data.priors=[]"];
    same_with_noise(&set, held_out_images, |run| trained(&set, run, &keys));
}

#[test]
fn held_out_pixels_reach_no_network() {
    let temporary = tempfile::tempdir().expect("a folder");
    let set = streets::streets(temporary.path(), 2);
    let images = |set: &Path| {
        let cameras = fs::read_dir(set.join("001/camera")).expect("a log").map(|entry| entry.expect("an entry").path());
        let files = cameras.flat_map(|camera| fs::read_dir(camera).expect("a camera"));
        let files = files.map(|entry| entry.expect("an entry").path());
        files.filter(|path| path.extension().is_some_and(|end| end != "json")).collect()
    };
    same_with_noise(&set, images, |run| streets::job(&set, run, STEPS, &[]));
}

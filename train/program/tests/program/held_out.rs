//! Held-out views: which image is compared, which split is measured, and that nothing inferred is taken for given.

use std::fs;
use std::path::Path;

use gs_pipelines::taylormode::Taylormode;
use gs_pipelines::{EvalRequest, fit, of_checkpoint};
use gs_train::config::tables;
use gs_train::fit::session::Data;
use gs_train::fit::told::{MOVING, Told};
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::evaluate::HeldOut;
use gs_train::run::measured::Measured;
use gs_train::run::scene::SceneFile;

use crate::common::program::gsburn;
use crate::common::{self, read_json};

const STEPS: usize = 120;

const OVERRIDES: [&str; 7] = [
    "pipeline=taylormode",
    "density.start=10",
    "density.every=20",
    "density.cap=1200",
    "motion.points=300",
    "motion.select_every=30",
    "blur.samples=5",
];

/// Held-out photos as a camera takes them: blurry, and nobody knows the sharp ones.
fn without_truth(world: &Path) {
    common::edit(world, "transforms_test.json", |frames| {
        for frame in frames {
            let truth = frame.as_object_mut().expect("a frame").remove("truth").expect("the truth");
            frame["file_path"] = truth["blurry_path"].clone();
        }
    });
}

/// A checkpoint measured on a data set, with `changes` of its configuration.
fn evaluated(checkpoint: &Path, dataset: &Path, changes: &[&str]) -> Measured {
    let file = Checkpoint::load(checkpoint).expect("loads");
    let mut config: toml::Table = file.origin.config.parse().expect("TOML");
    changes.iter().for_each(|change| tables::merge(&mut config, tables::override_layer(change).expect("valid").table));
    let pipeline = of_checkpoint(&file).expect("a pipeline");
    let file = SceneFile::Checkpoint(Box::new(file));
    let device = common::device();
    let request = EvalRequest { file: &file, dataset, config: &config, split: None, device: &device, pictures: false };
    pipeline.evaluate(&request).expect("measured").measured
}

/// A sharp rendering of a scene that is right loses against a blurry photo; the blur that it forms does not.
#[test]
fn blurry_photos_are_compared_with_the_formed_blur() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::video(folder);
    let job = common::job(&world, &folder.join("run"), &common::config(STEPS, &OVERRIDES));
    let sharp = common::finish(&job);
    assert_eq!(sharp.last.measured.quality.compared, "sharp truth");
    assert!(!sharp.last.measured.quality.regions.is_empty() && !sharp.last.measured.quality.regions_inferred);
    let checkpoint = job.folder.checkpoint(STEPS);

    without_truth(&world);
    let formed = evaluated(&checkpoint, &world, &[]);
    assert_eq!(formed.quality.compared, "formed blur");
    // The same photos of a data set that states no exposure, measured as if they were sharp.
    common::edit(&world, "transforms_test.json", |frames| {
        frames.iter_mut().for_each(|frame| frame["exposure"] = 0.0.into());
    });
    assert_eq!(
        evaluated(&checkpoint, &world, &[]).quality.compared,
        "formed blur",
        "training took photos to be blurry"
    );
    let believed = evaluated(&checkpoint, &world, &["blur.mode=none"]);
    assert_eq!(believed.quality.compared, "photo");
    let [formed, believed] = [&formed, &believed].map(|measured| measured.quality.mean.psnr);
    assert!(formed > believed, "formed blur {formed} dB, sharp rendering {believed} dB against the same photos");
}

/// The files of a run on such a set.
#[test]
fn eval_json_says_what_was_compared() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::video(folder);
    without_truth(&world);
    let overrides = [&OVERRIDES[..], &["data.priors=[]"]].concat();
    let job = common::job(&world, &folder.join("run"), &common::config(10, &overrides));
    common::finish(&job);
    let eval = read_json(&job.folder.eval());
    assert_eq!(eval["compared"], "formed blur");
    let report = fs::read_to_string(job.folder.report()).expect("read");
    assert!(report.contains("compared with the blur that the scene forms"));
    // Nor does the set mark what moves.
    assert!(eval["regions"][MOVING]["psnr"].is_number() && eval["regions_inferred"] == true, "{eval}");
    assert!(report.contains("found where the photos change"));

    let still = common::job(&common::tiny_scene(folder), &folder.join("still"), &common::config(3, &[]));
    let still = common::finish(&still).last.measured.quality;
    assert_eq!((still.compared.as_str(), still.regions_inferred), ("photo", false));
}

/// Masks that are inferred for training and for measuring stay out of the fields for what the data set gave.
#[test]
fn inferred_masks_are_not_given_ones() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = common::video(temporary.path());
    without_truth(&world);
    let config = common::typed::<Taylormode>(&common::config(STEPS, &[&OVERRIDES[..], &["data.priors=[]"]].concat()));
    let scene = fit::load::<Taylormode>(&world, &config).expect("loads");
    let data = Data::<Taylormode>::new(scene.clone(), &config);
    let found = data.cues.masks.masks.iter().flatten().count();
    assert_eq!(found, scene.train.len(), "static cameras show what moves");

    let held_out = HeldOut::of::<Taylormode>(&data.scene, None).expect("a split");
    assert!(held_out.regions.iter().flatten().any(|region| region.name == MOVING), "moving parts are measured");
    // They know no configuration: a run's own heuristics do not change which pixels are scored.
    let blur = Taylormode::blur().expect("a model of blur");
    assert_eq!(held_out.regions, blur.regions(held_out.views));
    assert_eq!(data.scene, scene, "the data set stays what it was");
    let mut views = scene.train.iter().chain(scene.held_out_views());
    assert!(views.all(|view| view.priors.moving.is_none() && view.priors.depth.is_none()));
}

/// A test and a validation list beside the training views.
#[test]
fn splits_have_names() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = common::tiny_scene(folder);
    let file = |name: &str| scene.join(format!("transforms_{name}.json"));
    fs::copy(file("train"), file("val")).expect("copied");
    common::edit(&scene, "transforms_val.json", |frames| drop(frames.drain(1..)));
    common::edit(&scene, "transforms_train.json", |frames| drop(frames.remove(0)));
    let job = common::job(&scene, &folder.join("run"), &common::config(4, &[]));
    let eval = common::finish(&job);
    assert_eq!((eval.last.measured.split.as_str(), eval.last.measured.quality.views.len()), ("test", 2));

    let measured = |split: &str| {
        let output = {
            // Another backend sums in another order.
            let device = common::device_name();
            gsburn(folder, &["eval", "run", "--split", split, "--out", "out.json", "--device", &device])
        };
        assert!(output.status.success(), "{split}: {}", String::from_utf8_lossy(&output.stderr));
        let said = read_json(&folder.join("out.json"));
        assert_eq!(said["split"], split);
        let names = said["views"].as_array().expect("views").iter().map(|view| view["name"].to_string());
        (names.collect::<Vec<_>>(), said["psnr"].as_f64().expect("a number"))
    };
    let (validation, psnr) = measured("validation");
    assert!(validation.len() == 1 && validation[0].contains("r_000") && psnr > 0.0, "{validation:?}");
    let (training, _) = measured("train");
    assert!(training.len() == 4 && !training.contains(&validation[0]), "{training:?}");
    let (test, psnr) = measured("test");
    assert_eq!((test.len(), Some(psnr)), (2, read_json(&job.folder.eval())["psnr"].as_f64()));

    let unknown = gsburn(folder, &["eval", "run", "--split", "vaildation"]);
    let said = String::from_utf8_lossy(&unknown.stderr).into_owned();
    assert_eq!(unknown.status.code(), Some(1), "{said}");
    assert!(said.contains("expected a split from train, test, validation; found \"vaildation\""), "{said}");
}

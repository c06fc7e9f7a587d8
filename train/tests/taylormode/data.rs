//! What data sets do not say, or say twice, is refused, left out or told, by `check` as by `train`.

use std::path::Path;

use gs_train::commands::check::examine;
use gs_train::run::run;
use gs_train::taylormode::hints;

use crate::{OVERRIDES, STEPS, common, finish_in, request, tiny_world};

#[test]
fn a_set_without_times_is_refused_in_a_sentence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let still = common::tiny_scene(folder);
    let error = run(&request(&still, &folder.join("run"), &[])).expect_err("no times").to_string();
    assert!(error.contains("expected a time for each frame") && !error.contains('\n'), "{error}");
}

/// A photo of no time is left out, and an exposure longer than the frame interval is questioned.
#[test]
fn times_that_say_nothing_are_not_believed() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    let mut count = 0;
    edit(&world, "transforms_train.json", |frames| {
        count = frames.len();
        frames[2].as_object_mut().expect("a frame").remove("time");
    });
    let load = |more: &[&str]| {
        let config = common::config(STEPS, &[&OVERRIDES, more].concat());
        (config.load(&world).expect("loads"), config)
    };
    let (scene, config) = load(&[]);
    assert_eq!(scene.train.len(), count - 1);
    assert!(scene.warnings.iter().any(|w| w.contains("1 photos without a time are left out")), "{:?}", scene.warnings);
    assert_eq!(hints::first_exposure(&scene, &config).1, None);
    let (scene, config) = load(&["blur.exposure=0.3"]);
    let (exposure, warning) = hints::first_exposure(&scene, &config);
    assert!(exposure == 0.3 && warning.expect("a warning").contains("time between two frames, 0.25"));
}

#[test]
fn a_still_scene_reads_no_prior_that_it_does_not_use() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    let priors = |pipeline: &str| {
        let scene = common::config(STEPS, &[pipeline]).load(&world).expect("loads");
        let all = scene.train.into_iter().map(|view| view.priors);
        let each = all.map(|priors| [priors.depth.is_some(), priors.moving.is_some(), priors.sharp.is_some()]);
        each.collect::<Vec<_>>()
    };
    assert!(priors("pipeline=taylormode").contains(&[true; 3]));
    let still = priors("pipeline=static");
    assert!(still.contains(&[false, true, false]) && still.iter().all(|[depth, _, sharp]| !depth && !sharp));
}

/// `check` says what `train` says: what it refuses, and what it leaves out.
#[test]
fn checking_asks_what_training_asks() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let still = common::tiny_scene(folder);
    let config = |pipeline: &str| common::config(STEPS, &[pipeline]);
    let report = examine(&still, &config("pipeline=taylormode"));
    let refused = run(&request(&still, &folder.join("run"), &[])).expect_err("no times").to_string();
    assert!(report.errors == [refused], "{report}");
    assert!(examine(&still, &config("pipeline=static")).is_ok());

    let world = tiny_world(folder);
    edit(&world, "transforms_train.json", |frames| {
        frames[2].as_object_mut().expect("a frame").remove("time");
    });
    let report = examine(&world, &config("pipeline=taylormode"));
    let loaded = config("pipeline=taylormode").load(&world).expect("loads").warnings;
    assert!(report.is_ok() && report.warnings == loaded, "{report}: {loaded:?}");
    assert!(loaded.iter().any(|w| w.contains("1 photos without a time are left out")), "{loaded:?}");
}

/// Everything of a small world is nearer than the nearest that is drawn.
#[test]
fn a_world_too_small_for_its_near_plane_is_told() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    let warns = |near: &str| {
        let report = examine(&world, &common::config(STEPS, &["pipeline=taylormode", near]));
        report.warnings.iter().any(|warning| warning.contains("render.near"))
    };
    assert!(!warns("render.near=0.01"));
    let config = common::config(STEPS, &["pipeline=taylormode"]);
    let distance = config.load(&world).expect("loads").subject_distance().expect("cameras look at the body");
    assert!(warns(&format!("render.near={}", 0.6 * distance)));
}

/// One exposure is learned; the first view's is no truth where others differ.
#[test]
fn exposures_that_differ_are_judged_by_their_median() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    for file in ["transforms_train.json", "transforms_test.json"] {
        edit(&world, file, |frames| {
            frames.iter_mut().enumerate().for_each(|(i, frame)| frame["exposure"] = [0.2_f64, 0.05][i.min(1)].into());
        });
    }
    let run =
        |name: &str, from: &str| finish_in(temporary.path(), &world, name, &[from]).last.motion.expect("it moves");
    let held = run("held", "blur.exposure_from=1");
    assert!((held.exposure / 0.05 - 1.0).abs() < 1e-6, "{}", held.exposure);
    assert_eq!(held.exposure_error, None, "what is held is not found");
    let learned = run("learned", "blur.exposure_from=0");
    let error = learned.exposure_error.expect("a stated exposure");
    assert!(error > 1e-6 && (error - (learned.exposure / 0.05 - 1.0).abs()).abs() < 1e-12, "{error}");
}

/// Rewrites the frames of a set's description.
fn edit(world: &Path, file: &str, change: impl FnOnce(&mut Vec<serde_json::Value>)) {
    let path = world.join(file);
    let mut json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&path).expect("a file")).expect("JSON");
    change(json["frames"].as_array_mut().expect("frames"));
    std::fs::write(&path, json.to_string()).expect("written");
}

//! Facts that data sets omit or give twice are refused, left out or told, by `check` as by `train`.

use std::path::Path;

use gs_datasets::{CheckReport, Scene};
use gs_pipelines::fit::{SceneMethod, load};
use gs_pipelines::still::Still;
use gs_pipelines::taylormode::{Config, Taylormode, cues};
use gs_train::fit::intake::Intake;

use crate::common;
use crate::taylormode::{STEPS, config, finish_in, job, tiny_world};

/// The report of `check` on a data set.
fn examine(dataset: &Path, config: &toml::Table) -> CheckReport {
    common::pipeline(config).check(dataset, config).expect("a valid configuration")
}

/// A data set as a method's training would load it.
fn loaded<M: SceneMethod>(dataset: &Path, config: &toml::Table) -> Scene {
    load::<M>(dataset, &common::typed::<M>(config)).expect("loads")
}

/// The overrides of a static run and of a moving one with the program's own settings.
fn plain(pipeline: &str) -> toml::Table {
    common::config(STEPS, &[pipeline])
}

#[test]
fn a_set_without_times_is_refused_in_a_sentence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let still = common::tiny_scene(folder);
    let error = common::train(&job(&still, &folder.join("run"), &[])).expect_err("no times").to_string();
    assert!(error.contains("expected a time for each frame") && !error.contains('\n'), "{error}");
}

/// A photo of no time is left out, and an exposure longer than the frame interval is questioned.
#[test]
fn times_that_say_nothing_are_not_believed() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    let mut count = 0;
    common::edit(&world, "transforms_train.json", |frames| {
        count = frames.len();
        frames[2].as_object_mut().expect("a frame").remove("time");
    });
    let load = |more: &[&str]| {
        let config = config(more);
        let typed: Config = common::typed::<Taylormode>(&config);
        (loaded::<Taylormode>(&world, &config), typed)
    };
    let (scene, config) = load(&[]);
    assert_eq!(scene.train.len(), count - 1);
    assert!(scene.warnings.iter().any(|w| w.contains("1 photos without a time are left out")), "{:?}", scene.warnings);
    assert_eq!(cues::first_exposure(&scene, &config).1, None);
    let (scene, config) = load(&["blur.exposure=0.3"]);
    let (exposure, warning) = cues::first_exposure(&scene, &config);
    assert!(exposure == 0.3 && warning.expect("a warning").contains("time between two frames, 0.25"));
}

#[test]
fn a_still_scene_reads_no_prior_that_it_does_not_use() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    let priors = |scene: Scene| {
        let all = scene.train.into_iter().map(|view| view.priors);
        let each = all.map(|priors| [priors.depth.is_some(), priors.moving.is_some(), priors.sharp.is_some()]);
        each.collect::<Vec<_>>()
    };
    assert!(priors(loaded::<Taylormode>(&world, &plain("pipeline=taylormode"))).contains(&[true; 3]));
    let still = priors(loaded::<Still>(&world, &plain("pipeline=static")));
    assert!(still.contains(&[true, true, false]) && still.iter().all(|[.., sharp]| !sharp));
    let without = priors(loaded::<Still>(&world, &common::config(STEPS, &["depth.weight=0.0"])));
    assert!(without.contains(&[false, true, false]) && without.iter().all(|[depth, ..]| !depth));
}

/// `check` says what `train` says: what it refuses, and what it leaves out.
#[test]
fn checking_asks_what_training_asks() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let still = common::tiny_scene(folder);
    let report = examine(&still, &plain("pipeline=taylormode"));
    let refused = common::train(&job(&still, &folder.join("run"), &[])).expect_err("no times").to_string();
    assert!(report.errors == [refused], "{report}");
    assert!(examine(&still, &plain("pipeline=static")).is_ok());

    let world = tiny_world(folder);
    common::edit(&world, "transforms_train.json", |frames| {
        frames[2].as_object_mut().expect("a frame").remove("time");
    });
    let report = examine(&world, &plain("pipeline=taylormode"));
    let loaded = loaded::<Taylormode>(&world, &plain("pipeline=taylormode")).warnings;
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
    let scene = loaded::<Taylormode>(&world, &plain("pipeline=taylormode"));
    let distance = scene.subject_distance().expect("cameras look at the body");
    assert!(warns(&format!("render.near={}", 0.6 * distance)));
}

/// Points say how near things are; without them nothing is looked for, or drawn, close to a static camera.
#[test]
fn the_near_plane_is_proposed_without_points_alone() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    let config = common::typed::<Taylormode>(&plain("pipeline=taylormode"));
    let mut scene = load::<Taylormode>(&world, &config).expect("loads");
    assert!(scene.points.is_some());
    assert_eq!(Taylormode::near_share(&scene, &config), None);
    scene.points = None;
    assert_eq!(Taylormode::near_share(&scene, &config), Some(config.method.cues.near_share));
}

/// One exposure is learned; the first view's is no truth where others differ.
#[test]
fn exposures_that_differ_are_judged_by_their_median() {
    let temporary = tempfile::tempdir().expect("a folder");
    let world = tiny_world(temporary.path());
    for file in ["transforms_train.json", "transforms_test.json"] {
        common::edit(&world, file, |frames| {
            frames.iter_mut().enumerate().for_each(|(i, frame)| frame["exposure"] = [0.2_f64, 0.05][i.min(1)].into());
        });
    }
    let run = |name: &str, from: &str| finish_in(temporary.path(), &world, name, &[from]).last;
    let exposure = |last: &gs_train::run::measured::Evaluation| last.figure("exposure").expect("it moves");
    let held = run("held", "blur.exposure_from=1");
    assert!((exposure(&held) / 0.05 - 1.0).abs() < 1e-6, "{}", exposure(&held));
    assert_eq!(held.figure("exposure_error"), None, "what is held is not found");
    let learned = run("learned", "blur.exposure_from=0");
    let error = learned.figure("exposure_error").expect("a stated exposure") / 100.0;
    assert!(error > 1e-6 && (error - (exposure(&learned) / 0.05 - 1.0).abs()).abs() < 1e-12, "{error}");
}

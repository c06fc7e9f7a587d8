//! The pipeline for blurry video: resumes to the same bits, goes on without priors and says so, and its commands work.

mod common;

use std::path::{Path, PathBuf};

use gs_burn::glam::DMat4;
use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_datasets::{Intrinsics, Priors, RgbImage8, Truth, View};
use gs_models::Motion;
use gs_models::taylormode::TimeWindow;
use gs_train::commands::check::examine;
use gs_train::parameters::{Parameters, from_host, to_host};
use gs_train::run::{Ending, RunRequest, run};
use gs_train::run_folder::EvalFile;
use gs_train::taylormode::config::MotionConfig;
use gs_train::taylormode::hints;
use gs_train::taylormode::select::{Selected, select};
use gs_train::taylormode::state::{RemainderFrame, still};

const STEPS: usize = 40;

/// A set of four cameras, one held out, and five frames.
fn tiny_world(folder: &Path) -> PathBuf {
    written(folder, DeblurOptions { world: World::Sphere, ..DeblurOptions::default() })
}

/// Writes a world as small as that, otherwise as `options` say.
fn written(folder: &Path, options: DeblurOptions) -> PathBuf {
    let path = folder.join("world");
    let options = DeblurOptions { width: 64, height: 48, cameras: 5, held_out: 1, frames: 5, ..options };
    deblur::write(&path, &options, |_, _| {}).expect("the world is written");
    path
}

const OVERRIDES: [&str; 9] = [
    "pipeline=taylormode",
    "model.sh_degree=1",
    "density.start=4",
    "density.every=10",
    "density.growth=0.2",
    "density.cap=1500",
    "motion.points=200",
    "motion.select_every=10",
    "blur.samples=3",
];

fn request(world: &Path, folder: &Path, more: &[&str]) -> RunRequest {
    let overrides: Vec<&str> = OVERRIDES.iter().chain(more).copied().collect();
    common::request(world, folder, &common::config(STEPS, &overrides))
}

fn finish_in(folder: &Path, world: &Path, name: &str, more: &[&str]) -> EvalFile {
    common::finish(&request(world, &folder.join(name), more))
}

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
    resumes_on(&world, folder, &[]);
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

/// The exposure that the data set states is held, its moments are not.
#[test]
fn a_stated_exposure_is_held_for_its_share_of_the_run() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = tiny_world(folder);
    let exposure =
        |name: &str, more: &[&str]| finish_in(folder, &world, name, more).last.motion.expect("a moving scene").exposure;
    let stated = DeblurOptions { frames: 5, ..DeblurOptions::default() }.exposure_time();
    let near = |value: f64, other: f64| (value / other - 1.0).abs() < 1e-6;
    assert!(near(exposure("held", &["blur.exposure_from=1"]), stated));
    assert!(!near(exposure("learned", &["blur.exposure_from=0.5"]), stated));
    // One that the user guessed is no statement of the data set.
    let guess = format!("blur.exposure={stated}");
    assert!(!near(exposure("guessed", &["blur.exposure_from=1", &guess]), stated));
}

#[test]
fn the_warp_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["blur.mode=warp", "blur.decouple=true"]);
}

#[test]
fn every_formation_trains_and_is_measured() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = tiny_world(folder);
    let modes: [(&str, &[&str]); 5] = [
        ("integrate", &["blur.mode=integrate"]),
        ("decoupled", &["blur.mode=integrate", "blur.decouple=true"]),
        ("warp", &["blur.mode=warp"]),
        ("network", &["blur.mode=warp", "blur.velocity=network"]),
        ("none", &["blur.mode=none"]),
    ];
    for (name, more) in modes {
        let eval = finish_in(folder, &world, name, more);
        let motion = eval.last.motion.as_ref().expect("a moving scene");
        assert_eq!(eval.skipped_steps, 0, "{name}");
        assert!(eval.last.moving.as_ref().expect("the truth's mask").psnr > 5.0, "{name}");
        assert!(motion.blurry_psnr.expect("the truth's blurry photo") > 5.0, "{name}");
        assert!(motion.velocity_angle.is_some() && motion.cost.moving > 0, "{name}: {motion:?}");
    }
}

/// Largest difference between backends, dB. Sums in another order differ in the seventh digit; forty steps of Adam, whose first have
/// full length whatever the gradient, made 4e-4 dB of that.
#[cfg(any(feature = "ndarray", feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda"))]
const BACKENDS_APART: f64 = 0.01;

/// The whole pipeline, on each backend of the build: the same scene but for rounding.
#[test]
#[cfg(any(feature = "ndarray", feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda"))]
fn every_backend_trains_the_same_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    // Two bodies, each with a common motion.
    let world = written(folder, DeblurOptions { world: World::Pair, ..DeblurOptions::default() });
    for more in [["blur.mode=integrate", "motion.remainder=on"], ["blur.mode=warp", "blur.decouple=true"]] {
        let trained = common::BACKENDS.iter().map(|backend| {
            let run = RunRequest {
                device: common::named(backend),
                ..request(&world, &folder.join(format!("{backend} {}", more[0])), &more)
            };
            let last = common::finish(&run).last;
            (*backend, [last.mean.psnr, last.moving.expect("the truth's mask").psnr])
        });
        let trained: Vec<(&str, [f64; 2])> = trained.collect();
        let (_, first) = trained[0];
        for (backend, psnr) in &trained {
            let apart = (0..2).map(|i| (psnr[i] - first[i]).abs()).fold(0.0, f64::max);
            assert!(apart <= BACKENDS_APART, "{more:?} on {backend}: {psnr:?} dB, on {}: {first:?}", trained[0].0);
        }
    }
}

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
    let path = world.join("transforms_train.json");
    let mut json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&path).expect("a file")).expect("JSON");
    let frames = json["frames"].as_array_mut().expect("frames");
    let count = frames.len();
    frames[2].as_object_mut().expect("a frame").remove("time");
    std::fs::write(&path, json.to_string()).expect("written");
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
fn without_priors_it_goes_on_by_evidence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let path = written(folder, DeblurOptions { world: World::Cube, points: 0, ..DeblurOptions::default() });
    for masks in ["auto", "none"] {
        let masks_key = format!("motion.masks={masks}");
        // More points for what stands still than the cap has room for.
        let more = [masks_key.as_str(), "data.priors=[]", "init.random_points=2000"];
        let eval = finish_in(folder, &path, masks, &more);
        let moving = eval.last.motion.expect("a moving scene").cost.moving;
        // Half of the 200 that a hull may have: some are of a hull's far side and stop.
        assert!(moving >= 100, "{masks}: {moving} move");
        assert!(eval.last.gaussians <= 1500, "{masks}: {} Gaussians", eval.last.gaussians);
    }
    let warnings = |priors: &str| {
        let config = common::config(STEPS, &["pipeline=taylormode", priors]);
        let scene = config.load(&path).expect("loads");
        gs_train::taylormode::hints::gather(&scene, &config).expect("a moving scene").warnings.join("; ")
    };
    let (with, without) = (warnings("data.priors=[\"depth\", \"masks\", \"sharp\"]"), warnings("data.priors=[]"));
    assert!(!with.contains("no depth priors") && !with.contains("no pseudo-sharp"), "{with}");
    assert!(without.contains("no depth priors") && without.contains("no pseudo-sharp"), "{without}");
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

/// A black photo of 1 x 1 pixels by a camera at the origin in which a unit at depth 1 is 100 pixels.
fn black_view() -> View {
    View {
        name: String::new(),
        image_path: PathBuf::new(),
        c2w: DMat4::IDENTITY,
        intrinsics: Intrinsics { fx: 100.0, fy: 100.0, cx: 0.5, cy: 0.5 },
        width: 1,
        height: 1,
        time: Some(0.4),
        camera_id: None,
        image: RgbImage8 { width: 1, height: 1, data: vec![0; 3] },
        mask: None,
        exposure: None,
        priors: Priors::default(),
        truth: Truth::default(),
    }
}

#[test]
fn selection_changes_nothing_that_shows() {
    let device = common::device();
    let table = |row: &[f32]| from_host(row.repeat(6), row.len(), &device);
    let mut parameters = Parameters::new([
        table(&[0.0, 0.0, 1.0]),
        table(&[1.0, 0.0, 0.0, 0.0]),
        table(&[-2.0; 3]),
        table(&[0.0]),
        table(&[0.5; 3]),
    ]);
    // Gaussian 1 stands still but for 0.05 pixels, 2 needs order 2, 4 turns on its place.
    let mut state = still(vec![1, 2, 4], TimeWindow { t0: 0.4, half: 0.25 }, [3, 2], 0.1, &device);
    #[rustfmt::skip]
    let paths = vec![
        0.0005, 0.0, 0.0,  0.0, 0.0, 0.0,  0.0, 0.0, 0.0,
        0.5, 0.0, 0.0,     0.0, 0.3, 0.0,  0.0, 0.0, 0.0005,
        0.0, 0.0, 0.0,     0.0, 0.0, 0.0,  0.0, 0.0, 0.0,
    ];
    state.position.value = from_host(paths, 9, &device);
    let turns = [[0.0; 6], [0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    state.rotation.value = from_host(turns.as_flattened().to_vec(), 6, &device);
    let times = [0.15, 0.25, 0.4, 0.5, 0.65];
    let before = times.map(|t| state.scene(parameters.gaussians()).at(t));

    let config = MotionConfig { shrink_pixels: 0.0, ..MotionConfig::default() };
    // What a remainder network moves needs no order to do so.
    let mut carried = state.clone();
    carried.remainder = Some(RemainderFrame { centre: [0.0; 3], scale: 1.0, order: 3 });
    assert_eq!(select(&mut parameters.clone(), &mut carried, &[black_view()], &config).stopped, 0);

    let selected = select(&mut parameters, &mut state, &[black_view()], &config);

    assert_eq!(selected, Selected { lowered: 3 + 1 + 3, stopped: 1 });
    assert_eq!((state.rows.as_slice(), state.orders.as_slice()), ([2, 4].as_slice(), [2, 0].as_slice()));
    assert_eq!(state.rotation_orders, [0, 1]);
    let kept = to_host(state.position.value.clone());
    assert!(kept[6..].iter().all(|x| *x == 0.0), "blocks above the orders: {kept:?}");
    let limit = config.select_pixels / 100.0;
    for (t, before) in times.iter().zip(before) {
        let after = state.scene(parameters.gaussians()).at(*t);
        let moved = to_host((before.means.val() - after.means.val()).abs().max());
        assert!(f64::from(moved[0]) <= limit, "{t}: moved by {moved:?}");
        assert_eq!(to_host(before.quats.val()), to_host(after.quats.val()), "{t}");
    }
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
    let held = finish_in(temporary.path(), &world, "held", &["blur.exposure_from=1"]);
    let motion = held.last.motion.expect("a moving scene");
    assert!((motion.exposure / 0.05 - 1.0).abs() < 1e-6, "{}", motion.exposure);
    assert!(motion.exposure_error.expect("a stated exposure") < 1e-6, "{:?}", motion.exposure_error);
}

/// Rewrites the frames of a set's description.
fn edit(world: &Path, file: &str, change: impl Fn(&mut Vec<serde_json::Value>)) {
    let path = world.join(file);
    let mut json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&path).expect("a file")).expect("JSON");
    change(json["frames"].as_array_mut().expect("frames"));
    std::fs::write(&path, json.to_string()).expect("written");
}

//! The pipeline of docs/extend.md, which the program knows by one line: it learns, saves, resumes, reports and is
//! charted like any other.

use std::fs;
use std::path::{Path, PathBuf};

use gs_pipelines::brightness::Brightness;
use gs_pipelines::fit::read_model;
use gs_train::fit::parameters::to_host;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::watch::Job;
use gs_worlds::still::{self, StillOptions};
use gsburn::report::comparison::{Table, gather};

use crate::common::program::succeeds;
use crate::common::{self, read_json};

const STEPS: usize = 1500;

/// Brightness of the training photos, in turn. Its geometric mean is 1, so that the scene is learned at the brightness
/// of the held-out photos.
const FACTORS: [f64; 8] = [0.7, 1.0 / 0.7, 0.8, 1.0 / 0.8, 0.9, 1.0 / 0.9, 1.0, 1.0];

/// Training photos.
const PHOTOS: usize = 16;

/// Of all photos, so that the brightest one is not clipped.
const DARKER: f64 = 0.69;

const OVERRIDES: [&str; 5] =
    ["data.background=[0,0,0]", "model.sh_degree=0", "density.cap=1000", "density.start=50", "density.every=50"];

/// The demo's scene in photos of different brightness.
fn world(folder: &Path) -> PathBuf {
    let path = folder.join("world");
    let options = StillOptions {
        train_views: PHOTOS,
        test_views: 3,
        width: 64,
        height: 48,
        points: 300,
        seed: 1,
        ..StillOptions::default()
    };
    still::write(&path, &options, |_, _| ()).expect("the scene is written");
    for (index, factor) in FACTORS.into_iter().cycle().take(PHOTOS).enumerate() {
        darken(&path.join(format!("train/r_{index:03}.png")), DARKER * factor);
    }
    for index in 0..options.test_views {
        darken(&path.join(format!("test/r_{index:03}.png")), DARKER);
    }
    path
}

fn darken(path: &Path, factor: f64) {
    let mut photo = image::open(path).expect("a photo").to_rgba8();
    for level in photo.pixels_mut().flat_map(|pixel| &mut pixel.0[..3]) {
        *level = (f64::from(*level) * factor).round() as u8;
    }
    photo.save(path).expect("written");
}

fn job(world: &Path, folder: &Path, pipeline: &str, steps: usize) -> Job {
    let pipeline = format!("pipeline={pipeline}");
    let overrides: Vec<&str> = OVERRIDES.into_iter().chain([pipeline.as_str()]).collect();
    common::job(world, folder, &common::config(steps, &overrides))
}

/// Root mean square error of the learned factors' logarithms. A photo's factor is told from its scene only where other
/// photos show the same surfaces: seven runs, of five worlds and three seeds, end at 2.7 to 3.5 % (5 to 7 % in the
/// worst photo). The bound is their mean, 3.1 %, and three of their deviations of 0.3 %.
const ERROR: f64 = 0.04;

/// Of held-out photos over a scene that takes all photos to be of one brightness, dB: 6.1 to 9.3 dB in the same runs.
/// The bound is their mean, 7.4 dB, less three of their deviations of 1.1 dB.
const GAIN: f64 = 4.1;

#[test]
fn brightness_is_learned_measured_reported_and_charted() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = world(folder);
    let learned = job(&world, &folder.join("learned"), "brightness", STEPS);
    let eval = common::finish(&learned);

    let file = Checkpoint::load(&learned.folder.checkpoint(STEPS)).expect("loads");
    let (model, ..) = read_model::<Brightness>(&file, &common::device()).expect("a scene");
    let factors = to_host(model.method.factors());
    assert_eq!(factors.len(), PHOTOS);
    let errors = factors.iter().zip(FACTORS.into_iter().cycle()).map(|(found, truth)| (f64::from(*found) / truth).ln());
    let error = (errors.map(|error| error * error).sum::<f64>() / PHOTOS as f64).sqrt();
    assert!(error <= ERROR, "factors {factors:?} are off by {error}");
    let ratio = eval.last.figure("brightness_ratio").expect("a figure");
    let largest = factors.iter().copied().fold(0.0, f32::max) / factors.iter().copied().fold(f32::MAX, f32::min);
    assert!((ratio / f64::from(largest) - 1.0).abs() < 1e-6, "{ratio} of {factors:?}");

    let plain = common::finish(&job(&world, &folder.join("plain"), "static", STEPS));
    let (with, without) = (eval.last.mean().psnr, plain.last.mean().psnr);
    assert!(with >= without + GAIN, "{with} dB with a brightness for each photo, {without} dB without");

    // The page has its figure as a card, and the table both runs.
    let report = fs::read_to_string(learned.folder.report()).expect("read");
    let card = format!("<span>Brightest / darkest photo</span><b>{ratio:.3}</b>");
    assert!(report.contains(&card), "no card");
    let found = gather(&["learned", "plain"].map(|name| folder.join(name))).expect("two finished runs");
    let table = Table::new(&found.runs).csv();
    let rows: Vec<&str> = table.lines().collect();
    assert!(rows[0].contains("brightest / darkest photo"), "{table}");
    assert!(rows.iter().any(|row| row.starts_with("learned,")) && rows.iter().any(|row| row.starts_with("plain,")));

    // The checkpoint is the scene that was measured; another backend sums in another order.
    succeeds(folder, &["eval", "learned", "--out", "eval.json", "--device", &common::device_name()]);
    let (again, first) = (read_json(&folder.join("eval.json")), read_json(&learned.folder.eval()));
    for key in ["psnr", "ssim", "views", "figures", "compared", "split"] {
        assert_eq!(again[key], first[key], "{key}");
    }
    assert!(succeeds(folder, &["info", "learned"]).contains("brightness"));

    // A PLY file knows no brightness: all photos are taken to be equally bright.
    let ply = ["eval", "learned/scene.ply", "--data", "world", "--set", "pipeline=brightness"];
    assert!(succeeds(folder, &ply).contains("brightest / darkest photo 1.000"));
}

#[test]
fn it_resumes_to_the_same_bits() {
    const SHORT: usize = 60;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = world(folder);
    let [whole, resumed] = ["whole", "resumed"].map(|name| job(&world, &folder.join(name), "brightness", SHORT));
    common::finish(&whole);
    common::finish_interrupted(&resumed, &[17, 41]);
    let bits = |job: &Job| fs::read(job.folder.checkpoint(SHORT)).expect("saved");
    assert!(bits(&whole) == bits(&resumed), "the resumed run differs");
}

/// The example stays one: the module and its method in at most eighty lines of code, and one line for the program to
/// know it.
#[test]
fn it_is_small_and_named_in_the_list_alone() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/src");
    let text = fs::read_to_string(source.join("brightness.rs")).expect("read");
    let (_, code) = text.split_once("/// The brightness of each training photo.").expect("the module");
    let is_code = |line: &&str| !line.trim().is_empty() && !line.trim().starts_with("//");
    let lines = code.lines().filter(is_code).count();
    assert!(lines <= 80, "{lines} lines");

    let named = files(&source).into_iter().filter(|path| {
        let text = fs::read_to_string(path).unwrap_or_default();
        text.contains("brightness::") || text.contains("Brightness") || text.contains("\"brightness\"")
    });
    let named: Vec<_> = named.map(|path| path.strip_prefix(&source).expect("inside").to_path_buf()).collect();
    let expected = ["brightness.rs", "lib.rs"].map(PathBuf::from);
    assert!(named.len() == 2 && expected.iter().all(|path| named.contains(path)), "{named:?}");
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

//! Small sound logs with one damaged file: nothing panics, the work is bounded, and no control character is said.
//!
//! Each layout gets [`SHORT`] cases with all other tests. The long run is asked for:
//!
//! ```text
//! GS_FUZZ_CASES=100000 cargo test --release -p gs-driving --test fuzz -- --ignored
//! ```

#[path = "../../../tests/fuzz/bounded.rs"]
mod bounded;
#[path = "../../../../tests/src/mutate.rs"]
mod mutate;
#[cfg(feature = "waymo")]
mod waymo;

use std::fs;
use std::path::{Path, PathBuf};

use gs_driving::{DrivingLog, LogOptions, check, truth_image};
use gs_worlds::driving::{StreetOptions, write};

use crate::bounded::{asked, kept, run, steps};
use crate::mutate::damaged;

/// Cases for each layout with all other tests.
const SHORT: u32 = 96;

/// Cases for each layout when no number is given.
const LONG: u32 = 20_000;

fn files(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() { files(&path, all) } else { all.push(path) }
    }
}

fn street(folder: &Path, compressed: bool) {
    let options = StreetOptions {
        frames: 2,
        cameras: 1,
        width: 16,
        height: 16,
        beams: 3,
        columns: 36,
        subpixels: 1,
        movers: 2,
        compressed,
        ..StreetOptions::default()
    };
    write(folder, &options, |_, _| {}).expect("written");
}

/// A map of the ground.
fn map(folder: &Path) {
    fs::create_dir(folder).expect("made");
    gs_base::npy::write_npy(&folder.join("_ground_height_surface____.npy"), &[[60.0; 4]; 4]).expect("written");
    let place = r#"{"R": [1.0, 0.0, 0.0, 1.0], "t": [-5008.0, 3000.0], "s": 0.2}"#;
    fs::write(folder.join("___img_Sim2_city.json"), place).expect("written");
}

/// Copies a small log that is kept as it is.
fn fixture(name: &str, folder: &Path) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    let mut all = Vec::new();
    files(&source, &mut all);
    for path in all {
        let target = folder.join(path.strip_prefix(&source).expect("below"));
        fs::create_dir_all(target.parent().expect("a parent")).expect("a folder");
        fs::copy(&path, target).expect("copied");
    }
}

/// Damages each file of a log in turn.
fn fuzz(folder: &Path, cases: u32) {
    let mut all = Vec::new();
    files(folder, &mut all);
    all.sort();
    let whole: Vec<Vec<u8>> = all.iter().map(|path| fs::read(path).expect("read")).collect();
    assert!(check(folder, &LogOptions::default(), None).is_ok(), "the seed itself is sound");
    run("a log", cases, (0..all.len(), steps()), |(file, steps)| {
        fs::write(&all[file], damaged(&whole[file], &steps)).expect("written");
        let kept = kept(&all[file].display().to_string(), || examine(folder));
        fs::write(&all[file], &whole[file]).expect("written");
        kept
    });
}

fn examine(folder: &Path) {
    let report = check(folder, &LogOptions::default(), None);
    let mut said = [report.facts, report.warnings, report.errors].concat();
    if let Err(error) = truth_image(folder, "front_camera", "00") {
        said.push(error.to_string());
    }
    if let Ok(log) = DrivingLog::open(folder, &LogOptions::default()) {
        match log.map_ground() {
            Ok(ground) => _ = ground.has([10.0, 0.0, 1.0]),
            Err(error) => said.push(error.to_string()),
        }
    }
    let raw = said.iter().find(|text| text.chars().any(|c| c.is_control() || c == '\u{202e}'));
    assert_eq!(raw, None, "a control character is said");
}

fn both(cases: u32) {
    for layout in 0..3 {
        let folder = tempfile::tempdir().expect("a folder");
        match layout {
            0 => street(folder.path(), false),
            1 => street(folder.path(), true),
            _ => {
                fixture("argoverse", folder.path());
                map(&folder.path().join("map"));
            }
        }
        fuzz(folder.path(), cases);
    }
}

#[test]
fn damaged_logs() {
    both(SHORT);
}

#[test]
#[ignore = "as long as wanted: GS_FUZZ_CASES cases for each layout"]
fn damaged_logs_for_long() {
    both(asked(LONG));
}

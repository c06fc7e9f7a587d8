//! Small sound data sets with one damaged file: nothing panics, the work is bounded, no control character is said, and
//! `load` and `check` agree.
//!
//! Each reader gets [`SHORT`] cases with all other tests. The long run is asked for, with as many cases as wanted:
//!
//! ```text
//! GS_FUZZ_CASES=100000 cargo test --release -p gs-datasets --test fuzz -- --ignored
//! ```

mod bounded;
#[path = "../datasets/colmap_writer.rs"]
mod colmap_writer;
#[allow(dead_code)] // Other tests use the rest of them.
#[path = "../datasets/fixtures.rs"]
mod fixtures;
#[path = "../../../tests/src/mutate.rs"]
mod mutate;
mod seeds;

use std::fs;

use gs_datasets::{Holdout, LoadOptions, Scene, check, load, load_cameras};

use crate::bounded::{asked, bounded, kept, run, steps};
use crate::mutate::damaged;
use crate::seeds::{SEEDS, Seed};

/// Cases for each reader with all other tests.
const SHORT: u32 = 64;

/// Cases for each reader when no number is given.
const LONG: u32 = 20_000;

/// Damages each file of a seed in turn.
fn fuzz(name: &str, cases: u32) {
    let seed = SEEDS.iter().find(|seed| seed.name == name).expect("a seed of this name");
    let folder = (seed.write)();
    assert!(loaded(&folder, &options(0)).is_ok(), "{name}: the seed itself is sound");
    let whole: Vec<Vec<u8>> = seed.files.iter().map(|file| fs::read(folder.file(file)).expect("read")).collect();
    run(name, cases, (0..seed.files.len(), 0..3_u8, steps()), |(file, kind, steps)| {
        folder.write(seed.files[file], damaged(&whole[file], &steps));
        let kept = kept(seed.files[file], || examine(&folder, &options(kind)));
        folder.write(seed.files[file], &whole[file]);
        kept
    });
}

/// How the set is loaded: each kind leads through other code.
fn options(kind: u8) -> LoadOptions {
    match kind {
        0 => LoadOptions { holdout: Holdout::None, ..LoadOptions::default() },
        1 => LoadOptions { max_width: Some(5), training_truth: true, ..LoadOptions::default() },
        _ => LoadOptions { holdout: Holdout::Every(2), recentre: false, ..LoadOptions::default() },
    }
}

fn loaded(folder: &fixtures::Folder, options: &LoadOptions) -> Result<Scene, gs_datasets::DatasetError> {
    load(folder.path(), options)
}

/// Reads a set in every way there is.
fn examine(folder: &fixtures::Folder, options: &LoadOptions) {
    let loaded = loaded(folder, options);
    let report = check(folder.path(), options);
    let mut said = [report.facts.clone(), report.warnings.clone(), report.errors.clone()].concat();
    match &loaded {
        Ok(scene) => {
            assert!(report.is_ok(), "it loads, and is bad by the report: {report}");
            said.extend(scene.warnings.clone());
            let views = scene.train.iter().chain(scene.held_out_views());
            for view in views {
                said.push(view.name.clone());
                said.extend(view.camera_id.clone());
                assert!(
                    view.c2w.is_finite() && view.intrinsics.fx.is_finite() && view.intrinsics.fx > 0.0,
                    "{}",
                    view.name
                );
                assert_eq!(view.image.data.len(), 3 * view.width * view.height, "{}", view.name);
            }
            let points = scene.points.iter().flat_map(|points| points.positions.iter().flatten());
            assert!(points.into_iter().all(|value| value.is_finite()), "a point that is not finite");
        }
        Err(error) => {
            assert!(!report.is_ok(), "it does not load ({error}), and is good by the report: {report}");
            said.push(error.to_string());
        }
    }
    match load_cameras(folder.path()) {
        Ok(cameras) => said.extend(cameras.into_iter().map(|camera| camera.name)),
        Err(error) => said.push(error.to_string()),
    }
    let raw = said.iter().find(|text| text.chars().any(|c| c.is_control() || c == '\u{202e}'));
    assert_eq!(raw, None, "a control character is said");
}

#[test]
fn transforms_json() {
    fuzz("transforms.json", SHORT);
}

#[test]
fn transforms_json_with_everything_beside_it() {
    fuzz("transforms.json with priors", SHORT);
}

#[test]
fn points_ply() {
    fuzz("PLY", SHORT);
}

#[test]
fn depth_npy() {
    fuzz("NPY", SHORT);
}

#[test]
fn depth_exr() {
    fuzz("EXR", SHORT);
}

#[test]
fn colmap_binary() {
    fuzz("COLMAP binary", SHORT);
}

#[test]
fn colmap_text() {
    fuzz("COLMAP text", SHORT);
}

#[test]
fn colmap_of_several_models() {
    fuzz("COLMAP of several models", SHORT);
}

#[test]
fn llff() {
    fuzz("LLFF", SHORT);
}

#[test]
fn llff_of_photos() {
    fuzz("LLFF of photos", SHORT);
}

#[test]
fn realityscan() {
    fuzz("RealityScan", SHORT);
}

#[test]
fn paths_of_another_machine() {
    fuzz("paths of another machine", SHORT);
}

#[test]
fn lenses() {
    fuzz("lenses", SHORT);
}

#[test]
fn wide_lenses() {
    fuzz("wide lenses", SHORT);
}

#[test]
fn panoptic() {
    fuzz("Panoptic", SHORT);
}

#[test]
fn photos() {
    fuzz("photos", SHORT);
}

#[test]
fn photos_in_light() {
    fuzz("photos in light", SHORT);
}

/// Sizes that are within every limit, on files of some hundred bytes.
#[test]
fn a_header_cannot_ask_for_more_than_its_file_could_hold() {
    let side = 8192_i32;
    let folder = (SEEDS[4].write)();
    let mut exr = fs::read(folder.file("depth/2.exr")).expect("read");
    for window in ["dataWindow", "displayWindow"] {
        // Four i32 after the name, the type and the attribute's length.
        let key = format!("{window}\0box2i\0");
        let start = exr.windows(key.len()).position(|found| found == key.as_bytes()).expect("a window") + key.len() + 4;
        exr[start + 8..start + 12].copy_from_slice(&(side - 1).to_le_bytes());
        exr[start + 12..start + 16].copy_from_slice(&(side - 1).to_le_bytes());
    }
    // The table of places of chunks, 16 lines each, has one entry: the place behind itself.
    let entry = |at: &usize| exr[*at..at + 8] == (*at as u64 + 8).to_le_bytes();
    let table = (0..exr.len() - 8).find(entry).expect("a table");
    exr.splice(table + 8..table + 8, vec![0; 8 * (side as usize / 16 - 1)]);
    let key = b"chunkCount\0int\0";
    if let Some(at) = exr.windows(key.len()).position(|found| found == key) {
        exr[at + key.len() + 4..at + key.len() + 8].copy_from_slice(&(side / 16).to_le_bytes());
    }
    folder.write("depth/2.exr", exr);
    bounded(|| examine(&folder, &options(0)));

    let folder = (SEEDS[0].write)();
    let mut png = fs::read(folder.file("images/00.png")).expect("read");
    png[16..20].copy_from_slice(&side.to_be_bytes());
    png[20..24].copy_from_slice(&side.to_be_bytes());
    let sum = crc(&png[12..29]);
    png[29..33].copy_from_slice(&sum.to_be_bytes());
    folder.write("images/00.png", png);
    bounded(|| examine(&folder, &options(0)));
    let error = loaded(&folder, &options(0)).expect_err("a lie").to_string();
    assert!(error.contains("a header of 8192 x 8192 pixels"), "{error}");
}

/// The checksum of a PNG's chunk (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

#[test]
#[ignore = "as long as wanted: GS_FUZZ_CASES cases for each reader"]
fn all_readers_for_long() {
    for Seed { name, .. } in SEEDS {
        fuzz(name, asked(LONG));
    }
}

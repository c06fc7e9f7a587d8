//! Small sound segments with damage: nothing panics, memory is bounded, and every mistake is one sentence.
//!
//! [`SHORT`] cases run for each layout with all other tests. The long run is asked for:
//!
//! ```text
//! GS_FUZZ_CASES=100000 cargo test --release -p gs-driving --features waymo --test fuzz -- --ignored
//! ```

// Shared with the tests of sound segments, which use the rest.
#[allow(dead_code)]
#[path = "../driving/waymo/modular.rs"]
mod modular;
#[allow(dead_code)]
#[path = "../driving/waymo/record.rs"]
mod record;
#[allow(dead_code)]
#[path = "../driving/waymo/scene.rs"]
mod scene;

use std::fs;
use std::path::{Path, PathBuf};

use gs_driving::{DrivingLog, LogOptions};
use parquet::file::properties::WriterVersion;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use modular::{NAME, Style};

use crate::bounded::{asked, bounded};
use crate::mutate::{Step, damaged};

/// Cases for each layout with all other tests.
const SHORT: usize = 1000;

/// Cases for each layout when no number is given.
const LONG: u32 = 50_000;

/// Opens a segment and reads a frame. The sentences of all that is wrong.
fn examine(path: &Path) -> Vec<String> {
    let mut said = Vec::new();
    match DrivingLog::open(path, &LogOptions::default()) {
        Err(error) => said.push(error.to_string()),
        Ok(log) => {
            let frame = log.frames().len() - 1;
            said.extend(log.labelled_sweep(frame).err().map(|error| error.to_string()));
            said.extend(log.cuboids(0).err().map(|error| error.to_string()));
            let images = (0..log.cameras().len()).filter(|camera| log.view_index(frame, *camera).is_some());
            said.extend(images.filter_map(|camera| log.image(frame, camera).err()).map(|error| error.to_string()));
        }
    }
    let bad = said.iter().find(|text| text.chars().any(char::is_control) || text.len() > 2000);
    assert_eq!(bad, None, "no sentence");
    said
}

fn steps(random: &mut ChaCha8Rng) -> Vec<Step> {
    (0..random.random_range(1..5)).map(|_| (random.random(), random.random(), random.random())).collect()
}

/// Runs cases: `write` damages a segment and gives what makes it sound again. The share of cases in which something is
/// found.
fn cases(count: usize, path: &Path, mut write: impl FnMut(&mut ChaCha8Rng) -> Box<dyn FnOnce()>) -> f64 {
    assert_eq!(bounded(|| examine(path)), Vec::<String>::new(), "the seed itself is sound");
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut found = 0;
    for case in 0..count {
        let restore = write(&mut random);
        let said = std::panic::catch_unwind(|| bounded(|| examine(path)));
        restore();
        match said {
            Ok(said) => found += usize::from(!said.is_empty()),
            Err(panic) => panic!("case {case}: {:?}", panic.downcast_ref::<String>()),
        }
    }
    found as f64 / count as f64
}

fn files(root: &Path) -> Vec<PathBuf> {
    let names = modular::components().into_iter().map(|(component, _)| component);
    names.map(|component| root.join(component).join(format!("{NAME}.parquet"))).collect()
}

fn modular_cases(count: usize) {
    let styles = [
        Style { version: WriterVersion::PARQUET_1_0, dictionary: true, group: 4, page: 600 },
        Style { version: WriterVersion::PARQUET_2_0, dictionary: true, group: 4, page: 600 },
    ];
    for style in styles {
        let folder = tempfile::tempdir().expect("a folder");
        modular::segment(folder.path(), style);
        share_of_files(count / 2, folder.path());
    }
    // Packed pages, of another writer.
    let folder = tempfile::tempdir().expect("a folder");
    crate::fixture("waymo", folder.path());
    share_of_files(count, folder.path());
}

fn share_of_files(count: usize, root: &Path) {
    let all = files(root);
    let whole: Vec<Vec<u8>> = all.iter().map(|path| fs::read(path).expect("read")).collect();
    let share = cases(count, root, |random| {
        let file = random.random_range(0..all.len());
        let (path, whole) = (all[file].clone(), whole[file].clone());
        // Half of the cases damage the footer alone, which most of the reader's work is about.
        let footer = u32::from_le_bytes(std::array::from_fn(|i| whole[whole.len() - 8 + i])) as usize + 8;
        let start = if random.random_bool(0.5) { whole.len() - footer } else { 0 };
        let bytes = [&whole[..start], &damaged(&whole[start..], &steps(random))].concat();
        fs::write(&path, bytes).expect("written");
        Box::new(move || fs::write(path, whole).expect("written"))
    });
    assert!(share > 0.5, "{share} of the cases are noticed");
}

fn record_cases(count: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = record::segment(folder.path());
    let whole = fs::read(&path).expect("read");
    let content = record::frame(0);
    let share = cases(count, &path.clone(), |random| {
        let bytes = match random.random_range(0..3) {
            0 => damaged(&whole, &steps(random)),
            // A content whose checksum is right.
            1 => record::framed(&damaged(&content, &steps(random))),
            _ => record::framed(&with_damaged_matrix(&content, &steps(random))),
        };
        fs::write(&path, bytes).expect("written");
        let (path, whole) = (path.clone(), whole.clone());
        Box::new(move || fs::write(path, whole).expect("written"))
    });
    assert!(share > 0.5, "{share} of the cases are noticed");
}

/// The frame with one more laser, whose matrix is damaged before it is compressed.
fn with_damaged_matrix(content: &[u8], steps: &[Step]) -> Vec<u8> {
    let sides = record::Message::default().integer(1, 4).integer(1, 5).integer(1, 4);
    let matrix = record::Message::default().bytes(1, &[0x3f; 4 * 4 * 5 * 4]).bytes(2, &sides.0);
    let packed = record::deflated(&damaged(&matrix.0, steps));
    let image = record::Message::default().bytes(2, &packed);
    let laser = record::Message::default().integer(1, 2).bytes(2, &image.0);
    record::Message(content.to_vec()).bytes(5, &laser.0).0
}

#[test]
fn damaged_parquet() {
    modular_cases(SHORT);
}

#[test]
fn damaged_records() {
    record_cases(SHORT);
}

#[test]
#[ignore = "as long as wanted: GS_FUZZ_CASES cases for each layout"]
fn damaged_for_long() {
    let count = asked(LONG) as usize;
    modular_cases(count);
    record_cases(count);
}

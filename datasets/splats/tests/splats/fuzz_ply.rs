//! Small sound PLY scenes, damaged: reading them does not panic, its memory is bounded, and what is read is finite.
//!
//! A short run goes with all other tests. The long one is asked for:
//!
//! ```text
//! GS_FUZZ_CASES=100000 cargo test --release -p gs-splats -- --ignored
//! ```

use std::fs;

use gs_splats::Splats;
use gs_splats::ply::{read, write};

use crate::bounded::{asked, kept, run, steps};
use crate::mutate::damaged;

/// Cases for each encoding with all other tests.
const SHORT: u32 = 64;

/// Cases for each encoding when no number is given.
const LONG: u32 = 20_000;

/// Three Gaussians as this crate writes them, far from their world's origin, and the same in the two other encodings.
fn seeds() -> [Vec<u8>; 3] {
    fn ramp<const C: usize>(count: usize) -> Vec<[f32; C]> {
        (0..count).map(|row| std::array::from_fn(|column| 0.1 * ((row * C + column) as f32 + 1.0))).collect()
    }
    let splats = Splats {
        means: ramp(3),
        offset: [450_123.5, 5_200_456.25, -300.0],
        quats: ramp(3),
        log_scales: ramp(3),
        opacity_logits: ramp::<1>(3).into_flattened(),
        degree: 1,
        sh: ramp(12),
        antialiased: Some(true),
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.ply");
    write(&path, &splats).expect("written");
    let little = fs::read(&path).expect("read");
    let end = b"end_header\n";
    let len = little.windows(end.len()).position(|window| window == end).expect("a header") + end.len();
    let header = String::from_utf8(little[..len].to_vec()).expect("text");
    let values = || little[len..].chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().expect("four")));
    let renamed = |encoding: &str| header.replace("binary_little_endian", encoding).into_bytes();
    let big: Vec<u8> = values().flat_map(f32::to_be_bytes).collect();
    let columns = values().count() / 3;
    let rows: Vec<String> = values().map(|value| value.to_string()).collect();
    let text: String = rows.chunks(columns).map(|row| row.join(" ") + "\n").collect();
    let big = [renamed("binary_big_endian"), big].concat();
    let text = [renamed("ascii"), text.into_bytes()].concat();
    [little, big, text]
}

fn fuzz(cases: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.ply");
    for (encoding, whole) in seeds().into_iter().enumerate() {
        fs::write(&path, &whole).expect("written");
        assert_eq!(read(&path).expect("the seed itself is sound").splats.len(), 3, "encoding {encoding}");
        run(&format!("encoding {encoding}"), cases, steps(), |steps| {
            fs::write(&path, damaged(&whole, &steps)).expect("written");
            kept("scene.ply", || examine(&path))
        });
    }
}

fn examine(path: &std::path::Path) {
    match read(path) {
        Ok(scene) => {
            scene.splats.check().expect("whole and finite");
        }
        Err(error) => {
            let text = error.to_string();
            assert!(!text.chars().any(char::is_control) && text.contains("scene.ply"), "{text:?}");
        }
    }
}

#[test]
fn damaged_scenes_never_panic() {
    fuzz(SHORT);
}

#[test]
#[ignore = "as long as wanted: GS_FUZZ_CASES cases for each encoding"]
fn damaged_scenes_for_long() {
    fuzz(asked(LONG));
}

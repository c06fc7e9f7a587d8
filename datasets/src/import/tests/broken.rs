//! Archives in every type and order, and archives that are broken.

use std::path::Path;

use super::super::arrays::Arrays;
use super::super::prediction;
use super::archive::{floats, npy, npz, texts};
use crate::findings::Findings;

fn saved(bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("predictions.npz");
    std::fs::write(&path, bytes).expect("a file");
    (folder, path)
}

fn open(path: &Path) -> Arrays {
    Arrays::open(path, &mut Findings::default()).expect("arrays")
}

/// A dictionary of two views of 3 x 2 pixels.
fn dictionary() -> Vec<(&'static str, Vec<u8>)> {
    let camera = |x: f32| [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    vec![
        ("extrinsic", floats(&[1, 2, 3, 4], [camera(0.0), camera(-1.0)].concat())),
        ("depth", floats(&[2, 2, 3, 1], (1..=12).map(|value| value as f32))),
        ("image_names", texts(&["a.png", "\u{e9}.png"])),
    ]
}

#[test]
fn every_type_and_order_is_read_from_stored_and_deflated_archives() {
    let halves: Vec<u8> = [0x3c00_u16, 0x4000, 0xc200, 0x0001, 0x7c00, 0x3555].map(u16::to_le_bytes).concat();
    let entries = vec![
        ("half", npy("<f2", false, &[6], &halves)),
        ("double", npy(">f8", false, &[2], &[1.5_f64, -2.0].map(f64::to_be_bytes).concat())),
        ("long", npy("<i8", false, &[2], &[7_i64, -9].map(i64::to_le_bytes).concat())),
        ("fortran", npy("<f4", true, &[2, 3], &[1.0_f32, 4.0, 2.0, 5.0, 3.0, 6.0].map(f32::to_le_bytes).concat())),
        ("names", texts(&["one", "three"])),
    ];
    for deflated in [false, true] {
        let (_folder, path) = saved(&npz(&entries, deflated));
        let mut arrays = open(&path);
        let mut values = |name: &str| arrays.numbers(name).expect("read").expect("there").values;
        // 1, 2, -3, the smallest subnormal 2^-24, infinity, and 0.333 in halves.
        assert_eq!(values("half")[..5], [1.0, 2.0, -3.0, 2.0_f64.powi(-24), f64::INFINITY]);
        assert_eq!((values("double"), values("long")), (vec![1.5, -2.0], vec![7.0, -9.0]));
        assert_eq!(values("fortran"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(arrays.texts("names").expect("read"), Some(vec!["one".to_string(), "three".to_string()]));
        assert!(arrays.numbers("absent").expect("no error").is_none());
    }
}

/// NumPy 2 writes the same files; a header of version 2 has a longer length.
#[test]
fn a_header_of_version_2_and_a_folder_of_files_are_read() {
    let first = floats(&[2], [1.0, 2.0]);
    let mut second = b"\x93NUMPY\x02\x00".to_vec();
    second.extend([first[8], first[9], 0, 0]);
    second.extend(&first[10..]);
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("depth.npy"), second).expect("a file");
    std::fs::write(folder.path().join("readme.txt"), "no array").expect("a file");
    let mut arrays = open(folder.path());
    assert_eq!(arrays.names(), ["depth"]);
    assert_eq!(arrays.numbers("depth").expect("read").expect("there").values, [1.0, 2.0]);
}

#[test]
fn a_dictionary_gives_cameras_depth_and_names() {
    let (_folder, path) = saved(&npz(&dictionary(), true));
    let read = prediction::read(&path, &mut Findings::default()).expect("a prediction");
    assert_eq!((read.views.len(), read.size), (2, (3, 2)));
    assert_eq!(read.views[1].centre, glam::DVec3::X, "the world's x is 1 more than the camera's");
    assert_eq!(read.views[1].depth[0], 7.0);
    assert!(read.views[0].confidence.iter().all(|value| *value > 1.0), "nothing says that a depth is unsure");
    assert_eq!(read.names, Some(vec!["a.png".to_string(), "\u{e9}.png".to_string()]));
}

/// `pose_enc` says the same as `extrinsic`: translation 1, 2, 3, a quarter turn about z, a field of view of 90 degrees.
#[test]
fn an_encoded_pose_is_a_camera() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let angle = std::f32::consts::FRAC_PI_2;
    let entries = vec![
        ("pose_enc", floats(&[1, 9], [1.0, 2.0, 3.0, 0.0, 0.0, half, half, angle, angle])),
        ("depth", floats(&[1, 2, 4], [1.0; 8])),
    ];
    let (_folder, path) = saved(&npz(&entries, false));
    let view = prediction::read(&path, &mut Findings::default()).expect("a prediction").views.remove(0);
    // The camera sees the world's x as its y: rotation and translation of the world's (-2, 1, -3) cancel.
    assert!(view.centre.distance(glam::DVec3::new(-2.0, 1.0, -3.0)) < 1e-6, "{}", view.centre);
    let (x, y) = view.focal.expect("a focal length");
    assert!((x - 2.0).abs() < 1e-6 && (y - 1.0).abs() < 1e-6, "{x}, {y}");
}

/// Every prefix of an archive, and every archive with one byte changed, gives arrays or a sentence.
#[test]
fn cut_and_changed_archives_give_a_sentence() {
    let whole = npz(&dictionary(), true);
    for end in 0..whole.len() {
        let (_folder, path) = saved(&whole[..end]);
        assert!(prediction::read(&path, &mut Findings::default()).is_err(), "{end} of {} bytes", whole.len());
    }
    for at in 0..whole.len() {
        let mut changed = whole.clone();
        changed[at] ^= 0xff;
        let (_folder, path) = saved(&changed);
        if let Err(error) = prediction::read(&path, &mut Findings::default()) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}

#[test]
fn shapes_that_contradict_each_other_are_named() {
    let says = |change: (&'static str, Vec<u8>), expected: &str| {
        let mut entries = dictionary();
        entries.retain(|(name, _)| *name != change.0);
        entries.push(change);
        let (_folder, path) = saved(&npz(&entries, false));
        let error = prediction::read(&path, &mut Findings::default()).expect_err("a contradiction").to_string();
        assert!(error.contains(expected), "{error}");
    };
    says(("depth", floats(&[3, 2, 2, 1], [1.0; 12])), "expected (2, H, W, 1)");
    says(("depth_conf", floats(&[2, 3, 2], [1.0; 12])), "expected (2, 2, 3)");
    says(("extrinsic", floats(&[2, 12], [1.0; 24])), "(S, 3, 4)");
    says(("extrinsic", floats(&[2, 3, 4], [f32::NAN; 24])), "view 0: expected a rotation");
    // A petabyte in the header and nothing behind it.
    says(("depth", npy("<f4", false, &[2, 1 << 24, 1 << 24, 1], &[])), "values: expected an array of");
    says(("depth", npy("|O", false, &[2], b"\x80\x04.")), "keys: expected the key `depth` or `world_points`");
}

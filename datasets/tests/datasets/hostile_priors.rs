//! Broken and hostile files beside sound photos: the photo loads, the file is left out with a warning, nothing panics.

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    SmallVec, Vec2, WritableImage, f16,
};
use gs_datasets::{Holdout, LoadOptions, check, image_io::write_exr, load};
use proptest::prelude::*;
use serde_json::json;

use crate::fixtures::{Folder, npy, npy_f32, rig};

/// A set of one photo whose depth, mask and velocity are all this file.
fn set() -> Folder {
    let folder = Folder::new();
    let mut top = rig(&folder, "train", 0, 1, 1);
    top["mask_meaning"] = json!("dynamic");
    top["depth_kind"] = json!("depth");
    top["frames"][0]["depth_file_path"] = json!("file");
    top["frames"][0]["mask_path"] = json!("file");
    top["frames"][0]["pseudo_sharp_path"] = json!("file");
    top["frames"][0]["truth"] = json!({ "velocity_path": "file" });
    folder.write_json("transforms_train.json", &top);
    folder
}

/// Loads and checks the set; whether the depth could be used, and the warnings.
fn try_file(folder: &Folder, bytes: &[u8]) -> (bool, Vec<String>) {
    folder.write("file", bytes);
    let options = LoadOptions { holdout: Holdout::None, ..LoadOptions::default() };
    let scene = load(folder.path(), &options).expect("a prior cannot keep a scene from loading");
    assert!(check(folder.path(), &options).is_ok());
    (scene.train[0].priors.depth.is_some(), scene.warnings)
}

fn ramp() -> Vec<f32> {
    (0..48).map(|i| i as f32).collect()
}

fn exr() -> Vec<u8> {
    let folder = Folder::new();
    let values = ramp();
    write_exr(&folder.file("d.exr"), 8, 6, &[("R", &values), ("G", &values), ("B", &values)]).expect("written");
    std::fs::read(folder.file("d.exr")).expect("read")
}

#[test]
fn arrays_that_are_none() {
    let folder = set();
    let zeros = [0_u8; 400];
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("a magic and nothing", b"\x93NUMPY".to_vec()),
        ("an unknown version", npy(9, "<f4", false, "(6, 8)", &zeros)),
        ("too few values", npy(1, "<f8", false, "(6, 80)", &zeros)),
        ("more values than memory", npy(1, "<f8", false, "(4611686018427387904, 4611686018427387904)", &zeros)),
        ("more digits than a number", npy(1, "<f8", false, "(99999999999999999999999, 1)", &zeros)),
        ("a negative side", npy(1, "<f4", false, "(-6, 8)", &zeros)),
        ("no side", npy(1, "<f4", false, "()", &zeros)),
        ("no pixel", npy(1, "<f4", false, "(0, 8)", &zeros)),
        ("one axis", npy(1, "<f4", false, "(48,)", &zeros)),
        ("two planes", npy(1, "<f4", false, "(2, 6, 8)", &zeros)),
        ("text", npy(1, "<U4", false, "(6, 8)", &zeros)),
        ("objects", npy(1, "|O", false, "(6, 8)", &zeros)),
        ("no type", npy(1, "", false, "(6, 8)", &zeros)),
        ("a type that is no text", npy(1, "é", false, "(6, 8)", &zeros)),
        ("a huge type", npy(1, "<f99999999999999999999", false, "(6, 8)", &zeros)),
        ("a header without end", [b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), zeros.to_vec()].concat()),
        ("a header of rubbish", [b"\x93NUMPY\x01\x00\x10\x00".to_vec(), vec![0xff; 64]].concat()),
    ];
    for (what, bytes) in files {
        let (used, warnings) = try_file(&folder, &bytes);
        assert!(!used, "{what}");
        assert!(warnings.iter().any(|text| text.contains("depth priors of 1 of 1 view ")), "{what}: {warnings:?}");
    }
    let (used, _) = try_file(&folder, &npy_f32("(6, 8)", &ramp()));
    assert!(used, "the fixture itself is sound");
}

#[test]
fn a_cut_file_is_left_out_wherever_it_is_cut() {
    let folder = set();
    for whole in [exr(), npy_f32("(6, 8)", &ramp())] {
        assert!(try_file(&folder, &whole).0, "the whole file is sound");
        for length in (0..whole.len()).step_by(7) {
            let (used, _) = try_file(&folder, &whole[..length]);
            assert!(!used, "{length} of {} bytes", whole.len());
        }
    }
}

#[test]
fn an_exr_that_claims_to_be_huge_asks_for_no_memory() {
    let folder = set();
    let whole = exr();
    // dataWindow: four i32 after "dataWindow\0box2i\0" and the attribute's length.
    let key = b"dataWindow\0box2i\0";
    let start = whole.windows(key.len()).position(|window| window == key).expect("a window") + key.len() + 4;
    for side in [65_535_i32, i32::MAX, -1, i32::MIN] {
        let mut bytes = whole.clone();
        bytes[start + 8..start + 12].copy_from_slice(&side.to_le_bytes());
        bytes[start + 12..start + 16].copy_from_slice(&side.to_le_bytes());
        assert!(!try_file(&folder, &bytes).0, "{side}");
    }
}

/// Every compression, scan lines and tiles, floats and halves: each has a decoder of its own to break.
fn encoded(kind: usize) -> Vec<u8> {
    let compression = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
    ][kind % 8];
    let blocks = if kind & 8 == 0 { Blocks::ScanLines } else { Blocks::Tiles(Vec2(4, 4)) };
    let samples = if kind & 16 == 0 {
        FlatSamples::F32((0..48).map(|i| 0.37 * i as f32).collect())
    } else {
        FlatSamples::F16((0..48).map(|i| f16::from_f32(0.37 * i as f32)).collect())
    };
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let channels = AnyChannels::sort(SmallVec::from_vec(vec![AnyChannel::new("Z", samples)]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let layer = Layer::new(Vec2(8, 6), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_buffered(&mut bytes).expect("encoded");
    bytes.into_inner()
}

#[test]
fn every_encoding_of_exr_is_read() {
    let folder = set();
    for kind in 0..KINDS {
        assert!(try_file(&folder, &encoded(kind)).0, "encoding {kind}");
    }
}

#[test]
fn every_byte_of_a_tiled_file_may_be_wrong() {
    // The decoder of resolution levels asserts what a damaged file can break.
    let folder = set();
    let whole = encoded(14);
    for place in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[place] = 1;
        try_file(&folder, &bytes);
    }
}

/// How many files [`encoded`] makes.
const KINDS: usize = 32;

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_never_panic(
        kind in 0..KINDS + 4,
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let folder = set();
        let mut bytes = if kind < KINDS { encoded(kind) } else { npy_f32("(6, 8)", &ramp()) };
        for (place, value) in damage {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        try_file(&folder, &bytes);
    }

    #[test]
    fn rubbish_after_a_magic_never_panics(is_exr: bool, rest in proptest::collection::vec(any::<u8>(), 0..400)) {
        let folder = set();
        let magic: &[u8] = if is_exr { &[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0] } else { b"\x93NUMPY\x01\x00" };
        try_file(&folder, &[magic, &rest].concat());
    }
}

//! Broken and hostile input: an error that names the file, never a panic.

use gs_datasets::{LoadOptions, check, load, load_cameras};
use proptest::prelude::*;
use serde_json::json;

use crate::colmap;
use crate::fixtures::{Folder, ring_scene};

fn error_of(folder: &Folder) -> String {
    load(folder.path(), &LoadOptions::default()).expect_err("broken").to_string()
}

/// Everything that reads a data set; the answers do not matter here.
fn read_all(folder: &Folder) {
    let options = LoadOptions { max_width: Some(7), ..LoadOptions::default() };
    let loaded = load(folder.path(), &options);
    let report = check(folder.path(), &options);
    if loaded.is_ok() {
        assert!(report.is_ok(), "what loads is good by the report: {report}");
    } else {
        assert!(!report.is_ok(), "what does not load is bad by the report: {:?}", loaded.err());
    }
    let _ = load_cameras(folder.path());
}

#[test]
fn json_that_is_not_a_scene() {
    let folder = Folder::new();
    let deep = "[".repeat(100_000);
    for text in [
        "",
        "{",
        "[]",
        "null",
        "{}",
        r#"{"frames": []}"#,
        r#"{"frames": 3}"#,
        r#"{"frames": [3]}"#,
        "{\"a\": NaN",
        &deep,
    ] {
        folder.write("transforms.json", text);
        let error = error_of(&folder);
        assert!(error.contains("transforms.json") || error.contains("empty list of frames"), "{text:.20}: {error}");
        read_all(&folder);
    }
    folder.write("transforms.json", [0xff, 0xfe, 0x00]);
    assert!(error_of(&folder).contains("UTF-8"));
}

#[test]
fn wrong_types_name_the_key() {
    for (key, value) in [
        ("fl_x", json!("long")),
        ("fl_x", json!(0)),
        ("w", json!(-5)),
        ("h", json!(1e300)),
        ("cx", json!([1])),
        ("k1", json!({})),
        ("camera_model", json!(7)),
        ("camera_angle_x", json!(4)),
        ("train_filenames", json!([1, 2])),
        ("ply_file_path", json!(1)),
    ] {
        let (folder, mut top) = ring_scene(2);
        if key == "camera_angle_x" {
            top.as_object_mut().expect("an object").retain(|key, _| !key.starts_with("fl"));
        }
        top[key] = value;
        folder.write_json("transforms.json", &top);
        let error = error_of(&folder);
        assert!(error.contains("transforms.json") && error.contains(key), "{key}: {error}");
    }
    for value in [json!(null), json!(3), json!([[1, 2], [3, 4]]), json!([[1, 0, 0, 0], [0, 1, 0], [0, 0, 1, 0]])] {
        let (folder, mut top) = ring_scene(2);
        top["frames"][1]["transform_matrix"] = value;
        folder.write_json("transforms.json", &top);
        let error = error_of(&folder);
        assert!(error.contains("images/01.png") && error.contains("transform_matrix"), "{error}");
    }
}

#[test]
fn an_unreadable_image_is_named() {
    let (folder, top) = ring_scene(3);
    folder.write_json("transforms.json", &top);
    let whole = std::fs::read(folder.file("images/01.png")).expect("read");
    for bytes in [&b""[..], b"no image at all", &whole[..whole.len() / 2]] {
        folder.write("images/01.png", bytes);
        let error = error_of(&folder);
        assert!(error.contains("images/01.png"), "{error}");
    }
    // A header that promises 4 gigapixels.
    let mut huge = whole.clone();
    huge[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
    folder.write("images/01.png", huge);
    assert!(error_of(&folder).contains("images/01.png"));
}

/// The decoder would fill the rest of a photo with grey.
#[test]
fn a_jpeg_cut_short_is_named() {
    let (folder, mut top) = ring_scene(3);
    let photo = image::RgbImage::from_fn(32, 24, |x, y| image::Rgb([(x * 8) as u8, (y * 10) as u8, 77]));
    photo.save(folder.file("images/01.jpg")).expect("written");
    top["frames"][1]["file_path"] = json!("images/01.jpg");
    folder.write_json("transforms.json", &top);
    folder.load(&LoadOptions::default());
    let whole = std::fs::read(folder.file("images/01.jpg")).expect("read");
    for length in [20, whole.len() / 2, whole.len() - 2] {
        folder.write("images/01.jpg", &whole[..length]);
        let error = error_of(&folder);
        assert!(error.contains("images/01.jpg") && (length == 20 || error.contains("cut short")), "{error}");
        assert!(!check(folder.path(), &LoadOptions::default()).is_ok());
    }
}

#[test]
fn intrinsics_of_no_camera_are_refused_and_those_of_another_size_said() {
    let (folder, mut top) = ring_scene(3);
    for key in ["w", "h"] {
        top.as_object_mut().expect("an object").remove(key);
    }
    for (key, value) in [("cx", 960.0), ("cx", -960.0), ("cy", 1e30), ("fl_x", 1e300), ("fl_x", 1e-300)] {
        let mut wrong = top.clone();
        wrong[key] = json!(value);
        wrong.as_object_mut().expect("an object").remove("fl_y");
        folder.write_json("transforms.json", &wrong);
        let error = error_of(&folder);
        assert!(error.contains("image sides") && error.contains("principal point"), "{key} {value}: {error}");
        // The values are shown as numbers, and no debug text is.
        assert!(error.contains(" pixels (x) and not given (y)"), "{key} {value}: {error}");
        assert!(!error.contains("Some(") && !error.contains("None"), "{key} {value}: {error}");
    }
    // Those of photos twice as wide.
    top["cx"] = json!(32.0);
    folder.write_json("transforms.json", &top);
    let said = |warnings: &[String]| warnings.iter().any(|text| text.contains("(cx, cy) of 3 views"));
    assert!(said(&folder.load(&LoadOptions::default()).warnings));
    assert!(said(&check(folder.path(), &LoadOptions::default()).warnings));
}

#[test]
fn options_without_meaning_are_refused() {
    let (folder, top) = ring_scene(3);
    folder.write_json("transforms.json", &top);
    folder.refused(&LoadOptions { max_width: Some(0), ..LoadOptions::default() }, &["max_width"]);
    folder.refused(&LoadOptions { background: [f32::NAN; 3], ..LoadOptions::default() }, &["background"]);
}

#[test]
fn a_binary_model_cut_anywhere_names_the_file() {
    let folder = Folder::new();
    let model = colmap::example(&folder);
    for (whole, stem) in model.binary().iter().zip(colmap::STEMS) {
        model.write_binary(&folder, "sparse/0");
        let file = &format!("sparse/0/{stem}.bin");
        for length in 0..whole.len() {
            folder.write(file, &whole[..length]);
            let error = error_of(&folder);
            assert!(error.contains(file) && error.contains("byte "), "{error}");
        }
        folder.write(file, [&whole[..], &[0]].concat());
        assert!(error_of(&folder).contains("1 more byte"));
    }
}

#[test]
fn binary_counts_are_bounded_by_the_file() {
    let folder = Folder::new();
    let model = colmap::example(&folder);
    let whole = model.binary();
    for (whole, stem) in whole.iter().zip(colmap::STEMS) {
        model.write_binary(&folder, "sparse/0");
        let file = &format!("sparse/0/{stem}.bin");
        for count in [u64::MAX, u64::MAX / 48, 1 << 40] {
            folder.write(file, [&count.to_le_bytes(), &whole[8..]].concat());
            assert!(error_of(&folder).contains(file));
        }
    }
    let mut unknown = whole[0].clone();
    unknown[12..16].copy_from_slice(&18_i32.to_le_bytes());
    folder.write("sparse/0/cameras.bin", unknown);
    assert!(error_of(&folder).contains("model 18"));
}

#[test]
fn points_and_poses_that_are_not_finite_are_named() {
    let folder = Folder::new();
    let mut model = colmap::example(&folder);
    model.points[3].position[1] = f64::NAN;
    model.write_binary(&folder, "sparse/0");
    assert!(error_of(&folder).contains("point 14"));
    let mut model = colmap::example(&folder);
    model.images[2].q = [0.0; 4];
    model.write_binary(&folder, "sparse/0");
    assert!(error_of(&folder).contains("a photo.png"));
    let mut model = colmap::example(&folder);
    model.images[2].t = [1e200, 0.0, 0.0];
    model.write_binary(&folder, "sparse/0");
    let error = error_of(&folder);
    assert!(error.contains("a photo.png") && error.contains("within 1e15 scene units"), "{error}");
}

proptest! {
    #[test]
    fn garbage_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..300), which in 0..6_usize) {
        let (folder, mut top) = ring_scene(2);
        top["ply_file_path"] = json!("points.ply");
        folder.write_json("transforms.json", &top);
        let file = ["transforms.json", "points.ply", "images/00.png"].get(which).copied();
        if let Some(file) = file {
            let ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nproperty float y\n\
                        property float z\nend_header\n";
            let head = if which == 1 { &ply[..] } else { &[] };
            folder.write(file, [head, &bytes].concat());
        } else {
            std::fs::remove_file(folder.file("transforms.json")).expect("removed");
            colmap::example(&folder).write_binary(&folder, "sparse/0");
            folder.write(&format!("sparse/0/{}.bin", colmap::STEMS[which - 3]), bytes);
        }
        read_all(&folder);
    }

    #[test]
    fn a_flipped_byte_never_panics(
        which in 0..8_usize,
        at in any::<prop::sample::Index>(),
        value in any::<u8>(),
        cut in any::<bool>(),
    ) {
        let (folder, top) = ring_scene(2);
        folder.write_json("transforms.json", &top);
        let file = if which == 0 {
            "transforms.json".to_string()
        } else if which == 7 {
            "images/00.png".to_string()
        } else {
            std::fs::remove_file(folder.file("transforms.json")).expect("removed");
            let (write, ending) = colmap::ENCODINGS[(which - 1) / 3];
            write(&colmap::example(&folder), &folder, "sparse/0");
            format!("sparse/0/{}.{ending}", colmap::STEMS[(which - 1) % 3])
        };
        let mut bytes = std::fs::read(folder.file(&file)).expect("read");
        let at = at.index(bytes.len());
        if cut { bytes.truncate(at) } else { bytes[at] = value }
        folder.write(&file, bytes);
        read_all(&folder);
    }
}

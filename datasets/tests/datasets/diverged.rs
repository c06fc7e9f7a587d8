//! Broken calibrations: lenses that fold inside the photo, cameras without numbers. One fault is one sentence.

use gs_datasets::{check, load, load_cameras};
use serde_json::json;

use crate::colmap::{Camera, example};
use crate::fixtures::{Folder, all, names, ring_scene};

/// Photos of 32 x 24 pixels with a focal length of 30: corners are at 0.66 focal lengths.
#[test]
fn a_lens_that_folds_inside_the_photo_is_refused_with_its_radius() {
    // r (1 - 45 r^2) turns at r = 0.0861, which is seen at two thirds of it: 0.0574 focal lengths.
    for (keys, radius) in [
        (vec![("k1", -45.0)], "0.0574 focal lengths (1.7 pixels)"),
        (vec![("k1", -44.85), ("k2", 1017.4), ("p1", 0.621), ("p2", 0.94)], "focal lengths"),
        (vec![("k3", -500.0)], "focal lengths"),
        (vec![("k4", -4000.0)], "focal lengths"),
        (vec![("k1", 500.0)], "times as far out"),
    ] {
        let (folder, mut top) = ring_scene(4);
        for (key, value) in &keys {
            top[*key] = json!(value);
        }
        folder.write_json("transforms.json", &top);
        let error = load(folder.path(), &all()).expect_err("diverged").to_string();
        let report = check(folder.path(), &all());
        assert_eq!(report.errors.len(), 1, "{report}");
        for text in [&error, &report.errors[0]] {
            let (key, value) = keys[0];
            assert!(text.contains(radius) && text.contains("the calibration diverged"), "{text}");
            assert!(text.contains("transforms.json") && text.contains(&format!("{key} {value}")), "{text}");
        }
        assert!(report.errors[0].contains("4 times"), "{report}");
    }
}

#[test]
fn a_lens_of_every_colmap_model_that_folds_is_refused() {
    // The example's photos are 40 x 30 with a focal length of 40: corners are at 0.63 focal lengths.
    let [f, cx, cy, k] = [40.0, 20.0, 15.0, -9.0];
    for (model, params) in [
        (2, vec![f, cx, cy, k]),
        (3, vec![f, cx, cy, k, 0.0]),
        (4, vec![f, f, cx, cy, k, 0.0, 0.0, 0.0]),
        (4, vec![f, f, cx, cy, 0.0, 0.0, 0.9, 0.0]),
        (6, vec![f, f, cx, cy, k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (6, vec![f, f, cx, cy, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0]),
    ] {
        let folder = Folder::new();
        let mut example = example(&folder);
        example.cameras[1] = Camera { id: 4, model, width: 40, height: 30, params };
        example.write_binary(&folder, "sparse/0");
        folder.refused_by_both(&all(), &["folds back", "cameras.bin"]);
    }
}

/// Wide lenses may turn back in the corners, which are left out then, and beyond the photo.
#[test]
fn a_lens_that_folds_in_the_corners_or_outside_loads() {
    // r (1 - k r^2) turns at two thirds of sqrt(1 / 3k): seen at 0.60 of 0.66, and at 0.77.
    for (k1, is_cut) in [(-0.41, true), (-0.25, false)] {
        let (folder, mut top) = ring_scene(3);
        top["k1"] = json!(k1);
        let scene = folder.scene(&top, &all());
        assert!(scene.train[0].mask.is_none() || is_cut, "{k1}");
        assert!(check(folder.path(), &all()).is_ok());
    }
}

/// As COLMAP writes a camera whose adjustment diverged, on Windows and on Linux, and as a text is cut.
#[test]
fn a_broken_camera_costs_its_own_images() {
    for (line, word) in [
        ("12 SIMPLE_PINHOLE 40 30 -nan(ind) 20 15", "finite parameters"),
        ("12 SIMPLE_PINHOLE 40 30 nan 20 15", "finite parameters"),
        ("12 SIMPLE_PINHOLE 40 30 -1.#IND 20 15", "finite parameters"),
        ("12 SIMPLE_PINHOLE 40 30 inf 20 15", "finite parameters"),
        ("12 SIMPLE_PINHOLE 40 30 40 20", "3 parameters for SIMPLE_PINHOLE"),
        ("12 SIMPLE_PINHOLE 40 30 40 20 15 0", "one more: 0"),
        ("12 SIMPLE_PINHOLE 40 thirty 40 20 15", "a height"),
    ] {
        let folder = Folder::new();
        example(&folder).write_text(&folder, "sparse/0");
        let text = std::fs::read_to_string(folder.file("sparse/0/cameras.txt")).expect("read");
        let lines = text.lines().map(|old| if old.starts_with("12 ") { line } else { old });
        folder.write("sparse/0/cameras.txt", lines.collect::<Vec<_>>().join("\n"));
        let scene = folder.load(&all());
        assert_eq!(names(&scene.train), ["a photo", "b", "left/a"], "{line}");
        let report = check(folder.path(), &all());
        assert!(report.is_ok() && report.warnings == scene.warnings, "{report}");
        assert_eq!(report.warnings.len(), 1, "{report}");
        let said = &report.warnings[0];
        assert!(said.contains(word) && said.contains("1 image of this camera was left out (z.png)"), "{said}");
    }
    let folder = Folder::new();
    let mut model = example(&folder);
    model.cameras[0].params[1] = f64::NAN;
    model.write_binary(&folder, "sparse/0");
    assert_eq!(folder.load(&all()).train.len(), 3);
    // Without any sound camera there is nothing.
    model.cameras[1].params[1] = f64::NAN;
    model.write_binary(&folder, "sparse/0");
    folder.refused(&all(), &["no sound camera of 4 images"]);
    assert!(!check(folder.path(), &all()).is_ok());
}

/// One camera of three images, and one camera for each image.
#[test]
fn a_camera_model_that_is_not_read_is_one_sentence() {
    for is_each in [false, true] {
        let folder = Folder::new();
        let mut model = example(&folder);
        model.cameras.truncate(1);
        for i in 0..3 {
            let id = if is_each { 100 + i as u32 } else { 77 };
            model.images[i].camera_id = id;
            if is_each || i == 0 {
                model.cameras.push(Camera { id, model: 11, width: 40, height: 30, params: vec![1.0; 16] });
            }
        }
        model.write_binary(&folder, "sparse/0");
        let report = check(folder.path(), &all());
        assert_eq!(report.errors.len(), 1, "{report}");
        assert!(report.errors[0].contains("model RAD_TAN_THIN_PRISM_FISHEYE of 3 images"), "{report}");
        assert!(!load(folder.path(), &all()).is_ok_and(|_| true));
    }
    // Cameras that no line lists.
    let folder = Folder::new();
    let mut model = example(&folder);
    model.images[0].camera_id = 1000;
    model.images[1].camera_id = 1001;
    model.write_text(&folder, "sparse/0");
    let report = check(folder.path(), &all());
    assert_eq!(report.errors.len(), 1, "{report}");
    assert!(report.errors[0].contains("cameras 1000, 1001 of 2 images"), "{report}");
    // A list of cameras that cannot be read is one fault.
    folder.write("sparse/0/cameras.txt", "one PINHOLE 40 30\n");
    let report = check(folder.path(), &all());
    assert_eq!(report.errors.len(), 1, "{report}");
}

/// Editors of Windows begin a text with a byte order mark; some tools drop empty lines, some all lines of observations.
#[test]
fn texts_of_other_tools_are_read() {
    let folder = Folder::new();
    let mut model = example(&folder);
    model.images[2].seen.clear();
    model.write_text(&folder, "sparse/0");
    let whole = folder.load(&all());
    let poses = load_cameras(folder.path()).expect("cameras");
    for name in ["cameras", "images", "points3D"] {
        let file = format!("sparse/0/{name}.txt");
        let text = std::fs::read_to_string(folder.file(&file)).expect("read");
        folder.write(&file, format!("\u{feff}{}", text.replace('\n', "\r\n")));
    }
    assert_eq!(folder.load(&all()), whole);
    let text = std::fs::read_to_string(folder.file("sparse/0/images.txt")).expect("read");
    let without_empty: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    assert_eq!(without_empty.len() + 2, text.lines().count(), "two images see nothing");
    let headers: Vec<&str> =
        text.lines().enumerate().filter(|(i, _)| *i == 0 || i % 2 == 1).map(|(_, line)| line).collect();
    for lines in [without_empty, headers] {
        folder.write("sparse/0/images.txt", lines.join("\n"));
        assert_eq!(folder.load(&all()), whole);
        assert_eq!(load_cameras(folder.path()).expect("cameras"), poses);
    }
    // Observations that are cut are no image.
    let cut = text.lines().map(|line| if line.contains(" -1") { &line[..line.len() / 2] } else { line });
    folder.write("sparse/0/images.txt", cut.collect::<Vec<_>>().join("\n"));
    folder.refused(&all(), &["observations"]);
}

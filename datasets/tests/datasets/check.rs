//! The report on a data set that may be broken.

use gs_datasets::{LoadOptions, SceneFormat, check};
use serde_json::json;

use crate::colmap;
use crate::fixtures::{Folder, move_camera, ring_scene};

#[test]
fn a_sound_scene_is_described() {
    let (folder, top) = ring_scene(9);
    folder.write_json("transforms.json", &top);
    let report = check(folder.path(), &LoadOptions { max_width: Some(16), ..LoadOptions::default() });
    assert!(report.is_ok() && report.warnings.is_empty(), "{report}");
    assert_eq!((report.format, report.train, report.views()), (Some(SceneFormat::Transforms), 7, 9));
    let text = report.to_string();
    for part in [
        "9 images are 32 x 24 pixels, loaded at 16 x 12",
        "30.00 by 31.00",
        "7 views train, 2 are held out (2 test): one in 8",
        "Good to load.",
    ] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
}

#[test]
fn all_errors_are_listed() {
    let (folder, mut top) = ring_scene(5);
    top["frames"][1]["transform_matrix"][0][0] = json!("NaN");
    top["frames"][2]["fl_x"] = json!(-3);
    folder.write("images/03.png", b"not an image");
    folder.write_json("transforms.json", &top);
    let report = check(folder.path(), &LoadOptions::default());
    assert_eq!(report.errors.len(), 3, "{report}");
    for part in ["images/01.png", "images/02.png", "images/03.png"] {
        assert!(report.errors.iter().any(|error| error.contains(part)), "{report}");
    }
    assert!(report.to_string().ends_with("Cannot be loaded: 3 errors."));
}

/// A mistake at the top level is in every frame, and one sentence.
#[test]
fn one_mistake_in_all_frames_is_one_error() {
    for (key, value) in [("fl_x", json!(-3)), ("cx", json!("middle")), ("h", json!(32)), ("ftheta_p0", json!(0.1))] {
        let (folder, mut top) = ring_scene(5);
        top[key] = value;
        folder.write_json("transforms.json", &top);
        let report = check(folder.path(), &LoadOptions::default());
        let about: Vec<&String> = report.errors.iter().filter(|error| error.contains("5 times: ")).collect();
        assert_eq!(about.len(), 1, "{report}");
        let names = ["images/00.png", "images/01.png", "images/02.png, ..."];
        assert!(names.iter().all(|name| about[0].contains(name)), "{report}");
        assert!(report.errors.len() <= 2, "{report}");
    }
    // A frame with another mistake is apart.
    let (folder, mut top) = ring_scene(5);
    top["fl_x"] = json!(-3);
    top["frames"][1]["fl_x"] = json!(-4);
    folder.write_json("transforms.json", &top);
    let report = check(folder.path(), &LoadOptions::default());
    assert!(report.errors[0].contains("found -3 (4 times: images/00.png, images/02.png"), "{report}");
    assert!(report.errors[1].contains("images/01.png") && report.errors[1].contains("found -4"), "{report}");
}

/// A world of millimetres is described in millimetres.
#[test]
fn small_worlds_have_digits() {
    let (folder, mut top) = ring_scene(9);
    for i in 0..9 {
        move_camera(&mut top["frames"][i], 0.001, [0.0; 3]);
    }
    folder.write_json("transforms.json", &top);
    let text = check(folder.path(), &LoadOptions::default()).to_string();
    assert!(text.contains("at distances of 0.00") && !text.contains("at distances of 0.00 "), "{text}");
}

#[test]
fn a_folder_of_nothing_is_an_error_in_the_report() {
    let folder = Folder::new();
    let report = check(folder.path(), &LoadOptions::default());
    assert!(report.errors[0].contains("an empty folder"), "{report}");
    assert!(!check(&folder.file("nowhere"), &LoadOptions::default()).is_ok());
}

#[test]
fn the_reprojection_error_of_an_exact_model_is_zero() {
    let folder = Folder::new();
    let model = colmap::example(&folder);
    model.write_text(&folder, "sparse/0");
    let report = check(folder.path(), &LoadOptions::default());
    assert!(report.is_ok(), "{report}");
    assert!(report.reprojection_median.expect("observations") < 1e-9, "{report}");
}

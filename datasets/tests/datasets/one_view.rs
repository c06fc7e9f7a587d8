//! A photo serves one view.

use gs_datasets::{check, load};
use serde_json::json;

use crate::colmap::example;
use crate::fixtures::{Folder, all, names, ring, ring_scene, warned};

fn assert_refused(folder: &Folder, parts: &[&str]) {
    let error = load(folder.path(), &all()).expect_err("ambiguous").to_string();
    let report = check(folder.path(), &all());
    assert_eq!(report.errors.len(), 1, "{report}");
    for text in [&error, &report.errors[0]] {
        assert!(parts.iter().all(|part| text.contains(part)), "{parts:?}: {text}");
    }
}

/// A rig whose photos were put into one folder.
#[test]
fn two_names_of_one_file_are_refused() {
    let folder = Folder::new();
    let mut model = example(&folder);
    for (image, name) in model.images.iter_mut().zip(["left/b.png", "right/b.png", "left/z.png", "right/z.png"]) {
        image.name = name.to_string();
    }
    model.write_binary(&folder, "sparse/0");
    assert_refused(&folder, &["left/b", "right/b", "images/b.png", "2 views"]);
    // A file that one of them names as it is belongs to that one.
    model.images[0].name = "b.png".to_string();
    model.images[2].name = "z.png".to_string();
    model.write_binary(&folder, "sparse/0");
    let scene = folder.load(&all());
    assert_eq!(names(&scene.train), ["b", "z"]);
    let said = scene.warnings.join(" ");
    assert!(said.contains("2 of 4 photos do not exist") && said.contains("right/b.png, right/z.png"), "{said}");
}

#[test]
fn two_poses_of_one_file_are_refused() {
    let (folder, mut top) = ring_scene(4);
    top["frames"][2]["file_path"] = json!("./images/01.png");
    folder.write_json("transforms.json", &top);
    assert_refused(&folder, &["1 view ", "images/01"]);
    // Also at two times.
    top["frames"][1]["time"] = json!(0.0);
    top["frames"][2]["time"] = json!(1.0);
    folder.write_json("transforms.json", &top);
    assert_refused(&folder, &["1 view ", "images/01"]);
    // And in two files.
    let frame = json!({ "file_path": "images/00", "transform_matrix": ring(3) });
    let test = json!({ "fl_x": 30.0, "w": 32, "h": 24, "frames": [frame] });
    top["frames"].as_array_mut().expect("frames").remove(2);
    folder.write_json("transforms_train.json", &top);
    folder.write_json("transforms_test.json", &test);
    std::fs::remove_file(folder.file("transforms.json")).expect("removed");
    assert_refused(&folder, &["1 view ", "images/00"]);
}

/// A frame listed twice, and one photo at several times of a static camera.
#[test]
fn one_pose_of_one_file_may_be_listed_again() {
    let (folder, mut top) = ring_scene(3);
    let again = top["frames"][1].clone();
    top["frames"].as_array_mut().expect("frames").push(again);
    let scene = folder.scene(&top, &all());
    assert_eq!(scene.train.len(), 3);
    warned(&scene.warnings, &["1 frame is listed more than once"]);
    for i in 0..4 {
        top["frames"][i]["time"] = json!(i as f64);
    }
    folder.write_json("transforms.json", &top);
    assert_eq!(folder.load(&all()).train.len(), 4);
}

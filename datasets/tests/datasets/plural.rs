//! Sentences about one thing.

use gs_base::{agree, counted};
use gs_datasets::check;
use serde_json::json;

use crate::fixtures::{Folder, all, cloud, ring_scene};

#[test]
fn one_view_is_and_two_views_are() {
    assert_eq!([0, 1, 2].map(|count| counted(count, "view")), ["0 views", "1 view", "2 views"]);
    assert_eq!([0, 1, 2].map(|count| agree(count, "is", "are")), ["are", "is", "are"]);
}

/// Sentences of a set in which everything is there once. "1 of 3 images" is right.
#[test]
fn nothing_is_one_things() {
    let folder = one_of_each();
    let report = check(folder.path(), &all()).to_string();
    let warnings = folder.load(&all()).warnings.join("\n");
    for line in report.lines().chain(warnings.lines()) {
        let words: Vec<&str> =
            line.split([' ', '(', ')', ',', ';', '.', ':']).filter(|word| !word.is_empty()).collect();
        for pair in words.windows(2).filter(|pair| pair[0] == "1") {
            assert!(!pair[1].ends_with('s') || ["is", "has", "was"].contains(&pair[1]), "{pair:?}: {line}");
        }
    }
}

fn one_of_each() -> Folder {
    let (folder, mut top) = ring_scene(2);
    folder.write("points.ply", cloud("float", &[[1.0, 2.0, 3.0]]));
    folder.photo("images/01.png", 64, 48);
    top["ply_file_path"] = json!("points.ply");
    top["k1"] = json!(0.01);
    let mut missing = top["frames"][0].clone();
    missing["file_path"] = json!("images/none.png");
    let repeated = top["frames"][0].clone();
    top["frames"][0]["time"] = json!(0.5);
    top["frames"][0]["exposure"] = json!(0.1);
    top["frames"].as_array_mut().expect("a list").extend([missing, repeated]);
    folder.write_json("transforms.json", &top);
    folder
}

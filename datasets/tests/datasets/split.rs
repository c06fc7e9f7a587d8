//! Which views are held out.

use gs_datasets::{Holdout, LoadOptions, load};
use serde_json::json;

use crate::fixtures::{names, ring_scene};

fn with(holdout: Holdout) -> LoadOptions {
    LoadOptions { holdout, ..LoadOptions::default() }
}

#[test]
fn every_eighth_by_name_is_the_default() {
    let (folder, mut top) = ring_scene(17);
    top["frames"].as_array_mut().expect("a list").reverse();
    folder.write_json("transforms.json", &top);
    let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
    assert_eq!(names(&scene.test), ["images/00", "images/08", "images/16"]);
    assert_eq!(scene.train.len(), 14);
    assert_eq!(names(&scene.train)[..2], ["images/01", "images/02"]);
    let scene = load(folder.path(), &with(Holdout::Every(5))).expect("loaded");
    assert_eq!(names(&scene.test), ["images/00", "images/05", "images/10", "images/15"]);
    let scene = load(folder.path(), &with(Holdout::None)).expect("loaded");
    assert_eq!((scene.train.len(), scene.test.len()), (17, 0));
}

#[test]
fn views_can_be_held_out_by_name() {
    let (folder, top) = ring_scene(4);
    folder.write_json("transforms.json", &top);
    let scene = load(folder.path(), &with(Holdout::Names(vec!["02".into(), "images/03".into()]))).expect("loaded");
    assert_eq!(names(&scene.test), ["images/02", "images/03"]);
    let error =
        load(folder.path(), &with(Holdout::Names(vec!["nobody".into()]))).expect_err("no such view").to_string();
    assert!(error.contains("nobody"), "{error}");
}

#[test]
fn the_data_sets_own_lists_win() {
    let (folder, mut top) = ring_scene(6);
    top["train_filenames"] = json!(["images/00.png", "./images/01.png", "images/02.png"]);
    top["val_filenames"] = json!(["images/03.png"]);
    top["test_filenames"] = json!(["images/04.png"]);
    folder.write_json("transforms.json", &top);
    let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
    assert_eq!(names(&scene.train), ["images/00", "images/01", "images/02"]);
    assert_eq!(names(&scene.test), ["images/04"]);
    assert!(scene.warnings[0].contains("1 frames are in none"), "{:?}", scene.warnings);
}

#[test]
fn the_data_sets_own_files_win_and_validation_stands_in_for_test() {
    let (folder, top) = ring_scene(6);
    let part = |range: std::ops::Range<usize>| {
        let mut part = top.clone();
        part["frames"] = json!(range.map(|i| top["frames"][i].clone()).collect::<Vec<_>>());
        part
    };
    folder.write_json("transforms_train.json", &part(0..3));
    folder.write_json("transforms_val.json", &part(3..4));
    let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), names(&scene.test)), (3, vec!["images/03"]));
    folder.write_json("transforms_test.json", &part(4..6));
    let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), names(&scene.test)), (3, vec!["images/04", "images/05"]));
    let scene = load(folder.path(), &with(Holdout::Every(3))).expect("loaded");
    assert_eq!(names(&scene.test), ["images/00", "images/03"], "an explicit rule covers all files");
    let scene = load(&folder.file("transforms_train.json"), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), scene.test.len()), (2, 1), "a file by itself is split like any other");
}

#[test]
fn of_standing_cameras_that_film_whole_cameras_are_held_out() {
    let (folder, mut top) = ring_scene(6);
    let frames = top["frames"].as_array_mut().expect("a list");
    let poses: Vec<_> = (0..3).map(|camera| frames[camera]["transform_matrix"].clone()).collect();
    for (index, frame) in frames.iter_mut().enumerate() {
        frame["transform_matrix"] = poses[index % 3].clone();
        frame["time"] = json!([0.0, 1.0][index / 3]);
        frame["exposure"] = json!(0.5);
    }
    let mut twice = top.clone();
    twice["frames"].as_array_mut().expect("a list").retain(|frame| frame["transform_matrix"] != poses[2]);
    folder.write_json("transforms_train.json", &top);
    let scene = load(&folder.file("transforms_train.json"), &LoadOptions::default()).expect("loaded");
    assert_eq!(names(&scene.test), ["images/01", "images/04"], "both times of the middle one");
    assert_eq!(scene.train.len(), 4);
    assert!(
        scene.warnings.iter().any(|warning| warning.contains("2 held-out photos are as blurry")),
        "{:?}",
        scene.warnings
    );
    // Of two cameras none can be spared.
    folder.write_json("transforms_train.json", &twice);
    let scene = load(&folder.file("transforms_train.json"), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), scene.test.len()), (3, 1));
}

#[test]
fn no_training_view_is_an_error() {
    let (folder, top) = ring_scene(1);
    folder.write_json("transforms.json", &top);
    for holdout in [Holdout::Dataset, Holdout::Every(1), Holdout::Names(vec!["00".into()])] {
        let error = load(folder.path(), &with(holdout.clone())).expect_err("nothing to train on").to_string();
        assert!(error.contains("at least one training view"), "{holdout:?}: {error}");
    }
    assert!(load(folder.path(), &with(Holdout::Every(0))).is_err());
}

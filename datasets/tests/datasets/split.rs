//! Which views are held out.

use gs_datasets::{Holdout, LoadOptions, Scene, Split, SplitUse, check, load};
use serde_json::json;

use crate::fixtures::{held_out, names, ring_scene, warned};

fn with(holdout: Holdout) -> LoadOptions {
    LoadOptions { holdout, ..LoadOptions::default() }
}

#[test]
fn every_eighth_by_name_is_the_default() {
    let (folder, mut top) = ring_scene(17);
    top["frames"].as_array_mut().expect("a list").reverse();
    let scene = folder.scene(&top, &LoadOptions::default());
    assert_eq!(names(held_out(&scene)), ["images/00", "images/08", "images/16"]);
    assert_eq!(scene.train.len(), 14);
    assert_eq!(names(&scene.train)[..2], ["images/01", "images/02"]);
    let scene = load(folder.path(), &with(Holdout::Every(5))).expect("loaded");
    assert_eq!(names(held_out(&scene)), ["images/00", "images/05", "images/10", "images/15"]);
    let scene = folder.load(&with(Holdout::None));
    assert_eq!((scene.train.len(), held_out(&scene).len()), (17, 0));
}

#[test]
fn views_can_be_held_out_by_name() {
    let (folder, top) = ring_scene(4);
    folder.write_json("transforms.json", &top);
    let scene = load(folder.path(), &with(Holdout::Names(vec!["02".into(), "images/03".into()]))).expect("loaded");
    assert_eq!(names(held_out(&scene)), ["images/02", "images/03"]);
    folder.refused(&with(Holdout::Names(vec!["nobody".into()])), &["nobody"]);
}

/// Name and number of views of each held-out split.
fn counts(scene: &Scene) -> Vec<(&str, usize)> {
    scene.held_out.iter().map(|split| (split.name.as_str(), split.views.len())).collect()
}

#[test]
fn the_data_sets_own_lists_win() {
    let (folder, mut top) = ring_scene(7);
    top["train_filenames"] = json!(["images/00.png", "./images/01.png", "images/02.png"]);
    top["val_filenames"] = json!(["images/03.png"]);
    top["test_filenames"] = json!(["images/04.png"]);
    top["../later_filenames"] = json!(["images/05.png"]);
    // Lists of other things are no splits.
    top["mask_filenames"] = json!(["masks/00.png"]);
    top["depth_filenames"] = json!(3);
    let scene = folder.scene(&top, &LoadOptions::default());
    assert_eq!(names(&scene.train), ["images/00", "images/01", "images/02"]);
    assert_eq!(counts(&scene), [("test", 1), ("validation", 1), ("later", 1)]);
    let split = |name| scene.split(name).map(names);
    assert_eq!(split(Split::TEST), Some(vec!["images/04"]));
    assert_eq!(split(Split::VALIDATION), Some(vec!["images/03"]));
    assert_eq!(split("later"), Some(vec!["images/05"]));
    assert_eq!((split(Split::TRAIN).map(|names| names.len()), split("other")), (Some(3), None));
    assert_eq!(scene.held_out_views().count(), 3);
    assert!(scene.warnings[0].contains("1 frame is in none"), "{:?}", scene.warnings);
    let report = check(folder.path(), &LoadOptions::default()).to_string();
    assert!(report.contains("3 views train, 3 are held out (1 test, 1 validation, 1 later)"), "{report}");
}

/// Without a training list `NAME_filenames` may list anything.
#[test]
fn without_a_training_list_only_known_lists_split() {
    let (folder, mut top) = ring_scene(9);
    top["image_filenames"] = json!(["images/00.png", "images/01.png"]);
    let scene = folder.scene(&top, &LoadOptions::default());
    assert_eq!((scene.train.len(), counts(&scene)), (7, vec![("test", 2)]));
}

/// nerfstudio's tools write one list under two keys.
#[test]
fn a_frame_in_two_lists_is_loaded_once_and_for_the_figures() {
    let (folder, mut top) = ring_scene(6);
    top["train_filenames"] = json!(["images/00.png", "images/01.png"]);
    top["val_filenames"] = json!(["images/01.png", "images/03.png", "images/04.png"]);
    top["test_filenames"] = json!(["images/04.png", "images/05.png"]);
    let scene = folder.scene(&top, &LoadOptions::default());
    assert_eq!(names(&scene.train), ["images/00", "images/01"]);
    assert_eq!(names(held_out(&scene)), ["images/04", "images/05"]);
    assert_eq!(counts(&scene), [("test", 2), ("validation", 1)]);
    let report = check(folder.path(), &LoadOptions::default()).to_string();
    assert!(report.contains("2 frames are in several of the split's lists"), "{report}");
}

#[test]
fn the_data_sets_own_files_win_and_figures_are_of_test_else_validation() {
    let (folder, top) = ring_scene(6);
    let part = |range: std::ops::Range<usize>| {
        let mut part = top.clone();
        part["frames"] = json!(range.map(|i| top["frames"][i].clone()).collect::<Vec<_>>());
        part
    };
    folder.write_json("transforms_train.json", &part(0..3));
    folder.write_json("transforms_val.json", &part(3..4));
    let scene = folder.load(&LoadOptions::default());
    assert_eq!((scene.train.len(), counts(&scene)), (3, vec![("validation", 1)]));
    assert_eq!(names(held_out(&scene)), ["images/03"]);
    folder.write_json("transforms_test.json", &part(4..6));
    let scene = folder.load(&LoadOptions::default());
    assert_eq!((scene.train.len(), names(held_out(&scene))), (3, vec!["images/04", "images/05"]));
    assert_eq!(scene.split(Split::VALIDATION).map(names), Some(vec!["images/03"]));
    // Without the others, the validation photo need not even be sound.
    folder.write("images/03.png", "no image");
    let reported = LoadOptions { splits: SplitUse::Reported, ..LoadOptions::default() };
    let scene = folder.load(&reported);
    assert_eq!(counts(&scene), [("test", 2)]);
    assert!(load(folder.path(), &LoadOptions::default()).is_err());
    assert!(check(folder.path(), &reported).is_ok() && !check(folder.path(), &LoadOptions::default()).is_ok());
    folder.photo("images/03.png", 32, 24);
    let scene = load(folder.path(), &with(Holdout::Every(3))).expect("loaded");
    assert_eq!(counts(&scene), [("test", 2)]);
    assert_eq!(names(held_out(&scene)), ["images/00", "images/03"], "an explicit rule covers all files");
    let scene = load(&folder.file("transforms_train.json"), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), counts(&scene)), (2, vec![("test", 1)]), "a file by itself is split like any other");
}

/// Times of all splits count, also where no figure is quoted on them.
#[test]
fn the_range_of_times_is_over_all_splits_that_are_loaded() {
    let (folder, mut top) = ring_scene(4);
    for index in 0..4 {
        top["frames"][index]["time"] = json!([0.2, 0.4, 0.0, 1.0][index]);
    }
    top["train_filenames"] = json!(["images/00.png", "images/01.png"]);
    top["val_filenames"] = json!(["images/03.png"]);
    top["test_filenames"] = json!(["images/02.png"]);
    folder.write_json("transforms.json", &top);
    assert_eq!(folder.load(&LoadOptions::default()).time_range, Some((0.0, 1.0)));
    let reported = LoadOptions { splits: SplitUse::Reported, ..LoadOptions::default() };
    assert_eq!(folder.load(&reported).time_range, Some((0.0, 0.4)));
}

#[test]
fn of_static_cameras_that_film_whole_cameras_are_held_out() {
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
    assert_eq!(names(held_out(&scene)), ["images/01", "images/04"], "both times of the middle one");
    assert_eq!(scene.train.len(), 4);
    warned(&scene.warnings, &["2 held-out photos are as blurry"]);
    // Of two cameras none can be spared.
    folder.write_json("transforms_train.json", &twice);
    let scene = load(&folder.file("transforms_train.json"), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), held_out(&scene).len()), (3, 1));
}

#[test]
fn no_training_view_is_an_error() {
    let (folder, top) = ring_scene(1);
    folder.write_json("transforms.json", &top);
    for holdout in [Holdout::Dataset, Holdout::Every(1), Holdout::Names(vec!["00".into()])] {
        folder.refused(&with(holdout.clone()), &["at least one training view"]);
    }
    assert!(load(folder.path(), &with(Holdout::Every(0))).is_err());
}

//! Times, exposures and cameras that contradict themselves or each other.

use gs_datasets::{LoadOptions, Scene, check, load};
use serde_json::{Value, json};

use crate::fixtures::{Folder, all, held_out, move_camera, rig, ring, ring_scene};

/// Two training cameras and a held-out one at four times, 0.1 apart.
fn set() -> (Folder, Value, Value) {
    let folder = Folder::new();
    let train = rig(&folder, "train", 0, 2, 4);
    let test = rig(&folder, "test", 2, 1, 4);
    (folder, train, test)
}

fn read(folder: &Folder, train: &Value, test: &Value) -> Scene {
    read_with(folder, train, test, &LoadOptions::default())
}

fn read_with(folder: &Folder, train: &Value, test: &Value, options: &LoadOptions) -> Scene {
    folder.write_json("transforms_train.json", train);
    folder.write_json("transforms_test.json", test);
    let scene = load(folder.path(), options).expect("loaded");
    let report = check(folder.path(), options);
    assert_eq!(report.warnings, scene.warnings, "the report says what loading says");
    scene
}

#[track_caller]
fn only_warning(scene: &Scene, parts: &[&str]) {
    assert_eq!(scene.warnings.len(), 1, "{}", scene.warnings.join("\n"));
    let text = &scene.warnings[0];
    parts.iter().for_each(|part| assert!(text.contains(part), "{part:?} is not in {text:?}"));
}

#[test]
fn a_sound_set_is_not_complained_about() {
    let (folder, mut train, test) = set();
    train["exposure"] = json!(0.09);
    let scene = read(&folder, &train, &test);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let report = check(folder.path(), &LoadOptions::default()).to_string();
    for part in
        ["exposure of 8 views is 0.09, 0.90 of the frame interval", "3 of 3 cameras with several times are static"]
    {
        assert!(report.contains(part), "{part:?} is not in\n{report}");
    }
}

/// A change of the training and the test set.
type Change = fn(&mut Value, &mut Value);

/// Changes, parts of the one warning about each, and how many views train then.
const CONTRADICTIONS: [(Change, &[&str], usize); 7] = [
    // The first photo of a time is kept.
    (
        |train, _| train["frames"][2]["time"] = json!(0.1),
        &["times repeat: 1 photo has", "train/cam00/0002 after train/cam00/0001"],
        7,
    ),
    (
        |train, _| train["frames"][2]["time"] = json!(0.05),
        &["backwards in 1 place although", "train/cam00/0002 at 0.05 after train/cam00/0001 at 0.1"],
        8,
    ),
    (
        |train, _| train["frames"][2]["transform_matrix"][0][3] = json!(0.5),
        &["1 camera changes its pose over time (cam00)"],
        8,
    ),
    (|_, test| test["camera_angle_x"] = json!(1.2), &["one set of intrinsics", "1.182", "0.730"], 8),
    (
        |_, test| {
            for i in 0..4 {
                test["frames"][i]["camera_id"] = json!("cam00");
                test["frames"][i]["camera_angle_x"] = json!(1.2);
                test["frames"][i]["transform_matrix"] = ring(0);
            }
        },
        &["1 camera has another pose or other intrinsics in the test set", "(cam00)"],
        8,
    ),
    // The test set in other units.
    (
        |_, test| (0..4).for_each(|i| move_camera(&mut test["frames"][i], 100.0, [0.0; 3])),
        &["4 held-out views turn their back", "one world"],
        8,
    ),
    (
        |_, test| test["frames"][3]["time"] = json!(0.5),
        &["1 held-out view was", "test/cam02/0003", "held out from 0 to 0.5, training from 0 to 0.3"],
        8,
    ),
];

#[test]
fn sets_that_contradict_themselves_are_told() {
    for (change, parts, count) in CONTRADICTIONS {
        let (folder, mut train, mut test) = set();
        change(&mut train, &mut test);
        let scene = read(&folder, &train, &test);
        only_warning(&scene, parts);
        assert_eq!(scene.train.len(), count, "{parts:?}");
    }
}

#[test]
fn an_exposure_of_nothing_or_of_more_than_a_frame_is_left_out() {
    for (exposure, part) in
        [(0.0, "is 0, in which no light"), (0.15, "longer than one frame interval (0.15 against 0.1")]
    {
        let (folder, mut train, test) = set();
        train["exposure"] = json!(exposure);
        let scene = read(&folder, &train, &test);
        only_warning(&scene, &["exposure of 8 views", part, "counts as unknown"]);
        assert!(scene.train.iter().all(|view| view.exposure.is_none()));
    }
    let (folder, mut train, test) = set();
    train["exposure"] = json!(0.1);
    let scene = read(&folder, &train, &test);
    assert!(
        scene.warnings.is_empty() && scene.train.iter().all(|view| view.exposure == Some(0.1)),
        "a whole frame is open"
    );
}

#[test]
fn an_exposure_that_is_no_duration_is_an_error() {
    for value in [json!(-0.1), json!("long"), json!("NaN"), json!([1])] {
        let (folder, mut train, _) = set();
        train["frames"][1]["exposure"] = value;
        folder.write_json("transforms_train.json", &train);
        folder.refused(&LoadOptions::default(), &["exposure", "train/cam00/0001.png"]);
    }
    for exposure in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let (folder, train, _) = set();
        folder.write_json("transforms_train.json", &train);
        let options = LoadOptions { exposure: Some(exposure), ..LoadOptions::default() };
        folder.refused(&options, &["option `exposure`"]);
    }
}

#[test]
fn the_users_exposure_is_believed() {
    let (folder, mut train, test) = set();
    train["exposure"] = json!(0.0);
    let with = |exposure| LoadOptions { exposure: Some(exposure), ..LoadOptions::default() };
    let scene = read_with(&folder, &train, &test, &with(0.05));
    assert!(scene.warnings.is_empty() && scene.train.iter().all(|view| view.exposure == Some(0.05)));
    let scene = read_with(&folder, &train, &test, &with(0.3));
    only_warning(&scene, &["0.3 is longer than one frame interval", "used as given"]);
    assert!(held_out(&scene).iter().all(|view| view.exposure == Some(0.3)));
}

/// frame_10 comes after frame_9, though not in the alphabet.
#[test]
fn times_in_the_order_of_numbers_do_not_run_backwards() {
    let folder = Folder::new();
    let mut names = rig(&folder, "train", 0, 2, 12);
    for i in 0..12 {
        let name = format!("train/frame_{i}.png");
        folder.photo(&name, 8, 6);
        names["frames"][i]["file_path"] = json!(name);
    }
    let scene = read(&folder, &names, &rig(&folder, "test", 1, 1, 1));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn a_camera_far_from_all_others_is_named() {
    let (folder, mut top) = ring_scene(6);
    folder.write_json("transforms.json", &top);
    assert!(folder.load(&all()).warnings.is_empty());
    top["frames"][4]["transform_matrix"][0][3] = json!(1000.0);
    let scene = folder.scene(&top, &all());
    only_warning(&scene, &["1 camera stands more than 10 times", "(images/04)"]);
}

#[test]
fn cameras_are_told_apart_by_their_poses_where_nothing_names_them() {
    let (folder, mut train, mut test) = set();
    for top in [&mut train, &mut test] {
        for frame in top["frames"].as_array_mut().expect("frames") {
            frame.as_object_mut().expect("a frame").remove("camera_id");
        }
    }
    let scene = read(&folder, &train, &test);
    let ids: Vec<&str> = scene.train.iter().map(|view| view.camera_id.as_deref().expect("a camera")).collect();
    assert!(ids[..4].iter().all(|id| *id == ids[0]) && ids[4..].iter().all(|id| *id == ids[4]) && ids[0] != ids[4]);
    // A camera that never stands still is one camera or many; nobody can say.
    for (i, frame) in train["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
        frame["transform_matrix"] = ring(i);
        frame["time"] = json!(i);
    }
    let (folder_2, _, _) = set();
    folder_2.write_json("transforms_train.json", &train);
    let scene = folder_2.load(&LoadOptions::default());
    assert!(scene.train.iter().all(|view| view.camera_id.is_none()));
}

#[test]
fn exposures_that_differ_are_told_with_the_one_that_is_taken() {
    let (folder, mut train, mut test) = set();
    train["exposure"] = json!(0.02);
    test["exposure"] = json!(0.02);
    train["frames"][0]["exposure"] = json!(0.09);
    train["frames"][5]["exposure"] = json!(0.05);
    let scene = read(&folder, &train, &test);
    only_warning(&scene, &["3 different exposures, from 0.02 to 0.09", "median, 0.02,"]);
    // Rounding is no difference, and neither are held-out views, which nothing is learned from.
    train["frames"][0]["exposure"] = json!(0.02 + 1e-9);
    train["frames"][5]["exposure"] = json!(0.02);
    test["exposure"] = json!(0.05);
    assert!(read(&folder, &train, &test).warnings.is_empty());
}

#[test]
fn views_without_a_time_are_counted() {
    let (folder, mut train, test) = set();
    for i in [1, 6] {
        train["frames"][i].as_object_mut().expect("a frame").remove("time");
    }
    let scene = read(&folder, &train, &test);
    only_warning(&scene, &["2 views have no time although others do"]);
    let report = check(folder.path(), &LoadOptions::default());
    assert_eq!((report.timed, report.without_time), (6, 2));
}

/// The ring of [`ring`] has a radius of 4 at a height of 1.
#[test]
fn what_cameras_look_at_has_a_distance() {
    let (folder, train, test) = set();
    let scene = read(&folder, &train, &test);
    let distance = scene.subject_distance().expect("a ring of cameras");
    assert!((distance - 17.0_f64.sqrt()).abs() < 1e-6, "{distance}");
    let report = check(folder.path(), &LoadOptions::default());
    assert!((report.subject_distance.expect("the same ring") - distance).abs() < 1e-9);
}

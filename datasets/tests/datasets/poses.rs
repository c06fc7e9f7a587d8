//! Poses that are not rigid, and scenes far from their origin.

use gs_datasets::{LoadOptions, load, load_cameras, load_cameras_by};
use serde_json::{Value, json};

use crate::fixtures::{all, cloud, move_camera, ring_scene};

fn load_with_pose(pose: Value) -> Result<gs_datasets::Scene, String> {
    let (folder, mut top) = ring_scene(2);
    top["frames"][1]["transform_matrix"] = pose;
    folder.write_json("transforms.json", &top);
    load(folder.path(), &all()).map_err(|error| error.to_string())
}

fn diagonal(x: f64, y: f64, z: f64) -> Value {
    json!([[x, 0, 0, 1], [0, y, 0, 2], [0, 0, z, 3], [0, 0, 0, 1]])
}

#[test]
fn a_pose_that_is_not_rigid_names_its_frame() {
    let sheared = json!([[1, 0.3, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    let last_row = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0.5, 1]]);
    // Finite here, and not where squares of distances are f32.
    let far_away = json!([[1, 0, 0, 1e16], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    let cases = [
        (diagonal(1.0, 1.0, -1.0), "reflection"),
        (diagonal(2.0, 2.0, 2.0), "scale of 2"),
        (diagonal(1.0, 1.0, 0.0), "singular"),
        (diagonal(1.02, 1.0, 0.9), "unevenly scaled"),
        (sheared, "sheared"),
        (last_row, "last row"),
        (far_away, "(1e16, 0e0, 0e0)"),
    ];
    for (pose, problem) in cases {
        let error = load_with_pose(pose).expect_err(problem);
        assert!(error.contains("images/01.png") && error.contains(problem), "{error}");
    }
}

#[test]
fn a_number_that_is_not_finite_names_its_frame() {
    // Python writes NaN and Infinity as bare words.
    for word in ["NaN", "Infinity", "-Infinity"] {
        let (folder, mut top) = ring_scene(2);
        top["frames"][1]["transform_matrix"][0][3] = json!("HERE");
        folder.write("transforms.json", top.to_string().replace("\"HERE\"", word));
        folder.refused(&LoadOptions::default(), &["images/01.png", "row 0, column 3"]);
    }
}

#[test]
fn a_slight_scale_is_divided_out_with_a_warning() {
    let scene = load_with_pose(diagonal(1.01, 1.01, 1.01)).expect("loaded");
    let c2w = scene.train[1].c2w;
    assert!((c2w.x_axis.length() - 1.0).abs() < 1e-12 && c2w.w_axis.to_array() == [1.0, 2.0, 3.0, 1.0]);
    assert!(scene.warnings[0].contains("scale"), "{:?}", scene.warnings);
    let scene = load_with_pose(diagonal(1.0001, 0.9999, 1.0)).expect("rounding is no scale");
    assert!(scene.warnings.is_empty());
    let c2w = scene.train[1].c2w;
    assert!((c2w.x_axis.length() - 1.0).abs() < 1e-12 && (c2w.y_axis.length() - 1.0).abs() < 1e-12);
}

#[test]
fn a_far_scene_is_moved_to_its_cameras_and_keeps_millimetres() {
    let (folder, mut top) = ring_scene(4);
    let far = [4_321_000.125, -98_765.5, 250.0];
    for frame in top["frames"].as_array_mut().expect("a list") {
        move_camera(frame, 1.0, far);
    }
    top["ply_file_path"] = json!("points.ply");
    folder.write("points.ply", cloud("double", &[[far[0] + 0.001, far[1], far[2]]]));
    let scene = folder.scene(&top, &LoadOptions::default());
    assert!(scene.origin.distance(glam::DVec3::from_array(far)) < 5.0);
    let point = glam::Vec3::from_array(scene.points.as_ref().expect("points").positions[0]).as_dvec3() + scene.origin;
    assert!((point.x - far[0] - 0.001).abs() < 1e-6, "{point}");
    for view in scene.train.iter().chain(scene.held_out_views()) {
        let centre = view.c2w.w_axis.truncate();
        assert!(centre.length() < 10.0);
    }
    let still = folder.load(&LoadOptions { recentre: false, ..LoadOptions::default() });
    assert_eq!(still.origin, glam::DVec3::ZERO);
    assert!((still.train[0].c2w.w_axis - scene.train[0].c2w.w_axis - scene.origin.extend(0.0)).length() < 1e-8);
}

#[test]
fn an_entry_that_is_no_number_is_named() {
    let rows = |entry: Value| json!([[1, 0, 0, entry], [0, 1, 0, 0], [0, 0, 1, 0]]);
    for (entry, found) in [(json!(null), "null"), (json!("far"), "\"far\""), (json!([1]), "a list of 1")] {
        let error = load_with_pose(rows(entry)).expect_err("no number");
        assert!(error.contains(&format!("found {found} in row 0, column 3")), "{error}");
    }
    let error = load_with_pose(json!([[1, 0, 0], [0, 1, 0], [0, 0, 1]])).expect_err("three columns");
    assert!(error.contains("found rows of 3, 3, 3"), "{error}");
}

#[test]
fn one_pose_of_many_that_is_none_is_left_out() {
    let (folder, mut top) = ring_scene(12);
    top["frames"][3]["transform_matrix"][0][0] = json!(9.0);
    let scene = folder.scene(&top, &all());
    assert_eq!(scene.train.len(), 11);
    assert!(scene.warnings[0].contains("1 frame without a sound pose was left out"), "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("images/03.png"), "{:?}", scene.warnings);
    // Two of twelve say that the file means something else.
    top["frames"][4]["transform_matrix"][0][0] = json!(9.0);
    folder.write_json("transforms.json", &top);
    folder.refused(&all(), &["images/03.png"]);
}

/// A file whose world is left-handed, with cameras of either hand: Unity's have x right, y up and z forward.
#[test]
fn a_mirrored_world_is_mirrored_back() {
    let (folder, mut top) = ring_scene(3);
    top["ply_file_path"] = json!("points.ply");
    folder.write("points.ply", cloud("double", &[[1.0, 2.0, 3.0]]));
    let sound = folder.scene(&top, &all());
    for (poses, flip_camera) in [(None, false), (Some("c2w-right-up-forward"), true)] {
        let mut mirrored = top.clone();
        for frame in mirrored["frames"].as_array_mut().expect("a list") {
            let entry = |value: &mut Value| *value = json!(-value.as_f64().expect("a number"));
            let matrix = &mut frame["transform_matrix"];
            (0..4).for_each(|column| entry(&mut matrix[0][column]));
            if flip_camera {
                (0..3).for_each(|row| entry(&mut matrix[row][2]));
            }
        }
        folder.write("points.ply", cloud("double", &[[-1.0, 2.0, 3.0]]));
        let options = LoadOptions { poses: poses.map(|text| text.parse().expect("a convention")), ..all() };
        let scene = folder.scene(&mirrored, &options);
        assert!(
            scene.warnings.iter().any(|text| text.contains("mirrored (left-handed) world")),
            "{:?}",
            scene.warnings
        );
        assert_eq!(scene.points, sound.points);
        for (view, sound) in scene.train.iter().zip(&sound.train) {
            assert!(view.c2w.abs_diff_eq(sound.c2w, 1e-12), "{}", view.name);
        }
        // Cameras for rendering are of the same world.
        let cameras = load_cameras_by(folder.path(), options.poses).expect("cameras");
        for (camera, sound) in cameras.iter().zip(&sound.train) {
            assert!(camera.c2w.abs_diff_eq(sound.c2w, 1e-12), "{}", camera.name);
        }
        if !flip_camera {
            // One frame of the other hand is none of this file.
            mirrored["frames"][1] = top["frames"][1].clone();
            folder.write_json("transforms.json", &mirrored);
            folder.refused(&options, &["images/01.png", "reflection"]);
            let mixed = load_cameras(folder.path()).expect_err("two hands").to_string();
            assert!(mixed.contains("images/00.png") && mixed.contains("reflection"), "{mixed}");
        }
    }
}

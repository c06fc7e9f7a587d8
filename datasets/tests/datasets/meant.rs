//! Data read as the user says that they are meant: pose conventions, units of points, levels of deep photos; outliers
//! that set no scale.

use gs_datasets::{LoadOptions, PoseConvention, check, load, load_cameras_by};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use serde_json::json;

use crate::colmap_writer::example;
use crate::fixtures::{Folder, all, cloud, move_camera, ring, ring_scene, rows};

#[test]
fn poses_of_any_convention_are_read_as_one() {
    let (folder, mut top) = ring_scene(6);
    let usual = folder.scene(&top, &all());
    for text in ["c2w-opencv", "w2c-opencv", "w2c-opengl", "c2w-down-right-back", "w2c-left-up-forward"] {
        let convention: PoseConvention = text.parse().expect("a convention");
        for (frame, view) in top["frames"].as_array_mut().expect("frames").iter_mut().zip(&usual.train) {
            frame["transform_matrix"] = rows(convention.to_file(view.c2w));
        }
        let scene = folder.scene(&top, &LoadOptions { poses: Some(convention), ..all() });
        for (view, usual) in scene.train.iter().zip(&usual.train) {
            assert!(view.c2w.abs_diff_eq(usual.c2w, 1e-12), "{text}: {} for {}", view.c2w, usual.c2w);
        }
        same_cameras(&folder, convention);
        let other = folder.load(&all());
        assert!(!other.train[0].c2w.abs_diff_eq(usual.train[0].c2w, 0.1), "{text} makes a difference");
    }
}

/// Cameras for rendering are read as those of the photos.
fn same_cameras(folder: &Folder, convention: PoseConvention) {
    let scene = folder.load(&LoadOptions { poses: Some(convention), ..all() });
    let cameras = load_cameras_by(folder.path(), Some(convention)).expect("cameras");
    assert_eq!(cameras.len(), scene.train.len());
    for (camera, view) in cameras.iter().zip(&scene.train) {
        let c2w = glam::DMat4::from_translation(-scene.origin) * camera.c2w;
        assert!(c2w.abs_diff_eq(view.c2w, 1e-12), "{convention}: {} for {}", c2w, view.c2w);
    }
}

#[test]
fn cameras_of_a_model_are_read_as_its_photos() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    for text in ["c2w-opencv", "w2c-right-up-forward"] {
        same_cameras(&folder, text.parse().expect("a convention"));
    }
}

#[test]
fn points_are_scaled() {
    let (folder, mut top) = ring_scene(4);
    top["ply_file_path"] = json!("points.ply");
    folder.write("points.ply", cloud("float", &[[1000.0, -2000.0, 3000.0]]));
    let scene = folder.scene(&top, &LoadOptions { points_scale: 0.001, ..all() });
    let points = scene.points.expect("a point").positions;
    assert!(
        points[0].iter().zip([1.0, -2.0, 3.0]).all(|(found, expected)| (found - expected).abs() < 1e-6),
        "{points:?}"
    );
    let far = folder.load(&LoadOptions { points_scale: 1e300, ..all() });
    assert!(far.points.expect("a cloud").positions.is_empty(), "no 32-bit number holds them");
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        folder.refused(&LoadOptions { points_scale: wrong, ..all() }, &["points_scale"]);
    }
}

/// Grey photos of 16 bits with the levels 2900 to 3300 of a thermal camera.
fn thermal() -> Folder {
    let (folder, top) = ring_scene(3);
    for i in 0..3 {
        let levels = (0..32 * 24).map(|pixel| 2900 + (pixel * 7 + i * 13) % 401);
        let data: Vec<u8> = levels.flat_map(|level| (level as u16).to_ne_bytes()).collect();
        let mut png = Vec::new();
        PngEncoder::new(&mut png).write_image(&data, 32, 24, ExtendedColorType::L16).expect("encoded");
        folder.write(&format!("images/{i:02}.png"), png);
    }
    folder.write_json("transforms.json", &top);
    folder
}

fn levels_of(scene: &gs_datasets::Scene) -> usize {
    let levels: std::collections::BTreeSet<u8> =
        scene.train.iter().flat_map(|view| view.image.data.iter().copied()).collect();
    levels.len()
}

#[test]
fn deep_photos_of_few_levels_are_told_and_stretched() {
    let folder = thermal();
    let scene = folder.load(&all());
    assert!(levels_of(&scene) <= 3, "{}", levels_of(&scene));
    let told = |warnings: &[String]| {
        let key = "data.levels=[0.04425, 0.05036]";
        let one: Vec<&String> = warnings.iter().filter(|sentence| sentence.contains(key)).collect();
        assert_eq!(one.len(), 1, "{warnings:?}");
        assert!(one[0].contains("3 photos of more than 8 bits have levels from 0.04425 to 0.05036"), "{}", one[0]);
    };
    told(&scene.warnings);
    told(&check(folder.path(), &all()).warnings);
    let stretched = LoadOptions { levels: Some([0.0442, 0.0504]), ..all() };
    let scene = folder.load(&stretched);
    assert!(scene.warnings.is_empty() && levels_of(&scene) > 240, "{} levels, {:?}", levels_of(&scene), scene.warnings);
    // Level 3000 of 65535 lies 0.0016 into a range of 0.0062.
    let expected = 255.0 * (3000.0 / 65535.0 - 0.0442) / 0.0062;
    let place = (0..32 * 24).find(|pixel| (pixel * 7) % 401 == 100).expect("a pixel of that level");
    assert!((f64::from(scene.train[0].image.data[3 * place]) - expected).abs() <= 0.5, "{expected}");
    for wrong in [[0.5, 0.5], [-0.1, 1.0], [0.0, f64::INFINITY], [f64::NAN, 1.0]] {
        assert!(load(folder.path(), &LoadOptions { levels: Some(wrong), ..all() }).is_err(), "{wrong:?}");
    }
}

#[test]
fn a_stray_camera_sets_no_scale() {
    let (folder, mut top) = ring_scene(12);
    let usual = folder.scene(&top, &all());
    top["frames"][4]["transform_matrix"] = ring(4);
    move_camera(&mut top["frames"][4], 100.0, [0.0; 3]);
    let scene = folder.scene(&top, &all());
    assert!((scene.extent() / usual.extent() - 1.0).abs() < 0.15, "{} for {}", scene.extent(), usual.extent());
    let (distance, known) = (scene.subject_distance().expect("one"), usual.subject_distance().expect("one"));
    assert!((distance / known - 1.0).abs() < 0.05, "{distance} for {known}");
    assert_eq!(
        scene.warnings.iter().filter(|warning| warning.contains("(images/04)")).count(),
        1,
        "{:?}",
        scene.warnings
    );
}

/// A scene in millimetres is as large as it is far away, and stays in its file's world; one in map coordinates is moved
/// by whole units.
#[test]
fn only_a_scene_far_away_for_its_size_is_moved() {
    let moved = |scale: f64, by: [f64; 3]| {
        let (folder, mut top) = ring_scene(6);
        for frame in top["frames"].as_array_mut().expect("frames") {
            move_camera(frame, scale, by);
        }
        folder.write_json("transforms.json", &top);
        folder.load(&all()).origin
    };
    assert_eq!(moved(1000.0, [0.0, 0.0, 2500.0]), glam::DVec3::ZERO);
    let origin = moved(1.0, [450_123.4, 5_200_456.7, 315.2]);
    assert!(origin.distance(glam::DVec3::new(450_123.4, 5_200_456.7, 315.2)) < 3.0, "{origin}");
    assert_eq!(origin, origin.round());
}

#[test]
fn one_photo_written_in_two_ways_serves_one_view() {
    let (folder, mut top) = ring_scene(4);
    top["frames"][2]["file_path"] = json!("./images/../images/01.png");
    folder.write_json("transforms.json", &top);
    folder.refused(&all(), &["1 view whose photo has another pose already"]);
}

#[test]
fn transposed_matrices_are_one_error() {
    let (folder, mut top) = ring_scene(4);
    for frame in top["frames"].as_array_mut().expect("frames") {
        let matrix = frame["transform_matrix"].clone();
        frame["transform_matrix"] =
            json!([0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| matrix[column][row].clone())));
    }
    folder.write_json("transforms.json", &top);
    let errors = check(folder.path(), &all()).errors;
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert!(errors[0].contains("transposed (column-major)") && errors[0].contains("4 times"), "{}", errors[0]);
}

//! Layouts of videos: a model of static cameras with their frames, Nerfies, photos with numbers for times.

use glam::{DMat4, DQuat, DVec3};
use gs_datasets::{LoadOptions, Scene, SceneFormat};
use serde_json::json;

use crate::colmap_writer::{Camera, Image, Model};
use crate::fixtures::{Folder, all, cloud, names, npy_f32, ring_scene, warned};

fn times(scene: &Scene) -> Vec<Option<f64>> {
    scene.train.iter().map(|view| view.time).collect()
}

/// Two cameras with two frames each, and a third without a folder.
#[test]
fn the_multipleview_layout_loads() {
    let folder = Folder::new();
    let q = DQuat::from_euler(glam::EulerRot::XYZ, 0.1, 0.2, -0.3);
    let image = |id: u32| Image {
        id,
        q: [q.w, q.x, q.y, q.z],
        t: [f64::from(id), 0.0, 4.0],
        camera_id: 1,
        name: format!("image{id}.jpg"),
        seen: Vec::new(),
    };
    let camera = Camera { id: 1, model: 1, width: 40, height: 30, params: vec![50.0, 51.0, 20.0, 15.0] };
    let model = Model { cameras: vec![camera], images: vec![image(1), image(2), image(12)], points: Vec::new() };
    model.write_binary(&folder, "sparse_");
    for name in ["cam01/frame_00001.png", "cam01/frame_00002.png", "cam02/frame_00001.png", "cam02/frame_00002.png"] {
        folder.photo(name, 40, 30);
    }
    folder.write("points3D_multipleview.ply", cloud("float", &[[0.0, 0.0, 1.0]]));
    let scene = folder.load(&all());
    assert_eq!(scene.format, SceneFormat::Filmed);
    assert_eq!(names(&scene.train)[..2], ["cam01/frame_00001", "cam01/frame_00002"]);
    assert_eq!(times(&scene), [Some(0.0), Some(1.0), Some(0.0), Some(1.0)]);
    assert_eq!(scene.train[3].camera_id.as_deref(), Some("cam02"));
    assert_eq!((scene.train[0].intrinsics.fy, scene.points.as_ref().map_or(0, |points| points.len())), (51.0, 1));
    let w2c = DMat4::from_rotation_translation(q, DVec3::new(2.0, 0.0, 4.0));
    assert!(scene.train[2].c2w.abs_diff_eq(w2c.inverse(), 1e-12));
    warned(&scene.warnings, &["image12.jpg", "no folder of frames"]);
    std::fs::remove_dir_all(folder.file("cam01")).expect("removed");
    std::fs::remove_dir_all(folder.file("cam02")).expect("removed");
    folder.refused(&all(), &["no frames of 3 cameras"]);
}

/// A camera at (1, 2, 3) that looks along the world's x axis, its image's down along -z.
fn nerfies() -> Folder {
    let folder = Folder::new();
    folder.write_json("dataset.json", &json!({ "ids": ["a", "b", "c"], "train_ids": ["a", "c"], "val_ids": ["b"] }));
    let said = |time: u64, camera: u64| json!({ "warp_id": time, "appearance_id": time, "camera_id": camera });
    folder.write_json("metadata.json", &json!({ "a": said(0, 0), "b": said(2, 1), "c": said(4, 0) }));
    for id in ["a", "b", "c"] {
        folder.photo(&format!("rgb/2x/{id}.png"), 20, 15);
        folder.photo(&format!("rgb/4x/{id}.png"), 10, 7);
        let camera = json!({
            "orientation": [[0, -1, 0], [0, 0, -1], [1, 0, 0]], "position": [1, 2, 3], "focal_length": 50,
            "principal_point": [20, 15], "pixel_aspect_ratio": 1.1, "radial_distortion": [0, 0, 0],
            "tangential_distortion": [0, 0], "skew": 0, "image_size": [40, 30],
        });
        folder.write_json(&format!("camera/{id}.json"), &camera);
    }
    folder.write("points.npy", npy_f32("(2, 3)", &[0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0]));
    folder
}

#[test]
fn captures_of_nerfies_load() {
    let folder = nerfies();
    let scene = folder.load(&LoadOptions::default());
    assert_eq!((scene.format, names(&scene.train)), (SceneFormat::Nerfies, vec!["a", "c"]));
    assert_eq!((times(&scene), scene.held_out[0].views[0].time), (vec![Some(0.0), Some(1.0)], Some(0.5)));
    let view = &scene.train[0];
    assert_eq!((view.width, view.intrinsics.fx, view.camera_id.as_deref()), (20, 25.0, Some("0")));
    assert!((view.intrinsics.fy - 27.5).abs() < 1e-12);
    assert_eq!(view.c2w.w_axis.truncate(), DVec3::new(1.0, 2.0, 3.0));
    assert!((view.c2w.z_axis.truncate() - DVec3::X).length() < 1e-12, "looks along x: {}", view.c2w.z_axis);
    assert!((view.c2w.y_axis.truncate() - DVec3::NEG_Z).length() < 1e-12, "is upright: {}", view.c2w.y_axis);
    assert_eq!(scene.points.as_ref().map(|points| points.len()), Some(1), "one is no number");

    std::fs::remove_file(folder.file("rgb/2x/b.png")).expect("removed");
    warned(&folder.load(&all()).warnings, &["1 photo does not exist", "(b)"]);
    for (key, value) in
        [("focal_length", json!("x")), ("orientation", json!([[1, 0], [0, 1]])), ("position", json!([1]))]
    {
        let folder = nerfies();
        let camera = json!({
            "focal_length": 5, "principal_point": [1, 1], "image_size": [2, 2], "position": [1, 2, 3], key: value,
        });
        folder.write_json("camera/a.json", &camera);
        folder.refused(&all(), &["a.json", key]);
    }
}

#[test]
fn numbers_in_names_become_times() {
    let (folder, mut top) = ring_scene(3);
    for (frame, name) in top["frames"].as_array_mut().expect("a list").iter_mut().zip(["v2_0010", "v2_0025", "v2_0040"])
    {
        folder.photo(&format!("images/{name}.png"), 32, 24);
        frame["file_path"] = json!(format!("images/{name}.png"));
    }
    let filmed = LoadOptions { fps: Some(30.0), ..all() };
    assert_eq!(times(&folder.scene(&top, &filmed)), [Some(0.0), Some(0.5), Some(1.0)]);
    assert_eq!(times(&folder.scene(&top, &all())), [None; 3]);
    folder.refused(&LoadOptions { fps: Some(f64::NAN), ..all() }, &["fps"]);
    top["frames"][0]["time"] = json!(3.0);
    let scene = folder.scene(&top, &filmed);
    warned(&scene.warnings, &["data.fps is not used"]);
}

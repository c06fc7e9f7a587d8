//! The transforms.json family: layouts, intrinsics, transparency, times, points, camera files.

use glam::{DVec2, DVec3};
use gs_datasets::{LoadOptions, SceneFormat, View, load_cameras};
use serde_json::{Value, json};

use crate::fixtures::{Folder, all, held_out, look_at, names, ring, ring_scene, warned};

/// A ball of 0.3 m that moves along x; photographed from three places at five times, 32 x 24 RGBA.
fn ball(time: f64) -> DVec3 {
    DVec3::new(time - 0.4, 0.2, 0.1)
}

const ANGLE_X: f64 = 0.7;

fn eye(camera: usize) -> DVec3 {
    let turn = 0.8 * camera as f64;
    DVec3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 1.2)
}

fn photograph(folder: &Folder, name: &str, camera: usize, time: f64) {
    let eye = eye(camera);
    let back = eye.normalize();
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    let focal = 16.0 / (0.5 * ANGLE_X).tan();
    folder.rgba(name, 32, 24, |x, y| {
        let ray = (right * (x as f64 + 0.5 - 16.0) + up * (12.0 - y as f64 - 0.5) - back * focal).normalize();
        let off = (ball(time) - eye).cross(ray).length();
        if off < 0.3 { [250, 120, 10, 255] } else { [90, 200, 90, 0] }
    });
}

fn ball_is_where_the_camera_says(view: &View) {
    let c = view.c2w.inverse().transform_point3(ball(view.time.expect("a time")));
    assert!(c.z > 0.0, "{}: the ball is in front of an OpenCV camera", view.name);
    let k = view.intrinsics;
    let expected = DVec2::new(k.fx * c.x / c.z + k.cx, k.fy * c.y / c.z + k.cy);
    let (mut sum, mut count) = (DVec2::ZERO, 0.0);
    for (i, pixel) in view.image.data.chunks_exact(3).enumerate() {
        if pixel[0] > 100 {
            sum += DVec2::new((i % view.width) as f64 + 0.5, (i / view.width) as f64 + 0.5);
            count += 1.0;
        }
    }
    assert!(
        count > 10.0 && (sum / count - expected).length() < 0.5,
        "{}: {} against {expected}",
        view.name,
        sum / count
    );
}

fn ball_scene(nested: bool, extension: &str) -> Folder {
    let folder = Folder::new();
    for (part, times) in [("train", 0..4), ("test", 4..5)] {
        let mut flat = Vec::new();
        let mut cameras = serde_json::Map::new();
        for camera in 0..3 {
            let mut frames = Vec::new();
            for step in times.clone() {
                let time = 0.25 * f64::from(step);
                let stem = format!("{part}/c{camera}_{step}");
                photograph(&folder, &format!("{stem}.png"), camera, time);
                frames.push(json!({ "file_path": format!("./{stem}{extension}"), "time": time }));
            }
            let pose = look_at(eye(camera), DVec3::ZERO);
            for frame in &frames {
                let mut frame = frame.clone();
                frame["transform_matrix"] = pose.clone();
                flat.push(frame);
            }
            cameras.insert(format!("cam{camera}"), json!({ "transform_matrix": pose, "frames": frames }));
        }
        let key = if nested { json!({ "data": cameras }) } else { json!({ "frames": flat }) };
        let mut top = key;
        top["camera_angle_x"] = json!(ANGLE_X);
        folder.write_json(&format!("transforms_{part}.json"), &top);
    }
    folder
}

#[test]
fn flat_and_nested_with_and_without_extension_are_one_scene() {
    let scenes: Vec<_> = [(false, ".png"), (false, ""), (true, ".png"), (true, "")]
        .into_iter()
        .map(|(nested, extension)| {
            let folder = ball_scene(nested, extension);
            folder.load(&LoadOptions::default())
        })
        .collect();
    for scene in &scenes {
        assert_eq!((scene.train.len(), held_out(scene).len()), (12, 3));
        assert_eq!(scene.format, SceneFormat::Transforms);
        assert_eq!(scene.time_range, Some((0.0, 1.0)), "test times lie beyond the training times");
        assert_eq!(scene.warnings, Vec::<String>::new());
        scene.train.iter().chain(scene.held_out_views()).for_each(ball_is_where_the_camera_says);
        for (view, other) in scene.train.iter().zip(&scenes[0].train) {
            assert_eq!((&view.name, view.c2w, &view.image), (&other.name, other.c2w, &other.image));
        }
    }
    assert_eq!(scenes[0].train[0].name, "train/c0_0");
    assert_eq!(scenes[2].train[0].camera_id.as_deref(), Some("cam0"));
}

#[test]
fn opengl_axes_become_opencv_axes() {
    let (folder, mut top) = ring_scene(1);
    top["frames"][0]["transform_matrix"] = json!([[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7]]);
    folder.write_json("transforms.json", &top);
    let c2w = folder.load(&all()).train[0].c2w;
    assert_eq!(c2w.to_cols_array(), [1., 0., 0., 0., 0., -1., 0., 0., 0., 0., -1., 0., 5., 6., 7., 1.]);
}

#[test]
fn a_frame_may_have_its_own_intrinsics() {
    let (folder, mut top) = ring_scene(3);
    top["frames"][1]["fl_x"] = json!(40.0);
    top["frames"][1]["cx"] = json!(10.0);
    top["frames"][2]["camera_angle_x"] = json!(1.0);
    let scene = folder.scene(&top, &all());
    let k: Vec<_> = scene.train.iter().map(|view| view.intrinsics).collect();
    assert_eq!((k[0].fx, k[0].fy, k[0].cx, k[0].cy), (30.0, 31.0, 15.5, 12.5));
    assert_eq!((k[1].fx, k[1].fy, k[1].cx, k[1].cy), (40.0, 40.0, 10.0, 12.5), "the frame's one axis stands for both");
    let focal = 16.0 / 0.5_f64.tan();
    assert!((k[2].fx - focal).abs() < 1e-12 && (k[2].fy - focal).abs() < 1e-12);
}

#[test]
fn an_angle_alone_and_no_centre_mean_square_pixels_and_the_middle() {
    let (folder, top) = ring_scene(1);
    folder.write_json("transforms.json", &json!({ "camera_angle_x": 0.9, "frames": top["frames"] }));
    let k = folder.load(&all()).train[0].intrinsics;
    let focal = 16.0 / 0.45_f64.tan();
    assert!((k.fx - focal).abs() < 1e-12 && k.fy == k.fx && k.cx == 16.0 && k.cy == 12.0);
}

#[test]
fn intrinsics_follow_images_that_were_resized() {
    let (folder, mut top) = ring_scene(2);
    top["w"] = json!(64.0);
    top["h"] = json!(48.0);
    let scene = folder.scene(&top, &all());
    let k = scene.train[0].intrinsics;
    assert_eq!((k.fx, k.fy, k.cx, k.cy), (15.0, 15.5, 7.75, 6.25));
    warned(&scene.warnings, &["64 x 48", "32 x 24"]);
}

#[test]
fn intrinsics_follow_the_area_filter() {
    let (folder, top) = ring_scene(1);
    folder.write_json("transforms.json", &top);
    let view = folder.load(&LoadOptions { max_width: Some(12), ..all() }).train.remove(0);
    assert_eq!((view.width, view.height, view.image.data.len()), (12, 9, 12 * 9 * 3));
    let k = view.intrinsics;
    assert_eq!((k.fx, k.fy, k.cx, k.cy), (30.0 * 0.375, 31.0 * 0.375, 15.5 * 0.375, 12.5 * 0.375));
}

#[test]
fn other_proportions_than_declared_are_an_error_with_both_sizes() {
    let (folder, mut top) = ring_scene(2);
    top["h"] = json!(32.0);
    top["w"] = json!(24.0);
    folder.write_json("transforms.json", &top);
    folder.refused(&all(), &["images/00.png", "24 x 32", "32 x 24", "turned by 90 degrees"]);
}

/// Intrinsics of photos of two pixels.
fn resize(top: &mut Value) {
    for (key, value) in [("w", 2.0), ("h", 1.0), ("cx", 1.0), ("cy", 0.5)] {
        top[key] = json!(value);
    }
}

#[test]
fn transparency_is_composited_before_resizing() {
    let (folder, mut top) = ring_scene(1);
    // The transparent pixel hides green, which must not show; half red, half white background remain.
    folder.rgba("images/00.png", 2, 1, |x, _| if x == 0 { [255, 0, 0, 255] } else { [0, 255, 0, 0] });
    resize(&mut top);
    folder.write_json("transforms.json", &top);
    let options = LoadOptions { max_width: Some(1), background: [1.0; 3], ..all() };
    let scene = folder.load(&options);
    assert_eq!(scene.train[0].image.data, [255, 128, 128]);
    let scene = folder.load(&LoadOptions { max_width: Some(1), ..all() });
    assert_eq!(scene.train[0].image.data, [128, 0, 0]);
}

#[test]
fn transparency_of_exposed_photos_is_a_share_of_light() {
    let (folder, mut top) = ring_scene(1);
    // Half the exposure white, half the black background: half the light, encoded as 188.
    folder.rgba("images/00.png", 2, 1, |x, _| if x == 0 { [255, 255, 255, 128] } else { [0, 0, 0, 255] });
    resize(&mut top);
    folder.write_json("transforms.json", &top);
    assert_eq!(folder.load(&all()).train[0].image.data, [128, 128, 128, 0, 0, 0]);
    top["frames"][0]["time"] = json!(0.0);
    top["frames"][0]["exposure"] = json!(0.5);
    folder.write_json("transforms.json", &top);
    assert_eq!(folder.load(&all()).train[0].image.data, [188, 188, 188, 0, 0, 0]);
}

#[test]
fn missing_images_are_left_out_and_none_left_is_an_error() {
    let (folder, top) = ring_scene(3);
    folder.write_json("transforms.json", &top);
    std::fs::remove_file(folder.file("images/01.png")).expect("removed");
    let scene = folder.load(&all());
    assert_eq!(names(&scene.train), ["images/00", "images/02"]);
    assert!(scene.warnings[0].contains("1 of 3 photos") && scene.warnings[0].contains("images/01.png"));
    std::fs::remove_dir_all(folder.file("images")).expect("removed");
    folder.refused(&all(), &["none of 3 images"]);
}

#[test]
fn paths_may_have_backslashes_and_repeat() {
    let (folder, mut top) = ring_scene(2);
    top["frames"][1]["file_path"] = json!(".\\images\\01.png");
    let again = top["frames"][0].clone();
    top["frames"].as_array_mut().expect("a list").push(again);
    let scene = folder.scene(&top, &all());
    assert_eq!(names(&scene.train), ["images/00", "images/01"]);
    assert!(scene.warnings[0].contains("listed more than once"), "{:?}", scene.warnings);
}

#[test]
fn points_of_ply_file_path_are_read() {
    let (folder, mut top) = ring_scene(1);
    top["ply_file_path"] = json!("sparse.ply");
    folder.write_json("transforms.json", &top);
    folder.refused(&all(), &["ply_file_path", "sparse.ply"]);
    let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
    folder.write("sparse.ply", format!("{head}1 2 3 4 5 6\n-1 0.5 0 255 0 128\n"));
    let points = folder.load(&all()).points.expect("points");
    assert_eq!(points.positions, [[1.0, 2.0, 3.0], [-1.0, 0.5, 0.0]]);
    assert_eq!(points.colors, [[4, 5, 6], [255, 0, 128]]);
    folder.write("sparse.ply", format!("{head}1 2 nan 4 5 6\n-1 0.5 0 255 0 128\n"));
    folder.refused(&all(), &["sparse.ply", "vertex 0"]);
}

#[test]
fn a_camera_file_needs_no_images_and_keeps_its_order() {
    let folder = Folder::new();
    let frames: Vec<Value> =
        [3, 1, 2].map(|i| json!({ "file_path": format!("path/{i}.png"), "transform_matrix": ring(i) })).into();
    folder.write_json("cameras.json", &json!({ "fl_x": 20, "w": 64, "h": 48, "frames": frames, "k1": 0.1 }));
    let cameras = load_cameras(&folder.file("cameras.json")).expect("cameras");
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["path/3", "path/1", "path/2"]);
    let k = cameras[0].intrinsics;
    assert_eq!((k.fx, k.fy, k.cx, k.cy, cameras[0].width, cameras[0].height), (20.0, 20.0, 32.0, 24.0, 64, 48));
    // transforms_render.json of NVFi: poses only.
    let bare = json!([{ "transform_matrix": ring(0) }, { "transform_matrix": ring(1), "time": 0.5 }]);
    folder.write_json("cameras.json", &json!({ "camera_angle_x": 0.7, "w": 8, "h": 6, "frames": bare }));
    let cameras = load_cameras(&folder.file("cameras.json")).expect("cameras");
    assert_eq!((cameras[0].name.as_str(), cameras[1].name.as_str(), cameras[1].time), ("00000", "00001", Some(0.5)));
    folder.write_json("cameras.json", &json!({ "camera_angle_x": 0.7, "frames": bare }));
    let error = load_cameras(&folder.file("cameras.json")).expect_err("no size").to_string();
    assert!(error.contains("w and h"), "{error}");
}

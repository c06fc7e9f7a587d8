use glam::{DMat4, DVec3};

use super::*;

/// Cameras on an arc before the origin, z up, looking at it.
fn arc() -> Vec<CameraPose> {
    let camera = |i: usize| {
        let angle = 0.3 * i as f64;
        let centre = DVec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0);
        CameraPose {
            name: format!("c{i}"),
            c2w: looking(centre, DVec3::ZERO, DVec3::Z).expect("a camera"),
            intrinsics: Intrinsics { fx: 100.0, fy: 100.0, cx: 50.0, cy: 40.0 },
            width: 100,
            height: 80,
            time: None,
        }
    };
    (0..6).map(camera).collect()
}

fn sees_origin(c2w: &DMat4) -> bool {
    let to = -c2w.w_axis.truncate();
    to.angle_between(c2w.z_axis.truncate()) < 0.02
}

/// Axes of these cameras meet at the origin exactly: subject, height and radius are theirs.
#[test]
fn an_orbit_goes_round_what_all_look_at() {
    let cameras = arc();
    assert!(up(&cameras).expect("up").angle_between(DVec3::Z) < 0.3);
    let path = orbit(&cameras, 12).expect("a path");
    assert_eq!(path.len(), 12);
    for camera in &path {
        let centre = camera.c2w.w_axis.truncate();
        assert!(sees_origin(&camera.c2w) && (centre.length() - 17.0_f64.sqrt()).abs() < 0.3, "{centre}");
        assert!(camera.c2w.determinant() > 0.999 && camera.intrinsics == cameras[0].intrinsics);
    }
    let turned = path[6].c2w.w_axis.truncate() + path[0].c2w.w_axis.truncate();
    assert!(turned.truncate().length() < 1.0, "half a turn later on the other side: {turned}");
    assert_eq!((path[0].name.as_str(), path[11].name.as_str()), ("orbit_0000", "orbit_0011"));
    assert!(orbit(&[], 3).is_none());
    let parallel: Vec<CameraPose> = (0..3)
        .map(|i| CameraPose { c2w: DMat4::from_translation(DVec3::X * f64::from(i)), ..cameras[0].clone() })
        .collect();
    assert!(orbit(&parallel, 3).is_none(), "parallel axes meet nowhere");
}

#[test]
fn a_spiral_stays_among_the_cameras() {
    let cameras = arc();
    let path = spiral(&cameras, 20).expect("a path");
    let middle = cameras.iter().map(|camera| camera.c2w.w_axis.truncate()).sum::<DVec3>() / 6.0;
    for camera in &path {
        assert!(sees_origin(&camera.c2w) && (camera.c2w.w_axis.truncate() - middle).length() < 2.5);
    }
}

#[test]
fn between_two_cameras_both_ends_are_met() {
    let cameras = arc();
    let path = between(&cameras[0], &cameras[5], 5);
    assert!((path[0].c2w - cameras[0].c2w).abs().to_cols_array().iter().all(|x| *x < 1e-9));
    assert!((path[4].c2w - cameras[5].c2w).abs().to_cols_array().iter().all(|x| *x < 1e-9));
    assert_eq!(between(&cameras[0], &cameras[5], 1).len(), 1);
    let mut path = path;
    spread_times(&mut path, [1.0, 3.0]);
    assert_eq!((path[0].time, path[2].time, path[4].time), (Some(1.0), Some(2.0), Some(3.0)));
}

fn read(text: &str) -> Result<Option<Vec<CameraPose>>, crate::DatasetError> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("path.json");
    std::fs::write(&file, text).expect("written");
    in_file(&file)
}

#[test]
fn key_frames_are_met() {
    let text = r#"{"keyframes": [
        {"position": [0, 0, -4], "look_at": [0, 0, 0], "time": 0, "fov": 90},
        {"position": [4, 0, 0], "look_at": [0, 0, 0], "time": 1, "fov": 60},
        {"position": [0, 0, 4], "rotation": [0, 0, 2, 0], "time": 2}],
        "width": 200, "height": 100, "images": 5}"#;
    let path = read(text).expect("read").expect("key frames");
    assert_eq!(path.len(), 5);
    let at = |i: usize| path[i].c2w.w_axis.truncate();
    assert!((at(0) - DVec3::new(0.0, 0.0, -4.0)).length() < 1e-9 && (at(2) - DVec3::X * 4.0).length() < 1e-9);
    assert!((at(4) - DVec3::Z * 4.0).length() < 1e-9);
    // 90 degrees over 100 pixels.
    assert!((path[0].intrinsics.fy - 50.0).abs() < 1e-9 && path[0].width == 200);
    assert_eq!(path[1].time, Some(0.5));
    assert!(sees_origin(&path[0].c2w) && sees_origin(&path[2].c2w) && sees_origin(&path[4].c2w));
    let closed =
        read(&text.replace("\"images\": 5", "\"images\": 6, \"closed\": true")).expect("read").expect("key frames");
    assert!((closed[4].c2w.w_axis.truncate() - DVec3::Z * 4.0).length() < 1e-9 && closed.len() == 6);
}

#[test]
fn broken_key_frames_are_named() {
    assert!(read(r#"{"frames": []}"#).expect("another file").is_none());
    for (text, word) in [
        (r#"{"keyframes": []}"#, "keyframes"),
        (r#"{"keyframes": [3]}"#, "key frame 0"),
        (r#"{"keyframes": [{"position": [0, 0]}]}"#, "3 finite numbers"),
        (r#"{"keyframes": [{"position": [0, 0, 0]}]}"#, "rotation"),
        (r#"{"keyframes": [{"position": [0, 0, 0], "look_at": [0, 5, 0]}]}"#, "rotation"),
        (r#"{"keyframes": [{"position": [0, 0, 0], "rotation": [0, 0, 0, 0]}]}"#, "rotation"),
        (r#"{"keyframes": [{"position": [0, 0, 0], "rotation": [1, 0, 0, 0], "fov": 200}]}"#, "fov"),
        (r#"{"keyframes": [{"position": [0, 0, 0], "rotation": [1, 0, 0, 0]}], "images": 1e9}"#, "images"),
    ] {
        let error = read(text).expect_err("broken").to_string();
        assert!(error.contains(word) && error.contains("path.json"), "{error}");
    }
}

/// A camera of Inria's list, by hand: it looks along the world's x, with the world's z up, so the rows of camera to
/// world are the x, y and z of right (-y), down (-z) and forward (x).
#[test]
fn cameras_of_inria_are_read() {
    let camera = |name: &str| {
        format!(
            r#"{{"id": 0, "img_name": "{name}", "width": 200, "height": 100, "position": [1, 2, 3],
                "rotation": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], "fy": 80.0, "fx": 90.0}}"#
        )
    };
    let list = format!("[{}, {}, {}]", camera("a/DSC_1.JPG"), camera("../../a/DSC_1"), camera("b"));
    let cameras = read(&list).expect("read").expect("cameras");
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["a/DSC_1", "a/DSC_1_2", "b"], "no name leads out of the folder");
    let camera = &cameras[0];
    assert_eq!(camera.intrinsics, Intrinsics { fx: 90.0, fy: 80.0, cx: 100.0, cy: 50.0 });
    assert_eq!((camera.width, camera.height, camera.time), (200, 100, None));
    let close = |vector: DVec3, expected: DVec3| (vector - expected).length() < 1e-9;
    assert!(close(camera.c2w.transform_point3(DVec3::ZERO), DVec3::new(1.0, 2.0, 3.0)));
    assert!(close(camera.c2w.transform_vector3(DVec3::Z), DVec3::X), "forward");
    assert!(close(camera.c2w.transform_vector3(DVec3::Y), DVec3::NEG_Z), "down");
}

/// A path of nerfstudio, by hand: the camera at (1, 2, 3) looks along the world's -z with y up, as OpenGL's unturned
/// camera does.
#[test]
fn paths_of_nerfstudio_are_read() {
    let camera = |more: &str| {
        format!(
            r#"{{"camera_to_world": [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1], "fov": 90, "aspect": 1.5{more}}}"#
        )
    };
    let path = |cameras: &str| {
        format!(
            r#"{{"keyframes": [{{"matrix": "[]", "fov": 50}}], "camera_type": "perspective", "render_height": 100,
                "render_width": 150, "fps": 24, "seconds": 4, "camera_path": [{cameras}]}}"#
        )
    };
    let still =
        read(&path(&[camera(""), camera(r#", "render_time": 0.5"#)].join(","))).expect("read").expect("cameras");
    assert_eq!((still.len(), still[1].time, still[1].name.as_str()), (2, None, "path_0001"), "not all have a time");
    let timed = read(&path(&camera(r#", "render_time": 0.5"#))).expect("read").expect("cameras").remove(0);
    assert_eq!((timed.width, timed.height, timed.time), (150, 100, Some(0.5)));
    let Intrinsics { fx, fy, cx, cy } = timed.intrinsics;
    assert!((fx - 50.0).abs() < 1e-9 && (fy - 50.0).abs() < 1e-9 && (cx, cy) == (75.0, 50.0));
    let close = |vector: DVec3, expected: DVec3| (vector - expected).length() < 1e-9;
    assert!(close(timed.c2w.transform_point3(DVec3::ZERO), DVec3::new(1.0, 2.0, 3.0)));
    assert!(close(timed.c2w.transform_vector3(DVec3::Z), DVec3::NEG_Z), "forward");
    assert!(close(timed.c2w.transform_vector3(DVec3::Y), DVec3::NEG_Y), "down");
    let inria = |fx: &str, sign: &str| {
        format!(
            r#"[{{"width": 9, "height": 9, "fx": {fx}, "fy": 1, "position": [0, 0, 0],
                "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, {sign}]]}}]"#
        )
    };
    for (text, word) in [
        (path(&camera("")).replace("perspective", "fisheye"), "camera_type"),
        (path(""), "camera_path"),
        (path("3"), "camera 0"),
        (path(&camera("").replace("\"fov\": 90", "\"fov\": 0")), "fov"),
        (path(&camera("").replace("[1, 0, 0, 1,", "[")), "16 numbers"),
        (path(&camera("")).replace("\"render_height\": 100,", ""), "render_height"),
        ("[]".into(), "1 to 100000 cameras"),
        ("[5]".into(), "camera 0"),
        (r#"[{"width": 9, "height": 9, "fx": 1, "fy": 1, "position": [0, 0, 0]}]"#.into(), "3 rows"),
        (inria("0", "1"), "fx"),
        (inria("1", "-1"), "reflection"),
        (r#"[{"width": 1e9, "height": 9}]"#.into(), "width"),
    ] {
        let error = read(&text).expect_err("broken").to_string();
        assert!(error.contains(word) && error.contains("path.json"), "{word}: {error}");
    }
}

/// Any byte of these files may be another: they are read, or refused by a sentence with the file's name.
#[test]
fn damaged_cameras_never_panic() {
    let inria = r#"[{"id": 0, "img_name": "a", "width": 20, "height": 10, "position": [1, 2, 3],
        "rotation": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], "fy": 80.0, "fx": 90.0}]"#;
    let path = r#"{"render_height": 100, "render_width": 150, "camera_path": [
        {"camera_to_world": [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1], "fov": 90, "render_time": 0.5}]}"#;
    for text in [inria, path] {
        for place in 0..text.len() {
            for with in ["9", "-", "\""] {
                let mut damaged = text.to_owned();
                damaged.replace_range(place..=place, with);
                match read(&damaged) {
                    Ok(cameras) => assert!(cameras.into_iter().flatten().all(|camera| camera.c2w.is_finite())),
                    Err(error) => assert!(error.to_string().contains("path.json"), "{error}"),
                }
            }
        }
    }
}

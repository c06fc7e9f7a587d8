//! Fisheye photos and panoramas of a world in which each direction has a colour must come out as pinhole views of it.

use glam::{DQuat, DVec2, DVec3};
use gs_datasets::{Holdout, LoadOptions, View, check, load, load_cameras};
use serde_json::{Value, json};

use crate::colmap::{Camera, Image, Model};
use crate::fixtures::{Folder, all, names, npy_f32, ring, warned};
use crate::lens_formulas::{direction, shown};

const SIZE: (usize, usize) = (160, 120);
const CENTRE: [f64; 2] = [79.0, 61.5];

/// The colour of the world in a direction.
fn color(direction: DVec3) -> [u8; 3] {
    let DVec3 { x, y, z } = direction.normalize();
    [2.5 * x + y, 2.5 * y - z + 1.0, 2.5 * z + x + 2.0].map(|phase| (127.5 + 100.0 * phase.sin()).round() as u8)
}

/// A photo by a lens of COLMAP, in a pose that is turned about all axes.
fn photographed(model: i32, params: &[f64], size: (usize, usize)) -> Folder {
    let folder = Folder::new();
    let w2c = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
    folder.rgb("images/a.png", size.0, size.1, |x, y| {
        let pixel = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        direction(model, params, pixel).map_or([0; 3], |direction| color(w2c.conjugate() * direction))
    });
    write_model(&folder, model, params, size, [w2c.w, w2c.x, w2c.y, w2c.z]);
    folder
}

fn write_model(folder: &Folder, model: i32, params: &[f64], size: (usize, usize), q: [f64; 4]) {
    let image = Image { id: 1, q, t: [1.0, 2.0, 3.0], camera_id: 1, name: "a.png".into(), seen: vec![] };
    let camera = Camera { id: 1, model, width: size.0 as u64, height: size.1 as u64, params: params.to_vec() };
    Model { cameras: vec![camera], images: vec![image], points: vec![] }.write_binary(folder, "sparse/0");
}

/// Every pixel has the colour of its direction, and is masked where the photo does not show it; pixels that count.
fn compare(view: &View, model: i32, params: &[f64], size: (usize, usize), to_photo: glam::DMat4) -> usize {
    let (mut counting, mut worst) = (0, 0);
    for i in 0..view.width * view.height {
        let ray = view.intrinsics.ray((i % view.width) as f64 + 0.5, (i / view.width) as f64 + 0.5);
        let ray = view.c2w.transform_vector3(ray);
        let own = to_photo.transform_vector3(ray);
        let at = shown(model, params, own);
        // The round image of a fisheye lens, whose sides are at less than a right angle here.
        let is_dark = model != 17 && own.z < 0.0;
        let inside = at.x.min(at.y).min(size.0 as f64 - at.x).min(size.1 as f64 - at.y);
        let counts = view.mask.as_ref().is_none_or(|mask| mask[i] == 255);
        assert!(counts || inside < 1e-6 || is_dark, "{}: pixel {i} shows {at}", view.name);
        assert!(!counts || inside > -1e-6 && !is_dark, "{}: pixel {i} would show {at}", view.name);
        if counts {
            counting += 1;
            // Along the photo's border a colour stays as it is, for half a pixel.
            let expected = color(ray);
            let off = (0..3).map(|c| expected[c].abs_diff(view.image.data[3 * i + c])).max().unwrap_or(0);
            worst = worst.max(if inside > 0.5 { off } else { off.saturating_sub(4) });
        }
    }
    assert!(worst <= 3, "{} of model {model}: {worst} levels", view.name);
    counting
}

#[test]
fn every_lens_becomes_pinhole_views() {
    let [cx, cy] = CENTRE;
    let cube = ["a_back", "a_down", "a_front", "a_left", "a_right", "a_up"];
    let cases: [(i32, Vec<f64>, &[&str]); 11] = [
        (14, vec![92.0, cx, cy], &["a"]),
        (15, vec![47.0, 48.0, cx, cy], &cube[1..]),
        (8, vec![94.0, cx, cy, -0.03], &["a"]),
        (8, vec![50.0, cx, cy, -0.02], &cube[1..]),
        (9, vec![50.0, cx, cy, -0.03, 0.004], &cube[1..]),
        (5, vec![92.0, 93.0, cx, cy, -0.02, 0.01, -0.004, 0.001], &["a"]),
        (5, vec![48.0, 48.0, cx, cy, 0.02, -0.01, 0.002, -0.0001], &cube[1..]),
        (10, vec![92.0, 92.0, cx, cy, 0.02, -0.01, 0.003, -0.002, 0.002, -0.001, 0.004, -0.003], &["a"]),
        (10, vec![50.0, 50.0, cx, cy, 0.02, -0.01, 0.003, -0.002, 0.002, -0.0001, 0.004, -0.003], &cube[1..]),
        (7, vec![94.0, 94.0, cx, cy, 1.2], &["a"]),
        (17, vec![160.0, 120.0], &cube),
    ];
    for (model, params, expected) in cases {
        let folder = photographed(model, &params, SIZE);
        let scene = folder.load(&all());
        assert_eq!(names(&scene.train), expected, "model {model} with {params:?}");
        let w2c = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
        let to_photo = glam::DMat4::from_quat(w2c);
        let mut counting = 0;
        for view in &scene.train {
            counting += compare(view, model, &params, SIZE, to_photo);
            assert_eq!(view.camera_id.as_deref(), Some("1"));
            assert!((view.c2w.w_axis - scene.train[0].c2w.w_axis).length() < 1e-12, "one position");
        }
        assert!(counting > SIZE.0 * SIZE.1 / 2, "model {model}: {counting} pixels");
    }
}

#[test]
fn depth_beside_wide_photos_is_left_out_with_a_sentence() {
    for (model, params, views) in [(14, vec![92.0, 79.0, 61.5], 1), (17, vec![160.0, 120.0], 6)] {
        let folder = photographed(model, &params, SIZE);
        folder.write("depth/a.npy", npy_f32("(120, 160)", &[2.0; 120 * 160]));
        let scene = folder.load(&all());
        assert!(scene.train.iter().all(|view| view.priors.depth.is_none()));
        let sentence = |count| format!("depth priors of {count} of {count} view");
        warned(&scene.warnings, &[&sentence(views), "wide angle of their photos, and are not resampled"]);
        warned(
            &check(folder.path(), &all()).warnings,
            &[&sentence(1), "wide angle of their photos, and are not resampled"],
        );
    }
}

/// A circle of 190 degrees in a square photo: its corners would be at 134 degrees.
#[test]
fn the_dark_corners_around_a_round_image_are_left_out() {
    let folder = Folder::new();
    folder.photo("images/a.png", 120, 120);
    let focal = 60.0 / 95.0_f64.to_radians();
    write_model(&folder, 14, &[focal, 60.0, 60.0], (120, 120), [1.0, 0.0, 0.0, 0.0]);
    let scene = folder.load(&all());
    assert_eq!(names(&scene.train), ["a_down", "a_front", "a_left", "a_right", "a_up"]);
    for view in &scene.train {
        for i in 0..view.width * view.height {
            let ray = view.intrinsics.ray((i % view.width) as f64 + 0.5, (i / view.width) as f64 + 0.5);
            let angle = view.c2w.transform_vector3(ray).angle_between(DVec3::Z).to_degrees();
            let counts = view.mask.as_ref().is_none_or(|mask| mask[i] == 255);
            assert!(counts == (angle < 95.0) || (angle - 95.0).abs() < 0.01, "{}: {angle} degrees", view.name);
        }
    }
}

/// A folder with panoramas of one colour each, and their description.
fn panoramas(count: usize) -> (Folder, Value) {
    let folder = Folder::new();
    let frames: Vec<Value> = (0..count)
        .map(|i| {
            folder.photo(&format!("{i:02}.png"), 32, 16);
            json!({ "file_path": format!("{i:02}.png"), "transform_matrix": ring(i), "time": 0.1 * i as f64 })
        })
        .collect();
    (folder, json!({ "camera_model": "EQUIRECTANGULAR", "k1": 0.3, "frames": frames }))
}

#[test]
fn all_views_of_a_photo_are_in_one_split() {
    let (folder, top) = panoramas(9);
    folder.write_json("transforms.json", &top);
    let named = LoadOptions { holdout: Holdout::Names(vec!["03".into()]), ..LoadOptions::default() };
    for (options, held) in [(LoadOptions::default(), vec!["00", "08"]), (named, vec!["03"])] {
        let scene = folder.load(&options);
        let test = &scene.held_out[0].views;
        let mut photos: Vec<&str> = test.iter().filter_map(|view| view.name.split('_').next()).collect();
        photos.dedup();
        assert_eq!((photos, test.len()), (held.clone(), 6 * held.len()));
        assert_eq!(scene.train.len(), 6 * (9 - held.len()));
        assert!(test[..6].iter().all(|view| view.time == test[0].time && view.width == 10 && view.mask.is_none()));
        let report = check(folder.path(), &options);
        assert_eq!((report.train, report.held_out[0].1), (scene.train.len(), test.len()), "{report}");
        let said = report.to_string();
        assert!(said.contains("9 equirectangular photos, each as 6 pinhole views of 90 degrees across."), "{said}");
        assert!(report.is_ok() && scene.warnings == report.warnings, "{said}");
    }
}

#[test]
fn masks_and_alpha_of_a_photo_are_those_of_its_views() {
    let (folder, mut top) = panoramas(1);
    // The left half of the panorama: all of the face to the left, and half of the one in front.
    folder.rgba("00.png", 64, 32, |x, y| [(4 * x) as u8, (8 * y) as u8, 9, if x < 32 { 0 } else { 255 }]);
    folder.grey("mask.png", 64, 32, |x, _| if x < 32 { 0 } else { 255 });
    top["frames"][0]["mask_path"] = json!("mask.png");
    top["mask_meaning"] = json!("keep");
    let scene = folder.scene(&top, &all());
    let share = |values: &Option<Vec<u8>>| {
        let values = values.as_ref().expect("some are 0");
        values.iter().filter(|value| **value == 0).count() as f64 / values.len() as f64
    };
    for (view, expected) in scene.train.iter().zip([0.5, 0.5, 0.5, 1.0, 0.0, 0.5]) {
        assert_eq!(view.alpha.as_ref().map(Vec::len), Some(view.width * view.height));
        if expected > 0.0 {
            assert!((share(&view.mask) - expected).abs() < 0.1, "{}: {}", view.name, share(&view.mask));
        } else {
            assert_eq!(view.mask, None, "{}", view.name);
        }
    }
    let small = folder.load(&LoadOptions { max_width: Some(8), ..all() });
    assert!(small.train.iter().all(|view| (view.width, view.intrinsics.cx) == (8, 4.0)));
}

#[test]
fn keys_of_nerfstudio_and_instant_ngp_mean_one_lens() {
    let (folder, mut top) = panoramas(2);
    let mut loaded = |keys: &[(&str, Value)]| {
        top = json!({ "frames": top["frames"], "w": 32, "h": 16 });
        keys.iter().for_each(|(key, value)| top[*key] = value.clone());
        folder.scene(&top, &all()).train
    };
    let fisheye = [("fl_x", json!(9)), ("k1", json!(0.01)), ("k4", json!(0.001))];
    let of = |key: &'static str, value: Value| [&fisheye[..], &[(key, value)]].concat();
    assert_eq!(loaded(&of("camera_model", json!("OPENCV_FISHEYE"))), loaded(&of("is_fisheye", json!(true))));
    let pinhole = loaded(&of("is_fisheye", json!(false)));
    assert_ne!(pinhole, loaded(&of("is_fisheye", json!(true))));
    assert_eq!(loaded(&[("camera_model", json!("equirectangular"))]), loaded(&[("latlong", json!(true))]));
    for (key, value) in [
        ("equirectangular", json!(true)),
        ("ftheta_p0", json!(0.1)),
        ("camera_model", json!("FISHEYE624")),
        ("camera_model", json!("VR180_L")),
    ] {
        let mut other = json!({ "frames": top["frames"], "fl_x": 9 });
        other[key] = value.clone();
        folder.write_json("transforms.json", &other);
        folder.refused(&all(), &["not supported", "OPENCV_FISHEYE", "EQUIRECTANGULAR", value.as_str().unwrap_or(key)]);
    }
}

#[test]
fn a_fisheye_camera_renders_as_the_pinhole_of_its_focal_length() {
    let (folder, top) = panoramas(1);
    let mut fisheye = json!({ "is_fisheye": true, "fl_x": 9, "w": 32, "h": 16, "frames": top["frames"] });
    folder.write_json("cameras.json", &fisheye);
    let cameras = load_cameras(&folder.file("cameras.json")).expect("cameras");
    assert_eq!((cameras[0].intrinsics.fx, cameras[0].width), (9.0, 32));
    fisheye["latlong"] = json!(true);
    folder.write_json("cameras.json", &fisheye);
    let error = load_cameras(&folder.file("cameras.json")).expect_err("no focal length").to_string();
    assert!(error.contains("equirectangular camera"), "{error}");
}

#[test]
fn a_fisheye_lens_that_diverged_is_refused() {
    let [cx, cy] = CENTRE;
    // theta (1 - 4 theta^2) turns at two thirds of 0.289: 10 of 80 pixels.
    for params in [vec![50.0, cx, cy, -4.0], vec![50.0, cx, cy, 90.0]] {
        let folder = Folder::new();
        folder.photo("images/a.png", SIZE.0, SIZE.1);
        write_model(&folder, 8, &params, SIZE, [1.0, 0.0, 0.0, 0.0]);
        folder.refused_by_both(&all(), &["the calibration diverged", "cameras.bin"]);
    }
}

/// Parameters of any value load or are refused, and ask for no more pixels than twice the photo's sides.
#[test]
fn hostile_parameters() {
    let folder = Folder::new();
    let size = (16, 12);
    folder.photo("images/a.png", size.0, size.1);
    for (model, count) in [(5, 8), (7, 5), (8, 4), (10, 12), (14, 3), (17, 2)] {
        let centre = if [8, 14].contains(&model) { 1 } else { 2 };
        for index in 0..count {
            for value in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e-300, 1e-3, 0.3, 4.0, 1e9, -1e300] {
                let mut params = vec![0.0; count];
                params[..centre].fill(5.0);
                if model == 7 {
                    params[4] = 0.9;
                }
                if model != 17 {
                    params[centre..centre + 2].copy_from_slice(&[8.0, 6.0]);
                }
                params[index] = value;
                write_model(&folder, model, &params, size, [1.0, 0.0, 0.0, 0.0]);
                let loaded = load(folder.path(), &all());
                assert_eq!(loaded.is_ok(), check(folder.path(), &all()).is_ok(), "{model}: {params:?}");
                for view in loaded.iter().flat_map(|scene| &scene.train) {
                    assert!(view.width <= 32 && view.height <= 32, "{model}: {params:?}");
                    assert!(view.c2w.is_finite() && view.intrinsics.fx.is_finite() && view.intrinsics.cx.is_finite());
                }
            }
        }
    }
}

//! Panoptic sets and LLFF poses: the same cameras as in transforms.json, whatever the layout.

use gs_datasets::{LoadOptions, MaskUse, SceneFormat, View, check, load};
use serde_json::{Value, json};

use crate::fixtures::{Folder, all, held_out, npy, rig, ring};

const CAMERAS: usize = 3;
const TIMES: usize = 4;

/// The rig as transforms.json describes it, one focal length in pixels.
fn reference() -> Vec<View> {
    let folder = Folder::new();
    let mut top = rig(&folder, "train", 0, CAMERAS, TIMES);
    top["fl_x"] = json!(9.5);
    folder.write_json("transforms.json", &top);
    folder.load(&all()).train
}

/// Entry of a camera's OpenGL matrix.
fn entry(matrix: &Value, row: usize, column: usize) -> f64 {
    matrix[row][column].as_f64().expect("a number")
}

/// World to camera, OpenCV axes, of the `camera`-th: R^T of the rotation with y and z negated.
fn w2c(camera: usize) -> Value {
    let m = ring(camera);
    let sign = [1.0, -1.0, -1.0];
    let rows: Vec<Vec<f64>> = (0..3)
        .map(|axis| {
            let r: Vec<f64> = (0..3).map(|row| sign[axis] * entry(&m, row, axis)).collect();
            let t = -(0..3).map(|row| r[row] * entry(&m, row, 3)).sum::<f64>();
            vec![r[0], r[1], r[2], t]
        })
        .collect();
    json!([rows[0], rows[1], rows[2], [0, 0, 0, 1]])
}

fn assert_same_cameras(found: &[View], tolerance: f64) {
    let expected = reference();
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(&expected) {
        let difference = (a.c2w - b.c2w).to_cols_array().iter().fold(0.0_f64, |worst, value| worst.max(value.abs()));
        assert!(difference < tolerance, "{}: off by {difference}", a.name);
        assert_eq!(a.intrinsics, b.intrinsics, "{}", a.name);
        let (time, expected) = (a.time.expect("a time"), b.time.expect("a time") / 0.3);
        assert!((time - expected).abs() < 1e-12, "{}: {time}", a.name);
    }
}

/// Photos, masks (of camera 0 and 1) and a description with `cameras`.
fn write_meta(folder: &Folder, name: &str, cameras: std::ops::Range<usize>, times: usize) -> Value {
    let over = |value: &dyn Fn(usize, usize) -> Value| -> Vec<Vec<Value>> {
        (0..times).map(|t| cameras.clone().map(|c| value(t, c)).collect()).collect()
    };
    for t in 0..times {
        for c in cameras.clone() {
            folder.photo(&format!("ims/{c}/{t:06}.png"), 8, 6);
            if c < 2 {
                folder.grey(&format!("seg/{c}/{t:06}.png"), 8, 6, |x, _| if x == c { 255 } else { 0 });
            }
        }
    }
    let meta = json!({
        "w": 8, "h": 6,
        "k": over(&|_, _| json!([[9.5, 0, 4], [0, 9.5, 3], [0, 0, 1]])),
        "w2c": over(&|_, c| w2c(c)),
        "fn": over(&|t, c| json!(format!("{c}/{t:06}.png"))),
        "cam_id": over(&|_, c| json!(c)),
    });
    folder.write_json(name, &meta);
    meta
}

#[test]
fn panoptic_cameras_masks_and_split() {
    let folder = Folder::new();
    write_meta(&folder, "train_meta.json", 0..2, TIMES);
    write_meta(&folder, "test_meta.json", 2..3, TIMES);
    let scene = folder.load(&LoadOptions::default());
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!((scene.format, scene.train.len(), held_out(&scene).len()), (SceneFormat::Panoptic, 8, 4));
    let first = &scene.train[0];
    assert_eq!((first.name.as_str(), first.camera_id.as_deref(), &first.mask), ("ims/0/000000", Some("0"), &None));
    assert_eq!(first.priors.moving.as_ref().expect("a mask")[..3], [255, 0, 0]);
    assert_eq!(scene.train[4].priors.moving.as_ref().expect("a mask")[..3], [0, 255, 0]);
    let both: Vec<View> = scene.train.iter().chain(scene.held_out_views()).cloned().collect();
    assert_same_cameras(&both, 1e-12);
    // Masks as in any reconstruction, and given by file.
    let options = LoadOptions { masks: MaskUse::KeepBlack, ..LoadOptions::default() };
    let view = load(&folder.file("train_meta.json"), &options).expect("loaded").train.remove(0);
    assert_eq!((view.mask.expect("a mask")[0], view.priors.moving), (0, None));
    let report = check(folder.path(), &LoadOptions::default());
    assert!(report.is_ok() && report.to_string().contains("8 views have masks of moving objects"), "{report}");
}

#[test]
fn transforms_beside_a_panoptic_set_know_what_its_masks_mean() {
    let folder = Folder::new();
    write_meta(&folder, "train_meta.json", 0..1, 2);
    let mut top = rig(&folder, "train", 0, 1, 2);
    for t in 0..2 {
        top["frames"][t]["file_path"] = json!(format!("ims/0/{t:06}.png"));
        top["frames"][t]["mask_path"] = json!(format!("seg/0/{t:06}.png"));
    }
    folder.write_json("transforms_train.json", &top);
    let scene = folder.load(&LoadOptions::default());
    assert_eq!(scene.format, SceneFormat::Transforms);
    assert!(scene.train.iter().all(|view| view.priors.moving.is_some() && view.mask.is_none()));
    // Stated, it means what is stated.
    top["mask_meaning"] = json!("keep");
    folder.write_json("transforms_train.json", &top);
    let scene = folder.load(&LoadOptions::default());
    assert!(scene.train.iter().all(|view| view.priors.moving.is_none() && view.mask.is_some()));
}

#[test]
fn panoptic_descriptions_that_are_wrong_name_the_place() {
    for (key, value, part) in [
        ("k", json!([[]]), "as many as `fn`"),
        ("k", json!(3), "list over times"),
        ("w", json!(0), "image side"),
        ("h", json!(null), "image side"),
        ("fn", json!([[1, 2], [3, 4]]), "time 0, camera 0"),
        ("cam_id", json!([[1, 2], [3, {}]]), "time 1, camera 1"),
        ("w2c", json!([[1, 2], [3, 4]]), "4 rows of 4"),
        ("k", json!([[[[0, 0, 0], [0, 1, 0], [0, 0, 1]], 2], [3, 4]]), "above 0"),
        ("w2c", json!([[[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], 2], [3, 4]]), "4 rows of 4"),
    ] {
        let folder = Folder::new();
        let mut meta = write_meta(&folder, "train_meta.json", 0..2, 2);
        meta[key] = value;
        folder.write_json("train_meta.json", &meta);
        folder.refused_by_both(&LoadOptions::default(), &["train_meta.json", part]);
    }
}

/// Rows of poses_bounds.npy: columns down, right, back and position, then height, width, focal length, near, far.
fn poses(cameras: usize) -> Vec<u8> {
    let mut values: Vec<f64> = Vec::new();
    for camera in 0..cameras {
        let m = ring(camera);
        for row in 0..3 {
            let size = [12.0, 16.0, 19.0][row];
            values.extend([-entry(&m, row, 1), entry(&m, row, 0), entry(&m, row, 2), entry(&m, row, 3), size]);
        }
        values.extend([0.5, 20.0]);
    }
    let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    npy(1, "<f8", false, &format!("({cameras}, 17)"), &data)
}

#[test]
fn llff_poses_with_frames_of_cameras() {
    let folder = Folder::new();
    // Poses for photos of twice the size: intrinsics follow the photos.
    folder.write("poses_bounds.npy", poses(CAMERAS));
    for (c, name) in ["cam00", "cam01/images", "cam10"].iter().enumerate() {
        for t in 0..TIMES {
            folder.photo(&format!("{name}/{}.png", 7 + t), 8, 6);
            folder.grey(&format!("masks/cam{:02}/{}.png", [0, 1, 10][c], 7 + t), 8, 6, |x, _| u8::from(x == c));
        }
    }
    let scene = folder.load(&LoadOptions::default());
    assert_eq!((scene.format, scene.train.len(), held_out(&scene).len()), (SceneFormat::Llff, 8, 4));
    assert!(held_out(&scene).iter().all(|view| view.camera_id.as_deref() == Some("cam00")));
    let mut both: Vec<View> = scene.held_out_views().chain(&scene.train).cloned().collect();
    both.sort_by(|a, b| a.camera_id.cmp(&b.camera_id).then_with(|| a.time.partial_cmp(&b.time).expect("times")));
    assert_same_cameras(&both, 1e-9);
    assert!(both[0].priors.moving.is_some());
    std::fs::remove_dir_all(folder.file("cam10")).expect("removed");
    folder.refused(&LoadOptions::default(), &["3 poses", "2 folders"]);
}

#[test]
fn llff_poses_with_photos_or_videos_or_rubbish() {
    let folder = Folder::new();
    folder.write("poses_bounds.npy", poses(2));
    folder.refused(&all(), &["0 images"]);
    folder.photo("images/a.png", 8, 6);
    folder.photo("images/b.png", 8, 6);
    let scene = folder.load(&all());
    assert_eq!((scene.format, scene.train.len(), scene.time_range), (SceneFormat::Llff, 2, None));
    folder.write("cam00.mp4", "a film");
    folder.refused(&all(), &["videos"]);
    std::fs::remove_file(folder.file("cam00.mp4")).expect("removed");
    let mut nan = poses(2);
    let end = nan.len();
    nan[end - 17 * 8..end - 16 * 8].copy_from_slice(&f64::NAN.to_le_bytes());
    for bytes in
        [b"".to_vec(), b"\x93NUMPY".to_vec(), npy(1, "<f8", false, "(17,)", &[0; 136]), nan, poses(2)[..200].to_vec()]
    {
        folder.write("poses_bounds.npy", bytes);
        folder.refused(&all(), &["poses_bounds.npy"]);
        assert!(!check(folder.path(), &all()).is_ok());
    }
}

//! Blurry sets made from the frames of multi-view video.

use gs_datasets::LoadOptions;
use gs_datasets::light::{to_byte, to_linear};
use gs_datasets::{BlurFromFrames, blur_from_frames};
use serde_json::{Value, json};

use crate::fixtures::{Folder, held_out, ring, warned};

/// Grey of frame `frame` of camera `camera` at column `x`: a bright bar over a dark ground, one pixel on per frame.
fn grey(camera: usize, frame: usize, x: usize) -> u8 {
    if x == 2 + frame { 230 } else { 20 + 10 * camera as u8 }
}

/// Three cameras with `frames` frames of 12 x 9 pixels, 0.1 apart; masks show the bar.
fn video(frames: usize) -> (Folder, Value) {
    let folder = Folder::new();
    let mut list = Vec::new();
    for camera in 0..3 {
        for frame in 0..frames {
            let (name, mask) = (format!("ims/{camera}/{frame}.png"), format!("seg/{camera}/{frame}.png"));
            folder.rgb(&name, 12, 9, |x, _| [grey(camera, frame, x); 3]);
            folder.grey(&mask, 12, 9, |x, _| if x == 2 + frame { 255 } else { 0 });
            list.push(json!({
                "file_path": name, "mask_path": mask, "transform_matrix": ring(camera), "camera_id": camera,
                "time": frame as f64 * 0.1, "k1": 0.01 * camera as f64,
            }));
        }
    }
    (folder, json!({ "fl_x": 10.0, "w": 12, "h": 9, "frames": list }))
}

fn options() -> BlurFromFrames {
    BlurFromFrames { window: 3, stride: 2, max_width: None, moving_masks: true }
}

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    image::open(folder.file(name)).expect("an image").into_bytes()
}

#[test]
fn windows_are_averaged_in_linear_light() {
    let ((source, set), out) = (video(7), Folder::new());
    source.write_json("transforms_train.json", &set);
    let summary = blur_from_frames(source.path(), out.path(), &options()).expect("written");
    // Frames 0 to 6 give windows at 0, 2 and 4; of three cameras without a split the middle one is held out.
    assert_eq!((summary.train_cameras, summary.test_cameras, summary.photos), (2, 1, 9));
    assert!((summary.exposure - 0.3).abs() < 1e-9, "{}", summary.exposure);
    for camera in [0, 2] {
        for window in 0..3 {
            let stem = format!("train/cam{camera:02}/{window:04}.png");
            let (blurry, sharp) = (bytes(&out, &stem), bytes(&out, &format!("truth/sharp/{stem}")));
            let (mask, union) =
                (bytes(&out, &format!("truth/masks/{stem}")), bytes(&out, &format!("truth/masks_union/{stem}")));
            assert_eq!(mask, bytes(&out, &format!("priors/masks/{stem}")));
            for x in 0..12 {
                let light = |frame: usize| to_linear(f32::from(grey(camera, frame, x)) / 255.0);
                let first = 2 * window;
                assert_eq!(blurry[3 * x], to_byte((light(first) + light(first + 1) + light(first + 2)) / 3.0));
                assert_eq!(sharp[3 * x], grey(camera, first + 1, x));
                assert_eq!(mask[x] > 0, x == first + 3);
                assert_eq!(union[x] > 0, (first + 2..first + 5).contains(&x));
            }
        }
    }
}

#[test]
fn what_is_written_is_read_with_the_source_cameras() {
    let ((source, set), out) = (video(6), Folder::new());
    let mut test = set.clone();
    let is_held = |frame: &Value| frame["camera_id"] == 1;
    let keep = |set: &mut Value, held: bool| {
        set["frames"].as_array_mut().expect("frames").retain(|frame| is_held(frame) == held);
    };
    let mut train = set;
    keep(&mut train, false);
    keep(&mut test, true);
    source.write_json("transforms_train.json", &train);
    source.write_json("transforms_test.json", &test);
    let options = BlurFromFrames { max_width: Some(6), ..options() };
    let summary = blur_from_frames(source.path(), out.path(), &options).expect("written");
    assert_eq!((summary.train_cameras, summary.test_cameras, summary.photos), (2, 1, 6));
    let (before, after) =
        (source.load(&LoadOptions { max_width: Some(6), ..LoadOptions::default() }), out.load(&LoadOptions::default()));
    assert_eq!((after.train.len(), held_out(&after).len()), (4, 2));
    for (old, new) in [(&before.train[7], &after.train[2]), (&held_out(&before)[1], &held_out(&after)[0])] {
        assert_eq!((new.width, new.height, &new.camera_id), (6, 5, &old.camera_id));
        assert!(new.c2w.abs_diff_eq(old.c2w, 1e-12) && new.time == old.time, "{} is {}", new.name, old.name);
        assert!((new.intrinsics.fx - old.intrinsics.fx).abs() < 1e-9);
    }
    // Held-out photos are sharp: the bar is one of two pixels that a new one covers, not one of six.
    assert_eq!(held_out(&after)[0].image.data, bytes(&out, "test/cam01/0000.png"));
    assert!(bytes(&out, "truth/blurry/test/cam01/0000.png") != bytes(&out, "test/cam01/0000.png"));
}

#[test]
fn a_gap_costs_the_windows_over_it() {
    let ((source, mut set), out) = (video(8), Folder::new());
    // Without frame 3 of camera 0 the windows from 1 and 2 on lie over the gap.
    set["frames"].as_array_mut().expect("frames").remove(3);
    source.write_json("transforms_train.json", &set);
    let every = BlurFromFrames { stride: 1, ..options() };
    let summary = blur_from_frames(source.path(), out.path(), &every).expect("written");
    assert_eq!(summary.photos, 6 + 6 + 3);
    warned(&summary.warnings, &["2 of camera 0"]);
}

#[test]
fn what_cannot_be_averaged_is_refused() {
    type Change = fn(&mut Value, &mut BlurFromFrames);
    let cases: [(Change, &str); 8] = [
        (|_, options| options.window = 4, "`window`: expected an odd number"),
        (|_, options| options.stride = 0, "`stride`: expected at least 1 frame"),
        (|_, options| options.window = 9, "cameras with at most 7 frames"),
        (|set, _| set["frames"][2]["transform_matrix"] = ring(9), "expected a static camera"),
        (|set, _| set["frames"][2]["time"] = Value::Null, "expected a time in every frame"),
        (|set, _| set["frames"][2]["time"] = json!(0.1), "expected one frame at a time"),
        (|set, _| set["frames"][2]["fl_x"] = json!(11.0), "expected one lens per camera"),
        (
            |set, _| {
                for (i, frame) in set["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
                    frame["camera_id"] = Value::Null;
                    frame["transform_matrix"] = ring(i);
                }
            },
            "21 frames from as many positions, as a moving camera takes them",
        ),
    ];
    for (change, expected) in cases {
        let ((source, mut set), out) = (video(7), Folder::new());
        let mut options = options();
        change(&mut set, &mut options);
        source.write_json("transforms_train.json", &set);
        let error = blur_from_frames(source.path(), out.path(), &options).expect_err("refused").to_string();
        assert!(error.contains(expected), "{error}");
        assert!(!out.file("transforms_train.json").exists(), "{expected}");
    }
    let ((source, set), out) = (video(7), Folder::new());
    source.photo("ims/1/3.png", 16, 9);
    source.write_json("transforms_train.json", &set);
    let error = blur_from_frames(source.path(), out.path(), &options()).expect_err("refused").to_string();
    assert!(error.contains("pixels where") && error.contains("16 x 9") && error.contains("12 x 9"), "{error}");
}

//! Sets in the manner of NVFi: training up to time 0.75, held-out cameras, and a future of all cameras.

use gs_datasets::{LoadOptions, Scene, SparseViews, Split, View};
use serde_json::{Map, Value, json};

use crate::fixtures::{Folder, ring};

const CAMERAS: usize = 5;
const HELD_OUT: usize = 4;
const FRAMES: usize = 12;

/// The three lists, flat or nested by camera.
fn written(nested: bool) -> Folder {
    let folder = Folder::new();
    for part in ["train", "val", "test"] {
        let (mut flat, mut cameras) = (Vec::new(), Map::new());
        for camera in 0..CAMERAS {
            let mut frames = Vec::new();
            for frame in 0..FRAMES {
                let time = frame as f64 / FRAMES as f64;
                let own = match (time <= 0.75, camera == HELD_OUT) {
                    (false, _) => "test",
                    (true, true) => "val",
                    (true, false) => "train",
                };
                if own == part {
                    let stem = format!("{part}/r_{camera}_{frame:02}");
                    folder.rgba(&format!("{stem}.png"), 16, 12, |x, _| {
                        [200, 10 * x as u8, 0, if x < 8 { 255 } else { 0 }]
                    });
                    frames.push(json!({ "file_path": format!("./{stem}"), "time": time }));
                }
            }
            for frame in &frames {
                let mut frame = frame.clone();
                frame["transform_matrix"] = ring(camera);
                // A pose that was written several times differs in its last digits.
                let x = frame["transform_matrix"][0][3].as_f64().expect("a number");
                frame["transform_matrix"][0][3] = json!(x + 1e-8 * flat.len() as f64);
                flat.push(frame);
            }
            if !frames.is_empty() {
                cameras.insert(camera.to_string(), json!({ "transform_matrix": ring(camera), "frames": frames }));
            }
        }
        let mut top = if nested { json!({ "data": Value::Object(cameras) }) } else { json!({ "frames": flat }) };
        top["camera_angle_x"] = json!(0.7);
        folder.write_json(&format!("transforms_{part}.json"), &top);
    }
    folder
}

fn times(views: &[View]) -> (Option<f64>, Option<f64>) {
    let time = |view: &View| view.time.expect("a time");
    (views.iter().map(time).reduce(f64::min), views.iter().map(time).reduce(f64::max))
}

fn cameras(views: &[View]) -> usize {
    let mut ids: Vec<_> = views.iter().map(|view| view.camera_id.clone().expect("a camera")).collect();
    ids.sort();
    ids.dedup();
    ids.len()
}

#[test]
fn both_shapes_give_training_validation_and_future() {
    let check = |scene: &Scene| {
        let split = |name: &str| scene.split(name).expect("a split");
        assert_eq!((scene.train.len(), times(&scene.train)), (4 * 10, (Some(0.0), Some(0.75))));
        let (validation, test) = (split(Split::VALIDATION), split(Split::TEST));
        assert_eq!((validation.len(), times(validation)), (10, (Some(0.0), Some(0.75))));
        // Later times stay as they are written: nothing is divided by the last training time.
        assert_eq!((test.len(), times(test)), (5 * 2, (Some(10.0 / 12.0), Some(11.0 / 12.0))));
        assert_eq!((cameras(&scene.train), cameras(validation), cameras(test)), (4, 1, 5));
        assert_eq!(scene.time_range, Some((0.0, 11.0 / 12.0)));
        assert_eq!(scene.reported().map(|split| split.name.as_str()), Some(Split::TEST));
    };
    for nested in [false, true] {
        let folder = written(nested);
        check(&folder.load(&LoadOptions::default()));
        let half = LoadOptions { max_width: Some(8), background: [1.0; 3], ..LoadOptions::default() };
        let scene = folder.load(&half);
        check(&scene);
        // Half the size, on white: four columns of the photo, four of the background.
        let view = &scene.train[0];
        assert_eq!((view.width, view.height), (8, 6));
        assert_eq!(view.image.data[..3], [200, 5, 0]);
        assert_eq!(view.image.data[3 * 7..3 * 8], [255; 3]);
    }
}

/// The protocol of few views: three training cameras of all five, the others held out, at seen and at later times.
#[test]
fn both_shapes_give_the_protocol_of_few_views() {
    for nested in [false, true] {
        let folder = written(nested);
        let sparse = Some(SparseViews { train: 3, validation: 2, seen: 0.75 });
        let scene = folder.load(&LoadOptions { sparse, ..LoadOptions::default() });
        let split = |name: &str| scene.split(name).expect("a split");
        assert_eq!((scene.train.len(), cameras(&scene.train), times(&scene.train).1), (3 * 10, 3, Some(0.75)));
        let (validation, test, seen) = (split(Split::VALIDATION), split(Split::TEST), split(Split::TEST_SEEN));
        assert_eq!((test.len(), cameras(test), times(test).0), (cameras(test) * 2, cameras(test), Some(10.0 / 12.0)));
        assert!(cameras(validation) >= 1 && times(validation).1 <= Some(0.75));
        assert_eq!((seen.len(), cameras(seen)), (3 * 2, 3));
    }
}

//! Logs with mistakes: one sentence each.

use std::fs;
use std::path::Path;

use gs_driving::{DrivingLog, LogOptions, SnippetKind, check, colors, snippets};
use gs_worlds::driving::{StreetOptions, write};
use serde_json::{Value, json};

fn made(frames: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let options = StreetOptions {
        frames,
        cameras: 1,
        width: 32,
        height: 24,
        beams: 8,
        columns: 72,
        subpixels: 1,
        movers: 4,
        compressed: false,
        truth_images: false,
        ..StreetOptions::default()
    };
    write(folder.path(), &options, |_, _| {}).expect("written");
    folder
}

fn edit(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value: Value = serde_json::from_str(&fs::read_to_string(path).expect("read")).expect("JSON");
    change(&mut value);
    fs::write(path, value.to_string()).expect("written");
}

fn error(folder: &Path) -> String {
    DrivingLog::open(folder, &LogOptions::default()).expect_err("a mistake").to_string()
}

#[test]
fn times_out_of_order() {
    for file in ["lidar/timestamps.json", "camera/front_camera/timestamps.json"] {
        let folder = made(3);
        edit(&folder.path().join(file), |times| times[2] = times[0].clone());
        let error = error(folder.path());
        assert!(error.contains(file) && error.contains("entry 2: expected a time after"), "{error}");
    }
}

#[test]
fn lists_that_are_too_short() {
    for file in ["lidar/timestamps.json", "lidar/poses.json"] {
        let folder = made(3);
        edit(&folder.path().join(file), |list| drop(list.as_array_mut().expect("a list").pop()));
        let error = error(folder.path());
        assert!(error.contains(file) && error.contains("found 2 entr"), "{error}");
    }
    let folder = made(2);
    edit(&folder.path().join("camera/front_camera/poses.json"), |list| *list = json!([]));
    assert!(error(folder.path()).contains("found 2 times and 0 poses"), "{}", error(folder.path()));
}

#[test]
fn poses_and_intrinsics_without_meaning() {
    let folder = made(1);
    edit(&folder.path().join("lidar/poses.json"), |list| list[0]["heading"]["w"] = json!(7.0));
    assert!(error(folder.path()).contains("expected a heading of length 1"));
    let folder = made(1);
    edit(&folder.path().join("camera/front_camera/intrinsics.json"), |k| k["fx"] = json!(0.0));
    assert!(error(folder.path()).contains("focal lengths above 0"));
}

/// Programs write NaN, which is no JSON: the entry is named, not a column of the file.
#[test]
fn numbers_that_are_none_are_named() {
    for word in ["NaN", "-Infinity", "-nan(ind)"] {
        let written = |file: &str, number: &str| {
            let folder = made(3);
            let path = folder.path().join(file);
            edit(&path, |list| match list[1].is_object() {
                true => list[1]["position"]["x"] = json!(1.5e6),
                false => list[1] = json!(1.5e6),
            });
            let text = fs::read_to_string(&path).expect("read");
            assert!(text.contains("1500000.0"), "{text}");
            fs::write(&path, text.replace("1500000.0", number)).expect("written");
            error(folder.path())
        };
        let said = written("lidar/poses.json", word);
        assert!(said.contains("pose 1: expected a position in metres, found [NaN, "), "{word}: {said}");
        let said = written("camera/front_camera/timestamps.json", word);
        assert!(said.contains("entry 1: expected Unix seconds, found NaN"), "{word}: {said}");
        assert!(written("lidar/timestamps.json", "1e308").contains("entry 1: expected Unix seconds, found 1e308"));
    }
}

#[test]
fn missing_sensors() {
    // Without a camera points have no colours; without a sweep the frame is one of the camera alone.
    let folder = made(2);
    fs::remove_dir_all(folder.path().join("camera")).expect("removed");
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    let sweep = log.labelled_sweep(0).expect("a sweep");
    assert!(log.cameras().is_empty() && colors(&log, 0, &sweep).expect("none").iter().all(Option::is_none));
    let folder = made(3);
    fs::remove_file(folder.path().join("lidar/01.pkl")).expect("removed");
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    assert_eq!(log.frames().iter().map(|frame| frame.has_sweep).collect::<Vec<_>>(), [true, false, true]);
    assert!(log.warnings().iter().any(|text| text.contains("without a sweep")), "{:?}", log.warnings());
    assert!(log.labelled_sweep(1).expect_err("no sweep").to_string().contains("01.pkl"));
    fs::remove_dir_all(folder.path().join("lidar")).expect("removed");
    assert!(error(folder.path()).contains("expected a driving log"));
}

#[test]
fn a_log_of_one_frame() {
    let folder = made(1);
    let report = check(folder.path(), &LogOptions::default(), None);
    assert!(report.is_ok() && report.to_string().contains("1 frame over 0.0 s"), "{report}");
    let list = snippets(1, SnippetKind::Interpolation);
    assert_eq!((list.len(), &list[0].inputs[..], list[0].targets.len()), (1, &[0][..], 0));
}

/// A log is written or downloaded without some cameras: a fact. A folder without images is none.
#[test]
fn absent_cameras_are_no_warning() {
    let folder = made(2);
    let report = check(folder.path(), &LogOptions::default(), None);
    assert!(report.warnings.is_empty(), "{report}");
    assert!(report.to_string().contains("5 cameras of the rig's 6 are not here: front_left_camera, "), "{report}");
    for name in ["left_camera", "back_camera"] {
        fs::create_dir(folder.path().join("camera").join(name)).expect("made");
    }
    let report = check(folder.path(), &LogOptions::default(), None);
    assert_eq!(report.warnings, ["2 cameras without an image: left_camera, back_camera"]);
}

#[test]
fn a_gap_is_named() {
    let folder = made(8);
    edit(&folder.path().join("lidar/timestamps.json"), |times| {
        for time in &mut times.as_array_mut().expect("a list")[5..] {
            *time = json!(time.as_f64().expect("seconds") + 20.0);
        }
    });
    let report = check(folder.path(), &LogOptions::default(), None).to_string();
    assert!(report.contains("8 frames over 20.7 s, one every 100 ms"), "{report}");
    assert!(report.contains("warning: the recording has 1 gap (20.1 s after frame 04)"), "{report}");
}

#[test]
fn one_fault_of_all_sweeps_is_one_sentence() {
    let folder = made(6);
    for sweep in 0..6 {
        let path = folder.path().join(format!("lidar/{sweep:02}.pkl"));
        let whole = fs::read(&path).expect("read");
        fs::write(&path, &whole[..whole.len() - 3]).expect("written");
    }
    let report = check(folder.path(), &LogOptions::default(), None);
    assert_eq!(report.errors.len(), 1, "{report}");
    assert!(report.errors[0].contains("(in 6 files: 00.pkl, 01.pkl, 02.pkl, ...)"), "{report}");
}

#[test]
fn points_at_infinity_are_left_out() {
    let folder = made(1);
    let path = folder.path().join("lidar/00.pkl");
    let before =
        DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened").labelled_sweep(0).expect("a sweep");
    let mut bytes = fs::read(&path).expect("read");
    // The block of floats begins with the column x, whose first three values are replaced.
    let length = (5 * 8 * before.len() as u32).to_le_bytes();
    let start = bytes.windows(5).position(|w| w[0] == b'B' && w[1..] == length).expect("the block") + 5;
    for (row, value) in [f64::INFINITY, f64::NAN, 1e9].into_iter().enumerate() {
        bytes[start + 8 * row..start + 8 * row + 8].copy_from_slice(&value.to_le_bytes());
    }
    fs::write(&path, bytes).expect("written");
    let after =
        DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened").labelled_sweep(0).expect("a sweep");
    assert_eq!((after.len(), after.left_out), (before.len() - 3, 3));
    assert_eq!(after.points[..], before.points[3..]);
    let (old, new) = (before.labels.expect("labels"), after.labels.expect("labels"));
    assert_eq!(
        (&old.semantic[3..], &old.flow[3..]),
        (&new.semantic[..], &new.flow[..]),
        "labels stay with their points"
    );
    assert!(check(folder.path(), &LogOptions::default(), None).to_string().contains("3 points are not finite"));
}

#[test]
fn a_calibration_that_shows_no_point() {
    let folder = made(2);
    edit(&folder.path().join("camera/front_camera/poses.json"), |list| {
        for pose in list.as_array_mut().expect("a list") {
            pose["position"]["z"] = json!(5000.0);
            // Looking up.
            pose["heading"] = json!({ "w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0 });
        }
    });
    let report = check(folder.path(), &LogOptions::default(), None);
    assert!(!report.is_ok() && report.to_string().contains("no LiDAR point falls into any image"), "{report}");
}

#[test]
fn every_cut_of_a_sweep_is_one_sentence() {
    let folder = made(1);
    let path = folder.path().join("lidar/00.pkl");
    let whole = fs::read(&path).expect("read");
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    // Every byte of the head and of the tail, where the structure is, and every 499th of the numbers.
    let cuts = (0..whole.len()).filter(|cut| *cut < 400 || *cut + 500 > whole.len() || cut % 499 == 0);
    for cut in cuts {
        fs::write(&path, &whole[..cut]).expect("written");
        let error = log.labelled_sweep(0).expect_err("cut").to_string();
        assert!(error.contains("00.pkl") && !error.contains('\n'), "{cut}: {error}");
    }
}

/// Recognising a segment of Waymo needs no feature, reading it does.
#[test]
#[cfg(not(feature = "waymo"))]
fn a_segment_of_waymo_names_the_feature() {
    let folder = tempfile::tempdir().expect("a folder");
    let component = folder.path().join("vehicle_pose");
    fs::create_dir_all(&component).expect("a folder");
    let (poses, records) = (component.join("a.parquet"), folder.path().join("a.tfrecord"));
    fs::write(&poses, "").expect("written");
    fs::write(&records, "").expect("written");
    for path in [folder.path(), &poses, &records] {
        let error = error(path);
        assert!(error.contains("is not supported") && error.contains("--features waymo"), "{error}");
        let report = check(path, &LogOptions::default(), None);
        assert!(!report.is_ok() && report.to_string().contains("Waymo Open Dataset"), "{report}");
    }
}

//! A small log of Argoverse 2, written by `fixtures/argoverse.py`.

use std::path::Path;

use gs_driving::{DrivingLog, LogFormat, LogOptions, ObjectClass, colors, project};

fn copied() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/argoverse"), folder.path());
    folder
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).expect("copied");
        }
    }
}

#[test]
fn points_boxes_and_poses() {
    let folder = copied();
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    assert_eq!((log.format(), log.frames().len(), log.cameras().len()), (LogFormat::Argoverse, 2, 0));
    assert_eq!(log.origin().to_array(), [5000.0, -3000.0, 60.0]);
    for frame in 0..2 {
        let sweep = log.labelled_sweep(frame).expect("a sweep");
        assert_eq!(sweep.len(), 200, "both batches");
        // Half precision keeps 16 to 32 m to 1/64 m; the vehicle drives 1 m.
        for (i, point) in sweep.points.iter().enumerate() {
            let expected = 8.0 + 0.1 * i as f32 + frame as f32;
            assert!((point[0] - expected).abs() < 0.01 && point[1].abs() == 0.25 && point[2] == 1.5, "{i}: {point:?}");
            let after = sweep.times[i] - log.frames()[frame].time;
            // Unix seconds in f64 keep 6e-8 s here.
            assert!((after - 5e-4 * i as f64).abs() < 2e-7, "{i}: {after}");
            assert_eq!((sweep.intensity[i] as usize, sweep.sensor[i]), (i, u8::from(i % 64 >= 32)));
        }
        let labels = sweep.labels.expect("boxes");
        let inside = labels.class.iter().filter(|class| **class == ObjectClass::Car).count();
        // The first box reaches from 7.5 to 12.5 m and the second from 7 to 12 m, 0.1 m more by the margin of boxes: 47
        // and 42 points.
        assert!(inside.abs_diff([47, 42][frame]) <= 1, "{inside} points in the box");
        // The vehicle drives 1 m and the box falls back 0.5 m in its axes: it moves 0.5 m in the city.
        match (frame, labels.flow[10]) {
            (0, Some(flow)) => assert!((flow[0] - 0.5).abs() < 1e-4 && flow[1].abs() < 1e-4, "{flow:?}"),
            (1, None) => {}
            other => panic!("{other:?}: the last frame's boxes have no next one"),
        }
        assert_eq!(labels.flow[199], Some([0.0; 3]));
    }
}

/// Logs of the LiDAR data set have no image and no intrinsics.
#[test]
fn a_log_without_cameras_opens() {
    let folder = copied();
    let intrinsics = folder.path().join("calibration/intrinsics.feather");
    std::fs::remove_file(&intrinsics).expect("removed");
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    assert_eq!((log.frames().len(), log.cameras().len()), (2, 0));
    assert_eq!(log.labelled_sweep(0).expect("a sweep").len(), 200);
    std::fs::create_dir_all(folder.path().join("sensors/cameras/ring_front_center")).expect("made");
    let said = DrivingLog::open(folder.path(), &LogOptions::default()).expect_err("images need it").to_string();
    assert!(said.contains("intrinsics.feather"), "{said}");
}

/// The ground of the map is 0.2 m below the points up to 16 m ahead, and far below the others.
#[test]
fn the_map_says_what_is_ground() {
    let folder = copied();
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    let sweep = log.sweep(0).expect("a sweep");
    let map = folder.path().join("map");
    assert!(log.map_ground().expect_err("no map").to_string().contains("map"));
    std::fs::create_dir(&map).expect("made");
    let row: [f32; 40] = std::array::from_fn(|x| if x < 16 { 61.3 } else { 55.0 });
    gs_base::npy::write_npy(&map.join("0_ground_height_surface____PIT.npy"), &[row; 8]).expect("written");
    let place = map.join("0___img_Sim2_city.json");
    std::fs::write(&place, r#"{"R": [1.0, 0.0, 0.0, 1.0], "t": [-5000.0, 3004.0], "s": 1.0}"#).expect("written");
    let ground = log.map_ground().expect("a map");
    for point in &sweep.points {
        assert_eq!(ground.has(*point), point[0] < 16.0, "{point:?}");
    }
    // A place that is no number is on no ground.
    std::fs::write(&place, r#"{"R": [1e308, 1e308, 1e308, 1e308], "t": [-1e308, -1e308], "s": 1e308}"#)
        .expect("written");
    let nowhere = log.map_ground().expect("numbers");
    assert!(sweep.points.iter().all(|point| !nowhere.has(*point)));
    std::fs::write(&place, "{}").expect("written");
    assert!(log.map_ground().expect_err("no numbers").to_string().contains("Sim2"));
}

#[test]
fn a_log_without_lidar_says_so() {
    let folder = copied();
    let said = || DrivingLog::open(folder.path(), &LogOptions::default()).expect_err("no frames").to_string();
    let lidar = folder.path().join("sensors/lidar");
    std::fs::rename(&lidar, folder.path().join("elsewhere")).expect("moved");
    assert!(said().contains("sensors/lidar: expected LiDAR sweeps") && said().contains("no such folder"), "{}", said());
    std::fs::create_dir_all(&lidar).expect("made");
    assert!(said().contains("a folder without any"), "{}", said());
}

#[test]
fn a_portrait_camera_sees_what_is_ahead() {
    let folder = copied();
    let images = folder.path().join("sensors/cameras/ring_front_center");
    std::fs::create_dir_all(&images).expect("a folder");
    // 20 ms after the first sweep; the second has no image within 50 ms.
    let picture = image::RgbImage::from_pixel(24, 32, image::Rgb([200, 100, 50]));
    picture.save(images.join("315966265279836000.jpg")).expect("written");
    let opened = DrivingLog::open(folder.path(), &LogOptions::default());
    let error = opened.expect_err("no pose within 10 ms of that image").to_string();
    assert!(error.contains("a pose within 10 ms"), "{error}");
    std::fs::rename(images.join("315966265279836000.jpg"), images.join("315966265262836000.jpg")).expect("renamed");
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    assert_eq!((log.view_index(0, 0), log.view_index(1, 0)), (Some(0), None));
    let sweep = log.labelled_sweep(0).expect("a sweep");
    let w2c = log.camera_pose(0, 0).expect("a pose").inverse();
    // Point 0 is 6.5 m ahead of the camera, 0.25 m to its left and 0.1 m below.
    let (pixel, z) = project(&log.cameras()[0], &w2c, sweep.points[0]).expect("in view");
    assert!((z - 6.5).abs() < 1e-6 && (pixel.x - (12.0 - 40.0 * 0.25 / 6.5)).abs() < 1e-6, "{pixel} at {z}");
    assert!((pixel.y - (16.0 + 40.0 * 0.1 / 6.5)).abs() < 1e-6, "{pixel}");
    let found = colors(&log, 0, &sweep).expect("colours");
    let color = found[0].expect("seen");
    assert!((color[0] - 200.0 / 255.0).abs() < 0.02 && (color[2] - 50.0 / 255.0).abs() < 0.03, "{color:?}");
    assert!(colors(&log, 1, &sweep).expect("no image").iter().all(Option::is_none));
}

//! Segments of the Waymo Open Dataset, written here from a known scene in both versions and read back.

mod hostile;
mod modular;
mod record;
mod scene;

use std::path::{Path, PathBuf};

use glam::{DVec3, DVec4};
use gs_datasets::FrameSource;
use gs_driving::{CameraUse, DrivingLog, LogFormat, LogOptions, ObjectClass, check, colors, project};
use parquet::file::properties::WriterVersion;

use modular::{NAME, PLAIN, Style, stamp};
use scene::*;

/// Most that a point may be off, metres: f32 keeps poses of pixels at 4096 to 8192 m to half of 2^-11 m along each axis
/// (0.42 mm along the diagonal), their angles to 2^-25 rad each and ranges to 2^-24 of 60 m (0.01 mm in all), and
/// centred points below 128 m to 2^-18 m.
const TOP_BOUND: f64 = 4.5e-4;

/// The same without poses of pixels, which the other lasers do not have.
const BOUND: f64 = 2e-5;

/// Segments in each layout: a folder that keeps the files, and the path to open.
fn segments() -> Vec<(tempfile::TempDir, PathBuf)> {
    let styles = [
        PLAIN,
        Style { version: WriterVersion::PARQUET_1_0, dictionary: true, group: 2, page: 700 },
        Style { version: WriterVersion::PARQUET_2_0, dictionary: false, group: 4, page: 900 },
        Style { version: WriterVersion::PARQUET_2_0, dictionary: true, group: 1000, page: 2000 },
    ];
    let mut all: Vec<(tempfile::TempDir, PathBuf)> = styles
        .into_iter()
        .map(|style| {
            let folder = tempfile::tempdir().expect("a folder");
            modular::segment(folder.path(), style);
            let path = folder.path().to_path_buf();
            (folder, path)
        })
        .collect();
    let folder = tempfile::tempdir().expect("a folder");
    let path = record::segment(folder.path());
    all.push((folder, path));
    all
}

fn open(path: &Path) -> DrivingLog {
    DrivingLog::open(path, &LogOptions::default()).expect("opened")
}

fn assert_scene(log: &DrivingLog) {
    assert_eq!((log.format(), log.name(), log.frames().len()), (LogFormat::Waymo, NAME, FRAMES));
    assert_eq!(log.warnings(), &[] as &[String]);
    assert!(log.origin().distance(START) < 1e-9, "{}", log.origin());
    for frame in 0..FRAMES {
        let described = &log.frames()[frame];
        assert_eq!((described.name.clone(), described.has_sweep), (stamp(frame).to_string(), true));
        assert_points(log, frame);
        let boxes = log.cuboids(frame).expect("boxes");
        let (centre, yaw) = box_pose(frame);
        assert_eq!((boxes.len(), boxes[0].label.as_str(), boxes[0].track.as_str()), (1, "TYPE_VEHICLE", "the-box"));
        // f64 throughout: positions of 10^4 m keep 1e-11 of that.
        assert!(boxes[0].centre.distance(centre - log.origin()) < 1e-8 && (boxes[0].yaw - yaw).abs() < 1e-9);
        assert_eq!(boxes[0].size, LABEL_SIZE);
    }
}

fn assert_points(log: &DrivingLog, frame: usize) {
    let sweep = log.labelled_sweep(frame).expect("a sweep");
    let lasers = lasers();
    let expected: Vec<(usize, Hit)> =
        lasers.iter().enumerate().flat_map(|(i, l)| hits(l, frame).into_iter().map(move |hit| (i, hit))).collect();
    assert_eq!((sweep.len(), sweep.left_out), (expected.len(), 0));
    assert!(sweep.len() > 500, "{} points", sweep.len());
    let labels = sweep.labels.as_ref().expect("boxes");
    let (mut on_box, mut unlabelled) = (0, 0);
    for (i, (laser, hit)) in expected.iter().enumerate() {
        let point = DVec3::from_array(sweep.points[i].map(f64::from));
        let off = point.distance(hit.point - log.origin());
        assert!(off < [TOP_BOUND, BOUND][*laser], "{i}: {off} m off, of laser {laser}");
        assert_eq!((sweep.sensor[i], sweep.intensity[i]), (*laser as u8, hit.row as f32));
        // Unix seconds in f64 keep 2.4e-7 s.
        assert!((sweep.times[i] - STAMP as f64 * 1e-6 - hit.time).abs() < 1e-6, "{i}");
        let world = point + log.origin();
        if hit.on_box {
            on_box += 1;
            assert_eq!((labels.class[i], labels.instance[i]), (ObjectClass::Car, 1));
            match labels.flow[i] {
                None => assert_eq!(frame + 1, FRAMES, "only the last frame has no next one"),
                Some(found) => {
                    let flow = DVec3::from_array(found.map(f64::from));
                    // Flow is of the point that was read, and f32 itself.
                    assert!(flow.distance(scene::flow(frame, world)) < 1e-6, "{i}: {flow}");
                }
            }
        } else if hit.column == 0 {
            unlabelled += 1;
            assert_eq!(labels.flow[i], None, "a zone without labels");
        } else {
            assert!((world.z - GROUND).abs() < TOP_BOUND, "on the plane: {world}");
            // The margin of boxes reaches over the plane at their feet.
            assert!(labels.flow[i] == Some([0.0; 3]) || labels.instance[i] == 1, "{i}: {:?}", labels.flow[i]);
        }
    }
    assert!(on_box > 30 && unlabelled > 3, "{on_box} on the box, {unlabelled} without labels");
}

#[test]
fn points_times_boxes_and_flow() {
    for (_folder, path) in segments() {
        assert_scene(&open(&path));
    }
}

/// Writes the segment that `fixtures/waymo.py` rewrites, and reads it back.
#[test]
#[ignore = "needs GS_WAYMO_FIXTURE"]
fn the_source_of_the_fixture() {
    let folder = PathBuf::from(std::env::var_os("GS_WAYMO_FIXTURE").expect("a folder"));
    modular::segment(&folder, PLAIN);
    assert_scene(&open(&folder));
}

/// The frame of a segment whose row and column are known by hand: the first column looks back, and columns turn
/// clockwise.
#[test]
fn the_first_column_looks_back_and_to_the_left() {
    let laser = Laser { number: 1, place: glam::DMat4::IDENTITY, angles: Err((0.0, 0.0)), rows: 1, columns: 4 };
    let quarters = [0, 1, 2, 3].map(|column| laser.direction(0, column));
    let half = 0.5_f64.sqrt();
    let expected = [(-half, half), (half, half), (half, -half), (-half, -half)];
    for (found, (x, y)) in quarters.iter().zip(expected) {
        assert!(found.distance(DVec3::new(x, y, 0.0)) < 1e-12, "{found}");
    }
}

#[test]
fn second_returns_follow_the_first() {
    for (_folder, path) in segments() {
        let (first, second) = (open(&path), open(&path).with_second_returns());
        let (few, all) = (first.labelled_sweep(1).expect("a sweep"), second.labelled_sweep(1).expect("a sweep"));
        assert_eq!(all.len(), few.len() + 2, "one of each laser");
        for (index, laser) in lasers().iter().enumerate() {
            let hit = &hits(laser, 1)[0];
            let place = (vehicle(hit.time) * laser.place).w_axis.truncate();
            let expected = hit.point + (hit.point - place).normalize() - second.origin();
            // Version 2 and version 1 order returns differently.
            let found = all.points.iter().map(|p| DVec3::from_array(p.map(f64::from)).distance(expected));
            assert!(found.fold(f64::INFINITY, f64::min) < TOP_BOUND, "laser {index}");
        }
    }
}

#[test]
fn cameras_project_to_known_pixels() {
    for (_folder, path) in segments() {
        let log = open(&path);
        for (index, camera) in cameras().iter().enumerate() {
            let described = &log.cameras()[index];
            assert_eq!(described.name, ["FRONT", "FRONT_LEFT"][index]);
            let [fu, fv, cu, cv, ..] = camera.intrinsic;
            let k = described.intrinsics;
            let zoom = k.fx / fu;
            assert!((k.fy / fv - zoom).abs() < 1e-12 && (k.cx, k.cy) == (cu, cv), "{k:?}");
            assert!(if index == 0 { zoom > 1.0 && zoom < 1.3 } else { zoom == 1.0 }, "{zoom}");
            for frame in 0..FRAMES {
                let time = exposure(frame, camera);
                let shot = log.shot(frame, index).expect("a shot");
                assert!((shot.time - STAMP as f64 * 1e-6 - time).abs() < 1e-6);
                let pose = vehicle(time) * camera.place;
                for (ahead, left, up) in [(9.0, 0.5, 0.3), (20.0, -3.0, -2.0), (3.0, 0.0, 0.0)] {
                    let world = pose.transform_point3(DVec3::new(ahead, left, up)) - log.origin();
                    let w2c = log.camera_pose(frame, index).expect("a pose").inverse();
                    let (pixel, depth) = project(described, &w2c, world.as_vec3().to_array()).expect("in view");
                    let expected = (cu - zoom * fu * left / ahead, cv - zoom * fv * up / ahead);
                    // f32 keeps positions below 32 m to 1e-6 m, which is 2e-5 pixels at 3 m.
                    assert!((pixel.x - expected.0).abs() < 5e-5 && (pixel.y - expected.1).abs() < 5e-5, "{pixel}");
                    assert!((depth - ahead).abs() < 1e-5);
                }
            }
        }
    }
}

/// The photo is painted through the lens; what is read must be the ideal image at the described intrinsics, at every
/// pixel.
#[test]
fn distortion_is_removed() {
    for (_folder, path) in segments() {
        let log = open(&path);
        for index in 0..2 {
            let k = log.cameras()[index].intrinsics;
            let image = log.image(2, index).expect("an image");
            assert_eq!((image.width, image.height), (WIDTH, HEIGHT));
            let mut worst = 0.0_f64;
            for (i, found) in image.data.chunks_exact(3).enumerate() {
                let (u, v) = ((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5);
                // The outermost half pixel repeats the border.
                if u < 1.0 || v < 1.0 || u > WIDTH as f64 - 1.0 || v > HEIGHT as f64 - 1.0 {
                    continue;
                }
                let expected = paint((u - k.cx) / k.fx, (v - k.cy) / k.fy);
                found.iter().zip(expected).for_each(|(f, e)| worst = worst.max((f64::from(*f) - e).abs()));
            }
            // Two roundings, of the photo and of the result; the paint is bent by the lens by less than 0.1 within a
            // pixel.
            assert!(worst < 1.2, "camera {index}: {worst} of 255");
        }
    }
}

/// Pose of the image, calibration, axes and lens together: a point has the colour that is painted in its direction.
#[test]
fn points_have_the_colour_of_their_direction() {
    let (_folder, path) = segments().remove(0);
    let log = open(&path);
    let sweep = log.labelled_sweep(1).expect("a sweep");
    let mut seen = 0;
    for (point, color) in sweep.points.iter().zip(colors(&log, 1, &sweep).expect("colours")) {
        let Some(color) = color else { continue };
        let world = DVec3::from_array(point.map(f64::from)) + log.origin();
        let cameras = cameras();
        let off = cameras.iter().map(|camera| {
            let pose = vehicle(exposure(1, camera)) * camera.place;
            let local = pose.inverse().transform_point3(world);
            let expected = paint(-local.y / local.x, -local.z / local.x);
            color.iter().zip(expected).map(|(f, e)| (255.0 * f64::from(*f) - e).abs()).fold(0.0, f64::max)
        });
        // Points at the border of an image take the colour of its outermost pixels' centres: half a pixel, 1.3 of 255.
        assert!(off.fold(f64::INFINITY, f64::min) < 3.0, "{point:?}: {color:?}");
        seen += 1;
    }
    assert!(seen > 100, "{seen} points in an image");
}

/// Written by pyarrow (`fixtures/waymo.py`) from the files of this scene: Brotli, dictionaries, short pages, several
/// groups, rows and columns in another order, transforms in single precision, names in place of numbers.
#[test]
fn files_of_another_writer() {
    let log = open(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/waymo"));
    assert_eq!((log.frames().len(), log.cameras().len()), (FRAMES, 2));
    for frame in 0..FRAMES {
        let sweep = log.labelled_sweep(frame).expect("a sweep");
        let expected: Vec<Hit> = lasers().iter().flat_map(|laser| hits(laser, frame)).collect();
        assert_eq!(sweep.len(), expected.len());
        for (point, hit) in sweep.points.iter().zip(&expected) {
            let off = DVec3::from_array(point.map(f64::from)).distance(hit.point - log.origin());
            // Twice the bound of poses in single precision: the origin is one of them too.
            assert!(off < 2.0 * TOP_BOUND, "{off}");
        }
        assert_eq!(sweep.labels.expect("boxes").tracks, ["the-box"]);
        assert_eq!(log.image(frame, 0).expect("an image").width, WIDTH);
    }
}

#[test]
fn a_segment_by_the_file_of_a_component() {
    let folder = tempfile::tempdir().expect("a folder");
    modular::segment(folder.path(), PLAIN);
    let name = format!("{NAME}.parquet");
    for component in ["vehicle_pose", "lidar", "camera_image"] {
        let path = folder.path().join(component).join(&name);
        assert_eq!((LogFormat::of(&path), open(&path).name()), (Some(LogFormat::Waymo), NAME));
    }
    assert_eq!(LogFormat::of(&folder.path().join("vehicle_pose")), None, "a folder of logs");
    let other = folder.path().join("vehicle_pose/other.parquet");
    std::fs::copy(folder.path().join("vehicle_pose").join(&name), &other).expect("copied");
    let error = DrivingLog::open(folder.path(), &LogOptions::default()).expect_err("two segments").to_string();
    assert!(error.contains("the file vehicle_pose/NAME.parquet stands for one"), "{error}");
    let report = check(&folder.path().join("lidar").join(&name), &LogOptions::default(), None);
    assert!(report.is_ok(), "{report}");
}

#[test]
fn options_choose_cameras_and_sizes() {
    let (_folder, path) = segments().remove(4);
    let options = LogOptions { cameras: CameraUse::Front, max_width: Some(WIDTH / 2) };
    let log = DrivingLog::open(&path, &options).expect("opened");
    let [camera] = log.cameras() else { panic!("one camera") };
    assert_eq!((camera.name.as_str(), camera.width, camera.height), ("FRONT", WIDTH / 2, HEIGHT / 2));
    assert_eq!(camera.intrinsics.cx, 15.5);
    let view = log.decode(0).expect("a view");
    assert_eq!((view.image.width, view.mask), (WIDTH / 2, None));
}

/// The pose of a camera keeps the axes apart: x right, y down, z ahead.
#[test]
fn camera_axes_are_those_of_opencv() {
    let (_folder, path) = segments().remove(0);
    let log = open(&path);
    let camera = &cameras()[0];
    let pose = vehicle(exposure(0, camera)) * camera.place;
    let c2w = log.camera_pose(0, 0).expect("a pose");
    let off = |found: DVec4, expected: DVec4| (found - expected).length();
    assert!(off(c2w.z_axis, pose.x_axis) < 1e-9, "ahead");
    assert!(off(c2w.x_axis, -pose.y_axis) < 1e-9, "right");
    assert!(off(c2w.y_axis, -pose.z_axis) < 1e-9, "down");
}

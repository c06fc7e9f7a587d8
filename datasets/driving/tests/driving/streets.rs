//! Synthetic streets, written and read back.

use std::path::Path;

use glam::{DVec2, DVec3};
use gs_datasets::FrameSource;
use gs_driving::truth_image;
use gs_driving::{CameraUse, DrivingLog, LogOptions, check, colors, depth_image, project};
use gs_worlds::driving::{StreetOptions, write};

fn small() -> StreetOptions {
    StreetOptions {
        frames: 3,
        cameras: 2,
        width: 160,
        height: 90,
        beams: 24,
        columns: 360,
        subpixels: 1,
        range_noise: 0.0,
        ..StreetOptions::default()
    }
}

fn made(options: &StreetOptions) -> (tempfile::TempDir, DrivingLog) {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), options, |_, _| {}).expect("written");
    let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
    (folder, log)
}

#[test]
fn a_street_comes_back_in_both_layouts() {
    for compressed in [true, false] {
        let (_folder, log) = made(&StreetOptions { compressed, ..small() });
        assert_eq!((log.frames().len(), log.cameras().len(), log.origin()), (3, 2, DVec3::ZERO));
        assert!(log.warnings().is_empty(), "a log may have two cameras: {:?}", log.warnings());
        for frame in 0..3 {
            let sweep = log.labelled_sweep(frame).expect("a sweep");
            assert!(sweep.len() > 2000 && sweep.left_out == 0, "{} points", sweep.len());
            let time = log.frames()[frame].time;
            assert!(
                sweep.times.iter().all(|t| (-0.1..=0.0).contains(&(t - time))),
                "points are of the turn before the time"
            );
            let labels = sweep.labels.expect("labels");
            assert_eq!((labels.flow.len(), labels.semantic.len()), (sweep.points.len(), sweep.points.len()));
            assert!(labels.tracks.len() > 5 && labels.instance.iter().any(|number| *number > 0));
            assert_eq!(log.image(frame, 1).expect("an image").data.len(), 3 * 160 * 90);
        }
        let view = log.decode(log.view_index(2, 1).expect("an image")).expect("a view");
        assert_eq!(
            (view.name.as_str(), view.camera_id.as_deref()),
            ("front_left_camera/02", Some("front_left_camera"))
        );
    }
}

#[test]
fn same_seed_same_bytes_other_seed_other_street() {
    let folders: Vec<_> = (0..3).map(|_| tempfile::tempdir().expect("a folder")).collect();
    for (folder, seed) in folders.iter().zip([3, 3, 4]) {
        write(folder.path(), &StreetOptions { frames: 1, seed, ..small() }, |_, _| {}).expect("written");
    }
    let bytes = |i: usize, file: &str| std::fs::read(folders[i].path().join(file)).expect("read");
    for file in ["lidar/00.pkl.gz", "camera/front_camera/00.jpg", "annotations/cuboids/00.pkl.gz", "truth/actors.json"]
    {
        assert_eq!(bytes(0, file), bytes(1, file), "{file}");
        assert_ne!(bytes(0, file), bytes(2, file), "{file}");
    }
}

/// A LiDAR point that is nowhere hidden has the depth of the pixel it falls on. LiDAR and camera stand apart and look
/// at different times, so a share of points is hidden or moved; a wrong axis, half-turn or time would leave almost
/// none.
#[test]
fn points_fall_on_pixels_of_their_depth() {
    let (folder, log) = made(&small());
    for frame in 0..3 {
        let sweep = log.labelled_sweep(frame).expect("a sweep");
        for camera in 0..2 {
            let described = &log.cameras()[camera];
            let truth =
                truth_image(folder.path(), &described.name, &log.frames()[frame].name).expect("read").expect("truth");
            let w2c = log.camera_pose(frame, camera).expect("a pose").inverse();
            let (mut close, mut all) = (0, 0);
            for point in &sweep.points {
                let Some((pixel, z)) = project(described, &w2c, *point) else { continue };
                let depth = f64::from(truth.depth[pixel.y as usize * truth.width + pixel.x as usize]);
                all += 1;
                // A pixel of the road at grazing view covers metres of depth, so the bound is a share.
                close += usize::from((depth - z).abs() < 0.05 * z + 0.05);
            }
            assert!(all > 300, "{all} points in view of camera {camera}");
            assert!(close as f64 > 0.85 * all as f64, "frame {frame}, camera {camera}: {close} of {all}");
            let sparse = depth_image(described, &log.camera_pose(frame, camera).expect("a pose"), &sweep.points);
            let filled = sparse.iter().filter(|z| **z > 0.0).count();
            assert!(filled > all / 3 && filled <= all, "{filled} pixels for {all} points");
        }
    }
}

#[test]
fn colours_are_those_of_the_image() {
    let (_folder, log) = made(&small());
    let sweep = log.labelled_sweep(1).expect("a sweep");
    let found = colors(&log, 1, &sweep).expect("colours");
    let image = log.image(1, 0).expect("an image");
    let w2c = log.camera_pose(1, 0).expect("a pose").inverse();
    let mut compared = 0;
    for (point, color) in sweep.points.iter().zip(&found) {
        // The cameras look 55 degrees apart and see 72, so the middle third is the front camera's alone.
        let Some((pixel, _)) = project(&log.cameras()[0], &w2c, *point) else { continue };
        if (pixel.x / 160.0 - 0.5).abs() > 0.15 {
            continue;
        }
        let near = (pixel - DVec2::splat(0.5)).round().min(DVec2::new(159.0, 89.0));
        let at = 3 * (near.y as usize * 160 + near.x as usize);
        let red = f32::from(image.data[at]) / 255.0;
        compared += 1;
        // Half a pixel away at most: neighbours differ by less than their range.
        let range: Vec<f32> = (-1_i64..=1)
            .flat_map(|dy| (-1_i64..=1).map(move |dx| (dx, dy)))
            .map(|(dx, dy)| {
                let (x, y) = ((near.x as i64 + dx).clamp(0, 159) as usize, (near.y as i64 + dy).clamp(0, 89) as usize);
                f32::from(image.data[3 * (y * 160 + x)]) / 255.0
            })
            .collect();
        let (low, high) = (range.iter().copied().fold(red, f32::min), range.iter().copied().fold(red, f32::max));
        let value = color.expect("seen")[0];
        assert!(value >= low - 1e-5 && value <= high + 1e-5, "{value} outside {low} to {high}");
    }
    assert!(compared > 100, "{compared} points");
    assert!(found.iter().any(Option::is_none), "no camera looks back");
}

/// The exact flow of points agrees with the boxes that are written beside them: a point moved by its flow lies in the
/// box of the next frame.
#[test]
fn flow_leads_into_the_next_box() {
    let (_folder, log) = made(&small());
    let (mut moving, mut inside) = (0, 0);
    for frame in 0..2 {
        let sweep = log.labelled_sweep(frame).expect("a sweep");
        let labels = sweep.labels.as_ref().expect("labels");
        let later = log.cuboids(frame + 1).expect("boxes");
        for (index, point) in sweep.points.iter().enumerate() {
            let flow = labels.flow[index].expect("known");
            let length = flow.iter().map(|v| v * v).sum::<f32>().sqrt();
            if labels.instance[index] == 0 {
                assert_eq!(length, 0.0, "the street does not move");
            } else if length > 0.05 {
                let track = &labels.tracks[labels.instance[index] as usize - 1];
                let cuboid = later.iter().find(|cuboid| cuboid.track == *track).expect("the object's next box");
                let moved = DVec3::from_array([0, 1, 2].map(|axis| f64::from(point[axis] + flow[axis])));
                moving += 1;
                // Boxes are of the middle of the sweep, points up to 0.05 s off, at up to 13 m/s.
                inside += usize::from(cuboid.contains(moved, 0.7));
            }
        }
    }
    assert!(moving > 30 && inside == moving, "{inside} of {moving}");
}

#[test]
fn the_front_camera_alone_and_smaller_images() {
    let (folder, _) = made(&StreetOptions { frames: 1, ..small() });
    let options = LogOptions { cameras: CameraUse::Front, max_width: Some(80) };
    let log = DrivingLog::open(folder.path(), &options).expect("opened");
    assert_eq!(log.cameras().len(), 1);
    let camera = &log.cameras()[0];
    assert_eq!((camera.name.as_str(), camera.width, camera.height), ("front_camera", 80, 45));
    assert_eq!(camera.intrinsics.cx, 40.0);
    assert_eq!(log.image(0, 0).expect("an image").data.len(), 3 * 80 * 45);
}

#[test]
fn check_says_what_is_there() {
    let (folder, log) = made(&small());
    let out = folder.path().join("drawn");
    let report = check(folder.path(), &LogOptions::default(), Some(&out));
    assert!(report.is_ok(), "{report}");
    let text = report.to_string();
    for part in ["3 frames", "front_camera: 3 images of 160 x 90", "-50.0 to -50.0 ms", "3 sweeps"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(out.join("front_left_camera-01.png").is_file());
    drop(log);
    let missing = check(Path::new("nowhere"), &LogOptions::default(), None);
    assert!(!missing.is_ok() && missing.to_string().contains("nothing there"), "{missing}");
}

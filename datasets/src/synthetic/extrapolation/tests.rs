//! Worlds as they are loaded again: splits, times, alpha, and moving objects where the cameras show them.

use std::path::Path;

use glam::DVec3;

use super::*;
use crate::{LoadOptions, Scene, Split, View, load};

fn small(world: World) -> ExtrapolationOptions {
    ExtrapolationOptions {
        width: 64,
        height: 48,
        cameras: 5,
        held_out: 1,
        frames: 12,
        ..ExtrapolationOptions::of(world)
    }
}

fn written(options: &ExtrapolationOptions) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), options, |_, _| {}).expect("written");
    folder
}

fn loaded(folder: &Path) -> Scene {
    let options = LoadOptions { background: [1.0; 3], training_truth: true, ..LoadOptions::default() };
    load(folder, &options).expect("loaded")
}

#[test]
fn splits_are_those_of_nvfi_and_times_stay() {
    let options = small(World::Fan);
    let folder = written(&options);
    let scene = loaded(folder.path());
    let count = |name: &str| scene.split(name).map_or(0, <[View]>::len);
    // Times 0 to 9 of 12 are up to 0.75.
    assert_eq!((scene.train.len(), count(Split::VALIDATION), count(Split::TEST)), (4 * 10, 10, 5 * 2));
    let times = |views: &[View]| {
        views.iter().filter_map(|view| view.time).fold([f64::MAX, f64::MIN], |[low, high], t| [low.min(t), high.max(t)])
    };
    assert_eq!(times(&scene.train), [0.0, 0.75]);
    assert_eq!(times(scene.split(Split::TEST).expect("test")), [10.0 / 12.0, 11.0 / 12.0]);
    let with_depth = scene.train.iter().filter(|view| view.priors.depth.is_some());
    assert!(with_depth.clone().count() == 4 && with_depth.clone().all(|view| view.time == Some(0.0)));
    assert!(scene.points.as_ref().is_some_and(|points| points.len() > 100), "the union of the priors' pixels");
}

#[test]
fn objects_are_transparent_around_and_rooms_are_not() {
    for (world, share) in [(World::Duo, 0.5), (World::Room, 0.0)] {
        let folder = written(&small(world));
        let image = image::open(folder.path().join("train/cam00/0000.png")).expect("a photo");
        let pixels = image.to_rgba8();
        let clear =
            pixels.pixels().filter(|pixel| pixel[3] == 0).count() as f64 / f64::from(pixels.width() * pixels.height());
        assert!(if share > 0.0 { clear > share } else { clear == 0.0 }, "{world}: {clear} of the pixels are clear");
    }
}

#[test]
fn the_same_options_write_the_same_bytes() {
    let options = small(World::Hinge);
    let folders = [written(&options), written(&options), written(&ExtrapolationOptions { seed: 1, ..options })];
    let bytes = |i: usize, file: &str| std::fs::read(folders[i].path().join(file)).expect("read");
    for file in ["train/cam01/0003.png", "transforms_train.json", "priors/depth/train/cam00/0000.exr", "points3d.ply"] {
        assert_eq!(bytes(0, file), bytes(1, file), "{file}");
        assert_ne!(bytes(0, file), bytes(2, file), "{file}");
    }
}

/// The mask of the moving ball is where the camera projects the ball, at all times and in all splits.
#[test]
fn masks_lie_where_the_movers_are() {
    let options = ExtrapolationOptions { width: 96, height: 96, ..small(World::FallingBall) };
    let folder = written(&options);
    let scene = loaded(folder.path());
    let text = std::fs::read_to_string(folder.path().join("transforms_test.json")).expect("read");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let poses = json["movers"][0]["poses"].as_array().expect("poses").clone();
    let mut compared = 0;
    for view in scene.train.iter().chain(scene.held_out_views()) {
        let time = view.time.expect("a time");
        let near = |pose: &&serde_json::Value| (pose["time"].as_f64().expect("a number") - time).abs() < 1e-9;
        let pose = poses.iter().find(near).expect("a pose");
        let position: Vec<f64> =
            pose["position"].as_array().expect("three").iter().filter_map(|x| x.as_f64()).collect();
        let centre = view.intrinsics.project(view.c2w.inverse().transform_point3(DVec3::from_slice(&position)));
        let mask = view.truth.moving.as_ref().expect("a mask");
        let lit: Vec<(f64, f64)> = (0..mask.len())
            .filter(|pixel| mask[*pixel] > 0)
            .map(|pixel| ((pixel % view.width) as f64 + 0.5, (pixel / view.width) as f64 + 0.5))
            .collect();
        // The still object may cover part of the ball.
        let inside = lit.iter().any(|(x, y)| (x - centre.x).hypot(y - centre.y) < 1.5);
        let middle = lit.iter().fold((0.0, 0.0), |sum, at| (sum.0 + at.0, sum.1 + at.1));
        let (x, y) = (middle.0 / lit.len() as f64, middle.1 / lit.len() as f64);
        compared += usize::from(inside && (x - centre.x).hypot(y - centre.y) < 2.0);
    }
    let all = scene.train.len() + scene.held_out_views().count();
    assert!(compared * 10 >= all * 8, "the ball was found in {compared} of {all} views");
}

#[test]
fn options_out_of_range_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    for options in [
        ExtrapolationOptions { frames: 3, ..small(World::Fan) },
        ExtrapolationOptions { held_out: 3, ..small(World::Fan) },
        ExtrapolationOptions { priors: PriorErrors { noise: f64::NAN, ..PriorErrors::default() }, ..small(World::Fan) },
    ] {
        assert!(write(folder.path(), &options, |_, _| {}).is_err());
    }
    assert!("fann".parse::<World>().is_err_and(|message| message.contains("falling-ball")));
}

//! Few training cameras, a seen past and a future.

use std::path::PathBuf;

use glam::{DMat4, DVec3};
use gs_datasets::{LoadOptions, Scene, SparseViews, Split, SplitUse, View, ViewKind, check, load, view_kind};
use serde_json::json;

use crate::fixtures::{Folder, look_at};

fn cameras(views: &[View]) -> Vec<String> {
    let mut ids: Vec<String> = views.iter().filter_map(|view| view.camera_id.clone()).collect();
    ids.sort();
    ids.dedup();
    ids
}

fn options(train: usize, validation: usize, seen: f64) -> LoadOptions {
    LoadOptions { sparse: Some(SparseViews { train, validation, seen }), ..LoadOptions::default() }
}

/// `count` cameras on an arc of 150 degrees, eight times 0 to 1 each, without a split of their own.
fn arc(count: usize) -> Folder {
    let folder = Folder::new();
    let mut frames = Vec::new();
    for camera in 0..count {
        let turn = 2.6 * camera as f64 / (count - 1) as f64;
        let eye = DVec3::new(4.0 * turn.cos(), 4.0 * turn.sin(), 1.0);
        for time in 0..8 {
            let name = format!("images/c{camera:02}_{time}.png");
            folder.photo(&name, 8, 6);
            frames.push(json!({
                "file_path": name,
                "time": f64::from(time) / 7.0,
                "camera_id": format!("c{camera:02}"),
                "transform_matrix": look_at(eye, DVec3::ZERO),
            }));
        }
    }
    folder.write_json("transforms.json", &json!({ "camera_angle_x": 0.8, "w": 8, "h": 6, "frames": frames }));
    folder
}

fn at(turn: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(turn.cos(), turn.sin(), 0.2))
}

#[test]
fn a_camera_between_interpolates_and_one_outside_extrapolates() {
    let train = [at(0.0), at(0.6), at(1.2)];
    for (turn, kind) in [
        (0.3, ViewKind::Interpolating),
        (0.9, ViewKind::Interpolating),
        (-0.5, ViewKind::Extrapolating),
        (1.8, ViewKind::Extrapolating),
        (3.6, ViewKind::Extrapolating),
    ] {
        assert_eq!(view_kind(&train, &at(turn)), kind, "{turn}");
    }
}

#[test]
fn an_arc_without_a_split_is_divided_by_camera_and_time() {
    let folder = arc(10);
    let scene = folder.load(&options(3, 4, 0.75));
    let split = |name: &str| scene.split(name).expect("a split");
    let own = cameras(&scene.train);
    // Times 0 to 5 of 7 are within three quarters.
    assert_eq!((own.len(), scene.train.len(), split(Split::VALIDATION).len()), (3, 18, 24));
    assert_eq!((split(Split::TEST).len(), split(Split::TEST_SEEN).len()), (8, 6));
    assert_eq!(cameras(split(Split::TEST_SEEN)), own);
    assert!(cameras(split(Split::TEST)).iter().all(|id| !own.contains(id)));
    assert!(scene.train.iter().all(|view| view.time <= Some(0.75)));
    assert!(split(Split::TEST).iter().all(|view| view.time > Some(0.75)));
    let poses: Vec<DMat4> = scene.train.iter().map(|view| view.c2w).collect();
    let between = |view: &&View| view_kind(&poses, &view.c2w) == ViewKind::Interpolating;
    assert_eq!(split(Split::TEST).iter().filter(between).count(), 4, "two of four cameras at two times");
    assert_eq!(scene.warnings, Vec::<String>::new(), "the future is held out on purpose");
    let report = check(folder.path(), &options(3, 4, 0.75)).to_string();
    assert!(report.contains("2 between them, 2 outside"), "{report}");
}

#[test]
fn the_choice_is_the_same_each_time_and_figures_are_of_the_future() {
    let folder = arc(12);
    let ids = |options: &LoadOptions| {
        let Scene { train, held_out, .. } = load(folder.path(), options).expect("loaded");
        let lists: Vec<_> = held_out.iter().map(|split| (split.name.clone(), cameras(&split.views))).collect();
        (cameras(&train), lists)
    };
    let all = ids(&options(5, 4, 0.5));
    assert_eq!(all, ids(&options(5, 4, 0.5)));
    let names: Vec<&str> = all.1.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, [Split::TEST, Split::VALIDATION, Split::TEST_SEEN]);
    let reported = ids(&LoadOptions { splits: SplitUse::Reported, ..options(5, 4, 0.5) });
    assert_eq!(reported, (all.0, all.1[..1].to_vec()));
    let (_, without_future) = ids(&options(5, 4, 1.0));
    assert_eq!(without_future.len(), 1, "all is seen: only held-out cameras are left");
}

#[test]
fn sets_without_enough_cameras_are_refused_in_words() {
    let folder = arc(4);
    folder.refused(&options(5, 2, 1.0), &["at most 4 training cameras", "found 5"]);
    let still = Folder::new();
    still.photo("images/a.png", 8, 6);
    let frame = json!({ "file_path": "images/a.png", "transform_matrix": look_at(DVec3::X, DVec3::ZERO) });
    still.write_json("transforms.json", &json!({ "camera_angle_x": 0.8, "frames": [frame] }));
    still.refused(&options(3, 2, 1.0), &["told apart by name or pose"]);
    assert!(!check(still.path(), &options(3, 2, 1.0)).is_ok());
}

/// Names the folder of the real capture "basketball" of the CMU Panoptic Studio in Dynamic 3D Gaussians' layout.
const PANOPTIC: &str = "GS_PANOPTIC";

/// A real capture: 27 training and 4 held-out cameras, 40 times.
#[test]
#[ignore = "needs the capture: GS_PANOPTIC=FOLDER"]
fn panoptic_basketball_has_a_past_and_a_future() {
    let folder = PathBuf::from(std::env::var_os(PANOPTIC).expect("GS_PANOPTIC names the capture's folder"));
    for (train, validation) in [(3, 4), (5, 7)] {
        let scene =
            load(&folder, &LoadOptions { max_width: Some(32), ..options(train, validation, 0.75) }).expect("loaded");
        let split = |name: &str| scene.split(name).expect("a split");
        // Times 0 to 29 of 39.
        assert_eq!((cameras(&scene.train).len(), scene.train.len()), (train, 30 * train));
        assert_eq!((split(Split::VALIDATION).len(), split(Split::TEST).len()), (30 * validation, 10 * validation));
        assert_eq!(split(Split::TEST_SEEN).len(), 10 * train);
        let poses: Vec<DMat4> = scene.train.iter().map(|view| view.c2w).collect();
        let kinds: Vec<_> = split(Split::TEST).iter().map(|view| view_kind(&poses, &view.c2w)).collect();
        assert!(kinds.contains(&ViewKind::Interpolating) && kinds.contains(&ViewKind::Extrapolating));
    }
}

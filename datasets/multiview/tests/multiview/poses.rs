//! Poses in a wrong convention, points in a wrong unit and photos in a wrong order are found, and sound sets pass.

use std::sync::OnceLock;

use glam::{DMat4, DVec3};
use gs_datasets::{LoadOptions, PointCloud, PoseConvention, Scene, View, load};
use gs_multiview::{Camera, PointsFault, PoseJudgement, PoseVerdict, judge_poses, pose_pairs};
use gs_worlds::extrapolation::{self, ExtrapolationOptions};

use crate::fixture;

/// Photos of a still world on an arc, and its points; traced once.
fn still_world() -> &'static Scene {
    static WORLD: OnceLock<Scene> = OnceLock::new();
    WORLD.get_or_init(|| fixture::still_world(14, 400))
}

const READ: &str = "c2w-opengl";

fn convention(text: &str) -> PoseConvention {
    text.parse().expect("a convention")
}

fn judged(views: &[View], points: Option<&PointCloud>) -> PoseJudgement {
    let cameras: Vec<Camera> = views.iter().map(|view| Camera { c2w: view.c2w, time: view.time }).collect();
    let chosen = pose_pairs(&cameras);
    let views: Vec<&View> = chosen.views.iter().map(|view| &views[*view]).collect();
    judge_poses(&views, &chosen.pairs, points, DVec3::ZERO, convention(READ))
}

/// The views as a reader gives them that takes a file of the convention `written` for one of [`READ`].
fn misread(views: &[View], written: &str) -> Vec<View> {
    let of = |view: &View| {
        let c2w = convention(READ).to_c2w(convention(written).to_file(view.c2w));
        View { c2w, ..view.clone() }
    };
    views.iter().map(of).collect()
}

#[test]
fn sound_poses_pass() {
    let scene = still_world();
    for points in [scene.points.as_ref(), None] {
        let judgement = judged(&scene.train, points);
        assert_eq!((judgement.verdict, judgement.warning(false)), (PoseVerdict::Agrees, None), "{judgement:?}");
        assert!(judgement.given.matches.is_some_and(|share| share > 0.9), "{judgement:?}");
    }
}

#[test]
fn another_convention_is_named() {
    let scene = still_world();
    // The last one is Unity's, whose world is left-handed.
    for written in ["c2w-opencv", "w2c-opencv", "w2c-opengl", "c2w-down-right-back", "c2w-right-up-forward"] {
        let mut points = scene.points.clone().expect("points");
        if written == "c2w-right-up-forward" {
            points.positions.iter_mut().for_each(|position| position[0] = -position[0]);
        }
        for points in [Some(&points), None] {
            let judgement = judged(&misread(&scene.train, written), points);
            let PoseVerdict::Convention(found, _) = judgement.verdict else { panic!("{written}: {judgement:?}") };
            assert_eq!(found, convention(written), "with points: {}", points.is_some());
            let warning = judgement.warning(false).expect("a fault");
            assert!(warning.contains(&format!("data.poses={written} ")), "{warning}");
        }
    }
}

#[test]
fn another_unit_is_named() {
    let scene = still_world();
    let mut points = scene.points.clone().expect("points");
    points.positions.iter_mut().for_each(|position| *position = position.map(|x| 1000.0 * x));
    let judgement = judged(&scene.train, Some(&points));
    let Some(PointsFault::Scale(scale, _)) = judgement.points else { panic!("{judgement:?}") };
    assert_eq!(scale, 1e-3);
    assert!(judgement.warning(false).is_some_and(|text| text.contains("data.points_scale=0.0010 ")));
}

/// Photos of one place have like colours in any order, so that points alone would pass.
#[test]
fn photos_in_another_order_are_told() {
    let scene = still_world();
    let poses: Vec<DMat4> = scene.train.iter().map(|view| view.c2w).collect();
    let mut views = scene.train.clone();
    let count = views.len();
    views.iter_mut().enumerate().for_each(|(i, view)| view.c2w = poses[(5 * i + 2) % count]);
    for points in [scene.points.as_ref(), None] {
        let judgement = judged(&views, points);
        assert_eq!(judgement.verdict, PoseVerdict::Disagrees, "{judgement:?}");
    }
}

#[test]
fn points_of_another_world_are_told() {
    let scene = still_world();
    let moved = |change: &dyn Fn([f32; 3]) -> [f32; 3]| {
        let mut points = scene.points.clone().expect("points");
        points.positions.iter_mut().for_each(|position| *position = change(*position));
        judged(&scene.train, Some(&points))
    };
    // Far away, one direction has all of them in view.
    for (x, y, z) in [(1e4, 2e4, -3e4), (5e5, 5e6, 300.0)] {
        let judgement = moved(&|[a, b, c]| [a + x, b + y, c + z]);
        assert!(matches!(judgement.points, Some(PointsFault::Distant(_))), "{judgement:?}");
        assert!(judgement.warning(false).is_some_and(|text| text.contains("of one world")), "{judgement:?}");
    }
    let turned = moved(&|[x, y, z]| [x, -z, y]);
    let shuffled = {
        let mut points = scene.points.clone().expect("points");
        points.colors.rotate_left(37);
        judged(&scene.train, Some(&points))
    };
    for judgement in [turned, shuffled] {
        assert_eq!(judgement.verdict, PoseVerdict::Agrees, "{judgement:?}");
        assert!(matches!(judgement.points, Some(PointsFault::Colors | PointsFault::Unseen)), "{judgement:?}");
    }
}

/// Points of the first frame of two moving objects, from all sides: each photo shows the half that faces it, and photos
/// of later frames show nothing where the points lie.
#[test]
fn points_that_move_and_hide_each_other_are_judged_where_photos_show_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = ExtrapolationOptions {
        width: 100,
        height: 100,
        cameras: 9,
        frames: 12,
        ..ExtrapolationOptions::of(extrapolation::World::Duo)
    };
    extrapolation::write(folder.path(), &options, |_, _| {}).expect("written");
    let scene = load(folder.path(), &LoadOptions::default()).expect("a scene");
    let judgement = judged(&scene.train, scene.points.as_ref());
    assert_eq!((judgement.points, judgement.warning(false)), (None, None), "{judgement:?}");
}

/// Grey photos of nothing say nothing, whatever the poses.
#[test]
fn photos_without_texture_do_not_tell() {
    let views: Vec<View> =
        (0..6).map(|i| View { c2w: DMat4::from_translation(DVec3::X * f64::from(i)), ..View::blank(64, 48) }).collect();
    assert_eq!(judged(&views, None).verdict, PoseVerdict::Untold);
    assert_eq!(judged(&[], None).verdict, PoseVerdict::Untold);
    assert_eq!(judged(&views[..1], Some(&PointCloud::default())).verdict, PoseVerdict::Untold);
}

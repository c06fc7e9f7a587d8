//! Input that has no answer gets none, and a reason.

use glam::DVec3;
use gs_datasets::Scene;
use gs_multiview::{
    CueOptions, HullOptions, MaskOptions, MaskSource, MovingMasks, background, centres, guide_velocity, hull,
    moving_masks, object_centres, static_cameras,
};

use crate::fixture::{HEIGHT, WIDTH, World, straight, true_masks};

/// Runs everything; returns all that was said about what is missing.
fn run(scene: &Scene, masks: &[Option<Vec<u8>>]) -> Vec<String> {
    let MovingMasks { mut warnings, .. } = moving_masks(scene, MaskSource::Auto, &MaskOptions::default());
    let found = centres(scene, masks);
    guide_velocity(&found.centres, 0.5);
    object_centres(scene, masks, &CueOptions::default());
    for camera in static_cameras(&scene.train) {
        background(&scene.train, &camera, &MaskOptions::default());
    }
    let hull = hull(scene, masks, 0.5, &HullOptions::default());
    assert_eq!(hull.points.len(), hull.points.colors.len());
    assert!(hull.points.positions.iter().flatten().all(|value| value.is_finite()));
    warnings.extend(found.notes);
    warnings.extend(hull.notes);
    warnings
}

fn small() -> Scene {
    World { cameras: 4, frames: 4, ..World::of(straight) }.scene()
}

fn says(warnings: &[String], what: &str) {
    assert!(warnings.iter().any(|text| text.contains(what)), "expected {what:?} in {warnings:?}");
}

#[test]
fn empty_masks() {
    let scene = small();
    let masks = vec![Some(vec![0; WIDTH * HEIGHT]); scene.train.len()];
    says(&run(&scene, &masks), "fewer than two cameras see it");
    says(&run(&scene, &vec![None; scene.train.len()]), "no hull at time");
    says(&run(&scene, &[]), "no hull at time");
    // Sizes that are not the photo's.
    says(&run(&scene, &vec![Some(vec![255; 7]); scene.train.len()]), "no hull at time");
}

#[test]
fn one_camera() {
    let scene = World { cameras: 1, frames: 4, ..World::of(straight) }.scene();
    says(&run(&scene, &true_masks(&scene)), "fewer than two cameras see it");
}

#[test]
fn cameras_in_one_place() {
    let mut scene = small();
    let pose = scene.train[0].c2w;
    scene.train.iter_mut().for_each(|view| view.c2w = pose);
    says(&run(&scene, &true_masks(&scene)), "same direction");
}

#[test]
fn everything_moves() {
    let scene = small();
    let masks = vec![Some(vec![255; WIDTH * HEIGHT]); scene.train.len()];
    assert_eq!(run(&scene, &masks), Vec::<String>::new(), "masks of everything are answered");
    let mut scene = scene;
    for (i, view) in scene.train.iter_mut().enumerate() {
        view.image.data.iter_mut().enumerate().for_each(|(j, value)| *value = ((i * 7919 + j * 104_729) % 251) as u8);
    }
    says(&run(&scene, &masks), "are the cameras fixed");
}

#[test]
fn no_times() {
    let mut scene = small();
    let masks = true_masks(&scene);
    scene.train.iter_mut().for_each(|view| view.time = None);
    says(&run(&scene, &masks), "no training view has a time");
    scene.train.iter_mut().for_each(|view| view.time = Some(f64::NAN));
    says(&run(&scene, &masks), "no training view has a time");
    // All at one time, in which the object is in four places.
    scene.train.iter_mut().for_each(|view| view.time = Some(3.0));
    says(&run(&scene, &masks), "do not agree on one position");
    scene.train.clear();
    says(&run(&scene, &[]), "no training view has a time");
}

#[test]
fn broken_views() {
    let scene = small();
    let masks = true_masks(&scene);
    let mut broken = scene.clone();
    broken.train[3].c2w.w_axis.x = f64::NAN;
    broken.train[5].intrinsics.fx = 0.0;
    broken.train[6].c2w = glam::DMat4::ZERO;
    broken.train[9].image.data.truncate(100);
    broken.train[10].mask = Some(vec![255; 3]);
    broken.train[12].priors.moving = Some(vec![0; 5]);
    broken.train[13].mask = Some(vec![0; WIDTH * HEIGHT]);
    says(&run(&broken, &masks), "another size than the photo");
    let mut behind = scene;
    for view in &mut behind.train {
        view.c2w.z_axis = -view.c2w.z_axis;
        view.c2w.x_axis = -view.c2w.x_axis;
    }
    says(&run(&behind, &masks), "same direction");
}

/// Two times without a common object, and a time far from any view.
#[test]
fn nothing_near() {
    let scene = small();
    let hull =
        hull(&scene, &true_masks(&scene), 40.0, &HullOptions { points: 0, misses: Some(9), ..HullOptions::default() });
    says(&hull.notes, "no view was taken near time 40");
    assert!(hull.points.is_empty());
    assert!(hull.centre.distance(DVec3::ZERO) < 3.0);
}

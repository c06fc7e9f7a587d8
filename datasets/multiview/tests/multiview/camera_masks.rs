//! Masks found in the photos of static cameras.

use glam::DVec3;
use gs_datasets::{RgbImage8, Scene};
use gs_multiview::{MaskOptions, MaskOrigin, MaskSource, background, camera_masks, moving_masks, static_cameras};

use crate::fixture::{HEIGHT, WIDTH, World, share, straight, true_masks};

/// Intersection over union, all views together.
fn iou(found: &[Option<Vec<u8>>], truth: &[Option<Vec<u8>>]) -> f64 {
    let (mut both, mut either) = (0, 0);
    for (a, b) in found.iter().zip(truth) {
        let (a, b) = (a.as_ref().expect("found"), b.as_ref().expect("true"));
        both += a.iter().zip(b).filter(|(a, b)| **a != 0 && **b != 0).count();
        either += a.iter().zip(b).filter(|(a, b)| **a != 0 || **b != 0).count();
    }
    both as f64 / either as f64
}

fn found(scene: &Scene) -> Vec<Option<Vec<u8>>> {
    let masks = moving_masks(scene, MaskSource::Inferred, &MaskOptions::default());
    assert_eq!(masks.warnings, Vec::<String>::new());
    assert_eq!(masks.count(MaskOrigin::Inferred), scene.train.len());
    masks.masks
}

/// The ball is 20 pixels wide, so half a pixel all around is 10 % of its area and would leave an IoU of 0.9.
#[test]
fn a_moving_ball_is_found_under_noise() {
    for noise in [0.0, 1.5, 4.0] {
        let scene = World { noise, ..World::of(straight) }.scene();
        let iou = iou(&found(&scene), &true_masks(&scene));
        assert!(iou > 0.9, "noise {noise}: IoU {iou}");
    }
}

/// A path of half its diameter: the middle of the ball's way shows the ball all the time, where a median over time
/// would show it as background and call its surroundings moving.
#[test]
fn a_slow_ball_leaves_no_ghost() {
    let scene = World::of(|t| DVec3::new(0.1, 0.3 * t - 0.15, 0.45)).scene();
    let iou = iou(&found(&scene), &true_masks(&scene));
    assert!(iou > 0.9, "IoU {iou}");
}

/// One colour, covering the middle of its way for more than half of the time: only its colour tells its first and last
/// position from the background, and what it never uncovers from a thing that stands there.
#[test]
fn a_plain_ball_leaves_no_ghost() {
    let mut world = World::of(|t| DVec3::new(0.1, 0.8 * t - 0.4, 0.45));
    world.balls[0].texture = 0.0;
    let scene = world.scene();
    // From the side; who looks along its way sees one colour that stays where it is.
    let scene = from_the_side(scene);
    let iou = iou(&found(&scene), &true_masks(&scene));
    assert!(iou > 0.85, "IoU {iou}");
}

/// The five middle cameras of the arc.
fn from_the_side(mut scene: Scene) -> Scene {
    scene.train.retain(|view| ["cam02", "cam03", "cam04", "cam05", "cam06"].iter().any(|id| view.name.starts_with(id)));
    scene
}

/// It turns in position by 4 radians: nothing but its texture changes, and no pixel of it ever shows the background. A
/// texture that is level along the turn, near the poles, does not change either.
#[test]
fn a_turning_ball_moves() {
    let mut world = World::of(|_| DVec3::new(0.1, 0.0, 0.45));
    world.balls[0].spin = 4.0;
    let scene = world.scene();
    let iou = iou(&found(&scene), &true_masks(&scene));
    assert!(iou > 0.75, "IoU {iou}");
}

#[test]
fn blur_gives_the_union_over_the_exposure() {
    let scene = World { exposure: 0.9, ..World::of(straight) }.scene();
    let iou = iou(&found(&scene), &true_masks(&scene));
    // Both ends of a smear are faint, a pixel there is covered for a ninth of the exposure, but the smear is half a
    // ball long and the ends are a pixel of it.
    assert!(iou > 0.9, "IoU {iou}");
}

#[test]
fn noise_alone_moves_nothing() {
    for noise in [0.0, 0.4, 2.0, 6.0] {
        let scene = World { noise, balls: Vec::new(), ..World::of(straight) }.scene();
        let masks = moving_masks(&scene, MaskSource::Inferred, &MaskOptions::default());
        let worst = masks.masks.iter().flatten().map(|mask| share(mask)).fold(0.0, f64::max);
        assert!(worst < 1e-3, "noise {noise}: {worst}");
        assert!(masks.warnings.iter().any(|text| text.contains("nothing moves")), "{:?}", masks.warnings);
    }
}

/// A disc of shade with a soft edge wanders over the floor; the ball must stay in the masks and the shade out.
#[test]
fn shadows_are_not_the_object() {
    let mut scene = World::of(straight).scene();
    for view in &mut scene.train {
        let truth = view.truth.moving_union.as_ref().expect("truth");
        let at = 20.0 + 56.0 * view.time.unwrap_or(0.0);
        for pixel in (0..WIDTH * HEIGHT).filter(|pixel| truth[*pixel] == 0) {
            let (x, y) = ((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
            let inside = ((12.0 - (x - at).hypot(y - 60.0)) / 6.0).clamp(0.0, 1.0);
            for c in 0..3 {
                let value = &mut view.image.data[3 * pixel + c];
                *value = (f64::from(*value) * (1.0 - 0.4 * inside)).round() as u8;
            }
        }
    }
    let iou = iou(&found(&scene), &true_masks(&scene));
    assert!(iou > 0.9, "IoU {iou}");
}

/// Against the same world without the ball: 99 % of pixels within 2 levels (noise of 1.5 averages to 0.5 and rounds).
#[test]
fn the_background_is_what_the_ball_hides() {
    let scene = from_the_side(World::of(straight).scene());
    let empty = from_the_side(World { balls: Vec::new(), noise: 0.0, ..World::of(straight) }.scene());
    for camera in static_cameras(&scene.train) {
        let found = background(&scene.train, &camera, &MaskOptions::default()).expect("a static camera");
        let truth: &RgbImage8 = &empty.train[camera.views[0]].image;
        let right = found.image.data.iter().zip(&truth.data).filter(|(a, b)| a.abs_diff(**b) <= 2).count();
        assert!(right as f64 > 0.99 * truth.data.len() as f64, "{} of {}", right, truth.data.len());
        assert!(found.known.iter().filter(|known| **known).count() as f64 > 0.99 * found.known.len() as f64);
    }
}

#[test]
fn cameras_are_told_by_pose() {
    let mut scene = World { cameras: 3, frames: 4, ..World::of(straight) }.scene();
    scene.train.iter_mut().for_each(|view| view.camera_id = None);
    // Two views trade positions: order is by time and not by position.
    scene.train.swap(0, 2);
    let groups = static_cameras(&scene.train);
    assert_eq!(groups.len(), 3);
    assert_eq!(groups[0].views, [2, 1, 0, 3]);
    // A camera that moves leaves groups of one view, and those have no evidence.
    for (i, view) in scene.train.iter_mut().enumerate() {
        view.c2w.w_axis.x += 0.1 * i as f64;
    }
    let groups = static_cameras(&scene.train);
    assert_eq!(groups.len(), 12);
    assert!(groups.iter().all(|group| camera_masks(&scene.train, group, &MaskOptions::default()).is_none()));
}

#[test]
fn masks_of_the_data_set_come_first() {
    let mut scene = World { cameras: 2, frames: 5, ..World::of(straight) }.scene();
    for view in scene.train.iter_mut().take(5) {
        view.priors.moving = view.truth.moving_union.clone();
    }
    let masks = moving_masks(&scene, MaskSource::Auto, &MaskOptions::default());
    assert_eq!((masks.count(MaskOrigin::Given), masks.count(MaskOrigin::Inferred)), (5, 5));
    assert_eq!(masks.masks[0], scene.train[0].truth.moving_union);
    let masks = moving_masks(&scene, MaskSource::Given, &MaskOptions::default());
    assert_eq!(masks.count(MaskOrigin::Given), 5);
    assert!(masks.warnings[0].contains("5 of 10"), "{:?}", masks.warnings);
}

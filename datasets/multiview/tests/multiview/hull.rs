//! Hulls against the ball they were carved from.

use std::f64::consts::PI;

use glam::{DMat4, DVec3, Vec3};
use gs_multiview::{HullOptions, MaskOptions, MaskSource, hull, moving_masks};

use crate::fixture::{Ball, HEIGHT, WIDTH, World, grown, straight, true_masks};

const RADIUS: f64 = 0.3;

/// Largest and smallest distance of the points from a centre.
fn distances(points: &[[f32; 3]], centre: DVec3) -> (f64, f64) {
    let all = points.iter().map(|point| Vec3::from_array(*point).as_dvec3().distance(centre));
    all.fold((0.0, f64::INFINITY), |(most, least), distance| (f64::max(most, distance), f64::min(least, distance)))
}

/// Nine silhouettes of a sphere: their cones meet in a body that is larger by what no camera sees (a few per cent), by
/// one camera that may miss, and by half a pixel of 20.
#[test]
fn the_hull_is_the_ball() {
    let scene = World::of(straight).scene();
    let masks = true_masks(&scene);
    for t in [0.0, 5.0 / 11.0, 1.0] {
        let hull = hull(&scene, &masks, t, &HullOptions::default());
        assert_eq!(hull.notes, Vec::<String>::new());
        let ratio = hull.volume / (4.0 / 3.0 * PI * RADIUS.powi(3));
        assert!((0.9..1.35).contains(&ratio), "t {t}: volume {ratio}");
        assert!(hull.centre.distance(straight(t)) < 0.03 * 2.0 * RADIUS, "t {t}: centre {}", hull.centre);
        let size = hull.bounds.1 - hull.bounds.0;
        assert!(size.max_element() < 1.3 * 2.0 * RADIUS && size.min_element() > 0.95 * 2.0 * RADIUS, "{size}");
        let (most, least) = distances(&hull.points.positions, straight(t));
        assert!(least > 0.9 * RADIUS && most < 1.4 * RADIUS, "{least} to {most}");
        assert_eq!(hull.points.len(), 4000);
        assert_eq!(hull.points.colors.len(), 4000);
    }
}

/// Points throughout the ball: the share within half the radius is that of the volume, an eighth, which the hull's
/// excess makes smaller.
#[test]
fn a_filled_hull_has_points_inside() {
    let scene = World::of(straight).scene();
    let options = HullOptions { points: 2000, filled: true, ..HullOptions::default() };
    let hull = hull(&scene, &true_masks(&scene), 0.0, &options);
    assert_eq!((hull.points.len(), hull.points.colors.len()), (2000, 2000));
    let inner =
        |position: &&[f32; 3]| DVec3::from_array(position.map(f64::from)).distance(straight(0.0)) < 0.5 * RADIUS;
    let share = hull.points.positions.iter().filter(inner).count() as f64 / 2000.0;
    assert!((0.125 / 1.35..0.125 / 0.9).contains(&share), "{share}");
}

/// The whole way from photos, blurry ones: longer by the path of one exposure (0.12), no more.
#[test]
fn hulls_of_found_masks_are_slightly_large() {
    for exposure in [0.0, 0.9] {
        let scene = World { exposure, ..World::of(straight) }.scene();
        let masks = moving_masks(&scene, MaskSource::Inferred, &MaskOptions::default()).masks;
        let t = 6.0 / 11.0;
        let hull = hull(&scene, &masks, t, &HullOptions::default());
        let size = hull.bounds.1 - hull.bounds.0;
        let path = 1.5 * exposure / 11.0;
        assert!(size.y > 1.8 * RADIUS && size.y < 1.3 * 2.0 * RADIUS + path, "exposure {exposure}: {size}");
        assert!(hull.centre.distance(straight(t)) < 0.04 * 2.0 * RADIUS, "exposure {exposure}: {}", hull.centre);
    }
}

/// Grown masks add a pixel (0.03) all around; worn ones take it; two wrong views of nine are found out.
#[test]
fn bad_masks_change_little() {
    let scene = World::of(straight).scene();
    let truth = true_masks(&scene);
    let t = 4.0 / 11.0;
    let plain = hull(&scene, &truth, t, &HullOptions::default());
    for (by, range) in [(1, 1.0..1.6), (-1, 0.55..1.0)] {
        let masks: Vec<_> = truth.iter().map(|mask| mask.as_ref().map(|mask| grown(mask, WIDTH, by))).collect();
        let other = hull(&scene, &masks, t, &HullOptions::default());
        assert!(range.contains(&(other.volume / plain.volume)), "grown by {by}: {}", other.volume / plain.volume);
        assert!(other.centre.distance(straight(t)) < 0.03 * 2.0 * RADIUS);
    }
    let mut masks = truth;
    for (i, view) in scene.train.iter().enumerate() {
        match view.camera_id.as_deref() {
            Some("cam02") => masks[i] = Some(vec![0; WIDTH * HEIGHT]),
            Some("cam05") => {
                masks[i] = Some((0..WIDTH * HEIGHT).map(|p| if p % WIDTH < 20 { 255 } else { 0 }).collect())
            }
            _ => {}
        }
    }
    let other = hull(&scene, &masks, t, &HullOptions::default());
    assert!((0.9..1.3).contains(&(other.volume / plain.volume)), "{}", other.volume / plain.volume);
    assert_eq!(other.cameras, 7);
    assert!(other.notes.iter().any(|note| note.contains("cam02") && note.contains("cam05")), "{:?}", other.notes);
}

/// Points on the side that cameras see have the ball's colours: red above green above blue is nowhere in the floor.
#[test]
fn colours_are_the_balls() {
    let scene = World::of(straight).scene();
    let hull = hull(&scene, &true_masks(&scene), 0.5, &HullOptions::default());
    let right = hull.points.colors.iter().filter(|[r, g, b]| r > g && g > b).count();
    assert!(right as f64 > 0.85 * hull.points.len() as f64, "{right} of {}", hull.points.len());
}

/// A ball of two hundredths of the rig's size is found, and the number of points obeyed.
#[test]
fn small_objects_are_found() {
    let ball = Ball { radius: 0.06, path: straight, texture: 40.0, spin: 0.0 };
    let scene = World { balls: vec![ball], scale: 2, cameras: 6, frames: 3, ..World::of(straight) }.scene();
    let hull = hull(&scene, &true_masks(&scene), 0.5, &HullOptions { points: 500, ..HullOptions::default() });
    assert!(hull.centre.distance(straight(0.5)) < 0.012, "{}", hull.centre);
    assert!((0.7..2.0).contains(&(hull.volume / (4.0 / 3.0 * PI * 0.06_f64.powi(3)))), "{}", hull.volume);
    assert_eq!(hull.points.len(), 500);
}

/// Two cameras side by side do not bound the ball's depth; a third one turned away, with a blob in its mask, bounds it
/// to nothing. The hull of the two is kept, and said to be cut.
#[test]
fn a_camera_turned_away_takes_nothing() {
    let mut scene = World { frames: 1, ..World::of(straight) }.scene();
    let mut masks = true_masks(&scene);
    scene.train.swap(0, 4);
    masks.swap(0, 4);
    scene.train.truncate(3);
    let eye = scene.train[0].c2w;
    let ball = DMat4::from_translation(straight(0.0));
    let beside = ball * DMat4::from_rotation_z(0.1) * ball.inverse() * eye;
    let away = eye * DMat4::from_rotation_y(PI);
    for (view, c2w) in scene.train.iter_mut().zip([eye, beside, away]) {
        view.c2w = c2w;
    }
    let blob = |pixel: usize| (pixel % WIDTH).abs_diff(WIDTH / 2) < 4 && (pixel / WIDTH).abs_diff(HEIGHT / 2) < 4;
    let blobs = (0..WIDTH * HEIGHT).map(|pixel| if blob(pixel) { 255 } else { 0 }).collect();
    let masks = [masks[0].clone(), masks[0].clone(), Some(blobs)];
    let hull = hull(&scene, &masks, 0.0, &HullOptions::default());
    assert!(hull.notes.iter().any(|note| note.contains("cut")), "{:?}", hull.notes);
    assert!(!hull.points.is_empty());
}

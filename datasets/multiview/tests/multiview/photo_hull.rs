//! Hulls that photos carve, against a plate that five cameras see from above.

use glam::{DVec2, DVec3};
use gs_datasets::{Scene, View};
use gs_multiview::{Hull, HullOptions, Pinhole, hull};

use crate::fixture::{World, straight};

/// Height of the plate and half its edge.
const HEIGHT: f64 = 0.4;
const HALF: f64 = 0.6;

/// Photos of the plate, each in its own brightness, and their masks.
fn plate(brightness: fn(usize) -> f64) -> (Scene, Vec<Option<Vec<u8>>>) {
    let mut scene = World { cameras: 5, frames: 1, scale: 2, ..World::of(straight) }.scene();
    let masks =
        scene.train.iter_mut().enumerate().map(|(camera, view)| Some(paint(view, brightness(camera)))).collect();
    (scene, masks)
}

/// Paints the plate before black, and its mask.
fn paint(view: &mut View, brightness: f64) -> Vec<u8> {
    let camera = Pinhole::new(view);
    let at = |pixel: usize| -> Option<DVec3> {
        let direction = camera.direction(DVec2::new((pixel % view.width) as f64, (pixel / view.width) as f64) + 0.5);
        let distance = (HEIGHT - camera.centre.z) / direction.z;
        let hit = camera.centre + distance * direction;
        (distance > 0.0 && hit.truncate().abs().max_element() < HALF).then_some(hit)
    };
    let hits: Vec<Option<DVec3>> = (0..view.width * view.height).map(at).collect();
    let wave = |hit: &DVec3, by: f64| 0.5 + 0.2 * (9.0 * hit.x + by).sin() + 0.2 * (11.0 * hit.y - 3.0 * by).sin();
    let color = |hit: &Option<DVec3>| {
        let levels = hit.map(|hit| [0.0, 2.0, 4.0].map(|by| 255.0 * brightness * wave(&hit, by)));
        levels.unwrap_or_default().map(|level| level.round() as u8)
    };
    view.image.data = hits.iter().flat_map(color).collect();
    hits.iter().map(|hit| if hit.is_some() { 255 } else { 0 }).collect()
}

fn carved((scene, masks): &(Scene, Vec<Option<Vec<u8>>>), photos: bool) -> Hull {
    hull(scene, masks, 0.0, &HullOptions { points: 10_000, photos, misses: Some(0), ..HullOptions::default() })
}

/// Mean distance of the hull's points from the plate's plane.
fn error(hull: &Hull) -> f64 {
    let off = hull.points.positions.iter().map(|point| (f64::from(point[2]) - HEIGHT).abs());
    off.sum::<f64>() / hull.points.len() as f64
}

/// Smallest share of a mask's pixels that show a point or are beside one that does.
fn cover(scene: &Scene, masks: &[Option<Vec<u8>>], hull: &Hull) -> f64 {
    let shares = scene.train.iter().zip(masks).map(|(view, mask)| {
        let camera = Pinhole::new(view);
        let mut shown = vec![false; view.width * view.height];
        for point in &hull.points.positions {
            let at = camera.project(DVec3::from_array(point.map(f64::from))).map(|(pixel, _)| pixel);
            for (x, y) in (0..9).map(|i| (f64::from(i % 3 - 1), f64::from(i / 3 - 1))) {
                if let Some((x, y)) = at.and_then(|at| camera.pixel(at + DVec2::new(x, y))) {
                    shown[y * view.width + x] = true;
                }
            }
        }
        let inside: Vec<bool> = mask.iter().flatten().zip(shown).filter(|(set, _)| **set > 0).map(|(_, s)| s).collect();
        inside.iter().filter(|shown| **shown).count() as f64 / inside.len() as f64
    });
    shares.fold(1.0, f64::min)
}

/// Outlines leave a body above and below the plate. Photos leave three voxels of a pixel (0.014) each, and what is
/// beside the plate's edge.
#[test]
fn photos_carve_what_outlines_leave() {
    let world = plate(|_| 1.0);
    let (outlines, photos) = (carved(&world, false), carved(&world, true));
    assert!(photos.spacing < 1.5 * 0.014, "{}", photos.spacing);
    assert!(error(&photos) < 3.0 * photos.spacing, "{} of voxels of {}", error(&photos), photos.spacing);
    assert!(error(&photos) < 0.5 * error(&outlines), "{} against {}", error(&photos), error(&outlines));
    assert!(cover(&world.0, &world.1, &photos) > 0.97);
}

/// Photos of unlike brightness contradict each other everywhere: no pixel loses its last voxel.
#[test]
fn photos_that_disagree_open_no_hole() {
    let world = plate(|camera| 0.6 + 0.2 * camera as f64);
    let hull = carved(&world, true);
    assert!(cover(&world.0, &world.1, &hull) > 0.97, "{}", cover(&world.0, &world.1, &hull));
}

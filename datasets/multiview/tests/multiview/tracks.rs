//! Objects with paths of their own, and thresholds that do not depend on the resolution.

use glam::DVec3;
use gs_multiview::{CueOptions, ImageScale, centres, tracks};

use crate::fixture::{Ball, World, straight, true_masks};

fn left(t: f64) -> DVec3 {
    DVec3::new(0.9 - 0.8 * t, -0.8, 0.4)
}

fn right(t: f64) -> DVec3 {
    DVec3::new(0.1, 0.6 + 0.3 * t, 0.4 + 0.6 * t)
}

/// Two balls have two paths, at either resolution: a centre is off its path by a share of the image, whatever its
/// pixels.
#[test]
fn objects_have_paths_at_any_resolution() {
    let (mut scales, mut middle) = (Vec::new(), Vec::new());
    for scale in [1, 2] {
        let ball = |path| Ball { radius: 0.22, path, texture: 14.0, spin: 0.0 };
        let scene = World { balls: vec![ball(left), ball(right)], scale, frames: 8, ..World::of(straight) }.scene();
        let masks = true_masks(&scene);
        let all = centres(&scene, &masks).centres;
        let found = tracks(&scene, &masks, &all, 3, 0, &CueOptions::default());
        assert_eq!(found.len(), 2, "scale {scale}");
        for path in [left, right] {
            assert!(found.iter().any(|track| track.path.position(0.5).distance(path(0.5)) < 0.05), "scale {scale}");
        }
        middle = if middle.is_empty() { all } else { middle };
        scales.push(ImageScale::at(&scene.train, &middle));
    }
    let [small, large] = scales[..] else { panic!("two scales") };
    assert!((large.pixels_per_unit / small.pixels_per_unit - 2.0).abs() < 1e-9);
    assert!((large.widths_per_unit / small.widths_per_unit - 1.0).abs() < 1e-9);
}

/// A path that no centre may leave is followed by nothing.
#[test]
fn thresholds_can_be_set() {
    let scene = World { frames: 6, ..World::of(straight) }.scene();
    let masks = true_masks(&scene);
    let all = centres(&scene, &masks).centres;
    let mut options = CueOptions::default();
    assert_eq!(tracks(&scene, &masks, &all, 3, 0, &options).len(), 1);
    options.objects.followed = 1e-9;
    assert!(tracks(&scene, &masks, &all, 0, 0, &options).is_empty());
}

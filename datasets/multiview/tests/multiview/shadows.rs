//! What moves is found without the shadow it throws, in photos that are blurred and traced.

use glam::DVec3;
use gs_datasets::{LoadOptions, Scene, load};
use gs_multiview::{Hull, HullOptions, MaskOptions, MaskSource, centres, hull, moving_masks};
use gs_worlds::deblur::{DeblurOptions, World};

use crate::fixture::written;

/// Eight cameras on an arc before a box that turns over a floor, its shadow on the floor below and behind it, which is
/// never seen in the light.
fn shadowed() -> Scene {
    let folder = written(&DeblurOptions {
        world: World::Cube,
        width: 160,
        height: 120,
        cameras: 9,
        points: 0,
        ..DeblurOptions::default()
    });
    load(folder.path(), &LoadOptions { training_truth: true, ..LoadOptions::default() }).expect("a scene")
}

/// Half the box's edge, metres, and its centre at time 7/15, from the world's definition.
const BOX: (f64, DVec3) = (0.34, DVec3::new(-0.055, 0.029, 0.773));

#[test]
fn masks_and_hull_are_of_the_body() {
    let scene = shadowed();
    let found = moving_masks(&scene, MaskSource::Inferred, &MaskOptions::default()).masks;
    let (mut both, mut either) = (0, 0);
    for (view, mask) in scene.train.iter().zip(&found) {
        let truth = view.truth.moving_union.as_ref().expect("the truth");
        let mask = mask.as_ref().expect("a mask");
        both += truth.iter().zip(mask).filter(|(a, b)| **a > 0 && **b > 0).count();
        either += truth.iter().zip(mask).filter(|(a, b)| **a > 0 || **b > 0).count();
    }
    // The box is 45 pixels wide: half a pixel all around is 5 % of its area, the faint ends of its smear as much again.
    // The shadow would be another 20 %.
    let iou = both as f64 / either as f64;
    assert!(iou > 0.88, "IoU {iou}");

    let t = 7.0 / 15.0;
    let Hull { centre, bounds: (low, high), notes, .. } = hull(&scene, &found, t, &HullOptions::default());
    assert!(notes.is_empty(), "{notes:?}");
    // From a third of a circle a hull is drawn out along the line of ray, to a box's width on either side; on the floor
    // beyond the shadow it would be three.
    let reach = (low - BOX.1).abs().max((high - BOX.1).abs()).max_element();
    assert!(reach < 4.0 * BOX.0, "the hull reaches {reach} from the box's centre");
    assert!(centre.distance(BOX.1) < BOX.0, "the hull's centre is at {centre}");

    let centres = centres(&scene, &found).centres;
    assert_eq!(centres.len(), 16);
    let middle = centres.iter().find(|centre| (centre.t - t).abs() < 1e-6).expect("a centre");
    // A tenth of the mask that is shadow, a box's width away, draws its middle by a tenth of that.
    assert!(middle.position.distance(BOX.1) < 0.1 * 2.0 * BOX.0, "the centre is at {}", middle.position);
}

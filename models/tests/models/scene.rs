//! Scenes that move and one that does not.

use gs_burn::Gaussians;
use gs_models::taylormode::{MotionFrame, TaylorScene};
use gs_models::{DynamicScene, Static};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

use crate::{WINDOW, gaussians, randomised};

fn moving(place: &Place, rows: Vec<u32>) -> TaylorScene {
    let mut random = Random::new(1);
    let frame = MotionFrame { recording: [0.2, 0.7], ..MotionFrame::new(rows, 2, 1, WINDOW) };
    let motion = randomised(frame.init(3, &place.device), 1.0, place, &mut random);
    TaylorScene { gaussians: gaussians(place, &mut random), motion }
}

fn same(a: &Gaussians, b: &Gaussians) -> bool {
    values(&a.means.val()) == values(&b.means.val()) && values(&a.quats.val()) == values(&b.quats.val())
}

#[test]
fn a_static_scene_stays() {
    let place = reference();
    let scene = Static::new(gaussians(place, &mut Random::new(1)));
    assert!(same(&scene.at(-7.0), &scene.gaussians));
    assert_eq!(values(&scene.velocity(3.0)), [0.0; 18]);
    assert_eq!(scene.span(), None);
}

#[test]
fn many_times_at_once_are_one_after_the_other() {
    for place in everywhere() {
        let scene = moving(place, vec![4, 1, 2]);
        let times = [0.1, WINDOW.t0, 0.5, 0.9];
        for (t, at) in times.iter().zip(scene.at_times(&times)) {
            assert!(same(&at, &scene.at(*t)), "{} at {t}", place.name);
        }
    }
}

#[test]
fn a_scene_without_moving_rows_has_no_span() {
    let place = reference();
    assert_eq!(moving(place, vec![4, 1]).span(), Some([0.2, 0.7]));
    let scene = moving(place, Vec::new());
    assert_eq!(scene.span(), None);
    assert!(same(&scene.at(0.6), &scene.gaussians));
    assert_eq!(values(&scene.velocity(0.6)), [0.0; 18]);
}

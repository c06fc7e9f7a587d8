//! Kinks: nothing around t0, an even force met exactly, velocities that are derivatives, no faster outside than inside.

use gs_models::taylormode::{Contact, Kinks, Paths};
use gs_tests::devices::{everywhere, reference};
use gs_tests::tolerance::{largest, values};

use crate::{WINDOW, standing};

fn at(s: f64) -> f64 {
    WINDOW.t0 + s * WINDOW.half
}

#[test]
fn contacts_lie_on_one_side_of_t0() {
    let after = Contact::new(at(0.2), at(0.3), &WINDOW).expect("a contact");
    assert!((after.near - 0.2).abs() < 1e-12 && (after.far - 0.3).abs() < 1e-12);
    let before = Contact::new(at(-0.2), at(-0.3), &WINDOW).expect("in any order");
    assert!((before.near + 0.2).abs() < 1e-12 && (before.far + 0.3).abs() < 1e-12);
    assert!(Contact::new(at(-0.1), at(0.1), &WINDOW).is_none(), "t0 lies inside");
    assert!(Contact::new(at(0.5), at(0.5), &WINDOW).is_none(), "it takes no time");
    assert!(Contact::new(f64::NAN, at(0.5), &WINDOW).is_none());
}

/// Zero up to the contact; after it the velocity has changed by the whole jump; between, as `s` squared; on both sides
/// of t0.
#[test]
fn a_ramp_is_an_even_force() {
    for side in [1.0, -1.0] {
        let contact = Contact { near: 0.2 * side, far: 0.4 * side };
        for s in [-0.9, -0.2, 0.0, 0.1, 0.2] {
            let sample = contact.ramp(s * side);
            assert!(sample.value == 0.0 && sample.slope == 0.0, "{sample:?} at {s}");
        }
        let middle = contact.ramp(0.3 * side);
        assert!((middle.value - 0.1 * 0.1 / 0.4).abs() < 1e-12 && (middle.slope - 0.5 * side).abs() < 1e-12);
        let after = contact.ramp(0.9 * side);
        assert!((after.value - 0.6).abs() < 1e-12 && (after.slope - side).abs() < 1e-12);
    }
}

/// A ball that falls and comes up again, out of a parabola and one jump, on every backend; its velocity against
/// differences in f64.
#[test]
fn a_bounce_is_met_exactly() {
    let contact = Contact { near: 0.25, far: 0.35 };
    // Height -2 s^2 before; then the velocity -1.2 of the contact's middle turns round.
    let truth = |s: f64| {
        let share = ((s - 0.25) / 0.1).clamp(0.0, 1.0);
        -2.0 * s * s + 3.0 * (0.05 * share * share + (s - 0.35).max(0.0))
    };
    let moving = |place: &gs_tests::devices::Place| Paths {
        position: place.tensor(&[0.0, 0.0, 0.0, 0.0, 0.0, -2.0], [1, 6]),
        kinks: Some(Kinks::new(vec![contact], place.tensor(&[0.0, 0.0, 3.0], [1, 3]))),
        ..standing(place, &[0])
    };
    for place in everywhere() {
        let name = &place.name;
        let motion = moving(place);
        for i in -10..=10 {
            let s = 0.1 * f64::from(i);
            let height = values(&motion.displacement(at(s)))[2];
            assert!((height - truth(s)).abs() < 1e-5, "{name}: {height} at {s}, it is {}", truth(s));
        }
    }
    let motion = moving(reference());
    let h = 1e-6;
    for s in [-0.7, 0.1, 0.27, 0.3, 0.34, 0.6, 0.99, 1.1, 1.3] {
        let [low, high] = [s - h, s + h].map(|s| values(&motion.displacement(at(s)))[2]);
        let slope = (high - low) / (2.0 * h * WINDOW.half);
        let velocity = values(&motion.velocity(at(s)))[2];
        assert!((velocity - slope).abs() < 1e-5 * slope.abs().max(1.0), "at {s}: {velocity}, differences say {slope}");
    }
    let far = largest(&values(&motion.displacement(at(3.0))));
    let line = 3.0 * largest(&values(&motion.velocity(at(3.0)))) * WINDOW.half;
    assert!(far <= line + 2.0, "it runs away outside the window: {far}");
}

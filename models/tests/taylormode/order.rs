//! The order of each Gaussian: what stays below a tenth of a pixel goes, what the photos ask for stays.

use gs_models::taylormode::TaylorMotion;
use gs_models::taylormode::order::{Evidence, has_pattern, orders, prune};
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

use crate::{WINDOW, motion};

#[test]
fn orders_are_counted_in_pixels() {
    let b = |x: f32| [x, 0.0, 0.0];
    let rows = [
        [b(0.5), b(0.3), b(0.2)],       // 3
        [b(0.5), b(0.3), b(0.0005)],    // 2: the third is 0.05 px
        [b(0.0), b(0.0), b(0.0)],       // 0
        [b(0.0006), b(0.0006), b(0.0)], // 1: each is 0.06 px, together they show
        [b(0.5), b(0.0), b(0.0)],       // 0: seen from so far that it is 0.05 px
        [b(f32::NAN), b(0.0), b(0.0)],  // 1: not hidden
    ];
    let scale = [100.0, 100.0, 100.0, 100.0, 0.1, 100.0];
    assert_eq!(orders(rows.as_flattened().as_flattened(), &scale), [3, 2, 0, 1, 0, 1]);
    assert_eq!(orders(&[], &[1.0, 1.0]), [0, 0]);
    assert_eq!(orders(&[], &[]), [0; 0]);
}

#[test]
fn pruning_changes_nothing_that_shows() {
    for place in everywhere() {
        let mut random = Random::new(1);
        let full = motion(place, &mut random);
        // Row 0 turns but stays, row 1 neither, row 2 moves with order 2.
        let pruned = prune(&full, &[0, 0, 2], &[1, 0, 0]);
        assert_eq!(pruned.kept, [0, 2]);
        assert_eq!([pruned.motion.order(), pruned.motion.rotation_order()], [2, 1], "{}", place.name);
        assert_eq!([pruned.position_orders.clone(), pruned.rotation_orders.clone()], [[0, 2], [1, 0]]);
        let rows: Vec<i64> = pruned.motion.rows.to_data().iter::<i64>().collect();
        assert_eq!(rows, [4, 2], "{}: rows of the scene", place.name);
        let (before, after) = (values(&full.position), values(&pruned.motion.position));
        let expected: Vec<f64> = [0.0; 6].into_iter().chain(before[18..24].iter().copied()).collect();
        assert_near(&place.name, &after, &expected, 0.0);

        let all = prune(&full, &[3; 3], &[2; 3]);
        assert_eq!(values(&all.motion.displacement(0.5)), values(&full.displacement(0.5)), "{}", place.name);
        let none = prune(&full, &[0; 3], &[0; 3]);
        assert!(none.motion.is_empty() && none.kept.is_empty(), "{}", place.name);
        assert_eq!(none.motion.displacement(0.5).dims(), [0, 3]);
        let empty = TaylorMotion::still(&[], 3, 1, WINDOW, &place.device);
        assert!(prune(&empty, &[], &[]).motion.is_empty());
    }
}

#[test]
fn a_higher_order_must_pay_for_its_numbers() {
    let evidence =
        Evidence { lower: 100.0, higher: 90.0, variance: 0.01, pixels: 1e4, blur_area: 1.0, parameters: 60.0 };
    // Twice the gain 1000, price 60 ln 10^4 = 553.
    assert!(evidence.accepts());
    assert!(!Evidence { parameters: 120.0, ..evidence }.accepts());
    // Pixels that share a blur of 9 px are one ninth as many witnesses: gain 111, price 60 ln 1111 = 421.
    assert!(!Evidence { blur_area: 9.0, ..evidence }.accepts());
    assert!(!Evidence { higher: 101.0, ..evidence }.accepts());
    assert!(!Evidence { pixels: 1.0, ..evidence }.accepts());
    assert!(!Evidence { lower: f64::NAN, ..evidence }.accepts());
}

/// Noise is called a pattern about as often as it should be, a wave nearly always.
#[test]
fn patterns_in_time_are_told_from_noise() {
    let mut random = Random::new(2);
    let mut noise = |size: f64| [0, 1, 2].map(|_| random.uniform(-size, size));
    let mut found = [0, 0];
    for trial in 0..400 {
        let white: Vec<[f64; 3]> = (0..16).map(|_| noise(1.0)).collect();
        let wave = (0..16).map(|i| {
            let [x, y, z] = noise(1.0);
            let phase = f64::from(i) * 0.6 + f64::from(trial);
            [x + 1.5 * phase.sin(), y, z + 1.5 * phase.cos()]
        });
        found[0] += usize::from(has_pattern(&white));
        found[1] += usize::from(has_pattern(&wave.collect::<Vec<_>>()));
    }
    assert!(found[0] <= 12, "noise was called a pattern in {} of 400", found[0]);
    assert!(found[1] >= 360, "a wave was called a pattern in {} of 400", found[1]);
    assert!(!has_pattern(&[[1.0, 2.0, 3.0]; 16]), "a constant is an offset, not a pattern");
    assert!(!has_pattern(&[[0.0; 3]; 3]));
}

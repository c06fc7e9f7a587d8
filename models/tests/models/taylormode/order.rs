//! The order of each Gaussian: what stays below a tenth of a pixel goes, what the photos ask for stays.

use gs_models::taylormode::order::{Evidence, NOTICEABLE, deviation, economise, has_pattern, lower};
use gs_models::taylormode::window::polynomials;
use gs_tests::scenes::Random;

/// First axis of a path at `s`.
fn at(path: &[f32], s: f64) -> f64 {
    let blocks = path.chunks_exact(3).zip(polynomials(s, path.len() / 3));
    blocks.map(|(block, sample)| f64::from(block[0]) * sample.value).sum()
}

#[test]
fn orders_are_counted_in_pixels() {
    let b = |x: f32| [x, 0.0, 0.0];
    let cases = [
        ([b(0.5), b(0.3), b(0.2)], 100.0, 3),
        // The third is 0.05 px.
        ([b(0.5), b(0.3), b(0.0005)], 100.0, 2),
        ([b(0.0), b(0.0), b(0.0)], 100.0, 0),
        // The second is 0.08 px; the first shows.
        ([b(0.0012), b(0.0016), b(0.0)], 100.0, 1),
        // The second and third are 0.06 px each: together they show.
        ([b(0.0), b(0.0012), b(0.0018)], 100.0, 2),
        // Seen from so far that it is 0.05 px.
        ([b(0.5), b(0.0), b(0.0)], 0.1, 0),
        // Not hidden.
        ([b(f32::NAN), b(0.0), b(0.0)], 100.0, 1),
        // No camera says how little it is.
        ([b(0.5), b(1e-9), b(1e-9)], f64::INFINITY, 3),
    ];
    for (blocks, scale, expected) in cases {
        let mut path: Vec<f32> = blocks.as_flattened().to_vec();
        let order = lower(&mut path, 3, scale, NOTICEABLE, &mut [0.0; 3]);
        assert_eq!(order, expected, "{blocks:?}");
        assert!(path[3 * order..].iter().all(|x| *x == 0.0), "{blocks:?}: {path:?}");
    }
    assert_eq!(lower(&mut [], 0, 1.0, NOTICEABLE, &mut [0.0; 3]), 0);
}

#[test]
fn a_lower_order_deviates_by_what_was_said() {
    for order in 1..=12 {
        let mut path: Vec<f32> = (0..36).map(|i| ((i * 7 + order) % 5) as f32 * 0.3 - 0.5).collect();
        path[3 * order..].fill(0.0);
        let (before, said) = (path.clone(), deviation(&path, order));
        let mut centre = [0.0; 3];
        economise(&mut path, order, &mut centre);
        let mut worst: f64 = 0.0;
        for i in 0..=2000 {
            let s = f64::from(i) * 1e-3 - 1.0;
            worst = worst.max((at(&before, s) - at(&path, s) - f64::from(centre[0])).abs());
        }
        // One axis of three deviates by at most the norm's share, and by exactly its own leading coefficient's.
        let own = f64::from(before[3 * (order - 1)]).abs() / order as f64;
        assert!((worst - own).abs() < 1e-5 && worst <= said + 1e-5, "order {order}: {worst} {own} {said}");
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

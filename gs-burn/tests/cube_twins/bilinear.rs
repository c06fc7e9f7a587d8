//! Lookups between pixels, forward and backward.

use gs_kernels::cpu::bilinear as cpu;
use gs_kernels::cube::bilinear;

use super::support::{Random, assert_gradient, assert_values, client, down, up, wide};

/// Positions are up to 60 pixels, whose place in `f32` is off by 4e-6 of a pixel, and values are of order 1.
const TOLERANCE: f64 = 1e-4;

fn check([height, width]: [usize; 2], channels: usize, positions: &[f32], seed: u64) {
    let mut random = Random(seed);
    let image = random.list(height * width * channels, 0.0, 1.0);
    let v = random.list(positions.len() / 2 * channels, -1.0, 1.0);
    let (size, at) = ([height, width], up(positions));
    let (on_device, v_device) = (up(&image), up(&v));
    let found = bilinear::forward(client(), &on_device, size, channels, &at).expect("forward");
    assert_values("values", &down(&found), &cpu::forward(&wide(&image), size, channels, &wide(positions)), TOLERANCE);
    let by_image = || down(&bilinear::by_image(client(), size, channels, &at, &v_device).expect("by image"));
    let once = by_image();
    assert_gradient("image", &once, &cpu::by_image(size, channels, &wide(positions), &wide(&v)), 1e-3);
    assert!(once == by_image(), "the bits of a second run");
    if height > 1 && width > 1 {
        let found = bilinear::by_positions(client(), &on_device, size, channels, &at, &v_device).expect("by positions");
        let want = cpu::by_positions(&wide(&image), size, channels, &wide(positions), &wide(&v));
        assert_gradient("positions", &down(&found), &want, 1e-3);
    }
}

/// Away from the lines between patches, where rounding decides the slope.
fn positions(count: usize, seed: u64) -> Vec<f32> {
    let mut random = Random(seed);
    let mut one = || random.within(-3.0, 62.0).floor() + 0.5 + random.within(0.05, 0.95);
    (0..2 * count).map(|_| one()).collect()
}

#[test]
fn inside_and_beyond_the_border() {
    check([45, 60], 3, &positions(5000, 90), 91);
    check([33, 20], 1, &positions(700, 92), 93);
    check([7, 5], 8, &positions(300, 94), 95);
}

#[test]
fn one_row_one_column_one_pixel() {
    for (k, size) in [[1, 40], [40, 1], [1, 1]].into_iter().enumerate() {
        check(size, 3, &positions(400, 96 + k as u64), 99);
    }
}

#[test]
fn all_lookups_at_one_place() {
    check([20, 30], 3, &[10.75, 6.25].repeat(3000), 100);
}

#[test]
fn a_position_that_is_no_number_harms_only_its_own_patch() {
    let image = vec![0.25; 6 * 8 * 3];
    let at = up(&[f32::NAN, 4.5, 3.0, 2.0, 1.0, f32::INFINITY]);
    let found = down(&bilinear::forward(client(), &up(&image), [6, 8], 3, &at).expect("forward"));
    assert!(found[3..].iter().all(|value| (value - 0.25).abs() < 1e-6), "{found:?}");
    let v_image = down(&bilinear::by_image(client(), [6, 8], 3, &at, &up(&[1.0; 9])).expect("by image"));
    // The patch whose first pixel is (0, 4).
    let spoilt = |k: usize| (k / 3) % 8 < 2 && (4..6).contains(&(k / 24));
    assert!(v_image.iter().enumerate().all(|(k, value)| spoilt(k) || value.is_finite()), "{v_image:?}");
}

#[test]
fn no_lookup() {
    let found = bilinear::forward(client(), &up(&[1.0; 12]), [2, 2], 3, &up(&[])).expect("forward");
    assert!(found.is_empty());
    assert_eq!(down(&bilinear::by_image(client(), [2, 2], 3, &up(&[]), &up(&[])).expect("by image")), [0.0; 12]);
}

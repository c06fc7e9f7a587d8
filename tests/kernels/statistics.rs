//! `gs_burn::ops::statistics`.

use gs_burn::ops::statistics::{StatisticsConfig, gather_statistics, gather_statistics_reference};
use gs_tests::devices::{everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, values};

const COUNT: usize = 700;

#[test]
fn a_view_is_gathered() {
    for (columns, absolute) in [(8, false), (1, true)] {
        let mut random = Random::new(31);
        // Gradients by pixels are small; half of the radii are not positive.
        let gradient = random.values(COUNT, 0.0, 3.0);
        let views: Vec<f64> = (0..COUNT).map(|row| (row % 7) as f64).collect();
        let screen = random.values(4 * COUNT, -1e-3, 1e-3);
        let rows = random.values(columns * COUNT, -5.0, 5.0);
        let config = StatisticsConfig { width: 640, height: 480, absolute, columns };
        let tables = |place: &gs_tests::devices::Place| {
            (
                place.tensor(&gradient, [COUNT]),
                place.tensor(&views, [COUNT]),
                place.tensor(&screen, [COUNT, 4]),
                place.tensor(&rows, [COUNT, columns]),
            )
        };
        let (a, b, c, d) = tables(reference());
        let (sums, seen) = gather_statistics_reference(a, b, c, d, &config);
        let (sums, seen) = (values(&sums), values(&seen));
        assert!(seen.iter().zip(&views).any(|(after, before)| after == before), "some were not seen");
        for place in everywhere() {
            let (a, b, c, d) = tables(place);
            let kept = a.clone();
            let (found, count) = gather_statistics(a, b, c, d, &config);
            let bound = if place.is_double() { FORWARD_F64 } else { FORWARD_F32 };
            assert_near(&place.name, &values(&found), &sums, bound);
            assert_eq!(values(&count), seen, "{}", place.name);
            // A tensor with another owner is not written.
            assert_near(&place.name, &values(&kept), &gradient, bound);
        }
    }
}

//! `gs_burn::ops::channels`.

use gs_burn::ops::channels::channels;
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

#[test]
fn the_channels_asked_for_and_no_others() {
    for place in everywhere() {
        for ([height, width, total], first, count) in
            [([37, 53, 5], 0, 3), ([37, 53, 5], 3, 1), ([37, 53, 5], 4, 1), ([1, 1, 4], 0, 4), ([200, 130, 33], 1, 32)]
        {
            let image = Random::new(1).values(height * width * total, -1.0, 1.0);
            let part = channels(place.tensor(&image, [height, width, total]), first, count);
            assert_eq!(part.dims(), [height, width, count], "{}", place.name);
            let expected: Vec<f64> =
                image.chunks(total).flat_map(|pixel| &pixel[first..first + count]).copied().collect();
            assert_eq!(values(&part), expected, "{first}..{} of {total} on {}", first + count, place.name);
        }
    }
}

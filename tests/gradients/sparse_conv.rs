//! `gs_burn::ops::sparse_conv` and `gs_burn::ops::segments`.

use gs_burn::ops::segments::{Segments, segment_mean, take_rows};
use gs_burn::ops::sparse_conv::{KernelMap, sparse_conv};
use gs_tests::devices::doubles;
use gs_tests::finite_differences::{Course, assert_course_derivatives};
use gs_tests::scenes::Random;
use gs_tests::sparse::surface;

#[test]
fn convolutions_are_the_central_differences() {
    for place in doubles() {
        let voxels = surface(2);
        let same = KernelMap::submanifold(&voxels, 3, &place.device).expect("voxels");
        let (_, down) = KernelMap::strided(&voxels, 2, 2, &place.device).expect("voxels");
        for map in [same, down.transposed(), down] {
            for [wide_in, wide_out] in [[3, 5], [4, 66]] {
                let shape = [map.offsets(), wide_in, wide_out];
                let input = Random::new(1).values(map.inputs() * wide_in, -1.0, 1.0);
                let weights = Random::new(2).values(shape.iter().product(), -0.2, 0.2);
                let arguments: [(&str, &[f64]); 2] = [("input", &input), ("weights", &weights)];
                assert_course_derivatives("convolution", Course::Smooth, place, arguments, 60, |[input, weights]| {
                    let input = input.reshape([map.inputs(), wide_in]);
                    sparse_conv(input, weights.reshape(shape), &map).square().mean()
                });
            }
        }
    }
}

#[test]
fn segments_are_the_central_differences() {
    for place in doubles() {
        let of_row: Vec<u32> = (0..90).map(|i| i * i % 17).collect();
        let segments = Segments::new(of_row, 20, &place.device).expect("indices");
        let points = Random::new(1).values(90 * 3, -1.0, 1.0);
        let voxels = Random::new(2).values(20 * 3, -1.0, 1.0);
        let arguments: [(&str, &[f64]); 2] = [("points", &points), ("voxels", &voxels)];
        assert_course_derivatives("segments", Course::Smooth, place, arguments, 60, |[points, voxels]| {
            let (points, voxels) = (points.reshape([90, 3]), voxels.reshape([20, 3]));
            let sum = segment_mean(points, &segments) * voxels.clone();
            sum.square().mean() + take_rows(voxels, &segments).square().mean()
        });
    }
}

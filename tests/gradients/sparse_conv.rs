//! `gs_burn::ops::sparse_conv` and `gs_burn::ops::segments`.

use burn::tensor::Tensor;
use gs_burn::ops::segments::{Segments, segment_mean, take_rows};
use gs_burn::ops::sparse_conv::{KernelMap, sparse_conv};
use gs_tests::devices::{Place, doubles};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::Random;
use gs_tests::sparse::surface;
use gs_tests::tolerance::values;

/// Gradients of `sum(f(leaves)^2)` against differences.
fn check(
    what: &str,
    place: &Place,
    at: [Vec<f64>; 2],
    f: impl Fn(&[Vec<f64>; 2]) -> (Tensor<1>, [Option<Vec<f64>>; 2]),
) {
    let (_, gradients) = f(&at);
    for k in 0..2 {
        let Some(gradient) = &gradients[k] else { continue };
        assert_derivative(&format!("{what}, argument {k} on {}", place.name), &at[k], gradient, 60, |x| {
            let mut moved = at.clone();
            moved[k] = x.to_vec();
            values(&f(&moved).0)[0]
        });
    }
}

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
                check("convolution", place, [input, weights], |[input, weights]| {
                    let input = place.leaf(input, [map.inputs(), wide_in]);
                    let weights = place.leaf(weights, shape);
                    let loss = sparse_conv(input.clone(), weights.clone(), &map).square().mean();
                    let gradients = loss.clone().backward();
                    let of = [input.grad(&gradients).map(|g| values(&g)), weights.grad(&gradients).map(|g| values(&g))];
                    (loss, of)
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
        check("segments", place, [points, voxels], |[points, voxels]| {
            let (points, voxels) = (place.leaf(points, [90, 3]), place.leaf(voxels, [20, 3]));
            let sum = segment_mean(points.clone(), &segments) * voxels.clone();
            let loss = sum.square().mean() + take_rows(voxels.clone(), &segments).square().mean();
            let gradients = loss.clone().backward();
            (loss, [points.grad(&gradients).map(|g| values(&g)), voxels.grad(&gradients).map(|g| values(&g))])
        });
    }
}

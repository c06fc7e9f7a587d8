//! `gs_burn::ops::sparse_conv` and `gs_burn::ops::segments`.

use burn::tensor::module::{conv_transpose3d, conv3d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn::tensor::{Device, Tensor};
use gs_burn::ops::segments::{Segments, segment_mean, take_rows};
use gs_burn::ops::sparse_conv::{KernelMap, sparse_conv, sparse_conv_reference};
use gs_tests::devices::{Place, doubles, everywhere, reference, singles};
use gs_tests::scenes::Random;
use gs_tests::sparse::{SIDE, surface};
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, GRADIENT_F32, GRADIENT_F64, assert_gradient, assert_near, values};

const WIDTHS: [[usize; 2]; 4] = [[3, 16], [17, 33], [5, 80], [80, 5]];

/// A bound for sums of up to `27 * 80` products of numbers in -1..1, whose magnitude is about 15: rounding grows with
/// it.
fn bound(place: &Place) -> f64 {
    if place.is_double() { FORWARD_F64 } else { FORWARD_F32 }
}

/// Weights small enough that results are of order 1.
fn weights(offsets: usize, [wide_in, wide_out]: [usize; 2]) -> Vec<f64> {
    let size = 1.0 / (wide_in as f64 * 11.0).sqrt();
    Random::new(7).values(offsets * wide_in * wide_out, -size, size)
}

/// Rows of voxels on a dense grid of `side` voxels an edge, `[1, C, side, side, side]` by z, y, x; zeros elsewhere.
fn dense(rows: &[f64], channels: usize, voxels: &[[i32; 4]], side: usize) -> Tensor<5> {
    let mut grid = vec![0.0; channels * side.pow(3)];
    for (row, voxel) in rows.chunks(channels).zip(voxels) {
        for (c, x) in row.iter().enumerate() {
            grid[c * side.pow(3) + place_in(voxel, side)] = *x;
        }
    }
    reference().tensor(&grid, [1, channels, side, side, side])
}

fn place_in([_, x, y, z]: &[i32; 4], side: usize) -> usize {
    ((*z as usize) * side + *y as usize) * side + *x as usize
}

/// The rows of voxels from a dense grid.
fn rows_of(grid: &Tensor<5>, voxels: &[[i32; 4]]) -> Vec<f64> {
    let [_, channels, side, _, _] = grid.dims();
    let grid = values(grid);
    let row = |voxel| (0..channels).map(move |c| c * side.pow(3) + place_in(voxel, side));
    voxels.iter().flat_map(row).map(|at| grid[at]).collect()
}

/// Weights `[K, C_in, C_out]` as `[C_out, C_in, z, y, x]`, from the order of offsets of an odd or an even kernel.
fn dense_weights(weights: &[f64], edge: usize, [wide_in, wide_out]: [usize; 2]) -> Tensor<5> {
    let cube = reference().tensor(weights, [edge, edge, edge, wide_in, wide_out]);
    if edge % 2 == 1 { cube.permute([4, 3, 0, 1, 2]) } else { cube.permute([4, 3, 2, 1, 0]) }
}

#[test]
fn equal_to_a_dense_convolution_of_what_is_there() {
    let voxels = surface(1);
    for [wide_in, wide_out] in WIDTHS {
        let input = Random::new(3).values(voxels.len() * wide_in, -1.0, 1.0);
        let grid = dense(&input, wide_in, &voxels, SIDE);
        for edge in [3, 5] {
            let w = weights(edge * edge * edge, [wide_in, wide_out]);
            let options = ConvOptions::new([1; 3], [edge / 2; 3], [1; 3], 1);
            let all = conv3d(grid.clone(), dense_weights(&w, edge, [wide_in, wide_out]), None, options);
            let expected = rows_of(&all, &voxels);
            for place in everywhere() {
                let map = KernelMap::submanifold(&voxels, edge, &place.device).expect("voxels");
                let input = place.tensor(&input, [voxels.len(), wide_in]);
                let output = sparse_conv(input, place.tensor(&w, [map.offsets(), wide_in, wide_out]), &map);
                let what = format!("edge {edge}, {wide_in} to {wide_out} on {}", place.name);
                assert_near(&what, &values(&output), &expected, bound(place));
            }
        }
    }
}

#[test]
fn strided_and_transposed_are_the_dense_ones() {
    let voxels = surface(1);
    for [wide_in, wide_out] in WIDTHS {
        let input = Random::new(4).values(voxels.len() * wide_in, -1.0, 1.0);
        let w = weights(8, [wide_in, wide_out]);
        let dense_w = dense_weights(&w, 2, [wide_in, wide_out]);
        let grid = dense(&input, wide_in, &voxels, SIDE);
        let coarse_grid = conv3d(grid, dense_w.clone(), None, ConvOptions::new([2; 3], [0; 3], [1; 3], 1));
        for place in everywhere() {
            let (coarse, map) = KernelMap::strided(&voxels, 2, 2, &place.device).expect("voxels");
            let what = format!("{wide_in} to {wide_out} on {}", place.name);
            let weights = place.tensor(&w, [8, wide_in, wide_out]);
            let output = sparse_conv(place.tensor(&input, [voxels.len(), wide_in]), weights.clone(), &map);
            assert_near(&what, &values(&output), &rows_of(&coarse_grid, &coarse), bound(place));

            let rows = Random::new(5).values(coarse.len() * wide_in, -1.0, 1.0);
            let options = ConvTransposeOptions::new([2; 3], [0; 3], [0; 3], [1; 3], 1);
            // A transposed convolution of Burn takes weights `[C_in, C_out, z, y, x]`.
            let from = dense(&rows, wide_in, &coarse, SIDE / 2);
            let fine = conv_transpose3d(from, dense_w.clone().swap_dims(0, 1), None, options);
            let output = sparse_conv(place.tensor(&rows, [coarse.len(), wide_in]), weights, &map.transposed());
            assert_near(&format!("{what}, transposed"), &values(&output), &rows_of(&fine, &voxels), bound(place));
        }
    }
}

/// `<S x, y> = <x, S^T y>`: the matrix of the transposed map with transposed weights is the transpose of the strided
/// one's.
#[test]
fn transposed_is_the_transpose_of_strided() {
    for place in doubles() {
        let voxels = surface(2);
        let (coarse, map) = KernelMap::strided(&voxels, 2, 2, &place.device).expect("voxels");
        let w = place.tensor(&weights(8, [6, 9]), [8, 6, 9]);
        let x = place.tensor(&Random::new(8).values(voxels.len() * 6, -1.0, 1.0), [voxels.len(), 6]);
        let y = place.tensor(&Random::new(9).values(coarse.len() * 9, -1.0, 1.0), [coarse.len(), 9]);
        let down = (sparse_conv(x.clone(), w.clone(), &map) * y.clone()).sum();
        let up = (sparse_conv(y, w.swap_dims(1, 2), &map.transposed()) * x).sum();
        let (down, up) = (values(&down)[0], values(&up)[0]);
        assert!((down - up).abs() <= 1e-12 * down.abs().max(1.0), "{down} and {up} on {}", place.name);
    }
}

/// Values and gradients of `sparse_conv` or its reference.
type Conv = fn(Tensor<2>, Tensor<3>, &KernelMap) -> Tensor<2>;

fn run(place: &Place, map: fn(&Device) -> KernelMap, [wide_in, wide_out]: [usize; 2], conv: Conv) -> [Vec<f64>; 3] {
    let map = map(&place.device);
    let input = Random::new(3).values(map.inputs() * wide_in, -1.0, 1.0);
    let input = place.leaf(&input, [map.inputs(), wide_in]);
    let shape = [map.offsets(), wide_in, wide_out];
    let weights = place.leaf(&weights(map.offsets(), [wide_in, wide_out]), shape);
    let output = conv(input.clone(), weights.clone(), &map);
    let v = Random::new(6).values(map.outputs() * wide_out, -1.0, 1.0);
    let gradients = (output.clone() * place.tensor(&v, [map.outputs(), wide_out]).autodiff()).sum().backward();
    let [v_input] = [&input].map(|leaf| values(&leaf.grad(&gradients).expect("tracked")));
    [values(&output), v_input, values(&weights.grad(&gradients).expect("tracked"))]
}

/// The voxels of [`surface`] in no order, some of them at negative coordinates.
fn shuffled() -> Vec<[i32; 4]> {
    let mut voxels: Vec<[i32; 4]> = surface(2).into_iter().map(|[b, x, y, z]| [b, x - 9, y - 8, z - 3]).collect();
    voxels.sort_by_key(|[b, x, y, z]| (b * 31 + x * 17 + y * 101 + z * 57).rem_euclid(97));
    voxels
}

const MAPS: [fn(&Device) -> KernelMap; 6] = [
    |device| KernelMap::submanifold(&surface(2), 3, device).expect("voxels"),
    |device| KernelMap::strided(&surface(2), 2, 2, device).expect("voxels").1,
    |device| KernelMap::strided(&surface(2), 2, 2, device).expect("voxels").1.transposed(),
    |device| KernelMap::submanifold(&shuffled(), 3, device).expect("voxels").transposed(),
    |device| KernelMap::strided(&shuffled(), 3, 2, device).expect("voxels").1,
    |device| KernelMap::strided(&shuffled(), 3, 2, device).expect("voxels").1.transposed(),
];

#[test]
fn every_device_follows_the_reference() {
    for map in MAPS {
        for widths in WIDTHS {
            let [output, v_input, v_weights] = run(reference(), map, widths, sparse_conv_reference);
            for place in doubles().iter().chain(singles()) {
                let gradient = if place.is_double() { GRADIENT_F64 } else { GRADIENT_F32 };
                let found = run(place, map, widths, sparse_conv);
                let what = format!("{widths:?} on {}", place.name);
                assert_near(&what, &found[0], &output, bound(place));
                assert_gradient(&format!("input, {what}"), &found[1], &v_input, gradient);
                assert_gradient(&format!("weights, {what}"), &found[2], &v_weights, gradient);
            }
        }
    }
}

#[test]
fn one_two_or_seven_threads_give_the_same_bits() {
    for place in everywhere() {
        for map in &MAPS[..3] {
            for widths in [[17, 33], [80, 80]] {
                let with = |threads| {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                    let pool = pool.expect("threads can be started");
                    pool.install(|| run(place, *map, widths, sparse_conv))
                        .map(|v| v.into_iter().map(f64::to_bits).collect())
                };
                let one: [Vec<u64>; 3] = with(1);
                for threads in [1, 2, 7] {
                    assert!(with(threads) == one, "{threads} threads, {widths:?} on {}", place.name);
                }
            }
        }
    }
}

/// The same voxels in another order give the same rows: each row is a sum over its own neighbours in the order of
/// offsets.
#[test]
fn the_order_of_voxels_is_free() {
    let sorted = surface(2);
    let shuffled: Vec<usize> = (0..sorted.len()).map(|i| (i * 7 + 3) % sorted.len()).collect();
    assert!(!sorted.len().is_multiple_of(7), "every voxel is named once");
    let voxels: Vec<[i32; 4]> = shuffled.iter().map(|i| sorted[*i]).collect();
    let (coarse, _) = KernelMap::strided(&voxels, 2, 2, &reference().device).expect("voxels");
    assert_eq!(coarse, KernelMap::strided(&sorted, 2, 2, &reference().device).expect("voxels").0);
    for place in everywhere() {
        let input = Random::new(3).values(sorted.len() * 17, -1.0, 1.0);
        let moved: Vec<f64> = shuffled.iter().flat_map(|i| &input[i * 17..][..17]).copied().collect();
        let w = place.tensor(&weights(27, [17, 20]), [27, 17, 20]);
        let of = |voxels: &[[i32; 4]], input: &[f64]| {
            let map = KernelMap::submanifold(voxels, 3, &place.device).expect("voxels");
            values(&sparse_conv(place.tensor(input, [voxels.len(), 17]), w.clone(), &map))
        };
        let (rows, moved) = (of(&sorted, &input), of(&voxels, &moved));
        let expected: Vec<f64> = shuffled.iter().flat_map(|i| &rows[i * 20..][..20]).copied().collect();
        assert_near(&place.name, &moved, &expected, bound(place));
    }
}

#[test]
fn points_go_to_voxels_and_back() {
    for place in everywhere() {
        let of_row: Vec<u32> = (0..5000).map(|i| (i * i + 3 * i) % 601).collect();
        let segments = Segments::new(of_row.clone(), 640, &place.device).expect("indices");
        let rows = Random::new(2).values(5000 * 7, -1.0, 1.0);
        let (mut sums, mut counts) = (vec![0.0; 640 * 7], vec![0.0; 640]);
        for (segment, row) in of_row.iter().map(|s| *s as usize).zip(rows.chunks(7)) {
            counts[segment] += 1.0;
            row.iter().zip(&mut sums[segment * 7..]).for_each(|(x, sum)| *sum += x);
        }
        let means: Vec<f64> = sums.iter().enumerate().map(|(i, sum)| sum / f64::max(counts[i / 7], 1.0)).collect();
        let points = place.leaf(&rows, [5000, 7]);
        let found = segment_mean(points.clone(), &segments);
        assert_near(&format!("means on {}", place.name), &values(&found), &means, bound(place));
        let gradients = take_rows(found, &segments).square().sum().backward();
        // The sum over points of their voxel's squared mean: each point gets twice its voxel's mean.
        let expected: Vec<f64> =
            of_row.iter().flat_map(|s| &means[*s as usize * 7..][..7]).map(|mean| 2.0 * mean).collect();
        let gradient = values(&points.grad(&gradients).expect("tracked"));
        let bound = if place.is_double() { GRADIENT_F64 } else { GRADIENT_F32 };
        assert_gradient(&format!("points on {}", place.name), &gradient, &expected, bound);
    }
}

#[test]
fn no_voxels_and_no_channels_are_shapes() {
    let place = reference();
    let empty = KernelMap::submanifold(&[], 3, &place.device).expect("voxels");
    let one = KernelMap::submanifold(&[[0, 1, 2, 3]], 3, &place.device).expect("a voxel");
    for (map, rows, wide_in, wide_out) in [(&empty, 0, 4, 5), (&one, 1, 0, 5), (&one, 1, 4, 0)] {
        let input = Random::new(1).leaf(place, [rows, wide_in], -1.0, 1.0);
        let weights = Random::new(2).leaf(place, [27, wide_in, wide_out], -1.0, 1.0);
        let output = sparse_conv(input.clone(), weights.clone(), map);
        assert_eq!(output.dims(), [rows, wide_out]);
        let gradients = output.sum().backward();
        assert_eq!(input.grad(&gradients).expect("tracked").dims(), [rows, wide_in]);
        assert_eq!(weights.grad(&gradients).expect("tracked").dims(), [27, wide_in, wide_out]);
    }
}

#[test]
fn bad_segments_are_errors_and_none_are_a_shape() {
    let place = reference();
    let error = Segments::new(vec![0, 3], 3, &place.device).unwrap_err();
    assert_eq!(error.to_string(), "row 1 is in segment 3: expected an index below 3");
    let none = Segments::new(Vec::new(), 0, &place.device).expect("no rows");
    assert_eq!(segment_mean(place.tensor(&[], [0, 4]), &none).dims(), [0, 4]);
    assert_eq!(take_rows(place.tensor(&[], [0, 4]), &none).dims(), [0, 4]);
}

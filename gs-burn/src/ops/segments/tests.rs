use super::*;
use crate::testing::{Random, assert_same_gradients, device, gradient_of, tensor};

/// `[V, N]`: 1, or one over the count, where a row is in a segment.
fn matrix(of_row: &[u32], count: usize, mean: bool) -> Tensor<2> {
    let size = |segment: usize| of_row.iter().filter(|s| **s as usize == segment).count();
    let entry = |segment: usize, row: usize| match of_row[row] as usize == segment {
        true if mean => 1.0 / size(segment) as f64,
        inside => f64::from(u8::from(inside)),
    };
    let entries = (0..count).flat_map(|segment| (0..of_row.len()).map(move |row| (segment, row)));
    tensor(entries.map(|(segment, row)| entry(segment, row)).collect(), [count, of_row.len()])
}

#[test]
fn both_ways_are_products_with_a_matrix() {
    // Segment 3 has no rows, segment 0 one.
    let of_row = vec![2, 1, 2, 0, 4, 1, 2, 4];
    let segments = Segments::new(of_row.clone(), 5, &device()).unwrap();
    let points = Random(1).tensor([8, 3], -1.0, 1.0).require_grad();
    let mean = matrix(&of_row, 5, true).matmul(points.clone());
    assert_same_gradients(segment_mean(points.clone(), &segments), mean, &[("points", &gradient_of(&points))]);
    let voxels = Random(2).tensor([5, 3], -1.0, 1.0).require_grad();
    let taken = matrix(&of_row, 5, false).transpose().matmul(voxels.clone());
    assert_same_gradients(take_rows(voxels.clone(), &segments), taken, &[("voxels", &gradient_of(&voxels))]);
}

#[test]
fn bad_indices_are_errors_and_nothing_is_a_shape() {
    let error = Segments::new(vec![0, 3], 3, &device()).unwrap_err();
    assert_eq!(error.to_string(), "row 1 is in segment 3: expected an index below 3");
    let none = Segments::new(Vec::new(), 0, &device()).unwrap();
    assert_eq!(segment_mean(tensor(Vec::new(), [0, 4]), &none).dims(), [0, 4]);
    assert_eq!(take_rows(tensor(Vec::new(), [0, 4]), &none).dims(), [0, 4]);
}

use super::*;
use crate::testing::{Random, assert_same_gradients, device, gradient_of};

/// Voxels on a bent surface in two batches, in no order.
pub fn surface() -> Vec<[i32; 4]> {
    let mut voxels: Vec<[i32; 4]> = (0..2)
        .flat_map(|b| (-9..9).flat_map(move |x| (-8..8).map(move |y| [b, x, y, (x * x + 3 * y + b) / 7])))
        .filter(|[b, x, y, _]| (x * 5 + y * 3 + b) % 4 != 0)
        .collect();
    voxels.sort_by_key(|[b, x, y, z]| (b * 31 + x * 17 + y * 101 + z * 57).rem_euclid(97));
    voxels
}

#[test]
fn kernels_are_the_reference() {
    let voxels = surface();
    let (_, down) = KernelMap::strided(&voxels, 2, 2, &device()).unwrap();
    let (_, wide) = KernelMap::strided(&voxels, 3, 2, &device()).unwrap();
    let same = KernelMap::submanifold(&voxels, 3, &device()).unwrap();
    let maps = [same.clone(), same.transposed(), down.transposed(), down, wide.transposed(), wide];
    for (case, map) in maps.into_iter().enumerate() {
        // Narrow and wide rows, multiples of the vector's lanes and others.
        for [wide_in, wide_out] in [[3, 16], [15, 20], [5, 70], [70, 5]] {
            let mut random = Random(case as u64);
            let input = random.tensor([map.inputs(), wide_in], -1.0, 1.0).require_grad();
            let weights = random.tensor([map.offsets(), wide_in, wide_out], -1.0, 1.0).require_grad();
            assert_same_gradients(
                sparse_conv(input.clone(), weights.clone(), &map),
                sparse_conv_reference(input.clone(), weights.clone(), &map),
                &[("input", &gradient_of(&input)), ("weights", &gradient_of(&weights))],
            );
        }
    }
}

#[test]
fn no_voxels_and_no_channels_are_shapes() {
    let empty = KernelMap::submanifold(&[], 3, &device()).unwrap();
    let one = KernelMap::submanifold(&[[0, 1, 2, 3]], 3, &device()).unwrap();
    for (map, rows, wide_in, wide_out) in [(&empty, 0, 4, 5), (&one, 1, 0, 5), (&one, 1, 4, 0)] {
        let input = Random(1).tensor([rows, wide_in], -1.0, 1.0).require_grad();
        let weights = Random(2).tensor([27, wide_in, wide_out], -1.0, 1.0).require_grad();
        let output = sparse_conv(input.clone(), weights.clone(), map);
        assert_eq!(output.dims(), [rows, wide_out]);
        let gradients = output.sum().backward();
        assert_eq!(input.grad(&gradients).unwrap().dims(), [rows, wide_in]);
        assert_eq!(weights.grad(&gradients).unwrap().dims(), [27, wide_in, wide_out]);
    }
}

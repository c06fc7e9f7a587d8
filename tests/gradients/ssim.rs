//! `gs_burn::ops::ssim`.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::{l1_ssim, l1_ssim_reference};
use gs_tests::devices::{Place, doubles, reference, singles};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64, assert_gradient, values};

const NAMES: [&str; 2] = ["image", "target"];
/// Height, width, channels.
const SHAPES: [[usize; 3]; 5] = [[1, 1, 3], [3, 40, 1], [19, 23, 3], [37, 53, 3], [70, 9, 5]];

type L1Ssim = fn(Tensor<3>, Tensor<3>) -> Tensor<1>;

/// An image and a target that resembles it, nowhere equal to it: the absolute difference has a kink there.
fn images(shape: [usize; 3]) -> [Vec<f64>; 2] {
    let image = Random::new(12).values(shape.iter().product(), 0.0, 1.0);
    let target = image.iter().map(|x| f64::from((0.3 + 0.5 * x * x) as f32)).collect();
    [image, target]
}

/// `0.7 L1 - 0.4 SSIM` and its gradients by both images.
fn run([image, target]: &[Vec<f64>; 2], shape: [usize; 3], place: &Place, op: L1Ssim) -> (f64, [Vec<f64>; 2]) {
    let [image, target] = [image, target].map(|values| place.leaf(values, shape));
    let sum = (op(image.clone(), target.clone()) * place.tensor(&[0.7, -0.4], [2]).autodiff()).sum();
    let gradients = sum.backward();
    let of = |leaf: &Tensor<3>| values(&leaf.grad(&gradients).expect("both images are tracked"));
    (values(&sum)[0], [of(&image), of(&target)])
}

#[test]
fn doubles_are_the_central_differences() {
    for place in doubles() {
        for shape in SHAPES {
            let at = images(shape);
            let (_, gradients) = run(&at, shape, place, l1_ssim);
            for k in 0..2 {
                assert_derivative(
                    &format!("{} {shape:?} on {}", NAMES[k], place.name),
                    &at[k],
                    &gradients[k],
                    100,
                    |x| {
                        let mut moved = at.clone();
                        moved[k] = x.to_vec();
                        run(&moved, shape, place, l1_ssim).0
                    },
                );
            }
        }
    }
}

#[test]
fn every_device_follows_the_reference() {
    for shape in SHAPES {
        let at = images(shape);
        let (_, expected) = run(&at, shape, reference(), l1_ssim_reference);
        for (place, bound) in
            doubles().iter().map(|p| (p, GRADIENT_F64)).chain(singles().iter().map(|p| (p, GRADIENT_F32)))
        {
            let (_, actual) = run(&at, shape, place, l1_ssim);
            for k in 0..2 {
                let what = format!("{} {shape:?} on {}", NAMES[k], place.name);
                assert_gradient(&what, &actual[k], &expected[k], bound);
            }
        }
    }
}

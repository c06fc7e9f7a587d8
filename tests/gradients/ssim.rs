//! `gs_burn::ops::ssim`.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::{l1_ssim, l1_ssim_reference};
use gs_tests::devices::{Place, bounded, doubles, reference};
use gs_tests::finite_differences::{Course, assert_course_derivatives};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64, assert_gradient, assert_same_gradients, gradient_of, values};

const NAMES: [&str; 2] = ["image", "target"];
/// Height, width, channels; the last reaches over several areas of the CPU's kernel.
const SHAPES: [[usize; 3]; 7] =
    [[1, 1, 3], [3, 40, 1], [12, 4, 2], [19, 23, 3], [37, 53, 3], [70, 9, 5], [141, 178, 3]];

type L1Ssim = fn(Tensor<3>, Tensor<3>) -> Tensor<1>;

/// An image and a target that resembles it, nowhere equal to it: the absolute difference has a kink there.
fn images(shape: [usize; 3]) -> [Vec<f64>; 2] {
    let image = Random::new(12).values(shape.iter().product(), 0.0, 1.0);
    let target = image.iter().map(|x| f64::from((0.3 + 0.5 * x * x) as f32)).collect();
    [image, target]
}

/// `0.7 L1 - 0.4 SSIM`.
fn mixture([image, target]: &[Tensor<3>; 2], place: &Place, op: L1Ssim) -> Tensor<1> {
    (op(image.clone(), target.clone()) * place.tensor(&[0.7, -0.4], [2]).autodiff()).sum()
}

/// The gradients of [`mixture`] by both images.
fn gradients(images: &[Vec<f64>; 2], shape: [usize; 3], place: &Place, op: L1Ssim) -> [Vec<f64>; 2] {
    let images = images.each_ref().map(|values| place.leaf(values, shape));
    let gradients = mixture(&images, place, op).backward();
    images.map(|leaf| values(&leaf.grad(&gradients).expect("both images are tracked")))
}

#[test]
fn doubles_are_the_central_differences() {
    for place in doubles() {
        for shape in SHAPES {
            let [image, target] = images(shape);
            let arguments: [(&str, &[f64]); 2] = [("image", &image), ("target", &target)];
            assert_course_derivatives(&format!("{shape:?}"), Course::Smooth, place, arguments, 100, |images| {
                mixture(&images.map(|image| image.reshape(shape)), place, l1_ssim)
            });
        }
    }
}

#[test]
fn every_device_follows_the_reference() {
    for shape in SHAPES {
        let at = images(shape);
        let expected = gradients(&at, shape, reference(), l1_ssim_reference);
        for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
            let actual = gradients(&at, shape, place, l1_ssim);
            for k in 0..2 {
                let what = format!("{} {shape:?} on {}", NAMES[k], place.name);
                assert_gradient(&what, &actual[k], &expected[k], bound);
            }
        }
    }
}

#[test]
fn strided_images_are_read_as_they_are() {
    let (place, mut random) = (reference(), Random::new(9));
    let image = random.leaf(place, [20, 18, 4], 0.0, 1.0);
    let target = place.tensor(&random.values(18 * 20 * 3, 0.0, 1.0), [18, 20, 3]).permute([1, 0, 2]).autodiff();
    let [actual, expected] = [l1_ssim, l1_ssim_reference].map(|op| op(image.clone().narrow(2, 0, 3), target.clone()));
    assert_same_gradients(actual, expected, &[("image", gradient_of(&image))]);
}

//! How near is near: every bound of the tests, with its argument, and the comparisons that use them.

use burn::tensor::{Gradients, Int, Tensor};

use crate::scenes::Random;

/// Kernels in `f64` against the reference in `f64`, relative to the largest value. Both do the same few hundred
/// operations in another order, each off by 1e-16; sums over a pixel's Gaussians and cancellation in the conic take
/// three to four digits. Six more digits would be an error in a formula.
pub const FORWARD_F64: f64 = 1e-10;

/// Gradients in `f64` against central differences, relative to the largest of the group. A step `h` costs `h^2 f'''`
/// and `1e-16 / h`: both 1e-10 at the best `h` for curvature of order 1, and the images here curve up to 1e3 times
/// more (a Gaussian of a pixel's size).
pub const GRADIENT_DIFFERENCES: f64 = 1e-6;

/// Gradients in `f64` against the gradients Burn finds of the reference in `f64`: rounding only, as
/// [`FORWARD_F64`], but summed over pixels with both signs.
pub const GRADIENT_F64: f64 = 1e-8;

/// Values in `f32` against the reference in `f64`, absolute for values of order 1 (colours, alphas, losses). Positions
/// in a 50 pixel image are rounded to 4e-6 pixels, and alpha falls by at most its half per pixel for the smallest
/// Gaussian there is (a dilation of 0.3 square pixels); 1e-5 is 1/400 of a step of an 8-bit image.
///
/// Vendors round sums and products alike. With the accuracies CUDA states (`exp` 2 ULP, `log` 1, `sqrt` and division
/// 0.5) alpha is off by 6e-6 at most: 4.4e-6 through the mean, 1.5e-6 through the conic, 4e-7 by the exponential. WGSL
/// states less (`exp` 3 + 2|x| ULP, `log` 3, `sqrt` 4.5, division 2.5): its division adds 9e-6 pixels to a mean at the
/// edge, so 1.6e-5 in the worst place for a driver that uses all of it. The bound is not widened for that;
/// BENCHMARKS.md has the chain.
pub const FORWARD_F32: f64 = 1e-5;

/// Gradients in `f32` against the reference in `f64`, relative to the largest of the group: the rounding of the forward
/// pass times the gain of the inverse covariance (a hundred for the thinnest Gaussians of the scenes).
///
/// By WGSL's accuracies a variance is off by 2.9e-6 of itself (`exp` of log scales down to -4.5: 12 ULP, twice) and a
/// conic by 4e-6: 4e-4 after that gain. The division in `1 / (1 - alpha)` adds 3e-7 of its value, however large that
/// is.
pub const GRADIENT_F32: f64 = 1e-3;

/// [`FORWARD_F32`] for needles of 1:1000, opaque stacks and Gaussians across the frustum edge or near plane: their
/// position or shape amplifies rounding by thirty.
pub const HARD_FORWARD_F32: f64 = 3e-4;

/// [`GRADIENT_F32`] for the scenes of [`HARD_FORWARD_F32`].
pub const HARD_GRADIENT_F32: f64 = 1e-2;

/// Smallest cosine between the gradient of a group in `f32` and in `f64`: catches a group that is right in its largest
/// entry alone.
pub const GRADIENT_COSINE: f64 = 0.9999;

/// A tensor's elements on the host.
pub fn values<const D: usize>(tensor: &Tensor<D>) -> Vec<f64> {
    tensor.to_data().iter::<f64>().collect()
}

/// An index tensor's elements on the host.
pub fn indices(tensor: &Tensor<1, Int>) -> Vec<usize> {
    tensor.to_data().iter::<i64>().map(|i| usize::try_from(i).expect("an index is not negative")).collect()
}

/// Bits of single-precision elements, for tests of equality to the last bit.
pub fn bits<const D: usize>(tensor: &Tensor<D>) -> Vec<u32> {
    tensor.to_data().iter::<f32>().map(f32::to_bits).collect()
}

/// One column of rows of `columns` values. Columns in units of their own (pixels, inverse square pixels, scene units)
/// are compared one by one, or the smaller would be held to a share of the larger.
pub fn column(rows: &[f64], columns: usize, column: usize) -> Vec<f64> {
    rows.iter().skip(column).step_by(columns).copied().collect()
}

/// Largest magnitude.
pub fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |max, x| max.max(x.abs()))
}

/// Asserts that every value is a number.
#[track_caller]
pub fn assert_finite(what: &str, values: &[f64]) {
    if let Some(i) = values.iter().position(|x| !x.is_finite()) {
        panic!("{what}[{i}] of {} is {}", values.len(), values[i]);
    }
}

/// Asserts that no value is further than `bound` from the expected one.
#[track_caller]
pub fn assert_near(what: &str, actual: &[f64], expected: &[f64], bound: f64) {
    assert_eq!(actual.len(), expected.len(), "number of values of {what}");
    let far = |(_, (a, e)): &(usize, (&f64, &f64))| (**a - **e).abs() > bound || (**a - **e).is_nan();
    let count = actual.iter().zip(expected).enumerate().filter(far).count();
    let worst = actual
        .iter()
        .zip(expected)
        .enumerate()
        .max_by(|(_, (a, e)), (_, (b, f))| (*a - *e).abs().total_cmp(&(*b - *f).abs()));
    if let Some((i, (a, e))) = worst {
        assert!(
            count == 0,
            "{what}: {count} of {} values are off by more than {bound:.1e}, most at {i}: {a} instead of {e}, off by {:.2e}",
            actual.len(),
            (a - e).abs()
        );
    }
}

/// [`assert_near`] with the bound relative to the largest expected value, or to 1 if that is less.
#[track_caller]
pub fn assert_near_scaled(what: &str, actual: &[f64], expected: &[f64], bound: f64) {
    assert_near(what, actual, expected, bound * largest(expected).max(1.0));
}

/// Asserts that an image of `channels` values a pixel is the expected one: all channels to `bound` itself, but for that
/// of depth, which counts in units of length: to `bound` of the largest depth, or to `bound` if that is below 1.
#[track_caller]
pub fn assert_image(what: &str, actual: &[f64], expected: &[f64], channels: usize, depth: Option<usize>, bound: f64) {
    assert_eq!(actual.len(), expected.len(), "number of values of {what}");
    let fits = channels > 0 && expected.len().is_multiple_of(channels) && depth.is_none_or(|depth| depth < channels);
    assert!(fits, "{channels} channels, depth {depth:?}, do not fit {} values of {what}", expected.len());
    for channel in 0..channels {
        let [actual, expected] = [actual, expected].map(|image| column(image, channels, channel));
        let what = format!("channel {channel} of {what}");
        if depth == Some(channel) {
            assert_near_scaled(&what, &actual, &expected, bound);
        } else {
            assert_near(&what, &actual, &expected, bound);
        }
    }
}

/// Asserts that a gradient is the expected one, to `bound` of its largest entry, and in direction; and that it is not
/// zero, which a kernel that the driver refused leaves behind and every bound of the form `bound * largest` accepts.
#[track_caller]
pub fn assert_gradient(what: &str, actual: &[f64], expected: &[f64], bound: f64) {
    let scale = largest(expected);
    assert!(scale > 0.0, "{what}: the expected gradient is all zero, the test would prove nothing");
    assert!(largest(actual) > 0.0, "{what}: the gradient is all zero");
    assert_near(what, actual, expected, bound * scale);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a / scale * b / scale).sum::<f64>();
    let cosine = dot(actual, expected) / (dot(actual, actual) * dot(expected, expected)).sqrt();
    assert!(cosine >= GRADIENT_COSINE, "{what}: cosine {cosine} with the expected gradient");
}

/// Finds the gradient of one leaf, flat.
pub type GradientOf = Box<dyn Fn(&Gradients) -> Option<Vec<f64>>>;

/// The gradient of a leaf, for [`assert_same_gradients`].
pub fn gradient_of<const D: usize>(leaf: &Tensor<D>) -> GradientOf {
    let leaf = leaf.clone();
    Box::new(move |gradients| leaf.grad(gradients).map(|gradient| values(&gradient)))
}

/// Asserts that two functions in `f64` of tensors that share leaves agree in value and in every leaf's gradient, for a
/// random gradient of the result.
#[track_caller]
pub fn assert_same_gradients<const D: usize>(actual: Tensor<D>, expected: Tensor<D>, leaves: &[(&str, GradientOf)]) {
    assert_eq!(actual.dims(), expected.dims(), "shape");
    let wanted = values(&expected);
    assert_near("value", &values(&actual), &wanted, FORWARD_F64 * largest(&wanted));
    let v = Random::new(99).values(wanted.len(), -1.0, 1.0);
    let v = Tensor::<1>::from_data(v.as_slice(), (&actual.device(), actual.dtype())).reshape(actual.dims());
    let (actual, expected) = ((actual * v.clone()).sum().backward(), (expected * v).sum().backward());
    for (name, gradient) in leaves {
        let [actual, expected] =
            [&actual, &expected].map(|all| gradient(all).expect("both results depend on the leaf"));
        assert_gradient(name, &actual, &expected, GRADIENT_F64);
    }
}

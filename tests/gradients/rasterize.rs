//! `gs_burn::ops::rasterize`.

use burn::tensor::Tensor;
use gs_burn::ops::intersect::intersect;
use gs_burn::ops::rasterize::{RasterizeConfig, rasterize, rasterize_reference};
use gs_kernels::rows::{PROJECTED, ProjectedRow, SCREEN};
use gs_tests::cutoff::{SHARE, SHARE_IN_STACKS, undecided_pixels, without};
use gs_tests::devices::{Place, bounded, doubles, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::{Random, Reading, Scene};
use gs_tests::tolerance::{
    GRADIENT_F32, GRADIENT_F64, HARD_GRADIENT_F32, assert_gradient, assert_near, column, largest, values,
};

const NAMES: [&str; 5] = ["projected", "opacities", "features", "background", "screen"];
const SIGNED_SCREEN: usize = 4;

/// Arguments on the host in the order of [`NAMES`] without the screen, and a weight for every output.
#[derive(Clone)]
struct Inputs {
    arguments: [Vec<f64>; 4],
    weights: Vec<f64>,
    config: RasterizeConfig,
}

impl Inputs {
    fn random(count: usize, channels: usize, depth: bool, seed: u64) -> Self {
        let scene = Scene::random(count, seed);
        let mut random = Random::new(seed);
        let config = RasterizeConfig { width: scene.config.width, height: scene.config.height, channels, depth };
        let rows: Vec<f64> = scene.reference_rows().into_iter().map(|x| f64::from(x as f32)).collect();
        let opacities = random.values(count, 0.05, 1.0);
        let features = random.values(count * channels, -0.2, 1.0);
        let background = random.values(channels, 0.0, 1.0);
        let pixels = (config.width * config.height) as usize;
        let weights = random.values(pixels * config.output_channels(), -1.0, 1.0);
        Self { arguments: [rows, opacities, features, background], weights, config }
    }

    /// Without weight where rounding decides; what single precision is judged on.
    #[track_caller]
    fn decided(mut self, share: f64) -> Self {
        let [rows, opacities, ..] = &self.arguments;
        let undecided =
            undecided_pixels(rows, opacities, [self.config.width as usize, self.config.height as usize], share);
        self.weights = without(&self.weights, &undecided);
        self
    }

    /// The image of flat arguments in the order of [`NAMES`].
    fn image(
        &self,
        [rows, opacities, features, background]: [Tensor<1>; 4],
        screen: Option<Tensor<2>>,
        reading: Reading,
    ) -> Tensor<3> {
        let (width, height) = (self.config.width as usize, self.config.height as usize);
        let rows = rows.reshape([-1, PROJECTED as i32]);
        let features = features.reshape([-1, self.config.channels as i32]);
        match reading {
            Reading::Kernels => {
                let lists = intersect(rows.clone(), opacities.clone(), features.clone(), width, height);
                rasterize(rows, opacities, features, background, screen, &lists, &self.config)
            }
            Reading::Reference => rasterize_reference(rows, opacities, features, background, screen, &self.config),
        }
    }

    /// The weighted image's sum.
    fn sum(&self, arguments: [Tensor<1>; 4], screen: Option<Tensor<2>>, place: &Place, reading: Reading) -> Tensor<1> {
        let image = self.image(arguments, screen, reading);
        let weights = place.tensor(&self.weights, image.dims()).autodiff();
        (image * weights).sum()
    }

    /// The gradients in the order of [`NAMES`], of the screen the signed half, which is all that the reference has; and
    /// its absolute half.
    fn gradients(&self, place: &Place, reading: Reading) -> ([Vec<f64>; 5], Vec<f64>) {
        let leaves = self.arguments.each_ref().map(|values| place.leaf(values, [values.len()]));
        let count = self.arguments[1].len();
        let screen = place.leaf(&vec![0.0; count * SCREEN], [count, SCREEN]);
        let gradients = self.sum(leaves.clone(), Some(screen.clone()), place, reading).backward();
        let screen = screen.grad(&gradients).expect("the screen is tracked");
        let [rows, opacities, features, background] =
            leaves.map(|leaf| values(&leaf.grad(&gradients).expect("every argument is tracked")));
        let [signed, absolute] = [0, SCREEN / 2].map(|first| values(&screen.clone().narrow(1, first, SCREEN / 2)));
        ([rows, opacities, features, background, signed], absolute)
    }
}

#[test]
fn doubles_are_the_central_differences() {
    for place in doubles() {
        for (channels, depth) in [(3, true), (3, false), (1, false), (8, true), (32, false)] {
            let inputs = Inputs::random(50, channels, depth, 6);
            let arguments = std::array::from_fn(|k| (NAMES[k], inputs.arguments[k].as_slice()));
            assert_derivatives(&format!("{channels} channels"), place, arguments, 100, |arguments| {
                inputs.sum(arguments, None, place, Reading::Kernels)
            });
        }
    }
}

/// [`assert_gradient`] for each column of the gradient by projected rows; nothing where the image does not depend on a
/// column.
#[track_caller]
fn assert_columns(what: &str, actual: &[f64], expected: &[f64], bound: f64) {
    for c in 0..PROJECTED {
        let [actual, expected] = [actual, expected].map(|rows| column(rows, PROJECTED, c));
        let what = format!("column {c} of {what}");
        if largest(&expected) > 0.0 {
            assert_gradient(&what, &actual, &expected, bound);
        } else {
            assert_near(&what, &actual, &expected, 0.0);
        }
    }
}

/// Asserts that every device follows the reference: in each argument's gradient, and in each column of the gradient by
/// the rows.
#[track_caller]
fn assert_follows_the_reference(case: &str, inputs: &Inputs, single: f64) {
    let (expected, _) = inputs.gradients(reference(), Reading::Reference);
    for (place, bound) in bounded(GRADIENT_F64, single) {
        let (actual, _) = inputs.gradients(place, Reading::Kernels);
        for k in 0..NAMES.len() {
            assert_gradient(&format!("{} of {case} on {}", NAMES[k], place.name), &actual[k], &expected[k], bound);
        }
        assert_columns(&format!("{case} on {}", place.name), &actual[0], &expected[0], bound);
    }
}

/// As many channels as models use in one pass: colour, with depth, and feature fields up to 32.
#[test]
fn every_device_follows_the_reference() {
    for (channels, depth) in [(1, false), (3, false), (3, true), (5, true), (8, false), (32, false)] {
        let inputs = Inputs::random(60, channels, depth, 7).decided(SHARE);
        assert_follows_the_reference(&format!("{channels} channels"), &inputs, GRADIENT_F32);
    }
}

/// The absolute half of the screen gradient: the reference has none, so pixels one by one stand in for it.
#[test]
fn absolute_screen_gradient_sums_pixels() {
    let inputs = Inputs::random(6, 2, false, 8).decided(SHARE);
    let per_pixel = inputs.config.output_channels();
    let mut expected = vec![0.0; 6 * SCREEN / 2];
    for pixel in 0..(inputs.config.width * inputs.config.height) as usize {
        let mut alone = inputs.clone();
        alone.weights.iter_mut().enumerate().filter(|(i, _)| i / per_pixel != pixel).for_each(|(_, w)| *w = 0.0);
        let (gradients, _) = alone.gradients(reference(), Reading::Kernels);
        expected.iter_mut().zip(&gradients[SIGNED_SCREEN]).for_each(|(sum, g)| *sum += g.abs());
    }
    for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
        let (gradients, absolute) = inputs.gradients(place, Reading::Kernels);
        assert_gradient(&format!("absolute screen on {}", place.name), &absolute, &expected, bound);
        // The signed half is the gradient by the mean; both come from the same sum.
        let means: Vec<f64> = gradients[0].chunks(PROJECTED).flat_map(|row| ProjectedRow::read(row, 0).mean).collect();
        assert_near(&format!("signed screen on {}", place.name), &gradients[SIGNED_SCREEN], &means, 0.0);
    }
}

#[test]
fn an_untracked_screen_is_optional() {
    let inputs = Inputs::random(20, 3, true, 7);
    for place in everywhere() {
        let leaves = inputs.arguments.each_ref().map(|values| place.leaf(values, [values.len()]));
        let screen = place.leaf(&[0.0; 20 * SCREEN], [20, SCREEN]);
        let [without, with] =
            [None, Some(screen)].map(|screen| values(&inputs.image(leaves.clone(), screen, Reading::Kernels)));
        assert!(largest(&without) > 0.0 && without == with, "{}", place.name);
    }
}

/// Stacks of Gaussians with alphas up to the cap: `1 / (1 - alpha)` reaches 1000 in the backward pass.
#[test]
fn opaque_stacks_follow_the_reference() {
    for (count, opacity) in [(200, 0.05), (200, 0.2), (30, 0.999), (30, 0.8), (3, 0.9), (2, 0.99), (1, 0.99)] {
        let mut inputs = Inputs::random(count, 3, true, 9);
        inputs.arguments[1] = vec![f64::from(opacity as f32); count];
        let conic = [1.0 / 32.0, 0.125, 1.0 / 64.0];
        for (i, row) in inputs.arguments[0].chunks_mut(PROJECTED).enumerate() {
            let mean = [20.3 + i as f64 / 512.0, 18.7 - i as f64 / 1024.0];
            let depth = 2.0 + i as f64 / 64.0;
            row.copy_from_slice(&ProjectedRow { mean, conic, depth, compensation: 1.0, radius: 30.0 }.pack());
        }
        let inputs = inputs.decided(SHARE_IN_STACKS);
        assert_follows_the_reference(&format!("{count} x {opacity}"), &inputs, HARD_GRADIENT_F32);
    }
}

//! `gs_burn::ops::rasterize`.

use burn::tensor::Tensor;
use gs_burn::ops::intersect::intersect;
use gs_burn::ops::rasterize::{RasterizeConfig, rasterize, rasterize_reference};
use gs_kernels::rows::{PROJECTED, ProjectedRow, SCREEN};
use gs_tests::cutoff::{SHARE, SHARE_IN_STACKS, undecided_pixels, without};
use gs_tests::devices::{Place, doubles, reference, singles};
use gs_tests::finite_differences::assert_derivative;
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

    fn leaves(&self, place: &Place) -> (Tensor<2>, Tensor<1>, Tensor<2>, Tensor<1>, Tensor<2>) {
        let [rows, opacities, features, background] = &self.arguments;
        let count = opacities.len();
        (
            place.leaf(rows, [count, PROJECTED]),
            place.leaf(opacities, [count]),
            place.leaf(features, [count, self.config.channels]),
            place.leaf(background, [self.config.channels]),
            place.leaf(&vec![0.0; count * SCREEN], [count, SCREEN]),
        )
    }

    /// The weighted output's sum, and its gradients in the order of [`NAMES`]; of the screen the signed half, which is
    /// all that the reference has.
    fn run(&self, place: &Place, reading: Reading) -> (f64, [Vec<f64>; 5], Vec<f64>) {
        let (rows, opacities, features, background, screen) = self.leaves(place);
        let (width, height) = (self.config.width as usize, self.config.height as usize);
        let [r, f] = [&rows, &features].map(Tensor::clone);
        let (o, b, s) = (opacities.clone(), background.clone(), Some(screen.clone()));
        let image = match reading {
            Reading::Kernels => {
                let lists = intersect(r.clone(), o.clone(), f.clone(), width, height);
                rasterize(r, o, f, b, s, &lists, &self.config)
            }
            Reading::Reference => rasterize_reference(r, o, f, b, s, &self.config),
        };
        let weights = place.tensor(&self.weights, image.dims()).autodiff();
        let sum = (image * weights).sum();
        let gradients = sum.backward();
        let screen = screen.grad(&gradients).expect("the screen is tracked");
        let both = [
            values(&rows.grad(&gradients).expect("rows are tracked")),
            values(&opacities.grad(&gradients).expect("opacities are tracked")),
            values(&features.grad(&gradients).expect("features are tracked")),
            values(&background.grad(&gradients).expect("the background is tracked")),
            values(&screen.clone().narrow(1, 0, SCREEN / 2)),
        ];
        (values(&sum)[0], both, values(&screen.narrow(1, SCREEN / 2, SCREEN / 2)))
    }
}

#[test]
fn doubles_are_the_central_differences() {
    for place in doubles() {
        for (channels, depth) in [(3, true), (3, false), (1, false), (8, true), (32, false)] {
            let inputs = Inputs::random(50, channels, depth, 6);
            let (_, gradients, _) = inputs.run(place, Reading::Kernels);
            for k in 0..4 {
                let what = format!("{} of {channels} channels on {}", NAMES[k], place.name);
                assert_derivative(&what, &inputs.arguments[k], &gradients[k], 100, |x| {
                    let mut moved = inputs.clone();
                    moved.arguments[k] = x.to_vec();
                    moved.run(place, Reading::Kernels).0
                });
            }
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

/// As many channels as models use in one pass: colour, with depth, and feature fields up to 32.
#[test]
fn every_device_follows_the_reference() {
    for (channels, depth) in [(1, false), (3, false), (3, true), (5, true), (8, false), (32, false)] {
        let inputs = Inputs::random(60, channels, depth, 7).decided(SHARE);
        let (_, expected, _) = inputs.run(reference(), Reading::Reference);
        for (place, bound) in
            doubles().iter().map(|p| (p, GRADIENT_F64)).chain(singles().iter().map(|p| (p, GRADIENT_F32)))
        {
            let (_, actual, _) = inputs.run(place, Reading::Kernels);
            for k in 0..NAMES.len() {
                let what = format!("{} of {channels} channels on {}", NAMES[k], place.name);
                assert_gradient(&what, &actual[k], &expected[k], bound);
            }
            assert_columns(&format!("{channels} channels on {}", place.name), &actual[0], &expected[0], bound);
        }
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
        let (_, gradients, _) = alone.run(reference(), Reading::Kernels);
        expected.iter_mut().zip(&gradients[SIGNED_SCREEN]).for_each(|(sum, g)| *sum += g.abs());
    }
    for (place, bound) in doubles().iter().map(|p| (p, GRADIENT_F64)).chain(singles().iter().map(|p| (p, GRADIENT_F32)))
    {
        let (_, gradients, absolute) = inputs.run(place, Reading::Kernels);
        assert_gradient(&format!("absolute screen on {}", place.name), &absolute, &expected, bound);
        // The signed half is the gradient by the mean; both come from the same sum.
        let means: Vec<f64> = gradients[0].chunks(PROJECTED).flat_map(|row| ProjectedRow::read(row, 0).mean).collect();
        assert_near(&format!("signed screen on {}", place.name), &gradients[SIGNED_SCREEN], &means, 0.0);
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
        let (_, expected, _) = inputs.run(reference(), Reading::Reference);
        for (place, bound) in
            doubles().iter().map(|p| (p, GRADIENT_F64)).chain(singles().iter().map(|p| (p, HARD_GRADIENT_F32)))
        {
            let (_, actual, _) = inputs.run(place, Reading::Kernels);
            for k in 0..NAMES.len() {
                let what = format!("{} of {count} x {opacity} on {}", NAMES[k], place.name);
                assert_gradient(&what, &actual[k], &expected[k], bound);
            }
            assert_columns(&format!("{count} x {opacity} on {}", place.name), &actual[0], &expected[0], bound);
        }
    }
}

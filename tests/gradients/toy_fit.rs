//! Twenty Gaussians find their way back: a backend that trains nothing, or the wrong way, does not pass.

use burn::tensor::Tensor;
use gs_burn::{Gaussians, render};
use gs_tests::devices::singles;
use gs_tests::fit::Fit;
use gs_tests::scenes::{Random, Scene};
use gs_tests::tolerance::{assert_finite, values};

const STEPS: usize = 150;
/// Ten times the rates of a long training, for a short one.
const RATES: [f64; 5] = [5e-3, 1e-2, 2e-2, 5e-2, 2e-2];

#[test]
fn the_loss_falls_on_every_device() {
    for place in singles() {
        let scene = Scene::random(20, 21).resized(40, 28);
        let truth = scene.leaves(place);
        let camera = scene.camera(truth.viewmat.clone().inner());
        let options = scene.options(false);
        let target = render(&truth.gaussians(), &camera, &options).color.inner();

        let mut random = Random::new(22);
        let mut shaken = scene.clone();
        for (group, by) in shaken.groups_mut().into_iter().zip([0.08, 0.2, 0.3, 0.5, 0.2]) {
            group.iter_mut().for_each(|x| *x += random.uniform(-by, by));
        }
        let start: Gaussians = shaken.leaves(place).gaussians();
        let mut fit = Fit::new(&start, RATES);
        let losses: Vec<Tensor<1>> = (0..STEPS).map(|_| fit.step(&camera, &options, &target)).collect();
        let losses: Vec<f64> = losses.iter().map(|loss| values(loss)[0]).collect();
        assert_finite(&place.name, &losses);
        let (first, last) = (losses[0], losses[STEPS - 1]);
        println!("{}: loss {first:.4} to {last:.4}", place.name);
        assert!(last * 5.0 < first, "{}: the loss went from {first} to {last}", place.name);
    }
}

//! A Burn user's view: networks and Gaussians under Burn's own optimiser and records, without the trainer.

use burn::module::Module;
use burn_optim::{AdamConfig, GradientsParams};
use gs_models::taylormode::{BlurWeights, MotionFrame, TaylorScene};
use gs_models::{Activation, DynamicScene, Mlp, MlpConfig};
use gs_tests::devices::{everywhere, singles};
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

use crate::{WINDOW, gaussians};

#[path = "../../examples/train_network.rs"]
mod train_network;

/// The documented example: the loss falls to less than a hundredth, and the network comes back from its files to the
/// bit.
#[test]
fn the_example_trains_a_network() {
    for place in singles() {
        let config = train_network::config();
        let (network, losses) = train_network::train(&config, 300, &place.device);
        let (first, last) = (losses[0], losses[losses.len() - 1]);
        assert!(last < 0.01 * first, "{}: the loss fell from {first} to {last} only", place.name);

        let folder = tempfile::tempdir().expect("a folder");
        let loaded = train_network::save_and_load(&network, &config, folder.path(), &place.device).expect("files");
        let (depth, velocity, _) = train_network::surfaces(&place.device);
        let weights = |network: &BlurWeights| values(&network.forward(depth.clone(), velocity.clone()));
        assert_eq!(weights(&loaded), weights(&network), "{}", place.name);
    }
}

/// A smooth network fits a smooth function to a thousandth of its variance.
#[test]
fn a_perceptron_fits_a_wave() {
    for place in singles() {
        let x: Vec<f64> = (0..128).map(|i| f64::from(i) / 64.0 - 1.0).collect();
        let wave: Vec<f64> = x.iter().map(|x| (4.0 * x).sin()).collect();
        let (x, wave) = (place.tensor(&x, [128, 1]), place.tensor(&wave, [128, 1]));
        let config = MlpConfig::new(vec![1, 32, 32, 1]).with_activation(Activation::Silu).with_seed(3);
        let mut mlp: Mlp = config.init(&place.device).train();
        let mut optimiser = AdamConfig::new().init();
        let mut last = f32::INFINITY;
        for _ in 0..800 {
            let loss = (mlp.forward(x.clone()) - wave.clone()).square().mean();
            let gradients = GradientsParams::from_grads(loss.backward(), &mlp);
            mlp = optimiser.step(1e-2, mlp, gradients);
            last = loss.into_scalar::<f32>();
        }
        assert!(last < 0.5e-3, "{}: {last}", place.name);
    }
}

/// A whole scene under Burn's optimiser: its Gaussians and its motion are leaves that `GradientsParams` finds by their
/// ids.
#[test]
fn burns_optimiser_moves_a_whole_scene() {
    for place in everywhere() {
        let mut random = Random::new(3);
        let motion = MotionFrame::new(vec![4, 1, 2], 2, 1, WINDOW).init(0, &place.device);
        let scene = TaylorScene { gaussians: gaussians(place, &mut random), motion: crate::cast(motion, place) };
        let target = place.tensor(&random.values(18, -1.0, 1.0), [6, 3]);
        let mut scene = scene.train();
        let mut optimiser = AdamConfig::new().init();
        let mut losses = Vec::new();
        for _ in 0..200 {
            let at = scene.at(WINDOW.t0 + 0.8 * WINDOW.half);
            let loss = (at.means.val() - target.clone()).square().mean() + at.quats.val().square().mean();
            losses.push(values(&loss)[0]);
            let gradients = GradientsParams::from_grads(loss.backward(), &scene);
            // Means, quats, position and rotation; the loss reaches no others.
            assert_eq!(gradients.len(), 4, "{}", place.name);
            scene = optimiser.step(2e-2, scene, gradients);
        }
        assert!(losses[199] < 0.01 * losses[0], "{}: from {} to {}", place.name, losses[0], losses[199]);
        let moved = values(&scene.motion.position.val());
        assert!(moved.iter().any(|x| x.abs() > 0.05), "{}: the motion learned nothing", place.name);
    }
}

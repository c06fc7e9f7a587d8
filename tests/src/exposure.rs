//! Scenes of which a part moves, and the slow reading of an exposure: one rendering an instant.

use burn::tensor::{DType, IndexingUpdateOp, Int, Tensor};
use gs_burn::{
    ExposureOptions, ExposureRendering, Extras, Gaussians, MovingSample, RenderOptions, render_exposure, render_with,
};

use crate::devices::Place;
use crate::scenes::{Leaves, Random, Scene};

/// A scene and where its movers are at each instant.
#[derive(Clone, Debug)]
pub struct Moving {
    /// The scene; what it has of the movers' centres and orientations is not used.
    pub scene: Scene,
    /// Numbers of what moves, rising.
    pub moving: Vec<u32>,
    /// Per instant, `[M, 3]`.
    pub means: Vec<Vec<f64>>,
    /// Per instant, `[M, 4]`.
    pub quats: Vec<Vec<f64>>,
}

impl Moving {
    /// `count` small Gaussians in an image of 120 x 83 pixels. Every `every`th moves by up to `step` an instant, along
    /// each axis, and turns.
    pub fn random(count: usize, every: usize, instants: usize, step: f64, seed: u64) -> Self {
        let mut scene = Scene::random(count, seed).resized(120, 83);
        scene.log_scales.iter_mut().for_each(|s| *s -= 1.0);
        let moving: Vec<u32> = (0..count as u32).filter(|row| *row as usize % every == every - 1).collect();
        let mut random = Random::new(seed + 1);
        let velocities = random.values(3 * moving.len(), -step, step);
        let turns = random.values(4 * moving.len(), -step, step);
        let at = |columns: usize, scene: &[f64], change: &[f64]| -> Vec<Vec<f64>> {
            let start: Vec<f64> =
                moving.iter().flat_map(|&row| scene[row as usize * columns..][..columns].to_vec()).collect();
            let instant =
                |k: usize| start.iter().zip(change).map(|(x, v)| f64::from((x + k as f64 * v) as f32)).collect();
            (0..instants).map(instant).collect()
        };
        let (means, quats) = (at(3, &scene.means, &velocities), at(4, &scene.quats, &turns));
        Self { scene, moving, means, quats }
    }

    /// The samples as tensors that require gradients.
    pub fn samples(&self, place: &Place) -> Vec<MovingSample> {
        let count = self.moving.len();
        let sample = |(means, quats): (&Vec<f64>, &Vec<f64>)| MovingSample {
            means: place.leaf(means, [count, 3]),
            quats: place.leaf(quats, [count, 4]),
        };
        self.means.iter().zip(&self.quats).map(sample).collect()
    }

    /// Options with depth.
    pub fn options(&self, linear: bool) -> ExposureOptions {
        ExposureOptions { render: self.scene.options(true), linear, room: None }
    }

    /// The exposure itself.
    pub fn exposure(
        &self,
        leaves: &Leaves,
        samples: &[MovingSample],
        options: &ExposureOptions,
        screen: Option<Tensor<2>>,
    ) -> ExposureRendering {
        let camera = self.scene.camera(leaves.viewmat.clone());
        render_exposure(&leaves.gaussians(), &self.moving, samples, &camera, options, screen)
    }

    /// The scene at one instant.
    pub fn at(&self, leaves: &Leaves, sample: &MovingSample) -> Gaussians {
        let Leaves { means, quats, log_scales, opacity_logits, sh, .. } = leaves.clone();
        let (means, quats) = (self.replaced(means, &sample.means), self.replaced(quats, &sample.quats));
        Gaussians::from_tensors(means, quats, log_scales, opacity_logits, sh)
    }

    fn replaced(&self, all: Tensor<2>, rows: &Tensor<2>) -> Tensor<2> {
        let [count, columns] = all.dims();
        if self.moving.is_empty() {
            return all;
        }
        let mut moves = vec![false; count];
        self.moving.iter().for_each(|&row| moves[row as usize] = true);
        let device = all.clone().inner().device();
        let moves = Tensor::<1, burn::tensor::Bool>::from_data(moves.as_slice(), &device).reshape([count, 1]);
        let numbers: Vec<i32> = self.moving.iter().map(|&row| row as i32).collect();
        let numbers = Tensor::<1, Int>::from_data(numbers.as_slice(), (&device, DType::I32));
        let still = all.mask_fill(moves.expand([count, columns]), 0.0);
        still.select_assign(0, numbers, rows.clone(), IndexingUpdateOp::Add)
    }

    /// One rendering an instant: colour, alpha and depth `[H, W, 5]` each.
    pub fn each(&self, leaves: &Leaves, samples: &[MovingSample], screen: Option<&Tensor<2>>) -> Vec<Tensor<3>> {
        let camera = self.scene.camera(leaves.viewmat.clone());
        let options = RenderOptions { depth: true, ..self.scene.options(true) };
        let one = |sample: &MovingSample| {
            let gaussians = self.at(leaves, sample);
            let extras = Extras { screen: screen.cloned(), ..Extras::default() };
            let rendering = render_with(&gaussians, &camera, &options, extras);
            Tensor::cat(vec![rendering.color, rendering.alpha, rendering.depth.expect("depth was asked for")], 2)
        };
        samples.iter().map(one).collect()
    }

    /// The mean of [`Moving::each`], of the first three channels as light if asked for.
    pub fn mean(&self, each: &[Tensor<3>], linear: bool) -> Tensor<3> {
        let share = 1.0 / each.len() as f64;
        let mean = |of: &dyn Fn(&Tensor<3>) -> Tensor<3>| {
            let parts = each.iter().map(of);
            times(parts.reduce(|sum, part| sum + part).expect("there is a sample"), share)
        };
        let color = |image: &Tensor<3>| image.clone().narrow(2, 0, 3);
        let color = if linear { to_encoded(mean(&|image| to_linear(color(image)))) } else { mean(&color) };
        Tensor::cat(vec![color, mean(&|image| image.clone().narrow(2, 3, 2))], 2)
    }
}

/// Colour, alpha and depth of an exposure, `[H, W, 5]`.
pub fn image(rendering: &ExposureRendering) -> Tensor<3> {
    let depth = rendering.depth.clone().expect("depth was asked for");
    Tensor::cat(vec![rendering.color.clone(), rendering.alpha.clone(), depth], 2)
}

/// `factor x` in the precision of `x`: Burn rounds a number beside a tensor to `f32` on the way back.
fn times(x: Tensor<3>, factor: f64) -> Tensor<3> {
    let (device, dtype) = (x.clone().inner().device(), x.dtype());
    x * Tensor::<3>::from_data([[[factor]]], (&device, dtype)).autodiff()
}

/// The curve of sRGB in tensor operations.
fn to_linear(value: Tensor<3>) -> Tensor<3> {
    let low = value.clone().lower_equal_elem(0.04045);
    // The branch not taken must have a finite gradient too.
    let power = times(times(value.clone().clamp_min(0.04) + 0.055, 1.0 / 1.055).log(), 2.4);
    power.exp().mask_where(low, times(value, 1.0 / 12.92))
}

fn to_encoded(light: Tensor<3>) -> Tensor<3> {
    let low = light.clone().lower_equal_elem(0.0031308);
    let power = times(light.clone().clamp_min(0.003).log(), 1.0 / 2.4);
    (times(power.exp(), 1.055) - 0.055).mask_where(low, times(light, 12.92))
}

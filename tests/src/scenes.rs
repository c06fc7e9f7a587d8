//! Tiny seeded scenes: numbers on the host, and the same numbers as tensors of a device.

use burn::tensor::{Gradients, Tensor};
use gs_base::Intrinsics;
use gs_burn::ops::intersect::intersect;
use gs_burn::ops::projection::{ProjectionConfig, project, project_reference};
use gs_burn::ops::rasterize::{RasterizeConfig, rasterize, rasterize_reference};
use gs_burn::ops::sh::{sh_colors, sh_colors_reference};
use gs_burn::{Camera, Gaussians, RenderOptions, exact_matmul};
use gs_kernels::rows::{PROJECTED, ProjectedRow};

use crate::cutoff::undecided_pixels;
use crate::devices::{Place, reference};
use crate::finite_differences::{Course, assert_course_derivative};
use crate::tolerance::{assert_gradient, values};

#[path = "../../gs-kernels/tests/scenes/mod.rs"]
pub(crate) mod generator;

/// Names of a scene's groups of numbers, in the order of [`Scene::groups`].
pub const GROUPS: [&str; 7] = ["means", "quats", "log_scales", "opacity_logits", "sh", "viewmat", "background"];

/// Numbers per Gaussian of the first five [`GROUPS`], for degree 3.
pub const COLUMNS: [usize; 5] = [3, 4, 3, 1, 48];

/// The pose of a camera at the origin that looks along z, row-major.
pub const IDENTITY: [f64; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

/// Uniform numbers from a seed, the same on every machine.
pub struct Random(generator::Random);

impl Random {
    /// A stream of its own for each seed.
    pub fn new(seed: u64) -> Self {
        Self(generator::Random::new(seed))
    }

    /// One number in `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.unit()
    }

    /// `count` numbers in `low..high` that `f32` holds exactly, so that both precisions get the same input.
    pub fn values(&mut self, count: usize, low: f64, high: f64) -> Vec<f64> {
        (0..count).map(|_| single(self.uniform(low, high))).collect()
    }

    /// Such numbers as a tensor of `place` that requires a gradient.
    pub fn leaf<const D: usize>(&mut self, place: &Place, shape: [usize; D], low: f64, high: f64) -> Tensor<D> {
        place.leaf(&self.values(shape.iter().product(), low, high), shape)
    }
}

fn single(x: f64) -> f64 {
    f64::from(x as f32)
}

/// Gaussians of SH degree 3 and a camera. All numbers are exact in `f32`.
#[derive(Clone, Debug)]
pub struct Scene {
    /// `[N, 3]`
    pub means: Vec<f64>,
    /// `[N, 4]`
    pub quats: Vec<f64>,
    /// `[N, 3]`
    pub log_scales: Vec<f64>,
    /// `[N]`
    pub opacity_logits: Vec<f64>,
    /// `[N, 16, 3]`
    pub sh: Vec<f64>,
    /// `[4, 4]`
    pub viewmat: Vec<f64>,
    /// `[3]`
    pub background: Vec<f64>,
    /// Image size, intrinsics and limits.
    pub config: ProjectionConfig,
}

impl Scene {
    /// `count` Gaussians of all shapes in front of a turned camera of 53 x 37 pixels (no multiple of a tile), with an
    /// off-centre principal point and unequal focal lengths.
    pub fn random(count: usize, seed: u64) -> Self {
        let generated = generator::Scene::<f64>::random(count, seed);
        let rounded = |values: Vec<f64>| values.into_iter().map(single).collect();
        Self {
            means: rounded(generated.means),
            quats: rounded(generated.quats),
            log_scales: rounded(generated.log_scales),
            opacity_logits: rounded(generated.logits),
            sh: rounded(generated.sh),
            viewmat: rounded(generated.viewmat),
            background: vec![0.25, 0.5, 0.75],
            config: generated.config,
        }
    }

    /// The same Gaussians seen by an image of another size, with the same angle of view across.
    pub fn resized(mut self, width: u32, height: u32) -> Self {
        let scale = f64::from(width) / f64::from(self.config.width);
        let ProjectionConfig { fx, fy, cx, .. } = &mut self.config;
        [fx, fy, cx].into_iter().for_each(|x| *x *= scale);
        self.config.cy = 0.52 * f64::from(height);
        (self.config.width, self.config.height) = (width, height);
        self
    }

    /// Needles of 1:1000 at any angle, some across the frustum edge, some across the near plane.
    pub fn needles_and_edges() -> Self {
        let mut scene = Self::random(60, 9);
        for (i, (mean, log_scales)) in scene.means.chunks_mut(3).zip(scene.log_scales.chunks_mut(3)).enumerate() {
            log_scales.copy_from_slice(&[if i % 2 == 0 { 0.25 } else { 1.5 }, -7.0, -6.5]);
            match i % 4 {
                1 => mean[0] = single(mean[2] * 0.75),
                2 => mean[2] = single(0.011 + 0.02 * i as f64),
                _ => {}
            }
        }
        scene
    }

    /// Number of Gaussians.
    pub fn count(&self) -> usize {
        self.opacity_logits.len()
    }

    /// Image size, pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.config.width as usize, self.config.height as usize]
    }

    /// The numbers in the order of [`GROUPS`].
    pub fn groups(&self) -> [&Vec<f64>; 7] {
        let Self { means, quats, log_scales, opacity_logits, sh, viewmat, background, .. } = self;
        [means, quats, log_scales, opacity_logits, sh, viewmat, background]
    }

    /// The numbers for writing, in the order of [`GROUPS`].
    pub fn groups_mut(&mut self) -> [&mut Vec<f64>; 7] {
        let Self { means, quats, log_scales, opacity_logits, sh, viewmat, background, .. } = self;
        [means, quats, log_scales, opacity_logits, sh, viewmat, background]
    }

    /// The scene without Gaussian `index`.
    pub fn without(mut self, index: usize) -> Self {
        for (group, columns) in self.groups_mut().into_iter().zip(COLUMNS) {
            group.drain(index * columns..(index + 1) * columns);
        }
        self
    }

    /// The scene as tensors that require gradients.
    pub fn leaves(&self, place: &Place) -> Leaves {
        let count = self.count();
        Leaves {
            means: place.leaf(&self.means, [count, 3]),
            quats: place.leaf(&self.quats, [count, 4]),
            log_scales: place.leaf(&self.log_scales, [count, 3]),
            opacity_logits: place.leaf(&self.opacity_logits, [count]),
            sh: place.leaf(&self.sh, [count, 16, 3]),
            viewmat: place.leaf(&self.viewmat, [4, 4]),
            background: place.leaf(&self.background, [3]),
        }
    }

    /// The camera with a given pose.
    pub fn camera(&self, viewmat: Tensor<2>) -> Camera {
        let ProjectionConfig { fx, fy, cx, cy, .. } = self.config;
        let [width, height] = self.size();
        Camera { viewmat, intrinsics: Intrinsics { fx, fy, cx, cy }, width, height }
    }

    /// Options of `render` for this scene.
    pub fn options(&self, depth: bool) -> RenderOptions {
        let ProjectionConfig { near, far, eps2d, antialiased, .. } = self.config;
        let background = std::array::from_fn(|c| self.background[c] as f32);
        RenderOptions { sh_degree: 3, background, near, far, eps2d, antialiased, depth, beyond: [0; 2] }
    }

    /// Projected rows `[N, 8]` of the reference in `f64`.
    pub fn reference_rows(&self) -> Vec<f64> {
        let Leaves { means, quats, log_scales, viewmat, .. } = self.leaves(reference());
        values(&project_reference(means, quats, log_scales, viewmat, &self.config))
    }

    /// Opacities `[N]`.
    pub fn opacities(&self) -> Vec<f64> {
        self.opacity_logits.iter().map(|x| 1.0 / (1.0 + (-x).exp())).collect()
    }

    /// Asserts that the gradient of `f` by each of the groups `by` is its derivative, see [`assert_course_derivative`].
    #[track_caller]
    pub fn assert_derivatives(
        &self,
        what: &str,
        course: Course,
        place: &Place,
        by: &[usize],
        samples: usize,
        f: impl Fn(&Leaves) -> Tensor<1>,
    ) {
        let leaves = self.leaves(place);
        let gradients = leaves.gradients(&f(&leaves).backward());
        for &k in by {
            let what = format!("{}, {what} on {}", GROUPS[k], place.name);
            assert_course_derivative(&what, course, self.groups()[k], &gradients[k], samples, |x| {
                let mut moved = self.clone();
                moved.groups_mut()[k].copy_from_slice(x);
                values(&f(&moved.leaves(place)))[0]
            });
        }
    }

    /// Pixels at a cut-off, at most a `share` of all, see [`crate::cutoff`].
    #[track_caller]
    pub fn undecided(&self, share: f64) -> Vec<bool> {
        let rows = self.reference_rows();
        let compensated =
            self.opacities().iter().enumerate().map(|(i, o)| o * compensation_of(&rows, i)).collect::<Vec<_>>();
        undecided_pixels(&rows, &compensated, self.size(), share)
    }
}

fn compensation_of(rows: &[f64], index: usize) -> f64 {
    ProjectedRow::read(rows, index).compensation
}

/// The bodies of the ops that compute an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The accelerated kernels.
    Kernels,
    /// The reference in tensor operations.
    Reference,
}

/// A [`Scene`] as tensors of one place.
#[derive(Clone, Debug)]
pub struct Leaves {
    /// `[N, 3]`
    pub means: Tensor<2>,
    /// `[N, 4]`
    pub quats: Tensor<2>,
    /// `[N, 3]`
    pub log_scales: Tensor<2>,
    /// `[N]`
    pub opacity_logits: Tensor<1>,
    /// `[N, 16, 3]`
    pub sh: Tensor<3>,
    /// `[4, 4]`
    pub viewmat: Tensor<2>,
    /// `[3]`
    pub background: Tensor<1>,
}

impl Leaves {
    /// As the module that `render` takes.
    pub fn gaussians(&self) -> Gaussians {
        let Self { means, quats, log_scales, opacity_logits, sh, .. } = self.clone();
        Gaussians::from_tensors(means, quats, log_scales, opacity_logits, sh)
    }

    /// The image `[H, W, 3 + depth + 1]` of `scene` from the ops one by one, so that either reading can be had, and the
    /// background's gradient too. The kernels' reading is what `render` does.
    pub fn compose(&self, scene: &Scene, depth: bool, reading: Reading) -> Tensor<3> {
        let Self { means, quats, log_scales, sh, viewmat, background, .. } = self.clone();
        let [width, height] = scene.size();
        let image = RasterizeConfig { width: width as u32, height: height as u32, channels: 3, depth };
        let kernels = reading == Reading::Kernels;
        let project = if kernels { project } else { project_reference };
        let colors = if kernels { sh_colors } else { sh_colors_reference };
        let rows = project(means.clone(), quats, log_scales, viewmat.clone(), &scene.config);
        let features = colors(means, sh, viewmat, rows.clone(), 3);
        let opacities = self.gaussians().opacities() * compensations(rows.clone());
        if kernels {
            let lists = intersect(rows.clone(), opacities.clone(), features.clone(), width, height);
            rasterize(rows, opacities, features, background, None, &lists, &image)
        } else {
            rasterize_reference(rows, opacities, features, background, None, &image)
        }
    }

    /// Gradients on the host in the order of [`GROUPS`]; zeros for a group that `gradients` does not hold.
    pub fn gradients(&self, gradients: &Gradients) -> [Vec<f64>; 7] {
        fn take<const D: usize>(leaf: &Tensor<D>, gradients: &Gradients) -> Vec<f64> {
            let Some(gradient) = leaf.grad(gradients) else { return vec![0.0; leaf.dims().iter().product()] };
            assert_eq!(gradient.dims(), leaf.dims(), "shape of a gradient");
            values(&gradient)
        }
        [
            take(&self.means, gradients),
            take(&self.quats, gradients),
            take(&self.log_scales, gradients),
            take(&self.opacity_logits, gradients),
            take(&self.sh, gradients),
            take(&self.viewmat, gradients),
            take(&self.background, gradients),
        ]
    }
}

/// Asserts that the gradients by the groups `by` are the expected ones, see [`assert_gradient`].
#[track_caller]
pub fn assert_gradients(what: &str, by: &[usize], actual: &[Vec<f64>; 7], expected: &[Vec<f64>; 7], bound: f64) {
    for &k in by {
        assert_gradient(&format!("{}, {what}", GROUPS[k]), &actual[k], &expected[k], bound);
    }
}

/// The opacity factors `[N]` of projected rows.
fn compensations(rows: Tensor<2>) -> Tensor<1> {
    let nothing = ProjectedRow { mean: [0.0; 2], conic: [0.0; 3], depth: 0.0, compensation: 0.0, radius: 0.0 };
    let selector = ProjectedRow { compensation: 1.0, ..nothing }.pack();
    let selector = Tensor::<1>::from_data(selector, (&rows.device(), rows.dtype())).reshape([PROJECTED, 1]);
    exact_matmul(rows, selector).squeeze_dim(1)
}

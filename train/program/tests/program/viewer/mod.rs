//! The viewer's page against the rasterizer, in headless Chromium with software GL, and everything of it that needs no
//! browser.
//!
//! Where there is no Chromium, the comparisons say so and pass.

mod browser;
mod controls;
mod fallbacks;
mod motion;
mod pages;

use burn::tensor::{Tensor, TensorData};
use gs_base::Intrinsics;
use gs_burn::{Camera, Gaussians, RenderOptions, render};
use gs_models::{DynamicScene, Static};
use gs_train::run::presentation::{self, Presentation};
use gsburn::report::viewer;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::device;
use browser::{agrees, bytes, pictures};

/// Size of the pictures: software GL draws some frames a second of them.
const SIZE: [usize; 2] = [256, 192];

/// A photo of one grey pixel.
const PHOTO: &str = "data:image/gif;base64,R0lGODlhAQABAIAAAICAgAAAACH5BAAAAAAALAAAAAABAAEAAAICRAEAOw==";

struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn numbers(&mut self, count: usize, [low, high]: [f32; 2]) -> Vec<f32> {
        (0..count).map(|_| self.0.random_range(low..high)).collect()
    }

    fn table(&mut self, rows: usize, columns: usize, range: [f32; 2]) -> Tensor<2> {
        Tensor::from_data(TensorData::new(self.numbers(rows * columns, range), [rows, columns]), &device())
    }
}

/// Overlapping Gaussians of all shapes before the camera of [`pose`].
fn cloud(count: usize, degree: usize, seed: u64) -> Gaussians {
    let mut draw = Draw::new(seed);
    let coefficients = (degree + 1) * (degree + 1);
    let mut sh = draw.numbers(3 * coefficients * count, [-0.3, 0.3]);
    for row in sh.chunks_exact_mut(3 * coefficients) {
        row[..3].iter_mut().for_each(|value| *value *= 5.0);
    }
    let means = draw.table(count, 3, [-1.2, 1.2]);
    let quats = draw.table(count, 4, [-1.0, 1.0]);
    let log_scales = draw.table(count, 3, [-4.0, -1.5]);
    let logits = Tensor::from_data(TensorData::new(draw.numbers(count, [-2.0, 4.0]), [count]), &device());
    let sh = Tensor::from_data(TensorData::new(sh, [count, coefficients, 3]), &device());
    Gaussians::from_tensors(means, quats, log_scales, logits, sh)
}

fn pose() -> glam::DMat4 {
    let turn = glam::DMat4::from_rotation_y(0.2) * glam::DMat4::from_rotation_z(0.1);
    glam::DMat4::from_translation(glam::DVec3::new(-0.5, -0.1, -3.0)) * turn
}

const INTRINSICS: Intrinsics = Intrinsics { fx: 260.0, fy: 255.0, cx: 125.0, cy: 99.0 };

fn camera() -> Camera {
    Camera::from_c2w(pose(), INTRINSICS, SIZE[0], SIZE[1], &device())
}

/// The picture of a scene at a time.
fn bytes_of(scene: &dyn DynamicScene, t: f64) -> Vec<u8> {
    bytes(render(&scene.at(t), &camera(), &options()).color)
}

fn options() -> RenderOptions {
    RenderOptions { background: [0.1, 0.2, 0.3], ..RenderOptions::default() }
}

fn viewed(name: &str) -> Presentation {
    let Intrinsics { fx, fy, cx, cy } = INTRINSICS;
    let camera = presentation::Camera {
        name: name.into(),
        split: "held out".into(),
        time: None,
        c2w: pose().to_cols_array(),
        k: [fx, fy, cx, cy],
        size: SIZE,
        photo: None,
    };
    let (middle, distance) = (0.0, Some(3.0));
    let (cameras, world) = (vec![camera], glam::DMat4::IDENTITY);
    Presentation { name: name.into(), options: options(), middle, cameras, distance, shutter: None, world }
}

#[test]
fn colours_of_every_degree_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    for degree in 0..=3 {
        let scene = Static::new(cloud(300, degree, degree as u64));
        let mut viewed = viewed("cloud");
        viewed.options.antialiased = degree == 2;
        let page = folder.path().join("page.html");
        std::fs::write(&page, viewer::page("cloud", &viewer::packed(&scene, &viewed))).expect("written");
        let Some(drawn) = pictures(&page, "0@0") else { return };
        let truth = bytes(render(&scene.gaussians, &camera(), &viewed.options).color);
        agrees(&format!("SH {degree}"), &drawn[0], &truth);
    }
}

//! A step of this pipeline for `gsburn bench`: a scene of which some Gaussians move, seen by one blurry photo.

use burn::module::Param;
use gs_burn::{Camera, Gaussians};
use gs_models::Pixels;
use gs_models::taylormode::{BodyFrame, MotionFrame, TimeWindow};
use rand::Rng;

use super::begin::networks;
use super::config::BlurMode;
use super::extra::ComparedPixels;
use super::model::Units;
use super::{PhotoPriors, Taylormode};
use gs_train::fit::bench::{Steps, photo_of, steps};
use gs_train::fit::intake::Intake;
use gs_train::fit::parameters::from_host;
use gs_train::fit::random::{Purpose, stream};
use gs_train::fit::trainer::Model;

/// One of so many Gaussians moves; of 100,000, 4,167, about as many as a run begins with.
const MOVING: usize = 24;

/// Largest displacement along an axis by each order from the middle of the recording to its end, scene units.
const DISPLACEMENT: f32 = 0.5;

/// The exposure, of a recording from -1 to 1: with [`DISPLACEMENT`] a blur of some pixels.
const EXPOSURE: f64 = 0.05;

/// Centre and root mean square extent of the scene of the benchmark, scene units.
const OBJECT: ([f64; 3], f64) = ([0.0, 0.0, 6.0], 3.0);

/// Steps with the exact formation of blur.
pub fn integrate(gaussians: Gaussians, camera: &Camera) -> Steps {
    with_blur(gaussians, camera, BlurMode::Integrate)
}

/// Steps with the paper's formation.
pub fn warp(gaussians: Gaussians, camera: &Camera) -> Steps {
    with_blur(gaussians, camera, BlurMode::Warp)
}

/// The photo has a mask of moving pixels, the middle half of its columns, and no other prior: the depth prior of a data
/// set is aligned on the host, whose work is not listed here.
fn with_blur(gaussians: Gaussians, camera: &Camera, mode: BlurMode) -> Steps {
    let device = gaussians.device();
    let mut config = Taylormode::defaults();
    config.method.blur.mode = mode;
    let motion = &config.method.motion;
    let rows: Vec<u32> = (0..gaussians.len() as u32).step_by(MOVING).collect();
    let window = TimeWindow { t0: 0.0, half: 1.0 };
    let mut frame = MotionFrame::new(rows, motion.order_max, motion.rotation_order, window);
    frame.bodies = vec![BodyFrame { order: motion.order_max as u8, ..BodyFrame::new(OBJECT.0, OBJECT.1) }];
    frame.body_of.fill(0);
    let mut rng = stream(0, Purpose::Bench, 1);
    let mut blocks = |orders: usize| {
        let values = (0..frame.rows.len() * 3 * orders).map(|_| rng.random_range(-DISPLACEMENT..DISPLACEMENT));
        Param::from_tensor(from_host(values.collect(), 3 * orders, &device))
    };
    let networks = (networks(&config), Units::new(1.0, window.half));
    let mut method = Taylormode::new(&frame, EXPOSURE, networks, config.seed, &device);
    method.motion.position = blocks(motion.order_max);
    method.motion.rotation = blocks(motion.rotation_order);

    let (width, height) = (camera.width, camera.height);
    let mask: Vec<u8> =
        (0..width * height).map(|pixel| u8::from((width / 4..3 * width / 4).contains(&(pixel % width)))).collect();
    let values = mask.iter().map(|moves| f32::from(*moves)).collect();
    let compared = Pixels::masked(&mask, width, height, &device);
    let extra = PhotoPriors {
        moving: Some(from_host(values, 1, &device).reshape([height, width, 1])),
        compared: compared.map_or(ComparedPixels::None, ComparedPixels::Some),
        ..PhotoPriors::default()
    };
    let photo = photo_of(&gaussians, camera, extra);
    steps(Model::uncorrected(gaussians, method), photo, config)
}

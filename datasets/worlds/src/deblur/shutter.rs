//! Exposures: what one static camera records of the stage over time, with the truth behind every pixel.
//!
//! A blurry pixel is the mean, in linear light, of what one ray per sub-frame meets; the rays of successive sub-frames
//! take the [`SIDE`]^2 positions inside the pixel in turn, and with each a share of the lamp, so that the sub-frames smooth
//! edges, textures and half shadows for free. A sharp pixel is the mean over all these positions at one instant.
//! Where no moving object covers or shades any of them, both are the mean
//! of what the rays meet without moving objects, computed once for all frames: blurry and sharp images are then equal to the bit.

use glam::DVec3;
use rayon::prelude::*;

use super::super::shapes::Ray;
use super::super::tracer::camera::Camera;
use super::super::tracer::motion::Twist;
use super::super::tracer::stage::{Lit, Placed, Stage, StaticPoint};
use gs_datasets::light::to_byte;

/// Rays along each side of a pixel.
const SIDE: usize = 4;

/// The order in which sub-frames take the positions in a pixel (Bayer's 4 x 4 matrix): any few in a row are spread out.
const ORDER: [usize; SIDE * SIDE] = [0, 10, 2, 8, 5, 15, 7, 13, 1, 11, 3, 9, 4, 14, 6, 12];

/// Samples of the shorter exposure that a pseudo-sharp image is made from.
const PARTLY_SAMPLES: usize = 8;

/// Poses of the moving objects for one frame.
pub(super) struct ExposurePoses {
    /// The exposure's centre.
    centre: Vec<Placed>,
    twists: Vec<Twist>,
    /// The moving objects at every sub-frame.
    open: Vec<Vec<Placed>>,
    /// The moving objects at instants of the shorter exposure; empty when it has no duration.
    partly: Vec<Vec<Placed>>,
    /// Per moving object a ball that holds it throughout the exposure.
    reach: Vec<(DVec3, f64)>,
}

/// The images of one frame, row by row from the top left.
#[derive(Debug, Default)]
pub(super) struct Shot {
    /// `[height, width, 3]`, encoded.
    pub blurry: Vec<u8>,
    /// `[height, width, 3]`, encoded: the exposure's centre.
    pub sharp: Vec<u8>,
    /// `[height, width, 3]`, encoded: the shorter exposure; equal to `sharp` when that has no duration.
    pub partly: Vec<u8>,
    /// `[height, width]`, camera z through the pixel's centre at the exposure's centre, metres.
    pub depth: Vec<f32>,
    /// X, Y and Z, each `[height, width]`, metres per unit of time, world axes, likewise.
    pub velocity: [Vec<f32>; 3],
    /// `[height, width]`, 255 where a moving object is seen, likewise.
    pub moving: Vec<u8>,
    /// `[height, width]`, 255 where a moving object is seen at any time of the exposure.
    pub moving_union: Vec<u8>,
}

/// One pixel of a [`Shot`].
#[derive(Clone, Copy)]
struct Pixel {
    blurry: [u8; 3],
    sharp: [u8; 3],
    partly: [u8; 3],
    depth: f32,
    velocity: [f32; 3],
    is_moving: bool,
    is_touched: bool,
}

/// The middles of `count` even parts of an exposure around `centre`.
pub(super) fn instants(centre: f64, exposure: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| centre + exposure * ((k as f64 + 0.5) / count as f64 - 0.5))
}

impl ExposurePoses {
    /// A frame at `time`. `partly` is the share of the exposure that the pseudo-sharp image keeps.
    pub fn new(stage: &Stage, time: f64, exposure: f64, subframes: usize, partly: f64) -> Self {
        let placed = |exposure: f64, count: usize| instants(time, exposure, count).map(|t| stage.placed(t)).collect();
        let open: Vec<Vec<Placed>> = placed(exposure, subframes);
        let centre = stage.placed(time);
        let reach = stage
            .objects
            .iter()
            .enumerate()
            .map(|(i, object)| {
                let middle = centre[i].pose.position;
                let way = open.iter().map(|objects| objects[i].pose.position.distance(middle)).fold(0.0, f64::max);
                (middle, object.solid.radius + way)
            })
            .collect();
        let partly = if partly > 0.0 { placed(exposure * partly, PARTLY_SAMPLES) } else { Vec::new() };
        let twists = stage.objects.iter().map(|object| object.motion.twist(time)).collect();
        Self { centre, twists, open, partly, reach }
    }
}

/// Photographs all moments with one camera, rows in parallel. What does not move is traced once.
pub(super) fn photograph(stage: &Stage, camera: &Camera, exposures: &[ExposurePoses]) -> Vec<Shot> {
    let rows: Vec<Vec<Pixel>> = (0..camera.height).into_par_iter().map(|y| row(stage, camera, exposures, y)).collect();
    exposures.iter().enumerate().map(|(index, _)| gather(&rows, index, camera)).collect()
}

/// One row of all moments, `[moments, width]`.
fn row(stage: &Stage, camera: &Camera, exposures: &[ExposurePoses], y: usize) -> Vec<Pixel> {
    let mut pixels = Vec::with_capacity(exposures.len() * camera.width);
    let still: Vec<PixelStill> = (0..camera.width).map(|x| PixelStill::new(stage, camera, x, y)).collect();
    for exposure in exposures {
        pixels.extend(still.iter().map(|still| still.expose(stage, camera, exposure)));
    }
    pixels
}

/// The rays of a pixel and what they meet without moving objects.
struct PixelStill {
    /// In [`ORDER`], then the one through the centre.
    samples: [(Ray, StaticPoint); SIDE * SIDE + 1],
    color: [u8; 3],
}

impl PixelStill {
    fn new(stage: &Stage, camera: &Camera, x: usize, y: usize) -> Self {
        let samples = std::array::from_fn(|i| {
            let position = |sub: usize| (sub as f64 + 0.5) / SIDE as f64;
            let (u, v) = match ORDER.get(i) {
                Some(order) => (position(order % SIDE), position(order / SIDE)),
                None => (0.5, 0.5),
            };
            let ray = camera.ray(x as f64 + u, y as f64 + v);
            (ray, stage.still(&ray, Lit::share(i)))
        });
        let mut still = Self { samples, color: [0; 3] };
        still.color = encode(still.samples[..SIDE * SIDE].iter().map(|(_, point)| point.color));
        still
    }

    fn expose(&self, stage: &Stage, camera: &Camera, exposure: &ExposurePoses) -> Pixel {
        let (ray, point) = &self.samples[SIDE * SIDE];
        let depth = camera.depth(ray, point.t) as f32;
        let mut pixel = Pixel {
            blurry: self.color,
            sharp: self.color,
            partly: self.color,
            depth,
            velocity: [0.0; 3],
            is_moving: false,
            is_touched: false,
        };
        let may_touch = |(ray, point): &(Ray, StaticPoint)| {
            exposure.reach.iter().any(|(centre, radius)| stage.may_touch(ray, point, *centre, *radius))
        };
        if !self.samples.iter().any(may_touch) {
            return pixel;
        }
        let centre = stage.sample(ray, point, &exposure.centre);
        if let Some((object, t)) = centre.object {
            let velocity = exposure.twists[object].at(ray.at(t), &exposure.centre[object].pose);
            pixel.depth = camera.depth(ray, t) as f32;
            pixel.velocity = velocity.as_vec3().to_array();
            pixel.is_moving = true;
        }
        let mut is_touched = pixel.is_moving;
        let mut look = |i: usize, objects: &[Placed]| {
            let (ray, point) = &self.samples[i % (SIDE * SIDE)];
            let sample = stage.sample(ray, point, objects);
            is_touched |= sample.object.is_some();
            sample.color
        };
        pixel.blurry = encode(exposure.open.iter().enumerate().map(|(k, objects)| look(k, objects)));
        pixel.sharp = encode((0..SIDE * SIDE).map(|i| look(i, &exposure.centre)));
        pixel.partly = match exposure.partly.is_empty() {
            true => pixel.sharp,
            false => encode(exposure.partly.iter().enumerate().map(|(k, objects)| look(k, objects))),
        };
        pixel.is_touched = is_touched;
        pixel
    }
}

/// The mean of linear colours, encoded.
fn encode(colors: impl ExactSizeIterator<Item = DVec3>) -> [u8; 3] {
    let count = colors.len() as f64;
    (colors.sum::<DVec3>() / count).as_vec3().to_array().map(to_byte)
}

fn gather(rows: &[Vec<Pixel>], exposure: usize, camera: &Camera) -> Shot {
    let mut shot = Shot::default();
    for pixel in rows.iter().flat_map(|row| &row[exposure * camera.width..][..camera.width]) {
        shot.blurry.extend(pixel.blurry);
        shot.sharp.extend(pixel.sharp);
        shot.partly.extend(pixel.partly);
        shot.depth.push(pixel.depth);
        for (channel, value) in shot.velocity.iter_mut().zip(pixel.velocity) {
            channel.push(value);
        }
        shot.moving.push(if pixel.is_moving { 255 } else { 0 });
        shot.moving_union.push(if pixel.is_touched { 255 } else { 0 });
    }
    shot
}

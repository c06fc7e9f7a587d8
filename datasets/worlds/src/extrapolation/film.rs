//! Sharp images of a static camera at many times, with transparency and the truth behind every pixel.
//!
//! A pixel is the mean, in linear light, of [`SIDE`]^2 rays. Its alpha is the share of them that meet anything, and its colour the mean
//! of these alone (straight alpha), encoded. Where no moving object covers or shades any ray, the pixel is worked out once for all times.

use glam::DVec3;
use rayon::prelude::*;

use super::super::shapes::Ray;
use super::super::tracer::camera::Camera;
use super::super::tracer::motion::Twist;
use super::super::tracer::stage::{Lit, Placed, Stage, StaticPoint};
use gs_datasets::light::to_byte;

/// Rays along each side of a pixel.
const SIDE: usize = 4;

/// Rays of a pixel, and one more through its centre for the truth.
const RAYS: usize = SIDE * SIDE;

/// The moving objects at one time.
pub(super) struct Moment {
    placed: Vec<Placed>,
    twists: Vec<Twist>,
}

impl Moment {
    pub fn new(stage: &Stage, time: f64) -> Self {
        let twists = stage.objects.iter().map(|object| object.motion.twist(time)).collect();
        Self { placed: stage.placed(time), twists }
    }
}

/// One frame, row by row from the top left.
#[derive(Debug, Default)]
pub(super) struct Shot {
    /// `[height, width, 4]`, encoded colour and straight alpha; of a room `[height, width, 3]`.
    pub image: Vec<u8>,
    /// `[height, width, 3]`, encoded colour without alpha.
    pub color: Vec<[u8; 3]>,
    /// `[height, width]`, camera z through the pixel's centre, metres; 0 where nothing is met.
    pub depth: Vec<f32>,
    /// X, Y and Z, each `[height, width]`, metres per unit of time, world axes, likewise.
    pub velocity: [Vec<f32>; 3],
    /// `[height, width]`, 255 where a moving object is seen through the pixel's centre.
    pub moving: Vec<u8>,
}

/// One pixel of a [`Shot`].
#[derive(Clone, Copy)]
struct Pixel {
    color: [u8; 3],
    alpha: u8,
    depth: f32,
    velocity: [f32; 3],
    is_moving: bool,
}

/// Films all moments with one camera, rows in parallel. Without `is_opaque` images have an alpha channel.
pub(super) fn film(stage: &Stage, camera: &Camera, moments: &[Moment], is_opaque: bool) -> Vec<Shot> {
    let rows: Vec<Vec<Pixel>> = (0..camera.height).into_par_iter().map(|y| row(stage, camera, moments, y)).collect();
    (0..moments.len()).into_par_iter().map(|index| gather(&rows, index, camera.width, is_opaque)).collect()
}

/// One row at all moments, `[moments, width]`.
fn row(stage: &Stage, camera: &Camera, moments: &[Moment], y: usize) -> Vec<Pixel> {
    let mut pixels = Vec::with_capacity(moments.len() * camera.width);
    let still: Vec<PixelStill> = (0..camera.width).map(|x| PixelStill::new(stage, camera, x, y)).collect();
    for moment in moments {
        pixels.extend(still.iter().map(|still| still.at(stage, camera, moment)));
    }
    pixels
}

/// The rays of a pixel and what they meet without moving objects.
struct PixelStill {
    /// The last goes through the pixel's centre.
    samples: [(Ray, StaticPoint); RAYS + 1],
    pixel: Pixel,
}

impl PixelStill {
    fn new(stage: &Stage, camera: &Camera, x: usize, y: usize) -> Self {
        let position = |sub: usize| (sub as f64 + 0.5) / SIDE as f64;
        let samples = std::array::from_fn(|i| {
            let (u, v) = if i < RAYS { (position(i % SIDE), position(i / SIDE)) } else { (0.5, 0.5) };
            let ray = camera.ray(x as f64 + u, y as f64 + v);
            // Diagonals of the pixel share a part of the lamp.
            (ray, stage.still(&ray, Lit::share(i + i / SIDE)))
        });
        let (ray, point) = &samples[RAYS];
        let depth = camera.depth(ray, point.t) as f32;
        let met = samples[..RAYS].iter().map(|(_, point)| point.t.is_finite().then_some(point.color));
        let (color, alpha) = mean(met);
        Self { samples, pixel: Pixel { color, alpha, depth, velocity: [0.0; 3], is_moving: false } }
    }

    fn at(&self, stage: &Stage, camera: &Camera, moment: &Moment) -> Pixel {
        let may_touch = |(ray, point): &(Ray, StaticPoint)| {
            stage.objects.iter().zip(&moment.placed).any(|(object, placed)| {
                let (centre, radius) = (placed.pose.position, object.solid.radius);
                // Nothing is shaded where nothing is met.
                let may_shade = point.t.is_finite();
                if may_shade { stage.may_touch(ray, point, centre, radius) } else { may_cover(ray, centre, radius) }
            })
        };
        if !self.samples.iter().any(may_touch) {
            return self.pixel;
        }
        let mut pixel = self.pixel;
        let (ray, point) = &self.samples[RAYS];
        if let Some((object, t)) = stage.sample(ray, point, &moment.placed).object {
            let velocity = moment.twists[object].at(ray.at(t), &moment.placed[object].pose);
            pixel.depth = camera.depth(ray, t) as f32;
            pixel.velocity = velocity.as_vec3().to_array();
            pixel.is_moving = true;
        }
        let met = self.samples[..RAYS].iter().map(|(ray, point)| {
            let sample = stage.sample(ray, point, &moment.placed);
            (sample.object.is_some() || point.t.is_finite()).then_some(sample.color)
        });
        (pixel.color, pixel.alpha) = mean(met);
        pixel
    }
}

/// Whether a ball is in the way of a ray that meets nothing else.
fn may_cover(ray: &Ray, centre: DVec3, radius: f64) -> bool {
    let ahead = (centre - ray.origin).dot(ray.direction).max(0.0);
    ray.at(ahead).distance_squared(centre) <= radius * radius
}

/// The mean of the linear colours that rays meet, encoded, and the share of rays that meet one, 0 to 255.
fn mean(colors: impl ExactSizeIterator<Item = Option<DVec3>>) -> ([u8; 3], u8) {
    let count = colors.len();
    let (mut sum, mut met) = (DVec3::ZERO, 0);
    for color in colors.flatten() {
        sum += color;
        met += 1;
    }
    if met == 0 {
        return ([0; 3], 0);
    }
    let alpha = (255 * met + count / 2) / count;
    ((sum / met as f64).as_vec3().to_array().map(to_byte), alpha as u8)
}

fn gather(rows: &[Vec<Pixel>], moment: usize, width: usize, is_opaque: bool) -> Shot {
    let mut shot = Shot::default();
    for pixel in rows.iter().flat_map(|row| &row[moment * width..][..width]) {
        shot.image.extend(pixel.color);
        if !is_opaque {
            shot.image.push(pixel.alpha);
        }
        shot.color.push(pixel.color);
        shot.depth.push(pixel.depth);
        for (channel, value) in shot.velocity.iter_mut().zip(pixel.velocity) {
            channel.push(value);
        }
        shot.moving.push(if pixel.is_moving { 255 } else { 0 });
    }
    shot
}

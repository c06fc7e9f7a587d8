//! Static cameras that film a scene over time, with the truth behind every pixel.
//!
//! A sharp pixel is the mean, in linear light, of [`RAYS`] rays at one instant. Its alpha is the share of them that
//! meet anything or a sky, and its colour the mean of these alone (straight alpha), encoded. A blurry pixel is the mean
//! of one ray per sub-frame; the rays of successive sub-frames take the positions inside the pixel in turn, and with
//! each a share of the lamp, so that the sub-frames smooth edges, textures and half shadows for free. Where no moving
//! body covers or shades any of the rays, both are the mean of the points that the rays meet without moving bodies,
//! computed once for all frames: blurry and sharp images are then equal to the bit.

use glam::DVec3;
use gs_datasets::light::to_byte;
use rayon::prelude::*;

use crate::tracer::camera::Camera;
use crate::tracer::motion::Twist;
use crate::tracer::scene::{Lit, Placed, Scene, StaticPoint};
use crate::tracer::shape::Ray;

/// Rays along each side of a pixel.
const SIDE: usize = 4;

/// Rays of a pixel, and one more through its centre for the truth.
const RAYS: usize = SIDE * SIDE;

/// Bayer's 4 x 4 matrix: any few positions in a row are spread out.
const BAYER: [usize; RAYS] = [0, 10, 2, 8, 5, 15, 7, 13, 1, 11, 3, 9, 4, 14, 6, 12];

/// Samples of the shorter exposure that a pseudo-sharp image is made from.
const PARTLY_SAMPLES: usize = 8;

/// The order in which the rays of a pixel take its positions and the shares of the lamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// Positions by Bayer's matrix, so that the first few sub-frames of an exposure are spread out.
    Bayer,
    /// Row by row; diagonals of the pixel have a share of the lamp in common.
    Rows,
}

impl Order {
    /// The position in the pixel of ray `index`, and the number of its share of the lamp.
    fn ray(self, index: usize) -> (usize, usize) {
        match self {
            Self::Bayer => (BAYER[index], index),
            Self::Rows => (index, index + index / SIDE),
        }
    }
}

/// Poses of the moving bodies for one frame.
pub(crate) struct Exposure {
    /// The exposure's centre.
    centre: Vec<Placed>,
    twists: Vec<Twist>,
    /// The moving bodies at every sub-frame; none of a frame that is sharp alone.
    open: Vec<Vec<Placed>>,
    /// The moving bodies at instants of the shorter exposure; none when it has no duration.
    partly: Vec<Vec<Placed>>,
    /// Per moving body a ball that holds it throughout the exposure.
    reach: Vec<(DVec3, f64)>,
}

/// The images of one frame, row by row from the top left.
#[derive(Debug, Default)]
pub(crate) struct Shot {
    /// `[height, width, 3]`, encoded: the exposure's centre.
    pub sharp: Vec<u8>,
    /// `[height, width]`, the share of a sharp pixel's rays that meet anything.
    pub alpha: Vec<u8>,
    /// `[height, width, 3]`, encoded; equal to `sharp` without sub-frames.
    pub blurry: Vec<u8>,
    /// `[height, width, 3]`, encoded: the shorter exposure; equal to `sharp` when that has no duration.
    pub partly: Vec<u8>,
    /// `[height, width]`, camera z through the pixel's centre at the exposure's centre, metres; 0 where nothing is met.
    pub depth: Vec<f32>,
    /// X, Y and Z, each `[height, width]`, metres per unit of time, world axes, likewise.
    pub velocity: [Vec<f32>; 3],
    /// `[height, width]`, 255 where a moving body is seen, likewise.
    pub moving: Vec<u8>,
    /// `[height, width]`, 255 where a moving body is seen at any time of the exposure.
    pub moving_union: Vec<u8>,
}

impl Shot {
    /// `[height, width, 4]`, the sharp image with its alpha.
    pub fn rgba(&self) -> Vec<u8> {
        self.sharp.chunks_exact(3).zip(&self.alpha).flat_map(|(rgb, alpha)| [rgb[0], rgb[1], rgb[2], *alpha]).collect()
    }

    fn push(&mut self, pixel: &Pixel) {
        self.sharp.extend(pixel.sharp);
        self.alpha.push(pixel.alpha);
        self.blurry.extend(pixel.blurry);
        self.partly.extend(pixel.partly);
        self.depth.push(pixel.depth);
        for (channel, value) in self.velocity.iter_mut().zip(pixel.velocity) {
            channel.push(value);
        }
        self.moving.push(if pixel.is_moving { 255 } else { 0 });
        self.moving_union.push(if pixel.is_touched { 255 } else { 0 });
    }
}

/// One pixel of a [`Shot`].
#[derive(Clone, Copy)]
struct Pixel {
    sharp: [u8; 3],
    alpha: u8,
    blurry: [u8; 3],
    partly: [u8; 3],
    depth: f32,
    velocity: [f32; 3],
    is_moving: bool,
    is_touched: bool,
}

/// The middles of `count` even parts of an exposure around `centre`.
pub(crate) fn instants(centre: f64, exposure: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| centre + exposure * ((k as f64 + 0.5) / count as f64 - 0.5))
}

impl Exposure {
    /// A frame at `time`. `partly` is the share of the exposure that the pseudo-sharp image keeps.
    pub fn new(scene: &Scene, time: f64, exposure: f64, subframes: usize, partly: f64) -> Self {
        let placed = |exposure: f64, count: usize| instants(time, exposure, count).map(|t| scene.placed(t)).collect();
        let open: Vec<Vec<Placed>> = placed(exposure, subframes);
        let centre = scene.placed(time);
        let reach = scene
            .moving
            .iter()
            .enumerate()
            .map(|(i, body)| {
                let middle = centre[i].pose.position;
                let way = open.iter().map(|bodies| bodies[i].pose.position.distance(middle)).fold(0.0, f64::max);
                (middle, body.solid.radius + way)
            })
            .collect();
        let partly = if partly > 0.0 { placed(exposure * partly, PARTLY_SAMPLES) } else { Vec::new() };
        let twists = scene.moving.iter().map(|body| body.motion.twist(time)).collect();
        Self { centre, twists, open, partly, reach }
    }

    /// A sharp frame at `time`.
    pub fn instant(scene: &Scene, time: f64) -> Self {
        Self::new(scene, time, 0.0, 0, 0.0)
    }
}

/// Films all exposures with one camera, rows in parallel. Points that do not move are traced once.
pub(crate) fn film(scene: &Scene, camera: &Camera, exposures: &[Exposure], order: Order) -> Vec<Shot> {
    let row = |y: usize| -> Vec<Pixel> {
        let still: Vec<PixelStill> = (0..camera.width).map(|x| PixelStill::new(scene, camera, x, y, order)).collect();
        let pixels = exposures.iter().flat_map(|exposure| still.iter().map(move |still| (still, exposure)));
        pixels.map(|(still, exposure)| still.expose(scene, camera, exposure)).collect()
    };
    let rows: Vec<Vec<Pixel>> = (0..camera.height).into_par_iter().map(row).collect();
    let shot = |index: usize| {
        let mut shot = Shot::default();
        rows.iter().flat_map(|row| &row[index * camera.width..][..camera.width]).for_each(|pixel| shot.push(pixel));
        shot
    };
    (0..exposures.len()).map(shot).collect()
}

/// The place of a ray in its pixel, right and down from the pixel's corner, 0 to 1.
fn place_in_pixel(position: usize) -> [f64; 2] {
    [position % SIDE, position / SIDE].map(|sub| (sub as f64 + 0.5) / SIDE as f64)
}

/// A photo of the size of `camera`'s, whose rows see the scene through the cameras and with the bodies of `open`, a
/// sub-frame each; `[height, width, 3]`, encoded.
pub(crate) fn shaken(
    scene: &Scene,
    camera: &Camera,
    open: impl Fn(usize) -> Vec<(Camera, Vec<Placed>)> + Sync,
    order: Order,
) -> Vec<u8> {
    let pixel = |x: usize, y: usize, open: &[(Camera, Vec<Placed>)]| {
        let seen = open.iter().enumerate().map(|(k, (camera, bodies))| {
            let (position, share) = order.ray(k % RAYS);
            let [right, down] = place_in_pixel(position);
            let ray = camera.ray(x as f64 + right, y as f64 + down);
            let point = scene.still(&ray, Lit::share(share));
            let sample = scene.sample(&ray, &point, bodies);
            (sample.body.is_some() || point.is_met() || scene.has_sky).then_some(sample.color)
        });
        mean(seen).0
    };
    let row = |y: usize| {
        let open = open(y);
        (0..camera.width).flat_map(|x| pixel(x, y, &open)).collect::<Vec<u8>>()
    };
    (0..camera.height).into_par_iter().flat_map_iter(row).collect()
}

/// The rays of a pixel and the points that they meet without moving bodies.
struct PixelStill {
    /// In the order of the film, then the one through the centre.
    samples: [(Ray, StaticPoint); RAYS + 1],
    pixel: Pixel,
}

impl PixelStill {
    fn new(scene: &Scene, camera: &Camera, x: usize, y: usize, order: Order) -> Self {
        let samples: [(Ray, StaticPoint); RAYS + 1] = std::array::from_fn(|i| {
            let ([u, v], share) = match i {
                RAYS => ([0.5; 2], RAYS),
                _ => {
                    let (position, share) = order.ray(i);
                    (place_in_pixel(position), share)
                }
            };
            let ray = camera.ray(x as f64 + u, y as f64 + v);
            (ray, scene.still(&ray, Lit::share(share)))
        });
        let seen = |(_, point): &(Ray, StaticPoint)| (point.is_met() || scene.has_sky).then_some(point.color);
        let (color, alpha) = mean(samples[..RAYS].iter().map(seen));
        let (ray, point) = &samples[RAYS];
        let depth = camera.depth(ray, point.t) as f32;
        let pixel = Pixel {
            sharp: color,
            alpha,
            blurry: color,
            partly: color,
            depth,
            velocity: [0.0; 3],
            is_moving: false,
            is_touched: false,
        };
        Self { samples, pixel }
    }

    fn expose(&self, scene: &Scene, camera: &Camera, exposure: &Exposure) -> Pixel {
        let may_touch = |(ray, point): &(Ray, StaticPoint)| {
            exposure.reach.iter().any(|(centre, radius)| scene.may_touch(ray, point, *centre, *radius))
        };
        if !self.samples.iter().any(may_touch) {
            return self.pixel;
        }
        let mut pixel = self.pixel;
        let (ray, point) = &self.samples[RAYS];
        if let Some((index, t)) = scene.sample(ray, point, &exposure.centre).body {
            let velocity = exposure.twists[index].at(ray.at(t), &exposure.centre[index].pose);
            pixel.depth = camera.depth(ray, t) as f32;
            pixel.velocity = velocity.as_vec3().to_array();
            pixel.is_moving = true;
        }
        let mut is_touched = pixel.is_moving;
        let mut look = |i: usize, bodies: &[Placed]| {
            let (ray, point) = &self.samples[i % RAYS];
            let sample = scene.sample(ray, point, bodies);
            is_touched |= sample.body.is_some();
            (sample.body.is_some() || point.is_met() || scene.has_sky).then_some(sample.color)
        };
        (pixel.sharp, pixel.alpha) = mean((0..RAYS).map(|i| look(i, &exposure.centre)));
        let mut over = |instants: &[Vec<Placed>]| match instants.is_empty() {
            true => pixel.sharp,
            false => mean(instants.iter().enumerate().map(|(k, bodies)| look(k, bodies))).0,
        };
        (pixel.blurry, pixel.partly) = (over(&exposure.open), over(&exposure.partly));
        pixel.is_touched = is_touched;
        pixel
    }
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

//! Images of the street with their truth.

use glam::{DMat4, DVec3};
use gs_base::Intrinsics;
use gs_datasets::light::to_byte;

use super::instant::{Candidates, Instant};
use super::rig::TURN;
use crate::tracer::shape::Ray;

/// Things are looked for once for each square of pixels of this side.
const TILE: usize = 16;

/// An image and the exact values at the centres of its pixels.
pub(super) struct Picture {
    /// `[height, width, 3]`.
    pub rgb: Vec<u8>,
    /// `[height, width]`, camera z in metres; 0: sky. Empty where no truth is asked for, as the next two.
    pub depth: Vec<f32>,
    /// `[3][height, width]`, metres in the next 0.1 s, street axes.
    pub flow: [Vec<f32>; 3],
    /// `[height, width]`.
    pub instance: Vec<f32>,
}

/// A camera that looks at an instant.
pub(super) struct View<'a> {
    pub instant: &'a Instant<'a>,
    /// OpenCV axes to street.
    pub c2w: DMat4,
    pub intrinsics: Intrinsics,
    pub width: usize,
    pub height: usize,
    /// Rays along each side of a pixel.
    pub subpixels: usize,
}

impl View<'_> {
    /// Takes the picture.
    pub fn photograph(&self, with_truth: bool) -> Picture {
        let pixels = self.width * self.height;
        let truth = if with_truth { pixels } else { 0 };
        let mut picture = Picture {
            rgb: vec![0; 3 * pixels],
            depth: vec![0.0; truth],
            flow: std::array::from_fn(|_| vec![0.0; truth]),
            instance: vec![0.0; truth],
        };
        for y in (0..self.height).step_by(TILE) {
            for x in (0..self.width).step_by(TILE) {
                self.tile(x, y, &mut picture);
            }
        }
        picture
    }

    fn ray(&self, x: f64, y: f64) -> Ray {
        let direction = self.c2w.transform_vector3(self.intrinsics.ray(x, y)).normalize();
        Ray { origin: self.c2w.w_axis.truncate(), direction }
    }

    fn tile(&self, x0: usize, y0: usize, picture: &mut Picture) {
        let (x1, y1) = ((x0 + TILE).min(self.width), (y0 + TILE).min(self.height));
        let middle = self.ray(0.5 * (x0 + x1) as f64, 0.5 * (y0 + y1) as f64);
        let corners = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)];
        let angle = |(x, y): (usize, usize)| middle.direction.angle_between(self.ray(x as f64, y as f64).direction);
        let half = corners.into_iter().map(angle).fold(0.0, f64::max);
        let candidates = self.instant.in_cone(middle.origin, middle.direction, half);
        for y in y0..y1 {
            for x in x0..x1 {
                let index = y * self.width + x;
                let color = self.pixel(x, y, &candidates);
                for channel in 0..3 {
                    picture.rgb[3 * index + channel] = to_byte(color[channel] as f32);
                }
                if !picture.depth.is_empty() {
                    self.truth(x, y, &candidates, picture);
                }
            }
        }
    }

    /// The mean light over the rays of a pixel, linear.
    fn pixel(&self, x: usize, y: usize, candidates: &Candidates) -> DVec3 {
        let count = self.subpixels;
        let mut sum = DVec3::ZERO;
        for sub in 0..count * count {
            let place = |pixel: usize, sub: usize| pixel as f64 + (sub as f64 + 0.5) / count as f64;
            let ray = self.ray(place(x, sub % count), place(y, sub / count));
            sum += match self.instant.meet(&ray, candidates) {
                Some(hit) => {
                    let slant = hit.normal.dot(ray.direction).abs().max(0.02);
                    self.instant.shade(&hit, hit.t / (self.intrinsics.fx * slant))
                }
                None => self.instant.sky(ray.direction),
            };
        }
        sum / (count * count) as f64
    }

    fn truth(&self, x: usize, y: usize, candidates: &Candidates, picture: &mut Picture) {
        let ray = self.ray(x as f64 + 0.5, y as f64 + 0.5);
        let Some(hit) = self.instant.meet(&ray, candidates) else { return };
        let index = y * self.width + x;
        picture.depth[index] = (hit.t * ray.direction.dot(self.c2w.z_axis.truncate())) as f32;
        let flow = self.instant.flow(&hit, TURN);
        for axis in 0..3 {
            picture.flow[axis][index] = flow[axis] as f32;
        }
        picture.instance[index] = hit.instance() as f32;
    }
}

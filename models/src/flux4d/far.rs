//! Points that no LiDAR gives (A.2): the sky, and the main paper's random points in a sphere.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::error::{FluxError, check_range};
use crate::random::SplitMix64;

/// The paper's number of sky points.
pub const SKY_POINTS: usize = 1_000_000;
/// The paper's radius of the sky, in lengths of the box.
pub const SKY_RADIUS: f64 = 4.0;
/// Random streams 0 and 1 are the lift's own.
const SKY_STREAM: u64 = 1 << 40;
const SPHERE_STREAM: u64 = 1 << 41;

/// The "length" of a box, which the paper does not define.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoxLength {
    /// The longest edge.
    #[default]
    LongestEdge,
    /// The diagonal.
    Diagonal,
}

/// An axis-aligned box, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub low: [f64; 3],
    /// Largest coordinates.
    pub high: [f64; 3],
}

impl Bounds {
    /// The box of `points`; at the origin and empty without points.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a [f32; 3]>) -> Self {
        let [low, high] = extremes(points.into_iter().map(|point| point.map(f64::from)));
        if low[0] > high[0] { Self { low: [0.0; 3], high: [0.0; 3] } } else { Self { low, high } }
    }

    /// Its centre.
    pub fn centre(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| 0.5 * (self.low[axis] + self.high[axis]))
    }

    /// Its length, metres.
    pub fn length(&self, length: BoxLength) -> f64 {
        let edges = [0, 1, 2].map(|axis| self.high[axis] - self.low[axis]);
        match length {
            BoxLength::LongestEdge => edges.into_iter().fold(0.0, f64::max),
            BoxLength::Diagonal => edges.iter().map(|edge| edge * edge).sum::<f64>().sqrt(),
        }
    }
}

/// The smallest and the largest coordinates of points; infinite, the smallest above the largest, without points.
pub fn extremes<const D: usize>(points: impl Iterator<Item = [f64; D]>) -> [[f64; D]; 2] {
    points.fold([[f64::INFINITY; D], [f64::NEG_INFINITY; D]], |[mut low, mut high], point| {
        for axis in 0..D {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
        [low, high]
    })
}

/// The number of far points and their places.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FarConfig {
    /// Points on the sky.
    pub sky_points: usize,
    /// Radius of the sky in lengths of the box.
    pub sky_radius: f64,
    /// The length of the box.
    pub box_length: BoxLength,
    /// Random points in a ball around the box's centre (main paper; 0 is the supplement alone).
    pub sphere_points: usize,
    /// Radius of the ball in lengths of the box.
    pub sphere_radius: f64,
}

impl Default for FarConfig {
    fn default() -> Self {
        Self {
            sky_points: SKY_POINTS,
            sky_radius: SKY_RADIUS,
            box_length: BoxLength::default(),
            sphere_points: 0,
            sphere_radius: 0.5,
        }
    }
}

/// Far points around `bounds`: those of the ball first, then those of the sky, whose upper half is towards larger z.
/// The same for a seed whatever the thread count.
///
/// # Errors
/// When a radius is not between 0 and 1000 lengths, or the box has no length.
pub fn far_points(bounds: &Bounds, config: &FarConfig, seed: u64) -> Result<Vec<[f32; 3]>, FluxError> {
    let radii = [("the sky's radius", config.sky_radius), ("the radius of the random points", config.sphere_radius)];
    radii.iter().try_for_each(|(what, value)| check_range(what, *value, [0.0, 1e3], "0 to 1000 lengths of the box"))?;
    if config.sky_points + config.sphere_points == 0 {
        return Ok(Vec::new());
    }
    let length = bounds.length(config.box_length);
    check_range("the length of the points' box", length, [1e-3, 1e6], "1 mm to 1000 km")?;
    let centre = bounds.centre();
    let place = |direction: [f64; 3], radius: f64| -> [f32; 3] {
        [0, 1, 2].map(|axis| (centre[axis] + radius * direction[axis]) as f32)
    };
    let ball = (0..config.sphere_points).into_par_iter().map(|i| {
        let mut random = SplitMix64::stream(seed, SPHERE_STREAM + i as u64);
        // The volume within a radius grows with its cube.
        place(direction(&mut random, -1.0), config.sphere_radius * length * random.unit().cbrt())
    });
    let sky = (0..config.sky_points).into_par_iter().map(|i| {
        let mut random = SplitMix64::stream(seed, SKY_STREAM + i as u64);
        place(direction(&mut random, 0.0), config.sky_radius * length)
    });
    Ok(ball.chain(sky).collect())
}

/// A uniform direction whose z is at least `lowest` (Archimedes: z of a uniform point of a sphere is uniform).
fn direction(random: &mut SplitMix64, lowest: f64) -> [f64; 3] {
    let z = lowest + (1.0 - lowest) * random.unit();
    let (sin, cos) = (TAU * random.unit()).sin_cos();
    let across = (1.0 - z * z).max(0.0).sqrt();
    [across * cos, across * sin, z]
}

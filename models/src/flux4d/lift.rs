//! The lift (A.2): points with colours to the raw channels of the first Gaussians, on the host, then as tensors.
//!
//! | channel | value |
//! |---|---|
//! | position | the point |
//! | quaternion | random and normalised, from the seed and the row |
//! | scale | `softplus^-1` of the mean distance to the three nearest neighbours |
//! | opacity | logit of 0.5 |
//! | colour | logit of the colour |
//!
//! A point that no image shows has the mean colour of those of its three nearest neighbours that have one, and mid grey
//! where none has. Far points ([`far`](super::far)) follow the points; they have the time 0.5 and neighbours among
//! themselves.

use std::f64::consts::TAU;

use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::profile;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::activate::ScaleLimits;
use super::channels::{CHANNELS, SCALE_MAX, SCALE_MIN};
use super::error::{FluxError, check_length, check_points, check_range};
use super::far::{Bounds, FarConfig, far_points};
use super::nearest::{NearestPoints, Neighbour};
use crate::random::SplitMix64;

/// Neighbours that determine a scale (A.2).
const NEIGHBOURS: usize = 3;
/// Scales are stored below the clamp by this share of it: at the clamp a scale receives no gradient.
const BELOW_CLAMP: f64 = 0.99;
/// Half a step of an 8-bit image: colours 0 and 1 have no finite logit.
const COLOR_MARGIN: f32 = 0.5 / 255.0;
/// Largest scale of the sky in distances between its points: Gaussians so wide overlap their second neighbours, so a
/// wider one shows nothing more.
const SKY_SPACINGS: f64 = 2.0;

/// First orientations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rotations {
    /// Uniform over all rotations, as in the paper.
    #[default]
    Random,
    /// None. The first Gaussians are isotropic, so the image is the same and the network's input has four channels less
    /// of noise.
    Identity,
}

/// The configuration of lifting.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LiftConfig {
    /// Seed of rotations and far points.
    pub seed: u64,
    /// First orientations.
    pub rotations: Rotations,
    /// Largest scale of points, metres.
    pub scale_max: f64,
    /// Largest scale of the sky, metres. Without it, twice the distance between its points and at least `scale_max`:
    /// with the paper's 1 m the sky is dots with gaps in between.
    pub sky_scale_max: Option<f64>,
    /// Sky and random points.
    pub far: FarConfig,
}

impl Default for LiftConfig {
    fn default() -> Self {
        let far = FarConfig::default();
        Self { seed: 0, rotations: Rotations::default(), scale_max: SCALE_MAX, sky_scale_max: None, far }
    }
}

/// The colour of a world position (metres) in the images, 0 to 1; `None` where none shows it.
pub type ColorAt<'a> = &'a (dyn Fn([f32; 3]) -> Option<[f32; 3]> + Sync);

/// The points of a snippet, one entry each.
#[derive(Clone, Copy)]
pub struct LiftInput<'a> {
    /// World, metres, centred; z up.
    pub points: &'a [[f32; 3]],
    /// 0 to 1 in the window.
    pub times: &'a [f32],
    /// Sampled from the image of the point's frame, 0 to 1; `None` where no image shows the point.
    pub colors: &'a [Option<[f32; 3]>],
    /// Colours of far points; mid grey without it.
    pub far_color: Option<ColorAt<'a>>,
}

/// The first Gaussians on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct LiftedRows {
    /// `[N, 14]`, see [`channels`](super::channels).
    pub raw: Vec<f32>,
    /// `[N]`, 0 to 1.
    pub times: Vec<f32>,
    /// The last rows that are random or sky points.
    pub far: usize,
    /// Clamps of the scales.
    pub limits: ScaleLimits,
}

/// The first Gaussians.
#[derive(Debug, Clone)]
pub struct Lifted {
    /// `[N, 14]`, see [`channels`](super::channels).
    pub raw: Tensor<2>,
    /// `[N]`, 0 to 1.
    pub times: Tensor<1>,
    /// The last rows that are random or sky points; they stay out of the convolutions.
    pub far: usize,
    /// Clamps of the scales.
    pub limits: ScaleLimits,
}

impl LiftedRows {
    /// The rows as `f32` tensors of `device`.
    pub fn to_device(&self, device: &Device) -> Lifted {
        let rows = self.times.len();
        let options = (device, DType::F32);
        Lifted {
            raw: Tensor::from_data(TensorData::new(self.raw.clone(), [rows, CHANNELS]), options),
            times: Tensor::from_data(TensorData::new(self.times.clone(), [rows]), options),
            far: self.far,
            limits: self.limits,
        }
    }
}

/// Lifts points to Gaussians of `device`.
///
/// # Errors
/// As [`lift_rows`].
pub fn lift(input: &LiftInput, config: &LiftConfig, device: &Device) -> Result<Lifted, FluxError> {
    Ok(lift_rows(input, config)?.to_device(device))
}

/// Lifts points to Gaussians on the host. The same for any thread count.
///
/// # Errors
/// With fewer than four points; when lengths differ; when a coordinate, time, colour or setting is out of range.
pub fn lift_rows(input: &LiftInput, config: &LiftConfig) -> Result<LiftedRows, FluxError> {
    let _stage = profile::stage("lift");
    check(input, config)?;
    let far = far_points(&Bounds::of(input.points), &config.far, config.seed)?;
    let limits = limits(config, input.points)?;
    let count = input.points.len();
    let mut times = input.times.to_vec();
    times.resize(count + far.len(), 0.5);
    let mut raw = vec![0.0; times.len() * CHANNELS];
    let (near_rows, far_rows) = raw.split_at_mut(count * CHANNELS);

    let neighbours = NearestPoints::new(input.points).all::<NEIGHBOURS>();
    near_rows.par_chunks_exact_mut(CHANNELS).enumerate().for_each(|(row, channels)| {
        let color = input.colors[row].or_else(|| color_of_neighbours(&neighbours[row], input.colors));
        let scale = mean_distance(&neighbours[row]);
        write(channels, input.points[row], rotation(config, row), raw_scale(scale, limits.near), color);
    });
    let neighbours = NearestPoints::new(&far).all::<NEIGHBOURS>();
    far_rows.par_chunks_exact_mut(CHANNELS).enumerate().for_each(|(row, channels)| {
        let color = input.far_color.and_then(|color_at| color_at(far[row]));
        let limit = if row < config.far.sphere_points { limits.near } else { limits.sky };
        let scale = raw_scale(mean_distance(&neighbours[row]), limit);
        write(channels, far[row], rotation(config, count + row), scale, color);
    });
    Ok(LiftedRows { raw, times, far: far.len(), limits })
}

/// The number before softplus and clamp whose scale is `scale`, or just below `limit` if that is smaller, metres.
pub fn raw_scale(scale: f64, limit: f64) -> f32 {
    let scale = scale.clamp(SCALE_MIN, BELOW_CLAMP * limit);
    // ln(e^s - 1) without the cancellation for small s and the overflow for large.
    (scale + (-(-scale).exp_m1()).ln()) as f32
}

/// The logit of a colour or opacity `value`, kept half an 8-bit step away from 0 and 1.
pub fn logit(value: f32) -> f32 {
    let value = value.clamp(COLOR_MARGIN, 1.0 - COLOR_MARGIN);
    (value / (1.0 - value)).ln()
}

fn check(input: &LiftInput, config: &LiftConfig) -> Result<(), FluxError> {
    let count = input.points.len();
    check_length("times", count, input.times.len())?;
    check_length("colours", count, input.colors.len())?;
    check_points(input.points)?;
    if count <= NEIGHBOURS {
        return Err(FluxError::TooFew { what: "the lift", needed: NEIGHBOURS + 1, found: count });
    }
    let time = |time: &f32| check_range("a point's time", f64::from(*time), [0.0, 1.0], "0 to 1");
    input.times.iter().try_for_each(time)?;
    let channel = |value: &f32| check_range("a colour", f64::from(*value), [0.0, 1.0], "0 to 1");
    input.colors.iter().flatten().flatten().try_for_each(channel)?;
    let limit = |value: f64| check_range("the largest scale", value, [0.01, 1e6], "1 cm to 1000 km");
    limit(config.scale_max)?;
    config.sky_scale_max.map_or(Ok(()), limit)
}

fn limits(config: &LiftConfig, points: &[[f32; 3]]) -> Result<ScaleLimits, FluxError> {
    let far = &config.far;
    let radius = far.sky_radius * Bounds::of(points).length(far.box_length);
    // Each sky point's share of the half sphere is the square of this.
    let spacing = radius * (TAU / far.sky_points.max(1) as f64).sqrt();
    let sky = config.sky_scale_max.unwrap_or_else(|| (SKY_SPACINGS * spacing).max(config.scale_max));
    Ok(ScaleLimits { near: config.scale_max, sky, sky_rows: far.sky_points })
}

fn write(channels: &mut [f32], point: [f32; 3], quat: [f32; 4], scale: f32, color: Option<[f32; 3]>) {
    channels[..3].copy_from_slice(&point);
    channels[3..7].copy_from_slice(&quat);
    channels[7..10].fill(scale);
    channels[10] = 0.0;
    channels[11..].copy_from_slice(&color.map_or([0.0; 3], |color| color.map(logit)));
}

/// Infinite without neighbours; the clamp makes a scale of it.
fn mean_distance(neighbours: &[Neighbour; NEIGHBOURS]) -> f64 {
    let known = neighbours.iter().filter(|(squared, _)| squared.is_finite());
    let (sum, count) =
        known.fold((0.0, 0.0), |(sum, count), (squared, _)| (sum + f64::from(*squared).sqrt(), count + 1.0));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

fn color_of_neighbours(neighbours: &[Neighbour; NEIGHBOURS], colors: &[Option<[f32; 3]>]) -> Option<[f32; 3]> {
    let known = neighbours.iter().filter_map(|(_, row)| colors[*row as usize]);
    let (sum, count) =
        known.fold(([0.0; 3], 0.0), |(sum, count), c| ([sum[0] + c[0], sum[1] + c[1], sum[2] + c[2]], count + 1.0_f32));
    (count > 0.0).then(|| sum.map(|x| x / count))
}

/// Shoemake 1992: a uniform rotation from three uniform numbers.
fn rotation(config: &LiftConfig, row: usize) -> [f32; 4] {
    if config.rotations == Rotations::Identity {
        return [1.0, 0.0, 0.0, 0.0];
    }
    let mut random = SplitMix64::stream(config.seed, row as u64);
    let (u, a, b) = (random.unit(), TAU * random.unit(), TAU * random.unit());
    let (low, high) = ((1.0 - u).sqrt(), u.sqrt());
    [low * a.sin(), low * a.cos(), high * b.sin(), high * b.cos()].map(|x| x as f32)
}

//! Options of the kernels beside their buffers, shared by the CPU kernels and their CubeCL twins.

use crate::constants::{EPS2D, FAR, NEAR, TILE};

/// A pinhole camera's image and the limits of projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectionConfig {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge.
    pub cx: f64,
    /// Principal point, pixels from the top edge.
    pub cy: f64,
    /// Gaussians whose mean is nearer than this (camera z, scene units) are culled.
    pub near: f64,
    /// Gaussians whose mean is farther than this are culled.
    pub far: f64,
    /// Variance added to the projected covariance, square pixels.
    pub eps2d: f64,
    /// Whether the opacity compensation of Mip-Splatting (Yu et al. 2024, Eq. 9) is computed; otherwise it is 1.
    pub antialiased: bool,
    /// Rows of the whole image above and below these, where they are a part of one.
    pub beyond: [u32; 2],
}

impl Default for ProjectionConfig {
    fn default() -> Self {
        Self {
            width: 1,
            height: 1,
            fx: 1.0,
            fy: 1.0,
            cx: 0.5,
            cy: 0.5,
            near: NEAR,
            far: FAR,
            eps2d: EPS2D,
            antialiased: false,
            beyond: [0; 2],
        }
    }
}

impl ProjectionConfig {
    /// Bounds of `x / z` and `y / z` at which the Jacobian is evaluated: `[x_min, x_max, y_min, y_max]`, of the whole
    /// image.
    pub fn frustum_limits(&self) -> [f64; 4] {
        let [above, below] = self.beyond.map(f64::from);
        let (w, h) = (f64::from(self.width), above + f64::from(self.height) + below);
        let cy = self.cy + above;
        let margin_x = crate::constants::FRUSTUM_MARGIN * 0.5 * w / self.fx;
        let margin_y = crate::constants::FRUSTUM_MARGIN * 0.5 * h / self.fy;
        [
            -(self.cx / self.fx + margin_x),
            (w - self.cx) / self.fx + margin_x,
            -(cy / self.fy + margin_y),
            (h - cy) / self.fy + margin_y,
        ]
    }
}

/// Numbers of stored and of used spherical harmonics coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShConfig {
    /// Active degree, 0 to 3; at most the stored one.
    pub degree: u32,
    /// Coefficients stored per Gaussian and channel: 1, 4, 9 or 16.
    pub coefficients: usize,
}

/// The output of a rasterization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RasterizeConfig {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Feature channels per Gaussian.
    pub channels: usize,
    /// Whether depth is accumulated as one more channel (without background) behind the features.
    pub depth: bool,
}

impl RasterizeConfig {
    /// Values per output pixel: features, depth if requested, alpha.
    pub fn output_channels(&self) -> usize {
        self.channels + usize::from(self.depth) + 1
    }

    /// Tiles along x and y.
    pub fn tiles(&self) -> (usize, usize) {
        tile_grid(self.width, self.height)
    }
}

/// The mean of an exposure's tiles as one image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AverageConfig {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Values per pixel.
    pub channels: usize,
    /// Number of first channels that are averaged as light; the others are averaged as they are.
    pub encoded: usize,
}

/// Room for the lists of a rendering, so that nothing waits for the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Pairs of tile and Gaussian.
    pub pairs: usize,
    /// Tiles drawn for an exposure, at all instants, those of the image included.
    pub tiles: usize,
}

/// Tiles along x and y of an image in pixels.
pub fn tile_grid(width: u32, height: u32) -> (usize, usize) {
    ((width as usize).div_ceil(TILE), (height as usize).div_ceil(TILE))
}

/// One Adam update (Kingma and Ba 2015).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamConfig {
    /// Learning rate, in the parameter's unit per step.
    pub lr: f64,
    /// Decay of the first moment.
    pub beta1: f64,
    /// Decay of the second moment.
    pub beta2: f64,
    /// Added to the root of the second moment; protects parameters that never had a gradient.
    pub eps: f64,
    /// Number of this step, from 1; used for the bias correction.
    pub step: u64,
    /// A rate of its own for the first columns of every row.
    pub first_columns: Option<FirstColumns>,
}

/// The first columns of a table's rows, which have a learning rate of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstColumns {
    /// Values in a row.
    pub row: usize,
    /// How many of them have the rate `lr`.
    pub count: usize,
    /// Their learning rate.
    pub lr: f64,
}

/// One view of the statistics of classic density control (3DGS, section 5.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatisticsConfig {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Whether the absolute contributions of pixels count (AbsGS) and not their sum.
    pub absolute: bool,
    /// Columns of the rows whose last one is the radius.
    pub columns: usize,
}

impl StatisticsConfig {
    /// Factors from a gradient by pixels to one by image coordinates from -1 to 1, which one threshold serves at every
    /// resolution.
    pub fn halves(&self) -> [f64; 2] {
        [self.width, self.height].map(|pixels| 0.5 * f64::from(pixels))
    }

    /// Column of the x component in a row of screen gradients.
    pub fn first_column(&self) -> usize {
        if self.absolute { 2 } else { 0 }
    }
}

/// The position noise of one step of 3DGS-MCMC (Kheradmand et al. 2024, Eq. 8): `mean += Sigma n strength gate`, with
/// the covariance `Sigma`, `n` standard normal and `gate = sigmoid(steepness (opacity_half - opacity))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseConfig {
    /// Factor of the noise, one over scene units.
    pub strength: f64,
    /// Seed of the run.
    pub seed: u64,
    /// Number of the step, below 2^31.
    pub step: u64,
    /// Steepness of the gate over opacity (paper: k = 100).
    pub steepness: f64,
    /// Opacity at which the gate is half open (paper: t = 0.005).
    pub opacity: f64,
    /// A gate below this lets no noise through: it would move the Gaussian by less than a thousandth of the noise.
    pub gate_min: f64,
}

impl NoiseConfig {
    /// The paper's gate.
    pub fn new(strength: f64, seed: u64, step: u64) -> Self {
        Self { strength, seed, step, steepness: 100.0, opacity: 0.005, gate_min: 1e-3 }
    }

    /// The key of all draws of this noise: the seed. The constant tells them from draws for other purposes.
    pub fn key(&self) -> [u32; 2] {
        const PURPOSE: u32 = 0x6e6f_6973; // "nois"
        [self.seed as u32, (self.seed >> 32) as u32 ^ PURPOSE]
    }

    /// The second words of the two counters of a row at this step; the first is the row.
    pub fn counters(&self) -> [u32; 2] {
        [0, 1].map(|draw| (self.step as u32) << 1 | draw)
    }
}

/// A function of each number, before a sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activation {
    /// `exp(x)`: from log scales to scales.
    Exp,
    /// `1 / (1 + exp(-x))`, 0 where `x` is not a number: from logits to opacities.
    Sigmoid,
}

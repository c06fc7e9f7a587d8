//! Every threshold of the rasterizer, once, with its source and reason. Both twins read them here.

/// Tile edge in pixels. 16 makes a tile sixteen blocks of sixteen pixels, each one 512-bit vector of `f32`, and one
/// 256-thread group on a GPU.
pub const TILE: usize = 16;

/// A Gaussian's contribution to a pixel is dropped when `opacity * exp(-sigma)` is below this: it could not change an
/// 8-bit image (3DGS, section 6).
pub const ALPHA_MIN: f64 = 1.0 / 255.0;

/// Alpha is capped here; a capped alpha passes no gradient. 3DGS uses 0.99, which keeps opaque surfaces visibly
/// translucent; 0.999 keeps `1 / (1 - alpha)` below 1000, which `f32` carries.
pub const ALPHA_MAX: f64 = 0.999;

/// A pixel ends at the Gaussian that would bring its transmittance below this; that Gaussian is not blended (3DGS).
/// Gaussians behind could change the pixel by at most this much, 1/40 of an 8-bit step.
pub const TRANSMITTANCE_MIN: f64 = 1e-4;

/// Default variance in square pixels added to every projected Gaussian, so that none falls between pixel centres
/// (3DGS).
pub const EPS2D: f64 = 0.3;

/// Default near plane, scene units: below it the perspective Jacobian is no longer a local approximation (gsplat's
/// value).
pub const NEAR: f64 = 0.01;

/// Default far plane, scene units (gsplat's value; effectively none).
pub const FAR: f64 = 1e10;

/// The Jacobian is evaluated inside the image enlarged by this share of its half size on each side; beyond it the
/// linearisation makes Gaussians at the frustum edge explode (3DGS clamps at 1.3 times the half angle's tangent).
pub const FRUSTUM_MARGIN: f64 = 0.3;

/// `sqrt(2 ln(1 / ALPHA_MIN))`: beyond this many standard deviations even an opaque Gaussian is under [`ALPHA_MIN`].
pub const CUTOFF_SIGMAS: f64 = 3.329_043_494_952_706;

/// Largest 2D variance kept, square pixels: a standard deviation of a million pixels is flat over any image, and the
/// determinant of anything larger leaves the range of `f32`.
pub const COV2D_MAX: f64 = 1e12;

/// Smallest squared quaternion norm that still fixes a rotation in `f32` (its square root is 1e-18).
pub const QUAT_NORM2_MIN: f64 = 1e-36;

/// Largest squared quaternion norm whose products stay finite in `f32`.
pub const QUAT_NORM2_MAX: f64 = 1e36;

/// Floor of the anti-aliasing ratio `det C0 / det C`: its square root has an infinite slope at zero.
pub const COMPENSATION_RATIO_MIN: f64 = 1e-10;

/// A Gaussian with a feature that is not smaller than this in magnitude is left out: sums over a pixel could overflow.
pub const FEATURE_MAX: f64 = 1e30;

/// The colour of a Gaussian whose computed colour is not finite. It is finite itself, and the intersection test rejects
/// it because its magnitude is above [`FEATURE_MAX`].
pub const INVALID_FEATURE: f64 = -1e38;

/// Edge of the SSIM window in pixels (Wang et al. 2004).
pub const SSIM_WINDOW: usize = 11;

/// Standard deviation of the SSIM window in pixels (Wang et al. 2004).
pub const SSIM_SIGMA: f64 = 1.5;

/// SSIM's stabiliser of the luminance term for images in 0..1: `(0.01)^2`.
pub const SSIM_C1: f64 = 0.0001;

/// SSIM's stabiliser of the contrast term for images in 0..1: `(0.03)^2`.
pub const SSIM_C2: f64 = 0.0009;

/// Subtracted from every pixel before SSIM takes its moments: the middle of the range. Variances do not change, and
/// `E[x^2] - mu^2` loses less to rounding.
pub const SSIM_SHIFT: f64 = 0.5;

/// Pixel values beyond this magnitude, or not finite, count as 0 in the photometric loss and get no gradient: the
/// fourth powers inside SSIM stay in the range of `f32`.
pub const PIXEL_MAX: f64 = 1e4;

/// Exponent of sRGB's transfer curve (IEC 61966-2-1), which relates an encoded image to its light.
pub const SRGB_GAMMA: f64 = 2.4;

/// Offset of the curve: `light = ((value + offset) / (1 + offset))^gamma`.
pub const SRGB_OFFSET: f64 = 0.055;

/// Slope of the line near black, `light = value / slope`; without it the root would have an infinite slope at zero.
pub const SRGB_SLOPE: f64 = 12.92;

/// Encoded values up to here are on the line.
pub const SRGB_KNEE: f64 = 0.04045;

/// Light up to here is on the line.
pub const SRGB_LIGHT_KNEE: f64 = 0.003_130_8;

//! Gaussians and a camera to an image.

use burn::tensor::Tensor;
use gs_kernels::config::{ProjectionConfig, RasterizeConfig};
use gs_kernels::constants::{EPS2D, FAR, NEAR};

use crate::ops::channels::channels;
use crate::ops::columns;
use crate::ops::intersect::{DeviceCount, intersect_within};
use crate::ops::projection::project;
use crate::ops::rasterize::rasterize;
use crate::ops::sh::sh_colors;
use crate::{Camera, Gaussians};

/// Options of a rendering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Active degree of the spherical harmonics; capped at the stored one. Default 3.
    pub sh_degree: usize,
    /// Colour behind everything, 0..1. Default black.
    pub background: [f32; 3],
    /// Gaussians nearer than this (camera z, scene units) are culled. Default 0.01.
    pub near: f64,
    /// Gaussians farther than this are culled. Default 1e10.
    pub far: f64,
    /// Variance added to every projected Gaussian, square pixels; smaller sharpens and aliases. Default 0.3.
    pub eps2d: f64,
    /// Lower the opacity of Gaussians that `eps2d` widens, so that they keep their light when the image is scaled
    /// (Mip-Splatting). Use the setting the scene was trained with. Default off.
    pub antialiased: bool,
    /// Also accumulate depth. Default off.
    pub depth: bool,
    /// Rows of the whole image above and below the camera's, where the camera has some rows of it alone. The projection
    /// is linear about a point at most a little outside of the whole image. Default none.
    pub beyond: [usize; 2],
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            sh_degree: 3,
            background: [0.0; 3],
            near: NEAR,
            far: FAR,
            eps2d: EPS2D,
            antialiased: false,
            depth: false,
            beyond: [0; 2],
        }
    }
}

/// Result of [`render`].
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Colour over the background, `[H, W, 3]`.
    pub color: Tensor<3>,
    /// Opacity of each pixel, `[H, W, 1]`.
    pub alpha: Tensor<3>,
    /// Depth (camera z, scene units) summed with the blending weights, `[H, W, 1]`; see [`Rendering::expected_depth`].
    pub depth: Option<Tensor<3>>,
    /// Feature channels summed with the blending weights, `[H, W, F]`; present when [`Extras::features`] was.
    pub features: Option<Tensor<3>>,
    /// Rows of [`project`], `[N, 8]`.
    pub projected: Tensor<2>,
    /// Number of (tile, Gaussian) pairs that were blended.
    pub intersections: DeviceCount,
}

impl Rendering {
    /// Mean depth of a pixel, `depth / alpha`, `[H, W, 1]`, scene units; 0 where alpha is 0.
    pub fn expected_depth(&self) -> Option<Tensor<3>> {
        // Any alpha above 0 is at least ALPHA_MIN; the floor only prevents 0 / 0.
        self.depth.clone().map(|depth| depth / self.alpha.clone().clamp_min(1e-6))
    }

    /// Bounding radii in the image, `[N]`, pixels; 0 for a culled Gaussian.
    pub fn radii(&self) -> Tensor<1> {
        columns::radius(self.projected.clone()).squeeze_dim(1)
    }
}

/// Renders the Gaussians as seen by the camera; differentiable with respect to every parameter and the camera's
/// `viewmat`.
///
/// # Panics
/// When the parameters' shapes disagree or the image has no pixels.
pub fn render(gaussians: &Gaussians, camera: &Camera, options: &RenderOptions) -> Rendering {
    render_with(gaussians, camera, options, Extras::default())
}

/// Optional inputs of a rendering beside colour.
#[derive(Clone, Debug, Default)]
pub struct Extras {
    /// One row of any numbers per Gaussian, `[N, F]`, blended in the same pass as the colours over a background of
    /// zero: velocities (velocity splatting, TaylorMoDe-GS Eq. 4), labels, network features.
    pub features: Option<Tensor<2>>,
    /// Zeros `[N, 4]` that require a gradient, for the statistic of density control. After the backward pass the
    /// gradient is, per Gaussian, the gradient of the loss with respect to its 2D mean in pixels (x, y), and the sum
    /// over pixels of the absolute contributions to it.
    pub screen: Option<Tensor<2>>,
    /// Pairs of tile and Gaussian for which a GPU makes room, so that it need not wait for their number; see
    /// [`intersect_within`]. A rendering with more pairs shows the background alone, and [`Rendering::intersections`]
    /// tells.
    pub room: Option<usize>,
}

/// Like [`render`], with [`Extras`]; differentiable with respect to the features too.
///
/// # Panics
/// When the parameters' shapes disagree, the features have another number of rows, or the image has no pixels.
pub fn render_with(gaussians: &Gaussians, camera: &Camera, options: &RenderOptions, extras: Extras) -> Rendering {
    let means = gaussians.means.val();
    let viewmat = camera.viewmat.clone().cast(means.dtype());
    let (width, height) = (camera.width, camera.height);
    assert!(width > 0 && height > 0, "the camera's image must have pixels, it has {width} x {height}");

    let projected = project(
        means.clone(),
        gaussians.quats.val(),
        gaussians.log_scales.val(),
        viewmat.clone(),
        &projection_config(camera, options),
    );
    let degree = options.sh_degree.min(gaussians.sh_degree());
    let colors = sh_colors(means, gaussians.sh.val(), viewmat, projected.clone(), degree);
    let mut opacities = gaussians.opacities();
    if options.antialiased {
        opacities = opacities * columns::compensation(projected.clone()).squeeze_dim(1);
    }
    let mut background = Tensor::from_data(options.background, (&colors.device(), colors.dtype()));
    let (mut count, mut blended) = (3, colors);
    if let Some(features) = extras.features {
        let [rows, extra] = features.dims();
        assert_eq!(rows, gaussians.len(), "features must have one row per Gaussian");
        background = Tensor::cat(
            vec![background.clone(), Tensor::zeros([extra], (&background.device(), background.dtype()))],
            0,
        );
        blended = Tensor::cat(vec![blended, features], 1);
        count += extra;
    }
    let (rows, alphas, values) = (projected.clone(), opacities.clone(), blended.clone());
    let intersections = intersect_within(rows, alphas, values, width, height, extras.room);
    let image = RasterizeConfig { width: width as u32, height: height as u32, channels: count, depth: options.depth };
    let output = rasterize(projected.clone(), opacities, blended, background, extras.screen, &intersections, &image);

    Rendering {
        color: channels(output.clone(), 0, 3),
        features: (count > 3).then(|| channels(output.clone(), 3, count - 3)),
        depth: options.depth.then(|| channels(output.clone(), count, 1)),
        alpha: channels(output, image.output_channels() - 1, 1),
        projected,
        intersections: intersections.count,
    }
}

pub(crate) fn projection_config(camera: &Camera, options: &RenderOptions) -> ProjectionConfig {
    ProjectionConfig {
        width: camera.width as u32,
        height: camera.height as u32,
        fx: camera.intrinsics.fx,
        fy: camera.intrinsics.fy,
        cx: camera.intrinsics.cx,
        cy: camera.intrinsics.cy,
        near: options.near,
        far: options.far,
        eps2d: options.eps2d,
        antialiased: options.antialiased,
        beyond: options.beyond.map(|rows| rows as u32),
    }
}

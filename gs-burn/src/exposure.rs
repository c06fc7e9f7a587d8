//! The image that a camera records while its shutter is open: the mean over several instants, with the static Gaussians
//! drawn once.
//!
//! The mean over `n` instants of a scene is the integral of the light by the midpoint rule (TaylorMoDe-GS, Eq. 12, with
//! renderings instead of warped ones). Only some Gaussians move between instants, and they touch only some tiles. The
//! static ones are therefore projected, coloured and listed once, and a tile is drawn once for every set of instants at
//! which it looks the same. The result is that of `n` calls of [`render`](crate::render()), to rounding, and so are the
//! gradients.

use crate::ops::rows::{add_rows, take_rows};
use burn::tensor::{DType, Device, Int, Tensor, assert_shape};
use gs_kernels::config::{RasterizeConfig, tile_grid};
use gs_kernels::constants::TILE;

use crate::limits::{copies_within, largest_buffer};
use crate::ops::channels::channels;
use crate::ops::columns;
use crate::ops::exposure::{AverageConfig, average_tiles};
use crate::ops::instants::{InstantIntersections, TileShares, intersect_instants};
use crate::ops::intersect::{DeviceCount, Room};
use crate::ops::projection::project;
use crate::ops::rasterize::rasterize;
use crate::ops::sh::sh_colors;
use crate::render::projection_config;
use crate::{Camera, Gaussians, RenderOptions, Rendering};

/// The moving Gaussians at one instant.
#[derive(Clone, Debug)]
pub struct MovingSample {
    /// Means `[M, 3]`, world, scene units.
    pub means: Tensor<2>,
    /// Orientations `[M, 4]`, w x y z of any norm.
    pub quats: Tensor<2>,
}

/// The moving Gaussians at all instants, one after another: one tensor each, so that a GPU gets few launches whatever
/// the number of instants. A list of [`MovingSample`] is one too.
#[derive(Clone, Debug)]
pub struct MovingSamples {
    /// Number of instants, `n`.
    pub instants: usize,
    /// Means `[n M, 3]`, world, scene units.
    pub means: Tensor<2>,
    /// Orientations `[n M, 4]`, w x y z of any norm.
    pub quats: Tensor<2>,
}

impl From<&[MovingSample]> for MovingSamples {
    /// # Panics
    /// When there is no sample, or samples disagree in shape.
    fn from(samples: &[MovingSample]) -> Self {
        assert!(!samples.is_empty(), "an exposure needs at least one sample");
        let moving = samples[0].means.dims()[0];
        for MovingSample { means, quats } in samples {
            assert_shape!(means, [moving, 3]);
            assert_shape!(quats, [moving, 4]);
        }
        let all = |of: fn(&MovingSample) -> Tensor<2>| concatenated(samples.iter().map(of).collect());
        Self { instants: samples.len(), means: all(|s| s.means.clone()), quats: all(|s| s.quats.clone()) }
    }
}

impl From<&Vec<MovingSample>> for MovingSamples {
    fn from(samples: &Vec<MovingSample>) -> Self {
        samples.as_slice().into()
    }
}

/// Options of [`render_exposure`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExposureOptions {
    /// Options of the rendering of each instant.
    pub render: RenderOptions,
    /// Average the light of colours (through the curve of sRGB), as a sensor does, instead of the colours.
    pub linear: bool,
    /// Pairs and tiles for which a GPU makes room, so that it need not wait for their numbers; see
    /// [`intersect_instants`]. An exposure that needs more shows the background alone, and
    /// [`ExposureRendering::intersections`] or [`ExposureRendering::tiles`] tells. Room that no buffer holds is not
    /// used.
    pub room: Option<Room>,
}

/// Result of [`render_exposure`].
#[derive(Clone, Debug)]
pub struct ExposureRendering {
    /// Mean colour over the background, `[H, W, 3]`, encoded (not as light).
    pub color: Tensor<3>,
    /// Mean opacity of each pixel, `[H, W, 1]`.
    pub alpha: Tensor<3>,
    /// Mean over the instants of the depth summed with the blending weights, `[H, W, 1]`, if requested.
    pub depth: Option<Tensor<3>>,
    /// Rows of [`project`], `[N + (n - 1) M, 8]`: the scene at the middle instant, then the moving Gaussians at each
    /// other instant in order.
    pub projected: Tensor<2>,
    /// Number of (tile, Gaussian) pairs that were blended.
    pub intersections: DeviceCount,
    /// Number of tiles that were drawn.
    pub tiles: DeviceCount,
    /// Number of tiles that one rendering per instant would draw.
    pub full_tiles: usize,
    shares: TileShares,
    drawn: Tensor<3>,
    image: RasterizeConfig,
    scene: usize,
    moving: Tensor<1, Int>,
}

impl ExposureRendering {
    /// The rendering of the middle instant, sample `n / 2`; it is part of the result and costs a copy.
    pub fn middle(&self) -> Rendering {
        let first = self.shares.first_only();
        let output = average_tiles(self.drawn.clone(), &first, &average_config(&self.image, false));
        Rendering {
            color: channels(output.clone(), 0, 3),
            depth: self.image.depth.then(|| channels(output.clone(), 3, 1)),
            alpha: channels(output, self.image.output_channels() - 1, 1),
            features: None,
            projected: self.projected.clone().narrow(0, 0, self.scene),
            intersections: self.intersections.clone(),
        }
    }

    /// Bounding radii in the image, `[N]`, pixels: the largest over the instants for a moving Gaussian; 0 for one that
    /// is culled at all of them. Not differentiable.
    pub fn radii(&self) -> Tensor<1> {
        let radii = columns::radius(self.projected.clone().inner());
        let ([count, _], [moving_count]) = (radii.dims(), self.moving.dims());
        let scene: Tensor<1> = radii.clone().narrow(0, 0, self.scene).squeeze_dim(1);
        if count == self.scene || moving_count == 0 {
            return scene;
        }
        let others = radii.narrow(0, self.scene, count - self.scene).reshape([-1, moving_count as i32]);
        let others: Tensor<1> = others.max_dim(0).squeeze_dim(0);
        let own = take_rows(scene.clone(), &self.moving);
        // Excess of the largest over the middle instant's; never negative, so the sum is the larger of the two.
        let more = (others - own).clamp_min(0.0);
        add_rows(scene, &self.moving, more)
    }
}

/// Renders the mean over `samples` of a scene whose Gaussians `moving` have the means and orientations of each sample.
///
/// `moving` holds ascending row numbers; each sample has as many rows. The means and orientations of these rows in
/// `gaussians` are not used, and get a gradient of zero; their scales, opacities and colours hold at all instants.
/// `screen` `[N, 4]` is as in [`Extras::screen`](crate::Extras::screen), summed over the instants. Differentiable with
/// respect to every parameter, the samples and the camera's `viewmat`.
///
/// # Panics
/// When there is no sample, shapes disagree, `moving` does not ascend or the image has no pixels.
pub fn render_exposure(
    gaussians: &Gaussians,
    moving: &[u32],
    samples: impl Into<MovingSamples>,
    camera: &Camera,
    options: &ExposureOptions,
    screen: Option<Tensor<2>>,
) -> ExposureRendering {
    let render = &options.render;
    let (width, height) = (camera.width, camera.height);
    assert!(width > 0 && height > 0, "the camera's image must have pixels, it has {width} x {height}");
    let samples = samples.into();
    let table = Table::new(gaussians, moving, &samples);
    let viewmat = camera.viewmat.clone().cast(table.means.dtype());

    let log_scales = table.of_rows(gaussians.log_scales.val());
    let projected = project(
        table.means.clone(),
        table.quats.clone(),
        log_scales,
        viewmat.clone(),
        &projection_config(camera, render),
    );
    let degree = render.sh_degree.min(gaussians.sh_degree());
    let colors = table.colors(gaussians.sh.val(), &viewmat, &projected, degree);
    let mut opacities = table.of_rows(gaussians.opacities());
    if render.antialiased {
        opacities = opacities * columns::compensation(projected.clone()).squeeze_dim(1);
    }
    let (rows, alphas, features) = (projected.clone(), opacities.clone(), colors.clone());
    let size = [width, height];
    let image = RasterizeConfig { width: width as u32, height: height as u32, channels: 3, depth: render.depth };
    let room = options.room.filter(|room| fits(room, &image, &colors.device()));
    let InstantIntersections { lists, shares, tiles } =
        intersect_instants(rows, alphas, features, size, table.scene, &table.moving, room);
    let background = Tensor::from_data(render.background, (&colors.device(), colors.dtype()));
    let screen = screen.map(|screen| {
        assert_shape!(screen, [table.scene, 4]);
        table.of_rows(screen)
    });
    let drawn = rasterize(projected.clone(), opacities, colors, background, screen, &lists, &image);
    let output = average_tiles(drawn.clone(), &shares, &average_config(&image, options.linear));

    let (columns, rows) = tile_grid(image.width, image.height);
    ExposureRendering {
        color: channels(output.clone(), 0, 3),
        depth: render.depth.then(|| channels(output.clone(), 3, 1)),
        alpha: channels(output, image.output_channels() - 1, 1),
        projected,
        intersections: lists.count,
        tiles,
        full_tiles: samples.instants * columns * rows,
        shares,
        drawn,
        image,
        scene: table.scene,
        moving: table.moving,
    }
}

/// Whether a buffer of the device holds the pixels of all tiles for which there is room.
fn fits(room: &Room, image: &RasterizeConfig, device: &Device) -> bool {
    let (columns, rows) = tile_grid(image.width, image.height);
    let values = room.tiles.max(columns * rows).saturating_mul(TILE * TILE * image.output_channels());
    largest_buffer(device).is_none_or(|most| (values as u64).saturating_mul(4) <= most)
}

fn average_config(image: &RasterizeConfig, linear: bool) -> AverageConfig {
    let encoded = if linear { image.channels } else { 0 };
    AverageConfig { width: image.width, height: image.height, channels: image.output_channels(), encoded }
}

/// The rows of all instants: the scene at the middle instant, then the moving Gaussians at each other instant.
struct Table {
    /// `[N + (n - 1) M, 3]`
    means: Tensor<2>,
    /// `[N + (n - 1) M, 4]`
    quats: Tensor<2>,
    /// Rows of the scene, `N`.
    scene: usize,
    /// Instants beside the middle one that have rows of their own.
    further: usize,
    /// `[M]`
    moving: Tensor<1, Int>,
}

impl Table {
    fn new(gaussians: &Gaussians, moving: &[u32], samples: &MovingSamples) -> Self {
        let (means, quats) = (gaussians.means.val(), gaussians.quats.val());
        let (scene, moving_count) = (gaussians.len(), moving.len());
        let instants = samples.instants;
        assert!(instants > 0, "an exposure needs at least one sample");
        assert!(moving.is_sorted_by(|a, b| a < b), "the numbers of what moves must rise");
        assert!(
            moving.last().is_none_or(|&last| (last as usize) < scene),
            "what moves must be among {scene} Gaussians"
        );
        assert_shape!(samples.means, [instants * moving_count, 3]);
        assert_shape!(samples.quats, [instants * moving_count, 4]);
        let indices = |values: Vec<i32>| Tensor::<1, Int>::from_data(values.as_slice(), (&means.device(), DType::I32));
        let rows = indices(moving.iter().map(|&row| row as i32).collect());
        if moving_count == 0 {
            return Self { means, quats, scene, further: 0, moving: rows };
        }
        // Rows are replaced by number, because a row that is not finite would remain in any product with zero.
        let middle = instants / 2;
        let at = |instant: usize| (0..moving_count).map(move |k| (scene + instant * moving_count + k) as i32);
        let mut taken: Vec<i32> = (0..scene as i32).collect();
        moving.iter().zip(at(middle)).for_each(|(&row, from)| taken[row as usize] = from);
        taken.extend((0..instants).filter(|instant| *instant != middle).flat_map(at));
        let taken = indices(taken);
        let table = |scene: Tensor<2>, moved: &Tensor<2>| take_rows(Tensor::cat(vec![scene, moved.clone()], 0), &taken);
        Self {
            means: table(means, &samples.means),
            quats: table(quats, &samples.quats),
            scene,
            further: instants - 1,
            moving: rows,
        }
    }

    /// A parameter of the scene for every row of the table.
    fn of_rows<const D: usize>(&self, parameter: Tensor<D>) -> Tensor<D> {
        if self.further == 0 {
            return parameter;
        }
        let further = self.repeated(parameter.clone(), self.further);
        Tensor::cat(vec![parameter, further], 0)
    }

    /// The moving rows of a parameter of the scene, once for each of some further instants.
    fn repeated<const D: usize>(&self, parameter: Tensor<D>, instants: usize) -> Tensor<D> {
        let moving = take_rows(parameter, &self.moving);
        let mut shape = moving.dims();
        let numbers = shape.iter().product();
        shape[0] *= instants;
        moving.reshape([1, numbers]).expand([instants, numbers]).reshape(shape)
    }

    /// Colours of all rows. The coefficients of the scene, by far the most numbers of a Gaussian, are not copied; those
    /// of what moves are.
    fn colors(&self, sh: Tensor<3>, viewmat: &Tensor<2>, projected: &Tensor<2>, degree: usize) -> Tensor<2> {
        let part = |first: usize, count: usize, sh: Tensor<3>| {
            let [means, rows] = [&self.means, projected].map(|rows| match self.further {
                0 => rows.clone(),
                _ => rows.clone().narrow(0, first, count),
            });
            sh_colors(means, sh, viewmat.clone(), rows, degree)
        };
        let mut parts = vec![part(0, self.scene, sh.clone())];
        // Repeated coefficients are one buffer, so a device may ask for a part of the instants at a time.
        let [moving] = self.moving.dims();
        let instants = copies_within(largest_buffer(&self.means.device()), moving * sh.dims()[1] * 3);
        for first in (0..self.further).step_by(instants) {
            let count = instants.min(self.further - first);
            let own = self.repeated(sh.clone(), count);
            parts.push(part(self.scene + first * moving, count * moving, own));
        }
        concatenated(parts)
    }
}

/// The tensors concatenated along the rows; a single one is not copied.
fn concatenated(mut parts: Vec<Tensor<2>>) -> Tensor<2> {
    if parts.len() == 1 { parts.remove(0) } else { Tensor::cat(parts, 0) }
}

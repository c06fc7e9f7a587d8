//! Front-to-back blending of projected Gaussians; the pixel's formula is in [`gs_kernels::cpu::blend`].

mod reference;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{DType, Tensor, assert_shape};
pub use gs_kernels::config::RasterizeConfig;
use gs_kernels::constants::TILE;
use gs_kernels::cpu::intersect::IntersectionSlices;
use gs_kernels::cpu::rasterize as cpu;
use gs_kernels::rows::PROJECTED;
pub use gs_kernels::rows::SCREEN;

use super::assert_same_dtype;
use super::intersect::TileIntersections;
use super::operation::{Operation, Output, State, Tensors, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, int_tensor, with_float};
pub use reference::rasterize_reference;

/// Blends Gaussians into an image, front to back.
///
/// - `projected` `[N, 8]`: rows of [`project`](super::projection::project)
/// - `opacities` `[N]`: 0 to 1
/// - `features` `[N, C]`: colours or anything else to blend
/// - `background` `[C]`: colour behind all Gaussians
/// - `screen` `[N, 4]`: zeros; their gradient is a statistic for density control: the gradient with respect to the 2D
///   mean in pixels (x, y) summed over pixels, and the sum over pixels of its absolute contributions (x, y)
/// - `intersections`: from [`intersect`](super::intersect::intersect) with the same rows, opacities and features
///
/// Returns `[H, W, C + depth + 1]`: features over the background, accumulated depth (no background) if requested, and
/// alpha. For intersections with `places` it returns `[tiles, 256, C + depth + 1]`, the pixels of one tile per list. A
/// contribution under `ALPHA_MIN` is dropped, alpha is capped at `ALPHA_MAX` and a pixel ends at `TRANSMITTANCE_MIN`,
/// see [`gs_kernels::constants`]. Differentiable with respect to all float tensors; the compensation and radius columns
/// have no gradient.
///
/// # Panics
/// When shapes or float types disagree.
pub fn rasterize(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    background: Tensor<1>,
    screen: Option<Tensor<2>>,
    intersections: &TileIntersections,
    config: &RasterizeConfig,
) -> Tensor<3> {
    check(&projected, &opacities, &features, &background, screen.as_ref(), config);
    let [count, _] = projected.dims();
    assert_shape!(intersections.gaussian_offsets, [count + 1]);
    let _stage = profile::stage("rasterize");
    // Burn's dispatch has no optional tensors. An untracked substitute receives no gradient and is never read.
    let screen = screen.unwrap_or_else(|| Tensor::empty([1, SCREEN], (&projected.device(), projected.dtype())));
    let TileIntersections { tile_offsets, gaussian_ids, gaussian_offsets, positions, places, count: _ } =
        intersections.clone();
    let places = places.unwrap_or_else(|| Tensor::from_data([0_i32; 0], (&gaussian_ids.device(), DType::I32)));
    let [projected, features, screen] = [projected, features, screen].map(Tensor::into_dispatch);
    let [opacities, background] = [opacities, background].map(Tensor::into_dispatch);
    let inputs = [projected, opacities, features, background, screen];
    let lists = [tile_offsets, gaussian_ids, gaussian_offsets, positions, places].map(Tensor::into_dispatch);
    differentiable(Rasterization(*config), inputs, lists)
}

fn check(
    projected: &Tensor<2>,
    opacities: &Tensor<1>,
    features: &Tensor<2>,
    background: &Tensor<1>,
    screen: Option<&Tensor<2>>,
    config: &RasterizeConfig,
) {
    let ([count, _], channels) = (projected.dims(), config.channels);
    assert_shape!(projected, [count, PROJECTED]);
    assert_shape!(opacities, [count]);
    assert_shape!(features, [count, channels]);
    assert_shape!(background, [channels]);
    if let Some(screen) = screen {
        assert_shape!(screen, [count, SCREEN]);
        assert_same_dtype("screen", screen, "projected", projected);
    }
    assert_same_dtype("opacities", opacities, "projected", projected);
    assert_same_dtype("features", features, "projected", projected);
    assert_same_dtype("background", background, "projected", projected);
}

/// [`rasterize`] as an operation. Its inputs are projected rows, opacities, features, background and the screen tensor,
/// whose numbers are never read; its lists are those of [`TileIntersections`]. What it saves is the backend's own.
#[derive(Clone, Debug)]
pub(crate) struct Rasterization(pub(crate) RasterizeConfig);

impl Rasterization {
    /// Shape of the image, or of the drawn tiles where there are `places` of tiles.
    pub(crate) fn output_shape(&self, places: usize) -> [usize; 3] {
        let channels = self.0.output_channels();
        match places {
            0 => [self.0.height as usize, self.0.width as usize, channels],
            tiles => [tiles, TILE * TILE, channels],
        }
    }
}

fn slices<B: HostBackend>(lists: &[IntTensor<B>; 5]) -> IntersectionSlices<'_> {
    let [tile_offsets, gaussian_ids, gaussian_offsets, positions, places] = lists.each_ref().map(|t| t.elements());
    IntersectionSlices { tile_offsets, gaussian_ids, gaussian_offsets, positions, places }
}

impl Operation<5, 5> for Rasterization {
    const BACKWARD: Option<&'static str> = Some("rasterize, backward");

    fn forward<B: HostBackend>(
        &self,
        [projected, opacities, features, background, _screen]: [FloatTensor<B>; 5],
        lists: [IntTensor<B>; 5],
        tracked: bool,
    ) -> Output<B> {
        let (config, shape) = (&self.0, self.output_shape(lists[4].shape()[0]));
        with_float!(projected, F => {
            let (rows, opacities, features) = (projected.elements::<F>(), opacities.elements(), features.elements());
            let (background, lists) = (background.elements(), slices::<B>(&lists));
            if !tracked {
                let output = cpu::forward(config, rows, opacities, features, background, lists);
                return Output::of(float_tensor::<B>(output, shape));
            }
            let (output, changed) = cpu::forward_saving(config, rows, opacities, features, background, lists);
            let saved = Tensors { floats: Vec::new(), ints: vec![int_tensor::<B>(changed)] };
            Output { tensor: float_tensor::<B>(output, shape), saved }
        })
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 5, 5>,
        v_output: FloatTensor<B>,
        _: [bool; 5],
    ) -> [Option<FloatTensor<B>>; 5] {
        let ([projected, opacities, features, background, _screen], config) = (&state.inputs(), &self.0);
        let count = projected.shape()[0];
        with_float!(*projected, F => {
            let gradients = cpu::backward::<F>(
                config,
                projected.elements(),
                opacities.elements(),
                features.elements(),
                background.elements(),
                slices::<B>(&state.lists),
                v_output.elements(),
                state.saved.ints.first().map(|words| words.elements()),
            );
            [
                Some(float_tensor::<B>(gradients.projected, [count, PROJECTED])),
                Some(float_tensor::<B>(gradients.opacities, [count])),
                Some(float_tensor::<B>(gradients.features, [count, config.channels])),
                Some(float_tensor::<B>(gradients.background, [config.channels])),
                Some(float_tensor::<B>(gradients.screen, [count, SCREEN])),
            ]
        })
    }
}

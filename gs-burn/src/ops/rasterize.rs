//! Front-to-back blending of projected Gaussians; the pixel's formula is in [`gs_kernels::cpu::blend`].

mod reference;
#[cfg(test)]
mod tests;

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{DType, Tensor, assert_shape};
pub use gs_kernels::config::RasterizeConfig;
use gs_kernels::constants::TILE;
use gs_kernels::cpu::intersect::IntersectionSlices;
use gs_kernels::cpu::rasterize as cpu;
use gs_kernels::rows::PROJECTED;
pub use gs_kernels::rows::SCREEN;

use super::assert_same_dtype;
use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use super::intersect::{IntersectionLists, TileIntersections};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, int_tensor, with_float};
pub use reference::rasterize_reference;

/// Blends Gaussians into an image, front to back.
///
/// - `projected` `[N, 8]`: rows of [`project`](super::projection::project)
/// - `opacities` `[N]`: 0 to 1
/// - `features` `[N, C]`: colours or anything else to blend
/// - `background` `[C]`: colour behind all Gaussians
/// - `screen` `[N, 4]`: zeros; their gradient is a statistic for density control: the gradient with respect to the 2D mean in
///   pixels (x, y) summed over pixels, and the sum over pixels of its absolute contributions (x, y)
/// - `intersections`: from [`intersect`](super::intersect::intersect) with the same rows, opacities and features
///
/// Returns `[H, W, C + depth + 1]`: features over the background, accumulated depth (no background) if requested, and alpha. For
/// intersections with `places` it returns `[tiles, 256, C + depth + 1]`, the pixels of one tile per list. A contribution under
/// `ALPHA_MIN` is dropped, alpha is capped at `ALPHA_MAX` and a pixel ends at `TRANSMITTANCE_MIN`, see [`gs_kernels::constants`].
/// Differentiable with respect to all float tensors; the compensation and radius columns have no gradient.
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
    Tensor::from_dispatch(Dispatch::rasterize(
        projected.into_dispatch(),
        opacities.into_dispatch(),
        features.into_dispatch(),
        background.into_dispatch(),
        screen.into_dispatch(),
        IntersectionLists {
            tile_offsets: tile_offsets.into_dispatch(),
            gaussian_ids: gaussian_ids.into_dispatch(),
            gaussian_offsets: gaussian_offsets.into_dispatch(),
            positions: positions.into_dispatch(),
            places: places.into_dispatch(),
        },
        *config,
    ))
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

/// Burn's dispatch for [`rasterize`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait RasterizeOps: Backend {
    /// See [`rasterize`]; the forward pass does not read `screen`.
    fn rasterize(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        background: FloatTensor<Self>,
        screen: FloatTensor<Self>,
        #[extension_type] intersections: IntersectionLists<Self>,
        config: RasterizeConfig,
    ) -> FloatTensor<Self>;
}

/// Inputs of a rasterization, as a backend's primitives; tensors may be strided.
#[derive(Clone, Debug)]
pub struct RasterizeInputs<B: Backend> {
    /// `[N, 8]`
    pub projected: FloatTensor<B>,
    /// `[N]`
    pub opacities: FloatTensor<B>,
    /// `[N, C]`
    pub features: FloatTensor<B>,
    /// `[C]`
    pub background: FloatTensor<B>,
    /// Tiles and their Gaussians.
    pub intersections: IntersectionLists<B>,
    /// Size of the output.
    pub config: RasterizeConfig,
}

impl<B: Backend> RasterizeInputs<B> {
    /// Shape of the output: an image, or tiles if the lists have `places`.
    pub fn output_shape(&self) -> [usize; 3] {
        let channels = self.config.output_channels();
        match self.intersections.places.shape()[0] {
            0 => [self.config.height as usize, self.config.width as usize, channels],
            tiles => [tiles, TILE * TILE, channels],
        }
    }
}

/// Gradients of [`RasterizeKernels::rasterize_forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct RasterizeGradients<B: Backend> {
    /// `[N, 8]`; compensation and radius columns are zero.
    pub projected: FloatTensor<B>,
    /// `[N]`
    pub opacities: FloatTensor<B>,
    /// `[N, C]`
    pub features: FloatTensor<B>,
    /// `[C]`, if it was wanted.
    pub background: Option<FloatTensor<B>>,
    /// `[N, 4]`: see `screen` of [`rasterize`].
    pub screen: FloatTensor<B>,
}

/// Result of [`RasterizeKernels::rasterize_forward`].
#[derive(Clone, Debug)]
pub struct RasterizeForward<B: Backend> {
    /// The image, or tiles; see [`RasterizeInputs::output_shape`].
    pub output: FloatTensor<B>,
    /// What the backend's backward reads of its forward, beside the inputs.
    pub saved: Option<RasterizeSaved<B>>,
}

/// State of a forward pass, of a layout that is the backend's own.
#[derive(Clone, Debug)]
pub struct RasterizeSaved<B: Backend> {
    /// Numbers by Gaussian, on a GPU.
    pub rows: FloatTensor<B>,
    /// Words by pixel on a GPU, by pair on the CPU.
    pub words: IntTensor<B>,
}

/// Rasterization on a backend's primitives, without gradient tracking.
pub trait RasterizeKernels: Backend {
    /// The image `[H, W, C + depth + 1]`, or tiles; with `save`, also what the backward needs.
    fn rasterize_forward(inputs: RasterizeInputs<Self>, save: bool) -> RasterizeForward<Self>;

    /// Gradients from what the forward `saved` and `v_output`, the gradient with respect to its output. That of the background may be
    /// left out unless `of_background`.
    fn rasterize_backward(
        inputs: RasterizeInputs<Self>,
        saved: Option<RasterizeSaved<Self>>,
        v_output: FloatTensor<Self>,
        of_background: bool,
    ) -> RasterizeGradients<Self>;
}

impl<B: RasterizeKernels> RasterizeOps for B {
    fn rasterize(
        projected: FloatTensor<B>,
        opacities: FloatTensor<B>,
        features: FloatTensor<B>,
        background: FloatTensor<B>,
        _screen: FloatTensor<B>,
        intersections: IntersectionLists<B>,
        config: RasterizeConfig,
    ) -> FloatTensor<B> {
        let inputs = RasterizeInputs { projected, opacities, features, background, intersections, config };
        B::rasterize_forward(inputs, false).output
    }
}

impl<B: HostBackend> RasterizeInputs<B> {
    fn contiguous(self) -> Self {
        let lists = self.intersections;
        Self {
            projected: self.projected.contiguous(),
            opacities: self.opacities.contiguous(),
            features: self.features.contiguous(),
            background: self.background.contiguous(),
            intersections: IntersectionLists {
                tile_offsets: lists.tile_offsets.contiguous(),
                gaussian_ids: lists.gaussian_ids.contiguous(),
                gaussian_offsets: lists.gaussian_offsets.contiguous(),
                positions: lists.positions.contiguous(),
                places: lists.places.contiguous(),
            },
            config: self.config,
        }
    }
}

impl<B: HostBackend> IntersectionLists<B> {
    fn as_slices(&self) -> IntersectionSlices<'_> {
        IntersectionSlices {
            tile_offsets: self.tile_offsets.elements(),
            gaussian_ids: self.gaussian_ids.elements(),
            gaussian_offsets: self.gaussian_offsets.elements(),
            positions: self.positions.elements(),
            places: self.places.elements(),
        }
    }
}

impl<B: HostBackend> RasterizeKernels for B {
    fn rasterize_forward(inputs: RasterizeInputs<B>, save: bool) -> RasterizeForward<B> {
        let inputs = inputs.contiguous();
        let RasterizeInputs { projected, opacities, features, background, intersections, config } = &inputs;
        with_float!(*projected, F => {
            let (rows, opacities, features) = (projected.elements::<F>(), opacities.elements(), features.elements());
            let (background, lists) = (background.elements(), intersections.as_slices());
            let (output, changed) = match save {
                false => (cpu::forward(config, rows, opacities, features, background, lists), None),
                true => {
                    let (output, changed) = cpu::forward_saving(config, rows, opacities, features, background, lists);
                    (output, Some(changed))
                }
            };
            RasterizeForward {
                output: float_tensor::<B>(output, inputs.output_shape()),
                saved: changed.map(|changed| RasterizeSaved {
                    rows: float_tensor::<B>(Vec::<F>::new(), [0]),
                    words: int_tensor::<B>(changed),
                }),
            }
        })
    }

    fn rasterize_backward(
        inputs: RasterizeInputs<B>,
        saved: Option<RasterizeSaved<B>>,
        v_output: FloatTensor<B>,
        _of_background: bool,
    ) -> RasterizeGradients<B> {
        let (inputs, v_output) = (inputs.contiguous(), v_output.contiguous());
        let RasterizeInputs { projected, opacities, features, background, intersections, config } = &inputs;
        let count = projected.shape()[0];
        with_float!(*projected, F => {
            let gradients = cpu::backward::<F>(
                config,
                projected.elements(),
                opacities.elements(),
                features.elements(),
                background.elements(),
                intersections.as_slices(),
                v_output.elements(),
                saved.as_ref().map(|saved| saved.words.elements()),
            );
            RasterizeGradients {
                projected: float_tensor::<B>(gradients.projected, [count, PROJECTED]),
                opacities: float_tensor::<B>(gradients.opacities, [count]),
                features: float_tensor::<B>(gradients.features, [count, config.channels]),
                background: Some(float_tensor::<B>(gradients.background, [config.channels])),
                screen: float_tensor::<B>(gradients.screen, [count, SCREEN]),
            }
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct RasterizeState<B: Backend> {
    inputs: RasterizeInputs<B>,
    saved: Option<RasterizeSaved<B>>,
}

#[derive(Debug)]
struct RasterizeBackward;

impl<B: RasterizeKernels> Backward<B, 5> for RasterizeBackward {
    type State = RasterizeState<B>;

    fn backward(self, ops: Ops<Self::State, 5>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("rasterize, backward");
        let v_output = grads.consume::<B>(&ops.node);
        let parents = ops.parents.map(|node| node.map(|node| node.id));
        let [of_projected, of_opacities, of_features, of_background, of_screen] = parents;
        let RasterizeState { inputs, saved } = ops.state;
        let RasterizeGradients { projected, opacities, features, background, screen } =
            B::rasterize_backward(inputs, saved, v_output, of_background.is_some());
        let others = [of_projected, of_opacities, of_features, of_screen];
        gradient::register::<B, 4>(grads, others, [projected, opacities, features, screen]);
        if let (Some(node), Some(background)) = (of_background, background) {
            grads.register::<B>(node, background);
        }
    }
}

impl<B: RasterizeKernels, C: CheckpointStrategy> RasterizeOps for Autodiff<B, C> {
    fn rasterize(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        background: FloatTensor<Self>,
        screen: FloatTensor<Self>,
        intersections: IntersectionLists<Self>,
        config: RasterizeConfig,
    ) -> FloatTensor<Self> {
        let (projected, projected_node) = projected.into_parts();
        let (opacities, opacities_node) = opacities.into_parts();
        let (features, features_node) = features.into_parts();
        let (background, background_node) = background.into_parts();
        let nodes = [projected_node, opacities_node, features_node, background_node, screen.node()];
        let IntersectionLists { tile_offsets, gaussian_ids, gaussian_offsets, positions, places } = intersections;
        let intersections = IntersectionLists::<B> { tile_offsets, gaussian_ids, gaussian_offsets, positions, places };
        let inputs = RasterizeInputs { projected, opacities, features, background, intersections, config };
        match RasterizeBackward.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let RasterizeForward { output, saved } = B::rasterize_forward(inputs.clone(), true);
                prep.finish(RasterizeState { inputs, saved }, output)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::rasterize_forward(inputs, false).output),
        }
    }
}

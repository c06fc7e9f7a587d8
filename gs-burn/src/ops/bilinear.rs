//! An image between its pixels: bilinear sampling, differentiable by image and position.
//!
//! The gradient of Burn's `select`, which the reference is made of, adds rows in one thread a channel on a GPU: seconds
//! for an image that is looked up at each pixel. Here every value of the image has one writer, which adds its lookups
//! in a fixed order, so results are equal to the bit from run to run.

mod reference;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::bilinear as cpu;
pub use reference::bilinear_reference;

use super::assert_same_dtype;
use super::operation::{Operation, Output, State, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Values of `image` `[H, W, C]` at `positions` `[P, 2]` (x, y in pixels, the first pixel's centre at (0.5, 0.5)), `[P,
/// C]`. Differentiable by both.
///
/// Beyond the outermost centres the image goes on as it is at its border. The gradient by position is the slope of the
/// bilinear patch, zero beyond the border; on a line between two patches the right or lower patch counts. A position
/// that is not a number gives values that are none.
///
/// # Panics
/// When the image has no pixels, the float types disagree, or the positions are not pairs.
pub fn bilinear(image: Tensor<3>, positions: Tensor<2>) -> Tensor<2> {
    check(&image, &positions);
    let _stage = profile::stage("bilinear lookup");
    differentiable(Lookup, [image.into_dispatch(), positions.into_dispatch()], [])
}

fn check(image: &Tensor<3>, positions: &Tensor<2>) {
    let [height, width, _] = image.dims();
    assert!(height > 0 && width > 0, "an image to sample must have pixels, it has {width} x {height}");
    let count = positions.dims()[0];
    assert_shape!(positions, [count, 2]);
    assert_same_dtype("positions", positions, "image", image);
}

/// [`bilinear`] as an operation.
#[derive(Clone, Debug)]
pub(crate) struct Lookup;

impl Operation<2> for Lookup {
    const BACKWARD: Option<&'static str> = Some("bilinear lookup, backward");

    fn forward<B: HostBackend>(
        &self,
        [image, positions]: [FloatTensor<B>; 2],
        []: [IntTensor<B>; 0],
        _: bool,
    ) -> Output<B> {
        let ([height, width, channels], count) = (image.shape().dims(), positions.shape()[0]);
        with_float!(image, F => {
            let values = cpu::forward::<F>(image.elements(), [height, width], channels, positions.elements());
            Output::of(float_tensor::<B>(values, [count, channels]))
        })
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 2, 0>,
        v: FloatTensor<B>,
        [of_image, of_positions]: [bool; 2],
    ) -> [Option<FloatTensor<B>>; 2] {
        let [image, positions] = state.inputs();
        let ([height, width, channels], count) = (image.shape().dims(), positions.shape()[0]);
        with_float!(image, F => {
            let (image, size, positions, v) = (image.elements(), [height, width], positions.elements(), v.elements());
            let by_image = || cpu::by_image::<F>(size, channels, positions, v);
            let by_positions = || cpu::by_positions::<F>(image, size, channels, positions, v);
            [
                of_image.then(|| float_tensor::<B>(by_image(), [height, width, channels])),
                of_positions.then(|| float_tensor::<B>(by_positions(), [count, 2])),
            ]
        })
    }
}

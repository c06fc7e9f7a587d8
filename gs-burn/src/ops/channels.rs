//! A range of an image's channels, as an image.
//!
//! `narrow` returns a strided view that every later op must make contiguous, and its gradient takes three passes over
//! the image; for an image of Gaussians that took as long as projecting them. This op takes one pass in each direction.

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::Tensor;
use rayon::prelude::*;

use super::operation::{Operation, Output, State, differentiable};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Channels `first..first + count` of `image` `[H, W, C]`, `[H, W, count]`. Differentiable.
///
/// # Panics
/// When the image has fewer channels.
pub fn channels(image: Tensor<3>, first: usize, count: usize) -> Tensor<3> {
    let [_, _, total] = image.dims();
    assert!(first + count <= total, "channels {first}..{} of an image that has {total}", first + count);
    differentiable(Channels { first, count, total }, [image.into_dispatch()], [])
}

/// [`channels`] as an operation: `count` channels from `first` on, of `total`.
#[derive(Clone, Debug)]
pub(crate) struct Channels {
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) total: usize,
}

impl Operation<1> for Channels {
    const READS_INPUTS: bool = false;

    fn forward<B: HostBackend>(&self, [image]: [FloatTensor<B>; 1], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        let (&Self { first, count, total }, [height, width, _]) = (self, image.shape().dims());
        with_float!(image, F => {
            let mut part = vec![F::default(); height * width * count];
            copy(image.elements::<F>(), total, first, &mut part, count, 0, [height, width], count);
            Output::of(float_tensor::<B>(part, [height, width, count]))
        })
    }

    fn backward<B: HostBackend>(
        &self,
        _: State<B, 1, 0>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        let (&Self { first, count, total }, [height, width, _]) = (self, v.shape().dims());
        with_float!(v, F => {
            let mut whole = vec![F::default(); height * width * total];
            copy(v.elements::<F>(), count, 0, &mut whole, total, first, [height, width], count);
            [Some(float_tensor::<B>(whole, [height, width, total]))]
        })
    }
}

/// Copies `count` channels of every pixel from channel `from_first` of `from_total` to channel `to_first` of
/// `to_total`.
fn copy<F: Copy + Send + Sync>(
    from: &[F],
    from_total: usize,
    from_first: usize,
    to: &mut [F],
    to_total: usize,
    to_first: usize,
    [height, width]: [usize; 2],
    count: usize,
) {
    if height * width * count == 0 {
        return;
    }
    let rows = to.par_chunks_exact_mut(width * to_total).zip(from.par_chunks_exact(width * from_total));
    rows.for_each(|(to, from)| {
        for (to, from) in to.chunks_exact_mut(to_total).zip(from.chunks_exact(from_total)) {
            to[to_first..to_first + count].copy_from_slice(&from[from_first..from_first + count]);
        }
    });
}

//! The bilinear lookup in plain tensor operations.

use burn::tensor::Tensor;

/// Reference of [`bilinear`](super::bilinear()): the same arguments, result and gradients, one tensor operation at a
/// time.
///
/// # Panics
/// When the image has no pixels, the float types disagree, or the positions are not pairs.
pub fn bilinear_reference(image: Tensor<3>, positions: Tensor<2>) -> Tensor<2> {
    super::check(&image, &positions);
    let [height, width, channels] = image.dims();
    let count = positions.dims()[0];
    // Patches are named by their first pixel; an image one pixel wide has one patch, of which only that side is used.
    // Turned once, since every operation on a column of two would walk memory with a stride.
    let positions = positions.transpose();
    let x = Axis::new(positions.clone().narrow(0, 0, 1), width);
    let y = Axis::new(positions.narrow(0, 1, 1), height);
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
    // One look-up for all four corners: its backward pass then writes into one image and not into four.
    let index = corners.map(|(right, below)| x.pixel(right) + y.pixel(below) * width as f64);
    let share = corners.map(|(right, below)| x.share(right) * y.share(below));
    // Pixel numbers are whole below 2^24, the last an f32 counts to. The bound holds where a GPU's compiler takes it
    // that no number is NaN.
    let last = (height * width - 1) as i64;
    let index = Tensor::cat(index.to_vec(), 0).reshape([4 * count]).int().clamp(0, last);
    let colors = image.reshape([height * width, channels]).select(0, index);
    let share = Tensor::cat(share.to_vec(), 0).reshape([4 * count, 1]);
    (colors * share).reshape([4, count, channels]).sum_dim(0).reshape([count, channels])
}

/// Positions along one axis, between two pixels each.
struct Axis {
    /// `[1, P]`, number of the pixel at or before each, no gradient.
    first: Tensor<2>,
    /// `[1, P]`, 0 at that pixel's centre, 1 at the next one's.
    fraction: Tensor<2>,
    last: f64,
}

impl Axis {
    fn new(positions: Tensor<2>, pixels: usize) -> Self {
        let last = (pixels - 1) as f64;
        let positions = (positions - 0.5).clamp(0.0, last);
        let first = positions.clone().detach().floor().clamp(0.0, (last - 1.0).max(0.0));
        // NaN looks at pixel 0 (ndarray's conversion to whole numbers panics on it); the shares carry it.
        let first = first.clone().mask_fill(first.is_nan(), 0.0);
        Self { fraction: positions - first.clone(), first, last }
    }

    fn pixel(&self, next: f64) -> Tensor<2> {
        (self.first.clone() + next).clamp_max(self.last)
    }

    fn share(&self, next: f64) -> Tensor<2> {
        if next > 0.0 { self.fraction.clone() } else { -self.fraction.clone() + 1.0 }
    }
}

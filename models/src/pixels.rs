//! A selection of an image's pixels, as rows.
//!
//! Losses and networks that concern moving pixels work on rows of them, not on images: moving pixels are a small part
//! of most images.

use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::ops::rows::{add_rows, take_rows};

/// `P` pixels of an image of `width` x `height`.
#[derive(Debug, Clone)]
pub struct Pixels {
    /// `[P]`, `y * width + x` of each, ascending; none means all of them in order.
    index: Option<Tensor<1, Int>>,
    /// `[P, 2]`, x and y of their centres: the first pixel's is (0.5, 0.5).
    pub centres: Tensor<2>,
    /// Pixels in a row of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
}

impl Pixels {
    /// All pixels.
    pub fn all(width: usize, height: usize, device: &Device) -> Self {
        Self { index: None, centres: centres(0..width * height, width, device), width, height }
    }

    /// The pixels where `mask` `[height, width]` is not 0; none if it is 0 everywhere.
    ///
    /// # Panics
    /// When the mask is not of that size.
    pub fn masked(mask: &[u8], width: usize, height: usize, device: &Device) -> Option<Self> {
        assert_eq!(mask.len(), width * height, "a mask has one value a pixel of {width} x {height}");
        let chosen: Vec<usize> = (0..mask.len()).filter(|i| mask[*i] != 0).collect();
        if chosen.is_empty() {
            return None;
        }
        let index: Vec<i32> = chosen.iter().map(|i| *i as i32).collect();
        let index = Tensor::from_data(TensorData::new(index, [chosen.len()]), device);
        Some(Self { index: Some(index), centres: centres(chosen.into_iter(), width, device), width, height })
    }

    /// `P`.
    pub fn len(&self) -> usize {
        self.centres.dims()[0]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// These pixels of an image `[H, W, C]`, `[P, C]`; differentiable.
    pub fn of(&self, image: Tensor<3>) -> Tensor<2> {
        let [height, width, channels] = image.dims();
        assert_eq!([height, width], [self.height, self.width], "size of the image");
        let rows = image.reshape([height * width, channels]);
        match &self.index {
            None => rows,
            Some(index) => take_rows(rows, index),
        }
    }

    /// `image` `[H, W, C]` with these pixels replaced by `rows` `[P, C]`; differentiable by both.
    pub fn paste(&self, rows: Tensor<2>, image: Tensor<3>) -> Tensor<3> {
        let [height, width, channels] = image.dims();
        let Some(index) = &self.index else { return rows.reshape([height, width, channels]) };
        let below = image.reshape([height * width, channels]);
        let change = rows - take_rows(below.clone(), index);
        let pasted = add_rows(below, index, change);
        pasted.reshape([height, width, channels])
    }
}

fn centres(pixels: impl Iterator<Item = usize>, width: usize, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = pixels.flat_map(|i| [(i % width) as f32 + 0.5, (i / width) as f32 + 0.5]).collect();
    let count = values.len() / 2;
    Tensor::from_data(TensorData::new(values, [count, 2]), device)
}

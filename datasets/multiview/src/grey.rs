//! Photos reduced to grey, with their cameras.

use gs_base::Intrinsics;
use rayon::prelude::*;

use gs_datasets::View;

use crate::patch::Pixels;

/// A reduced grey photo.
pub(crate) struct Grey {
    /// Mean of the channels.
    pub pixels: Pixels,
    /// Of the reduced photo.
    pub intrinsics: Intrinsics,
    /// World to camera.
    pub viewmat: glam::DMat4,
    /// Original pixels along a side of a reduced one.
    pub step: usize,
}

impl Grey {
    /// All photos at about one width.
    pub fn all(views: &[View], width: usize) -> Vec<Self> {
        views.par_iter().map(|view| Self::of(view, width)).collect()
    }

    /// The mean of the channels over blocks of pixels, about `width` of them in a row.
    pub fn of(view: &View, width: usize) -> Self {
        let step = view.width.div_ceil(width).max(1);
        let (width, height) = ((view.width / step).max(1), (view.height / step).max(1));
        let mut values = vec![0.0; width * height];
        for (index, value) in values.iter_mut().enumerate() {
            let (x, y) = (index % width * step, index / width * step);
            let (last_x, last_y) = ((x + step).min(view.width), (y + step).min(view.height));
            let block = (y..last_y).flat_map(|row| (x..last_x).map(move |column| 3 * (row * view.width + column)));
            let sum: u32 = block.flat_map(|i| &view.image.data[i..i + 3]).map(|c| u32::from(*c)).sum();
            *value = sum as f32 / (255 * 3 * (last_x - x) * (last_y - y)) as f32;
        }
        let scale = 1.0 / step as f64;
        Self {
            pixels: Pixels { width, height, values },
            intrinsics: view.intrinsics.scaled(scale, scale),
            viewmat: view.c2w.inverse(),
            step,
        }
    }
}

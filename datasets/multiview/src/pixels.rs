//! Pixels of a view: colour, and whether the view's own mask lets them count.

use gs_datasets::View;

/// Whether the view's own mask lets a pixel count.
pub(crate) fn counts(view: &View, pixel: usize) -> bool {
    view.mask.as_ref().is_none_or(|mask| mask[pixel] != 0)
}

/// Colour of a pixel, levels of 255.
pub(crate) fn color(view: &View, pixel: usize) -> [u8; 3] {
    let data = &view.image.data;
    [data[3 * pixel], data[3 * pixel + 1], data[3 * pixel + 2]]
}

//! Pixels of a view: colour, and whether the view's own mask lets them count.

use gs_base::statistics::median_by;
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

/// The median of each channel; `None` of no colour.
pub(crate) fn median_color(colors: &[[u8; 3]]) -> Option<[u8; 3]> {
    let median = |channel: usize| {
        let mut values: Vec<u8> = colors.iter().map(|color| color[channel]).collect();
        median_by(&mut values, u8::cmp)
    };
    Some([median(0)?, median(1)?, median(2)?])
}

//! A raster of numbers at a size of its own.

use gs_base::npy::Array;

/// `[height, width, channels]` values, row by row from the top left. No side is 0.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Map<T> {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    pub values: Vec<T>,
}

impl<T: Copy> Map<T> {
    /// `None` when a side is 0 or `values` has another length.
    pub fn new(width: usize, height: usize, channels: usize, values: Vec<T>) -> Option<Self> {
        let length = width.checked_mul(height)?.checked_mul(channels)?;
        (length > 0 && length == values.len()).then_some(Self { width, height, channels, values })
    }

    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The values at `target` (width, height): each new pixel takes the old one that its centre lies in. Depth and
    /// masks are never averaged: the mean of a near and a far surface is a depth where nothing is.
    pub fn nearest(self, target: (usize, usize)) -> Vec<T> {
        if self.size() == target {
            return self.values;
        }
        let pick = |i: usize, old: usize, new: usize| ((2 * i + 1) * old / (2 * new)).min(old - 1);
        let columns: Vec<usize> = (0..target.0).map(|x| pick(x, self.width, target.0)).collect();
        let mut out = Vec::with_capacity(target.0 * target.1 * self.channels);
        for y in 0..target.1 {
            let row = pick(y, self.height, target.1) * self.width;
            for x in &columns {
                let start = (row + x) * self.channels;
                out.extend_from_slice(&self.values[start..start + self.channels]);
            }
        }
        out
    }
}

impl Map<f32> {
    /// An array as one plane, `(H, W)`, `(1, H, W)` or `(H, W, 1)`, or with `channels` above 1 as `(H, W, channels)`.
    pub fn of_array(array: Array, channels: usize) -> Option<Self> {
        let (height, width) = match *array.shape.as_slice() {
            [height, width] if channels == 1 => (height, width),
            [1, height, width] if channels == 1 => (height, width),
            [height, width, last] if last == channels => (height, width),
            _ => return None,
        };
        Self::new(width, height, channels, array.values.into_iter().map(|value| value as f32).collect())
    }
}

/// Largest difference in proportions that is put down to rounding: a network that works on multiples of 14 pixels
/// makes 518 x 392 of 1024 x 768, 0.9 % off. Beyond it the map shows another part of the scene than the photo.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Whether a map of `size` can be a picture of the same view as a photo of `photo` (width, height).
pub(crate) fn same_shape(size: (usize, usize), photo: (usize, usize)) -> bool {
    let ratio = size.0 as f64 * photo.1 as f64 / (size.1 as f64 * photo.0 as f64);
    (ratio - 1.0).abs() <= ASPECT_TOLERANCE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_pixel_takes_the_old_one_under_its_centre() {
        let map = Map::new(5, 2, 1, (0..10).collect()).expect("a map");
        // Centres of two new pixels lie at 1.25 and 3.75 of 5, of one new row at 1 of 2, which is the second row.
        assert_eq!(map.clone().nearest((2, 1)), [6, 8]);
        assert_eq!(map.clone().nearest((5, 2)), map.values);
        assert_eq!(map.nearest((10, 2))[..4], [0, 0, 1, 1]);
        let pairs = Map::new(2, 1, 2, vec![1, 2, 3, 4]).expect("a map");
        assert_eq!(pairs.nearest((1, 1)), [3, 4]);
    }

    #[test]
    fn a_map_without_pixels_is_none() {
        assert!(Map::new(0, 4, 1, Vec::<f32>::new()).is_none());
        assert!(Map::new(usize::MAX, 2, 1, vec![0.0_f32]).is_none());
        assert!(same_shape((518, 392), (1024, 768)) && !same_shape((768, 1024), (1024, 768)));
    }
}

//! Downscaling by area: every new pixel is the exact mean of the rectangle of old pixels it covers.
//!
//! New pixel `i` of `w` covers `[i W/w, (i+1) W/w)` of `W` old ones; an old pixel cut by an edge counts by the part
//! inside. The mean of the image is preserved for any ratio. The resampler takes rows one at a time, so that a photo is
//! decoded, undistorted and downscaled without ever being held in floats.

/// One axis: for each new pixel the first old pixel and the weights of the run it covers (their sum is 1).
struct Axis {
    runs: Vec<(usize, Vec<f32>)>,
}

impl Axis {
    fn new(old: usize, new: usize) -> Self {
        let ratio = old as f64 / new as f64;
        let runs = (0..new)
            .map(|i| {
                let (from, to) = (i as f64 * ratio, ((i + 1) as f64 * ratio).min(old as f64));
                let first = (from as usize).min(old - 1);
                let last = (to.ceil() as usize).clamp(first + 1, old);
                let weights = (first..last)
                    .map(|j| {
                        let part = (to.min((j + 1) as f64) - from.max(j as f64)).max(0.0);
                        (part / ratio) as f32
                    })
                    .collect();
                (first, weights)
            })
            .collect();
        Self { runs }
    }
}

/// Downscales rows of `CHANNELS` interleaved floats as they come.
pub(crate) struct AreaResampler<const CHANNELS: usize> {
    columns: Axis,
    rows: Axis,
    width: usize,
    /// Old and new size are the same.
    is_copy: bool,
    next_row: usize,
    reduced: Vec<f32>,
    output: Vec<f32>,
}

impl<const CHANNELS: usize> AreaResampler<CHANNELS> {
    /// From `old` to `new` (width, height). All sides are at least 1 and the new ones at most the old ones.
    pub fn new(old: (usize, usize), new: (usize, usize)) -> Self {
        Self {
            columns: Axis::new(old.0, new.0),
            rows: Axis::new(old.1, new.1),
            width: new.0,
            is_copy: old == new,
            next_row: 0,
            reduced: vec![0.0; new.0 * CHANNELS],
            output: vec![0.0; new.0 * new.1 * CHANNELS],
        }
    }

    /// Adds the next row of `[old width, CHANNELS]` values.
    pub fn push_row(&mut self, row: &[f32]) {
        if self.is_copy {
            let start = self.next_row * row.len();
            self.output[start..start + row.len()].copy_from_slice(row);
            self.next_row += 1;
            return;
        }
        for (pixel, (first, weights)) in self.reduced.chunks_exact_mut(CHANNELS).zip(&self.columns.runs) {
            pixel.fill(0.0);
            for (old, weight) in row[first * CHANNELS..].chunks_exact(CHANNELS).zip(weights) {
                for (sum, value) in pixel.iter_mut().zip(old) {
                    *sum += weight * value;
                }
            }
        }
        // At most two new rows share an old one, because rows only shrink; they follow the last one that is complete.
        let y = self.next_row;
        let start = self.rows.runs.partition_point(|(first, weights)| first + weights.len() <= y);
        for (new_y, (first, weights)) in self.rows.runs.iter().enumerate().skip(start) {
            if *first > y {
                break;
            }
            let weight = weights[y - first];
            let line = &mut self.output[new_y * self.width * CHANNELS..][..self.width * CHANNELS];
            for (sum, value) in line.iter_mut().zip(&self.reduced) {
                *sum += weight * value;
            }
        }
        self.next_row += 1;
    }

    /// The new image, `[height, width, CHANNELS]`, once all rows were given.
    pub fn finish(self) -> Vec<f32> {
        self.output
    }
}

/// The size to load an image at: `max_width` wide if it is wider, in proportion, at least one pixel high.
pub(crate) fn target_size(actual: (usize, usize), max_width: Option<usize>) -> (usize, usize) {
    match max_width {
        Some(width) if width < actual.0 && width > 0 => {
            let height = (actual.1 as f64 * width as f64 / actual.0 as f64).round() as usize;
            (width, height.clamp(1, actual.1))
        }
        _ => actual,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resize(image: &[f32], old: (usize, usize), new: (usize, usize)) -> Vec<f32> {
        let mut resampler = AreaResampler::<1>::new(old, new);
        for row in image.chunks_exact(old.0) {
            resampler.push_row(row);
        }
        resampler.finish()
    }

    #[test]
    fn five_to_two_by_hand() {
        // New pixel 0 covers old [0, 2.5): (1 + 2 + 3/2) / 2.5; new pixel 1 covers [2.5, 5).
        let out = resize(&[1.0, 2.0, 3.0, 4.0, 5.0], (5, 1), (2, 1));
        assert!((out[0] - 1.8).abs() < 1e-6 && (out[1] - 4.2).abs() < 1e-6, "{out:?}");
        let out = resize(&[1.0, 2.0, 3.0, 4.0, 5.0], (1, 5), (1, 2));
        assert!((out[0] - 1.8).abs() < 1e-6 && (out[1] - 4.2).abs() < 1e-6, "{out:?}");
    }

    #[test]
    fn the_mean_is_preserved_and_a_constant_stays() {
        for (old, new) in
            [((37, 23), (11, 7)), ((64, 48), (16, 12)), ((9, 9), (8, 8)), ((5, 3), (5, 3)), ((7, 2), (1, 1))]
        {
            let image: Vec<f32> = (0..old.0 * old.1).map(|i| ((i * 7919) % 251) as f32 / 251.0).collect();
            let out = resize(&image, old, new);
            let mean = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
            assert!((mean(&image) - mean(&out)).abs() < 1e-6, "{old:?} -> {new:?}");
            let flat = resize(&vec![0.25; image.len()], old, new);
            assert!(flat.iter().all(|v| (v - 0.25).abs() < 1e-6), "{old:?} -> {new:?}");
        }
    }

    #[test]
    fn target_size_keeps_proportions_and_never_enlarges() {
        assert_eq!(target_size((1296, 1936), Some(480)), (480, 717));
        assert_eq!(target_size((100, 50), Some(200)), (100, 50));
        assert_eq!(target_size((1000, 1), Some(10)), (10, 1));
        assert_eq!(target_size((100, 50), None), (100, 50));
    }
}

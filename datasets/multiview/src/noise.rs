//! Noise of a static camera's pixels between frames.

use gs_datasets::View;

use crate::cameras::StaticCamera;

/// Smallest noise assumed, levels of 255. Rounding to 8 bits alone has 0.29, but light that an object reflects on its
/// surroundings and ringing of compressed video change pixels by a few levels and would give the object a halo. A
/// change of 3 levels in every channel is still seen.
const NOISE_MIN: f32 = 1.5;

/// Ranges of brightness, each with its own noise: shot noise grows with brightness, and the encoding bends it.
const LEVELS: usize = 8;

/// A range of brightness with fewer differences than this takes the noise of the whole image.
const DIFFERENCES_MIN: u32 = 2000;

/// Largest ratio of a range's noise to the whole image's. Where only moving objects have a brightness, its
/// differences are motion.
const LEVEL_MAX: f32 = 2.0;

/// The median of |a - b| over the standard deviation of a and b, for normal noise: 0.6745 sqrt(2).
const MEDIAN_DIFFERENCE: f32 = 0.953_9;

/// Standard deviation of a camera's noise, levels of 255, by brightness.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Noise {
    by_level: [f32; LEVELS],
    /// Noise of the whole image.
    pub overall: f32,
}

impl Noise {
    /// Estimates noise by the median difference of consecutive frames, which ignores motion in less than half of the
    /// image.
    pub fn of(views: &[View], camera: &StaticCamera) -> Self {
        let mut counts = [[0_u32; 256]; LEVELS];
        for pair in camera.views.windows(2) {
            let (a, b) = (&views[pair[0]].image.data, &views[pair[1]].image.data);
            for (a, b) in a.iter().zip(b) {
                let level = (usize::from(*a) + usize::from(*b)) * LEVELS / 512;
                counts[level][usize::from(a.abs_diff(*b))] += 1;
            }
        }
        let mut all = [0_u32; 256];
        for row in &counts {
            for (sum, count) in all.iter_mut().zip(row) {
                *sum += count;
            }
        }
        let overall = deviation(&all);
        let by_level = counts.each_ref().map(|row| {
            let enough = row.iter().sum::<u32>() >= DIFFERENCES_MIN;
            if enough { deviation(row).min(LEVEL_MAX * overall) } else { overall }
        });
        // The larger of neighbouring ranges, so that a step between them never makes noise look like motion.
        let around = |i: usize| by_level[i.saturating_sub(1)..(i + 2).min(LEVELS)].iter().copied().fold(0.0, f32::max);
        Self { by_level: std::array::from_fn(around), overall }
    }

    /// The standard deviation of a channel whose pixel has this mean brightness (0 to 255).
    pub fn at(&self, level: f32) -> f32 {
        self.by_level[((level * LEVELS as f32 / 256.0) as usize).min(LEVELS - 1)]
    }
}

/// Standard deviation from a histogram of absolute differences, at least [`NOISE_MIN`].
fn deviation(counts: &[u32; 256]) -> f32 {
    let total: u64 = counts.iter().map(|count| u64::from(*count)).sum();
    let half = total as f32 / 2.0;
    let mut below = 0.0;
    for (difference, count) in counts.iter().enumerate() {
        let count = *count as f32;
        if count > 0.0 && below + count >= half {
            // A whole difference d stands for [d - 0.5, d + 0.5], the 0 for [0, 0.5].
            let (from, width) = if difference == 0 { (0.0, 0.5) } else { (difference as f32 - 0.5, 1.0) };
            return ((from + width * (half - below) / count) / MEDIAN_DIFFERENCE).max(NOISE_MIN);
        }
        below += count;
    }
    NOISE_MIN
}

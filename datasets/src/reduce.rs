//! A view at a smaller size, for learning from coarse to fine.

use crate::frame::{PhotoSource, RgbImage8, View, rounded};
use crate::resample::COVERAGE_MIN;
use crate::resize::{AreaResampler, target_size};

impl View {
    /// The view at `width` pixels, in proportion, filtered by area: each new pixel is the mean of what it covers, and
    /// counts where all of that does. Priors and truth are left out. A view that is no wider keeps its size. One that
    /// is decoded when it is asked for is reduced then.
    pub fn reduced(&self, width: usize) -> Self {
        let (old, new) = ((self.width, self.height), target_size((self.width, self.height), Some(width)));
        let intrinsics = self.intrinsics.scaled(new.0 as f64 / old.0 as f64, new.1 as f64 / old.1 as f64);
        if let Some(source) = &self.source {
            let source = Some(PhotoSource { width: Some(width), ..source.clone() });
            return Self { intrinsics, width: new.0, height: new.1, source, ..self.clone() };
        }
        let (data, rests) = rounded(&filtered::<3>(|index| self.level(index), old, new));
        let image = RgbImage8 { width: new.0, height: new.1, data };
        let of_bytes = |bytes: &Vec<u8>| filtered::<1>(|index| f32::from(bytes[index]), old, new);
        let alpha = self.alpha.as_ref().map(|alpha| rounded(&of_bytes(alpha)).0);
        let counts = |share: f32| if share >= COVERAGE_MIN * 255.0 { 255 } else { 0 };
        let mask = self.mask.as_ref().map(|mask| of_bytes(mask).into_iter().map(counts).collect());
        Self {
            name: self.name.clone(),
            image_path: self.image_path.clone(),
            time: self.time,
            camera_id: self.camera_id.clone(),
            fine: self.fine.is_some().then_some(rests),
            alpha,
            mask,
            exposure: self.exposure,
            ..Self::new(self.c2w, intrinsics, image)
        }
    }
}

/// `CHANNELS` interleaved values by their indices, row by row, filtered by area.
fn filtered<const CHANNELS: usize>(value: impl Fn(usize) -> f32, old: (usize, usize), new: (usize, usize)) -> Vec<f32> {
    let mut resampler = AreaResampler::<CHANNELS>::new(old, new);
    let mut row = vec![0.0; CHANNELS * old.0];
    for y in 0..old.1 {
        row.iter_mut().enumerate().for_each(|(x, out)| *out = value(y * CHANNELS * old.0 + x));
        resampler.push_row(&row);
    }
    resampler.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Priors, Truth};

    #[test]
    fn half_a_view_is_the_mean_of_four_pixels_seen_by_the_same_camera() {
        let mut view = View::blank(4, 2);
        view.image.data = (0..24).map(|i| 10 * (i / 3) as u8).collect();
        view.mask = Some(vec![255, 255, 255, 255, 255, 255, 255, 0]);
        view.alpha = Some(vec![255, 255, 0, 0, 255, 255, 0, 40]);
        let half = view.reduced(2);
        assert_eq!((half.width, half.height, half.image.width, half.image.height), (2, 1, 2, 1));
        // (0 + 10 + 40 + 50) / 4, (20 + 30 + 60 + 70) / 4
        assert_eq!(half.image.data, [25, 25, 25, 45, 45, 45]);
        assert_eq!(half.mask, Some(vec![255, 0]), "a pixel counts where all that it covers does");
        assert_eq!(half.alpha, Some(vec![255, 10]));
        // The same direction is at half the pixel coordinates.
        let at = glam::DVec3::new(0.3, -0.1, 1.0);
        assert!((view.intrinsics.project(at) / 2.0 - half.intrinsics.project(at)).length() < 1e-12);
        assert_eq!(view.reduced(9), View { priors: Priors::default(), truth: Truth::default(), ..view.clone() });
    }
}

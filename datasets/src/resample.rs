//! From a decoded photo to training size: lens distortion undone, masks applied, downscaled.

use crate::frame::rounded;
use crate::mask::Mask;
use crate::pixels::Photo;
use crate::resize::AreaResampler;
use crate::undistort::{Undistortion, sample};

/// A new pixel counts when at least this share of the area it covers does. All of it, up to rounding: otherwise colours
/// from masked or undefined pixels would be mixed into ones that are learned from.
pub(crate) const COVERAGE_MIN: f32 = 0.999;

/// Undistorts, masks and downscales to `target`, at most the size of the ideal image, row by row: beside the decoded
/// photo only one row is held in floats. The bytes, the rests of [`rounded`], and the mask.
pub(crate) fn resample(
    photo: Photo,
    masks: &[Mask],
    undistortion: Option<&Undistortion>,
    target: (usize, usize),
) -> (Vec<u8>, Vec<i8>, Option<Vec<u8>>) {
    let size = photo.size();
    let ideal = undistortion.map_or(size, Undistortion::ideal_size);
    let plain = masks.is_empty() && undistortion.is_none();
    let photo = match photo {
        Photo::Rgb8(image) if plain && size == target => return (image.into_raw(), Vec::new(), None),
        other => other,
    };
    let mut colors = AreaResampler::<3>::new(ideal, target);
    let mut coverage = (!plain).then(|| AreaResampler::<1>::new(ideal, target));
    let (mut row, mut row_coverage) = (vec![0.0; 3 * ideal.0], vec![1.0; ideal.0]);
    for y in 0..ideal.1 {
        match undistortion {
            Some(undistortion) => undistort_row(&photo, undistortion, y, &mut row, &mut row_coverage),
            None => photo.copy_row(y, &mut row),
        }
        colors.push_row(&row);
        if let Some(coverage) = &mut coverage {
            mask_row(masks, undistortion, y, size, &mut row_coverage);
            coverage.push_row(&row_coverage);
        }
    }
    let (data, rests) = rounded(&colors.finish());
    let mask = coverage.map(|coverage| {
        coverage.finish().into_iter().map(|share| if share >= COVERAGE_MIN { 255 } else { 0 }).collect::<Vec<u8>>()
    });
    (data, rests, mask.filter(|mask| mask.contains(&0)))
}

fn undistort_row(photo: &Photo, undistortion: &Undistortion, y: usize, row: &mut [f32], coverage: &mut [f32]) {
    for (x, (color, cover)) in row.chunks_exact_mut(3).zip(coverage).enumerate() {
        let observed = undistortion.observed(x as f64 + 0.5, y as f64 + 0.5);
        color.copy_from_slice(&observed.map_or([0.0; 3], |(u, v)| sample(photo, u, v)));
        *cover = if observed.is_some() { 1.0 } else { 0.0 };
    }
}

/// Takes what mask files ignore out of a row's coverage; `size` is the photo's.
fn mask_row(masks: &[Mask], undistortion: Option<&Undistortion>, y: usize, size: (usize, usize), coverage: &mut [f32]) {
    if masks.is_empty() {
        return;
    }
    for (x, cover) in coverage.iter_mut().enumerate() {
        let ideal = (x as f64 + 0.5, y as f64 + 0.5);
        let observed = undistortion.map_or(Some(ideal), |undistortion| undistortion.observed(ideal.0, ideal.1));
        let counts = observed.is_some_and(|(u, v)| masks.iter().all(|mask| mask.keeps(u, v, size)));
        *cover = if counts { 1.0 } else { 0.0 };
    }
}

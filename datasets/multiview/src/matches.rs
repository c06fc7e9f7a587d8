//! Patches of one photo that are found again in another, without knowledge of the cameras.
//!
//! Corners of both photos are compared with each other. A match is mutual, clear, and supported: matches near it moved
//! alike, which those by chance do not.

use glam::DVec2;

use gs_datasets::View;

use crate::grey::Grey;
use crate::patch::{Patch, TEXTURE};
use crate::pixels::counts;

/// Photos are reduced to about this width: patches then span enough to be distinctive.
pub(crate) const WIDTH: usize = 320;

/// Cells along a photo's width; each gives one corner at the most, so that corners are everywhere.
const CELLS: usize = 40;

/// Most corners of a photo: comparing those of two takes 400 x 400 patches, some milliseconds.
const CORNERS: usize = 400;

/// Distance of a patch's pixels: 7 x 7 then span 13, more than noise and less than an object.
const SPACING: f64 = 2.0;

/// Smallest correlation of a match, and its lead over any other corner.
const CORRELATION: (f64, f64) = (0.8, 0.05);

/// Reach within which matches should move alike, and how much their displacements may differ, shares of the width.
const NEARBY: (f64, f64) = (0.15, 0.04);

/// Fewest neighbours that must move alike: of 100 matches by chance, 9 lie within reach and one in 150 of these moves
/// alike.
const SUPPORT: usize = 3;

/// Corners of a photo with their patches.
pub(crate) struct Corners {
    places: Vec<DVec2>,
    patches: Vec<Patch>,
    /// Pixels in a row of the reduced photo.
    width: f64,
}

impl Corners {
    /// The strongest corner of each cell, of those whose pixel counts.
    pub fn of(grey: &Grey, view: &View) -> Self {
        let (width, height) = (grey.pixels.width, grey.pixels.height);
        let cell = (width / CELLS).max(4);
        let mut found: Vec<(f32, [usize; 2])> = Vec::new();
        for top in (0..height).step_by(cell) {
            for left in (0..width).step_by(cell) {
                let pixels = (top..(top + cell).min(height))
                    .flat_map(|y| (left..(left + cell).min(width)).map(move |x| [x, y]))
                    .filter(|[x, y]| {
                        let at = |pixel: usize, size: usize| (pixel * grey.step + grey.step / 2).min(size - 1);
                        counts(view, at(*y, view.height) * view.width + at(*x, view.width))
                    });
                let strongest = pixels.map(|pixel| (strength(grey, pixel), pixel)).max_by(|a, b| a.0.total_cmp(&b.0));
                found.extend(strongest.filter(|(strength, _)| *strength > 0.0));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let (mut places, mut patches) = (Vec::new(), Vec::new());
        for (_, pixel) in found {
            let place = DVec2::from(pixel.map(|x| x as f64 + 0.5));
            if let Some(patch) = Patch::around(&grey.pixels, place, SPACING).filter(|p| p.deviation() >= TEXTURE) {
                places.push(place);
                patches.push(patch);
            }
            if places.len() == CORNERS {
                break;
            }
        }
        Self { places, patches, width: width as f64 }
    }

    /// Supported matches with another photo: places in both, pixels of the reduced photos.
    pub fn matches(&self, other: &Self) -> Vec<[DVec2; 2]> {
        let (forward, backward) = (self.best(other), other.best(self));
        let mutual: Vec<[DVec2; 2]> = forward
            .iter()
            .enumerate()
            .filter_map(|(i, found)| {
                let j = (*found)?;
                (backward[j] == Some(i)).then(|| [self.places[i], other.places[j]])
            })
            .collect();
        let (reach, alike) = (NEARBY.0 * self.width, NEARBY.1 * self.width);
        let moves_alike = |a: &[DVec2; 2], b: &[DVec2; 2]| {
            a[0].distance(b[0]) <= reach && (a[1] - a[0]).distance(b[1] - b[0]) <= alike
        };
        // Each moves as it does itself.
        let is_supported = |a: &&[DVec2; 2]| mutual.iter().filter(|b| moves_alike(a, b)).count() > SUPPORT;
        mutual.iter().filter(is_supported).copied().collect()
    }

    /// For each corner the one of `other` that looks like it and like no other.
    fn best(&self, other: &Self) -> Vec<Option<usize>> {
        let best_of = |patch: &Patch| {
            let (mut best, mut second, mut at) = (-1.0, -1.0, None);
            for (j, candidate) in other.patches.iter().enumerate() {
                let correlation = patch.correlation(candidate);
                if correlation > best {
                    (second, best, at) = (best, correlation, Some(j));
                } else if correlation > second {
                    second = correlation;
                }
            }
            at.filter(|_| best >= CORRELATION.0 && best - second >= CORRELATION.1)
        };
        self.patches.iter().map(best_of).collect()
    }
}

/// The smaller eigenvalue of the gradients' covariance over 3 x 3 pixels (Shi and Tomasi 1994); 0 at the border.
fn strength(grey: &Grey, [x, y]: [usize; 2]) -> f32 {
    let (width, height) = (grey.pixels.width, grey.pixels.height);
    if x < 2 || y < 2 || x + 2 >= width || y + 2 >= height {
        return 0.0;
    }
    let at = |x: usize, y: usize| grey.pixels.values[y * width + x];
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for v in y - 1..=y + 1 {
        for u in x - 1..=x + 1 {
            let (dx, dy) = (at(u + 1, v) - at(u - 1, v), at(u, v + 1) - at(u, v - 1));
            (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
        }
    }
    0.5 * (xx + yy - ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt())
}

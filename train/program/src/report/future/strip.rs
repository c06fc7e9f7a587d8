//! A strip of predicted frames above the photos of the same camera and times.

use gs_datasets::View;

use super::renderer::{PredictedScene, pose_of};
use gs_train::fit::times::through_time;
use gs_train::run::pixels::image_bytes;

/// Columns at most: as many frames as a page shows side by side.
const COLUMNS: usize = 6;

/// Pixels between pictures.
const GAP: usize = 4;

/// Widest strip, pixels; wider ones are drawn smaller.
const WIDEST: usize = 1800;

/// A picture of 8 bits RGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// `[height, width, 3]`.
    pub pixels: Vec<u8>,
}

/// Predictions above photos of the camera with the most of `views`, at a few times from the first to the last.
pub fn strip(predicted: &PredictedScene, views: &[&View]) -> Picture {
    let chosen = chosen(views);
    let times: Vec<f64> = chosen.iter().map(|view| view.time.unwrap_or(0.0)).collect();
    let rows: Vec<(Picture, Picture)> = chosen
        .iter()
        .zip(through_time(predicted.scene, &times))
        .map(|(view, gaussians)| {
            let image = predicted.renderer.image(&gaussians, &pose_of(view));
            let (width, height) = (view.width, view.height);
            let predicted = Picture { width, height, pixels: image_bytes(image) };
            (predicted, Picture { width, height, pixels: view.image.data.clone() })
        })
        .collect();
    let total: usize = rows.iter().map(|(picture, _)| picture.width + GAP).sum();
    let factor = total.div_ceil(WIDEST).max(1);
    let (above, below): (Vec<Picture>, Vec<Picture>) =
        rows.into_iter().map(|(a, b)| (a.shrunk(factor), b.shrunk(factor))).unzip();
    joined(&[above, below])
}

/// The views of one camera at evenly spread times, the first and the last among them.
fn chosen<'a>(views: &[&'a View]) -> Vec<&'a View> {
    let same = |a: &View, b: &View| a.c2w == b.c2w && (a.width, a.height) == (b.width, b.height);
    let count = |view: &View| views.iter().filter(|other| same(view, other)).count();
    // `max_by_key` returns the last of equal maxima; the first camera is taken.
    let Some(most) = views.iter().rev().max_by_key(|view| count(view)) else { return Vec::new() };
    let mut own: Vec<&View> = views.iter().copied().filter(|view| same(most, view)).collect();
    own.sort_by(|a, b| a.time.unwrap_or(0.0).total_cmp(&b.time.unwrap_or(0.0)));
    if own.len() <= COLUMNS {
        return own;
    }
    (0..COLUMNS).map(|k| own[k * (own.len() - 1) / (COLUMNS - 1)]).collect()
}

/// Rows of pictures of one size on white.
pub fn joined(rows: &[Vec<Picture>]) -> Picture {
    let (columns, first) = (rows.first().map_or(0, Vec::len), rows.first().and_then(|row| row.first()));
    let Some(first) = first else { return Picture { width: 0, height: 0, pixels: Vec::new() } };
    let width = columns * (first.width + GAP) - GAP;
    let height = rows.len() * (first.height + GAP) - GAP;
    let mut pixels = vec![255; 3 * width * height];
    for (row, pictures) in rows.iter().enumerate() {
        for (column, picture) in pictures.iter().enumerate() {
            for (line, bytes) in picture.pixels.chunks_exact(3 * picture.width).enumerate() {
                let y = row * (first.height + GAP) + line;
                let start = 3 * (y * width + column * (first.width + GAP));
                pixels[start..start + bytes.len()].copy_from_slice(bytes);
            }
        }
    }
    Picture { width, height, pixels }
}

impl Picture {
    /// The picture with every `factor` x `factor` pixels averaged; what is left at the right and lower edges is
    /// dropped.
    fn shrunk(self, factor: usize) -> Self {
        if factor <= 1 {
            return self;
        }
        let (width, height) = ((self.width / factor).max(1), (self.height / factor).max(1));
        let mean = |x: usize, y: usize, channel: usize| {
            let rows = (y * factor..((y + 1) * factor).min(self.height)).flat_map(|y| {
                let columns = x * factor..((x + 1) * factor).min(self.width);
                columns.map(move |x| (x, y))
            });
            let (sum, count) = rows.fold((0_usize, 0_usize), |(sum, count), (x, y)| {
                (sum + usize::from(self.pixels[3 * (y * self.width + x) + channel]), count + 1)
            });
            (sum / count.max(1)) as u8
        };
        let mut pixels = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            for x in 0..width {
                pixels.extend([0, 1, 2].map(|channel| mean(x, y, channel)));
            }
        }
        Self { width, height, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strip_has_the_first_and_the_last_time_of_one_camera() {
        let view = |time: f64, x: f64| View {
            time: Some(time),
            c2w: glam::DMat4::from_translation(glam::DVec3::X * x),
            ..View::blank(3, 2)
        };
        let views: Vec<View> = (0..20).map(|k| view(f64::from(k), 0.0)).chain([view(1.5, 1.0)]).collect();
        let chosen = chosen(&views.iter().collect::<Vec<_>>());
        let times: Vec<f64> = chosen.iter().filter_map(|view| view.time).collect();
        assert_eq!((times.len(), times[0], times[5]), (COLUMNS, 0.0, 19.0));
    }

    #[test]
    fn pictures_shrink_to_their_means_and_stand_in_rows() {
        let picture = Picture { width: 4, height: 2, pixels: (0..24).map(|k| k * 2).collect() };
        let small = picture.clone().shrunk(2);
        assert_eq!((small.width, small.height, small.pixels[0]), (2, 1, (6 + 24 + 30) / 4));
        let both = joined(&[vec![small.clone(), small.clone()], vec![small.clone(), small.clone()]]);
        assert_eq!((both.width, both.height), (4 + GAP, 2 + GAP));
        assert_eq!(both.pixels.len(), 3 * both.width * both.height);
        assert_eq!(both.pixels[3 * (both.width - 2)..3 * both.width], small.pixels);
    }
}

//! LiDAR points drawn into an image.

use std::path::Path;

use gs_datasets::DatasetError;
use gs_datasets::image_io::write_png;

use crate::log::DrivingLog;
use crate::project::project;
use crate::sweep::Sweep;

/// Depths with the first and the last colour, metres; the colours follow the logarithm of depth, as the density of
/// points does.
const DEPTHS: (f64, f64) = (3.0, 80.0);

/// A point is a square with a side of one pixel in so many columns.
const COLUMNS_A_DOT: usize = 640;

/// The image is dimmed to this share, so that dots stand out.
const DIM: f32 = 0.6;

/// Near to far.
const COLORS: [[f32; 3]; 5] =
    [[230.0, 40.0, 30.0], [250.0, 170.0, 20.0], [120.0, 220.0, 60.0], [30.0, 190.0, 230.0], [70.0, 60.0, 220.0]];

/// Writes the image of a frame and camera with the points of a sweep over it, coloured by depth: red near, blue far.
pub(crate) fn overlay(
    log: &DrivingLog,
    frame: usize,
    camera: usize,
    sweep: &Sweep,
    path: &Path,
) -> Result<(), DatasetError> {
    let mut image = log.image(frame, camera)?;
    let (width, height) = (image.width, image.height);
    image.data.iter_mut().for_each(|value| *value = (DIM * f32::from(*value)) as u8);
    let described = &log.cameras()[camera];
    let w2c = log.camera_pose(frame, camera).unwrap_or_default().inverse();
    let mut dots: Vec<(f64, usize, usize)> = sweep
        .points
        .iter()
        .filter_map(|point| project(described, &w2c, *point))
        .map(|(pixel, z)| (z, pixel.x as usize, pixel.y as usize))
        .collect();
    // Far ones first, so that near ones lie over them.
    dots.sort_by(|a, b| b.0.total_cmp(&a.0));
    let reach = width.div_ceil(COLUMNS_A_DOT).saturating_sub(1);
    for (z, x, y) in dots {
        let color = color(z);
        for py in y..=(y + reach).min(height - 1) {
            for px in x..=(x + reach).min(width - 1) {
                let start = 3 * (py * width + px);
                image.data[start..start + 3].copy_from_slice(&color);
            }
        }
    }
    Ok(write_png(path, width, height, &image.data)?)
}

fn color(z: f64) -> [u8; 3] {
    let share = ((z / DEPTHS.0).ln() / (DEPTHS.1 / DEPTHS.0).ln()).clamp(0.0, 1.0) as f32;
    let place = share * (COLORS.len() - 1) as f32;
    let first = (place as usize).min(COLORS.len() - 2);
    let part = place - first as f32;
    std::array::from_fn(|i| (COLORS[first][i] * (1.0 - part) + COLORS[first + 1][i] * part).round() as u8)
}

//! Space carving by colours (Kutulakos and Seitz, "A theory of shape by space carving", IJCV 2000): voxels at the
//! surface whose colours differ between the photos that see them are emptied, until none is left that may go. What
//! remains contains the object, as the visual hull does, without the hollows and bulges that outlines do not show.
//!
//! Two departures. A single voxel agrees by chance, so the mean over its neighbours at the surface decides. A voxel
//! stays if it is the last one behind a pixel, so that reflections and photos of unlike brightness open no hole.

use rayon::prelude::*;

use gs_base::statistics::median_by;
use gs_datasets::View;

use crate::carve::{OCCLUDED, Silhouette, Voxels, depth_map, shown};
use crate::pixels::color;

/// Half the edge of the cube of voxels that decide together, in voxels. On three sets of five cameras, objects of 2.2,
/// the median distance of points from surfaces is 0.082, 0.050 and 0.042 with 0, 1 and 2.
const REACH: u32 = 2;

/// Largest difference of colours that counts, levels of 255: one black pixel beside white ones must not decide.
const DIFFERENCE_MOST: i8 = 76;

/// No difference: fewer than two photos see the voxel.
const UNKNOWN: i8 = i8::MIN;

/// Carving ends when a pass empties no more than this share of the surface.
const NEARLY_NONE: f64 = 1e-4;

/// A photo with what of the grid it shows.
struct Photo<'a> {
    silhouette: &'a Silhouette,
    /// Smallest and largest level of each channel in the window of a voxel around each pixel.
    ranges: Vec<[[u8; 3]; 2]>,
    /// Number of filled voxels behind each pixel.
    behind: Vec<u32>,
}

impl<'a> Photo<'a> {
    fn new(silhouette: &'a Silhouette, view: &View, voxels: &Voxels, surface: &[usize]) -> Self {
        let camera = &silhouette.camera;
        let mut depths: Vec<f64> =
            surface.iter().filter_map(|index| Some(camera.sees(at(voxels, *index))?.1)).collect();
        let depth = median_by(&mut depths, f64::total_cmp).unwrap_or(f64::INFINITY);
        // The colour of a voxel is one in its own image; interpolation mixes it with the next pixel's.
        let window = ((0.5 * voxels.edge * camera.focal() / depth).ceil() as usize).max(1);
        let mut behind = vec![0; camera.width * camera.height];
        for (pixel, _) in voxels.cells().filter_map(|cell| camera.sees(voxels.position(cell))) {
            behind[pixel] += 1;
        }
        Self { silhouette, ranges: ranges(view, window), behind }
    }
}

/// Empties the voxels that photos contradict; `views[i]` is the photo of `silhouettes[i]`. At least one voxel stays
/// behind each pixel that has one.
pub(crate) fn carve_by_photos(voxels: &mut Voxels, silhouettes: &[Silhouette], views: &[&View]) {
    let mut surface = surface_of(voxels);
    let has_pixels = |view: &View| view.image.data.len() >= 3 * view.width * view.height;
    let mut photos: Vec<Photo> = silhouettes
        .iter()
        .zip(views)
        .filter(|(_, view)| has_pixels(view))
        .map(|(silhouette, view)| Photo::new(silhouette, view, voxels, &surface))
        .collect();
    // A pass takes at most one layer on all sides.
    for _ in 0..voxels.dims.into_iter().max().unwrap_or(0) {
        let contradicted = contradicted(voxels, &photos, &surface);
        let removed = remove(voxels, &mut photos, contradicted);
        if removed as f64 <= NEARLY_NONE * surface.len() as f64 {
            break;
        }
        surface = surface_of(voxels);
    }
}

/// Indices of the voxels at the surface.
fn surface_of(voxels: &Voxels) -> Vec<usize> {
    voxels.surface().into_iter().map(|cell| voxels.index(cell)).collect()
}

fn at(voxels: &Voxels, index: usize) -> glam::DVec3 {
    voxels.position(voxels.cell(index))
}

/// Voxels of `surface` that photos contradict, the worst first.
fn contradicted(voxels: &Voxels, photos: &[Photo], surface: &[usize]) -> Vec<usize> {
    let positions: Vec<_> = surface.iter().map(|index| at(voxels, *index)).collect();
    let nearest: Vec<Vec<f64>> =
        photos.par_iter().map(|photo| depth_map(photo.silhouette, &positions, voxels.edge)).collect();
    let difference = |position: &glam::DVec3| {
        let seen = photos.iter().zip(&nearest).filter_map(|(photo, nearest)| {
            let pixel = shown(photo.silhouette, nearest, *position, OCCLUDED * voxels.edge)?;
            Some(photo.ranges[pixel])
        });
        difference(seen)
    };
    let differences: Vec<i8> = positions.par_iter().map(difference).collect();
    let mut grid = vec![UNKNOWN; voxels.filled.len()];
    surface.iter().zip(&differences).for_each(|(index, difference)| grid[*index] = *difference);
    let mean = |index: &usize| {
        let around = voxels.within(voxels.cell(*index), REACH).map(|next| grid[next]).filter(|own| *own != UNKNOWN);
        let (sum, count) = around.fold((0, 0), |(sum, count), own| (sum + i32::from(own), count + 1));
        (sum > 0 && grid[*index] != UNKNOWN).then(|| (*index, f64::from(sum) / f64::from(count)))
    };
    let mut found: Vec<(usize, f64)> = surface.par_iter().filter_map(mean).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    found.into_iter().map(|(index, _)| index).collect()
}

/// Gap between ranges of colours, levels of 255, in the channel where it is widest; negative where they overlap.
/// [`UNKNOWN`] of fewer than two ranges.
fn difference(ranges: impl Iterator<Item = [[u8; 3]; 2]>) -> i8 {
    let (mut low, mut high, mut count) = ([0_u8; 3], [255_u8; 3], 0);
    for [least, most] in ranges {
        for channel in 0..3 {
            low[channel] = low[channel].max(least[channel]);
            high[channel] = high[channel].min(most[channel]);
        }
        count += 1;
    }
    let gap = (0..3).map(|channel| i16::from(low[channel]) - i16::from(high[channel])).max().unwrap_or(0);
    let most = i16::from(DIFFERENCE_MOST);
    if count > 1 { gap.clamp(-most, most) as i8 } else { UNKNOWN }
}

/// Empties those of `voxels` in turn that are not the last behind a pixel; how many.
fn remove(voxels: &mut Voxels, photos: &mut [Photo], contradicted: Vec<usize>) -> usize {
    let mut removed = 0;
    for index in contradicted {
        let position = at(voxels, index);
        let pixels: Vec<Option<usize>> =
            photos.iter().map(|photo| Some(photo.silhouette.camera.sees(position)?.0)).collect();
        let is_last = photos.iter().zip(&pixels).any(|(photo, pixel)| pixel.is_some_and(|at| photo.behind[at] <= 1));
        if is_last {
            continue;
        }
        voxels.filled[index] = false;
        removed += 1;
        for (photo, pixel) in photos.iter_mut().zip(pixels) {
            if let Some(pixel) = pixel {
                photo.behind[pixel] -= 1;
            }
        }
    }
    removed
}

/// Smallest and largest level of each channel in the window of `2 reach + 1` pixels around each pixel.
fn ranges(view: &View, reach: usize) -> Vec<[[u8; 3]; 2]> {
    let (width, height) = (view.width, view.height);
    let pixels: Vec<[[u8; 3]; 2]> = (0..width * height).map(|pixel| [color(view, pixel); 2]).collect();
    let spread = |from: &[[[u8; 3]; 2]], along: usize, size: usize, place: fn(usize, usize) -> usize| {
        let window = |pixel: usize| {
            let middle = place(pixel, width);
            let (first, last) = (middle.saturating_sub(reach), (middle + reach).min(size - 1));
            let start = pixel - middle * along;
            (first..=last).map(|i| from[start + i * along]).reduce(joined).unwrap_or(from[pixel])
        };
        (0..from.len()).into_par_iter().map(window).collect::<Vec<_>>()
    };
    let rows = spread(&pixels, 1, width, |pixel, width| pixel % width);
    spread(&rows, width, height, |pixel, width| pixel / width)
}

fn joined(a: [[u8; 3]; 2], b: [[u8; 3]; 2]) -> [[u8; 3]; 2] {
    let each = |pick: fn(u8, u8) -> u8, i: usize| std::array::from_fn(|channel| pick(a[i][channel], b[i][channel]));
    [each(u8::min, 0), each(u8::max, 1)]
}

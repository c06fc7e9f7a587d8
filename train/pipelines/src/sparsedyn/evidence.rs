//! Evidence of motion: the pixels of a static camera that change over time, and the Gaussians that lie on them.

use glam::{DMat4, DVec2, DVec3};
use gs_base::median;
use gs_datasets::View;

/// Pixels by which a changing region is grown: the footprint of a Gaussian at its border.
const GROWN: usize = 2;

/// Largest difference of entries of two poses of one static camera, relative to the largest entry.
const ONE_POSE: f64 = 1e-6;

/// The changing pixels of one camera.
#[derive(Debug, Clone)]
pub struct CameraEvidence {
    /// World to camera, OpenCV axes.
    pub w2c: DMat4,
    /// Its intrinsics.
    pub intrinsics: gs_base::Intrinsics,
    /// Width of its photos, pixels.
    pub width: usize,
    /// Height of its photos, pixels.
    pub height: usize,
    /// `[height, width]`: whether something changes there.
    pub changes: Vec<bool>,
}

/// Least range of a colour channel over the frames of a static camera at which something moves there, 0 to 1: the noise
/// of photos stays below it.
const CHANGE: f64 = 0.06;

/// Share of the cameras that show a Gaussian which must see a change there: another body may hide it from some.
const CAMERAS: f64 = 0.5;

/// The changing pixels of each static camera among `views`; empty if a camera has no second photo, or if too few
/// cameras stand still for the evidence to mean anything.
pub fn changing_pixels(views: &[View]) -> Vec<CameraEvidence> {
    let mut cameras: Vec<Vec<&View>> = Vec::new();
    for view in views {
        match cameras.iter_mut().find(|photos| is_one_camera(photos[0], view)) {
            Some(photos) => photos.push(view),
            None => cameras.push(vec![view]),
        }
    }
    if cameras.iter().any(|photos| photos.len() < 2) {
        return Vec::new();
    }
    cameras.iter().map(|photos| evidence_of(photos)).collect()
}

fn is_one_camera(a: &View, b: &View) -> bool {
    let (first, second) = (a.c2w.to_cols_array(), b.c2w.to_cols_array());
    let scale = first.iter().fold(1.0_f64, |largest, x| largest.max(x.abs()));
    let near = first.iter().zip(second).all(|(x, y)| (x - y).abs() <= ONE_POSE * scale);
    near && (a.width, a.height) == (b.width, b.height) && a.intrinsics == b.intrinsics
}

fn evidence_of(photos: &[&View]) -> CameraEvidence {
    let first = photos[0];
    let (width, height) = (first.width, first.height);
    let (mut low, mut high) = (first.image.data.clone(), first.image.data.clone());
    for photo in &photos[1..] {
        for ((low, high), value) in low.iter_mut().zip(&mut high).zip(&photo.image.data) {
            *low = (*low).min(*value);
            *high = (*high).max(*value);
        }
    }
    let least = 255.0 * CHANGE;
    let changes = |pixel: usize| (0..3).any(|c| f64::from(high[3 * pixel + c] - low[3 * pixel + c]) >= least);
    let changing: Vec<bool> = (0..width * height).map(changes).collect();
    CameraEvidence {
        w2c: first.c2w.inverse(),
        intrinsics: first.intrinsics,
        width,
        height,
        changes: grown(&changing, width, height),
    }
}

/// A mask with every pixel set that has a set pixel within [`GROWN`] rows and columns.
fn grown(mask: &[bool], width: usize, height: usize) -> Vec<bool> {
    let along = |mask: &[bool], length: usize, count: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut out = vec![false; mask.len()];
        for line in 0..count {
            for position in 0..length {
                let near = position.saturating_sub(GROWN)..(position + GROWN + 1).min(length);
                out[at(line, position)] = near.into_iter().any(|other| mask[at(line, other)]);
            }
        }
        out
    };
    let rows = along(mask, width, height, &|y, x| y * width + x);
    along(&rows, height, width, &|x, y| y * width + x)
}

impl CameraEvidence {
    fn swept(&self, centre: DVec3) -> Option<f64> {
        let depth = self.w2c.transform_point3(centre).z;
        let pixels: Vec<DVec2> = (0..self.changes.len())
            .filter(|pixel| self.changes[*pixel])
            .map(|pixel| DVec2::new((pixel % self.width) as f64, (pixel / self.width) as f64))
            .collect();
        if depth <= 0.0 || pixels.is_empty() {
            return None;
        }
        let count = pixels.len() as f64;
        let middle = pixels.iter().sum::<DVec2>() / count;
        let spread = pixels.iter().map(|pixel| pixel.distance_squared(middle)).sum::<f64>() / count;
        Some(spread.sqrt() * depth / self.intrinsics.fx)
    }

    /// Whether something changes where the camera shows `position` (world); `None` if it does not show it.
    pub fn changes_at(&self, position: DVec3) -> Option<bool> {
        let local = self.w2c.transform_point3(position);
        if local.z <= 0.0 {
            return None;
        }
        let pixel = self.intrinsics.project(local).floor();
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < self.width as f64 && pixel.y < self.height as f64;
        inside.then(|| self.changes[pixel.y as usize * self.width + pixel.x as usize])
    }
}

/// The root mean square distance of the changing pixels from their middle, at the depth of `centre`, scene units: the
/// median over the cameras; 0 without evidence.
pub fn swept(evidence: &[CameraEvidence], centre: DVec3) -> f64 {
    median(evidence.iter().filter_map(|camera| camera.swept(centre)).collect()).unwrap_or(0.0)
}

/// The rows of `means` that may move, ascending: those at which at least half of the cameras that show them see a
/// change. All rows without evidence.
pub fn may_move(means: &[[f32; 3]], evidence: &[CameraEvidence]) -> Vec<u32> {
    let moves = |mean: &[f32; 3]| {
        let position = glam::Vec3::from(*mean).as_dvec3();
        let seen: Vec<bool> = evidence.iter().filter_map(|camera| camera.changes_at(position)).collect();
        let changing = seen.iter().filter(|changes| **changes).count();
        changing > 0 && changing as f64 >= CAMERAS * seen.len() as f64
    };
    let rows = 0..means.len() as u32;
    if evidence.is_empty() { rows.collect() } else { rows.filter(|row| moves(&means[*row as usize])).collect() }
}

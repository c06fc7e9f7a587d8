//! A world as a feed-forward reconstructor gives it: another similarity, depth with a scale and a shift in each view, noise, outliers,
//! processed images.

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::archive::{floats, npy, npz};
use super::errors;
use crate::View;

/// How photos become processed images. The side is 112 pixels in place of 518: 8 patches.
#[derive(Clone, Copy)]
pub(super) enum Photos {
    /// 160 x 120 to 112 x 84.
    Wide,
    /// 120 x 160 to 112 x 154 (10.67 patches, so 11), of which 112 rows stay.
    Cropped,
    /// 160 x 120 to 112 x 84, in a square.
    Padded,
}

impl Photos {
    /// Processed size, resized size, and rows that the photo is shifted down.
    fn sizes(self) -> ((usize, usize), (usize, usize), f64) {
        match self {
            Self::Wide => ((112, 84), (112, 84), 0.0),
            Self::Cropped => ((112, 112), (112, 154), -21.0),
            Self::Padded => ((112, 112), (112, 84), 14.0),
        }
    }
}

/// Errors of the reconstruction; shares, except `factor`.
pub(super) struct Faults {
    /// Largest error of a view's scale, and of its shift as a share of the mean depth.
    pub scale: f64,
    pub shift: f64,
    pub noise: f64,
    pub outliers: f64,
    /// Error of a predicted centre as a share of the mean distance from the first, and of an orientation in radians.
    pub cameras: f64,
    /// Depth over the scale of the cameras.
    pub factor: f64,
    /// A view whose camera is elsewhere.
    pub lost: Option<usize>,
}

impl Faults {
    pub fn usual() -> Self {
        Self { scale: 0.07, shift: 0.02, noise: 0.005, outliers: 0.02, cameras: 0.01, factor: 1.0, lost: None }
    }
}

/// The dictionary's arrays, and what an import must find.
pub(super) struct Reconstruction {
    /// Scene units for each predicted unit.
    pub scale: f64,
    views: Vec<View>,
    size: (usize, usize),
    extrinsic: Vec<f32>,
    intrinsic: Vec<f32>,
    /// Predicted camera z, `[views, height, width]`.
    pub depth: Vec<f32>,
    confidence: Vec<f32>,
    /// Predicted depth at the photos' pixels, scene units.
    plain: Vec<Vec<f32>>,
}

/// The similarity from the reconstructor's world.
const SCALE: f64 = 3.7;
const SHIFT: DVec3 = DVec3::new(0.4, -2.0, 1.0);

pub(super) fn fabricate(views: &[View], photos: Photos, faults: &Faults) -> Reconstruction {
    let mut made = Reconstruction {
        scale: SCALE,
        views: views.to_vec(),
        size: photos.sizes().0,
        extrinsic: Vec::new(),
        intrinsic: Vec::new(),
        depth: Vec::new(),
        confidence: Vec::new(),
        plain: Vec::new(),
    };
    let first = views[0].c2w.w_axis.truncate();
    let spread = views.iter().map(|view| view.c2w.w_axis.truncate().distance(first)).sum::<f64>() / views.len() as f64;
    let rng = &mut ChaCha8Rng::seed_from_u64(11);
    for (index, view) in views.iter().enumerate() {
        let error = DVec3::new(either_way(rng), either_way(rng), either_way(rng));
        made.add_camera(view, photos, if faults.lost == Some(index) { 1.5 } else { faults.cameras } * error, spread);
        made.add_depth(view, photos, faults, rng);
    }
    made
}

/// -1 to 1.
fn either_way(rng: &mut ChaCha8Rng) -> f64 {
    2.0 * rng.random::<f64>() - 1.0
}

impl Reconstruction {
    fn add_camera(&mut self, view: &View, photos: Photos, error: DVec3, spread: f64) {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 2.3));
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(error)) * DMat3::from_mat4(view.c2w);
        let centre = turn.transpose() * (view.c2w.w_axis.truncate() + spread * error - SHIFT) / SCALE;
        let to_camera = rotation.transpose() * turn;
        let moved = -(to_camera * centre);
        for (row, moved) in [0, 1, 2].into_iter().zip(moved.to_array()) {
            self.extrinsic.extend(to_camera.row(row).to_array().map(|value| value as f32));
            self.extrinsic.push(moved as f32);
        }
        let (size, resized, _) = photos.sizes();
        let k = view.intrinsics.scaled(resized.0 as f64 / view.width as f64, resized.1 as f64 / view.height as f64);
        let middle = (0.5 * size.0 as f64, 0.5 * size.1 as f64);
        self.intrinsic.extend([k.fx, 0.0, middle.0, 0.0, k.fy, middle.1, 0.0, 0.0, 1.0].map(|value| value as f32));
    }

    fn add_depth(&mut self, view: &View, photos: Photos, faults: &Faults, rng: &mut ChaCha8Rng) {
        let (size, resized, down) = photos.sizes();
        let ratio = (resized.0 as f64 / view.width as f64, resized.1 as f64 / view.height as f64);
        let truth = view.truth.depth.as_ref().expect("true depth");
        let known = truth.iter().filter(|z| **z > 0.0).count();
        let mean = truth.iter().map(|z| f64::from(*z)).sum::<f64>() / known as f64;
        let (own_scale, own_shift) = (1.0 + faults.scale * either_way(rng), mean * faults.shift * either_way(rng));
        let wrong = |z: f64| faults.factor * (z - own_shift) / own_scale;
        self.plain.push(truth.iter().map(|z| if *z > 0.0 { wrong(f64::from(*z)) as f32 } else { 0.0 }).collect());
        for (row, column) in (0..size.1).flat_map(|row| (0..size.0).map(move |column| (row, column))) {
            let x = (column as f64 + 0.5) / ratio.0;
            let y = (row as f64 + 0.5 - down) / ratio.1;
            let inside = y >= 0.0 && y < view.height as f64;
            let z = if inside { f64::from(truth[y as usize * view.width + x as usize]) } else { 0.0 };
            // Networks give the background a depth too, without confidence in it.
            let is_outlier = rng.random::<f64>() < faults.outliers;
            let z = if z <= 0.0 || is_outlier { mean * (0.5 + rng.random::<f64>()) } else { z };
            let noise = 1.0 + faults.noise * 3.0_f64.sqrt() * either_way(rng);
            self.depth.push((wrong(z) * noise / SCALE) as f32);
            self.confidence.push(if inside && !is_outlier { 5.0 + rng.random::<f32>() } else { 1.5 });
        }
    }

    /// Writes the archive, with a pickled array in it, as VGGT's demo does.
    pub fn save(&self, path: &Path, deflated: bool) {
        let (count, (width, height)) = (self.views.len(), self.size);
        let entries = [
            ("extrinsic", floats(&[count, 3, 4], self.extrinsic.iter().copied())),
            ("intrinsic", floats(&[count, 3, 3], self.intrinsic.iter().copied())),
            ("depth", floats(&[count, height, width, 1], self.depth.iter().copied())),
            ("depth_conf", floats(&[count, height, width], self.confidence.iter().copied())),
            ("extra", npy("|O", false, &[1], b"\x80\x04K\x01.")),
        ];
        std::fs::write(path, npz(&entries, deflated)).expect("an archive");
    }

    /// Median relative error of each view's depth at the true scale, without noise.
    pub fn plain_errors(&self) -> Vec<f64> {
        errors(&self.views, |view, pixel| self.plain[view][pixel])
    }
}

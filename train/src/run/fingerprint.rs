//! Detects whether a resumed run has the views that it began with.

use gs_datasets::{Scene, View};
use serde::{Deserialize, Serialize};

/// A fingerprint of the training views of a run: their number, and a checksum of names, sizes, poses, intrinsics and
/// times.
///
/// Pixels are left out, because decoders differ by a bit. The order of views in a run, and the origin subtracted from
/// the world, follow from what is included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Number of views.
    pub views: usize,
    /// CRC-32 of names, sizes, poses, intrinsics and times.
    pub crc32: u32,
}

impl Fingerprint {
    /// The fingerprint of the training views of `scene`.
    pub fn of(scene: &Scene) -> Self {
        let mut hasher = crc32fast::Hasher::new();
        for view in &scene.train {
            hasher.update(view.name.as_bytes());
            hasher.update(&numbers(view));
        }
        Self { views: scene.train.len(), crc32: hasher.finalize() }
    }
}

fn numbers(view: &View) -> Vec<u8> {
    let lens = view.intrinsics;
    let sizes = [view.width as f64, view.height as f64, view.time.unwrap_or(f64::INFINITY)];
    let all = view.c2w.to_cols_array().into_iter().chain([lens.fx, lens.fy, lens.cx, lens.cy]).chain(sizes);
    all.flat_map(f64::to_le_bytes).collect()
}

//! Flux4D, part by part: UNet, lift, motion, losses, refinement, scene, actors, flow.

mod activate;
mod actors;
mod dbscan;
mod edits;
mod fast_nsf;
mod flow_metrics;
mod lift;
mod losses;
mod merge;
mod motion;
mod nearest;
mod refinement;
mod scene;
mod snippet;
mod unet;

use gs_tests::scenes::Random;

/// `count` points in a cube of `size` metres around the origin.
fn cloud(count: usize, size: f64, seed: u64) -> Vec<[f32; 3]> {
    let mut random = Random::new(seed);
    (0..count).map(|_| [0; 3].map(|_| random.uniform(-0.5 * size, 0.5 * size) as f32)).collect()
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2)).sum::<f64>().sqrt()
}

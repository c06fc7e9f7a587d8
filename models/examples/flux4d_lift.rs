//! Seconds of the host's part of Flux4D for a synthetic sweep: neighbours, lift, merging, clustering.
//!
//! `cargo run --release -p gs-models --example flux4d_lift -- 1000000`

use std::time::Instant;

use gs_models::flux4d::actors::dbscan;
use gs_models::flux4d::merge::{MergeConfig, TimedPoints, merge_to_budget};
use gs_models::flux4d::nearest::NearestPoints;
use gs_models::flux4d::{FarConfig, LiftConfig, LiftInput, lift_rows};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let count: usize = std::env::args().nth(1).map_or(Ok(1_000_000), |count| count.parse())?;
    let points = street(count);
    let times: Vec<f32> = (0..count).map(|i| (i % 6) as f32 / 5.0).collect();
    let colors = vec![Some([0.5; 3]); count];

    timed("neighbours", || NearestPoints::new(&points).all::<3>());
    let input = LiftInput { points: &points, times: &times, colors: &colors, far_color: None };
    for sky_points in [0, 100_000, 1_000_000] {
        let config = LiftConfig { far: FarConfig { sky_points, ..FarConfig::default() }, ..LiftConfig::default() };
        timed(&format!("lift with {sky_points} sky points"), || lift_rows(&input, &config)).map(|_| ())?;
    }
    let all = TimedPoints { points: points.clone(), times: times.clone(), colors: colors.clone() };
    let config = MergeConfig { budget: count / 4, times: 6, viewpoints: &[] };
    let merged = timed("merging to a quarter", || merge_to_budget(vec![all], &config))?;
    println!("{} points with voxels of {:?} m", merged.parts[0].points.len(), merged.edge);
    timed("clustering of all points", || dbscan(&points, 0.4, 10))?;
    Ok(())
}

fn timed<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    println!("{what}: {:.2} s", start.elapsed().as_secs_f64());
    result
}

/// Points on the ground and on walls, as dense as a turning LiDAR 2 m above the ground makes them.
fn street(count: usize) -> Vec<[f32; 3]> {
    let mut state = 1_u64;
    let mut unit = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u32 << 24) as f32
    };
    let point = |_| {
        let (turn, fall) = (std::f32::consts::TAU * unit(), 0.4 * unit() - 0.02);
        let range = if fall > 0.01 { (2.0 / fall).min(60.0) } else { 60.0 * (0.5 + 0.5 * unit()) };
        let noise = 0.02 * unit();
        [range * turn.cos() + noise, range * turn.sin() + noise, 2.0 - range * fall + noise]
    };
    (0..count).map(point).collect()
}

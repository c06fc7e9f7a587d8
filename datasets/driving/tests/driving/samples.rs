//! Real logs. Their folders come from environment variables, and the tests are ignored without them:
//!
//! ```text
//! GS_PANDASET=.../002 GS_ARGOVERSE=.../LOG cargo test --release -p gs-driving --test driving -- --ignored
//! ```

use std::path::PathBuf;

use glam::DVec3;
use gs_driving::{DrivingLog, LogOptions, colors};

fn folder(variable: &str) -> PathBuf {
    std::env::var_os(variable).map(PathBuf::from).unwrap_or_else(|| panic!("{variable} names no folder"))
}

/// Median distance from points of one sweep to the nearest of another, metres; every `every`-th point is looked at.
fn median_distance(a: &[[f32; 3]], b: &[[f32; 3]], every: usize) -> f32 {
    const CELL: f32 = 0.5;
    let cell = |p: &[f32; 3]| p.map(|v| (v / CELL).floor() as i32);
    let mut cells = std::collections::HashMap::<[i32; 3], Vec<&[f32; 3]>>::new();
    b.iter().for_each(|p| cells.entry(cell(p)).or_default().push(p));
    let mut found: Vec<f32> = a
        .iter()
        .step_by(every)
        .map(|p| {
            let c = cell(p);
            let around = (0..27)
                .filter_map(|i| cells.get(&[c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1]))
                .flatten();
            let squared = |q: &[f32; 3]| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f32>();
            around.map(|q| squared(q)).fold(f32::INFINITY, f32::min).sqrt()
        })
        .collect();
    found.sort_by(f32::total_cmp);
    found[found.len() / 2]
}

#[test]
#[ignore = "needs GS_PANDASET"]
fn pandaset_sweeps_overlap_and_are_coloured() {
    let log = DrivingLog::open(&folder("GS_PANDASET"), &LogOptions::default()).expect("opened");
    let (a, b) = (log.labelled_sweep(0).expect("a sweep"), log.labelled_sweep(1).expect("a sweep"));
    assert!(a.len() > 100_000 && a.left_out == 0);
    let distance = median_distance(&a.points, &b.points, 97);
    assert!(distance < 0.1, "{distance} m between sweeps of a vehicle that compensates for its motion");
    let labels = a.labels.as_ref().expect("boxes");
    assert_eq!(labels.semantic.len(), a.len());
    // Semantic cars (13) are in boxes of cars: both were labelled by people, apart from each other.
    let cars: Vec<usize> = (0..a.len()).filter(|i| labels.semantic[*i] == 13).collect();
    let boxed = cars.iter().filter(|i| labels.instance[**i] > 0).count();
    assert!(boxed as f64 > 0.9 * cars.len() as f64, "{boxed} of {} points of cars", cars.len());
    let fast =
        labels.flow.iter().flatten().filter(|flow| flow.iter().map(|v| v * v).sum::<f32>().sqrt() > 0.05).count();
    assert!(fast > 500, "{fast} moving points");
    let found = colors(&log, 0, &a).expect("colours").iter().flatten().count();
    assert!(found as f64 > 0.7 * a.len() as f64, "{found} of {} points have a colour", a.len());
}

#[test]
#[ignore = "needs GS_ARGOVERSE"]
fn argoverse_sweeps_overlap_and_are_labelled() {
    let log = DrivingLog::open(&folder("GS_ARGOVERSE"), &LogOptions::default()).expect("opened");
    assert!(log.origin().length() > 100.0, "a city's world: {}", log.origin());
    let (a, b) = (log.labelled_sweep(0).expect("a sweep"), log.labelled_sweep(1).expect("a sweep"));
    assert!(a.len() > 90_000 && a.left_out == 0, "{} points", a.len());
    let distance = median_distance(&a.points, &b.points, 97);
    assert!(distance < 0.1, "{distance} m between sweeps");
    let frame = &log.frames()[0];
    assert!(a.times.iter().all(|t| (0.0..0.12).contains(&(t - frame.time))), "points follow the time stamp");
    assert!(a.points.iter().all(|p| DVec3::from_array(p.map(f64::from)).length() < 400.0), "centred");
    let labels = a.labels.as_ref().expect("boxes");
    assert!(labels.tracks.len() > 10);
    assert!(labels.flow.iter().flatten().any(|flow| flow[0].hypot(flow[1]) > 0.3), "something drives");
}

//! Gains of photos are recovered from points that they share, and there are none where photos agree.

use gs_datasets::{Scene, View};
use gs_multiview::{Gains, gains, plane_sweep};

use crate::fixture::still_world;

fn photos_and_points() -> (Scene, Vec<[f32; 3]>) {
    let scene = still_world(9, 0);
    let points = plane_sweep(&scene.train, 1.0, 12.0, 1500, 3).positions;
    (scene, points)
}

fn multiply(view: &mut View, factors: [f64; 3]) {
    for pixel in view.image.data.chunks_exact_mut(3) {
        (0..3).for_each(|c| pixel[c] = (f64::from(pixel[c]) * factors[c]).round().min(255.0) as u8);
    }
}

fn each(views: &[View]) -> Vec<usize> {
    (0..views.len()).collect()
}

#[test]
fn gains_of_channels_are_recovered() {
    let (mut scene, points) = photos_and_points();
    let agreed = gains(&scene.train, &each(&scene.train), &points).expect("enough points");
    let factors: Vec<[f64; 3]> =
        (0..scene.train.len()).map(|i| [[0.80, 1.00, 0.9], [1.0, 0.85, 0.7], [0.75, 0.75, 0.75]][i % 3]).collect();
    scene.train.iter_mut().zip(&factors).for_each(|(view, factors)| multiply(view, *factors));
    let found = gains(&scene.train, &each(&scene.train), &points).expect("enough points");
    let mean = |c: usize| factors.iter().map(|factors| factors[c].ln()).sum::<f64>() / factors.len() as f64;
    let off = |(gain, factors): (&[f64; 3], &[f64; 3])| (0..3).map(|c| gain[c] - factors[c].ln() + mean(c)).collect();
    let offs: Vec<f64> = found.logarithms.iter().zip(&factors).flat_map::<Vec<f64>, _>(off).collect();
    let root = (offs.iter().map(|off| off * off).sum::<f64>() / offs.len() as f64).sqrt();
    // What photos of one exposure give is 0.004; a quarter of a step of 8 bits is 0.01 in dark pixels.
    assert!(root < 0.01, "gains are off by {root}: {offs:?}");
    assert!(found.left < 0.5 * agreed.left, "{} against {}", found.left, agreed.left);
    assert!(agreed.spread() < 0.01 && agreed.left > 0.95, "photos agree: {} {}", agreed.spread(), agreed.left);
}

/// All photos of a source have one gain.
#[test]
fn cameras_have_one_gain() {
    let (mut scene, points) = photos_and_points();
    let sources: Vec<usize> = (0..scene.train.len()).map(|i| i % 2).collect();
    scene.train.iter_mut().skip(1).step_by(2).for_each(|view| multiply(view, [0.8; 3]));
    let Gains { logarithms, .. } = gains(&scene.train, &sources, &points).expect("enough points");
    assert_eq!(logarithms.len(), 2);
    for c in 0..3 {
        let ratio = (logarithms[1][c] - logarithms[0][c]).exp();
        assert!((ratio - 0.8).abs() < 0.01, "{ratio}");
    }
}

#[test]
fn too_little_gives_none() {
    let (mut scene, points) = photos_and_points();
    let sources = each(&scene.train);
    assert_eq!(gains(&scene.train, &sources, &[]), None);
    assert_eq!(gains(&scene.train, &sources, &points[..10]), None);
    assert_eq!(gains(&scene.train, &sources, &[[f32::NAN; 3]; 200]), None);
    assert_eq!(gains(&[], &[], &points), None);
    assert_eq!(gains(&scene.train, &vec![0; scene.train.len()], &points), None, "one source");
    scene.train.iter_mut().for_each(|view| view.image.data.fill(255));
    assert_eq!(gains(&scene.train, &sources, &points), None, "clipped");
}

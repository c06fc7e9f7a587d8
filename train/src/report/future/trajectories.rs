//! Paths of moving Gaussians over an image: what was seen in blue, the future from orange to red.

use glam::{DMat4, DVec3};
use gs_datasets::CameraPose;
use gs_models::DynamicScene;
use rand::Rng;

use super::canvas::{fade, line};
use super::strip::Picture;
use super::studio::{Studio, enlarged};
use crate::fit::parameters::to_host;
use crate::fit::random::{Purpose, stream};
use crate::report::pictures::image_bytes;

/// Paths that are drawn at most: more cover each other.
const PATHS: usize = 160;

/// Least length of a path, pixels of the drawing: shorter ones are points.
const LEAST: f64 = 4.0;

/// Points of a path in the seen and in the future part.
const POINTS: usize = 40;

/// Least side of the drawing, pixels.
pub const SIDE: usize = 640;

/// Share of white over the image below the paths.
const FADED: f64 = 0.55;

/// Width of the lines of the seen and of the future part, pixels.
const WIDTHS: [f64; 2] = [1.4, 2.2];

/// Share of a line's colour that covers the image.
const COVER: f64 = 0.75;

/// Colours of the two parts from their first to their last time.
const COLORS: [[[f64; 3]; 2]; 2] =
    [[[160.0, 200.0, 235.0], [20.0, 70.0, 160.0]], [[250.0, 190.0, 40.0], [190.0, 10.0, 40.0]]];

/// The drawing, and the number of paths in it.
pub fn draw(
    studio: &Studio,
    scene: &dyn DynamicScene,
    camera: &CameraPose,
    ([first, end], until): ([f64; 2], f64),
    seed: u64,
) -> (Picture, usize) {
    let camera = enlarged(camera, SIDE);
    let now = scene.at(end);
    let pixels = image_bytes(studio.image(&now, &camera));
    let mut picture = Picture { width: camera.width, height: camera.height, pixels };
    fade(&mut picture, FADED);
    let between = |a: f64, b: f64| (0..=POINTS).map(move |k| a + (b - a) * k as f64 / POINTS as f64);
    let times: Vec<f64> = between(first, end).chain(between(end, until)).collect();
    let positions: Vec<Vec<f32>> =
        times.chunks(8).flat_map(|times| scene.at_times(times)).map(|scene| to_host(scene.means.val())).collect();
    let w2c = camera.c2w.inverse();
    let path = |row: usize| positions.iter().map(|at| projected(&camera, &w2c, &at[3 * row..3 * row + 3])).collect();
    let paths: Vec<Vec<Option<[f64; 2]>>> = (0..now.len()).map(path).collect();
    let chosen = chosen(&paths, &to_host(now.opacities()), seed);
    // The future lies above.
    for (part, colors) in COLORS.iter().enumerate() {
        let from = part * (POINTS + 1);
        for row in &chosen {
            for (k, pair) in paths[*row][from..=from + POINTS].windows(2).enumerate() {
                let (Some(a), Some(b)) = (pair[0], pair[1]) else { continue };
                let share = k as f64 / (POINTS - 1) as f64;
                let color = [0, 1, 2].map(|c| (colors[0][c] + share * (colors[1][c] - colors[0][c])) as u8);
                line(&mut picture, a, b, WIDTHS[part], color, COVER);
            }
        }
    }
    (picture, chosen.len())
}

/// The pixel of a point; `None` behind the camera.
fn projected(camera: &CameraPose, w2c: &DMat4, point: &[f32]) -> Option<[f64; 2]> {
    let seen = w2c.transform_point3(DVec3::new(point[0].into(), point[1].into(), point[2].into()));
    (seen.z > 0.0).then(|| camera.intrinsics.project(seen).to_array())
}

/// The rows whose paths are drawn: those that move, drawn at random by opacity without repetition.
fn chosen(paths: &[Vec<Option<[f64; 2]>>], opacities: &[f32], seed: u64) -> Vec<usize> {
    let mut rng = stream(seed, Purpose::Paths, 0);
    let mut keys: Vec<(f64, usize)> = Vec::new();
    for (row, (path, opacity)) in paths.iter().zip(opacities).enumerate() {
        // One number a row, so that a row's luck does not depend on the others.
        let luck: f64 = rng.random();
        if length(path) >= LEAST && *opacity > 0.0 {
            keys.push((-(1.0 - luck).ln() / f64::from(*opacity), row));
        }
    }
    keys.sort_by(|a, b| a.0.total_cmp(&b.0));
    keys.into_iter().take(PATHS).map(|(_, row)| row).collect()
}

/// The largest distance of a path from its beginning, pixels.
fn length(path: &[Option<[f64; 2]>]) -> f64 {
    let Some(Some(first)) = path.first() else { return 0.0 };
    path.iter().flatten().map(|at| (at[0] - first[0]).hypot(at[1] - first[1])).fold(0.0, f64::max)
}

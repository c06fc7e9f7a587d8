//! Paths of moving Gaussians over an image: what was seen in blue, the future from orange to red.

use glam::{DMat4, DVec3};
use gs_datasets::CameraPose;
use gs_models::DynamicScene;
use rand::Rng;

use super::canvas::{fade, line};
use super::renderer::{SceneRenderer, enlarged};
use super::strip::Picture;
use gs_train::fit::parameters::to_host;
use gs_train::fit::random::{Purpose, stream};
use gs_train::fit::times::through_time;
use gs_train::run::pixels::image_bytes;

/// Paths that are drawn at most and at least, as far as so many move.
const PATHS: [usize; 2] = [300, 24];

/// Length of all paths together, as a share of the pixels of the drawing: longer ones, as of what turns, hide each
/// other.
const INK: f64 = 0.08;

/// Least length of a path, pixels of the drawing: shorter ones are points.
const LEAST: f64 = 4.0;

/// Points of a path in the seen and in the future part.
const POINTS: usize = 40;

/// Least side of the drawing, pixels.
pub const SIDE: usize = 640;

/// Share of white over the image below the paths.
const FADED: f64 = 0.55;

/// Width of the lines of the seen and of the future part, pixels: where the future goes along the past, both are seen.
const WIDTHS: [f64; 2] = [4.5, 1.5];

/// Share of a line's colour that covers what is below it: joints of a line that lets it through would show.
const COVER: f64 = 1.0;

/// Colours of the two parts from their first to their last time.
const COLORS: [[[f64; 3]; 2]; 2] =
    [[[205.0, 224.0, 243.0], [110.0, 165.0, 220.0]], [[250.0, 170.0, 20.0], [185.0, 0.0, 35.0]]];

/// The drawing, and the number of paths in it.
pub fn draw(
    renderer: &SceneRenderer,
    scene: &dyn DynamicScene,
    camera: &CameraPose,
    ([first, end], until): ([f64; 2], f64),
    seed: u64,
) -> (Picture, usize) {
    let camera = enlarged(camera, SIDE);
    let now = scene.at(end);
    let pixels = image_bytes(renderer.image(&now, &camera));
    let mut picture = Picture { width: camera.width, height: camera.height, pixels };
    fade(&mut picture, FADED);
    let between = |a: f64, b: f64| (0..=POINTS).map(move |k| a + (b - a) * k as f64 / POINTS as f64);
    let times: Vec<f64> = between(first, end).chain(between(end, until)).collect();
    let positions: Vec<Vec<f32>> =
        through_time(scene, &times).map(|gaussians| to_host(gaussians.means.val())).collect();
    let w2c = camera.c2w.inverse();
    let path = |row: usize| positions.iter().map(|at| projected(&camera, &w2c, &at[3 * row..3 * row + 3])).collect();
    let paths: Vec<Vec<Option<[f64; 2]>>> = (0..now.len()).map(path).collect();
    let room = INK * (camera.width * camera.height) as f64;
    let chosen = chosen(&paths, &to_host(now.opacities()), room, seed);
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

/// The rows whose paths are drawn: those that move, drawn at random by opacity without repetition, until the paths are
/// `room` pixels long.
fn chosen(paths: &[Vec<Option<[f64; 2]>>], opacities: &[f32], room: f64, seed: u64) -> Vec<usize> {
    let mut rng = stream(seed, Purpose::Paths, 0);
    let mut keys: Vec<(f64, usize)> = Vec::new();
    for (row, (path, opacity)) in paths.iter().zip(opacities).enumerate() {
        // One number a row, so that a row's luck does not depend on the others.
        let luck: f64 = rng.random();
        if reach(path) >= LEAST && *opacity > 0.0 {
            keys.push((-(1.0 - luck).ln() / f64::from(*opacity), row));
        }
    }
    keys.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [most, least] = PATHS;
    let mut drawn = 0.0;
    let rows = keys.into_iter().map(|(_, row)| row).enumerate().take(most);
    let fits = |(count, row): &(usize, usize)| {
        drawn += length(&paths[*row]);
        *count < least || drawn <= room
    };
    rows.take_while(fits).map(|(_, row)| row).collect()
}

/// The length of a path, pixels.
fn length(path: &[Option<[f64; 2]>]) -> f64 {
    let parts = path.windows(2).filter_map(|pair| Some((pair[0]?, pair[1]?)));
    parts.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).sum()
}

/// The largest distance of a path from its beginning, pixels.
fn reach(path: &[Option<[f64; 2]>]) -> f64 {
    let Some(Some(first)) = path.first() else { return 0.0 };
    path.iter().flatten().map(|at| (at[0] - first[0]).hypot(at[1] - first[1])).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_rest_are_not_drawn_and_long_ones_are_few() {
        let path = |length: f64| -> Vec<Option<[f64; 2]>> {
            (0..3).map(|k| Some([length * f64::from(k) / 2.0, 1.0])).collect()
        };
        let paths: Vec<_> = (0..600).map(|row| path(if row < 100 { 0.5 } else { 50.0 })).collect();
        let opacities = vec![0.5; 600];
        let all = chosen(&paths, &opacities, 1e9, 3);
        assert_eq!(all.len(), PATHS[0]);
        assert!(all.iter().all(|row| *row >= 100));
        assert_eq!(chosen(&paths, &opacities, 50.0 * 70.0, 3), all[..70]);
        assert_eq!(chosen(&paths, &opacities, 0.0, 3).len(), PATHS[1]);
    }
}

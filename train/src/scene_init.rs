//! The first Gaussians: from the data set's points; where there are none, from points on which photos agree, and random in the
//! camera frusta.
//!
//! Sizes follow 3DGS (section 5.1): a Gaussian is as wide as the mean distance to its three nearest neighbours.

use std::num::NonZero;

use gs_datasets::{PointCloud, Scene, View, sweep};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::random::{Purpose, stream};

/// The zeroth real spherical harmonic, `1 / (2 sqrt(pi))`.
pub const SH_C0: f32 = 0.282_094_8;

/// Neighbours whose distance sets a Gaussian's size (3DGS).
const NEIGHBOURS: usize = 3;

/// Depth range of points, in distances to the point the cameras look at: from in front of the subject to the background behind
/// it.
pub(crate) const DEPTHS: [f64; 2] = [0.3, 3.0];

/// Most of the first Gaussians of a scene without points that come from a plane sweep; the others are random, for what has no
/// texture.
const SWEPT: f64 = 0.75;

/// How a scene begins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitConfig {
    /// Opacity of a new Gaussian, 0 to 1. Too high hides what lies behind before it has learned; too low is slow.
    pub opacity: f64,
    /// Size of a new Gaussian, in mean distances to its three nearest neighbours.
    pub scale: f64,
    /// Gaussians to begin with where the data set has no points (never more than `density.cap`).
    pub random_points: usize,
}

impl Default for InitConfig {
    fn default() -> Self {
        Self { opacity: 0.3, scale: 0.8, random_points: 20_000 }
    }
}

/// The Gaussians of step 0 as plain numbers; all have SH degree 0 and no rotation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FirstGaussians {
    /// `[N]` centres, scene units.
    pub means: Vec<[f32; 3]>,
    /// `[N]` natural logarithm of the standard deviation (equal on the three axes), scene units.
    pub log_scales: Vec<f32>,
    /// `[N]` zeroth SH coefficient per channel.
    pub sh_dc: Vec<[f32; 3]>,
    /// Logit of the opacity all begin with.
    pub opacity_logit: f32,
}

/// Gaussians for `scene`, at most `cap` of them.
pub fn first_gaussians(scene: &Scene, config: &InitConfig, cap: usize, seed: u64) -> FirstGaussians {
    let extent = size_of(scene);
    match &scene.points {
        Some(points) if !points.is_empty() => gaussians_at(points, extent, config, cap, seed),
        _ => {
            let points = points_in_front(&scene.train, config.random_points.min(cap), extent, DEPTHS[0], seed);
            gaussians_at(&points, extent, config, cap, seed)
        }
    }
}

/// Gaussians at `points`, at most `cap` of them; `extent` in scene units.
pub fn gaussians_at(points: &PointCloud, extent: f64, config: &InitConfig, cap: usize, seed: u64) -> FirstGaussians {
    let points = keep_at_most(points, cap, &mut stream(seed, Purpose::Init, 0));
    let opacity = config.opacity;
    FirstGaussians {
        log_scales: log_scales(&points.positions, config.scale, extent),
        sh_dc: points.colors.iter().map(|color| color.map(|c| (f32::from(c) / 255.0 - 0.5) / SH_C0)).collect(),
        opacity_logit: (opacity / (1.0 - opacity)).ln() as f32,
        means: points.positions,
    }
}

/// The scene's size in scene units, for rates and thresholds: [`Scene::extent`], or with a single camera (extent 0) the
/// median distance of the points from it, or 1.
pub fn size_of(scene: &Scene) -> f64 {
    let extent = scene.extent();
    if extent > 0.0 {
        return extent;
    }
    let (Some(view), Some(points)) = (scene.train.first(), &scene.points) else { return 1.0 };
    let centre = view.c2w.w_axis.truncate().as_vec3();
    let mut distances: Vec<f32> = points.positions.iter().map(|p| glam::Vec3::from(*p).distance(centre)).collect();
    distances.sort_by(f32::total_cmp);
    distances.get(distances.len() / 2).map_or(1.0, |d| f64::from(*d)).max(1e-6)
}

/// The natural logarithm of each point's mean distance to its nearest neighbours times `scale`, held between 1e-6 and
/// 0.1 times `extent`: coincident points must keep a size, and a stray point must not cover the scene.
pub fn log_scales(positions: &[[f32; 3]], scale: f64, extent: f64) -> Vec<f32> {
    let (smallest, largest) = (1e-6 * extent, 0.1 * extent);
    if positions.len() < 2 {
        return vec![(largest * scale).ln() as f32; positions.len()];
    }
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(positions);
    let wanted = NonZero::new(NEIGHBOURS + 1).expect("a positive constant");
    positions
        .par_iter()
        .map(|point| {
            let near = tree.nearest_n::<SquaredEuclidean>(point, wanted);
            // The nearest of all is the point itself.
            let distances = near.iter().skip(1).map(|n| f64::from(n.distance).sqrt());
            let mean = distances.sum::<f64>() / (near.len().max(2) - 1) as f64;
            (mean * scale).clamp(smallest, largest).ln() as f32
        })
        .collect()
}

/// The points, or `cap` of them chosen at random (in their order).
fn keep_at_most(points: &PointCloud, cap: usize, rng: &mut impl Rng) -> PointCloud {
    if points.len() <= cap {
        return points.clone();
    }
    tracing::info!(points = points.len(), cap, "more points than the cap allows: keeping a random choice");
    let mut kept = index::sample(rng, points.len(), cap).into_vec();
    kept.sort_unstable();
    PointCloud {
        positions: kept.iter().map(|&i| points.positions[i]).collect(),
        colors: kept.iter().map(|&i| points.colors[i]).collect(),
    }
}

/// `count` points in front of the cameras: where photos agree, as far as they do, and random ones, these no nearer than `nearest`
/// distances to the point the cameras look at.
pub(crate) fn points_in_front(views: &[View], count: usize, extent: f64, nearest: f64, seed: u64) -> PointCloud {
    let mut rng = stream(seed, Purpose::Init, 0);
    let distance = subject_distance(views).unwrap_or(extent);
    let [near, far] = DEPTHS.map(|d| d * distance);
    let mut points = sweep(views, near, far, (SWEPT * count as f64) as usize, seed);
    tracing::info!(agreed = points.len(), of = count, "no points in the data set: looked where photos agree");
    add_random(&mut points, views, count, [nearest * distance, far], &mut rng);
    points
}

/// Fills up to `count` with points on random rays through random pixels of random views, coloured by their pixel. Their depth
/// is uniform in its logarithm, so that near surfaces and far background both get their share.
fn add_random(points: &mut PointCloud, views: &[View], count: usize, depths: [f64; 2], rng: &mut impl Rng) {
    let [near, far] = depths.map(f64::ln);
    if views.is_empty() {
        return;
    }
    for _ in points.len()..count {
        let view = &views[rng.random_range(0..views.len())];
        let (column, row) = (rng.random_range(0..view.width), rng.random_range(0..view.height));
        let depth = rng.random_range(near..far).exp();
        let ray = view.intrinsics.ray(column as f64 + 0.5, row as f64 + 0.5);
        let position = view.c2w.transform_point3(ray * depth).as_vec3();
        let pixel = (row * view.width + column) * 3;
        points.positions.push(position.to_array());
        points.colors.push([0, 1, 2].map(|c| view.image.data[pixel + c]));
    }
}

/// Median distance from the cameras to the point nearest to all their optical axes; `None` when the axes do not meet in
/// front of most of them (a forward-facing rig, a single camera).
fn subject_distance(views: &[View]) -> Option<f64> {
    // The point p minimises the sum of squared distances to the axes: (sum of I - d d^T) p = sum of (I - d d^T) o.
    let (mut matrix, mut right) = (glam::DMat3::ZERO, glam::DVec3::ZERO);
    for view in views {
        let (centre, axis) = (view.c2w.w_axis.truncate(), view.c2w.z_axis.truncate());
        let across = glam::DMat3::IDENTITY - glam::DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        matrix += across;
        right += across * centre;
    }
    // The determinant of the mean matrix is 0 for parallel axes and at most 8/27; 0.005 is a spread of some 10 degrees.
    if views.len() < 3 || (matrix * (1.0 / views.len() as f64)).determinant() < 0.005 {
        return None;
    }
    let subject = matrix.inverse() * right;
    let mut depths: Vec<f64> = views
        .iter()
        .map(|view| (subject - view.c2w.w_axis.truncate()).dot(view.c2w.z_axis.truncate()))
        .filter(|depth| *depth > 0.0)
        .collect();
    depths.sort_by(f64::total_cmp);
    (2 * depths.len() > views.len()).then(|| depths[depths.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_is_the_mean_distance_of_three_neighbours() {
        // A corner of the unit cube: three neighbours at distance 1 (the fourth, at 5, is none of the three).
        let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [5., 0., 0.]];
        let sizes = log_scales(&points, 1.0, 100.0);
        assert!(sizes[0].abs() < 1e-6, "{sizes:?}");
        assert!((log_scales(&points, 2.0, 100.0)[0] - 2.0f32.ln()).abs() < 1e-6);
    }

    #[test]
    fn coincident_and_single_points_have_a_size() {
        let same = vec![[1.0, 2.0, 3.0]; 1000];
        assert!(log_scales(&same, 1.0, 1.0).iter().all(|s| (*s - 1e-6f32.ln()).abs() < 1e-3));
        assert!(log_scales(&[[0.0; 3]], 1.0, 1.0)[0].is_finite());
        assert!(log_scales(&[], 1.0, 1.0).is_empty());
        let line: Vec<[f32; 3]> = (0..5000).map(|i| [0.0, 0.0, i as f32]).collect();
        assert!(log_scales(&line, 1.0, 1e6).iter().all(|s| s.is_finite()));
    }
}

//! The initial Gaussians: at the data set's points, at positions on which photos agree (a plane sweep), and without
//! points also at random ones in the camera frusta.
//!
//! A dense start ([`InitConfig::dense_share`]) sweeps near the depths of what is known: the data set's points, or in a
//! set without any the first positions of a sweep over all depths.
//!
//! The scale of a Gaussian is the mean distance to its three nearest neighbours (3DGS, section 5.1).

use std::num::NonZero;

use super::outlines::Outlines;
use super::random::{Purpose, stream};
use super::region::Region;
use crate::config::InitConfig;
use gs_datasets::{PointCloud, Scene, View, subject_distance};
use gs_multiview::{plane_sweep, plane_sweep_around};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;

/// The zeroth real spherical harmonic, `1 / (2 sqrt(pi))`.
pub const SH_C0: f32 = 0.282_094_8;

/// Neighbours that determine a Gaussian's scale (3DGS).
const NEIGHBOURS: usize = 3;

/// Depth range of initial points, in distances of the subject: from in front of the subject to the background.
pub const DEPTHS: [f64; 2] = [0.3, 3.0];

/// Largest share of initial Gaussians from a plane sweep in a scene without points. The others are random, for surfaces
/// without texture.
const SWEPT: f64 = 0.75;

/// Positions of a sweep over all depths from which a dense start of a set without points goes on.
const SEEDS: usize = 4000;

/// Pixels of all training photos for each position of a dense start, at the least: tiny photos do not tell more apart.
const PIXELS_EACH: usize = 32;

/// The Gaussians of step 0 on the host; all have SH degree 0 and the identity rotation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InitialGaussians {
    /// `[N]` means, scene units.
    pub means: Vec<[f32; 3]>,
    /// `[N]` natural logarithm of the standard deviation (equal on the three axes), scene units.
    pub log_scales: Vec<f32>,
    /// `[N]` zeroth SH coefficient per channel.
    pub sh_dc: Vec<[f32; 3]>,
    /// Logit of the opacity, equal for all.
    pub opacity_logit: f32,
}

/// Gaussians for training views and the points that are known of their scene, at most `cap` of them, in line with
/// `region` where there is one; `extent` in scene units.
pub fn initial_gaussians(
    views: &[View],
    points: Option<&PointCloud>,
    config: &InitConfig,
    cap: usize,
    extent: f64,
    region: Option<Region>,
    seed: u64,
) -> InitialGaussians {
    let wanted = dense_count(views, config.dense_share, cap);
    let mut points = match points {
        Some(points) if !points.is_empty() => with_swept(points.clone(), views, wanted, extent, seed),
        _ if wanted > 0 => dense_in_front(views, config.random_points.min(cap), wanted, extent, seed),
        _ => points_in_front(views, config.random_points.min(cap), extent, &Random::default(), seed),
    };
    if let Some(region) = region {
        points = region.in_line(points, views);
    }
    gaussians_at(&points, extent, config, cap, seed)
}

/// The number of points that a dense start with `share` of `cap` asks for.
pub fn dense_count(views: &[View], share: f64, cap: usize) -> usize {
    let pixels: usize = views.iter().map(|view| view.width * view.height).sum();
    ((share * cap as f64) as usize).min(pixels / PIXELS_EACH)
}

/// `points`, and up to `wanted` in all with positions near theirs on which photos agree.
fn with_swept(mut points: PointCloud, views: &[View], wanted: usize, extent: f64, seed: u64) -> PointCloud {
    let count = wanted.saturating_sub(points.len());
    if count > 0 {
        let swept = plane_sweep_around(views, &points.positions, distance_of(views, extent), count, seed);
        tracing::info!(points = points.len(), swept = swept.len(), of = count, "added points on which photos agree");
        points.positions.extend(swept.positions);
        points.colors.extend(swept.colors);
    }
    points
}

/// Points for a set without any: up to `wanted` on which photos agree, then a quarter of `random` at random depths,
/// more where fewer than `random` were found in all.
fn dense_in_front(views: &[View], random: usize, wanted: usize, extent: f64, seed: u64) -> PointCloud {
    let mut rng = stream(seed, Purpose::Init, 0);
    let distance = distance_of(views, extent);
    let [near, far] = DEPTHS.map(|d| d * distance);
    let outlines = Outlines::of(views);
    let within = |points: PointCloud| match &outlines {
        Some(outlines) => outlines.within(points),
        None => points,
    };
    let seeds = within(plane_sweep(views, near, far, SEEDS.min(wanted), seed));
    tracing::info!(agreed = seeds.len(), "no points in the data set: looked where photos agree");
    // Another seed, so that the rays are others.
    let mut points = within(with_swept(seeds, views, wanted, extent, seed.wrapping_add(1)));
    let further = points.len() + (random as f64 * (1.0 - SWEPT)) as usize;
    let count = if outlines.is_some() { further } else { random.max(further) };
    let depths = Random { nearest: near, plain_nearest: near };
    add_random(&mut points, views, count, (&depths, far), outlines.as_ref(), &mut rng);
    points
}

/// Distance of the subject from the cameras, scene units.
fn distance_of(views: &[View], extent: f64) -> f64 {
    let poses: Vec<glam::DMat4> = views.iter().map(|view| view.c2w).collect();
    subject_distance(&poses).unwrap_or(extent)
}

/// Gaussians at `points`, at most `cap` of them; `extent` in scene units.
pub fn gaussians_at(points: &PointCloud, extent: f64, config: &InitConfig, cap: usize, seed: u64) -> InitialGaussians {
    let points = keep_at_most(points, cap, &mut stream(seed, Purpose::Init, 0));
    let opacity = config.opacity;
    InitialGaussians {
        log_scales: log_scales(&points.positions, config.scale, extent),
        sh_dc: points.colors.iter().map(|color| color.map(|c| (f32::from(c) / 255.0 - 0.5) / SH_C0)).collect(),
        opacity_logit: (opacity / (1.0 - opacity)).ln() as f32,
        means: points.positions,
    }
}

/// The scene's extent in scene units, for rates and thresholds: [`Scene::extent`], or for a single camera (extent 0)
/// the median distance of the points from it, or 1.
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

/// The natural logarithm of each point's mean distance to its nearest neighbours times `scale`, clamped to 1e-6 to 0.1
/// times `extent`: coincident points must keep a scale, and an outlier must not cover the scene.
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
            // The nearest neighbour of all is the point itself.
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

/// Smallest depths of random points, in distances of the subject.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Random {
    /// Smallest depth of all points.
    pub nearest: f64,
    /// Smallest depth of points at pixels without texture.
    pub plain_nearest: f64,
}

impl Default for Random {
    fn default() -> Self {
        Self { nearest: DEPTHS[0], plain_nearest: DEPTHS[0] }
    }
}

impl Random {
    /// For static cameras around a scene. A nearer point, seen in the corner of a single photo, can become a floater in
    /// front of the other cameras; pixels without texture mostly show a wall or a sky behind the subject.
    pub const STATIC_CAMERAS: Self = Self { nearest: 0.5, plain_nearest: 2.0 };
}

/// Near plane of scenes with static cameras and without points, in distances of the subject; what speaks for it is said
/// at the key `cues.near_share`.
pub const NEAR_STATIC_CAMERAS: f64 = 0.3;

/// `count` points in front of the cameras: positions on which photos agree, filled up with random ones.
pub fn points_in_front(views: &[View], count: usize, extent: f64, random: &Random, seed: u64) -> PointCloud {
    let mut rng = stream(seed, Purpose::Init, 0);
    let distance = distance_of(views, extent);
    let [near, far] = DEPTHS.map(|d| d * distance);
    let mut points = plane_sweep(views, near, far, (SWEPT * count as f64) as usize, seed);
    tracing::info!(agreed = points.len(), of = count, "no points in the data set: looked where photos agree");
    let random = Random { nearest: random.nearest * distance, plain_nearest: random.plain_nearest * distance };
    add_random(&mut points, views, count, (&random, far), None, &mut rng);
    points
}

/// Random positions drawn for each that is wanted where outlines admit few: an object fills a tenth of the depths of
/// its pixels, or less.
const TRIES: usize = 10;

/// Fills up to `count` with points on random rays through random pixels of random views, coloured by their pixel. Depth
/// is uniform in its logarithm, so that both near surfaces and a far background get points. Depths in scene units.
/// Fewer come where `outlines` admit few.
fn add_random(
    points: &mut PointCloud,
    views: &[View],
    count: usize,
    (random, far): (&Random, f64),
    outlines: Option<&Outlines>,
    rng: &mut impl Rng,
) {
    if views.is_empty() {
        return;
    }
    let tries = if outlines.is_some() { TRIES } else { 1 };
    for _ in 0..tries * count.saturating_sub(points.len()) {
        if points.len() >= count {
            break;
        }
        let view = &views[rng.random_range(0..views.len())];
        let (column, row) = (rng.random_range(0..view.width), rng.random_range(0..view.height));
        if view.mask.as_ref().is_some_and(|mask| mask[row * view.width + column] == 0) {
            // The colour of a masked pixel is not that of the scene.
            continue;
        }
        let near = if is_plain(view, column, row) { random.plain_nearest } else { random.nearest };
        let depth = rng.random_range(near.ln()..far.ln()).exp();
        let (position, color) = view.point_at(row * view.width + column, depth);
        if outlines.is_some_and(|outlines| !outlines.admit(position)) {
            continue;
        }
        points.positions.push(position);
        points.colors.push(color);
    }
}

/// Reach of the neighbourhood of a pixel, pixels, and largest difference in it, in levels of 255, at which the pixel
/// has no texture: sensor noise of two levels reaches that.
const PLAIN_REACH: usize = 3;
const PLAIN_LEVELS: u8 = 6;

/// Whether a pixel has no texture: its neighbours look like it.
fn is_plain(view: &View, column: usize, row: usize) -> bool {
    let at = |x: usize, y: usize| &view.image.data[3 * (y * view.width + x)..][..3];
    let here = at(column, row);
    let span = |middle: usize, size: usize| middle.saturating_sub(PLAIN_REACH)..(middle + PLAIN_REACH + 1).min(size);
    let is_like = |(x, y)| here.iter().zip(at(x, y)).all(|(a, b)| a.abs_diff(*b) <= PLAIN_LEVELS);
    span(row, view.height).flat_map(|y| span(column, view.width).map(move |x| (x, y))).all(is_like)
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

    /// Sky with noise of two levels above, a checker below.
    #[test]
    fn random_points_without_texture_begin_behind() {
        let sky = |x: usize, y: usize| 200 + ((x * 7 + y * 3) % 5) as u8 - 2;
        let checker = |x: usize, y: usize| if (x + y).is_multiple_of(2) { 30 } else { 220 };
        let size = 32;
        let level = |x: usize, y: usize| if y < size / 2 { sky(x, y) } else { checker(x, y) };
        let data = (0..size * size).flat_map(|i| [level(i % size, i / size); 3]).collect();
        let view = View {
            name: String::new(),
            image_path: Default::default(),
            c2w: glam::DMat4::IDENTITY,
            intrinsics: gs_base::Intrinsics { fx: 32.0, fy: 32.0, cx: 16.0, cy: 16.0 },
            width: size,
            height: size,
            time: None,
            camera_id: None,
            image: gs_datasets::RgbImage8 { width: size, height: size, data },
            fine: None,
            alpha: None,
            mask: None,
            exposure: None,
            priors: Default::default(),
            truth: Default::default(),
            source: None,
        };
        assert!(is_plain(&view, 10, 5) && is_plain(&view, 0, 0));
        assert!(!is_plain(&view, 10, 25) && !is_plain(&view, 10, 14), "texture, and the edge of it");
        let mut points = PointCloud::default();
        let random = Random { nearest: 0.5, plain_nearest: 1.5 };
        add_random(&mut points, &[view], 2000, (&random, 3.0), None, &mut stream(1, Purpose::Init, 0));
        let depth_of = |plain: bool| {
            let depths = points.positions.iter().filter(|p| (p[1] / p[2] < -0.15) == plain).map(|p| p[2]);
            depths.fold(f32::INFINITY, f32::min)
        };
        assert!(
            depth_of(true) >= 1.5 && (0.5..0.6).contains(&depth_of(false)),
            "{} {}",
            depth_of(true),
            depth_of(false)
        );
    }
}

//! The first Gaussians of a moving scene: static ones from the points or backgrounds, moving ones from the visual hull of
//! what moves at the middle of the recording.

use gs_datasets::motion::{self, HullOptions, Pinhole};
use gs_datasets::{PointCloud, Scene, View};
use rayon::prelude::*;

use crate::experiment::Config;
use crate::scene_init::{FirstGaussians, Random, gaussians_at, points_in_front, size_of};
use crate::taylormode::hints::{Found, frame_interval};

/// Most of the cap that Gaussians which may move take to begin with.
const MOVING_SHARE: f64 = 0.5;

/// The Gaussians to begin with, those that stand still first.
#[derive(Debug)]
pub struct First {
    /// All of them.
    pub gaussians: FirstGaussians,
    /// How many of them, the first ones, stand still.
    pub fixed: usize,
}

/// Gaussians at the points of `scene`, or at invented ones, and on what moves at `t0`.
pub fn first_points(scene: &Scene, found: &Found, config: &Config, t0: f64) -> First {
    let (still_points, moving_points) = split_points(scene, found, config, t0);
    // What moves comes first: points without number for what stands still would leave no room for it under the cap.
    let cap = config.density.cap;
    let share = config.motion.points.min((MOVING_SHARE * cap as f64) as usize).max(1);
    let moving = gaussians_of(scene, &moving_points, config, share);
    let room = cap.saturating_sub(moving.means.len());
    let still_points = still_points.unwrap_or_else(|| invented_points(scene, found, config, room));
    let fixed = gaussians_of(scene, &still_points, config, room);
    joined(fixed, moving)
}

/// Static points (`None`: the data set has none) and moving points.
fn split_points(scene: &Scene, found: &Found, config: &Config, t0: f64) -> (Option<PointCloud>, PointCloud) {
    let options = HullOptions { points: config.motion.points, ..HullOptions::default() };
    let hull = motion::hull(scene, &found.masks.masks, t0, &options);
    for note in &hull.notes {
        tracing::info!("{note}");
    }
    let mut moving = hull.points;
    let Some(points) = scene.points.as_ref().filter(|points| !points.is_empty()) else {
        return (None, moving);
    };
    let mut fixed = PointCloud::default();
    for (position, color) in points.positions.iter().zip(&points.colors) {
        let to = if moves_at(scene, found, t0, *position) { &mut moving } else { &mut fixed };
        to.positions.push(*position);
        to.colors.push(*color);
    }
    (Some(fixed), moving)
}

/// Share of the views of one instant that must have a point in their mask before it counts as moving.
const MOVING_VIEWS: f64 = 0.8;

/// Whether a point lies in the masks of nearly all views of a time that see it.
fn moves_at(scene: &Scene, found: &Found, t0: f64, point: [f32; 3]) -> bool {
    let (mut seen, mut inside) = (0, 0);
    // Not the views of t0 alone: cameras of a rig may begin a little apart. Of each camera that is the frame next to t0.
    let apart = 0.5 * frame_interval(&scene.train).unwrap_or(0.0);
    for (view, mask) in scene.train.iter().zip(&found.masks.masks) {
        let Some(mask) = mask.as_ref().filter(|_| view.time.is_some_and(|t| (t - t0).abs() <= apart)) else { continue };
        if let Some((pixel, _)) = Pinhole::new(view).sees(glam::Vec3::from(point).as_dvec3()) {
            seen += 1;
            inside += usize::from(mask[pixel] > 0);
        }
    }
    seen > 0 && inside as f64 >= MOVING_VIEWS * f64::from(seen)
}

/// Random points are no nearer than this share of the way to what the cameras look at: beside a camera, in the corner of its
/// picture alone, one can grow opaque and hang before all others.
const NEAREST: f64 = 0.5;

/// The same of those at pixels without texture. Of a sky the photos do not say how far it is: begun between the cameras, it stays
/// there, in the air, and is fog to a camera that is not one of those. On a ring around what they look at, 2 is where the cameras at
/// the other side stand, in every direction; there the wall of a dome may be, and a sky is as good to all. Twelve cameras all around
/// under a sky, held out, a thousand steps: 14.9 dB from 1.5 on.
const PLAIN_NEAREST: f64 = 2.0;

/// Views that must see something move behind a point: one mask may be wrong there.
const HIDES: usize = 2;

/// Points for what stands still where the data set has none: in front of the cameras, with the colours of what stands still
/// there, and none before what is seen moving.
fn invented_points(scene: &Scene, found: &Found, config: &Config, room: usize) -> PointCloud {
    let count = config.init.random_points.min(room);
    let random = Random { nearest: NEAREST, plain_nearest: PLAIN_NEAREST };
    let PointCloud { positions, colors } =
        points_in_front(&backgrounds(scene), count, size_of(scene), &random, config.seed);
    let movers = movers(scene, found);
    let clear = positions.into_par_iter().zip(colors).filter(|(position, _)| !hides(&movers, *position));
    let (positions, colors): (Vec<_>, Vec<_>) = clear.unzip();
    tracing::info!(of = count, clear = positions.len(), "points before what moves are left out");
    PointCloud { positions, colors }
}

/// A view that sees something move.
struct Mover<'a> {
    camera: Pinhole,
    mask: &'a [u8],
    /// Of the centre of what moves; of several the least, since any of them may be what moves at a pixel.
    depth: f64,
}

fn movers<'a>(scene: &'a Scene, found: &'a Found) -> Vec<Mover<'a>> {
    let of = |(view, mask): (&'a View, &'a Option<Vec<u8>>)| {
        let (mask, t, to_camera) = (mask.as_ref()?, view.time?, view.c2w.inverse());
        let depths = places(found, t).into_iter().map(|place| to_camera.transform_point3(place).z);
        Some(Mover { camera: Pinhole::new(view), mask, depth: depths.reduce(f64::min)? })
    };
    scene.train.iter().zip(&found.masks.masks).filter_map(of).collect()
}

/// Where the centre of each body is at a time; of bodies that follow no path, where the centre of them all was seen last or next.
fn places(found: &Found, t: f64) -> Vec<glam::DVec3> {
    if found.tracks.is_empty() {
        let seen = found.centres.iter().min_by(|a, b| (a.t - t).abs().total_cmp(&(b.t - t).abs()));
        return seen.map(|centre| centre.position).into_iter().collect();
    }
    found.tracks.iter().map(|track| track.path.position(t)).collect()
}

/// Whether a point would hide what is seen to move: it lies in masks of moving pixels, nearer than the centre of what moves.
fn hides(movers: &[Mover], point: [f32; 3]) -> bool {
    let point = glam::Vec3::from(point).as_dvec3();
    let hides_in = |mover: &&Mover| {
        mover.camera.sees(point).is_some_and(|(pixel, depth)| depth < mover.depth && mover.mask[pixel] > 0)
    };
    movers.iter().filter(hides_in).take(HIDES).count() == HIDES
}

/// Gaussians at points.
fn gaussians_of(scene: &Scene, points: &PointCloud, config: &Config, cap: usize) -> FirstGaussians {
    if points.is_empty() {
        return FirstGaussians::default();
    }
    gaussians_at(points, size_of(scene), &config.init, cap, config.seed)
}

/// One view for each camera that stands still, showing what stands still in front of it; all views where none does.
fn backgrounds(scene: &Scene) -> Vec<View> {
    let views: Vec<View> = motion::static_cameras(&scene.train)
        .iter()
        .filter_map(|camera| {
            let background = motion::background(&scene.train, camera)?;
            Some(View { image: background.image, ..scene.train[*camera.views.first()?].clone() })
        })
        .collect();
    if views.is_empty() { scene.train.clone() } else { views }
}

fn joined(fixed: FirstGaussians, moving: FirstGaussians) -> First {
    let count = fixed.means.len();
    let opacity_logit = if count > 0 { fixed.opacity_logit } else { moving.opacity_logit };
    let gaussians = FirstGaussians {
        means: [fixed.means, moving.means].concat(),
        log_scales: [fixed.log_scales, moving.log_scales].concat(),
        sh_dc: [fixed.sh_dc, moving.sh_dc].concat(),
        opacity_logit,
    };
    First { gaussians, fixed: count }
}

#[cfg(test)]
mod tests {
    use gs_datasets::Intrinsics;
    use gs_datasets::motion::Centre;

    use super::*;

    /// Two cameras at the origin and beside it look along z at what moves at depth 4, in the middle of 9 x 9 pixels.
    #[test]
    fn points_before_what_moves_hide_it() {
        let camera = |x: f64| {
            let c2w = glam::DMat4::from_translation(glam::DVec3::new(x, 0.0, 0.0));
            Pinhole::posed(c2w, Intrinsics { fx: 9.0, fy: 9.0, cx: 4.5, cy: 4.5 }, 9, 9)
        };
        let mut mask = vec![0; 81];
        mask[9 * 4 + 4] = 255;
        let movers = [0.0, 0.1].map(|x| Mover { camera: camera(x), mask: &mask, depth: 4.0 });
        assert!(hides(&movers, [0.05, 0.0, 2.0]), "before it, in both masks");
        assert!(!hides(&movers, [0.05, 0.0, 5.0]), "behind it");
        assert!(!hides(&movers, [0.9, 0.0, 2.0]), "beside it");
        assert!(!hides(&movers[..1], [0.0, 0.0, 2.0]), "one mask may be wrong");
    }

    /// Bodies that follow no path still hide what is behind them, from where they were seen.
    #[test]
    fn without_a_path_what_moves_is_where_it_was_seen() {
        let seen = |t: f64| Centre { t, position: glam::DVec3::new(0.0, 0.0, 10.0 * t), residual_px: 0.0, cameras: 3 };
        let found = Found { centres: vec![seen(0.2), seen(0.4), seen(0.9)], ..Found::default() };
        assert_eq!(places(&found, 0.5), [seen(0.4).position]);
        assert_eq!(places(&found, 2.0), [seen(0.9).position]);
        assert!(places(&Found::default(), 0.5).is_empty());
    }
}

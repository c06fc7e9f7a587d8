//! The initial Gaussians of a moving scene: static ones at the points or on backgrounds, moving ones in the visual hull
//! of moving pixels at the middle of the recording.

use gs_datasets::{PointCloud, Scene, View};
use gs_multiview::{self as multiview, HullOptions, Pinhole};
use rayon::prelude::*;

use super::Config;
use super::cues::{Cues, frame_interval};
use gs_train::fit::initialise::{InitialGaussians, Random, gaussians_at, points_in_front};

/// Largest share of the cap for the initial Gaussians that may move.
const MOVING_SHARE: f64 = 0.5;

/// The initial Gaussians, static ones first.
#[derive(Debug)]
pub struct Initial {
    /// All Gaussians.
    pub gaussians: InitialGaussians,
    /// Number of static Gaussians, which come first.
    pub fixed: usize,
}

/// Gaussians at the points of `scene`, or at invented ones, and on moving objects at `t0`.
pub fn initial_points(scene: &Scene, cues: &Cues, config: &Config, extent: f64, t0: f64) -> Initial {
    let (still_points, moving_points) = split_points(scene, cues, config, t0);
    // Moving points come first: any number of static points would leave no room for them under the cap.
    let cap = config.density.cap;
    let share = config.method.motion.points.min((MOVING_SHARE * cap as f64) as usize).max(1);
    let moving = gaussians_of(extent, &moving_points, config, share);
    let room = cap.saturating_sub(moving.means.len());
    let still_points = still_points.unwrap_or_else(|| invented_points(scene, cues, config, extent, room));
    let fixed = gaussians_of(extent, &still_points, config, room);
    joined(fixed, moving)
}

/// Static points (`None`: the data set has none) and moving points.
fn split_points(scene: &Scene, cues: &Cues, config: &Config, t0: f64) -> (Option<PointCloud>, PointCloud) {
    let options = HullOptions { points: config.method.motion.points, ..config.method.cues.options().hull };
    let hull = multiview::hull(scene, &cues.masks.masks, t0, &options);
    for note in &hull.notes {
        tracing::info!("{note}");
    }
    let mut moving = hull.points;
    let Some(points) = scene.points.as_ref().filter(|points| !points.is_empty()) else {
        return (None, moving);
    };
    let mut fixed = PointCloud::default();
    for (position, color) in points.positions.iter().zip(&points.colors) {
        let to = if moves_at(scene, cues, t0, *position) { &mut moving } else { &mut fixed };
        to.positions.push(*position);
        to.colors.push(*color);
    }
    (Some(fixed), moving)
}

/// Share of the views of one time whose mask must contain a point for it to be moving.
const MOVING_VIEWS: f64 = 0.8;

/// Whether a point lies in the masks of nearly all views of a time that see it.
fn moves_at(scene: &Scene, cues: &Cues, t0: f64, point: [f32; 3]) -> bool {
    let (mut seen, mut inside) = (0, 0);
    // Cameras of a rig may start at slightly different times, so each camera's frame nearest to t0 counts.
    let apart = 0.5 * frame_interval(&scene.train).unwrap_or(0.0);
    for (view, mask) in scene.train.iter().zip(&cues.masks.masks) {
        let Some(mask) = mask.as_ref().filter(|_| view.time.is_some_and(|t| (t - t0).abs() <= apart)) else { continue };
        if let Some((pixel, _)) = Pinhole::new(view).sees(glam::Vec3::from(point).as_dvec3()) {
            seen += 1;
            inside += usize::from(mask[pixel] > 0);
        }
    }
    seen > 0 && inside as f64 >= MOVING_VIEWS * f64::from(seen)
}

/// Views that must see motion behind a point before it is dropped: one mask may be wrong.
const HIDES: usize = 2;

/// Static points for a data set without points: in front of the cameras, with the colours of the static background, and
/// none in front of moving pixels.
fn invented_points(scene: &Scene, cues: &Cues, config: &Config, extent: f64, room: usize) -> PointCloud {
    let count = config.init.random_points.min(room);
    let random = Random { plain_nearest: config.method.cues.plain_nearest, ..Random::STATIC_CAMERAS };
    let PointCloud { positions, colors } =
        points_in_front(&backgrounds(scene, config), count, extent, &random, config.seed);
    let masked_views = masked_views(scene, cues);
    let clear = positions.into_par_iter().zip(colors).filter(|(position, _)| !hides(&masked_views, *position));
    let (positions, colors): (Vec<_>, Vec<_>) = clear.unzip();
    tracing::info!(of = count, clear = positions.len(), "points in front of moving pixels are left out");
    PointCloud { positions, colors }
}

/// A view with moving pixels.
struct MaskedView<'a> {
    camera: Pinhole,
    mask: &'a [u8],
    /// Depth of the centre of moving pixels, scene units; of several objects the smallest, because any may be seen at a
    /// pixel.
    depth: f64,
}

fn masked_views<'a>(scene: &'a Scene, cues: &'a Cues) -> Vec<MaskedView<'a>> {
    let of = |(view, mask): (&'a View, &'a Option<Vec<u8>>)| {
        let (mask, t, to_camera) = (mask.as_ref()?, view.time?, view.c2w.inverse());
        let depths = centres_at(cues, t).into_iter().map(|centre| to_camera.transform_point3(centre).z);
        Some(MaskedView { camera: Pinhole::new(view), mask, depth: depths.reduce(f64::min)? })
    };
    scene.train.iter().zip(&cues.masks.masks).filter_map(of).collect()
}

/// The centre of each object at a time; of objects without a path, their common centre at the nearest known time.
fn centres_at(cues: &Cues, t: f64) -> Vec<glam::DVec3> {
    if cues.tracks.is_empty() {
        let seen = cues.centres.iter().min_by(|a, b| (a.t - t).abs().total_cmp(&(b.t - t).abs()));
        return seen.map(|centre| centre.position).into_iter().collect();
    }
    cues.tracks.iter().map(|track| track.path.position(t)).collect()
}

/// Whether a point would hide moving pixels: it lies in their masks, nearer than their centre.
fn hides(masked_views: &[MaskedView], point: [f32; 3]) -> bool {
    let point = glam::Vec3::from(point).as_dvec3();
    let hides_in = |view: &&MaskedView| {
        view.camera.sees(point).is_some_and(|(pixel, depth)| depth < view.depth && view.mask[pixel] > 0)
    };
    masked_views.iter().filter(hides_in).take(HIDES).count() == HIDES
}

/// Gaussians at points.
fn gaussians_of(extent: f64, points: &PointCloud, config: &Config, cap: usize) -> InitialGaussians {
    if points.is_empty() {
        return InitialGaussians::default();
    }
    gaussians_at(points, extent, &config.init, cap, config.seed)
}

/// One view for each static camera, with the static background in front of it; all views if no camera is static.
fn backgrounds(scene: &Scene, config: &Config) -> Vec<View> {
    let options = config.method.cues.options().masks;
    let views: Vec<View> = multiview::static_cameras(&scene.train)
        .iter()
        .filter_map(|camera| {
            let background = multiview::background(&scene.train, camera, &options)?;
            Some(View { image: background.image, ..scene.train[*camera.views.first()?].clone() })
        })
        .collect();
    if views.is_empty() { scene.train.clone() } else { views }
}

fn joined(fixed: InitialGaussians, moving: InitialGaussians) -> Initial {
    let count = fixed.means.len();
    let opacity_logit = if count > 0 { fixed.opacity_logit } else { moving.opacity_logit };
    let gaussians = InitialGaussians {
        means: [fixed.means, moving.means].concat(),
        log_scales: [fixed.log_scales, moving.log_scales].concat(),
        sh_dc: [fixed.sh_dc, moving.sh_dc].concat(),
        opacity_logit,
    };
    Initial { gaussians, fixed: count }
}

#[cfg(test)]
mod tests {
    use gs_base::Intrinsics;
    use gs_multiview::Centre;

    use super::*;

    /// Two cameras, one at the origin and one beside it, look along z at an object at depth 4, in the middle of 9 x 9
    /// pixels.
    #[test]
    fn points_before_what_moves_hide_it() {
        let camera = |x: f64| {
            let c2w = glam::DMat4::from_translation(glam::DVec3::new(x, 0.0, 0.0));
            Pinhole::posed(c2w, Intrinsics { fx: 9.0, fy: 9.0, cx: 4.5, cy: 4.5 }, 9, 9)
        };
        let mut mask = vec![0; 81];
        mask[9 * 4 + 4] = 255;
        let masked_views = [0.0, 0.1].map(|x| MaskedView { camera: camera(x), mask: &mask, depth: 4.0 });
        assert!(hides(&masked_views, [0.05, 0.0, 2.0]), "before it, in both masks");
        assert!(!hides(&masked_views, [0.05, 0.0, 5.0]), "behind it");
        assert!(!hides(&masked_views, [0.9, 0.0, 2.0]), "beside it");
        assert!(!hides(&masked_views[..1], [0.0, 0.0, 2.0]), "one mask may be wrong");
    }

    /// Objects without a path still hide points, from where they were seen.
    #[test]
    fn without_a_path_what_moves_is_where_it_was_seen() {
        let seen = |t: f64| Centre { t, position: glam::DVec3::new(0.0, 0.0, 10.0 * t), residual_px: 0.0, cameras: 3 };
        let cues = Cues { centres: vec![seen(0.2), seen(0.4), seen(0.9)], ..Cues::default() };
        assert_eq!(centres_at(&cues, 0.5), [seen(0.4).position]);
        assert_eq!(centres_at(&cues, 2.0), [seen(0.9).position]);
        assert!(centres_at(&Cues::default(), 0.5).is_empty());
    }
}

//! Writes a world: its cameras, the files of each photo, and the points that the priors place.

use std::f64::consts::TAU;
use std::path::Path;

use glam::DVec3;
use gs_base::write_atomic;
use gs_datasets::DatasetError;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::priors::prior;
use super::{ExtrapolationOptions, Planted, World, random};
use crate::film::{Exposure, Order, Shot};
use crate::points::Points;
use crate::random::Draws;
use crate::ranges::check_ranges;
use crate::set::{Image, Photo, Set};
use crate::tracer::camera::{Camera, Rig};
use crate::tracer::scene::{MovingBody, Scene};

/// The light of all worlds but the room.
const LIGHT: &str = include_str!("../../scenes/extrapolation/light.toml");

/// Cameras on a dome: the point that they look at and their distance from it, metres; lowest and highest elevation as
/// seen from there and horizontal angle of view, radians.
struct Dome {
    target: DVec3,
    distance: f64,
    elevations: (f64, f64),
    angle_x: f64,
}

/// Elevations of 10 to 50 degrees. Half the image is 1.46 m wide at the target, which holds the objects.
const AROUND_OBJECTS: Dome = Dome { target: DVec3::ZERO, distance: 4.0, elevations: (0.175, 0.87), angle_x: 0.7 };

/// Inside the walls, which are 3 m from the middle, and under the ceiling at 3 m.
const IN_ROOM: Dome =
    Dome { target: DVec3::new(0.0, 0.0, 0.8), distance: 2.7, elevations: (0.17, 0.70), angle_x: 1.15 };

/// Share of the range of elevations from one camera to the next, modulo the range: the golden section spreads any
/// number evenly.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Cameras are out of line by up to this much, radians.
const JITTER: f64 = 0.02;

/// Writes a synthetic multi-view set for the prediction of future frames to `dir`, in the D-NeRF layout. `progress`
/// hears how many of all photos are done.
///
/// ```text
/// transforms_train.json             training cameras, times up to 0.75
/// transforms_val.json               cameras that are held out, times up to 0.75
/// transforms_test.json              all cameras, later times
/// train/cam00/0000.png ...          photos: RGBA with straight alpha, RGB of the room
/// points3d.ply                      the priors' pixels of all training cameras, placed in the world
/// priors/{depth,confidence}/...     EXR, of the first frame of each training camera: camera z up to a scale and
///                                   a shift for each view,
///                                   0 where nothing is met; confidence, 1 (none) and above
/// truth/masks/...                   255 where a moving object is seen through the pixel's centre
/// truth/{depth,velocity}/...        EXR, of every `truth_every`-th frame and the last: camera z (channel Z),
///                                   metres; world velocity (X,
///                                   Y, Z), metres per unit of time
/// ```
///
/// Keys of the JSON beside the usual ones: per frame `camera_id`, `depth_file_path`, `confidence_file_path`, and the
/// paths of the truth under `truth`; at the top `depth_kind`, `world`, and `movers` with every moving object's pose,
/// velocity and angular velocity at each time. The JSON files are written last, that of training after the others: a
/// folder without it is not finished.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn write(dir: &Path, options: &ExtrapolationOptions, progress: impl Fn(usize, usize)) -> Result<(), DatasetError> {
    check(dir, options)?;
    let scene = scene(options.world, &mut Draws::Scene.rng(options.seed));
    let cameras = cameras(options, &mut Draws::Rig.rng(options.seed));
    let times: Vec<f64> = (0..options.frames).map(|frame| options.time(frame)).collect();
    let exposures: Vec<Exposure> = times.iter().map(|time| Exposure::instant(&scene, *time)).collect();
    let set = Set { dir, scene: &scene, cameras: &cameras, times: &times, order: Order::Rows };
    let list = |camera: &Camera, frame| match (frame < options.training_frames(), camera.is_test) {
        (false, _) => "test",
        (true, true) => "val",
        (true, false) => "train",
    };
    let mut photos = set.photograph(&exposures, list, |photo, shot| files(photo, shot, options), progress)?;
    let points = Points::union(photos.iter_mut().map(|photo| std::mem::take(&mut photo.points)));
    write_atomic(&dir.join("points3d.ply"), &points.binary())?;
    let top = json!({ "depth_kind": "depth", "world": options.world.name(), "ply_file_path": "points3d.ply" });
    set.describe(photos, &["test", "val", "train"], top)
}

fn check(dir: &Path, options: &ExtrapolationOptions) -> Result<(), DatasetError> {
    let errors = &options.priors;
    let counts = [
        ("width", options.width, 8..=8192),
        ("height", options.height, 8..=8192),
        ("cameras", options.cameras, 1..=1000),
        ("held_out", options.held_out, 0..=options.cameras.saturating_sub(1) / 2),
        // Fewer leave no two future frames.
        ("frames", options.frames, 8..=10_000),
        ("truth_every", options.truth_every, 1..=10_000),
    ];
    check_ranges(dir, &counts)?;
    let numbers = [
        ("priors.scale", errors.scale, 0.0..=0.9),
        ("priors.shift", errors.shift, 0.0..=0.9),
        ("priors.noise", errors.noise, 0.0..=1.0),
        ("priors.outliers", errors.outliers, 0.0..=1.0),
    ];
    check_ranges(dir, &numbers)
}

/// The laws of the moving bodies of [`World::Random`], and where their origins are at first, metres.
pub fn planted(options: &ExtrapolationOptions) -> Vec<(Planted, DVec3)> {
    let bodies = scene(options.world, &mut Draws::Scene.rng(options.seed)).moving;
    let law = |body: &MovingBody| body.name.parse().ok().map(|law| (law, body.motion.pose(0.0).position));
    bodies.iter().filter_map(law).collect()
}

/// A world; textures come from `rng`.
pub(super) fn scene(world: World, rng: &mut ChaCha8Rng) -> Scene {
    let description = world.description();
    let texts = if world.is_room() { vec![description] } else { vec![description, LIGHT] };
    let mut scene = Scene::described(&texts, rng);
    if world == World::Random {
        scene.moving = random::bodies(rng);
    }
    scene
}

/// Cameras all around, at even steps of the azimuth: on a dome outside of objects, or under the ceiling of a room.
pub(super) fn cameras(options: &ExtrapolationOptions, rng: &mut ChaCha8Rng) -> Vec<Camera> {
    let ExtrapolationOptions { width, height, cameras: count, held_out, .. } = *options;
    let Dome { target, distance, elevations: (low, high), angle_x } =
        if options.world.is_room() { IN_ROOM } else { AROUND_OBJECTS };
    let mut jitter = || rng.random_range(-JITTER..JITTER);
    let direction = |index: usize| {
        let azimuth = TAU * index as f64 / count as f64 + jitter();
        (azimuth, low + (high - low) * (0.5 + GOLDEN * index as f64).fract() + jitter())
    };
    let directions: Vec<(f64, f64)> = (0..count).map(direction).collect();
    Rig { target, distance, angle_x, width, height }.cameras(held_out, &directions)
}

/// Writes the files of a photo; of the first photo of a training camera also the prior, whose points it keeps.
fn files(photo: &mut Photo<'_>, shot: &Shot, options: &ExtrapolationOptions) -> Result<(), DatasetError> {
    match options.world.is_room() {
        true => photo.photo(None, &shot.sharp)?,
        false => photo.photo(None, &shot.rgba())?,
    }
    photo.truth("mask_path", "masks", Image::Png(&shot.moving))?;
    if photo.frame.is_multiple_of(options.truth_every) || photo.frame + 1 == options.frames {
        photo.motion(shot)?;
    }
    if photo.frame > 0 || photo.camera.is_test {
        return Ok(());
    }
    let mut rng = Draws::Prior(photo.number as u64).rng(options.seed);
    let prior = prior(&shot.depth, options.width, &options.priors, &mut rng);
    photo.points = Points::of_view(photo.camera, &prior.depth, &shot.sharp);
    photo.prior("depth_file_path", "depth", Image::Exr(&[("Z", &prior.depth)]))?;
    photo.prior("confidence_file_path", "confidence", Image::Exr(&[("Y", &prior.confidence)]))
}

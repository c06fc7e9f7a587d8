//! Writes a world: its cameras, its exposures, and the files of each photo.

use std::f64::consts::TAU;
use std::path::Path;

use glam::DVec3;
use gs_base::write_atomic;
use gs_datasets::DatasetError;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::shake::Shake;
use super::{DeblurOptions, Shakes, World, priors};
use crate::film::{Exposure, Order, Shot, instants, shaken};
use crate::points::Points;
use crate::random::Draws;
use crate::ranges::check_ranges;
use crate::set::{Image, Photo, Set};
use crate::tracer::camera::{Camera, Rig};
use crate::tracer::scene::Scene;

/// The room, its lamp and the paints of its furniture.
const ROOM: &str = include_str!("../../scenes/deblur/room.toml");

/// Bodies are at the same position at this time for any speed.
const MIDDLE: f64 = 0.5;

/// Radius of the floor in the open, metres.
const GROUND: f64 = 5.0;

/// The point that the cameras look at, and their distance from it, metres.
const TARGET: DVec3 = DVec3::new(0.0, 0.0, 0.62);
const DISTANCE: f64 = 3.7;

/// Horizontal angle of view, radians. A metre at the target is then about 76 pixels of a 256 pixel wide image, so a
/// metre per unit of time is about 4.6 pixels per exposure of 0.06.
const ANGLE_X: f64 = 0.85;

/// The arc around the target, radians; the outermost cameras stand at half of it on either side.
const ARC: f64 = 1.4;

/// Height above the floor's plane as seen from the target, radians: every second camera stands higher by the step.
const ELEVATION: f64 = 0.30;
const ELEVATION_STEP: f64 = 0.12;

/// Cameras are out of line by up to this much, radians: nobody hangs them exactly.
const JITTER: f64 = 0.02;

/// Writes a synthetic multi-view set with motion blur to `dir`, in the D-NeRF layout: `transforms_train.json` and
/// `transforms_test.json`, 8-bit PNG images, EXR depth and velocity, and `points3d.ply`. `progress` hears how many of
/// all photos are done.
///
/// ```text
/// train/cam00/0000.png              blurry photos to learn from
/// test/cam09/0000.png               sharp photos of the cameras that are held out
/// truth/{sharp,blurry}/...          their counterparts
/// truth/{depth,velocity}/...        EXR: camera z (channel Z), metres; world velocity (X, Y, Z),
///                                   metres per unit of time;
///                                   both through the pixel's centre at the exposure's centre
/// truth/{masks,masks_union}/...     255 where a moving object is seen at the exposure's centre, and at any time of it
/// priors/{depth,masks,sharp}/...    of training photos, with the faults of `options.priors`
/// ```
///
/// Keys of the JSON beside the usual ones: `exposure` (unit of `time`), `mask_meaning`, `depth_kind`, `blur_space`; per
/// frame the paths of priors (`mask_path`, `depth_file_path`, `pseudo_sharp_path`) and under `truth` those of the
/// truth, and `camera_path`, poses at even times of the frame, if cameras shake; `movers` with every moving object's
/// pose, velocity and angular velocity at each time. The JSON is written last: a folder without it is not finished.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn write(dir: &Path, options: &DeblurOptions, progress: impl Fn(usize, usize)) -> Result<(), DatasetError> {
    check(dir, options)?;
    let seed = options.seed;
    let scene = scene(options.world, options.speed, options.ring, &mut Draws::Scene.rng(seed));
    let cameras = cameras(options, &mut Draws::Rig.rng(seed));
    let times: Vec<f64> = (0..options.frames).map(|frame| options.time(frame)).collect();
    let partly = options.priors.sharp_blur;
    let expose = |time: &f64| Exposure::new(&scene, *time, options.exposure_time(), options.subframes, partly);
    let exposures: Vec<Exposure> = times.iter().map(expose).collect();
    let set = Set { dir, scene: &scene, cameras: &cameras, times: &times, order: Order::Bayer };
    let middles: Vec<f64> = instants(0.0, 2.0, options.subframes).collect();
    // Of a frame, of which a row is exposed for a share.
    let (share, half) = (1.0 / (1.0 + options.readout), 0.5 * options.exposure_time() * (1.0 + options.readout));
    let shaken_photo = |photo: &mut Photo<'_>, shake: &Shake| {
        photo.entry["truth"]["camera_path"] = middles.iter().map(|u| json!(shake.at(*u).rows())).collect();
        let open = |row: usize| {
            let y = (2 * row + 1) as f64 / options.height as f64 - 1.0;
            let at = middles.iter().map(|u| (1.0 - share) * y + share * u);
            at.map(|u| (shake.at(u), scene.placed(times[photo.frame] + half * u))).collect()
        };
        shaken(&scene, photo.camera, open, Order::Bayer)
    };
    let write = |photo: &mut Photo<'_>, shot: &Shot| {
        let number = (photo.number * options.frames + photo.frame) as u64;
        let blurry = shake(photo.camera, number, options).map(|shake| shaken_photo(photo, &shake));
        files(photo, shot, blurry.as_ref().unwrap_or(&shot.blurry), options, &mut Draws::Prior(number).rng(seed))
    };
    let list = |camera: &Camera, _| if camera.is_test { "test" } else { "train" };
    let photos = set.photograph(&exposures, list, write, progress)?;
    let mut top = json!({
        "exposure": options.exposure_time(),
        "blur_space": "linear",
        "mask_meaning": "dynamic",
        "depth_kind": options.priors.depth_kind(),
        "world": options.world.name(),
    });
    if options.points > 0 {
        let middle = options.time(options.frames / 2);
        let points = Points::matched(&scene, &cameras, options.points, middle, &mut Draws::Points.rng(seed));
        write_atomic(&dir.join("points3d.ply"), &points.ascii())?;
        top["ply_file_path"] = json!("points3d.ply");
    }
    set.describe(photos, &["test", "train"], top)
}

fn check(dir: &Path, options: &DeblurOptions) -> Result<(), DatasetError> {
    let faults = &options.priors;
    let counts = [
        ("width", options.width, 8..=8192),
        ("height", options.height, 8..=8192),
        ("cameras", options.cameras, 1..=1000),
        ("held_out", options.held_out, 0..=options.cameras.saturating_sub(1) / 2),
        ("frames", options.frames, 1..=10_000),
        ("subframes", options.subframes, 16..=4096),
        ("points", options.points, 0..=10_000_000),
    ];
    check_ranges(dir, &counts)?;
    let numbers = [
        ("exposure", options.exposure, 0.0..=2.0),
        ("speed", options.speed, -10.0..=10.0),
        ("shake", options.shake, 0.0..=100.0),
        ("readout", options.readout, 0.0..=20.0),
        ("priors.depth_scale", faults.depth_scale, 0.0..=10.0),
        ("priors.depth_shift", faults.depth_shift, 0.0..=1.0),
        ("priors.depth_noise", faults.depth_noise, 0.0..=1.0),
        ("priors.depth_outliers", faults.depth_outliers, 0.0..=1.0),
        ("priors.mask_edge", faults.mask_edge, 0.0..=100.0),
        ("priors.sharp_blur", faults.sharp_blur, 0.0..=1.0),
        ("priors.sharp_noise", faults.sharp_noise, 0.0..=1.0),
    ];
    check_ranges(dir, &numbers)
}

/// A world in its room or in the `open`; textures and the turns of the furniture come from `rng`.
pub(super) fn scene(world: World, speed: f64, open: bool, rng: &mut ChaCha8Rng) -> Scene {
    let mut scene = Scene::described(&[world.description(), ROOM], rng);
    if open {
        scene.planes.truncate(1);
        scene.planes[0].reach = GROUND;
    }
    for body in &mut scene.moving {
        (body.motion.zero, body.motion.speed) = (MIDDLE, speed);
    }
    scene
}

/// Cameras at even steps on an arc in front of the scene or all around it.
pub(super) fn cameras(options: &DeblurOptions, rng: &mut ChaCha8Rng) -> Vec<Camera> {
    let DeblurOptions { cameras: count, held_out, ring, width, height, .. } = *options;
    let mut jitter = || rng.random_range(-JITTER..JITTER);
    let direction = |index: usize| {
        let around = match count {
            _ if ring => TAU * index as f64 / count as f64,
            1 => 0.0,
            _ => ARC * (index as f64 / (count - 1) as f64 - 0.5),
        };
        (around + jitter(), ELEVATION + ELEVATION_STEP * (index % 2) as f64 + jitter())
    };
    let directions: Vec<(f64, f64)> = (0..count).map(direction).collect();
    let rig = Rig { target: TARGET, distance: DISTANCE, angle_x: ANGLE_X, width, height };
    rig.cameras(held_out, &directions)
}

/// The shake of photo `number`; `None` if its camera stands still.
fn shake<'a>(camera: &'a Camera, number: u64, options: &DeblurOptions) -> Option<Shake<'a>> {
    let (draw, distance) = match options.shakes {
        Shakes::Own => (number, DISTANCE),
        Shakes::Turns => (number, 0.0),
        Shakes::Common => (0, DISTANCE),
        Shakes::Tenth if number.is_multiple_of(10) => (number, DISTANCE),
        Shakes::Tenth => return None,
    };
    let moves = options.shake > 0.0 && !camera.is_test;
    moves.then(|| Shake::draw(camera, (options.shake, distance), &mut Draws::Shake(draw).rng(options.seed)))
}

/// Writes the files of a photo: blurry ones of training cameras, sharp ones of held-out ones.
fn files(
    photo: &mut Photo<'_>,
    shot: &Shot,
    blurry: &[u8],
    options: &DeblurOptions,
    rng: &mut ChaCha8Rng,
) -> Result<(), DatasetError> {
    if photo.camera.is_test {
        photo.photo(Some("sharp_path"), &shot.sharp)?;
        photo.truth("blurry_path", "blurry", Image::Png(blurry))?;
    } else {
        photo.photo(Some("blurry_path"), blurry)?;
        photo.truth("sharp_path", "sharp", Image::Png(&shot.sharp))?;
    }
    photo.truth("mask_path", "masks", Image::Png(&shot.moving))?;
    photo.truth("mask_union_path", "masks_union", Image::Png(&shot.moving_union))?;
    photo.motion(shot)?;
    if photo.camera.is_test {
        return Ok(());
    }
    let (width, faults) = (options.width, &options.priors);
    photo.prior("depth_file_path", "depth", Image::Exr(&[("Z", &priors::depth(&shot.depth, width, faults, rng))]))?;
    photo.prior("mask_path", "masks", Image::Png(&priors::mask(&shot.moving, width, faults, rng)))?;
    photo.prior("pseudo_sharp_path", "sharp", Image::Png(&priors::sharp(&shot.partly, faults, rng)))
}

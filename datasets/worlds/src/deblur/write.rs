//! The data set on disk: the D-NeRF layout with more keys.

use std::ops::RangeInclusive;
use std::path::Path;

use gs_base::write_atomic;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::super::tracer::camera::Camera;
use super::super::tracer::stage::Stage;
use super::super::tracer::truth::movers;
use super::rig::{ANGLE_X, Rig, cameras};
use super::shutter::{ExposurePoses, Shot, photograph};
use super::{DeblurOptions, points, priors, worlds};
use gs_datasets::DatasetError;
use gs_datasets::image_io::{write_exr, write_png};

/// Pixels of all frames that are held in memory at a time, at about 60 bytes each. One camera's 16 frames of 640 x 480
/// fit; of larger sets the still part is traced again for every few frames.
const PIXELS_MAX: usize = 5_000_000;

/// Independent random sequences of one seed, so that a change of one option leaves the rest of the world as it is.
enum Draws {
    Stage,
    Rig,
    Points,
    /// Faults of frame `.0`, counted over all cameras.
    Frame(u64),
}

impl Draws {
    fn rng(&self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(match self {
            Self::Stage => 0,
            Self::Rig => 1,
            Self::Points => 2,
            Self::Frame(index) => 16 + index,
        });
        rng
    }
}

/// Writes a synthetic multi-view set with motion blur to `dir`, in the D-NeRF layout: `transforms_train.json` and
/// `transforms_test.json`, 8-bit PNG images, EXR depth and velocity, and `points3d.ply`. `progress` hears how many of all
/// photos are done.
///
/// ```text
/// train/cam00/0000.png              blurry photos to learn from
/// test/cam09/0000.png               sharp photos of the cameras that are held out
/// truth/{sharp,blurry}/...          their counterparts
/// truth/{depth,velocity}/...        EXR: camera z (channel Z), metres; world velocity (X, Y, Z), metres per unit of time;
///                                   both through the pixel's centre at the exposure's centre
/// truth/{masks,masks_union}/...     255 where a moving object is seen at the exposure's centre, and at any time of it
/// priors/{depth,masks,sharp}/...    of training photos, with the faults of `options.priors`
/// ```
///
/// Keys of the JSON beside the usual ones: `exposure` (unit of `time`), `mask_meaning`, `depth_kind`, `blur_space`; per
/// frame the paths of priors (`mask_path`, `depth_file_path`, `pseudo_sharp_path`) and under `truth` those of the truth;
/// `movers` with every moving object's pose, velocity and angular velocity at each time. The JSON is written last: a folder
/// without it is not finished.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn write(dir: &Path, options: &DeblurOptions, progress: impl Fn(usize, usize)) -> Result<(), DatasetError> {
    check(dir, options)?;
    let seed = options.seed;
    let stage = worlds::stage(options.world, options.speed, options.ring, &mut Draws::Stage.rng(seed));
    let (width, height) = (options.width, options.height);
    let rig = Rig { cameras: options.cameras, held_out: options.held_out, ring: options.ring, width, height };
    let cameras = cameras(&rig, &mut Draws::Rig.rng(seed));
    let exposures: Vec<ExposurePoses> = (0..options.frames)
        .map(|i| {
            let (time, partly) = (options.time(i), options.priors.sharp_blur);
            ExposurePoses::new(&stage, time, options.exposure_time(), options.subframes, partly)
        })
        .collect();
    let together = (PIXELS_MAX / (width * height)).max(1);
    let total = cameras.len() * options.frames;
    progress(0, total);
    for (number, camera) in cameras.iter().enumerate() {
        let mut done = 0;
        for exposures in exposures.chunks(together) {
            let shots = photograph(&stage, camera, exposures);
            let written: Vec<Result<(), DatasetError>> = shots
                .par_iter()
                .enumerate()
                .map(|(i, shot)| {
                    let draws = Draws::Frame((number * options.frames + done + i) as u64);
                    write_shot(dir, camera, done + i, shot, options, &mut draws.rng(seed))
                })
                .collect();
            // Collected first, so that the error of the first frame is reported and not of the fastest.
            written.into_iter().collect::<Result<(), _>>()?;
            done += exposures.len();
            progress(number * options.frames + done, total);
        }
    }
    if options.points > 0 {
        let middle = options.time(options.frames / 2);
        let text = points::ply(&stage, &cameras, options.points, middle, &mut Draws::Points.rng(seed));
        write_atomic(&dir.join("points3d.ply"), text.as_bytes())?;
    }
    for is_test in [true, false] {
        let cameras: Vec<&Camera> = cameras.iter().filter(|camera| camera.is_test == is_test).collect();
        if !cameras.is_empty() {
            let text = format!("{:#}\n", transforms(&stage, &cameras, options));
            write_atomic(&dir.join(format!("transforms_{}.json", part(is_test))), text.as_bytes())?;
        }
    }
    Ok(())
}

fn check(dir: &Path, options: &DeblurOptions) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: String, found: String| {
        Err(DatasetError::Option { path: dir.to_path_buf(), option, expected, found })
    };
    let counts: [(&'static str, usize, RangeInclusive<usize>); 7] = [
        ("width", options.width, 8..=8192),
        ("height", options.height, 8..=8192),
        ("cameras", options.cameras, 1..=1000),
        ("held_out", options.held_out, 0..=options.cameras.saturating_sub(1) / 2),
        ("frames", options.frames, 1..=10_000),
        ("subframes", options.subframes, 16..=4096),
        ("points", options.points, 0..=10_000_000),
    ];
    for (option, value, range) in counts {
        if !range.contains(&value) {
            return wrong(option, format!("{} to {}", range.start(), range.end()), value.to_string());
        }
    }
    let faults = &options.priors;
    let numbers: [(&'static str, f64, RangeInclusive<f64>); 9] = [
        ("exposure", options.exposure, 0.0..=2.0),
        ("speed", options.speed, -10.0..=10.0),
        ("priors.depth_scale", faults.depth_scale, 0.0..=10.0),
        ("priors.depth_shift", faults.depth_shift, 0.0..=1.0),
        ("priors.depth_noise", faults.depth_noise, 0.0..=1.0),
        ("priors.depth_outliers", faults.depth_outliers, 0.0..=1.0),
        ("priors.mask_edge", faults.mask_edge, 0.0..=100.0),
        ("priors.sharp_blur", faults.sharp_blur, 0.0..=1.0),
        ("priors.sharp_noise", faults.sharp_noise, 0.0..=1.0),
    ];
    for (option, value, range) in numbers {
        // NaN is in no range.
        if !range.contains(&value) {
            return wrong(option, format!("{} to {}", range.start(), range.end()), value.to_string());
        }
    }
    Ok(())
}

fn part(is_test: bool) -> &'static str {
    if is_test { "test" } else { "train" }
}

/// "train/cam00/0000", which all of a photo's files are named after.
fn stem(camera: &Camera, frame: usize) -> String {
    format!("{}/{}/{frame:04}", part(camera.is_test), camera.id)
}

fn write_shot(
    dir: &Path,
    camera: &Camera,
    frame: usize,
    shot: &Shot,
    options: &DeblurOptions,
    rng: &mut ChaCha8Rng,
) -> Result<(), DatasetError> {
    let (width, height) = (options.width, options.height);
    let stem = stem(camera, frame);
    let png = |path: String, data: &[u8]| write_png(&dir.join(path), width, height, data);
    let exr = |path: String, channels: &[(&str, &[f32])]| write_exr(&dir.join(path), width, height, channels);
    let (photo, other, counterpart) =
        if camera.is_test { (&shot.sharp, &shot.blurry, "blurry") } else { (&shot.blurry, &shot.sharp, "sharp") };
    png(format!("{stem}.png"), photo)?;
    png(format!("truth/{counterpart}/{stem}.png"), other)?;
    png(format!("truth/masks/{stem}.png"), &shot.moving)?;
    png(format!("truth/masks_union/{stem}.png"), &shot.moving_union)?;
    exr(format!("truth/depth/{stem}.exr"), &[("Z", &shot.depth)])?;
    let [x, y, z] = &shot.velocity;
    exr(format!("truth/velocity/{stem}.exr"), &[("X", x), ("Y", y), ("Z", z)])?;
    if camera.is_test {
        return Ok(());
    }
    let faults = &options.priors;
    exr(format!("priors/depth/{stem}.exr"), &[("Z", &priors::depth(&shot.depth, width, faults, rng))])?;
    png(format!("priors/masks/{stem}.png"), &priors::mask(&shot.moving, width, faults, rng))?;
    Ok(png(format!("priors/sharp/{stem}.png"), &priors::sharp(&shot.partly, faults, rng))?)
}

fn transforms(stage: &Stage, cameras: &[&Camera], options: &DeblurOptions) -> Value {
    let mut frames = Vec::new();
    for camera in cameras {
        let rows = [0, 1, 2, 3].map(|row| camera.c2w.row(row).to_array());
        for frame in 0..options.frames {
            let stem = stem(camera, frame);
            let (sharp, blurry) = if camera.is_test {
                (format!("{stem}.png"), format!("truth/blurry/{stem}.png"))
            } else {
                (format!("truth/sharp/{stem}.png"), format!("{stem}.png"))
            };
            let mut entry = json!({
                "file_path": format!("{stem}.png"),
                "time": options.time(frame),
                "transform_matrix": rows,
                "camera_id": camera.id,
                "truth": {
                    "sharp_path": sharp,
                    "blurry_path": blurry,
                    "depth_path": format!("truth/depth/{stem}.exr"),
                    "velocity_path": format!("truth/velocity/{stem}.exr"),
                    "mask_path": format!("truth/masks/{stem}.png"),
                    "mask_union_path": format!("truth/masks_union/{stem}.png"),
                },
            });
            if !camera.is_test {
                entry["mask_path"] = json!(format!("priors/masks/{stem}.png"));
                entry["depth_file_path"] = json!(format!("priors/depth/{stem}.exr"));
                entry["pseudo_sharp_path"] = json!(format!("priors/sharp/{stem}.png"));
            }
            frames.push(entry);
        }
    }
    let focal = cameras.first().map_or(0.0, |camera| camera.focal);
    let mut top = json!({
        "camera_angle_x": ANGLE_X,
        "fl_x": focal,
        "fl_y": focal,
        "cx": 0.5 * options.width as f64,
        "cy": 0.5 * options.height as f64,
        "w": options.width,
        "h": options.height,
        "exposure": options.exposure_time(),
        "blur_space": "linear",
        "mask_meaning": "dynamic",
        "depth_kind": options.priors.depth_kind(),
        "world": options.world.name(),
        "movers": movers(stage, (0..options.frames).map(|frame| options.time(frame))),
        "frames": frames,
    });
    if options.points > 0 {
        top["ply_file_path"] = json!("points3d.ply");
    }
    top
}

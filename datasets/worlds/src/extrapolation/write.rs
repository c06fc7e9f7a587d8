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
use super::film::{Moment, Shot, film};
use super::points::Points;
use super::priors::prior;
use super::rig::{angle_x, cameras};
use super::{ExtrapolationOptions, scene};
use gs_datasets::DatasetError;
use gs_datasets::image_io::{write_exr, write_png};

/// Pixels of all frames that are held in memory at a time, at about 60 bytes each. One camera's 60 frames of 280 x 280 fit; of larger
/// sets the still part is traced again for every few frames.
const PIXELS_MAX: usize = 5_000_000;

/// Independent random sequences of one seed, so that a change of one option leaves the rest of the world as it is.
enum Draws {
    Stage,
    Rig,
    /// Errors of the prior of camera `.0`.
    Prior(u64),
}

impl Draws {
    fn rng(&self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(match self {
            Self::Stage => 0,
            Self::Rig => 1,
            Self::Prior(index) => 16 + index,
        });
        rng
    }
}

/// The list that a frame is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Train,
    Validation,
    Test,
}

impl Part {
    fn of(camera: &Camera, frame: usize, options: &ExtrapolationOptions) -> Self {
        match (frame < options.training_frames(), camera.is_test) {
            (false, _) => Self::Test,
            (true, true) => Self::Validation,
            (true, false) => Self::Train,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "val",
            Self::Test => "test",
        }
    }
}

/// Writes a synthetic multi-view set for the prediction of future frames to `dir`, in the D-NeRF layout. `progress` hears how many of
/// all photos are done.
///
/// ```text
/// transforms_train.json             training cameras, times up to 0.75
/// transforms_val.json               cameras that are held out, times up to 0.75
/// transforms_test.json              all cameras, later times
/// train/cam00/0000.png ...          photos: RGBA with straight alpha, RGB of the room
/// points3d.ply                      the priors' pixels of all training cameras, placed in the world
/// priors/{depth,confidence}/...     EXR, of the first frame of each training camera: camera z up to a scale and a shift for each view,
///                                   0 where nothing is met; confidence, 1 (none) and above
/// truth/masks/...                   255 where a moving object is seen through the pixel's centre
/// truth/{depth,velocity}/...        EXR, of every `truth_every`-th frame and the last: camera z (channel Z), metres; world velocity (X,
///                                   Y, Z), metres per unit of time
/// ```
///
/// Keys of the JSON beside the usual ones: per frame `camera_id`, `depth_file_path`, `confidence_file_path`, and the paths of the truth
/// under `truth`; at the top `depth_kind`, `world`, and `movers` with every moving object's pose, velocity and angular velocity at each
/// time. The JSON files are written last, that of training after the others: a folder without it is not finished.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn write(dir: &Path, options: &ExtrapolationOptions, progress: impl Fn(usize, usize)) -> Result<(), DatasetError> {
    check(dir, options)?;
    let stage = scene::stage(options.world, &mut Draws::Stage.rng(options.seed));
    let cameras = cameras(options, &mut Draws::Rig.rng(options.seed));
    let moments: Vec<Moment> = (0..options.frames).map(|frame| Moment::new(&stage, options.time(frame))).collect();
    let together = (PIXELS_MAX / (options.width * options.height)).max(1);
    let total = cameras.len() * options.frames;
    let mut points = Points::default();
    progress(0, total);
    for (number, camera) in cameras.iter().enumerate() {
        let mut done = 0;
        for moments in moments.chunks(together) {
            let shots = film(&stage, camera, moments, options.world.is_room());
            let written: Vec<Result<(), DatasetError>> = shots
                .par_iter()
                .enumerate()
                .map(|(i, shot)| write_shot(dir, camera, done + i, shot, options))
                .collect();
            // Collected first, so that the error of the first frame is reported and not of the fastest.
            written.into_iter().collect::<Result<(), _>>()?;
            if done == 0
                && !camera.is_test
                && let Some(first) = shots.first()
            {
                write_prior(
                    dir,
                    camera,
                    first,
                    options,
                    &mut Draws::Prior(number as u64).rng(options.seed),
                    &mut points,
                )?;
            }
            done += moments.len();
            progress(number * options.frames + done, total);
        }
    }
    write_atomic(&dir.join("points3d.ply"), &points.ply())?;
    for part in [Part::Test, Part::Validation, Part::Train] {
        let frames = frames(&cameras, part, options);
        if !frames.is_empty() {
            let text = format!("{:#}\n", transforms(&stage, &cameras, frames, options));
            write_atomic(&dir.join(format!("transforms_{}.json", part.name())), text.as_bytes())?;
        }
    }
    Ok(())
}

fn check(dir: &Path, options: &ExtrapolationOptions) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: String, found: String| {
        Err(DatasetError::Option { path: dir.to_path_buf(), option, expected, found })
    };
    let counts: [(&'static str, usize, RangeInclusive<usize>); 6] = [
        ("width", options.width, 8..=8192),
        ("height", options.height, 8..=8192),
        ("cameras", options.cameras, 1..=1000),
        ("held_out", options.held_out, 0..=options.cameras.saturating_sub(1) / 2),
        // Fewer leave no two future frames.
        ("frames", options.frames, 8..=10_000),
        ("truth_every", options.truth_every, 1..=10_000),
    ];
    for (option, value, range) in counts {
        if !range.contains(&value) {
            return wrong(option, format!("{} to {}", range.start(), range.end()), value.to_string());
        }
    }
    let errors = &options.priors;
    let numbers: [(&'static str, f64, RangeInclusive<f64>); 4] = [
        ("priors.scale", errors.scale, 0.0..=0.9),
        ("priors.shift", errors.shift, 0.0..=0.9),
        ("priors.noise", errors.noise, 0.0..=1.0),
        ("priors.outliers", errors.outliers, 0.0..=1.0),
    ];
    for (option, value, range) in numbers {
        // NaN is in no range.
        if !range.contains(&value) {
            return wrong(option, format!("{} to {}", range.start(), range.end()), value.to_string());
        }
    }
    Ok(())
}

/// "train/cam00/0000", the name of all files of a photo.
fn stem(camera: &Camera, frame: usize, options: &ExtrapolationOptions) -> String {
    format!("{}/{}/{frame:04}", Part::of(camera, frame, options).name(), camera.id)
}

/// Whether depth and velocity of a frame are written.
fn has_maps(frame: usize, options: &ExtrapolationOptions) -> bool {
    frame.is_multiple_of(options.truth_every) || frame + 1 == options.frames
}

fn write_shot(
    dir: &Path,
    camera: &Camera,
    frame: usize,
    shot: &Shot,
    options: &ExtrapolationOptions,
) -> Result<(), DatasetError> {
    let (width, height) = (options.width, options.height);
    let stem = stem(camera, frame, options);
    write_png(&dir.join(format!("{stem}.png")), width, height, &shot.image)?;
    write_png(&dir.join(format!("truth/masks/{stem}.png")), width, height, &shot.moving)?;
    if has_maps(frame, options) {
        let [x, y, z] = &shot.velocity;
        write_exr(&dir.join(format!("truth/depth/{stem}.exr")), width, height, &[("Z", &shot.depth)])?;
        let velocity: [(&str, &[f32]); 3] = [("X", x), ("Y", y), ("Z", z)];
        write_exr(&dir.join(format!("truth/velocity/{stem}.exr")), width, height, &velocity)?;
    }
    Ok(())
}

/// The prior of a camera's first frame, and its points.
fn write_prior(
    dir: &Path,
    camera: &Camera,
    shot: &Shot,
    options: &ExtrapolationOptions,
    rng: &mut ChaCha8Rng,
    points: &mut Points,
) -> Result<(), DatasetError> {
    let (width, height) = (options.width, options.height);
    let stem = stem(camera, 0, options);
    let prior = prior(&shot.depth, width, &options.priors, rng);
    points.add(camera, &prior.depth, &shot.color);
    write_exr(&dir.join(format!("priors/depth/{stem}.exr")), width, height, &[("Z", &prior.depth)])?;
    let confidence = dir.join(format!("priors/confidence/{stem}.exr"));
    Ok(write_exr(&confidence, width, height, &[("Y", &prior.confidence)])?)
}

/// The entries of one list.
fn frames(cameras: &[Camera], part: Part, options: &ExtrapolationOptions) -> Vec<Value> {
    let mut frames = Vec::new();
    for camera in cameras {
        let rows = [0, 1, 2, 3].map(|row| camera.c2w.row(row).to_array());
        for frame in (0..options.frames).filter(|frame| Part::of(camera, *frame, options) == part) {
            let stem = stem(camera, frame, options);
            let mut entry = json!({
                "file_path": format!("{stem}.png"),
                "time": options.time(frame),
                "transform_matrix": rows,
                "camera_id": camera.id,
                "truth": { "mask_path": format!("truth/masks/{stem}.png") },
            });
            if has_maps(frame, options) {
                entry["truth"]["depth_path"] = json!(format!("truth/depth/{stem}.exr"));
                entry["truth"]["velocity_path"] = json!(format!("truth/velocity/{stem}.exr"));
            }
            if frame == 0 && part == Part::Train {
                entry["depth_file_path"] = json!(format!("priors/depth/{stem}.exr"));
                entry["confidence_file_path"] = json!(format!("priors/confidence/{stem}.exr"));
            }
            frames.push(entry);
        }
    }
    frames
}

fn transforms(stage: &Stage, cameras: &[Camera], frames: Vec<Value>, options: &ExtrapolationOptions) -> Value {
    let focal = cameras.first().map_or(0.0, |camera| camera.focal);
    json!({
        "camera_angle_x": angle_x(options.world.is_room()),
        "fl_x": focal,
        "fl_y": focal,
        "cx": 0.5 * options.width as f64,
        "cy": 0.5 * options.height as f64,
        "w": options.width,
        "h": options.height,
        "depth_kind": "depth",
        "world": options.world.name(),
        "movers": movers(stage, (0..options.frames).map(|frame| options.time(frame))),
        "ply_file_path": "points3d.ply",
        "frames": frames,
    })
}

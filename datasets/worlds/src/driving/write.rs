//! [`write`]: one log of a synthetic street.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DMat4, DQuat, DVec3};
use gs_base::write_atomic;
use gs_datasets::DatasetError;
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::film::{Picture, View};
use super::instant::Instant;
use super::options::StreetOptions;
use super::rig::Rig;
use super::street::Street;
use super::{files, lidar, records};
use crate::random::gaussian;
use gs_driving::layout::{
    CAMERA, CAMERAS, CUBOIDS, LIDAR, SEMSEG, TRUTH_POINTS, compress, encode_truth_image, truth_image_file,
};

/// Quality of JPEG files, of 100: no visible blocks at this size.
const QUALITY: u8 = 95;

/// Writes a log of a synthetic street into `dir`. `progress` is told how many of all sweeps and images are done.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn write(dir: &Path, options: &StreetOptions, progress: impl Fn(usize, usize) + Sync) -> Result<(), DatasetError> {
    options.check(dir)?;
    let street = Street::new(options);
    let rig = Rig { street: &street, options: options.clone() };
    let total = options.frames * (1 + options.cameras);
    let done = AtomicUsize::new(0);
    (0..total).into_par_iter().try_for_each(|task| -> Result<(), DatasetError> {
        let (frame, sensor) = (task / (1 + options.cameras), task % (1 + options.cameras));
        match sensor {
            0 => write_sweep(dir, &rig, frame)?,
            _ => write_image(dir, &rig, frame, sensor - 1)?,
        }
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
        Ok(())
    })?;
    // The descriptions come last: a log that is not whole is not recognised.
    let frames = 0..options.frames;
    for camera in 0..options.cameras {
        let folder = dir.join(CAMERA).join(CAMERAS[camera].0);
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0x9e37_79b9 ^ camera as u64);
        let poses: Vec<Value> =
            frames.clone().map(|frame| records::pose(&camera_pose(&rig, frame, camera, &mut rng))).collect();
        let times: Vec<f64> = frames.clone().map(|frame| rig.clock(rig.image_time(frame, camera))).collect();
        let k = rig.intrinsics();
        write_json(&folder.join("poses.json"), &json!(poses))?;
        write_json(&folder.join("timestamps.json"), &json!(times))?;
        write_json(&folder.join("intrinsics.json"), &json!({ "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy }))?;
    }
    write_json(&dir.join(SEMSEG).join("classes.json"), &records::classes())?;
    write_json(&dir.join("truth").join("actors.json"), &records::actors(&rig))?;
    let times: Vec<f64> = frames.clone().map(|frame| rig.clock(rig.sweep_end(frame))).collect();
    let egos: Vec<Value> = frames.map(|frame| records::pose(&(rig.world() * rig.ego(rig.sweep_end(frame))))).collect();
    write_json(&dir.join("meta").join("timestamps.json"), &json!(times))?;
    write_json(&dir.join(LIDAR).join("poses.json"), &json!(egos))?;
    write_json(&dir.join(LIDAR).join("timestamps.json"), &json!(times))
}

/// The written pose of a camera, with the noise that is asked for.
fn camera_pose(rig: &Rig<'_>, frame: usize, camera: usize, rng: &mut ChaCha8Rng) -> DMat4 {
    let mut draw = || rig.options.pose_noise * DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng));
    let (shift, turn) = (draw(), 0.01 * draw());
    let exact = rig.world() * rig.camera(rig.image_time(frame, camera), camera);
    DMat4::from_translation(shift) * exact * DMat4::from_quat(DQuat::from_scaled_axis(turn))
}

fn write_json(path: &Path, value: &Value) -> Result<(), DatasetError> {
    Ok(write_atomic(path, format!("{value}\n").as_bytes())?)
}

fn write_pickle(folder: &Path, frame: usize, content: &[u8], compressed: bool) -> Result<(), DatasetError> {
    let (ending, content) = if compressed { ("pkl.gz", &compress(content)[..]) } else { ("pkl", content) };
    Ok(write_atomic(&folder.join(format!("{frame:02}.{ending}")), content)?)
}

fn write_sweep(dir: &Path, rig: &Rig<'_>, frame: usize) -> Result<(), DatasetError> {
    let [sweep, labels, semantic] = files::sweep(rig, &lidar::sweep(rig, frame));
    let boxes = files::cuboids(rig, frame);
    for (folder, content) in [(LIDAR, sweep), (TRUTH_POINTS, labels), (SEMSEG, semantic), (CUBOIDS, boxes)] {
        write_pickle(&dir.join(folder), frame, &content, rig.options.compressed)?;
    }
    Ok(())
}

fn write_image(dir: &Path, rig: &Rig<'_>, frame: usize, camera: usize) -> Result<(), DatasetError> {
    let options = &rig.options;
    let time = rig.image_time(frame, camera) + options.camera_delay;
    let instant = Instant::new(rig.street, time);
    let (width, height) = (options.width, options.height);
    let view = View {
        instant: &instant,
        c2w: rig.camera(time, camera),
        intrinsics: rig.intrinsics(),
        width,
        height,
        subpixels: options.subpixels,
    };
    let picture = view.photograph(options.truth_images);
    let (name, stem) = (CAMERAS[camera].0, format!("{frame:02}"));
    let path = dir.join(CAMERA).join(name).join(format!("{stem}.jpg"));
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .write_image(&picture.rgb, width as u32, height as u32, ExtendedColorType::Rgb8)
        .map_err(|error| DatasetError::Image { path: path.clone(), found: error.to_string() })?;
    write_atomic(&path, &bytes)?;
    if options.truth_images {
        let path = truth_image_file(dir, name, &stem);
        let flow = world_flow(rig, &picture);
        write_atomic(&path, &encode_truth_image(&path, (width, height), &picture.depth, &flow, &picture.instance)?)?;
    }
    Ok(())
}

/// The flow of a picture in world axes.
fn world_flow(rig: &Rig<'_>, picture: &Picture) -> [Vec<f32>; 3] {
    let world = rig.world();
    let mut flow = picture.flow.clone();
    for index in 0..picture.depth.len() {
        let street = DVec3::from_array([0, 1, 2].map(|axis| f64::from(picture.flow[axis][index])));
        let turned = world.transform_vector3(street);
        for axis in 0..3 {
            flow[axis][index] = turned[axis] as f32;
        }
    }
    flow
}

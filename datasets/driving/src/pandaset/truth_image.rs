//! Truth of images of synthetic streets: [`TruthImage`], as EXR files.

use std::path::{Path, PathBuf};

use gs_datasets::image_io::encode_exr;
use gs_datasets::{DatasetError, ExrChannels, read_exr};

use super::names::TRUTH_IMAGES;

/// Names of the channels: camera z, the three of flow, the object.
const CHANNELS: [&str; 5] = ["Z", "VX", "VY", "VZ", "ID"];

/// Exact values of the pixels of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height, width]`: camera z in metres; 0 for sky.
    pub depth: Vec<f32>,
    /// `[3][height, width]`: how far the visible surface moves in the next 0.1 s, metres, world axes.
    pub flow: [Vec<f32>; 3],
    /// `[height, width]`: number of the vehicle or person in `truth/actors.json`; 0 for none.
    pub instance: Vec<u32>,
}

/// The file of a frame (by its name) and a camera.
pub fn truth_image_file(log: &Path, camera: &str, frame: &str) -> PathBuf {
    log.join(TRUTH_IMAGES).join(camera).join(format!("{frame}.exr"))
}

/// The bytes of a truth image; all lists have one value a pixel.
pub fn encode_truth_image(
    path: &Path,
    size: (usize, usize),
    depth: &[f32],
    flow: &[Vec<f32>; 3],
    instance: &[f32],
) -> Result<Vec<u8>, DatasetError> {
    let values = [depth, &flow[0], &flow[1], &flow[2], instance];
    let channels: Vec<(&str, &[f32])> = CHANNELS.into_iter().zip(values).collect();
    Ok(encode_exr(path, size, &channels, None)?)
}

/// The truth of a frame (by its name) and a camera of a synthetic log; `None` where the log has none.
///
/// # Errors
/// When the file is broken.
pub fn truth_image(log: &Path, camera: &str, frame: &str) -> Result<Option<TruthImage>, DatasetError> {
    let path = truth_image_file(log, camera, frame);
    if !path.exists() {
        return Ok(None);
    }
    let ExrChannels { width, height, values } = read_exr(&path, &CHANNELS)?;
    let channel = |index: usize| values.iter().skip(index).step_by(CHANNELS.len()).copied();
    Ok(Some(TruthImage {
        width,
        height,
        depth: channel(0).collect(),
        flow: [channel(1).collect(), channel(2).collect(), channel(3).collect()],
        instance: channel(4).map(|number| number as u32).collect(),
    }))
}

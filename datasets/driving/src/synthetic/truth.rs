//! Truth of images of synthetic streets: [`TruthImage`], as EXR files.

use std::path::{Path, PathBuf};

use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};
use gs_datasets::guarded::{self, IMAGE_MAX};
use gs_datasets::image_io::encode_exr;
use gs_datasets::{DatasetError, printable};

use crate::error::malformed;
use crate::pandaset::names::TRUTH_IMAGES;

/// Names of the channels.
const CHANNELS: [&str; 5] = ["Z", "flow.x", "flow.y", "flow.z", "instance"];

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
pub(super) fn file(log: &Path, camera: &str, frame: &str) -> PathBuf {
    log.join(TRUTH_IMAGES).join(camera).join(format!("{frame}.exr"))
}

/// The bytes of a truth image; all lists have one value a pixel.
pub(super) fn encode(
    path: &Path,
    size: (usize, usize),
    depth: &[f32],
    flow: &[Vec<f32>; 3],
    instance: &[f32],
) -> Result<Vec<u8>, DatasetError> {
    let values = [depth, &flow[0], &flow[1], &flow[2], instance];
    let channels: Vec<(&str, &[f32])> = CHANNELS.into_iter().zip(values).collect();
    encode_exr(path, size, &channels, None)
}

/// The truth of a frame (by its name) and a camera of a synthetic log; `None` where the log has none.
///
/// # Errors
/// When the file is broken.
pub fn truth_image(log: &Path, camera: &str, frame: &str) -> Result<Option<TruthImage>, DatasetError> {
    let path = file(log, camera, frame);
    if !path.exists() {
        return Ok(None);
    }
    let bytes = guarded::read(&path, IMAGE_MAX)?;
    let wrong =
        |found: String| malformed(&path, "the image", "channels of 32-bit floats", printable(&found).into_owned());
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(std::io::Cursor::new(&bytes));
    let layer = image.map_err(|error| wrong(error.to_string()))?.layer_data;
    let channel = |name: &str| -> Result<Vec<f32>, DatasetError> {
        let found = layer.channel_data.list.iter().find(|channel| channel.name.eq(name));
        match found.map(|channel| &channel.sample_data) {
            Some(FlatSamples::F32(values)) => Ok(values.clone()),
            _ => Err(malformed(&path, "the image", format!("a channel {name} of 32-bit floats"), "none")),
        }
    };
    Ok(Some(TruthImage {
        width: layer.size.width(),
        height: layer.size.height(),
        depth: channel(CHANNELS[0])?,
        flow: [channel(CHANNELS[1])?, channel(CHANNELS[2])?, channel(CHANNELS[3])?],
        instance: channel(CHANNELS[4])?.into_iter().map(|number| number as u32).collect(),
    }))
}

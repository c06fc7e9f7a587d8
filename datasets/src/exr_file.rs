//! OpenEXR files: named channels of half, float or integer samples.

use std::io::{BufRead, Cursor};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::block;
use exr::meta::MetaData;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};

use crate::error::DatasetError;
use crate::map::Map;

/// The first bytes of every file.
pub(crate) const MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Most samples of one file, over all its channels: 1 GiB in floats. A header that asks for more is broken, and its
/// memory is asked for before the pixels are looked at.
const SAMPLES_MAX: usize = 1 << 28;

/// Most samples for each byte of the file. Deflate, the closest of the compressions, makes at most 1032 bytes of one,
/// or 516 halves.
const SAMPLES_PER_BYTE: usize = 1024;

/// Names of the channel with depth, best first. Files with a picture and its depth call the depth Z; files of depth
/// alone use any of the others.
pub(crate) const DEPTH: &[&[&str]] = &[&["Z"], &["DEPTH"], &["V"], &["Y"], &["R"]];

/// Names of the three channels of a vector.
pub(crate) const VECTOR: &[&[&str]] = &[&["X", "Y", "Z"], &["R", "G", "B"]];

/// Reads the first group of channels in `groups` that the file has, ignoring case and the names of layers before the
/// last dot; a file with one channel only may call it anything when one is wanted. All groups have the same length.
pub(crate) fn parse(path: &Path, bytes: &[u8], groups: &[&[&str]]) -> Result<Map<f32>, DatasetError> {
    let wrong = |expected: &str, found: String| DatasetError::malformed(path, "OpenEXR", expected, found);
    // The decoder asserts where a damaged file contradicts itself (a tile of another resolution level, for one).
    // Nothing outlives the call, so that a panic in it leaves nothing half done.
    let layers = catch_unwind(|| decode(bytes)).unwrap_or_else(|_| Err("a file that contradicts itself".into()));
    let layers = layers.map_err(|found| wrong("a readable OpenEXR file", found))?;
    let all = || layers.iter().flat_map(|layer| layer.channels.iter().map(move |channel| (layer, channel)));
    let find = |wanted: &str| all().find(|(_, (name, _))| last_part(name).eq_ignore_ascii_case(wanted));
    let named = groups.iter().find_map(|group| group.iter().map(|name| find(name)).collect::<Option<Vec<_>>>());
    let lone = || {
        let first = all().next()?;
        (groups.iter().all(|group| group.len() == 1) && all().count() == 1).then(|| vec![first])
    };
    let Some(found) = named.or_else(lone) else {
        let names: Vec<&str> = all().take(8).map(|(_, (name, _))| name.as_str()).collect();
        let expected: Vec<String> = groups.iter().map(|group| group.join(" ")).collect();
        return Err(wrong(&format!("channels named {}", expected.join(" or ")), names.join(", ")));
    };
    let (width, height) = found.first().map_or((0, 0), |(layer, _)| (layer.width, layer.height));
    let mut values = vec![0.0; width * height * found.len()];
    for (i, (_, (name, samples))) in found.iter().enumerate() {
        if samples.len() != width * height {
            return Err(wrong("channels of the layer's size", format!("{} samples in {name}", samples.len())));
        }
        for (slot, value) in values.iter_mut().skip(i).step_by(found.len()).zip(samples) {
            *slot = *value;
        }
    }
    Map::new(width, height, found.len(), values).ok_or_else(|| wrong("at least one pixel", "none".to_string()))
}

/// Width and height of the image, pixels, from the start of a file.
pub(crate) fn size(path: &Path, start: impl BufRead) -> Result<(u32, u32), DatasetError> {
    let wrong = |found: String| DatasetError::malformed(path, "OpenEXR", "a readable OpenEXR file", found);
    let read = || MetaData::read_from_buffered(start, false).map_err(|error| error.to_string());
    // See `parse`.
    let meta = catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err("a header that contradicts itself".into()));
    let meta = meta.map_err(wrong)?;
    let size = meta.headers.first().map(|header| header.shared_attributes.display_window.size);
    let sides = size.map(|size| [size.0, size.1].map(|side| u16::try_from(side).unwrap_or(0)));
    let [width, height] = sides.filter(|sides| !sides.contains(&0)).ok_or_else(|| wrong("no sound size".into()))?;
    Ok((width.into(), height.into()))
}

struct Layer {
    width: usize,
    height: usize,
    channels: Vec<(String, Vec<f32>)>,
}

/// All flat layers. The headers are looked at before any memory for pixels is asked for.
fn decode(bytes: &[u8]) -> Result<Vec<Layer>, String> {
    let chunks = block::read(Cursor::new(bytes), false).map_err(|error| error.to_string())?;
    let mut samples = 0_usize;
    for header in chunks.headers() {
        let pixels = header.layer_size.0.checked_mul(header.layer_size.1);
        let size = pixels.and_then(|pixels| pixels.checked_mul(header.channels.list.len()));
        samples = samples.saturating_add(size.unwrap_or(usize::MAX));
    }
    let most = SAMPLES_MAX.min(bytes.len().saturating_mul(SAMPLES_PER_BYTE));
    if samples > most {
        return Err(format!("a header that asks for more than {most} samples"));
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_chunks(chunks)
        .map_err(|error| error.to_string())?;
    let layer = |layer: exr::prelude::Layer<exr::prelude::AnyChannels<FlatSamples>>| {
        let channels = layer.channel_data.list.into_iter();
        Layer {
            width: layer.size.0,
            height: layer.size.1,
            channels: channels.map(|channel| (channel.name.to_string(), floats(channel.sample_data))).collect(),
        }
    };
    Ok(image.layer_data.into_iter().map(layer).collect())
}

fn floats(samples: FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F16(values) => values.into_iter().map(exr::prelude::f16::to_f32).collect(),
        FlatSamples::F32(values) => values,
        FlatSamples::U32(values) => values.into_iter().map(|value| value as f32).collect(),
    }
}

/// "Z" of "ViewLayer.Depth.Z".
fn last_part(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

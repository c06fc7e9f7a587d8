//! Range images, images and boxes of a frame.

use std::io::Read;
use std::ops::Range;

use flate2::read::ZlibDecoder;
use gs_datasets::DatasetError;

use super::Records;
use super::wire::{Value, fields, integers};
use crate::waymo::parts::{BoxPart, RangeImage, Scan, TOP};

/// Longest content of a compressed image, bytes. The poses of the TOP laser have 4 MB.
const IMAGE_MAX: u64 = 64 << 20;

/// Longest name of an object, bytes.
const ID_MAX: usize = 256;

impl Records {
    /// The range images of a frame, with the poses of those of the TOP laser.
    pub fn scans(&self, frame: usize, with_second: bool) -> Result<Vec<Scan>, DatasetError> {
        self.read(frame, |content| {
            let mut scans = Vec::new();
            for field in fields(content, 0..content.len()) {
                if let (5, Value::Bytes(place)) = field? {
                    laser(content, place, with_second, &mut scans)?;
                }
            }
            Ok(scans)
        })
    }

    /// The JPEG of a camera in a frame.
    pub fn jpeg(&self, frame: usize, camera: i64) -> Result<Vec<u8>, DatasetError> {
        self.read(frame, |content| {
            for field in fields(content, 0..content.len()) {
                let (4, Value::Bytes(place)) = field? else { continue };
                let (mut number, mut image) = (None, None);
                for field in fields(content, place) {
                    match field? {
                        (1, Value::Integer(value)) => number = Some(value as i64),
                        (2, Value::Bytes(place)) => image = Some(place),
                        _ => {}
                    }
                }
                if let (true, Some(place)) = (number == Some(camera), image) {
                    return Ok(content[place].to_vec());
                }
            }
            Err(format!("no image of camera {camera}"))
        })
    }

    /// The boxes of a frame, in the vehicle's axes.
    pub fn boxes(&self, frame: usize) -> Result<Vec<BoxPart>, DatasetError> {
        self.read(frame, |content| {
            let mut boxes = Vec::new();
            for field in fields(content, 0..content.len()) {
                if let (6, Value::Bytes(place)) = field? {
                    boxes.push(label(content, place)?);
                }
            }
            Ok(boxes)
        })
    }

    fn read<T>(&self, frame: usize, read: impl FnOnce(&[u8]) -> Result<T, String>) -> Result<T, DatasetError> {
        let content = self.content(frame)?;
        let place = self.records[frame].to_string();
        read(&content).map_err(|found| DatasetError::malformed(&self.path, place, "a frame", found))
    }
}

/// Appends the returns of a laser.
fn laser(content: &[u8], place: Range<usize>, with_second: bool, scans: &mut Vec<Scan>) -> Result<(), String> {
    let mut number = None;
    let mut returns = [None, None];
    for field in fields(content, place) {
        match field? {
            (1, Value::Integer(value)) => number = Some(value as i64),
            (field @ (2 | 3), Value::Bytes(place)) => returns[field as usize - 2] = Some(place),
            _ => {}
        }
    }
    let laser = number.ok_or("a laser without its number")?;
    // Only the first return has poses, and they are those of the second too.
    let mut pose = None;
    for (index, place) in returns.into_iter().enumerate() {
        let Some(place) = place.filter(|_| index == 0 || with_second) else { continue };
        let mut image = None;
        for field in fields(content, place) {
            match field? {
                (2, Value::Bytes(place)) if !place.is_empty() => image = Some(matrix(&content[place])?),
                (4, Value::Bytes(place)) if !place.is_empty() && laser == TOP => pose = Some(matrix(&content[place])?),
                _ => {}
            }
        }
        if let Some(image) = image {
            scans.push(Scan { laser, image, pose: pose.clone() });
        }
    }
    Ok(())
}

/// A compressed matrix of floats: field 1 has the values, field 2 the shape.
fn matrix(packed: &[u8]) -> Result<RangeImage, String> {
    let mut content = Vec::new();
    let inflated = ZlibDecoder::new(packed).take(IMAGE_MAX + 1).read_to_end(&mut content);
    inflated.map_err(|error| format!("a range image that cannot be inflated: {error}"))?;
    if content.len() as u64 > IMAGE_MAX {
        return Err(format!("a range image of more than {} MiB", IMAGE_MAX >> 20));
    }
    let (mut values, mut shape) = (Vec::new(), Vec::new());
    for field in fields(&content[..], 0..content.len()) {
        match field? {
            (1, Value::Bytes(place)) => {
                let floats = content[place].chunks_exact(4);
                values.extend(floats.map(|bytes| f32::from_le_bytes(std::array::from_fn(|i| bytes[i]))));
            }
            (1, Value::Float(value)) => values.push(value),
            (2, Value::Bytes(place)) => {
                for field in fields(&content[..], place) {
                    if let (1, value) = field? {
                        integers(&content[..], &value, &mut shape)?;
                    }
                }
            }
            _ => {}
        }
    }
    RangeImage::new(&shape, values)
}

fn label(content: &[u8], place: Range<usize>) -> Result<BoxPart, String> {
    let mut part = BoxPart { id: String::new(), kind: 0, centre: [f64::NAN; 3], size: [f64::NAN; 3], heading: 0.0 };
    for field in fields(content, place) {
        match field? {
            (1, Value::Bytes(place)) => {
                for field in fields(content, place) {
                    let (number, Value::Double(value)) = field? else { continue };
                    match number {
                        1..=3 => part.centre[number as usize - 1] = value,
                        4 => part.size[1] = value,
                        5 => part.size[0] = value,
                        6 => part.size[2] = value,
                        7 => part.heading = value,
                        _ => {}
                    }
                }
            }
            (3, Value::Integer(value)) => part.kind = value as i64,
            (4, Value::Bytes(place)) => {
                let id = &content[place.start..place.end.min(place.start + ID_MAX)];
                part.id = String::from_utf8_lossy(id).into_owned();
            }
            _ => {}
        }
    }
    Ok(part)
}

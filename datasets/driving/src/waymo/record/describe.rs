//! Records, poses, calibrations and frames.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use glam::DMat4;
use gs_base::guarded;
use gs_datasets::DatasetError;

use super::wire::{Blob, Piece, Value, doubles, fields};
use super::{FILE_MAX, RECORD_MAX, Record, Records, crc};
use crate::waymo::calibration::{CameraCalibration, LaserCalibration};
use crate::waymo::names::RECORDS;
use crate::waymo::parts::{CAMERAS, FramePart, ImagePart, LASERS, Parts, rigid};

/// Bytes before the content of a record, a length and its checksum, and behind it, the checksum of the content.
const HEAD: u64 = 12;
const TAIL: u64 = 4;

/// Longest name of a segment, bytes.
const NAME_MAX: usize = 256;

/// The description of the segment. Every frame has it; the one of the first counts.
#[derive(Default)]
struct Context {
    name: String,
    cameras: BTreeMap<i64, CameraCalibration>,
    lasers: BTreeMap<i64, LaserCalibration>,
}

impl Records {
    /// Describes a file: images and range images are passed over. Contents are checked against their checksums when
    /// they are read.
    pub fn open(path: &Path) -> Result<(Parts, Self), DatasetError> {
        let mut file = guarded::open_regular(path, FILE_MAX)?;
        let records = list(path, &mut file)?;
        let mut context = Context::default();
        let mut frames = Vec::new();
        for (index, record) in records.iter().enumerate() {
            let blob = Piece::new(&file, record.start, record.length);
            let frame = frame(&blob, (index == 0).then_some(&mut context));
            frames.push((
                frame.map_err(|found| DatasetError::malformed(path, format!("record {index}"), "a frame", found))?,
                *record,
            ));
        }
        frames.sort_by_key(|(frame, _)| frame.stamp);
        if let Some(pair) = frames.windows(2).find(|pair| pair[0].0.stamp == pair[1].0.stamp) {
            let place = format!("the frames of the time {}", pair[0].0.stamp);
            return Err(DatasetError::malformed(path, place, "one frame", "two"));
        }
        if context.name.is_empty() {
            let stem = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            context.name = stem.strip_suffix(RECORDS).map_or(stem.clone(), str::to_string);
        }
        let (frames, records) = frames.into_iter().unzip();
        let Context { name, cameras, lasers } = context;
        let parts = Parts { name, cameras, lasers, frames, warnings: Vec::new() };
        Ok((parts, Self { path: path.to_path_buf(), records }))
    }

    /// The content of a frame's record.
    pub(super) fn content(&self, frame: usize) -> Result<Vec<u8>, DatasetError> {
        let record = self.records[frame];
        let io = |source| DatasetError::read(&self.path, source);
        let mut file = guarded::open_regular(&self.path, FILE_MAX)?;
        file.seek(SeekFrom::Start(record.start)).map_err(io)?;
        // The record was within the file when it was listed.
        let mut bytes = Vec::with_capacity(record.length + TAIL as usize);
        file.take(record.length as u64 + TAIL).read_to_end(&mut bytes).map_err(io)?;
        let sum = bytes.get(record.length..).and_then(|tail| tail.first_chunk()).map(|tail| u32::from_le_bytes(*tail));
        bytes.truncate(record.length);
        if sum != Some(crc::masked(&bytes)) {
            let expected = "a content that agrees with its checksum";
            return Err(DatasetError::malformed(&self.path, record.to_string(), expected, "another"));
        }
        Ok(bytes)
    }
}

/// The records of a file. Only their heads are read.
fn list(path: &Path, file: &mut File) -> Result<Vec<Record>, DatasetError> {
    let io = |source| DatasetError::read(path, source);
    let end = file.metadata().map_err(io)?.len();
    let (mut records, mut at) = (Vec::new(), 0_u64);
    while at < end {
        let wrong = |found: &str| {
            DatasetError::malformed(path, format!("the record from byte {at} on"), "a whole record", found)
        };
        let mut head = [0; HEAD as usize];
        if at + HEAD + TAIL > end {
            return Err(wrong("the end of the file"));
        }
        file.seek(SeekFrom::Start(at)).map_err(io)?;
        file.read_exact(&mut head).map_err(io)?;
        let (length, sum) = (u64::from_le_bytes(head[..8].try_into().unwrap_or_default()), &head[8..]);
        if sum != crc::masked(&head[..8]).to_le_bytes() {
            return Err(wrong("a length that does not agree with its checksum"));
        }
        if length > RECORD_MAX.min(end - at - HEAD - TAIL) {
            return Err(wrong(&format!("a length of {length} bytes")));
        }
        records.push(Record { start: at + HEAD, length: length as usize });
        at += HEAD + length + TAIL;
    }
    Ok(records)
}

/// Fields of a message, by number.
type Found = Result<(u64, Value), String>;

/// The transform in a message: field 1, 16 numbers.
fn transform<B: Blob + ?Sized>(blob: &B, place: Range<usize>) -> Result<DMat4, String> {
    let mut values = Vec::new();
    for field in fields(blob, place) {
        if let (1, value) = field? {
            doubles(blob, &value, &mut values)?;
        }
    }
    rigid(&values).ok_or_else(|| format!("{} numbers that are no transform", values.len()))
}

/// The number of a sensor, if it is one.
fn sensor(value: u64, names: &[&str]) -> Result<i64, String> {
    let known = (1..=names.len() as u64).contains(&value);
    if known { Ok(value as i64) } else { Err(format!("a sensor of the number {value}")) }
}

/// The description of a frame; that of the segment is read into `context`.
fn frame<B: Blob + ?Sized>(blob: &B, mut context: Option<&mut Context>) -> Result<FramePart, String> {
    let (mut stamp, mut pose) = (None, None);
    let (mut images, mut has_sweep) = (BTreeMap::new(), false);
    for field in fields(blob, 0..blob.length()) {
        match field? {
            (1, Value::Bytes(place)) => {
                if let Some(context) = context.as_deref_mut() {
                    read_context(blob, place, context)?;
                }
            }
            (2, Value::Integer(value)) => stamp = Some(value as i64),
            (3, Value::Bytes(place)) => pose = Some(transform(blob, place)?),
            (4, Value::Bytes(place)) => {
                let (number, image) = image(blob, place)?;
                images.insert(number, image);
            }
            (5, Value::Bytes(place)) => has_sweep |= has_range_image(blob, place)?,
            _ => {}
        }
    }
    let stamp = stamp.ok_or("no time")?;
    Ok(FramePart { stamp, pose: pose.ok_or("no pose of the vehicle")?, images, has_sweep })
}

fn image<B: Blob + ?Sized>(blob: &B, place: Range<usize>) -> Result<(i64, ImagePart), String> {
    let (mut number, mut pose, mut time) = (None, None, None);
    for field in fields(blob, place) {
        match field? {
            (1, Value::Integer(value)) => number = Some(sensor(value, &CAMERAS)?),
            (3, Value::Bytes(place)) => pose = Some(transform(blob, place)?),
            (5, Value::Double(value)) => time = Some(value).filter(|time| time.is_finite()),
            _ => {}
        }
    }
    match (number, pose, time) {
        (Some(number), Some(pose), Some(time)) => Ok((number, ImagePart { pose, time })),
        _ => Err("an image without its camera, pose or time".to_string()),
    }
}

/// Whether a laser has a first return.
fn has_range_image<B: Blob + ?Sized>(blob: &B, place: Range<usize>) -> Result<bool, String> {
    let filled = |field: Found| -> Result<bool, String> {
        Ok(matches!(field?, (2, Value::Bytes(content)) if !content.is_empty()))
    };
    for field in fields(blob, place) {
        if let (2, Value::Bytes(place)) = field? {
            for field in fields(blob, place) {
                if filled(field)? {
                    return Ok(true);
                }
            }
        }
    }
    Ok(false)
}

fn read_context<B: Blob + ?Sized>(blob: &B, place: Range<usize>, context: &mut Context) -> Result<(), String> {
    for field in fields(blob, place) {
        match field? {
            (1, Value::Bytes(place)) => {
                let name = blob.bytes(place.start, place.len().min(NAME_MAX))?;
                context.name = String::from_utf8_lossy(&name).into_owned();
            }
            (2, Value::Bytes(place)) => {
                let (number, camera) = camera(blob, place)?;
                context.cameras.insert(number, camera);
            }
            (3, Value::Bytes(place)) => {
                let (number, laser) = laser(blob, place)?;
                context.lasers.insert(number, laser);
            }
            _ => {}
        }
    }
    Ok(())
}

fn camera<B: Blob + ?Sized>(blob: &B, place: Range<usize>) -> Result<(i64, CameraCalibration), String> {
    let (mut number, mut intrinsic, mut extrinsic, mut size) = (None, Vec::new(), None, (0, 0));
    for field in fields(blob, place) {
        match field? {
            (1, Value::Integer(value)) => number = Some(sensor(value, &CAMERAS)?),
            (2, value) => doubles(blob, &value, &mut intrinsic)?,
            (3, Value::Bytes(place)) => extrinsic = Some(transform(blob, place)?),
            (4, Value::Integer(value)) => size.0 = value as i64,
            (5, Value::Integer(value)) => size.1 = value as i64,
            _ => {}
        }
    }
    let count = intrinsic.len();
    match (number, intrinsic.try_into(), extrinsic) {
        (Some(number), Ok(intrinsic), Some(extrinsic)) => {
            Ok((number, CameraCalibration { intrinsic, extrinsic, size }))
        }
        _ => Err(format!("a camera without its number or place, or with {count} intrinsics")),
    }
}

fn laser<B: Blob + ?Sized>(blob: &B, place: Range<usize>) -> Result<(i64, LaserCalibration), String> {
    let (mut number, mut extrinsic, mut low, mut high) = (None, None, None, None);
    let mut inclinations = Vec::new();
    for field in fields(blob, place) {
        match field? {
            (1, Value::Integer(value)) => number = Some(sensor(value, &LASERS)?),
            (2, value) => doubles(blob, &value, &mut inclinations)?,
            (3, Value::Double(value)) => low = Some(value),
            (4, Value::Double(value)) => high = Some(value),
            (5, Value::Bytes(place)) => extrinsic = Some(transform(blob, place)?),
            _ => {}
        }
    }
    match (number, extrinsic) {
        (Some(number), Some(extrinsic)) => {
            Ok((number, LaserCalibration { extrinsic, inclinations, bounds: low.zip(high) }))
        }
        _ => Err("a laser without its number or place".to_string()),
    }
}

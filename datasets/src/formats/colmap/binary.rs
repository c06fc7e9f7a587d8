//! COLMAP binary files: little-endian and packed. No count is trusted further than the file is long.

use std::path::Path;

use glam::DVec3;
use gs_base::{agree, counted, guarded};

use super::model::{Camera, Image, Listed, Point, model_by_id};
use crate::error::DatasetError;

/// The id of "no point".
const NO_POINT: u64 = u64::MAX;

struct Bytes<'a> {
    file: &'a Path,
    all: &'a [u8],
    offset: usize,
}

impl<'a> Bytes<'a> {
    fn wrong(&self, expected: impl Into<String>, found: impl Into<String>) -> DatasetError {
        DatasetError::malformed(self.file, format!("byte {}", self.offset), expected, found)
    }

    fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], DatasetError> {
        let rest = self.all.get(self.offset..).unwrap_or_default();
        let taken = rest.get(..count).ok_or_else(|| {
            self.wrong(
                format!("{} ({what})", counted(count, "byte")),
                format!("{}, then the end", counted(rest.len(), "byte")),
            )
        })?;
        self.offset += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], DatasetError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, what)?);
        Ok(out)
    }

    fn u32(&mut self, what: &str) -> Result<u32, DatasetError> {
        self.array(what).map(u32::from_le_bytes)
    }

    fn u64(&mut self, what: &str) -> Result<u64, DatasetError> {
        self.array(what).map(u64::from_le_bytes)
    }

    fn f64(&mut self, what: &str) -> Result<f64, DatasetError> {
        self.array(what).map(f64::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self, what: &str) -> Result<[f64; N], DatasetError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.f64(what)?;
        }
        Ok(out)
    }

    /// A count of records that each take at least `least` bytes, refused when the file cannot hold them.
    fn count(&mut self, least: usize, what: &str) -> Result<usize, DatasetError> {
        let count = self.u64(what)?;
        let rest = self.all.len().saturating_sub(self.offset);
        match usize::try_from(count) {
            Ok(count) if count.checked_mul(least).is_some_and(|needed| needed <= rest) => Ok(count),
            _ => Err(self.wrong(
                format!("{count} {what} of at least {least} bytes"),
                format!("{} up to the end", counted(rest, "byte")),
            )),
        }
    }

    fn name(&mut self) -> Result<String, DatasetError> {
        let rest = self.all.get(self.offset..).unwrap_or_default();
        let length = rest
            .iter()
            .position(|&byte| byte == 0)
            .ok_or_else(|| self.wrong("an image name that ends with a zero byte", "the end of the file"))?;
        let bytes = self.take(length, "image name")?;
        self.offset += 1;
        if bytes.is_empty() {
            return Err(self.wrong("an image name", "an empty one"));
        }
        String::from_utf8(bytes.to_vec()).map_err(|_| self.wrong("an image name in UTF-8", "other bytes"))
    }

    fn end(&self) -> Result<(), DatasetError> {
        let rest = self.all.len().saturating_sub(self.offset);
        match rest {
            0 => Ok(()),
            _ => Err(self.wrong("the end of the file", format!("{rest} more {}", agree(rest, "byte", "bytes")))),
        }
    }
}

/// A file's records, `what`, of at least `least` bytes each.
fn read<T>(
    path: &Path,
    least: usize,
    what: &str,
    record: impl Fn(&mut Bytes) -> Result<T, DatasetError>,
) -> Result<Vec<T>, DatasetError> {
    let all = guarded::read(path, guarded::MODEL_MAX)?;
    let mut bytes = Bytes { file: path, all: &all, offset: 0 };
    let count = bytes.count(least, what)?;
    let records = (0..count).map(|_| record(&mut bytes)).collect::<Result<_, _>>()?;
    bytes.end()?;
    Ok(records)
}

/// cameras.bin
pub(super) fn cameras(path: &Path) -> Result<Vec<Listed>, DatasetError> {
    read(path, 4 + 4 + 8 + 8 + 16, "cameras", |bytes| {
        let id = bytes.u32("camera id")?;
        let number = bytes.u32("camera model")? as i32;
        let (model, params) = model_by_id(number).ok_or_else(|| {
            bytes.wrong(format!("a camera model of 0 to 17 for camera {id}"), format!("model {number}"))
        })?;
        let (width, height) = (bytes.u64("width")?, bytes.u64("height")?);
        let params = (0..params).map(|_| bytes.f64("camera parameter")).collect::<Result<_, _>>()?;
        Ok((id, Ok(Camera { model, width, height, params })))
    })
}

/// images.bin
pub(super) fn images(path: &Path, keep_observations: bool) -> Result<Vec<Image>, DatasetError> {
    read(path, 4 + 7 * 8 + 4 + 2 + 8, "images", |bytes| {
        bytes.u32("image id")?;
        let (q, t) = (bytes.f64s("quaternion")?, bytes.f64s("translation")?);
        let camera_id = bytes.u32("camera id")?;
        let name = bytes.name()?;
        let seen = bytes.count(24, "observations")?;
        let mut observations = Vec::new();
        if keep_observations {
            observations.reserve_exact(seen);
            for _ in 0..seen {
                let ([x, y], point) = (bytes.f64s("observation")?, bytes.u64("point id")?);
                if point != NO_POINT {
                    observations.push((x, y, point));
                }
            }
        } else {
            bytes.take(24 * seen, "observations")?;
        }
        Ok(Image { q, t, camera_id, name, observations })
    })
}

/// points3D.bin
pub(super) fn points(path: &Path) -> Result<Vec<(u64, Point)>, DatasetError> {
    read(path, 8 + 24 + 3 + 8 + 8, "points", |bytes| {
        let id = bytes.u64("point id")?;
        let position = DVec3::from_array(bytes.f64s("position")?);
        let color = bytes.array("colour")?;
        let error = bytes.f64("reprojection error")?;
        let track = bytes.count(8, "track entries")?;
        bytes.take(8 * track, "track")?;
        Ok((id, Point { position, color, error }))
    })
}

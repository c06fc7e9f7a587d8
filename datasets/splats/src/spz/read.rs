//! Reading versions 2 to 4. A file from anywhere takes no more memory than its own length allows.

use std::io::Read;
use std::path::Path;

use flate2::GzHeader;
use flate2::read::MultiGzDecoder;
use gs_base::local::{is_offset, localised};
use gs_base::{FileError, guarded};

use super::rotation::{unpack, unpack_v2};
use super::zstd;
use super::{ANTIALIASED, COLOUR, HEADER, MAGIC, OFFSET, SCALE_LEAST, SCALE_STEPS};
use crate::bounded::Bytes;
use crate::splats::{ALPHA_LEAST, logit};
use crate::turn::flip;
use crate::{COUNT_MAX, FILE_MAX, MARK, Splats};

/// No deflate stream holds more than 1032 bytes a byte: a match of 258 bytes takes at least two bits.
const DEFLATE_MOST: usize = 1032;

/// Most bits behind the point that a position of 24 bits has use for.
const FRACTIONAL_MOST: u8 = 23;

/// Highest degree of a file; harmonics above 3 are left out.
const DEGREE_MAX: usize = 4;

/// Reads SPZ 2, 3 or 4.
///
/// # Errors
/// When the file cannot be read, is no SPZ of these versions, or is cut short.
pub fn read(path: &Path) -> Result<Splats, FileError> {
    decode(&guarded::read(path, FILE_MAX)?).map_err(|message| FileError::wrong(path, message))
}

/// [`read`] of bytes.
///
/// # Errors
/// A sentence without the file's name.
pub fn decode(file: &[u8]) -> Result<Splats, String> {
    // A browser or a web server may have undone the gzip.
    if file.starts_with(&MAGIC.to_le_bytes()) {
        return unpacked(file);
    }
    let mut stream = MultiGzDecoder::new(file);
    let mut header = [0; HEADER];
    stream
        .read_exact(&mut header)
        .map_err(|error| format!("expected an SPZ file, which is gzip, found other bytes: {error}"))?;
    let offset = stream.header().and_then(GzHeader::comment).map_or(Ok([0.0; 3]), offset_of)?;
    let header = Header::parse(header)?;
    let length = header.length();
    if length / DEFLATE_MOST > file.len() {
        return Err(format!(
            "expected {} Gaussians, which no {} bytes of gzip hold; the file is cut short",
            header.count,
            file.len()
        ));
    }
    let mut arrays = Vec::new();
    arrays.try_reserve_exact(length).map_err(|error| format!("no memory for {} Gaussians: {error}", header.count))?;
    stream.take(length as u64 + 1).read_to_end(&mut arrays).map_err(|error| format!("cannot unpack: {error}"))?;
    header.splats(&arrays, offset)
}

/// The stream without its gzip, or version 4, which has none.
fn unpacked(file: &[u8]) -> Result<Splats, String> {
    let Some((header, arrays)) = file.split_first_chunk::<HEADER>() else {
        return Err(format!("expected a header of {HEADER} bytes, found {}; the file is cut short", file.len()));
    };
    let header = Header::parse(*header)?;
    match header.version {
        4 => header.splats(&zstd::arrays(file, &header.lengths())?, [0.0; 3]),
        _ => header.splats(arrays, [0.0; 3]),
    }
}

/// The offset in a comment of ours.
fn offset_of(comment: &[u8]) -> Result<[f64; 3], String> {
    let text = String::from_utf8_lossy(comment);
    let Some((_, words)) = text.split_once(OFFSET).filter(|_| text.starts_with(MARK)) else { return Ok([0.0; 3]) };
    let numbers: Vec<f64> = words.split(' ').map_while(|word| word.parse().ok()).collect();
    let offset = <[f64; 3]>::try_from(numbers).ok().filter(|offset| is_offset(*offset));
    offset.ok_or_else(|| "expected an offset of three numbers in the gzip comment, found another".to_owned())
}

struct Header {
    version: u32,
    count: usize,
    degree: usize,
    fractional_bits: u8,
    flags: u8,
}

impl Header {
    fn parse(bytes: [u8; HEADER]) -> Result<Self, String> {
        let mut rest = Bytes(&bytes);
        let magic = rest.u32()?;
        if magic != MAGIC {
            return Err(format!("expected an SPZ file, which begins with NGSP, found {magic:#010x}"));
        }
        let (version, count) = (rest.u32()?, rest.u32()? as usize);
        let &[degree, fractional_bits, flags, _] = rest.take(4)? else { return Err("a header is cut short".into()) };
        if ![2, 3, 4].contains(&version) {
            return Err(format!("expected SPZ 2, 3 or 4, found SPZ {version}, which is not read"));
        }
        if count > COUNT_MAX {
            return Err(format!("expected at most {COUNT_MAX} Gaussians, found {count}"));
        }
        if usize::from(degree) > DEGREE_MAX || fractional_bits > FRACTIONAL_MOST {
            return Err(format!(
                "expected SH of degree 0 to {DEGREE_MAX} and at most {FRACTIONAL_MOST} fractional bits, found \
                 {degree} and {fractional_bits}"
            ));
        }
        Ok(Self { version, count, degree: degree.into(), fractional_bits, flags })
    }

    fn rest(&self) -> usize {
        (self.degree + 1).pow(2) - 1
    }

    /// Bytes of a rotation.
    fn rotation(&self) -> usize {
        if self.version == 2 { 3 } else { 4 }
    }

    /// Bytes of each array: positions, alphas, colours, scales, rotations, harmonics.
    fn lengths(&self) -> [usize; 6] {
        [9, 1, 3, 3, self.rotation(), 3 * self.rest()].map(|bytes| self.count * bytes)
    }

    /// Bytes of all arrays.
    fn length(&self) -> usize {
        self.lengths().iter().sum()
    }

    /// The Gaussians of all arrays, to which `offset` is to be added.
    fn splats(&self, arrays: &[u8], offset: [f64; 3]) -> Result<Splats, String> {
        let length = self.length();
        if arrays.len() != length {
            let found = if arrays.len() > length { "more".to_owned() } else { arrays.len().to_string() };
            return Err(format!("expected {length} bytes for {} Gaussians, found {found}", self.count));
        }
        Ok(flip(&self.read(&mut Bytes(arrays), offset)?).cut(3))
    }

    fn read(&self, arrays: &mut Bytes, offset: [f64; 3]) -> Result<Splats, String> {
        let (n, rest) = (self.count, self.rest());
        let mut splats = Splats {
            degree: self.degree.min(3),
            antialiased: Some(self.flags & ANTIALIASED != 0),
            ..Splats::default()
        };
        let step = 0.5_f64.powi(self.fractional_bits.into());
        // Shifted up to the sign bit and back: 24 bits with a sign.
        let position = |b: &[u8]| f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8) * step;
        let positions: Vec<[f64; 3]> =
            arrays.take(9 * n)?.chunks(9).map(|b| [position(b), position(&b[3..]), position(&b[6..])]).collect();
        (splats.means, splats.offset) = localised(&positions, offset);
        splats.opacity_logits = arrays.take(n)?.iter().map(|b| logit(f64::from(*b) / 255.0, ALPHA_LEAST)).collect();
        let colours = arrays.take(3 * n)?;
        let scale = |b: u8| f32::from(b) / SCALE_STEPS + SCALE_LEAST;
        splats.log_scales = arrays.take(3 * n)?.chunks(3).map(|b| [scale(b[0]), scale(b[1]), scale(b[2])]).collect();
        let quat = |b: &[u8]| {
            let [x, y, z, w] = match *b {
                [a, b, c, d] => unpack(u32::from_le_bytes([a, b, c, d])),
                _ => unpack_v2([b[0], b[1], b[2]]),
            };
            [w, x, y, z].map(|x| x as f32)
        };
        splats.quats = arrays.take(self.rotation() * n)?.chunks(self.rotation()).map(quat).collect();
        let harmonics = arrays.take(3 * rest * n)?;
        let kept = splats.coefficients() - 1;
        splats.sh.reserve(n * (kept + 1));
        for (index, colour) in colours.chunks(3).enumerate() {
            let dc = |b: u8| (f32::from(b) / 255.0 - 0.5) / COLOUR;
            splats.sh.push([dc(colour[0]), dc(colour[1]), dc(colour[2])]);
            let harmonic = |b: u8| (f32::from(b) - 128.0) / 128.0;
            let own = &harmonics[3 * rest * index..][..3 * kept];
            splats.sh.extend(own.chunks(3).map(|b| [harmonic(b[0]), harmonic(b[1]), harmonic(b[2])]));
        }
        Ok(splats)
    }
}

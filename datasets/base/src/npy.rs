//! NumPy arrays (`.npy`, versions 1 to 3), of any plain number type, in C or Fortran order.
//!
//! ```text
//! "\x93NUMPY" | u8 major | u8 minor | header length (u16 in version 1, else u32) | header | values
//! header: a Python dictionary, {'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }
//! ```

use std::path::Path;

use half::f16;

use crate::atomic::write_atomic;
use crate::error::FileError;
use crate::guarded;

/// The first bytes of every file.
pub const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header that is read, bytes. NumPy itself refuses more than 10 000.
const HEADER_MAX: usize = 1 << 16;

/// Most axes of an array: NumPy has no more. Bringing a value into order takes a step for each.
const AXES_MAX: usize = 64;

/// Most values that are read: half a GiB in f64, and more pixels than any camera has.
const VALUES_MAX: usize = 1 << 26;

/// An array as its file holds it.
pub struct Array {
    /// Lengths of the axes, outermost first. The values are always in C order.
    pub shape: Vec<usize>,
    /// All values.
    pub values: Vec<f64>,
}

/// Writes rows as an array `[rows.len(), C]` of little-endian f32 (version 1, C order).
///
/// # Errors
/// When the file cannot be written.
pub fn write_npy<const C: usize>(path: &Path, rows: &[[f32; C]]) -> Result<(), FileError> {
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {C}), }}", rows.len());
    // NumPy asks for values at a multiple of 64 bytes, and for a header that ends with a line.
    let before = MAGIC.len() + 4;
    let padded = (before + header.len() + 1).next_multiple_of(64) - before;
    header.extend(std::iter::repeat_n(' ', padded - header.len() - 1));
    header.push('\n');
    let mut bytes = [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    bytes.extend(rows.iter().flatten().flat_map(|value| value.to_le_bytes()));
    write_atomic(path, &bytes)
}

/// Reads a file.
pub fn read(path: &Path) -> Result<Array, FileError> {
    let bytes = guarded::read(path, guarded::IMAGE_MAX)?;
    parse(path, &bytes)
}

/// Reads a file's bytes; `path` is for messages.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Array, FileError> {
    let wrong = |location: &str, expected: &str, found: String| FileError::malformed(path, location, expected, found);
    let cut = |location: &str| wrong(location, "more bytes", "the end of the file".to_string());
    let rest = bytes
        .strip_prefix(MAGIC)
        .ok_or_else(|| wrong("byte 0", "a NumPy array (\\x93NUMPY)", format!("{:?}", &bytes[..bytes.len().min(6)])))?;
    let (version, rest) = rest.split_first_chunk::<2>().ok_or_else(|| cut("version"))?;
    let (length, rest) = match version[0] {
        1 => {
            let (length, rest) = rest.split_first_chunk::<2>().ok_or_else(|| cut("header length"))?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        2 | 3 => {
            let (length, rest) = rest.split_first_chunk::<4>().ok_or_else(|| cut("header length"))?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
        other => return Err(wrong("version", "1, 2 or 3", other.to_string())),
    };
    if length > HEADER_MAX {
        return Err(wrong("header length", "at most 65536 bytes", length.to_string()));
    }
    let (header, data) = rest.split_at_checked(length).ok_or_else(|| cut("header"))?;
    let header = String::from_utf8_lossy(header);
    let header = Header::parse(&header)
        .ok_or_else(|| wrong("header", "a dictionary with descr, fortran_order and shape", shortened(&header)))?;
    let number = Number::parse(&header.descr)
        .ok_or_else(|| wrong("descr", "a plain number type (f2 f4 f8 u1 u2 u4 i1 .. i8 b1)", header.descr.clone()))?;
    if header.shape.len() > AXES_MAX {
        return Err(wrong("shape", &format!("at most {AXES_MAX} axes"), header.shape.len().to_string()));
    }
    let count = header.shape.iter().try_fold(1_usize, |product, side| product.checked_mul(*side));
    let count = count.filter(|count| *count <= VALUES_MAX);
    let needed = count.and_then(|count| count.checked_mul(number.bytes()));
    let data = needed.and_then(|needed| data.get(..needed)).ok_or_else(|| {
        wrong("values", &format!("an array of {:?} {}", header.shape, header.descr), format!("{} bytes", data.len()))
    })?;
    let values: Vec<f64> = data.chunks_exact(number.bytes()).map(|bytes| number.read(bytes)).collect();
    let values = if header.fortran { to_c_order(&values, &header.shape) } else { values };
    Ok(Array { shape: header.shape, values })
}

struct Header {
    descr: String,
    fortran: bool,
    shape: Vec<usize>,
}

impl Header {
    fn parse(text: &str) -> Option<Self> {
        let descr = value_of(text, "descr")?;
        // A list in place of a string describes records with named fields; they are no plain numbers.
        let quote = descr.chars().next()?;
        let descr = match quote {
            '\'' | '"' => descr[1..].split(quote).next()?.to_string(),
            _ => "records".to_string(),
        };
        let fortran = value_of(text, "fortran_order")?.starts_with("True");
        let shape = value_of(text, "shape")?.strip_prefix('(')?.split(')').next()?;
        let shape = shape
            .split(',')
            .map(|side| side.trim().trim_end_matches('L'))
            .filter(|side| !side.is_empty())
            .map(|side| side.parse().ok())
            .collect::<Option<Vec<usize>>>()?;
        Some(Self { descr, fortran, shape })
    }
}

/// The text behind `'key':` in the text of a dictionary.
fn value_of<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let after = quoted.iter().find_map(|quoted| text.split_once(quoted.as_str()))?.1;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

fn shortened(text: &str) -> String {
    format!("{:?}", text.chars().take(60).collect::<String>())
}

/// A plain number type, little-endian or big-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Number {
    /// NumPy's letter.
    kind: u8,
    bytes: usize,
    big_endian: bool,
}

impl Number {
    /// The type of NumPy's text for it, `<f4` or without the order of its bytes `f4`; `None` for one of no plain
    /// numbers.
    pub fn parse(descr: &str) -> Option<Self> {
        let name = descr.strip_prefix(['<', '>', '|', '=']).unwrap_or(descr);
        let (kind, size) = name.as_bytes().split_first()?;
        let bytes: usize = std::str::from_utf8(size).ok()?.parse().ok()?;
        let known = match kind {
            b'f' => [2, 4, 8].contains(&bytes),
            b'u' | b'i' => [1, 2, 4, 8].contains(&bytes),
            b'b' => bytes == 1,
            _ => false,
        };
        known.then_some(Self { kind: *kind, bytes, big_endian: descr.starts_with('>') })
    }

    /// Reads the highest byte first from now on.
    pub fn set_big_endian(&mut self) {
        self.big_endian = true;
    }

    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        self.bytes
    }

    /// Whether values have a fraction.
    pub fn is_float(self) -> bool {
        self.kind == b'f'
    }

    /// The value in the first bytes of `bytes`.
    pub fn read(self, bytes: &[u8]) -> f64 {
        let raw = self.raw(bytes);
        match (self.kind, self.bytes) {
            (b'f', 2) => f64::from(f16::from_bits(raw as u16).to_f32()),
            (b'f', 4) => f64::from(f32::from_bits(raw as u32)),
            (b'f', _) => f64::from_bits(raw),
            (b'i', _) => self.read_integer(bytes) as f64,
            _ => raw as f64,
        }
    }

    /// The whole number in the first bytes of `bytes`.
    pub fn read_integer(self, bytes: &[u8]) -> i64 {
        let raw = self.raw(bytes);
        match (self.kind, self.bytes) {
            (b'i', 1) => i64::from(raw as u8 as i8),
            (b'i', 2) => i64::from(raw as u16 as i16),
            (b'i', 4) => i64::from(raw as u32 as i32),
            _ => raw as i64,
        }
    }

    /// The bits of the value, zeros above.
    fn raw(self, bytes: &[u8]) -> u64 {
        let mut raw = [0_u8; 8];
        raw[..self.bytes].copy_from_slice(&bytes[..self.bytes]);
        if self.big_endian {
            raw[..self.bytes].reverse();
        }
        u64::from_le_bytes(raw)
    }
}

/// From Fortran order (first axis fastest) to C order (last axis fastest).
fn to_c_order(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for side in shape {
        strides.push(stride);
        stride *= side;
    }
    (0..values.len())
        .map(|index| {
            let (mut rest, mut offset) = (index, 0);
            for (side, stride) in shape.iter().zip(&strides).rev() {
                offset += rest % side * stride;
                rest /= side;
            }
            values[offset]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Number, read, write_npy};

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("rows.npy");
        for count in [0, 1, 7] {
            let rows: Vec<[f32; 3]> = (0..count).map(|row| [row as f32, -0.5, 1e-7]).collect();
            write_npy(&path, &rows).expect("written");
            let array = read(&path).expect("read");
            assert_eq!(array.shape, [count, 3]);
            let values: Vec<f64> = rows.iter().flatten().map(|value| f64::from(*value)).collect();
            assert_eq!(array.values, values);
        }
    }

    fn number(descr: &str, bytes: &[u8]) -> f64 {
        Number::parse(descr).expect("a plain number type").read(bytes)
    }

    #[test]
    fn halves_by_hand() {
        let half = |bits: u16| {
            let value = number("<f2", &bits.to_le_bytes());
            assert_eq!(number(">f2", &bits.to_be_bytes()).to_bits(), value.to_bits(), "{bits:#x} in either order");
            value
        };
        assert_eq!(
            [0x3c00, 0xc000, 0x3555, 0x0001, 0x8001, 0x7bff, 0x7c00, 0xfc00].map(half),
            [
                1.0,
                -2.0,
                0.333_251_953_125,
                2f64.powi(-24),
                -(2f64.powi(-24)),
                65504.0,
                f64::INFINITY,
                f64::NEG_INFINITY
            ]
        );
        assert!(half(0x7e00).is_nan());
    }

    #[test]
    fn integers_by_hand() {
        let cases: [(&str, &[u8], f64); 10] = [
            ("|i1", &[0x80], -128.0),
            ("|u1", &[0x80], 128.0),
            ("|b1", &[1], 1.0),
            ("<i2", &[0xfe, 0xff], -2.0),
            (">i2", &[0xff, 0xfe], -2.0),
            (">u2", &[0xff, 0xfe], 65534.0),
            (">i4", &[0x80, 0, 0, 1], -2_147_483_647.0),
            (">u4", &[0x80, 0, 0, 1], 2_147_483_649.0),
            (">i8", &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xfd], -3.0),
            (">f4", &[0xc0, 0x20, 0, 0], -2.5),
        ];
        for (descr, bytes, expected) in cases {
            assert_eq!(number(descr, bytes), expected, "{descr}");
        }
    }
}

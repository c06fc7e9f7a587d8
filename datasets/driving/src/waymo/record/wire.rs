//! Fields of a message of Protocol Buffers. A message in a message is walked by who knows its number, so that the depth
//! is that of the code.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;

/// Longest head of a field: a tag and a number or length of ten bytes each.
const HEAD_MAX: usize = 20;

/// Most numbers that a list of a calibration or a shape may have: the TOP laser has 64 beams.
const LIST_MAX: usize = 65_536;

/// Bytes that are somewhere.
pub(crate) trait Blob {
    /// Bytes from `start` on, `length` or as many as there are.
    fn bytes(&self, start: usize, length: usize) -> Result<Cow<'_, [u8]>, String>;

    /// The length.
    fn length(&self) -> usize;
}

impl Blob for [u8] {
    fn bytes(&self, start: usize, length: usize) -> Result<Cow<'_, [u8]>, String> {
        let end = start.saturating_add(length).min(self.len());
        Ok(Cow::Borrowed(self.get(start..end).unwrap_or_default()))
    }

    fn length(&self) -> usize {
        self.len()
    }
}

/// A piece of a file, of which a little is held: images between the fields are not read.
pub(crate) struct Piece<'a> {
    file: RefCell<&'a File>,
    start: u64,
    length: usize,
    /// The bytes read last, and where they begin in the piece.
    window: RefCell<(usize, Vec<u8>)>,
}

impl<'a> Piece<'a> {
    /// Bytes that are read at a time.
    const WINDOW: usize = 4096;

    /// The piece of `length` bytes from `start` on.
    pub fn new(file: &'a File, start: u64, length: usize) -> Self {
        Self { file: RefCell::new(file), start, length, window: RefCell::default() }
    }
}

impl Blob for Piece<'_> {
    fn bytes(&self, start: usize, length: usize) -> Result<Cow<'_, [u8]>, String> {
        let length = length.min(self.length.saturating_sub(start));
        let mut window = self.window.borrow_mut();
        let (first, held) = &mut *window;
        let is_held = start >= *first && start + length <= *first + held.len();
        if !is_held {
            let count = length.max(Self::WINDOW).min(self.length - start.min(self.length));
            let mut file = self.file.borrow_mut();
            file.seek(SeekFrom::Start(self.start + start as u64)).map_err(|error| error.to_string())?;
            held.clear();
            *first = start;
            file.take(count as u64).read_to_end(held).map_err(|error| error.to_string())?;
        }
        let at = start - *first;
        held.get(at..at + length)
            .map(|bytes| Cow::Owned(bytes.to_vec()))
            .ok_or_else(|| "an end of the file".to_string())
    }

    fn length(&self) -> usize {
        self.length
    }
}

/// The value of a field.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    /// An integer or a truth value.
    Integer(u64),
    /// Eight bytes: a number in double precision.
    Double(f64),
    /// Four bytes: a number in single precision.
    Float(f32),
    /// The place of text, bytes, a message or a packed list.
    Bytes(Range<usize>),
}

/// The fields of the message at a place, each with its number.
pub(crate) fn fields<B: Blob + ?Sized>(blob: &B, place: Range<usize>) -> Fields<'_, B> {
    Fields { blob, at: place.start, end: place.end.min(blob.length()) }
}

/// See [`fields`].
pub(crate) struct Fields<'a, B: ?Sized> {
    blob: &'a B,
    at: usize,
    end: usize,
}

/// A number in groups of seven bits, and how many bytes it takes.
fn varint(bytes: &[u8]) -> Option<(u64, usize)> {
    let mut value = 0;
    for (index, byte) in bytes.iter().take(10).enumerate() {
        value |= u64::from(byte & 127).checked_shl(7 * index as u32)?;
        if *byte < 128 {
            return Some((value, index + 1));
        }
    }
    None
}

impl<B: Blob + ?Sized> Fields<'_, B> {
    fn read(&mut self) -> Result<(u64, Value), String> {
        let head = self.blob.bytes(self.at, HEAD_MAX.min(self.end - self.at))?;
        let wrong = || format!("a broken field at byte {}", self.at);
        let (tag, used) = varint(&head).ok_or_else(wrong)?;
        let rest = &head[used..];
        let (value, length) = match tag & 7 {
            0 => {
                let (value, length) = varint(rest).ok_or_else(wrong)?;
                (Value::Integer(value), length)
            }
            1 => {
                let bytes = rest.first_chunk().ok_or_else(wrong)?;
                (Value::Double(f64::from_le_bytes(*bytes)), 8)
            }
            2 => {
                let (length, more) = varint(rest).ok_or_else(wrong)?;
                let start = self.at + used + more;
                let end = usize::try_from(length).ok().and_then(|length| start.checked_add(length));
                let end = end.filter(|end| *end <= self.end).ok_or_else(wrong)?;
                (Value::Bytes(start..end), more + (end - start))
            }
            5 => {
                let bytes = rest.first_chunk().ok_or_else(wrong)?;
                (Value::Float(f32::from_le_bytes(*bytes)), 4)
            }
            _ => return Err(wrong()),
        };
        self.at += used + length;
        Ok((tag >> 3, value))
    }
}

impl<B: Blob + ?Sized> Iterator for Fields<'_, B> {
    type Item = Result<(u64, Value), String>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.end {
            return None;
        }
        let read = self.read();
        if read.is_err() {
            self.at = self.end;
        }
        Some(read)
    }
}

/// Appends the numbers of a field of a list, packed or not.
pub(crate) fn doubles<B: Blob + ?Sized>(blob: &B, value: &Value, list: &mut Vec<f64>) -> Result<(), String> {
    match value {
        Value::Double(number) => list.push(*number),
        Value::Bytes(place) if place.len() <= 8 * LIST_MAX => {
            let bytes = blob.bytes(place.start, place.len())?;
            list.extend(bytes.chunks_exact(8).map(|bytes| f64::from_le_bytes(std::array::from_fn(|i| bytes[i]))));
        }
        _ => return Err("another type in a list of numbers".to_string()),
    }
    if list.len() > LIST_MAX { Err(format!("{} numbers", list.len())) } else { Ok(()) }
}

/// Appends the integers of a field of a list, packed or not.
pub(crate) fn integers<B: Blob + ?Sized>(blob: &B, value: &Value, list: &mut Vec<i64>) -> Result<(), String> {
    match value {
        Value::Integer(number) => list.push(*number as i64),
        Value::Bytes(place) if place.len() <= LIST_MAX => {
            let bytes = blob.bytes(place.start, place.len())?;
            let mut at = 0;
            while at < bytes.len() {
                let (number, used) = varint(&bytes[at..]).ok_or("a broken list of integers")?;
                list.push(number as i64);
                at += used;
            }
        }
        _ => return Err("another type in a list of integers".to_string()),
    }
    if list.len() > LIST_MAX { Err(format!("{} integers", list.len())) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_by_hand() {
        // 1: 150; 2: "ab"; 3: 1.0 (double); 4: 1.0 (float); 5: a list 3, 270 packed.
        let mut bytes = vec![0x08, 0x96, 0x01, 0x12, 2, b'a', b'b', 0x19];
        bytes.extend(1.0_f64.to_le_bytes());
        bytes.push(0x25);
        bytes.extend(1.0_f32.to_le_bytes());
        bytes.extend([0x2a, 3, 3, 0x8e, 0x02]);
        let end = bytes.len();
        let found: Vec<_> = fields(&bytes[..], 0..end).collect::<Result<_, _>>().expect("sound");
        let expected = [
            (1, Value::Integer(150)),
            (2, Value::Bytes(5..7)),
            (3, Value::Double(1.0)),
            (4, Value::Float(1.0)),
            (5, Value::Bytes(end - 3..end)),
        ];
        assert_eq!(found, expected);
        let mut list = Vec::new();
        integers(&bytes[..], &found[4].1, &mut list).expect("integers");
        assert_eq!(list, [3, 270]);
        // A field that reaches beyond its message, a group, and a tag without an end.
        for broken in [&[0x12, 3, 1, 2][..], &[0x0b, 1], &[0xff; 12], &[0x12, 0xff, 0xff, 0xff, 0xff, 0xff, 1]] {
            assert!(fields(broken, 0..broken.len()).any(|field| field.is_err()), "{broken:?}");
        }
    }
}

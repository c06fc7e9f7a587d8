//! The text header of a PLY file, and the numbers behind it.

use std::path::Path;

use crate::error::FileError;
use crate::npy::Number;

/// Longest header that is read, bytes; a header of Gaussians has 2 KB.
pub const HEADER_MAX: usize = 1 << 16;

/// Encoding of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Text.
    Ascii,
    /// Bytes, the lowest first.
    LittleEndian,
    /// Bytes, the highest first.
    BigEndian,
}

impl Encoding {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "ascii" => Self::Ascii,
            "binary_little_endian" => Self::LittleEndian,
            "binary_big_endian" => Self::BigEndian,
            _ => return None,
        })
    }
}

/// The number type of a name: signed and unsigned whole numbers, and floats.
fn scalar(name: &str) -> Option<Number> {
    Number::parse(match name {
        "char" | "int8" => "i1",
        "uchar" | "uint8" => "u1",
        "short" | "int16" => "i2",
        "ushort" | "uint16" => "u2",
        "int" | "int32" => "i4",
        "uint" | "uint32" => "u4",
        "float" | "float32" => "f4",
        "double" | "float64" => "f8",
        _ => return None,
    })
}

/// A property of an element.
#[derive(Clone, Debug)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// The type, in the byte order of the file; `None` for a list, whose length is in the data.
    pub scalar: Option<Number>,
}

/// An element: `count` records of its properties.
#[derive(Clone, Debug)]
pub struct Element {
    /// Its name, `vertex` or `face`.
    pub name: String,
    /// How many records there are.
    pub count: u64,
    /// The properties of a record, in their order.
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary record; `None` for a record with a list.
    pub fn stride(&self) -> Option<usize> {
        self.properties.iter().map(|property| property.scalar.map(Number::bytes)).sum()
    }

    /// Index, first byte in a binary record without lists, and type of the property of a name; `None` without it, and
    /// for a list.
    pub fn column(&self, name: &str) -> Option<(usize, usize, Number)> {
        let index = self.properties.iter().position(|property| property.name == name)?;
        let before = self.properties[..index].iter().filter_map(|property| property.scalar).map(Number::bytes).sum();
        Some((index, before, self.properties[index].scalar?))
    }
}

/// The content of a header.
#[derive(Clone, Debug)]
pub struct Header {
    /// Encoding of the values behind the header.
    pub encoding: Encoding,
    /// Elements in the order of their records.
    pub elements: Vec<Element>,
    /// Texts of the comments.
    pub comments: Vec<String>,
    /// Bytes up to and including the line `end_header`.
    pub len: usize,
}

impl Header {
    /// Reads up to and including `end_header` in the first [`HEADER_MAX`] of a file's `bytes`; `path` is for messages.
    ///
    /// # Errors
    /// When a line is none of a PLY header's, or the end is missing.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, FileError> {
        let wrong = |number: usize, expected: &str, found: &str| {
            FileError::malformed(
                path,
                format!("line {number} of the header"),
                expected,
                format!("`{}`", start_of(found)),
            )
        };
        let (mut encoding, mut elements, mut comments) = (None, Vec::<Element>::new(), Vec::new());
        let mut len = 0;
        for (index, line) in bytes[..bytes.len().min(HEADER_MAX)].split_inclusive(|byte| *byte == b'\n').enumerate() {
            len += line.len();
            let text = String::from_utf8_lossy(line);
            let (number, text) = (index + 1, text.trim_end());
            let unclear = |expected: &str| wrong(number, expected, text);
            match text.split_whitespace().collect::<Vec<_>>()[..] {
                ["ply"] if number == 1 => {}
                _ if number == 1 => return Err(unclear("a PLY file, which begins with `ply`")),
                // Cut short, or longer than a header.
                _ if !line.ends_with(b"\n") => break,
                ["format", name, ..] => encoding = Some(Encoding::parse(name).ok_or_else(|| unclear("a PLY format"))?),
                ["comment", ..] => comments.push(text.trim_start()["comment".len()..].trim_start().to_owned()),
                ["obj_info", ..] | [] => {}
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| unclear("a number of elements"))?;
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ref words @ .., name] => {
                    let scalar = match words {
                        ["list", _, _] => None,
                        [scalar] => Some(self::scalar(scalar).ok_or_else(|| unclear("a PLY scalar type"))?),
                        _ => return Err(unclear("a type and a name")),
                    };
                    let element = elements.last_mut().ok_or_else(|| unclear("an element before"))?;
                    element.properties.push(Property { name: name.to_owned(), scalar });
                }
                ["end_header"] => {
                    let encoding = encoding.ok_or_else(|| unclear("a line `format` before"))?;
                    if encoding == Encoding::BigEndian {
                        let properties = elements.iter_mut().flat_map(|element| &mut element.properties);
                        properties.filter_map(|property| property.scalar.as_mut()).for_each(Number::set_big_endian);
                    }
                    return Ok(Self { encoding, elements, comments, len });
                }
                _ => return Err(unclear("a line of a PLY header")),
            }
        }
        let found = "none; the file is cut short or no PLY file";
        Err(FileError::malformed(path, "header", "the line `end_header`", found))
    }
}

/// At most 80 characters: a file of another kind may hold lines of any length.
pub fn start_of(text: &str) -> String {
    text.chars().take(80).collect()
}

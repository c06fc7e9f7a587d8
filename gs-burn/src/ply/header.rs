//! The text header of a PLY file.

use std::io::{BufRead, Read};
use std::path::Path;

use gs_kernels::local::{OFFSET_MAX, is_offset};

use super::printable::printable;
use super::{OFFSET, PlyError, RENDER_MODE, SplatRenderMode};

/// Longest header that is read; a header of Gaussians has 2 KB.
const HEADER_MAX: u64 = 1 << 16;

/// Encoding of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value at the start of `bytes`.
    pub fn decode(self, bytes: &[u8], encoding: Encoding) -> f64 {
        /// Reads `$type` in the file's byte order.
        macro_rules! value {
            ($type:ty) => {{
                let mut array = [0; size_of::<$type>()];
                array.copy_from_slice(&bytes[..size_of::<$type>()]);
                match encoding {
                    Encoding::BigEndian => <$type>::from_be_bytes(array),
                    _ => <$type>::from_le_bytes(array),
                }
            }};
        }
        match self {
            Self::I8 => value!(i8).into(),
            Self::U8 => value!(u8).into(),
            Self::I16 => value!(i16).into(),
            Self::U16 => value!(u16).into(),
            Self::I32 => value!(i32).into(),
            Self::U32 => value!(u32).into(),
            Self::F32 => value!(f32).into(),
            Self::F64 => value!(f64),
        }
    }
}

/// A property of an element.
#[derive(Clone, Debug)]
pub struct Property {
    pub name: String,
    /// `None` for a list, whose length is in the data.
    pub scalar: Option<Scalar>,
}

/// An element: `count` records of its properties.
#[derive(Clone, Debug)]
pub struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary record; `None` for a record with a list.
    pub fn stride(&self) -> Option<usize> {
        self.properties.iter().map(|property| property.scalar.map(Scalar::size)).sum()
    }
}

/// At most 80 characters: a file that is no scene may hold lines of any length.
pub fn start_of(text: &str) -> String {
    text.chars().take(80).collect()
}

/// What the header says.
#[derive(Clone, Debug)]
pub struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// What a comment says about drawing; `None` without it, or where it says a word that is not known.
    pub render_mode: Option<SplatRenderMode>,
    /// Added to every position, by a comment; zero without it.
    pub offset: [f64; 3],
    /// Bytes up to and including the line `end_header`.
    pub len: u64,
}

impl Header {
    /// Reads up to and including `end_header`.
    pub fn read(path: &Path, file: &mut impl BufRead) -> Result<Self, PlyError> {
        let bad = |message: String| PlyError::Header { path: path.to_owned(), message };
        let io = |source| PlyError::Io { path: path.to_owned(), source };
        let mut file = file.take(HEADER_MAX);
        let mut len = 0;
        let mut line = Vec::new();
        let mut next = |file: &mut std::io::Take<_>| -> Result<Option<String>, PlyError> {
            line.clear();
            len += file.read_until(b'\n', &mut line).map_err(io)? as u64;
            let text = String::from_utf8_lossy(&line).trim_end().to_owned();
            Ok(line.ends_with(b"\n").then_some(text))
        };

        if next(&mut file)?.as_deref() != Some("ply") {
            return Err(bad("expected a PLY file, which begins with the line `ply`".into()));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let (mut render_mode, mut offset) = (None, [0.0; 3]);
        loop {
            let Some(line) = next(&mut file)? else {
                return Err(
                    bad("expected the line `end_header`, found none; the file is cut short or no scene".into()),
                );
            };
            let unclear = || bad(format!("cannot read the header line `{}`", printable(&start_of(&line))));
            match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["format", name, _] => {
                    encoding = Some(match name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => return Err(unclear()),
                    });
                }
                ["comment", RENDER_MODE, word] => render_mode = SplatRenderMode::of_word(word),
                ["comment", OFFSET, ref words @ ..] => {
                    let expected = || format!("expected three numbers up to {OFFSET_MAX:e} as offset");
                    offset = offset_of(words).ok_or_else(|| {
                        bad(format!("{}, found the line `{}`", expected(), printable(&start_of(&line))))
                    })?;
                }
                ["comment" | "obj_info", ..] | [] => {}
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| unclear())?;
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", "list", _, _, name] => {
                    let element = elements.last_mut().ok_or_else(unclear)?;
                    element.properties.push(Property { name: name.to_owned(), scalar: None });
                }
                ["property", scalar, name] => {
                    let scalar = Some(Scalar::parse(scalar).ok_or_else(unclear)?);
                    let element = elements.last_mut().ok_or_else(unclear)?;
                    element.properties.push(Property { name: name.to_owned(), scalar });
                }
                ["end_header"] => break,
                _ => return Err(unclear()),
            }
        }
        let encoding = encoding.ok_or_else(|| bad("expected a line `format`, found none".into()))?;
        Ok(Self { encoding, elements, render_mode, offset, len })
    }
}

fn offset_of(words: &[&str]) -> Option<[f64; 3]> {
    let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).filter(|offset| is_offset(*offset))
}

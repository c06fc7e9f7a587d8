//! Points with colours from PLY files: ascii and binary, any vertex properties beside x, y, z and the colour.

use std::path::Path;

use glam::DVec3;

use crate::error::DatasetError;
use crate::guarded;
use crate::plural::{agree, counted};
use crate::raw::RawPoints;

/// Colour of points without one: mid grey.
const NO_COLOR: [u8; 3] = [128; 3];

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A scalar type: its bytes and how they read.
#[derive(Clone, Copy)]
enum Scalar {
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
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
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

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Reads a value from exactly [`Self::size`] bytes.
    fn read(self, bytes: &[u8], encoding: Encoding) -> f64 {
        let mut little = [0_u8; 8];
        for (to, from) in little.iter_mut().zip(bytes) {
            *to = *from;
        }
        if encoding == Encoding::BigEndian {
            little[..self.size().min(bytes.len())].reverse();
        }
        let [a, b, c, d, ..] = little;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(little),
        }
    }

    fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

struct Header {
    encoding: Encoding,
    vertices: usize,
    properties: Vec<(String, Scalar)>,
    /// Where the data starts.
    end: usize,
}

/// Reads the vertices of a PLY file as points.
pub(crate) fn read(path: &Path) -> Result<RawPoints, DatasetError> {
    let bytes = guarded::read(path, guarded::POINTS_MAX)?;
    let header = header(&bytes, path)?;
    let column = |names: &[&str]| header.properties.iter().position(|(name, _)| names.contains(&name.as_str()));
    let mut position = [0; 3];
    for (slot, name) in position.iter_mut().zip(["x", "y", "z"]) {
        *slot = column(&[name])
            .ok_or_else(|| DatasetError::malformed(path, "header", format!("a vertex property {name}"), "none"))?;
    }
    let color = [["red", "r", "diffuse_red"], ["green", "g", "diffuse_green"], ["blue", "b", "diffuse_blue"]];
    let color: Option<Vec<usize>> = color.iter().map(|names| column(names)).collect();

    let mut points = RawPoints::default();
    let mut add = |index: usize, row: &[f64]| -> Result<(), DatasetError> {
        let at = |column: usize| row.get(column).copied().unwrap_or(f64::NAN);
        let position = DVec3::from_array(position.map(at));
        if !position.is_finite() || position.abs().max_element() > f64::from(f32::MAX) {
            return Err(DatasetError::malformed(
                path,
                format!("vertex {index}"),
                "a finite position",
                format!("{:?}", position.to_array()),
            ));
        }
        let mut rgb = NO_COLOR;
        for (out, column) in rgb.iter_mut().zip(color.iter().flatten()) {
            let scale = if header.properties[*column].1.is_float() { 255.0 } else { 1.0 };
            *out = (at(*column) * scale).round().clamp(0.0, 255.0) as u8;
        }
        points.positions.push(position);
        points.colors.push(rgb);
        Ok(())
    };
    let data = &bytes[header.end..];
    match header.encoding {
        Encoding::Ascii => read_ascii(data, &header, path, &mut add)?,
        _ => read_binary(data, &header, path, &mut add)?,
    }
    Ok(points)
}

type Add<'a> = dyn FnMut(usize, &[f64]) -> Result<(), DatasetError> + 'a;

fn read_ascii(data: &[u8], header: &Header, path: &Path, add: &mut Add) -> Result<(), DatasetError> {
    let text = String::from_utf8_lossy(data);
    let mut words = text.split_ascii_whitespace();
    let mut row = Vec::with_capacity(header.properties.len());
    for index in 0..header.vertices {
        row.clear();
        for (name, _) in &header.properties {
            let word = words.next().unwrap_or("the end of the file");
            row.push(word.parse::<f64>().map_err(|_| {
                let location = format!("vertex {index} of {}, property {name}", header.vertices);
                DatasetError::malformed(path, location, "a number", word)
            })?);
        }
        add(index, &row)?;
    }
    Ok(())
}

fn read_binary(data: &[u8], header: &Header, path: &Path, add: &mut Add) -> Result<(), DatasetError> {
    let stride: usize = header.properties.iter().map(|(_, scalar)| scalar.size()).sum();
    let needed = header.vertices.checked_mul(stride);
    if needed.is_none_or(|needed| needed > data.len()) {
        return Err(DatasetError::malformed(
            path,
            format!("byte {}", header.end),
            format!(
                "{} {} of {}",
                header.vertices,
                agree(header.vertices, "vertex", "vertices"),
                counted(stride, "byte")
            ),
            format!("{} up to the end of the file", counted(data.len(), "byte")),
        ));
    }
    let mut row = Vec::with_capacity(header.properties.len());
    for (index, mut record) in data.chunks_exact(stride).take(header.vertices).enumerate() {
        row.clear();
        for (_, scalar) in &header.properties {
            let (bytes, rest) = record.split_at(scalar.size());
            row.push(scalar.read(bytes, header.encoding));
            record = rest;
        }
        add(index, &row)?;
    }
    Ok(())
}

/// Reads the header up to and with `end_header`. Vertices must come first, as every tool writes them.
fn header(bytes: &[u8], path: &Path) -> Result<Header, DatasetError> {
    let wrong = |location: String, expected: &str, found: &str| {
        DatasetError::malformed(path, location, expected, found.chars().take(60).collect::<String>())
    };
    let mut encoding = None;
    let mut element: Option<String> = None;
    let mut vertices = None;
    let mut properties = Vec::new();
    let mut start = 0;
    for number in 1.. {
        let Some(length) = bytes[start..].iter().position(|&byte| byte == b'\n') else { break };
        let line = String::from_utf8_lossy(&bytes[start..start + length]).trim().to_string();
        start += length + 1;
        let location = format!("line {number}");
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err(wrong(location, "the word ply", &line)),
            ["format", kind, ..] => {
                encoding = Some(match *kind {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(wrong(location, "ascii or binary_little_endian or binary_big_endian", kind)),
                });
            }
            ["element", "vertex", count] => {
                if element.is_some() {
                    return Err(wrong(location, "vertex as the first element", &line));
                }
                let count = count.parse::<usize>().map_err(|_| wrong(location, "a number of vertices", count))?;
                vertices = Some(count);
                element = Some("vertex".to_string());
            }
            ["element", name, ..] => element = Some((*name).to_string()),
            ["property", rest @ ..] if element.as_deref() == Some("vertex") => {
                let [kind, name] = rest else {
                    return Err(wrong(location, "a scalar vertex property", &line));
                };
                let scalar = Scalar::parse(kind).ok_or_else(|| wrong(location, "a PLY scalar type", kind))?;
                properties.push(((*name).to_string(), scalar));
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| wrong(location.clone(), "a format line before", "none"))?;
                let vertices = vertices.ok_or_else(|| wrong(location, "an element vertex before", "none"))?;
                return Ok(Header { encoding, vertices, properties, end: start });
            }
            _ => {}
        }
    }
    Err(wrong(format!("byte {start}"), "a PLY header with end_header", "the end of the file"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_bytes(bytes: &[u8]) -> Result<RawPoints, DatasetError> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("points.ply");
        std::fs::write(&path, bytes).expect("written");
        read(&path)
    }

    #[test]
    fn ascii_little_and_big_endian_agree() {
        let properties = "property float x\nproperty double y\nproperty float z\nproperty uchar alpha\n\
                          property uchar red\nproperty uchar green\nproperty uchar blue\n";
        let head = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\ncomment by hand\nelement vertex 2\n{properties}element face 0\n\
                     property list uchar int vertex_indices\nend_header\n"
            )
        };
        let ascii = head("ascii") + "1 2 3 255 10 20 30\n-0.5 0.25 8 0 40 50 60\n";
        let rows = [([1.0_f32, 3.0], 2.0_f64, [255_u8, 10, 20, 30]), ([-0.5, 8.0], 0.25, [0, 40, 50, 60])];
        let (mut little, mut big) = (head("binary_little_endian").into_bytes(), head("binary_big_endian").into_bytes());
        for ([x, z], y, color) in rows {
            little.extend(x.to_le_bytes());
            little.extend(y.to_le_bytes());
            little.extend(z.to_le_bytes());
            little.extend(color);
            big.extend(x.to_be_bytes());
            big.extend(y.to_be_bytes());
            big.extend(z.to_be_bytes());
            big.extend(color);
        }
        let expected = read_bytes(ascii.as_bytes()).expect("ascii");
        assert_eq!(expected.positions, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-0.5, 0.25, 8.0)]);
        assert_eq!(expected.colors, [[10, 20, 30], [40, 50, 60]]);
        assert_eq!(read_bytes(&little).expect("little endian"), expected);
        assert_eq!(read_bytes(&big).expect("big endian"), expected);
        let error = read_bytes(&little[..little.len() - 1]).expect_err("cut off").to_string();
        assert!(error.contains("2 vertices of 20 bytes") && error.contains("39 bytes"), "{error}");
    }

    #[test]
    fn a_count_is_never_trusted() {
        for format in ["ascii", "binary_little_endian"] {
            let text = format!(
                "ply\nformat {format} 1.0\nelement vertex 18446744073709551615\nproperty float x\n\
                 property float y\nproperty float z\nend_header\n"
            );
            assert!(read_bytes(text.as_bytes()).is_err());
        }
    }
}

//! Points with colours from PLY files: ascii and binary, any vertex properties beside x, y, z and the colour.

use std::path::Path;

use glam::DVec3;
use gs_base::npy::Number;
use gs_base::ply::{Encoding, Header, Property, start_of};
use gs_base::{agree, counted, guarded};

use crate::error::DatasetError;
use crate::raw::RawPoints;

/// Colour of points without one: mid grey.
pub(crate) const NO_COLOR: [u8; 3] = [128; 3];

/// The header with its first element, the vertices.
struct Vertices {
    header: Header,
    count: usize,
    properties: Vec<(String, Number)>,
}

/// Reads the vertices of a PLY file as points.
pub(crate) fn read(path: &Path) -> Result<RawPoints, DatasetError> {
    let bytes = guarded::read(path, guarded::POINTS_MAX)?;
    let vertices = vertices(&bytes, path)?;
    let column = |names: &[&str]| vertices.properties.iter().position(|(name, _)| names.contains(&name.as_str()));
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
            let scale = if vertices.properties[*column].1.is_float() { 255.0 } else { 1.0 };
            *out = (at(*column) * scale).round().clamp(0.0, 255.0) as u8;
        }
        points.positions.push(position);
        points.colors.push(rgb);
        Ok(())
    };
    let data = &bytes[vertices.header.len..];
    match vertices.header.encoding {
        Encoding::Ascii => read_ascii(data, &vertices, path, &mut add)?,
        _ => read_binary(data, &vertices, path, &mut add)?,
    }
    Ok(points)
}

type Add<'a> = dyn FnMut(usize, &[f64]) -> Result<(), DatasetError> + 'a;

fn read_ascii(data: &[u8], vertices: &Vertices, path: &Path, add: &mut Add) -> Result<(), DatasetError> {
    let text = String::from_utf8_lossy(data);
    let mut words = text.split_ascii_whitespace();
    let mut row = Vec::with_capacity(vertices.properties.len());
    for index in 0..vertices.count {
        row.clear();
        for (name, _) in &vertices.properties {
            let word = words.next().unwrap_or("the end of the file");
            row.push(word.parse::<f64>().map_err(|_| {
                let location = format!("vertex {index} of {}, property {name}", vertices.count);
                DatasetError::malformed(path, location, "a number", word)
            })?);
        }
        add(index, &row)?;
    }
    Ok(())
}

fn read_binary(data: &[u8], vertices: &Vertices, path: &Path, add: &mut Add) -> Result<(), DatasetError> {
    let stride: usize = vertices.properties.iter().map(|(_, scalar)| scalar.bytes()).sum();
    let needed = vertices.count.checked_mul(stride);
    if needed.is_none_or(|needed| needed > data.len()) {
        return Err(DatasetError::malformed(
            path,
            format!("byte {}", vertices.header.len),
            format!(
                "{} {} of {}",
                vertices.count,
                agree(vertices.count, "vertex", "vertices"),
                counted(stride, "byte")
            ),
            format!("{} up to the end of the file", counted(data.len(), "byte")),
        ));
    }
    let mut row = Vec::with_capacity(vertices.properties.len());
    for (index, mut record) in data.chunks_exact(stride).take(vertices.count).enumerate() {
        row.clear();
        for (_, scalar) in &vertices.properties {
            let (bytes, rest) = record.split_at(scalar.bytes());
            row.push(scalar.read(bytes));
            record = rest;
        }
        add(index, &row)?;
    }
    Ok(())
}

/// Reads the header. Vertices must come first, as every tool writes them.
fn vertices(bytes: &[u8], path: &Path) -> Result<Vertices, DatasetError> {
    let wrong = |expected: &str, found: &str| DatasetError::malformed(path, "header", expected, start_of(found));
    let header = Header::parse(path, bytes)?;
    let Some(element) = header.elements.first().filter(|element| element.name == "vertex") else {
        let found = header.elements.first().map_or("none", |element| &element.name);
        return Err(wrong("vertex as the first element", found));
    };
    let count =
        usize::try_from(element.count).map_err(|_| wrong("a number of vertices", &element.count.to_string()))?;
    let property = |property: &Property| {
        let scalar =
            property.scalar.ok_or_else(|| wrong("scalar vertex properties", &format!("a list {}", property.name)))?;
        Ok((property.name.clone(), scalar))
    };
    let properties = element.properties.iter().map(property).collect::<Result<_, DatasetError>>()?;
    Ok(Vertices { count, properties, header })
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

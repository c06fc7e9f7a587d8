//! Writing a scene.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use gs_base::FileError;
use gs_base::atomic::write_atomic_with;

use super::{OFFSET, RECORD_OPACITY, RECORD_SH, RENDER_MODE, SplatRenderMode, record_names};
use crate::{MARK, Splats};

/// Writes a scene as little-endian binary in the layout of 3DGS, with a comment that says how it is to be drawn where
/// that is known, and one with its offset where that is not zero. The file is complete or does not exist.
///
/// # Errors
/// When the file cannot be written, or a Gaussian holds a value that is not finite, which no viewer could show.
pub fn write(path: &Path, splats: &Splats) -> Result<(), FileError> {
    splats.check().map_err(|message| FileError::wrong(path, message))?;
    write_atomic_with(path, |file| write_records(file, splats))
}

/// Bytes of the file of a scene, with its header.
pub fn encoded_len(splats: &Splats) -> usize {
    let layout = layout(splats.coefficients() - 1);
    header(splats, &layout).len() + 4 * layout.len() * splats.len()
}

fn header(splats: &Splats, layout: &[(String, Option<usize>)]) -> String {
    let mut lines = vec!["ply".into(), "format binary_little_endian 1.0".into(), format!("comment {MARK}")];
    lines.extend(splats.antialiased.map(|antialiased| {
        let mode = if antialiased { SplatRenderMode::Mip } else { SplatRenderMode::Default };
        format!("comment {RENDER_MODE} {}", mode.word())
    }));
    if splats.offset != [0.0; 3] {
        let [x, y, z] = splats.offset;
        lines.push(format!("comment {OFFSET} {x} {y} {z}"));
    }
    lines.push(format!("element vertex {}", splats.len()));
    lines.extend(layout.iter().map(|(name, _)| format!("property float {name}")));
    lines.push("end_header\n".into());
    lines.join("\n")
}

fn write_records(file: &mut File, splats: &Splats) -> io::Result<()> {
    let mut file = BufWriter::with_capacity(1 << 20, file);
    let layout = layout(splats.coefficients() - 1);
    file.write_all(header(splats, &layout).as_bytes())?;
    let mut record = Vec::new();
    for index in 0..splats.len() {
        record.clear();
        record.extend(splats.means[index]);
        record.extend(splats.quats[index]);
        record.extend(splats.log_scales[index]);
        record.push(splats.opacity_logits[index]);
        record.extend(splats.sh[index * splats.coefficients()..][..splats.coefficients()].as_flattened());
        for (_, column) in &layout {
            file.write_all(&column.map_or(0.0, |column| record[column]).to_le_bytes())?;
        }
    }
    file.flush()
}

/// Properties in the order of 3DGS, each with its index in the packed record; normals have none.
fn layout(rest: usize) -> Vec<(String, Option<usize>)> {
    let names = record_names(rest);
    let of_record = |name: String| {
        let column = names.iter().position(|known| *known == name);
        (name, column)
    };
    let rest_names = (0..3 * rest).map(|k| format!("f_rest_{k}"));
    let colour = names[RECORD_SH..RECORD_SH + 3].iter().cloned().chain(rest_names);
    let scales_and_quats = names[7..RECORD_OPACITY].iter().chain(&names[3..7]).cloned();
    ["x", "y", "z", "nx", "ny", "nz"]
        .map(str::to_owned)
        .into_iter()
        .chain(colour)
        .chain([names[RECORD_OPACITY].clone()])
        .chain(scales_and_quats)
        .map(of_record)
        .collect()
}

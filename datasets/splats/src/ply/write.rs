//! Writing a scene.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use burn::tensor::Tensor;
use gs_base::atomic::write_atomic_with;

use super::{OFFSET, PlyError, RECORD_OPACITY, RECORD_SH, RENDER_MODE, SplatRenderMode, record_names};
use crate::Gaussians;

/// Writes a scene as little-endian binary in the layout of 3DGS.
///
/// The file is written under a temporary name and then renamed, so it is complete or does not exist. Its folder is
/// made.
///
/// # Errors
/// When the file cannot be written, or a Gaussian holds a value that is not finite, which no viewer could show.
pub fn write_ply(path: impl AsRef<Path>, gaussians: &Gaussians) -> Result<(), PlyError> {
    write_ply_as(path, gaussians, None, [0.0; 3])
}

/// [`write_ply`] with comments that say how the scene is to be drawn, and what is to be added to its positions, if that
/// is not zero.
///
/// # Errors
/// As [`write_ply`].
pub fn write_ply_as(
    path: impl AsRef<Path>,
    gaussians: &Gaussians,
    mode: Option<SplatRenderMode>,
    offset: [f64; 3],
) -> Result<(), PlyError> {
    let path = path.as_ref();
    let records = Records::of(gaussians);
    records.check(path)?;
    write_atomic_with(path, |file| write(file, &records, mode, offset)).map_err(PlyError::File)
}

/// Parameters on the host, each with its values per Gaussian, in the order of the packed record.
struct Records {
    groups: [(Vec<f32>, usize); 5],
    count: usize,
    rest: usize,
}

impl Records {
    fn of(gaussians: &Gaussians) -> Self {
        fn floats<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
            tensor.into_data().iter::<f32>().collect()
        }
        let rest = (gaussians.sh_degree() + 1).pow(2) - 1;
        let groups = [
            (floats(gaussians.means.val()), 3),
            (floats(gaussians.quats.val()), 4),
            (floats(gaussians.log_scales.val()), 3),
            (floats(gaussians.opacity_logits.val()), 1),
            (floats(gaussians.sh.val()), 3 * (rest + 1)),
        ];
        Self { groups, count: gaussians.len(), rest }
    }

    /// The packed record of a Gaussian.
    fn record(&self, index: usize, record: &mut Vec<f32>) {
        record.clear();
        for (values, each) in &self.groups {
            record.extend_from_slice(&values[index * each..][..*each]);
        }
    }

    fn check(&self, path: &Path) -> Result<(), PlyError> {
        if self.groups.iter().all(|(values, _)| values.iter().all(|value| value.is_finite())) {
            return Ok(());
        }
        let mut record = Vec::new();
        let (mut first, mut broken) = (None, 0);
        for vertex in 0..self.count {
            self.record(vertex, &mut record);
            if let Some(index) = record.iter().position(|value| !value.is_finite()) {
                first.get_or_insert((vertex, index, record[index]));
                broken += 1;
            }
        }
        let Some((vertex, index, found)) = first else { return Ok(()) };
        let (path, property) = (path.to_owned(), record_names(self.rest).swap_remove(index));
        Err(PlyError::Broken { path, vertex, property, found, broken, count: self.count })
    }
}

/// Bytes of a file of so many Gaussians, with its header.
pub fn encoded_len(count: usize, sh_degree: usize, mode: Option<SplatRenderMode>, offset: [f64; 3]) -> usize {
    let layout = layout((sh_degree + 1).pow(2) - 1);
    header(count, &layout, mode, offset).len() + 4 * layout.len() * count
}

fn header(count: usize, layout: &[(String, Option<usize>)], mode: Option<SplatRenderMode>, offset: [f64; 3]) -> String {
    let mut lines = vec!["ply".into(), "format binary_little_endian 1.0".into(), "comment written by gsburn".into()];
    lines.extend(mode.map(|mode| format!("comment {RENDER_MODE} {}", mode.word())));
    if offset != [0.0; 3] {
        let [x, y, z] = offset;
        lines.push(format!("comment {OFFSET} {x} {y} {z}"));
    }
    lines.push(format!("element vertex {count}"));
    lines.extend(layout.iter().map(|(name, _)| format!("property float {name}")));
    lines.push("end_header\n".into());
    lines.join("\n")
}

fn write(file: &mut File, records: &Records, mode: Option<SplatRenderMode>, offset: [f64; 3]) -> io::Result<()> {
    let mut file = BufWriter::with_capacity(1 << 20, file);
    let layout = layout(records.rest);
    file.write_all(header(records.count, &layout, mode, offset).as_bytes())?;
    let mut record = Vec::new();
    for index in 0..records.count {
        records.record(index, &mut record);
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

//! RealityScan (RealityCapture): "Internal/External camera parameters", a CSV table with a row for each photo, and the
//! points as a PLY file beside it. Postshot reads the same.
//!
//! Columns: `#name,x,y,alt,heading,pitch,roll,f`, and where the template has them `px,py,k1,k2,k3,k4,t1,t2`. The
//! world's z is up. Angles are degrees: camera to world, OpenGL axes, is `Rz(-heading) Rx(pitch) Ry(roll)`. `f` is of
//! 36 mm film over the longer side; `px` and `py` are the principal point from the middle, in longer sides. Distortion
//! is Brown's, of coordinates in focal lengths.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{DMat3, DMat4, DVec3};
use gs_base::{counted, guarded};

use super::lookup::{Lookup, Reach};
use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{entries, folder_of, has_extension};
use crate::lens::Lens;
use crate::names;
use crate::options::LoadOptions;
use crate::raw::{RawFrame, RawPoints, RawScene};
use crate::scene::SceneFormat;
use crate::{pixels, ply, pose};

/// Columns without which a table is none of cameras.
const REQUIRED: [&str; 8] = ["name", "x", "y", "alt", "heading", "pitch", "roll", "f"];

/// Width of the film, millimetres.
const FILM: f64 = 36.0;

/// A table and the folder it describes.
pub(crate) struct CameraTable {
    pub file: PathBuf,
    folder: PathBuf,
}

/// The table in a folder, or given itself. Of several the first by name.
pub(crate) fn find(path: &Path) -> Option<CameraTable> {
    let is_table =
        |file: &Path| has_extension(file, &["csv"]) && first_line(file).is_some_and(|line| columns(&line).is_some());
    if !path.is_dir() {
        return is_table(path).then(|| CameraTable { file: path.to_path_buf(), folder: folder_of(path).to_path_buf() });
    }
    let file = entries(path).into_iter().find(|file| is_table(file))?;
    Some(CameraTable { file, folder: path.to_path_buf() })
}

/// The first line with text, of at most 4 KB.
fn first_line(file: &Path) -> Option<String> {
    use std::io::Read;
    let mut begin = Vec::new();
    guarded::open_regular(file, guarded::DESCRIPTION_MAX).ok()?.take(4096).read_to_end(&mut begin).ok()?;
    let text = String::from_utf8_lossy(&begin).into_owned();
    text.lines().map(str::trim).find(|line| is_row(line)).map(str::to_owned)
}

/// Some templates begin with the number of cameras.
fn is_row(line: &str) -> bool {
    !line.is_empty() && !line.starts_with("#cameras")
}

/// The place of each column, if all that are required are there.
fn columns(line: &str) -> Option<HashMap<String, usize>> {
    let name = |name: &str| name.trim().trim_start_matches(['#', '\u{feff}']).to_lowercase();
    let columns: HashMap<String, usize> = line.split(',').enumerate().map(|(i, text)| (name(text), i)).collect();
    REQUIRED.iter().all(|name| columns.contains_key(*name)).then_some(columns)
}

/// Reads the description of a scene.
pub(crate) fn read(
    table: &CameraTable,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<RawScene, DatasetError> {
    let file = &table.file;
    let text = guarded::read_to_string(file, guarded::DESCRIPTION_MAX)?;
    let mut lines = text.lines().enumerate().filter(|(_, line)| is_row(line.trim()));
    let header = lines.next().and_then(|(_, line)| columns(line)).ok_or_else(|| {
        DatasetError::malformed(file, "first line", format!("the columns {}", REQUIRED.join(",")), "others")
    })?;
    let root = image_folder(table, options);
    let rows: Vec<Row> = lines
        .map(|(i, line)| Row { file, header: &header, fields: line.split(',').map(str::trim).collect(), number: i + 1 })
        .collect();
    let mut photos = Lookup::of(&root, rows.iter().filter_map(|row| row.text("name").ok()), Reach::Anywhere);
    let mut frames = Vec::new();
    for row in &rows {
        let Some(written) = findings.take(row.text("name"))? else { continue };
        let name = names::output_name(&root, written, file);
        let Some(name) = findings.take(name)? else { continue };
        let Some(image_path) = photos.find(written) else { continue };
        let frame = row.frame(name, image_path);
        frames.extend(findings.take_posed(frame)?);
    }
    let hint = photos.hint();
    photos.warn(file, &hint, findings);
    let found = || format!("none of the {} of {}{hint}", counted(rows.len(), "photo"), file.display());
    findings.need_frames(&frames, &table.folder, found)?;
    let points = findings.take(points(table))?.flatten();
    if points.is_none() {
        findings.warn(format!("{}: there are no points (no PLY file beside the table)", file.display()));
    }
    Ok(RawScene { format: SceneFormat::RealityScan, frames, points })
}

fn image_folder(table: &CameraTable, options: &LoadOptions) -> PathBuf {
    let chosen = options.images.as_ref().map(|images| table.folder.join(images)).filter(|folder| folder.is_dir());
    let usual = table.folder.join("images");
    chosen.unwrap_or(if usual.is_dir() { usual } else { table.folder.clone() })
}

/// The PLY file with the table's name, or the only one beside it.
fn points(table: &CameraTable) -> Result<Option<RawPoints>, DatasetError> {
    let own = table.file.with_extension("ply");
    if own.exists() {
        return ply::read(&own).map(Some);
    }
    let is_ply = |path: &PathBuf| has_extension(path, &["ply"]);
    let files: Vec<PathBuf> = entries(&table.folder).into_iter().filter(is_ply).collect();
    if let [file] = files.as_slice() { ply::read(file).map(Some) } else { Ok(None) }
}

struct Row<'a> {
    file: &'a Path,
    header: &'a HashMap<String, usize>,
    fields: Vec<&'a str>,
    /// Of the line, from 1.
    number: usize,
}

impl<'a> Row<'a> {
    fn text(&self, column: &str) -> Result<&'a str, DatasetError> {
        let found = self.header.get(column).and_then(|index| self.fields.get(*index)).filter(|text| !text.is_empty());
        found.copied().ok_or_else(|| self.wrong(column, "nothing"))
    }

    fn number(&self, column: &str) -> Result<f64, DatasetError> {
        let text = self.text(column)?;
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.wrong(column, text))
    }

    /// 0 where the template has no such column.
    fn number_or_0(&self, column: &str) -> Result<f64, DatasetError> {
        if self.header.contains_key(column) { self.number(column) } else { Ok(0.0) }
    }

    fn wrong(&self, column: &str, found: &str) -> DatasetError {
        let expected = if column == "name" { "the name of a photo" } else { "a finite number" };
        DatasetError::malformed(self.file, format!("line {}, column {column}", self.number), expected, found)
    }

    fn frame(&self, name: String, image_path: PathBuf) -> Result<RawFrame, DatasetError> {
        let (width, height) = pixels::size_of(&image_path)?;
        let (width, height) = (f64::from(width), f64::from(height));
        let longer = width.max(height);
        let angle = |column: &str| self.number(column).map(f64::to_radians);
        let rotation = DMat3::from_rotation_z(-angle("heading")?)
            * DMat3::from_rotation_x(angle("pitch")?)
            * DMat3::from_rotation_y(angle("roll")?);
        let position = DVec3::new(self.number("x")?, self.number("y")?, self.number("alt")?);
        let mut c2w = DMat4::from_mat3(rotation);
        c2w.w_axis = position.extend(1.0);
        // The same checks as for every other pose.
        let c2w = pose::rigid(&c2w.transpose().to_cols_array_2d(), self.file, &name)?.c2w;
        let focal = self.number("f")? * longer / FILM;
        let optional = |column: &str| self.number_or_0(column);
        let centre = [0.5 * width + optional("px")? * longer, 0.5 * height + optional("py")? * longer];
        let distortion = Distortion {
            k: [optional("k1")?, optional("k2")?, optional("k3")?, optional("k4")?],
            p: [optional("t1")?, optional("t2")?],
            ..Distortion::default()
        };
        let lens = Lens::of([focal, focal, centre[0], centre[1]], (width, height), distortion);
        Ok(RawFrame::posed(name, image_path, pose::opencv_from_opengl(c2w), lens, self.file.to_path_buf()))
    }
}

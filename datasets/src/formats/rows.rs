//! The file of each row of an LLFF pose file, which holds no names.
//!
//! LLFF's script sorts names as text: `IMG_10` stands before `IMG_2`. Other scripts go by number. Photos and cameras
//! are numbered along a path, so that the right order has the shorter one.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use gs_base::sentence::decimals;

use crate::findings::Findings;
use crate::folder::file_name;
use crate::options::RowOrder;
use crate::order::natural;

/// The path in one order is this many times shorter: that order is right. A video in a wrong order jumps between frames
/// far apart, and its path is several times longer; cameras at random places have paths within a few tens of percent of
/// each other in any two orders.
const SHORTER: f64 = 2.0;

/// Brings files, which are sorted as text, into the order of the rows, and says which that is where it can be in doubt.
/// `positions` are the cameras by row.
pub(super) fn in_order(
    files: Vec<PathBuf>,
    positions: &[DVec3],
    pose_file: &Path,
    order: RowOrder,
    findings: &mut Findings,
) -> Vec<PathBuf> {
    let mut by_number = files.clone();
    by_number.sort_by(|a, b| natural(&file_name(a), &file_name(b)));
    let Some(at) = files.iter().zip(&by_number).position(|(a, b)| a != b).filter(|_| files.len() == positions.len())
    else {
        return files;
    };
    match order {
        RowOrder::Auto => {}
        RowOrder::Text => return files,
        RowOrder::Number => return by_number,
    }
    let row: HashMap<&Path, usize> = files.iter().enumerate().map(|(row, file)| (file.as_path(), row)).collect();
    // Both along the numbers, in which the photos were taken.
    let if_text = length(by_number.iter().map(|file| positions[row[file.as_path()]]));
    let if_number = length(positions.iter().copied());
    let (text, number) = (file_name(&files[at]), file_name(&by_number[at]));
    let file = pose_file.display();
    let way_out = |other: &str| format!("data.row_order={other} reads them the other way");
    if SHORTER * if_number < if_text {
        findings.warn(format!(
            "{file}: rows go with the numbers in names ({number} before {text}), and not with the names as text as \
             LLFF's script writes them: along the numbers the cameras' path is {} then, and {} otherwise; {}",
            shown(if_number),
            shown(if_text),
            way_out("text")
        ));
        return by_number;
    }
    let begin =
        format!("{file}: rows go with the names as text, as LLFF's script writes them ({text} before {number})");
    let paths = format!(
        "along the numbers the cameras' path is {} then, and {} if rows go by number",
        shown(if_text),
        shown(if_number)
    );
    let way_out = way_out("number");
    if SHORTER * if_text < if_number {
        findings.fact(format!("{begin}: {paths}; {way_out}."));
    } else {
        findings.warn(format!("{begin}; {paths}, which does not tell; {way_out}"));
    }
    files
}

fn shown(length: f64) -> String {
    // A world may be of any size.
    let places = if length < 1.0 { 5 } else { 2 };
    format!("{} long", decimals(length, places))
}

fn length(positions: impl Iterator<Item = DVec3>) -> f64 {
    let (mut length, mut last) = (0.0, None);
    for position in positions {
        length += last.map_or(0.0, |last: DVec3| last.distance(position));
        last = Some(position);
    }
    length
}

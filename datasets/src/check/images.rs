//! Facts and mistakes that show when every image, mask and prior is decoded.

use std::collections::BTreeMap;

use gs_base::statistics::range;
use gs_base::{agree, clause, counted};
use rayon::prelude::*;

use super::CheckReport;
use crate::decode::Decoder;
use crate::error::DatasetError;
use crate::face::Face;
use crate::findings::Findings;
use crate::names::some_names;
use crate::notes::{ViewNote, few_levels, off_photo_warning, say_depth, suspicion};
use crate::one_color;
use crate::priors::summary::{self, Noted};
use crate::projection::Projection;
use crate::raw::RawFrame;

/// Decodes every frame. Beside each stands whether it trains.
pub(super) fn describe(
    frames: &[(&RawFrame, bool)],
    decoder: &Decoder,
    report: &mut CheckReport,
    findings: &mut Findings,
) {
    let results: Vec<Result<ViewNote, DatasetError>> =
        frames.par_iter().map(|(frame, _)| decoder.examine(frame)).collect();
    let mut kept = Vec::new();
    for ((_, trains), result) in frames.iter().zip(results) {
        match result {
            Ok(note) => kept.push((note, *trains)),
            Err(error) => findings.errors.push(error),
        }
    }
    let (decoded, trains): (Vec<ViewNote>, Vec<bool>) = kept.into_iter().unzip();
    let training = decoded.iter().zip(&trains).filter(|(_, trains)| **trains);
    findings.errors.extend(one_color::refuse(&report.path, training.map(|(note, _)| note.one_color)).err());
    let mut sizes: Vec<((usize, usize), usize)> = Vec::new();
    for ViewNote { size, .. } in &decoded {
        match sizes.iter_mut().find(|(known, _)| known == size) {
            Some((_, count)) => *count += 1,
            None => sizes.push((*size, 1)),
        }
    }
    for ((width, height), count) in sizes.iter().take(5) {
        let (w, h) = decoder.target((*width, *height));
        let loaded = if (w, h) == (*width, *height) { String::new() } else { format!(", loaded at {w} x {h}") };
        report.facts.push(format!("{} {width} x {height} pixels{loaded}.", clause(*count, "image", "is", "are")));
    }
    if sizes.len() > 5 {
        report.facts.push(format!(
            "There {} {} more.",
            agree(sizes.len() - 5, "is", "are"),
            counted(sizes.len() - 5, "image size")
        ));
    }
    let turned: Vec<&str> = decoded.iter().filter(|value| value.is_turned).map(|value| value.name.as_str()).collect();
    if !turned.is_empty() {
        report.facts.push(format!(
            "{} an EXIF orientation, which is not applied: poses and intrinsics must be of the pixels as they are \
             stored, and those of COLMAP are ({}).",
            clause(turned.len(), "image", "has", "have"),
            some_names(&turned)
        ));
    }
    let rescaled = decoded.iter().filter(|value| value.rescaled.is_some()).count();
    if rescaled > 0 {
        findings
            .warn(format!("the intrinsics of {} are for another size and will be rescaled", counted(rescaled, "view")));
    }
    findings.warn_all(off_photo_warning(&report.path, &decoded));
    findings.warn_all(few_levels(&report.path, &decoded, decoder.behind.levels));
    say_depth(&report.path, &decoded, findings);
    report.facts.append(&mut findings.take_facts());
    let pinholes = || decoded.iter().filter(|value| value.projection == Projection::Pinhole);
    let across = |value: fn(&ViewNote) -> f64| range(pinholes().map(value)).map(shown);
    let x = across(|value| value.intrinsics.fx);
    let y = across(|value| value.intrinsics.fy);
    let angle = across(|value| 2.0 * (0.5 * value.size.0 as f64 / value.intrinsics.fx).atan().to_degrees());
    if let (Some(x), Some(y), Some(angle)) = (x, y, angle) {
        report
            .facts
            .push(format!("Focal lengths are {x} by {y} pixels; the horizontal angle of view is {angle} degrees."));
    }
    report.facts.extend(wide_photos(&decoded));
    let distorted = frames.iter().filter(|(frame, _)| !frame.lens.distortion.is_none()).count();
    report.facts.push(match distorted {
        0 => "No lens distortion is declared.".to_string(),
        _ => format!("{} a lens distortion, which is removed at load.", clause(distorted, "image", "has", "have")),
    });
    let masked = frames.iter().filter(|(frame, _)| !frame.masks.is_empty()).count();
    if masked > 0 {
        report.facts.push(format!("{} masks.", clause(masked, "image", "has", "have")));
    }
    report.blank = decoded.iter().filter(|value| value.is_blank).count();
    findings.warn_all(suspicion(&report.path, &decoded));
    let noted: Vec<Noted> = decoded
        .iter()
        .zip(trains)
        .map(|(note, trains)| Noted { name: &note.name, trains, notes: &note.sides })
        .collect();
    report.facts.extend(summary::facts(&noted));
    summary::warn(&report.path, &noted, findings);
}

/// How many pinhole views are made of wide photos, a sentence for each kind.
fn wide_photos(notes: &[ViewNote]) -> Vec<String> {
    // The horizontal angles of all views, degrees.
    let mut kinds: BTreeMap<(&str, usize), Vec<f64>> = BTreeMap::new();
    for note in notes.iter().filter(|note| !note.faces.is_empty()) {
        let angles = note.faces.iter().map(Face::across);
        kinds.entry((note.projection.kind(), note.faces.len())).or_default().extend(angles);
    }
    let said = |((kind, views), angles): ((&str, usize), Vec<f64>)| {
        let photos = counted(angles.len() / views, &format!("{kind} photo"));
        let angle = range(angles.into_iter()).map(|(low, high)| match (low.round(), high.round()) {
            (low, high) if low < high => format!("{low} to {high}"),
            (low, _) => low.to_string(),
        })?;
        Some(format!("{photos}, each as {} of {angle} degrees across.", counted(views, "pinhole view")))
    };
    kinds.into_iter().filter_map(said).collect()
}

/// "1375.52" or "1370.00 to 1380.00".
fn shown((low, high): (f64, f64)) -> String {
    if high - low < 0.005 { format!("{low:.2}") } else { format!("{low:.2} to {high:.2}") }
}

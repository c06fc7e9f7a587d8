//! Photos of more than 8 bits that use little of their range, as thermal cameras write them.

use std::path::Path;

use gs_base::statistics::range;
use gs_base::{agree, counted};

use crate::decode::ViewNote;

/// Levels of 255 that photos have at the least: with a quarter of the range, two of eight bits are lost.
const FEW: f64 = 64.0;

/// Half a level of 16 bits: photos of one level hold nothing that a stretch would show.
const ONE_LEVEL: f64 = 0.5 / 65535.0;

/// A warning about photos of more than 8 bits of which few levels are left at 8, with the key that spreads them;
/// `levels` is that key's value.
pub(crate) fn warning(scene: &Path, notes: &[ViewNote], levels: Option<[f64; 2]>) -> Option<String> {
    let ranges: Vec<[f64; 2]> = notes.iter().filter_map(|note| note.range).collect();
    let (low, high) = range(ranges.iter().flatten().copied())?;
    let left = 255.0 * (high - low);
    if levels.is_some() || left >= FEW || high - low < ONE_LEVEL {
        return None;
    }
    // A hundredth of the range, rounded outwards, so that no pixel is cut.
    let places = (2.0 - (high - low).log10()).ceil() as usize;
    let unit = 10.0_f64.powi(places as i32);
    let (low, high) = ((low * unit).floor() / unit, ((high * unit).ceil() / unit).min(1.0));
    Some(format!(
        "{}: {} of more than 8 bits {} levels from {low:.places$} to {high:.places$} of the full range, which leaves \
         {} of 256; data.levels=[{low:.places$}, {high:.places$}] spreads them over all",
        scene.display(),
        counted(ranges.len(), "photo"),
        agree(ranges.len(), "has", "have"),
        left.ceil() + 1.0
    ))
}

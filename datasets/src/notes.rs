//! Facts about decoded frames, and sentences about many of them.

use std::path::Path;

use gs_base::statistics::range;
use gs_base::{Intrinsics, agree, clause, counted, median};

use crate::face::Face;
use crate::findings::Findings;
use crate::frame::View;
use crate::mask::SUSPECT_SHARE;
use crate::names::some_names;
use crate::priors::attach::SideNotes;
use crate::projection::Projection;

/// Facts about one decoded frame, for sentences about many.
pub(crate) struct ViewNote {
    pub name: String,
    /// Width and height of the image file, pixels.
    pub size: (usize, usize),
    /// At that size.
    pub intrinsics: Intrinsics,
    pub projection: Projection,
    /// The pinhole views of a wide photo. Known only of photos that [`examine`](crate::decode::Decoder::examine) read.
    pub faces: Vec<Face>,
    /// The declared size, where intrinsics were rescaled.
    pub rescaled: Option<(f64, f64)>,
    pub off_photo: bool,
    /// Share of the photo that mask files ignore; `None` without one.
    pub masked: Option<f64>,
    /// No pixel of the view counts.
    pub is_blank: bool,
    /// The one colour of the whole photo, see [`one_color`](crate::one_color).
    pub one_color: Option<[f32; 3]>,
    /// The photo is stored turned or mirrored, by EXIF. Known only of frames that
    /// [`examine`](crate::decode::Decoder::examine) read.
    pub is_turned: bool,
    /// The levels of a photo of more than 8 bits, as shares of its full range; `None` of a photo of 8 bits.
    pub range: Option<[f64; 2]>,
    /// Share of the pixels of a photo in linear light that are brighter than white; `None` of another photo.
    pub clipped: Option<f64>,
    pub sides: SideNotes,
}

/// Views of a log in its order, and the notes of frames that were decoded, with their indices.
pub(crate) type ViewsWithNotes = (Vec<View>, Vec<(usize, ViewNote)>);

/// Levels of 255 that photos have at the least: with a quarter of the range, two of eight bits are lost.
const FEW: f64 = 64.0;

/// Half a level of 16 bits: photos of one level hold nothing that a stretch would show.
const ONE_LEVEL: f64 = 0.5 / 65535.0;

/// A warning about photos of more than 8 bits of which few levels are left at 8, so that errors are small, as thermal
/// cameras write them, with the key that spreads them; `levels` is that key's value.
pub(crate) fn few_levels(scene: &Path, notes: &[ViewNote], levels: Option<[f64; 2]>) -> Option<String> {
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
        "{}: {} of more than 8 bits {} levels from {low:.places$} to {high:.places$} of the full range, which shows \
         {} of 256; data.levels=[{low:.places$}, {high:.places$}] spreads them over all",
        scene.display(),
        counted(ranges.len(), "photo"),
        agree(ranges.len(), "has", "have"),
        left.ceil() + 1.0
    ))
}

/// Says which photos have more than 8 bits, the space of the loss for those in linear light, and what is clipped there.
pub(crate) fn say_depth(scene: &Path, notes: &[ViewNote], findings: &mut Findings) {
    let deep = notes.iter().filter(|note| note.range.is_some()).count();
    if deep > 0 {
        let have = clause(deep, "photo", "has", "have");
        findings.fact(format!("{have} more than 8 bits a channel, which the loss and the measures keep."));
    }
    let clipped: Vec<f64> = notes.iter().filter_map(|note| note.clipped).collect();
    let percent = 100.0 * clipped.iter().sum::<f64>() / clipped.len().max(1) as f64;
    let are = clause(clipped.len(), "photo", "is", "are");
    let said = format!("{are} in linear light and brought to sRGB, in which the loss is taken");
    if percent > 0.0 {
        findings.warn(format!(
            "{}: {said}; {percent:.2} % of the pixels are brighter than white and clipped to it; \
             data.levels=[0, LIGHT] makes another light white",
            scene.display()
        ));
    } else if !clipped.is_empty() {
        findings.fact(format!("{said}."));
    }
}

/// The sentence about views whose principal point is not inside their photo, where there are any.
pub(crate) fn off_photo_warning(scene: &Path, notes: &[ViewNote]) -> Option<String> {
    let views: Vec<&str> = notes.iter().filter(|note| note.off_photo).map(|note| note.name.as_str()).collect();
    (!views.is_empty()).then(|| {
        format!(
            "{}: the principal point (cx, cy) of {} is not inside the photo; if the intrinsics are for photos of \
             another size, w and h must say which ({})",
            scene.display(),
            counted(views.len(), "view"),
            some_names(&views)
        )
    })
}

/// A warning if the masks of a scene ignore so much that they probably mean the opposite.
pub(crate) fn suspicion(scene: &Path, notes: &[ViewNote]) -> Option<String> {
    let median = median(notes.iter().filter_map(|note| note.masked).collect())?;
    (median > SUSPECT_SHARE).then(|| {
        format!(
            "{}: MASKS IGNORE {:.0} % OF THE MEDIAN VIEW. They may mean the opposite: look at one; \
             data.masks=keep-white, keep-black and ignore say how they are read",
            scene.display(),
            100.0 * median
        )
    })
}

//! What decoding every image, mask and prior shows.

use rayon::prelude::*;

use super::CheckReport;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::frame::Intrinsics;
use crate::lens::off_photo_warning;
use crate::loader;
use crate::mask::{self, Mask};
use crate::options::LoadOptions;
use crate::pixels::{self, Behind};
use crate::priors::attach::{Notes, Photo, attach};
use crate::priors::summary::{self, Noted};
use crate::raw::{Part, RawFrame};
use crate::resize::target_size;

/// What decoding one frame's files gave.
struct Decoded {
    size: (usize, usize),
    intrinsics: Intrinsics,
    rescaled: bool,
    off_photo: bool,
    /// Share of the image that masks ignore; `None` without masks.
    masked: Option<f64>,
    /// What loading priors and truth found.
    sides: Notes,
}

fn decode(frame: &RawFrame, options: &LoadOptions, behind: Behind) -> Result<Decoded, DatasetError> {
    let image = pixels::decode(&frame.image_path)?;
    let size = (image.width() as usize, image.height() as usize);
    let resolved = frame.lens.resolve((image.width(), image.height()), &frame.image_path, &frame.file)?;
    let masks: Vec<Mask> = frame.masks.iter().map(|file| Mask::open(file, size)).collect::<Result<_, _>>()?;
    let masked = (!masks.is_empty()).then(|| mask::ignored_share(&masks, size));
    let photo = Photo {
        size,
        target: target_size(size, options.max_width),
        undistorted: !frame.lens.distortion.is_none(),
        behind,
    };
    let sides = attach(&frame.sides, &photo).notes;
    Ok(Decoded {
        size,
        intrinsics: resolved.intrinsics,
        rescaled: resolved.rescaled_from.is_some(),
        off_photo: resolved.off_photo,
        masked,
        sides,
    })
}

pub(super) fn describe(frames: &[RawFrame], options: &LoadOptions, report: &mut CheckReport, findings: &mut Findings) {
    let behind = loader::behind(frames, options);
    let results: Vec<Result<Decoded, DatasetError>> =
        frames.par_iter().map(|frame| decode(frame, options, behind)).collect();
    let mut decoded = Vec::new();
    let mut names = Vec::new();
    for (frame, result) in frames.iter().zip(results) {
        match result {
            Ok(value) => {
                decoded.push(value);
                names.push(frame);
            }
            Err(error) => findings.errors.push(error),
        }
    }
    let mut sizes: Vec<((usize, usize), usize)> = Vec::new();
    for Decoded { size, .. } in &decoded {
        match sizes.iter_mut().find(|(known, _)| known == size) {
            Some((_, count)) => *count += 1,
            None => sizes.push((*size, 1)),
        }
    }
    for ((width, height), count) in sizes.iter().take(5) {
        let (w, h) = target_size((*width, *height), options.max_width);
        let loaded = if (w, h) == (*width, *height) { String::new() } else { format!(", loaded at {w} x {h}") };
        report.facts.push(format!("{count} images are {width} x {height} pixels{loaded}."));
    }
    if sizes.len() > 5 {
        report.facts.push(format!("There are {} more image sizes.", sizes.len() - 5));
    }
    let rescaled = decoded.iter().filter(|value| value.rescaled).count();
    if rescaled > 0 {
        findings.warn(format!("the intrinsics of {rescaled} views are for another size and will be rescaled"));
    }
    let off_photo: Vec<&str> =
        names.iter().zip(&decoded).filter(|(_, value)| value.off_photo).map(|(frame, _)| frame.name.as_str()).collect();
    findings.warnings.extend(off_photo_warning(&report.path, &off_photo));
    let across = |focal: fn(&Decoded) -> f64| {
        let low = decoded.iter().map(focal).fold(f64::INFINITY, f64::min);
        (low, decoded.iter().map(focal).fold(0.0, f64::max))
    };
    if !decoded.is_empty() {
        let (x, y) = (across(|value| value.intrinsics.fx), across(|value| value.intrinsics.fy));
        let angle = across(|value| 2.0 * (0.5 * value.size.0 as f64 / value.intrinsics.fx).atan().to_degrees());
        report.facts.push(format!(
            "Focal lengths are {} by {} pixels; the horizontal angle of view is {} degrees.",
            range(x),
            range(y),
            range(angle)
        ));
    }
    let distorted = frames.iter().filter(|frame| !frame.lens.distortion.is_none()).count();
    report.facts.push(match distorted {
        0 => "No lens distortion is declared.".to_string(),
        _ => format!("{distorted} images have a lens distortion, which is removed at load."),
    });
    let masked = frames.iter().filter(|frame| !frame.masks.is_empty()).count();
    if masked > 0 {
        report.facts.push(format!("{masked} images have masks."));
    }
    report.blank = decoded.iter().filter(|value| value.masked == Some(1.0)).count();
    let shares = decoded.iter().filter_map(|value| value.masked).collect();
    findings.warnings.extend(mask::suspicion(&report.path, shares));
    let noted: Vec<Noted> = names
        .iter()
        .zip(&decoded)
        .map(|(frame, value)| Noted {
            name: &frame.name,
            trains: Part::trains(frame.part.as_ref()),
            notes: &value.sides,
        })
        .collect();
    report.facts.extend(summary::facts(&noted));
    summary::warn(&report.path, &noted, findings);
}

/// "1375.52" or "1370.00 to 1380.00".
fn range((low, high): (f64, f64)) -> String {
    if high - low < 0.005 { format!("{low:.2}") } else { format!("{low:.2} to {high:.2}") }
}

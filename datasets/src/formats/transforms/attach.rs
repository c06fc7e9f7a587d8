//! Finding the files of each frame: the image, its masks, priors and truth.

use std::path::Path;

use gs_base::{agree, counted};
use serde_json::{Map, Value};

use super::frames::Entry;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats::json::Keys;
use crate::formats::lookup::{Lookup, Reach};
use crate::formats::panoptic;
use crate::mask::{MaskFile, White};
use crate::names;
use crate::names::some_names;
use crate::options::{DepthKind, LoadOptions, MaskUse};
use crate::priors::sources;
use crate::raw::RawFrame;
use crate::side_files::{DepthMeaning, Kind, SideFile, SideFiles};

/// The use of `mask_path` files.
#[derive(Clone, Copy, PartialEq)]
enum MaskRule {
    /// They say which pixels count.
    Counting(White),
    /// They mark moving objects.
    Moving,
    Unused,
}

/// Finds the files of each frame. Frames without an image are dropped with a warning; its end, about what is there in
/// place of missing images, comes back too.
pub(super) fn images(
    mut entries: Vec<Entry>,
    top: &Map<String, Value>,
    root: &Path,
    file: &Path,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<(Vec<RawFrame>, String), DatasetError> {
    let total = entries.len();
    let moved: Vec<(String, String)> = entries.iter_mut().filter_map(|entry| move_here(entry, root)).collect();
    let written: Vec<Option<String>> = entries.iter_mut().map(|entry| entry.file_path.take()).collect();
    let mut photos = Lookup::of(root, written.iter().filter_map(Option::as_deref), Reach::InPlace);
    moved.iter().for_each(|(from, to)| photos.note_elsewhere(from, to));
    let keys = Keys { file, location: "top level".to_string(), objects: vec![top] };
    let rule = mask_rule(&keys, root, options, &entries, findings)?;
    let depth = depth_meaning(&keys, options)?;
    blur_space(&keys, findings)?;
    let (mut nameless, mut missing_masks) = (0, Vec::new());
    let mut found = Vec::new();
    for (entry, written) in entries.into_iter().zip(&written) {
        let Some(written) = written else {
            nameless += 1;
            continue;
        };
        let Some(name) = findings.take(names::output_name(root, written, file))? else { continue };
        let Some(image_path) = photos.find(written) else { continue };
        let mut sides = SideFiles { files: Vec::new(), depth };
        // instant-ngp turns depth off by a scale of 0.
        let wanted = |kind| sources::is_wanted(kind, options.priors) && (kind != Kind::Depth || depth.step > 0.0);
        for (kind, path) in entry.sides.iter().filter(|(kind, _)| wanted(*kind)) {
            sides.files.push(SideFile { kind: *kind, path: Some(sources::named(root, path)) });
        }
        let mut masks = Vec::new();
        match (&entry.mask_path, rule) {
            (Some(path), MaskRule::Counting(white)) => match names::find_image(root, path) {
                Some(path) => masks.push(MaskFile { path, white }),
                None => missing_masks.push(path.clone()),
            },
            (Some(path), MaskRule::Moving) if options.priors.masks => {
                sides.files.push(SideFile { kind: Kind::Moving, path: Some(sources::named(root, path)) });
            }
            _ => {}
        }
        found.push(RawFrame {
            time: entry.time,
            camera_id: entry.camera_id,
            masks,
            exposure: entry.exposure,
            sides,
            ..RawFrame::posed(name, image_path, entry.c2w, entry.lens, file.to_path_buf())
        });
    }
    if let [first, ..] = &missing_masks[..]
        && missing_masks.len() == found.len()
    {
        let expected = "the masks that all frames name (--set data.masks=ignore: without)";
        return Err(keys.wrong(
            "mask_path",
            expected,
            format!("none of {}, {first} among them", counted(total, "file")),
        ));
    }
    let hint = photos.hint();
    photos.warn(file, &hint, findings);
    if nameless > 0 {
        let count = counted(nameless, "frame");
        findings.warn(format!(
            "{}: {count} without file_path {} left out",
            file.display(),
            agree(nameless, "was", "were")
        ));
    }
    if !missing_masks.is_empty() {
        findings.warn(format!(
            "{}: {} of {} {} not exist; {} ({})",
            file.display(),
            missing_masks.len(),
            counted(total, "mask"),
            agree(missing_masks.len(), "does", "do"),
            agree(missing_masks.len(), "its frame is not masked", "their frames are not masked"),
            some_names(&missing_masks)
        ));
    }
    search_side_folders(&mut found, root, file, rule, options, findings);
    Ok((found, hint))
}

/// Brings the paths of an entry that were written on another machine below `root`. The path of the photo as it was
/// written and as it is here.
fn move_here(entry: &mut Entry, root: &Path) -> Option<(String, String)> {
    let sides = entry.sides.iter_mut().map(|(_, path)| path);
    for path in entry.mask_path.iter_mut().chain(sides) {
        if let Some(here) = names::moved_here(root, path) {
            *path = here;
        }
    }
    let path = entry.file_path.as_mut()?;
    let here = names::moved_here(root, path)?;
    Some((std::mem::replace(path, here.clone()), here))
}

/// Looks beside the JSON for priors that it does not name.
fn search_side_folders(
    frames: &mut [RawFrame],
    root: &Path,
    file: &Path,
    rule: MaskRule,
    options: &LoadOptions,
    findings: &mut Findings,
) {
    let mut kinds = sources::OF_STILLS.to_vec();
    // Other folders of sets without times hold other things.
    if frames.iter().any(|frame| frame.time.is_some()) || options.masks == MaskUse::Moving {
        kinds.push(Kind::Sharp);
        if rule == MaskRule::Moving {
            kinds.push(Kind::Moving);
        }
    }
    sources::search(frames, root, file, &kinds, options.priors, findings);
    sources::note_gaps(frames);
}

/// The meaning of white in `mask_path` files.
fn mask_rule(
    keys: &Keys,
    root: &Path,
    options: &LoadOptions,
    entries: &[Entry],
    findings: &mut Findings,
) -> Result<MaskRule, DatasetError> {
    match options.masks {
        MaskUse::Ignore => return Ok(MaskRule::Unused),
        MaskUse::KeepWhite => return Ok(MaskRule::Counting(White::Keep)),
        MaskUse::KeepBlack => return Ok(MaskRule::Counting(White::Ignore)),
        MaskUse::Moving => return Ok(MaskRule::Moving),
        MaskUse::Auto => {}
    }
    match keys.text("mask_meaning")? {
        Some("keep") => Ok(MaskRule::Counting(White::Keep)),
        Some("ignore") => Ok(MaskRule::Counting(White::Ignore)),
        Some("dynamic") => Ok(MaskRule::Moving),
        Some(other) => Err(keys.wrong("mask_meaning", "\"keep\", \"ignore\" or \"dynamic\"", format!("{other:?}"))),
        None if marks_moving_people(root, entries) => Ok(MaskRule::Moving),
        // Those that no frame names are looked for where things move, see `search_side_folders`.
        None if entries.iter().all(|entry| entry.mask_path.is_none()) => Ok(MaskRule::Moving),
        None if entries.iter().any(|entry| entry.exposure.is_some()) => {
            findings.warn(format!(
                "{}: the masks are taken to be white where something moves, as those of blurry video are; \
                 \"mask_meaning\" in the \
                 file (\"keep\", \"ignore\", \"dynamic\") or data.masks says otherwise",
                keys.file.display()
            ));
            Ok(MaskRule::Moving)
        }
        None => Ok(MaskRule::Counting(White::Keep)),
    }
}

/// Whether masks without a stated meaning are those of a Panoptic set, converted: its own description lies beside the
/// JSON, and its masks, which mark what moves, are in the folder that it keeps them in.
fn marks_moving_people(root: &Path, entries: &[Entry]) -> bool {
    let folder = format!("{}/", panoptic::MASK_FOLDER);
    let in_folder = |path: &str| names::with_slashes(path).trim_start_matches("./").starts_with(&folder);
    let mut named = entries.iter().filter_map(|entry| entry.mask_path.as_deref()).peekable();
    named.peek().is_some() && named.all(in_folder) && root.join(panoptic::TRAIN_FILE).is_file()
}

/// The meaning of depth maps as the file states it; the user's options take precedence.
fn depth_meaning(keys: &Keys, options: &LoadOptions) -> Result<DepthMeaning, DatasetError> {
    let mut meaning = DepthMeaning::default();
    let said = keys.text("depth_kind")?.map(|kind| kind.replace('-', "_"));
    meaning.kind = match said.as_deref() {
        None => None,
        Some("metric_z") => Some(DepthKind::MetricZ),
        Some("depth") => Some(DepthKind::Depth),
        Some("inverse_depth" | "disparity") => Some(DepthKind::InverseDepth),
        Some(other) => {
            let expected = "\"metric_z\", \"depth\" or \"inverse_depth\"";
            return Err(keys.wrong("depth_kind", expected, format!("{other:?}")));
        }
    };
    meaning.kind = options.depth_kind.or(meaning.kind);
    if let Some(step) = keys.number("integer_depth_scale")? {
        if step < 0.0 {
            return Err(keys.wrong("integer_depth_scale", "a scale of 0 (no depth) or above", step.to_string()));
        }
        meaning.step = step;
    }
    Ok(meaning)
}

/// Blur is modelled in linear light; a file that says otherwise is read, with a word about it.
fn blur_space(keys: &Keys, findings: &mut Findings) -> Result<(), DatasetError> {
    match keys.text("blur_space")? {
        None | Some("linear") => {}
        Some("encoded") => findings.warn(format!(
            "{}: its photos were averaged as they are encoded (blur_space), not in linear light as cameras do; train \
             with blur.linear=false, or bright moving edges will differ",
            keys.file.display()
        )),
        Some(other) => return Err(keys.wrong("blur_space", "\"linear\" or \"encoded\"", format!("{other:?}"))),
    }
    Ok(())
}

//! Masks that no description names: `NAME.mask.png` beside a photo, as Postshot and Brush have it, is used; others are
//! said.

use std::path::{Path, PathBuf};

use gs_base::{agree, counted, guarded};

use crate::findings::Findings;
use crate::folder::{entries, file_name};
use crate::mask::{MaskFile, White};
use crate::names::some_names;
use crate::options::{LoadOptions, MaskUse};
use crate::raw::RawFrame;
use crate::side_files::{Kind, SideFile};

/// Ends of the names of masks, in place of a photo's extension or behind it.
const ENDS: [&str; 8] = ["png", "jpg", "jpeg", "mask.png", "mask.jpg", "_mask.png", "_mask.jpg", "-mask.png"];

/// Words in the names of folders of masks.
const FOLDER_WORDS: [&str; 4] = ["mask", "segment", "matte", "alpha"];

/// Adds the masks beside photos, and says which other masks there are where none is used.
pub(crate) fn find(frames: &mut [RawFrame], scene: &Path, options: &LoadOptions, findings: &mut Findings) {
    // A set that names its truth says all there is to say.
    let is_said = |frame: &RawFrame| {
        !frame.masks.is_empty()
            || frame.sides.files.iter().any(|file| file.kind == Kind::Moving || !file.kind.is_prior())
    };
    if options.masks == MaskUse::Ignore || frames.iter().any(is_said) {
        return;
    }
    let used = add_beside(frames, options);
    if !used.is_empty() {
        let (count, are) = (counted(used.len(), "file"), agree(used.len(), "is a mask", "are masks"));
        findings.fact(format!("{count} NAME.mask.png beside photos {are} ({}).", some_names(&used)));
        return;
    }
    warn_of_others(frames, scene, findings);
}

/// In a set with times they mark what moves, as a `masks` folder does that no frame names; elsewhere black is ignored.
fn add_beside(frames: &mut [RawFrame], options: &LoadOptions) -> Vec<String> {
    let is_moving = match options.masks {
        MaskUse::Auto => frames.iter().any(|frame| frame.time.is_some()),
        other => other == MaskUse::Moving,
    };
    let white = if options.masks == MaskUse::KeepBlack { White::Ignore } else { White::Keep };
    let mut used = Vec::new();
    for frame in frames {
        let path = frame.image_path.with_extension("mask.png");
        if !guarded::is_there(&path) || is_moving && !options.priors.masks {
            continue;
        }
        used.push(file_name(&path));
        if is_moving {
            frame.sides.files.push(SideFile { kind: Kind::Moving, path: Some(path) });
        } else {
            frame.masks.push(MaskFile { path, white });
        }
    }
    used
}

/// Warns of folders with names of masks, and of files beside photos with names of masks, that hold a file for some
/// photo.
fn warn_of_others(frames: &[RawFrame], scene: &Path, findings: &mut Findings) {
    let root = if scene.is_dir() { scene } else { scene.parent().unwrap_or(scene) };
    let is_mask_folder = |folder: &PathBuf| {
        let name = file_name(folder).to_lowercase();
        FOLDER_WORDS.iter().any(|word| name.contains(word)) && folder.is_dir()
    };
    let photo_folder = frames.first().and_then(|frame| frame.image_path.parent());
    let mut folders: Vec<PathBuf> = entries(root).into_iter().filter(is_mask_folder).collect();
    folders.extend(photo_folder.into_iter().flat_map(entries).filter(is_mask_folder));
    folders.dedup();
    // Beside the photo itself an image of its own name is no mask.
    let beside = |frame: &RawFrame| in_folder(frame.image_path.parent()?, &file_name(&frame.image_path), &ENDS[3..]);
    let counts = folders.iter().map(|folder| {
        let count = frames.iter().filter(|frame| masked_in(folder, frame, root)).count();
        (count, folder.display().to_string())
    });
    let beside: Vec<PathBuf> = frames.iter().filter_map(beside).collect();
    let beside = beside.first().map(|first| (beside.len(), first.display().to_string()));
    for (count, place) in counts.chain(beside).filter(|(count, _)| *count > 0) {
        findings.warn(format!(
            "{place}: {} named after photos {} not used: masks are read from `mask_path` in transforms.json, from \
             masks/NAME.png beside the image folder of a COLMAP model, and from NAME.mask.png beside a photo (black: \
             ignored)",
            counted(count, "mask"),
            agree(count, "is", "are")
        ));
    }
}

/// Whether a folder of masks has one of the frame's, by the photo's own name or with the folders before it.
fn masked_in(folder: &Path, frame: &RawFrame, root: &Path) -> bool {
    let name = file_name(&frame.image_path);
    let below = frame.image_path.strip_prefix(root).unwrap_or(&frame.image_path).to_string_lossy().into_owned();
    let shorter = below.split_once('/').map_or("", |(_, rest)| rest);
    [name.as_str(), below.as_str(), shorter]
        .into_iter()
        .filter(|name| !name.is_empty())
        .any(|name| in_folder(folder, name, &ENDS).is_some_and(|path| path != frame.image_path))
}

/// The first file of a folder that is named after the photo `name` with one of the ends.
fn in_folder(folder: &Path, name: &str, ends: &[&str]) -> Option<PathBuf> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let named = |base: &str, end: &&str| {
        let dot = if end.starts_with(['_', '-']) { "" } else { "." };
        folder.join(format!("{base}{dot}{end}"))
    };
    let all = [stem, name].into_iter().flat_map(|base| ends.iter().map(move |end| named(base, end)));
    all.into_iter().find(|path| guarded::is_there(path))
}

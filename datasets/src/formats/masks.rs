//! Masks that no description names, by their usual names: in a folder of masks, or beside a photo. Masks by other names
//! are said.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gs_base::{agree, clause, counted, guarded};

use crate::findings::Findings;
use crate::folder::{entries, file_name, folder_of, stem};
use crate::mask::{MaskFile, White};
use crate::options::{LoadOptions, MaskUse};
use crate::priors::sources;
use crate::raw::RawFrame;
use crate::scene::SceneFormat;
use crate::side_files::{Kind, SideFile};

/// Folders of masks. One lies in a photo's folder, beside it, or beside a folder above.
pub(super) const FOLDERS: [&str; 5] = ["masks", "mask", "images_masks", "segmentation", "segmentations"];

/// Masks in them, in the folders that the photos are in. FILE is the photo's name (COLMAP), NAME is it without its
/// extension (nerfstudio).
const IN_FOLDER: [&str; 7] =
    ["FILE.png", "NAME.png", "NAME.jpg", "NAME.jpeg", "NAME.mask.png", "NAME_mask.png", "NAME_mask.jpg"];

/// Masks beside their photos (the first one: Postshot, Brush).
const BESIDE: [&str; 4] = ["NAME.mask.png", "NAME_mask.png", "NAME_mask.jpg", "NAME-mask.png"];

/// instant-ngp's mask beside a photo, in which anything but black is ignored.
const DYNAMIC: &str = "dynamic_mask_NAME.png";

/// Words in the names of other folders of masks.
const WORDS: [&str; 4] = ["mask", "segment", "matte", "alpha"];

/// Folders of a photo that are looked at for folders of masks: its own and those above.
const LEVELS: usize = 4;

/// Adds the masks with usual names to frames of a set that names none, and says which other masks there are where there
/// are none. White counts; in a set with times, but one of COLMAP, it moves.
pub(crate) fn find(
    frames: &mut [RawFrame],
    scene: &Path,
    format: SceneFormat,
    options: &LoadOptions,
    findings: &mut Findings,
) {
    if options.masks == MaskUse::Ignore {
        return;
    }
    add_dynamic(frames);
    // A set that names its truth says all there is to say.
    let is_said = |frame: &RawFrame| {
        !frame.masks.is_empty()
            || frame.sides.files.iter().any(|file| file.kind == Kind::Moving || !file.kind.is_prior())
    };
    let is_colmap = matches!(format, SceneFormat::ColmapText | SceneFormat::ColmapBinary);
    let is_moving = match options.masks {
        MaskUse::Auto => !is_colmap && frames.iter().any(|frame| frame.time.is_some()),
        other => other == MaskUse::Moving,
    };
    if frames.iter().any(is_said) || is_moving && !options.priors.masks {
        return;
    }
    // The reader of transforms.json, which may say what masks mean, looked for masks of moving objects.
    let is_searched = is_moving && format == SceneFormat::Transforms;
    let folders = folders(frames, scene, |name| !is_searched && FOLDERS.contains(&name));
    let mask_of = |frame: &RawFrame| {
        let photo = &frame.image_path;
        let beside = BESIDE.iter().map(|pattern| named(photo, pattern)).find(|path| guarded::is_there(path));
        beside.or_else(|| folders.iter().find_map(|folder| in_folder(folder, photo)))
    };
    let masks: Vec<Option<PathBuf>> = frames.iter().map(mask_of).collect();
    let Some(first) = masks.iter().flatten().next() else { return warn_of_others(frames, scene, findings) };
    let (white, meaning) = match options.masks {
        _ if is_moving => (White::Keep, "white moves"),
        MaskUse::KeepBlack => (White::Ignore, "white is ignored"),
        _ => (White::Keep, "black is ignored"),
    };
    let (count, others) = (masks.iter().flatten().count(), masks.iter().filter(|mask| mask.is_none()).count());
    let (files, are) = (counted(count, "file"), agree(count, "is a mask", "are masks"));
    let said = format!("{}: {files} named after photos {are}, {meaning}", folder_of(first).display());
    if others == 0 || is_moving {
        findings.fact(format!("{said}."));
    } else {
        findings.warn(format!("{said}; {} whole", clause(others, "photo without one", "counts", "count")));
    }
    for (frame, path) in frames.iter_mut().zip(masks) {
        let Some(path) = path else { continue };
        if is_moving {
            frame.sides.files.push(SideFile { kind: Kind::Moving, path: Some(path) });
        } else {
            frame.masks.push(MaskFile { path, white });
        }
    }
    // Photos without a mask of what moves are counted with those without other priors.
    sources::note_gaps(frames);
}

/// Adds the masks of instant-ngp, which lie beside others.
fn add_dynamic(frames: &mut [RawFrame]) {
    for frame in frames {
        let path = Some(named(&frame.image_path, DYNAMIC)).filter(|path| guarded::is_there(path));
        frame.masks.extend(path.map(|path| MaskFile { path, white: White::Ignore }));
    }
}

/// The folders that masks may be in, by their names in lower case, the nearest to the photos first.
fn folders(frames: &[RawFrame], scene: &Path, is_meant: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let root = if scene.is_dir() { scene } else { scene.parent().unwrap_or(scene) };
    let of_photos: BTreeSet<&Path> = frames.iter().filter_map(|frame| frame.image_path.parent()).collect();
    let is_inside = |own: &Path, above: &Path| above.starts_with(root) || !own.starts_with(root);
    let above = of_photos.iter().flat_map(|own| own.ancestors().take_while(|above| is_inside(own, above)).take(LEVELS));
    let all: BTreeSet<&Path> = above.collect();
    let is_meant = |path: &PathBuf| is_meant(&file_name(path).to_lowercase()) && path.is_dir();
    all.into_iter().rev().flat_map(entries).filter(is_meant).collect()
}

/// The mask of a photo in a folder of masks, below which it lies as the photo does below the folder's own folder, or
/// without the first folder of that way.
fn in_folder(folder: &Path, photo: &Path) -> Option<PathBuf> {
    let whole = photo.strip_prefix(folder.parent()?).ok()?;
    let shorter: PathBuf = whole.iter().skip(1).collect();
    let ways = [whole, &shorter].into_iter().filter(|way| way.file_name().is_some());
    let mut names = ways.flat_map(|way| IN_FOLDER.iter().map(move |pattern| named(&folder.join(way), pattern)));
    // A photo that lies in the folder itself is not its own mask.
    names.find(|path| path != photo && guarded::is_there(path))
}

/// The path of a photo with its file's name by a pattern.
fn named(photo: &Path, pattern: &str) -> PathBuf {
    let file = file_name(photo);
    photo.with_file_name(match pattern.strip_prefix("FILE") {
        Some(end) => file + end,
        None => pattern.replace("NAME", &stem(photo)),
    })
}

/// Warns of other folders with names of masks that hold a file for some photo.
fn warn_of_others(frames: &[RawFrame], scene: &Path, findings: &mut Findings) {
    for folder in folders(frames, scene, |name| WORDS.iter().any(|word| name.contains(word))) {
        let count = frames.iter().filter(|frame| in_folder(&folder, &frame.image_path).is_some()).count();
        if count > 0 {
            findings.warn(format!(
                "{}: {} named after photos {} not used: masks are read from `mask_path` in transforms.json, from \
                 masks/NAME.png beside the image folder, and from NAME.mask.png beside a photo (black: ignored)",
                folder.display(),
                counted(count, "mask"),
                agree(count, "is", "are")
            ));
        }
    }
}

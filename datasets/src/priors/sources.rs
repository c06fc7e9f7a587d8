//! The files beside a photo: named by keys of its JSON frame, or found in side folders by the photo's own name.

use std::path::{Path, PathBuf};

use gs_base::{agree, counted, guarded};

use crate::findings::Findings;
use crate::names;
use crate::options::{LoadOptions, PriorUse};
use crate::raw::RawFrame;
use crate::side_files::{Kind, SideFile};

/// Keys of a frame. Masks are not among them: what `mask_path` means is for `mask_meaning` to say.
pub(crate) const FRAME_KEYS: &[(&str, Kind)] = &[
    ("depth_file_path", Kind::Depth),
    ("depth_path", Kind::Depth),
    ("confidence_file_path", Kind::Confidence),
    ("confidence_path", Kind::Confidence),
    ("pseudo_sharp_path", Kind::Sharp),
];

/// Keys of a frame's `truth` object.
pub(crate) const TRUTH_KEYS: &[(&str, Kind)] = &[
    ("sharp_path", Kind::TrueSharp),
    ("blurry_path", Kind::TrueBlurry),
    ("depth_path", Kind::TrueDepth),
    ("velocity_path", Kind::TrueVelocity),
    ("mask_path", Kind::TrueMoving),
    ("mask_union_path", Kind::TrueMovingUnion),
];

/// Extensions of files of depth and confidence, in the order in which they are tried.
const DEPTH_ENDINGS: &[&str] = &["exr", "npy", "png"];

/// Side folders of each prior, best first, and the extensions tried in them.
const FOLDERS: &[(Kind, &[&str], &[&str])] = &[
    (Kind::Depth, &["priors/depth", "depth", "depths"], DEPTH_ENDINGS),
    (Kind::Confidence, &["priors/confidence"], DEPTH_ENDINGS),
    (Kind::Moving, &["priors/masks", "masks", "seg"], &["png", "npy", "jpg"]),
    (Kind::Sharp, &["priors/sharp", "sharp"], &["png", "jpg", "jpeg"]),
];

/// The priors that sets without times may have.
pub(crate) const OF_STILLS: [Kind; 2] = [Kind::Depth, Kind::Confidence];

/// Extensions tried for a path that is written without one.
const TRIED: &[&str] = &["png", "exr", "npy", "jpg"];

/// The file that a key names, whether it exists or not.
pub(crate) fn named(root: &Path, written: &str) -> PathBuf {
    let path = root.join(names::with_slashes(written));
    if guarded::is_there(&path) {
        return path;
    }
    names::with_extension(&path, TRIED).unwrap_or(path)
}

/// Whether the user wants a kind of file read; truth always is.
pub(crate) fn is_wanted(kind: Kind, wanted: PriorUse) -> bool {
    match kind {
        Kind::Depth | Kind::Confidence => wanted.depth,
        Kind::Moving => wanted.masks,
        Kind::Sharp => wanted.sharp,
        _ => true,
    }
}

/// [`search`] for the depth of a set without times, whose description never names one.
pub(crate) fn search_depth(frames: &mut [RawFrame], root: &Path, options: &LoadOptions, findings: &mut Findings) {
    search(frames, root, root, &OF_STILLS, options.priors, findings);
    for frame in &mut *frames {
        frame.sides.depth.kind = options.depth_kind;
    }
    note_gaps(frames);
}

/// Looks for the side folders of `kinds` below `root`, by the frames' names, for kinds that no frame lists yet. Frames
/// without a file in a folder that others have one in are left for [`note_gaps`].
///
/// Folders are not looked at when any frame names its truth: such a set says all there is to say, and its `sharp`
/// folder holds the truth. `file` is the description, for the sentences about what was found.
pub(crate) fn search(
    frames: &mut [RawFrame],
    root: &Path,
    file: &Path,
    kinds: &[Kind],
    wanted: PriorUse,
    findings: &mut Findings,
) {
    if frames.iter().any(|frame| frame.sides.files.iter().any(|file| !file.kind.is_prior())) {
        return;
    }
    for (kind, folders, extensions) in FOLDERS {
        if !kinds.contains(kind) || !is_wanted(*kind, wanted) || frames.iter().any(|frame| frame.sides.lists(*kind)) {
            continue;
        }
        for folder in folders.iter().map(|folder| root.join(folder)).filter(|folder| folder.is_dir()) {
            let mut found = 0;
            for frame in frames.iter_mut() {
                // A photo that lies in the folder itself is not beside itself.
                let path = beside(&folder, &frame.name, extensions).filter(|path| *path != frame.image_path);
                if path.is_some() {
                    found += 1;
                    frame.sides.files.push(SideFile { kind: *kind, path });
                }
            }
            if found > 0 {
                report(*kind, &folder, file, found, findings);
                break;
            }
        }
    }
}

/// Says what a side folder is taken for. Pseudo-sharp images are warned about, because a folder of that name may also
/// hold the truth, and what trains on the truth proves nothing.
fn report(kind: Kind, folder: &Path, file: &Path, found: usize, findings: &mut Findings) {
    let sentence = format!(
        "{}: {} of {} {} read as {kind}",
        file.display(),
        counted(found, "file"),
        folder.display(),
        agree(found, "is", "are")
    );
    if kind == Kind::Sharp {
        findings.warn(format!(
            "{sentence}, guesses to learn from; if they are the truth, leave \"sharp\" out of data.priors"
        ));
    } else {
        findings.fact(format!("{sentence}."));
    }
}

/// The depth file of the photo `name` in a folder, as side folders are searched.
pub fn find_depth(folder: &Path, name: &str) -> Option<PathBuf> {
    beside(folder, name, DEPTH_ENDINGS)
}

/// `folder/train/0001.png` for `train/0001`, or `folder/0001.png`: some tools keep the photos' own folder, others not.
fn beside(folder: &Path, name: &str, extensions: &[&str]) -> Option<PathBuf> {
    let shorter = name.split_once('/').map(|(_, rest)| rest);
    [Some(name), shorter].into_iter().flatten().find_map(|name| names::with_extension(&folder.join(name), extensions))
}

/// Adds an entry without a path where other frames have one of the kind, so that the gap is counted. Where several
/// frames have one and all of these are of one time, as the priors of a reconstruction of the first frame are, only
/// frames of that time can lack it.
pub(crate) fn note_gaps(frames: &mut [RawFrame]) {
    for kind in [Kind::Depth, Kind::Confidence, Kind::Moving, Kind::Sharp] {
        let mut times = frames.iter().filter(|frame| frame.sides.lists(kind)).map(|frame| frame.time);
        let Some(first) = times.next() else { continue };
        let (others, same) = times.fold((0, true), |(count, same), time| (count + 1, same && time == first));
        let is_of_one_time = others > 0 && same;
        for frame in frames.iter_mut().filter(|frame| !frame.sides.lists(kind)) {
            if !is_of_one_time || frame.time == first {
                frame.sides.files.push(SideFile { kind, path: None });
            }
        }
    }
}

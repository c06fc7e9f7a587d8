//! Photos or videos without camera poses: the commonest first attempt, which deserves an answer.

use std::path::{Path, PathBuf};

use gs_base::counted;

use crate::folder::entries;
use crate::foreign::{CONVERT, EXTRACT, Foreign, POSES, is_photo};

/// The sentence on a folder of photos or videos: its content and the next step.
pub(super) fn found(path: &Path, is_folder: bool) -> Option<String> {
    if !is_folder {
        return match Foreign::of_extension(path) {
            Some(Foreign::Video) => Some(format!("a video and no camera poses; {EXTRACT}, then {POSES}")),
            None if !is_photo(path) => None,
            _ => Some("a single photo; give the folder that holds the photos and their poses".to_string()),
        };
    }
    let entries = entries(path);
    let below = || entries.iter().filter(|entry| entry.is_dir()).map(|folder| self::entries(folder));
    std::iter::once(files(&entries)).chain(below().map(|entries| files(&entries))).find_map(|found| found.sentence())
}

/// Files by what they would be good for.
struct Files {
    photos: usize,
    foreign: usize,
    videos: usize,
    /// Kind of the first foreign photo.
    kind: &'static str,
}

impl Files {
    fn sentence(&self) -> Option<String> {
        let none = "no camera poses";
        if self.photos > 0 {
            return Some(format!("{} and {none}; {POSES}", counted(self.photos, "photo")));
        }
        if self.foreign > 0 {
            let photos = counted(self.foreign, "photo");
            return Some(format!("{photos} of the kind {} and {none}; {CONVERT}, then {POSES}", self.kind));
        }
        (self.videos > 0).then(|| format!("{} and {none}; {EXTRACT}, then {POSES}", counted(self.videos, "video")))
    }
}

fn files(entries: &[PathBuf]) -> Files {
    let mut found = Files { photos: 0, foreign: 0, videos: 0, kind: "" };
    for path in entries {
        match Foreign::of_extension(path) {
            Some(Foreign::Photo(kind)) => {
                found.foreign += 1;
                found.kind = kind;
            }
            Some(Foreign::Video) => found.videos += 1,
            None => found.photos += usize::from(is_photo(path)),
        }
    }
    found
}

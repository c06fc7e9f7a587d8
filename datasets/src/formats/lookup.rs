//! The photos of a description: each where its name says, else where the name is found.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use gs_base::{agree, counted};

use super::renamed::Renamed;
use crate::findings::Findings;
use crate::names::{self, some_names};

/// How far from its name a photo is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reach {
    /// Anywhere below the folder, if only one photo can be meant: names of photos, whose folders come and go.
    Anywhere,
    /// In the place that the name gives, with another extension: paths, whose folders count. A path of [another
    /// machine](names::is_elsewhere) is looked for anywhere.
    InPlace,
}

/// Looks for the photos of one description, and keeps account.
pub(super) struct Lookup<'a> {
    root: &'a Path,
    reach: Reach,
    exact: HashMap<&'a str, PathBuf>,
    /// Files that some name gives as they are: no other name means them.
    taken: HashSet<PathBuf>,
    /// Files that were found under another name.
    moved: Vec<PathBuf>,
    /// The folder is listed once, and only if a photo is not where it should be.
    renamed: Option<Renamed>,
    elsewhere: Vec<String>,
    missing: Vec<String>,
    total: usize,
}

impl<'a> Lookup<'a> {
    /// For these names, relative to `root`.
    pub fn of(root: &'a Path, written: impl Iterator<Item = &'a str>, reach: Reach) -> Self {
        let (mut exact, mut total) = (HashMap::new(), 0);
        for name in written {
            total += 1;
            exact.extend(names::find_image(root, name).map(|path| (name, path)));
        }
        let taken = exact.values().cloned().collect();
        Self {
            root,
            reach,
            exact,
            taken,
            moved: Vec::new(),
            renamed: None,
            elsewhere: Vec::new(),
            missing: Vec::new(),
            total,
        }
    }

    /// The photo of one of the names. `None` is counted among the missing.
    pub fn find(&mut self, written: &str) -> Option<PathBuf> {
        if let Some(path) = self.exact.get(written) {
            return Some(path.clone());
        }
        let renamed = self.renamed.get_or_insert_with(|| Renamed::of(self.root));
        let is_anywhere = self.reach == Reach::Anywhere || names::is_elsewhere(self.root, written);
        let found = if is_anywhere { renamed.find(written) } else { renamed.find_in_place(written) };
        let Some(found) = found.filter(|found| !self.taken.contains(&found.path)) else {
            self.missing.push(written.to_string());
            return None;
        };
        let form = if found.is_other_form { ", in another Unicode form (NFC, NFD)" } else { "" };
        self.elsewhere.push(format!("{written} as {}{form}", renamed.shown(&found.path)));
        self.moved.push(found.path.clone());
        Some(found.path)
    }

    /// The files of all names.
    pub fn files(&self) -> HashSet<&Path> {
        self.taken.iter().chain(&self.moved).map(PathBuf::as_path).collect()
    }

    /// Counts a name that was found by other means.
    pub fn note_elsewhere(&mut self, written: &str, as_path: &str) {
        self.elsewhere.push(format!("{written} as {as_path}"));
    }

    /// The number of names.
    pub fn total(&self) -> usize {
        self.total
    }

    /// The names of photos that were not found.
    pub fn missing(&self) -> &[String] {
        &self.missing
    }

    /// The end of a sentence about the missing photos: what is there in their place.
    pub fn hint(&self) -> String {
        let Some(renamed) = &self.renamed else { return String::new() };
        // Where some photos are in place, one of the same name in another folder is another photo.
        let is_all = self.reach == Reach::InPlace && self.missing.len() == self.total;
        renamed.hint(&self.missing) + &if is_all { renamed.other_place(&self.missing) } else { String::new() }
    }

    /// Says what was found under another name and what was not found, of the photos that `file` describes. `hint` ends
    /// the sentence.
    pub fn warn(&self, file: &Path, hint: &str, findings: &mut Findings) {
        let root = self.root.display();
        findings.warn_of(file, &self.elsewhere, ["photo", "was", "were"], |were, names| {
            format!("{were} found under another name below {root} ({names})")
        });
        if !self.missing.is_empty() {
            findings.warn(format!(
                "{}: {} of {} {} not exist below {root}; {} left out ({}){hint}",
                file.display(),
                self.missing.len(),
                counted(self.total, "photo"),
                agree(self.missing.len(), "does", "do"),
                agree(self.missing.len(), "it was", "they were"),
                some_names(&self.missing)
            ));
        }
    }
}

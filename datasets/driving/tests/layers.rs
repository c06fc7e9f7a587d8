//! Files stay short, and modules form floors: no circle of `use crate::`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Most lines of a file.
const LINES_MAX: usize = 400;

fn sources(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    paths.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

#[test]
fn no_circle_of_imports() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut left: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in sources(&src) {
        let below = path.strip_prefix(&src).expect("below src").with_extension("");
        let name = below.iter().next().expect("a name").to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(text.lines().count() <= LINES_MAX, "{}: more than {LINES_MAX} lines", path.display());
        let used = text.lines().filter_map(|line| line.trim_start().strip_prefix("use crate::"));
        let first =
            used.map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("").to_string());
        left.entry(name.clone()).or_default().extend(first.filter(|module| *module != name));
    }
    left.remove("lib");
    assert!(left.len() > 10, "{} modules", left.len());
    while !left.is_empty() {
        let free = |used: &BTreeSet<String>| used.iter().all(|module| !left.contains_key(module));
        let floor: Vec<String> = left.iter().filter(|(_, used)| free(used)).map(|(name, _)| name.clone()).collect();
        assert!(!floor.is_empty(), "a circle among {:?}", left.keys());
        floor.iter().for_each(|name| drop(left.remove(name)));
    }
}

//! Modules of the crate form floors: no circle of `use crate::`.

use std::collections::BTreeMap;
use std::path::Path;

/// For each module the modules it imports.
fn imports() -> BTreeMap<String, Vec<String>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut imports = BTreeMap::new();
    for file in std::fs::read_dir(folder).expect("the sources") {
        let path = file.expect("a file").path();
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).expect("text");
        let used = text.lines().filter_map(|line| line.trim_start().strip_prefix("use crate::"));
        let modules =
            used.map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("").into());
        imports.insert(name, modules.collect());
    }
    imports
}

#[test]
fn no_circle_of_imports() {
    let mut left = imports();
    assert!(left.len() > 10, "{} modules", left.len());
    // Modules that import none of those left are taken away, floor by floor, until none is left.
    while !left.is_empty() {
        let floor: Vec<String> = left
            .iter()
            .filter(|(_, used)| used.iter().all(|module| !left.contains_key(module)))
            .map(|(name, _)| name.clone())
            .collect();
        assert!(!floor.is_empty(), "a circle among {:?}", left.keys());
        floor.iter().for_each(|name| drop(left.remove(name)));
    }
}

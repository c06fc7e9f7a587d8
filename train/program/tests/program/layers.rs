//! The rules of imports that the compiler does not hold: within a crate they never go in a circle, and papers are named
//! by their own crates alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const PAPERS: [&str; 3] = ["taylormode", "sparsedyn", "flux4d"];

/// Source folders that name no paper: papers are `models`, `train/pipelines`, `configs` and `tests/lab`. Comments of
/// `gs-burn`, `datasets/driving`, `datasets/multiview` and `datasets/worlds` cite their equations.
const NO_PAPERS: [&str; 6] =
    ["datasets/base/src", "datasets/splats/src", "datasets/src", "gs-kernels/src", "train/program/src", "train/src"];

/// Source folders in which no circle is allowed. Twins of a kernel are one idea in several files, so `gs-kernels` is
/// not one of them.
const NO_CIRCLES: [&str; 12] = [
    "datasets/base/src",
    "datasets/src",
    "datasets/multiview/src",
    "datasets/driving/src",
    "datasets/worlds/src",
    "models/src",
    "gs-burn/src",
    "datasets/splats/src",
    "train/src",
    "train/pipelines/src",
    "train/program/src",
    "tests/lab/src",
];

/// A module's own file may name the modules inside it, as a table of contents does.
#[test]
fn no_imports_go_in_circles() {
    for folder in NO_CIRCLES {
        let modules = modules(folder);
        let mut arrows = BTreeSet::new();
        for (name, text) in &modules {
            let tested = text.split("#[cfg(test)]").next().unwrap_or(text);
            let inside = format!("{name}::");
            let used = imports(&modules, name, tested).into_iter().filter(|to| to != name && !to.starts_with(&inside));
            arrows.extend(used.map(|to| (name.clone(), to)));
        }
        // What nothing leads to, or what leads nowhere, is in no circle; what is left when all such files are gone, is.
        loop {
            let before = arrows.len();
            let (from, to): (BTreeSet<String>, BTreeSet<String>) = arrows.iter().cloned().unzip();
            arrows.retain(|(a, b)| to.contains(a) && from.contains(b));
            if arrows.len() == before {
                break;
            }
        }
        assert!(arrows.is_empty(), "{folder}: {arrows:#?}");
    }
}

#[test]
fn only_their_crates_name_papers() {
    for path in NO_PAPERS.iter().flat_map(|folder| files(&root(folder))) {
        for (number, line) in fs::read_to_string(&path).expect("text").lines().enumerate() {
            let named = PAPERS.iter().find(|paper| line.to_lowercase().contains(*paper));
            assert!(named.is_none(), "{}:{}: {line}", path.display(), number + 1);
        }
    }
}

fn root(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// The Rust files of a folder by module path (`fit::density::mcmc`), without comments.
fn modules(folder: &str) -> BTreeMap<String, String> {
    let root = root(folder);
    let sources = files(&root).into_iter().filter(|path| path.extension().is_some_and(|end| end == "rs"));
    let named = sources.map(|path| {
        let text = fs::read_to_string(&path).expect("text");
        let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        let inner = path.strip_prefix(&root).expect("inside").with_extension("");
        let names: Vec<_> = inner.iter().map(|part| part.to_string_lossy()).filter(|part| part != "mod").collect();
        (names.join("::"), code.join("\n"))
    });
    named.collect()
}

/// The modules that a file's paths lead to, through re-exports.
fn imports(modules: &BTreeMap<String, String>, name: &str, text: &str) -> BTreeSet<String> {
    let starts = ["crate::", "super::", "use "].iter().flat_map(|start| text.match_indices(start));
    let found = starts.flat_map(|(at, start)| paths(&text[at + if start == "use " { 4 } else { 0 }..]));
    found.filter_map(|path| leads_to(modules, &absolute(name, &path)?, 0)).collect()
}

/// The paths that a text begins with: `a::{b, c::{d}}` begins with `a::b` and `a::c::d`.
fn paths(text: &str) -> Vec<String> {
    let text = text.trim_start();
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(text.len());
    let (head, rest) = text.split_at(end);
    if !(head.ends_with("::") && rest.starts_with('{')) {
        return vec![head.to_string()];
    }
    let mut depth = 0;
    let mut deeper = |c: char| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth
    };
    let inner = &rest[1..rest.find(|c| deeper(c) == 0).unwrap_or(rest.len())];
    let mut depth = 0;
    let parts = inner.split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth == 0 && c == ','
    });
    parts.flat_map(paths).map(|path| format!("{head}{path}")).collect()
}

/// A path of the module `name` from the crate's root; `None` where it leads out of the crate.
fn absolute(name: &str, path: &str) -> Option<Vec<String>> {
    let mut here: Vec<String> = name.split("::").filter(|part| *part != "lib").map(String::from).collect();
    let mut parts = path.split("::").peekable();
    match *parts.peek()? {
        "crate" => here.clear(),
        "super" | "self" => {}
        _ => return Some([here, parts.map(String::from).collect()].concat()),
    }
    for part in parts {
        match part {
            "crate" | "self" => {}
            "super" => drop(here.pop()),
            part => here.push(part.into()),
        }
    }
    Some(here)
}

/// The module that has the thing at a path, where the longest known module does not re-export it from another.
fn leads_to(modules: &BTreeMap<String, String>, path: &[String], depth: usize) -> Option<String> {
    let (length, name) =
        (1..=path.len()).rev().map(|n| (n, path[..n].join("::"))).find(|(_, m)| modules.contains_key(m))?;
    let Some(thing) = path.get(length).filter(|_| depth < 4) else { return Some(name) };
    let exported = modules[&name].match_indices("pub use ").flat_map(|(at, _)| paths(&modules[&name][at + 8..]));
    let exporting = exported.filter(|path| path.rsplit("::").next() == Some(thing));
    let further = exporting.filter_map(|path| leads_to(modules, &absolute(&name, &path)?, depth + 1));
    Some(further.into_iter().next().unwrap_or(name))
}

/// The reader of paths understands what is written here.
#[test]
fn paths_are_read() {
    assert_eq!(paths("a::{b, c::{d, e}, self};"), ["a::b", "a::c::d", "a::c::e", "a::self"]);
    let of = |texts: &[(&str, &str)]| texts.iter().map(|(name, text)| (name.to_string(), text.to_string())).collect();
    let modules: BTreeMap<String, String> = of(&[
        ("a", "pub use b::Thing;"),
        ("a::b", ""),
        ("c", "use crate::a::Thing;\nfn f() { crate::d::e() }"),
        ("d", ""),
    ]);
    let found = imports(&modules, "c", &modules["c"]);
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["a::b", "d"]);
}

//! The size of the tree: source lines of each crate and items of each large trait.
//!
//! Raise a number only in a commit that says for what; lower it when code goes.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a crate, and its most lines of source: without tests, and without crates inside it.
const SOURCE_LINES: [(&str, usize); 15] = [
    ("configs", 101),
    ("datasets", 12_570),
    ("datasets/base", 1_150),
    ("datasets/driving", 6_645),
    ("datasets/multiview", 4_745),
    ("datasets/splats", 4_300),
    ("datasets/worlds", 5_195),
    ("gs-burn", 6_660),
    ("gs-kernels", 14_455),
    ("models", 12_670),
    ("tests/lab", 6_170),
    ("tests/shaders", 1_870),
    ("train", 11_220),
    ("train/pipelines", 13_370),
    ("train/program", 9_015),
];

/// Lines of tests in all crates.
const TEST_LINES: usize = 42_650;

/// The file of a trait, its name and its most items.
const TRAIT_ITEMS: [(&str, &str, usize); 4] = [
    ("train/src/fit/method.rs", "Method", 14),
    ("train/src/fit/intake.rs", "Intake", 10),
    ("train/pipelines/src/lib.rs", "Pipeline", 9),
    ("models/src/scene.rs", "DynamicScene", 7),
];

/// Most columns of a comment, as of code in `rustfmt.toml`.
const COLUMNS: usize = 120;

#[test]
fn crates_stay_within_their_lines() {
    let root = root();
    let counted = SOURCE_LINES.map(|(folder, most)| (folder, most, lines(&root.join(folder)).0));
    let over: Vec<_> = counted.iter().filter(|(_, most, found)| found > most).collect();
    assert!(over.is_empty(), "folder, most lines, lines found: {over:?}");
    let tests: usize = SOURCE_LINES.iter().map(|(folder, _)| lines(&root.join(folder)).1).sum();
    let tests = tests + lines(&root.join("tests")).1;
    assert!(tests <= TEST_LINES, "{tests} lines of tests, of at most {TEST_LINES}");
}

#[test]
fn traits_stay_within_their_items() {
    for (file, name, most) in TRAIT_ITEMS {
        let text = fs::read_to_string(root().join(file)).expect("text");
        let start = text.find(&format!("pub trait {name}")).expect("the trait");
        let body = text[start..].split("\n}").next().unwrap_or_default();
        let items = ["    fn ", "    const ", "    type "];
        let found = body.lines().filter(|line| items.iter().any(|item| line.starts_with(item))).count();
        assert!((1..=most).contains(&found), "{name} has {found} items, of at most {most}");
    }
}

/// Rows of tables cannot be wrapped.
#[test]
fn comments_are_short() {
    let is_long = |line: &&str| {
        let text = line.trim_start();
        line.chars().count() > COLUMNS && text.starts_with("//") && !text.contains('|')
    };
    let long = sources(&root()).into_iter().flat_map(|path| {
        let text = fs::read_to_string(&path).expect("text");
        text.lines().filter(is_long).map(|line| format!("{}: {line}", path.display())).collect::<Vec<_>>()
    });
    let long: Vec<String> = long.collect();
    assert!(long.is_empty(), "{} comments of more than {COLUMNS} columns: {long:#?}", long.len());
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The Rust files under a folder, without those of a `target` folder and of crates inside it.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let inside = entries.flat_map(|path| match path.is_dir() {
        true if path.ends_with("target") || path.ends_with(".git") => Vec::new(),
        true => sources(&path),
        false => vec![path],
    });
    inside.filter(|path| path.extension().is_some_and(|end| end == "rs")).collect()
}

/// Lines of source and of tests under a crate's folder.
fn lines(krate: &Path) -> (usize, usize) {
    let is_own =
        |path: &PathBuf| path.ancestors().skip(1).find(|folder| folder.join("Cargo.toml").is_file()) == Some(krate);
    sources(krate).into_iter().filter(is_own).fold((0, 0), |(source, tests), path| {
        let text = fs::read_to_string(&path).expect("text");
        let all = text.lines().count();
        let inner = path.strip_prefix(krate).expect("inside");
        let is_test = inner.iter().any(|part| ["tests", "examples", "tests.rs"].iter().any(|name| part == *name));
        let tested = if is_test || krate.ends_with("tests") { all } else { inline_tests(&text) };
        (source + all - tested, tests + tested)
    })
}

/// Lines of the modules that are compiled for tests alone.
fn inline_tests(text: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let starts = (1..lines.len()).filter(|i| lines[i - 1].trim() == "#[cfg(test)]" && lines[*i].ends_with(" {"));
    let modules = starts.filter(|i| lines[*i].trim_start().trim_start_matches("pub ").starts_with("mod "));
    modules.map(|i| lines[i..].iter().take_while(|line| !is_end(line, lines[i])).count() + 2).sum()
}

/// Whether a line ends the block that `start` begins.
fn is_end(line: &str, start: &str) -> bool {
    let indent = start.len() - start.trim_start().len();
    line.trim() == "}" && line.len() == indent + 1
}

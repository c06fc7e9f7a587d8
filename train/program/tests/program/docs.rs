//! The Markdown of the workspace: listings equal the code, links lead somewhere, and pages stay short.

use std::fs;
use std::path::{Path, PathBuf};

/// Set, the test writes the listings in place of comparing them.
const WRITE: &str = "GSBURN_WRITE_DOCS";

const COMMAND: &str = "GSBURN_WRITE_DOCS=1 cargo test --release -p gsburn --test program docs::";

/// Most bytes of all pages: one evening of reading.
const PAGES_MAX: usize = 196_000;

/// Most bytes of the README and of a page of a method.
const PAGE_MAX: usize = 9_000;

#[test]
fn listings_of_extend_equal_the_files_that_they_name() {
    let path = root().join("docs/extend.md");
    let page = fs::read_to_string(&path).expect("a page");
    let written = with_listings(&page);
    if std::env::var_os(WRITE).is_some() {
        fs::write(&path, &written).expect("written");
    } else {
        assert_eq!(written, page, "docs/extend.md shows other code than the files; write it anew with\n{COMMAND}");
    }
    assert!(page.contains("<!-- item train/pipelines/src/still.rs"), "the page shows the example");
}

/// The page with each listing below a line `<!-- item FILE `START` -->` taken from that file.
fn with_listings(page: &str) -> String {
    let (mut written, mut lines) = (String::new(), page.lines());
    while let Some(line) = lines.next() {
        written += &format!("{line}\n");
        let Some((file, start)) = line.strip_prefix("<!-- item ").and_then(|rest| rest.split_once(" `")) else {
            continue;
        };
        let start = start.strip_suffix("` -->").expect("the mark ends with `START` -->");
        let source = fs::read_to_string(root().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        let fence = lines.next().expect("a listing follows its mark");
        lines.by_ref().find(|line| *line == "```").expect("a listing ends");
        written += &format!("{fence}\n{}\n```\n", item(&source, start).unwrap_or_else(|| panic!("{file}: {start}")));
    }
    written
}

/// The item of a file whose first line begins with `start`, with its doc comment and attributes, at the margin.
fn item(source: &str, start: &str) -> Option<String> {
    let lines: Vec<&str> = source.lines().collect();
    let head = lines.iter().position(|line| line.trim_start().starts_with(start))?;
    let indent = &lines[head][..lines[head].len() - lines[head].trim_start().len()];
    let is_about = |line: &&&str| ["///", "#["].iter().any(|mark| line.trim_start().starts_with(mark));
    let first = head - lines[..head].iter().rev().take_while(is_about).count();
    let length = lines[head..].iter().position(|line| *line == format!("{indent}}}"))?;
    let at_margin = lines[first..=head + length].iter().map(|line| line.strip_prefix(indent).unwrap_or(line));
    Some(at_margin.collect::<Vec<_>>().join("\n"))
}

#[test]
fn links_lead_to_files_and_headings() {
    for (path, page) in pages() {
        for target in links(&page) {
            let (file, heading) = target.split_once('#').unwrap_or((&target, ""));
            let linked = if file.is_empty() { path.clone() } else { path.parent().expect("a folder").join(file) };
            assert!(linked.exists(), "{}: {target} leads nowhere", path.display());
            if !heading.is_empty() {
                let text = fs::read_to_string(&linked).expect("a page");
                assert!(anchors(&text).any(|anchor| anchor == heading), "{}: no heading {target}", path.display());
            }
        }
    }
}

#[test]
fn pages_stay_short() {
    let bytes = |page: &(PathBuf, String)| page.1.len();
    let all = pages();
    let total: usize = all.iter().map(bytes).sum();
    assert!(total <= PAGES_MAX, "{total} bytes of Markdown, at most {PAGES_MAX}");
    let bounded = |path: &Path| path == root().join("README.md") || path.starts_with(root().join("docs/methods"));
    for page in all.iter().filter(|(path, _)| bounded(path)) {
        assert!(bytes(page) <= PAGE_MAX, "{}: {} bytes, at most {PAGE_MAX}", page.0.display(), bytes(page));
    }
}

/// Relative targets of a page's links and pictures, code blocks left out.
fn links(page: &str) -> Vec<String> {
    let text: String = page.split("```").step_by(2).collect();
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    let relative = targets.map(|(target, _)| target).filter(|target| !target.contains("://"));
    relative.map(str::to_string).collect()
}

/// Anchors of a page's headings, as GitHub makes them.
fn anchors(page: &str) -> impl Iterator<Item = String> {
    let headings = page.lines().filter_map(|line| line.strip_prefix('#'));
    headings.map(|heading| {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    })
}

/// Every page of the workspace with its text: at the top, in the docs and in the crates.
fn pages() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root()];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("read").path()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                let is_crate = folder != root() || name == "docs" || path.join("Cargo.toml").exists();
                folders.extend((is_crate && !name.starts_with('.') && name != "target").then_some(path));
            } else if name.ends_with(".md") {
                let text = fs::read_to_string(&path).expect("text");
                found.push((path, text));
            }
        }
    }
    found
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

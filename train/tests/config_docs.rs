//! docs/config.md is made from the doc comments of the configuration's structs and from the pipelines' defaults.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use gs_train::config::tables::keys;
use gs_train::pipelines::PIPELINES;
use toml::{Table, Value};

/// Set, the test writes the page in place of comparing it.
const WRITE: &str = "GSBURN_WRITE_DOCS";

const COMMAND: &str = "GSBURN_WRITE_DOCS=1 cargo test --release -p gs-train --test config_docs";

#[test]
fn the_page_is_what_the_code_says() {
    let path = root("../docs/config.md");
    let page = page();
    if std::env::var_os(WRITE).is_some() {
        fs::write(&path, &page).expect("written");
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(written == page, "docs/config.md is not what the code says; write it anew with\n{COMMAND}");
}

#[test]
fn every_key_is_on_the_page() {
    let page = page();
    for pipeline in &PIPELINES {
        let defaults = pipeline.defaults();
        for key in keys(&defaults).iter().filter(|key| !defaults.get(key.as_str()).is_some_and(Value::is_table)) {
            assert!(page.contains(&format!("| `{key}` |")), "{key} of {}", pipeline.name());
        }
    }
}

/// A struct or enum of the configuration: what its doc comment says, and its fields or variants in their order.
#[derive(Debug, Clone, Default)]
struct Item {
    about: String,
    /// How serde writes the variants of an enum: "kebab-case", "lowercase".
    rename: Option<String>,
    parts: Vec<Part>,
}

#[derive(Debug, Clone, Default)]
struct Part {
    name: String,
    /// Type of a field; empty for a variant.
    kind: String,
    about: String,
}

type Items = BTreeMap<String, Item>;

/// A section with what is said of its keys, and the items that their types are among.
struct Section<'a> {
    item: &'a Item,
    items: &'a Items,
}

fn page() -> String {
    let defaults: Vec<(&str, Table)> =
        PIPELINES.iter().map(|pipeline| (pipeline.name(), pipeline.defaults())).collect();
    let shared: Items = sources(&root("src/config")).iter().flat_map(|text| items(text)).collect();
    let own: Vec<Items> = sources(&root("src/pipelines")).iter().map(|text| items(text)).collect();
    let own: Vec<&Items> = own.iter().filter(|items| items.contains_key("Sections")).collect();

    let mut page = format!(
        "<!-- Made from the doc comments of train/src/config and train/src/pipelines by:\n     {COMMAND} -->\n\n# Configuration\n\n\
         A run's `config.toml` has the keys of its pipeline, and `--set section.key=value` changes one of them. Pipelines: {}.\n\
         Where their defaults differ, the pipelines are named with theirs. Recipes change some of these values: `gsburn recipes` lists them.\n",
        list(defaults.iter().map(|(name, _)| *name))
    );
    let config = &shared["Config"];
    heading(&mut page, "All runs", &[], &defaults, "");
    let scalars = config.parts.iter().filter(|part| !shared.contains_key(&part.kind));
    rows(&mut page, scalars, &Section { item: config, items: &shared }, "", &defaults);
    let mut written = BTreeSet::new();
    let sections = config.parts.iter().filter(|part| shared.contains_key(&part.kind)).map(|part| (part, &shared));
    let more = own.iter().flat_map(|items| items["Sections"].parts.iter().map(|part| (part, *items)));
    for (part, items) in sections.chain(more) {
        assert!(written.insert(part.name.clone()), "two sections are called {}", part.name);
        let item = &items[&part.kind];
        let with: Vec<&str> =
            defaults.iter().filter(|(_, table)| table.contains_key(&part.name)).map(|(n, _)| *n).collect();
        heading(&mut page, &format!("`[{}]`", part.name), &with, &defaults, &part.about);
        rows(&mut page, item.parts.iter(), &Section { item, items }, &part.name, &defaults);
    }
    page
}

/// The heading of a section, the pipelines that have it where not all do, and the head of its table.
fn heading(page: &mut String, title: &str, with: &[&str], defaults: &[(&str, Table)], about: &str) {
    write!(page, "\n## {title}\n\n{about}").expect("a string");
    if !with.is_empty() && with.len() < defaults.len() {
        write!(page, " Pipeline: {}.", list(with.iter().copied())).expect("a string");
    }
    page.push_str(if about.is_empty() { "" } else { "\n\n" });
    page.push_str("| key | default | meaning |\n|---|---|---|\n");
}

fn rows<'a>(
    page: &mut String,
    parts: impl Iterator<Item = &'a Part>,
    section: &Section,
    prefix: &str,
    defaults: &[(&str, Table)],
) {
    let names: Vec<&String> = section.item.parts.iter().map(|part| &part.name).collect();
    for part in parts {
        assert!(!part.about.is_empty(), "{prefix}.{} says nothing", part.name);
        let values: Vec<(&str, String)> = defaults
            .iter()
            .filter_map(|(name, table)| {
                let table = if prefix.is_empty() { table } else { table.get(prefix)?.as_table()? };
                assert!(
                    prefix.is_empty() || table.keys().all(|key| names.contains(&key)),
                    "a key of {prefix} is unknown"
                );
                Some((*name, shown(table.get(&part.name)?)))
            })
            .collect();
        let separator = if prefix.is_empty() { "" } else { "." };
        let meaning = format!("{}{}", part.about, choices(section.items, &part.kind));
        let default = default_of(&values);
        writeln!(page, "| `{prefix}{separator}{}` | {default} | {} |", part.name, meaning.replace('|', "\\|"))
            .expect("a string");
    }
}

/// A value as a configuration has it; small and large numbers in powers of ten.
fn shown(value: &Value) -> String {
    match value {
        Value::Float(number) => format!("{number:?}"),
        other => other.to_string(),
    }
}

/// The default, and the pipelines that have another one.
fn default_of(values: &[(&str, String)]) -> String {
    let (_, usual) = values.first().expect("a pipeline has the key");
    let others = values.iter().filter(|(_, value)| value != usual);
    let others: String = others.map(|(name, value)| format!("; {name} `{value}`")).collect();
    format!("`{usual}`{others}")
}

/// What an enum's variants mean, by the word that a configuration has for them.
fn choices(items: &Items, kind: &str) -> String {
    let kind = kind.strip_prefix("Vec<").and_then(|kind| kind.strip_suffix('>')).unwrap_or(kind);
    let Some((item, rename)) = items.get(kind).and_then(|item| Some((item, item.rename.clone()?))) else {
        return String::new();
    };
    let word = |name: &str| match rename.as_str() {
        "kebab-case" => kebab(name),
        "lowercase" => name.to_lowercase(),
        other => panic!("variants as {other}"),
    };
    item.parts.iter().map(|part| format!("<br>`{}`: {}", word(&part.name), part.about)).collect()
}

fn kebab(name: &str) -> String {
    let mut word = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            word.push('-');
        }
        word.extend(c.to_lowercase());
    }
    word
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The texts of a folder's Rust files, in the order of their paths.
fn sources(folder: &Path) -> Vec<String> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("read").path()).collect();
    paths.sort();
    let texts = paths.into_iter().flat_map(|path| match path.is_dir() {
        true => sources(&path),
        false => vec![fs::read_to_string(&path).expect("text")],
    });
    texts.collect()
}

/// The public structs with named fields and the public enums of a file. Fields and variants stand on lines of their own.
fn items(text: &str) -> Items {
    let (mut items, mut open) = (Items::new(), None::<(String, Item)>);
    let (mut about, mut rename) = (Vec::new(), None);
    for line in text.lines() {
        let trimmed = line.trim();
        if let Some(said) = trimmed.strip_prefix("///") {
            about.push(said.trim().to_string());
            continue;
        }
        if let Some(attribute) = trimmed.strip_prefix("#[") {
            let found = attribute.split_once("rename_all = \"").and_then(|(_, rest)| rest.split_once('"'));
            rename = found.map(|(name, _)| name.to_string()).or(rename);
            continue;
        }
        let said = plain(&std::mem::take(&mut about).join(" "));
        let head =
            ["pub struct ", "pub enum "].iter().find_map(|start| trimmed.strip_prefix(start)?.strip_suffix(" {"));
        if let Some(name) = head {
            open = Some((name.into(), Item { about: said, rename: rename.take(), parts: Vec::new() }));
        } else if line == "}" {
            items.extend(open.take());
        } else if let Some((_, item)) = &mut open {
            let part = trimmed.trim_end_matches(',').trim_start_matches("pub ");
            let (name, kind) = part.split_once(": ").unwrap_or((part, ""));
            item.parts.push(Part { name: name.into(), kind: kind.into(), about: said });
        }
        rename = None;
    }
    items
}

/// A doc comment without its links.
fn plain(text: &str) -> String {
    let mut words = String::new();
    let mut rest = text;
    while let Some((before, link)) = rest.split_once('[') {
        words.push_str(before);
        let closed = link.split_once(']').filter(|(name, _)| name.starts_with('`'));
        match closed {
            Some((name, after)) => {
                words.push_str(name);
                let target = after.strip_prefix('(').and_then(|after| after.split_once(')'));
                rest = target.map_or(after, |(_, after)| after);
            }
            None => {
                words.push('[');
                rest = link;
            }
        }
    }
    words + rest
}

/// The reader of source lines understands what is written here.
#[test]
fn lines_are_read() {
    let text = "/// A [`Thing`](super::x), from [0, 1].\n#[derive(Debug)]\n#[serde(rename_all = \"kebab-case\")]\npub enum E {\n    \
                /// One.\n    FirstOne,\n}\n\npub struct S {\n    /// Two\n    /// lines.\n    pub field: E,\n}\n";
    let items = items(text);
    assert_eq!(items["E"].about, "A `Thing`, from [0, 1].");
    assert_eq!(choices(&items, "Vec<E>"), "<br>`first-one`: One.");
    let field = &items["S"].parts[0];
    assert_eq!((field.name.as_str(), field.kind.as_str(), field.about.as_str()), ("field", "E", "Two lines."));
}

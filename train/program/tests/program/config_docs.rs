//! docs/config.md is made from the declarations of the configuration's keys and from the pipelines' defaults.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use gs_pipelines::{PIPELINES, flux4d, sparsedyn, still, taylormode};
use gs_train::config::tables::flat;
use gs_train::config::{Config, Declared, Key};
use toml::{Table, Value};

/// Set, the test writes the page in place of comparing it.
const WRITE: &str = "GSBURN_WRITE_DOCS";

const COMMAND: &str = "GSBURN_WRITE_DOCS=1 cargo test --release -p gsburn --test program config_docs::";

#[test]
fn the_page_is_what_the_code_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/config.md");
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
        for (key, _) in flat(&pipeline.defaults()) {
            assert!(page.contains(&format!("| `{key}` |")), "{key} of {}", pipeline.name());
        }
    }
}

/// The sections of all pipelines, each once.
fn sections() -> Vec<Key> {
    let own = [still::Sections::keys(), flux4d::config::Sections::keys(), sparsedyn::Sections::keys()];
    let shared = Config::keys().into_iter().filter(|key| !key.keys.is_empty());
    let sections: Vec<Key> = shared.chain(own.into_iter().flatten()).chain(taylormode::Sections::keys()).collect();
    let names: BTreeSet<&str> = sections.iter().map(|section| section.name).collect();
    assert_eq!(names.len(), sections.len(), "two sections have one name");
    sections
}

fn page() -> String {
    let defaults: Vec<(&str, Table)> =
        PIPELINES.iter().map(|pipeline| (pipeline.name(), pipeline.defaults())).collect();
    let mut page = format!(
        "<!-- Made from the doc comments of train/src/config and train/pipelines/src by:\n     {COMMAND} -->\n\n# Configuration\n\n\
         A run's `config.toml` has the keys of its pipeline, and `--set section.key=value` changes one of them. Pipelines: {}.\n\
         Where their defaults differ, the pipelines are named with theirs. Recipes change some of these values: `gsburn recipes` lists them.\n",
        list(defaults.iter().map(|(name, _)| *name))
    );
    page.push_str("\n## All runs\n\n");
    let values: Vec<Key> = Config::keys().into_iter().filter(|key| key.keys.is_empty()).collect();
    rows(&mut page, &values, "", &defaults);
    for key in sections() {
        section(&mut page, &key, key.name, &defaults);
    }
    page
}

/// A section called `path`, and those in it; `defaults` are the tables around it.
fn section(page: &mut String, key: &Key, path: &str, defaults: &[(&str, Table)]) {
    let own: Vec<(&str, Table)> =
        defaults.iter().filter_map(|(name, table)| Some((*name, table.get(key.name)?.as_table()?.clone()))).collect();
    write!(page, "\n## `[{path}]`\n\n{}", key.about).expect("a string");
    let (with, without): (Vec<&str>, Vec<&str>) =
        PIPELINES.iter().map(|pipeline| pipeline.name()).partition(|name| own.iter().any(|(own, _)| own == name));
    match without.as_slice() {
        [] => {}
        [only] => write!(page, " Not in `{only}`.").expect("a string"),
        _ => write!(page, " Pipeline: {}.", list(with.into_iter())).expect("a string"),
    }
    page.push_str("\n\n");
    let (sections, values): (Vec<Key>, Vec<Key>) = key.keys.iter().cloned().partition(|key| !key.keys.is_empty());
    rows(page, &values, &format!("{path}."), &own);
    for inner in sections {
        section(page, &inner, &format!("{path}.{}", inner.name), &own);
    }
}

/// The table of some keys; `defaults` are the values of the pipelines that have them.
fn rows(page: &mut String, keys: &[Key], prefix: &str, defaults: &[(&str, Table)]) {
    page.push_str("| key | default | meaning |\n|---|---|---|\n");
    for key in keys {
        let values: Vec<(&str, String)> =
            defaults.iter().filter_map(|(name, table)| Some((*name, shown(table.get(key.name)?)))).collect();
        let words: String = key.words.iter().map(|(word, about)| format!("<br>`{word}`: {about}")).collect();
        let meaning = format!("{}{words}", key.about).replace('|', "\\|");
        writeln!(page, "| `{prefix}{}` | {} | {meaning} |", key.name, default_of(&values)).expect("a string");
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

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

//! The configuration files of the repository: all valid, and the written-out defaults are the defaults.

use std::path::{Path, PathBuf};

use gs_train::commands::demo::RECIPE;
use gs_train::experiment::Config;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/static")
}

#[test]
fn every_file_is_valid() {
    let mut count = 0;
    for entry in std::fs::read_dir(folder()).expect("configs/static").flatten() {
        Config::read(&entry.path()).unwrap_or_else(|error| panic!("{error}"));
        count += 1;
    }
    assert!(count >= 5);
}

#[test]
fn base_is_the_defaults_with_every_key() {
    let path = folder().join("base.toml");
    assert_eq!(Config::read(&path).expect("valid"), Config::default());
    let text = std::fs::read_to_string(&path).expect("read");
    let written: toml::Table = text.parse().expect("TOML");
    let all: toml::Table = Config::default().to_toml().parse().expect("TOML");
    for (section, value) in &all {
        let keys = |value: &toml::Value| value.as_table().map(|table| table.keys().cloned().collect::<Vec<_>>());
        let mut expected = keys(value);
        let mut found = written.get(section).and_then(keys);
        expected.iter_mut().chain(&mut found).for_each(|keys| keys.sort());
        assert_eq!(expected, found, "[{section}] of base.toml");
    }
}

#[test]
fn the_demo_is_its_file() {
    let file = Config::read(&folder().join("demo.toml")).expect("valid");
    assert_eq!(Config::resolve(None, &RECIPE.map(String::from)).expect("valid"), file);
}

//! The configuration files of the repository: all valid, and the written-out defaults are the defaults.

use std::path::{Path, PathBuf};

use gs_train::commands::demo::{RECIPE, STILL_RECIPE};
use gs_train::experiment::Config;

/// Sections that only moving scenes have; configs/taylormode/base.toml writes them out.
const MOVING: [&str; 3] = ["motion", "blur", "prior"];

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs").join(name)
}

#[test]
fn every_file_is_valid() {
    for (name, least) in [("static", 5), ("taylormode", 6), ("taylormode/ablations", 9)] {
        let mut count = 0;
        for entry in std::fs::read_dir(folder(name)).expect("a folder of configurations").flatten() {
            if entry.path().is_file() {
                Config::read(&entry.path()).unwrap_or_else(|error| panic!("{error}"));
                count += 1;
            }
        }
        assert!(count >= least, "{name}: {count}");
    }
}

#[test]
fn base_is_the_defaults_with_every_key() {
    let path = folder("static").join("base.toml");
    assert_eq!(Config::read(&path).expect("valid"), Config::default());
    let text = std::fs::read_to_string(&path).expect("read");
    let written: toml::Table = text.parse().expect("TOML");
    let all: toml::Table = Config::default().to_toml().parse().expect("TOML");
    for (section, value) in all.iter().filter(|(section, _)| !MOVING.contains(&section.as_str())) {
        let keys = |value: &toml::Value| value.as_table().map(|table| table.keys().cloned().collect::<Vec<_>>());
        let mut expected = keys(value);
        let mut found = written.get(section).and_then(keys);
        expected.iter_mut().chain(&mut found).for_each(|keys| keys.sort());
        assert_eq!(expected, found, "[{section}] of base.toml");
    }
}

#[test]
fn the_base_of_moving_scenes_names_every_key_of_theirs() {
    let path = folder("taylormode").join("base.toml");
    let written: toml::Table = std::fs::read_to_string(&path).expect("read").parse().expect("TOML");
    let all: toml::Table = Config::default().to_toml().parse().expect("TOML");
    for section in MOVING {
        let keys = |table: &toml::Table| -> Vec<String> {
            let mut keys: Vec<String> = table[section].as_table().expect("a section").keys().cloned().collect();
            keys.sort();
            keys
        };
        assert_eq!(keys(&all), keys(&written), "[{section}] of configs/taylormode/base.toml");
    }
}

#[test]
fn the_demos_are_their_files() {
    let resolve = |recipe: &[&str]| {
        Config::resolve(None, &recipe.iter().map(|text| text.to_string()).collect::<Vec<_>>()).expect("valid")
    };
    let still = Config::read(&folder("static").join("demo.toml")).expect("valid");
    assert_eq!(resolve(&STILL_RECIPE), still);
    let moving = Config::read(&folder("taylormode").join("demo.toml")).expect("valid");
    assert_eq!(resolve(&RECIPE), moving);
}

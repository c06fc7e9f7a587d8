//! The recipes: all valid, the files of the repository, and a base recipe is its pipeline alone.

use std::path::{Path, PathBuf};

use gs_pipelines::{PIPELINES, Resolved, Sources, find, resolve, resolve_overrides};
use gs_train::config::tables;
use toml::Table;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(name)
}

fn of_file(name: &str) -> Resolved {
    let path = file(name);
    resolve(Sources { file: Some(&path), ..Sources::default() }).unwrap_or_else(|error| panic!("{error}"))
}

fn of_recipe(name: &str) -> Resolved {
    resolve(Sources { recipe: Some(name), ..Sources::default() }).unwrap_or_else(|error| panic!("{error}"))
}

fn sorted(table: &Table) -> Vec<String> {
    let mut keys = tables::keys(table);
    keys.sort();
    keys
}

#[test]
fn every_recipe_is_its_file() {
    for recipe in &gs_recipes::RECIPES {
        let (compiled, read) = (of_recipe(recipe.name), of_file(&format!("{}.toml", recipe.name)));
        assert_eq!(compiled.text, read.text, "{}", recipe.name);
        assert!(recipe.name.starts_with(compiled.pipeline.name()), "{}: {}", recipe.name, compiled.pipeline.name());
    }
    assert!(gs_recipes::RECIPES.len() >= 20);
}

/// Three ways to ask for the same.
#[test]
fn a_pipeline_alone_is_its_base_recipe() {
    let mut based = 0;
    for pipeline in &PIPELINES {
        let name = pipeline.name();
        let alone = resolve_overrides(&[format!("pipeline={name}")]).expect("valid");
        assert_eq!(sorted(&alone.config), sorted(&pipeline.defaults()), "{name}");
        // A pipeline without recipes is its defaults.
        if gs_recipes::find(&format!("{name}/base")).is_none() {
            continue;
        }
        assert_eq!(alone.text, of_recipe(&format!("{name}/base")).text);
        assert_eq!(alone.text, of_file(&format!("{name}/base.toml")).text);
        assert_eq!(alone.config, pipeline.defaults(), "{name}");
        based += 1;
    }
    assert!(based >= 2, "{based} pipelines have a base recipe");
    assert_eq!(resolve_overrides(&[]).expect("valid").pipeline.name(), "static");
}

/// The static base is the code's defaults.
#[test]
fn the_static_base_is_the_defaults() {
    assert_eq!(of_file("static/base.toml").config, find("static").expect("a pipeline").defaults());
}

/// `gsburn demo` trains by recipes that are compiled in.
#[test]
fn the_demos_are_recipes() {
    assert_eq!(of_recipe("static/demo").pipeline.name(), "static");
    let moving = of_recipe("taylormode/demo");
    assert_eq!(moving.pipeline.name(), "taylormode");
    assert!(moving.config["steps"].as_integer() < of_recipe("taylormode/base").config["steps"].as_integer());
}

//! Damaged configurations and checkpoints: nothing panics, and what is not read is refused in a sentence of one line.
//!
//! Each reader gets [`SHORT`] cases with all other tests. The long run is asked for, with as many cases as wanted:
//!
//! ```text
//! GS_FUZZ_CASES=100000 cargo test --release -p gs-train --test fuzz -- --ignored
//! ```

mod common;
#[path = "../../tests/src/mutate.rs"]
mod mutate;

use std::fs;
use std::path::Path;

use gs_train::pipelines::fit::read_model;
use gs_train::pipelines::still::Still;
use gs_train::pipelines::{Sources, of_checkpoint, resolve};
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::folder::RunFolder;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestCaseError, TestRunner};

use crate::mutate::{Step, damaged};

/// Cases for each reader with all other tests.
const SHORT: u32 = 256;

/// Cases for each reader when no number is given.
const LONG: u32 = 20_000;

/// The variable with the number of cases of the long run.
const CASES: &str = "GS_FUZZ_CASES";

fn long() -> u32 {
    std::env::var(CASES).ok().map_or(LONG, |text| text.parse().expect("a number of cases"))
}

/// Damages `seeds` and gives each to `read`, which returns the sentence of a refusal.
fn fuzz(cases: u32, seeds: &[Vec<u8>], read: impl Fn(&[u8]) -> Option<String>) {
    let step = (any::<u8>(), any::<u32>(), any::<u64>());
    let strategy = (0..seeds.len(), proptest::collection::vec(step, 1..6));
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    let outcome = runner.run(&strategy, |(seed, steps): (usize, Vec<Step>)| {
        let sentence = read(&damaged(&seeds[seed], &steps)).unwrap_or_default();
        if sentence.contains('\n') {
            return Err(TestCaseError::fail(format!("more than one line: {sentence}")));
        }
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

fn configurations(cases: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("config.toml");
    // Every key of each pipeline, and a recipe as people write it.
    let seeds: Vec<Vec<u8>> = ["pipeline=static", "pipeline=taylormode"]
        .map(|pipeline| common::resolved(10, &[pipeline]).text.into_bytes())
        .into_iter()
        .chain(gs_recipes::find("taylormode/base").map(|recipe| recipe.text.as_bytes().to_vec()))
        .collect();
    fuzz(cases, &seeds, |bytes| {
        fs::write(&file, bytes).expect("written");
        let resolved = resolve(Sources { file: Some(&file), ..Sources::default() });
        resolved.err().map(|error| gs_train::logging::one_sentence(&error.into()))
    });
}

/// A checkpoint of a run on the tiny scene.
fn checkpoint(folder: &Path, steps: usize) -> Vec<u8> {
    let config = common::config(steps, &["init.random_points=20"]);
    let job = common::job(&common::tiny_scene(folder), &folder.join("run"), &config);
    common::finish(&job);
    fs::read(RunFolder::at(folder.join("run")).checkpoint(steps)).expect("read")
}

fn checkpoints(cases: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let device = common::device();
    let file = folder.path().join("x.safetensors");
    fuzz(cases, &[checkpoint(folder.path(), 3)], |bytes| {
        fs::write(&file, bytes).expect("written");
        let read = || -> anyhow::Result<()> {
            let checkpoint = Checkpoint::load(&file)?;
            of_checkpoint(&checkpoint)?;
            read_model::<Still>(&checkpoint, &device)?;
            checkpoint.whole()?;
            Ok(())
        };
        read().err().map(|error| gs_train::logging::one_sentence(&error))
    });
}

#[test]
fn damaged_configurations_are_refused() {
    configurations(SHORT);
}

#[test]
fn damaged_checkpoints_are_refused() {
    checkpoints(SHORT);
}

#[test]
#[ignore = "long: GS_FUZZ_CASES cases"]
fn damaged_configurations_are_refused_long() {
    configurations(long());
}

#[test]
#[ignore = "long: GS_FUZZ_CASES cases"]
fn damaged_checkpoints_are_refused_long() {
    checkpoints(long());
}

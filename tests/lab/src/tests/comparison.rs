//! A chart says what it leaves out, a report keeps its section, and files of others are left alone.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;
use gs_pipelines::resolve_overrides;
use gs_train::run::folder::RunFolder;
use gs_train::run::lock::Lock;
use gs_train::run::outcome::Contents;
use gs_train::run::watch::Job;
use gs_train::sentence::one_sentence;
use gsburn::commands::train::train_and_report;
use gsburn::report::comparison::gather;

use super::{device, tiny_scene};
use crate::cli::Cli;

/// The laboratory called with these words.
fn gs_lab(words: &[&str]) -> Result<ExitCode> {
    let line = std::iter::once("gs-lab").chain(words.iter().copied());
    crate::call(&Cli::try_parse_from(line).expect("valid arguments").command)
}

/// The one sentence of a call that must fail.
fn fails(words: &[&str]) -> String {
    one_sentence(&gs_lab(words).expect_err("a sentence"))
}

/// Trains three steps, or until it is stopped.
fn train(folder: PathBuf, scene: &Path, stop_at: Option<usize>) {
    let sets = ["steps=3", "eval.ms_ssim=false", "eval.lpips=false", "eval.images=1", "eval.at=[1]"];
    let resolved = resolve_overrides(&sets.map(String::from)).expect("a valid configuration");
    let job = Job {
        dataset: scene.into(),
        config: resolved.config,
        folder: RunFolder::vacant(folder).expect("a new folder"),
        device: device(),
        more_devices: Vec::new(),
        device_name: "test".into(),
        resume: false,
        stop_at,
        quiet: true,
        minutes: None,
        schedule_svg: Some(gsburn::report::schedule_svg),
    };
    train_and_report(resolved.pipeline, &job).expect("the run succeeds");
}

#[test]
fn a_chart_names_what_it_leaves_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = tiny_scene(folder);
    train(folder.join("a"), &scene, None);
    train(folder.join("b"), &scene, None);
    let elsewhere = folder.join("elsewhere");
    fs::create_dir(&elsewhere).expect("made");
    train(folder.join("c"), &tiny_scene(&elsewhere), None);
    train(folder.join("d"), &scene, Some(2));
    fs::write(folder.join("chart.svg"), "an earlier chart").expect("written");

    let paths = ["a", "b", "c", "d", "scene", "nowhere", "chart.svg"];
    let found = gather(&paths.map(|name| folder.join(name))).expect("two are left");
    assert_eq!(found.runs.iter().map(|run| run.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    let warned = |name: &str, why: &str| {
        let start = folder.join(name).display().to_string();
        let found = found.warnings.iter().find(|warning| warning.starts_with(&start));
        assert!(found.is_some_and(|warning| warning.contains(why)), "{name}: {:?}", found);
    };
    warned("c", "the others on");
    warned("d", "after step 1 of 3");
    warned("scene", "no figures yet");
    warned("nowhere", "found nothing");
    assert_eq!(found.warnings.len(), 4, "a file is no run and needs no word");

    let at = |name: &str| folder.join(name).display().to_string();
    let (a, b, c) = (at("a"), at("b"), at("c"));
    // Its own files may be written over.
    for _ in 0..2 {
        gs_lab(&["chart", &a, &b, &c, "--out", &at("all.html"), "--csv", &at("all.csv"), "--report", &a])
            .expect("charted");
        gs_lab(&["chart", &a, "--out", &at("one.svg")]).expect("charted");
    }
    let page = fs::read_to_string(folder.join("all.html")).expect("read");
    assert!(page.contains("Accuracy against cost") && page.contains("trained on"), "{page}");
    let report = || fs::read_to_string(folder.join("a/report.html")).expect("read");
    assert!(report().contains("Accuracy against cost"));
    assert!(fs::read_to_string(folder.join("all.csv")).expect("read").starts_with("run,cap,step"));
    assert!(fs::read_to_string(folder.join("one.md")).expect("read").contains("| a | "));
    // The section is still there after the report is written anew.
    let folder_a = RunFolder::at(folder.join("a"));
    let (config, _) = folder_a.read_config().expect("a run");
    let eval = folder_a.read_eval().expect("figures");
    let contents = Contents { config: config.to_string(), ..Contents::default() };
    gsburn::report::write(&folder_a, &eval, &contents).expect("written");
    assert!(report().contains("Accuracy against cost"));

    fs::create_dir(folder.join("empty")).expect("made");
    assert!(fails(&["chart", &at("empty"), "--out", &at("new.svg")]).contains("cannot read its eval.json"));
    fs::write(folder.join("mine.svg"), "<svg/>").expect("written");
    assert!(fails(&["chart", &a, "--out", &at("mine.svg")]).contains("mine.svg"));
    fs::write(folder.join("empty/report.html"), "<main></main>").expect("written");
    let said = fails(&["chart", &a, "--out", &at("new.svg"), "--report", &at("empty")]);
    assert!(said.contains("report.html") && said.contains("gsburn wrote"), "{said}");
    assert!(!folder.join("new.svg").exists());
    #[cfg(unix)]
    {
        fs::remove_file(folder.join("b/eval.json")).expect("removed");
        std::os::unix::fs::symlink("/dev/zero", folder.join("b/eval.json")).expect("linked");
        assert!(fails(&["chart", &b, "--out", &at("new.svg")]).contains("a device"));
    }
}

/// Experiments refuse a folder of others before they compute, and say who writes one.
#[test]
fn folders_of_experiments_are_their_own_and_have_one_writer() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = tiny_scene(folder);
    let experiments = |out: &Path| {
        let words = ["experiments", "sparsedyn", "--only", "reversal", "--quick", "--out"];
        gs_lab(&[&words[..], &[&out.display().to_string()]].concat())
    };
    let refused = |out: &Path| one_sentence(&experiments(out).expect_err("a sentence"));
    let said = refused(&scene);
    assert!(said.contains("expected an empty folder") && said.contains("in it"), "{said}");
    let out = folder.join("out");
    let held = Lock::of_results(&out).expect("free");
    assert!(refused(&out).contains(&format!("process {} is writing", std::process::id())));
    drop(held);
    assert!(!out.exists());
    fs::create_dir(folder.join("mine")).expect("made");
    fs::write(folder.join("mine/results.json"), "[]").expect("written");
    let said = refused(&folder.join("mine"));
    assert!(said.contains("results.json") && said.contains("gsburn wrote"), "{said}");
    for _ in 0..2 {
        experiments(&out).expect("they run");
    }
    assert!(out.join("stability.html").is_file() && !out.join(".lock").exists());
}

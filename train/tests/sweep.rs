//! Comparisons of runs: a sweep continues where it was cut off, and a chart says what it leaves out.

mod common;

use std::fs;
use std::path::Path;

use gs_train::pipelines::resolve_overrides;
use gs_train::report::comparison::gather;
use gs_train::run::folder::{MetricsLine, RunFolder};
use gs_train::run::outcome::Contents;
use gs_train::run::watch::{Ending, Job};

use common::program::{gsburn, says};

const COMMON: [&str; 4] = ["steps=6", "eval.ms_ssim=false", "eval.lpips=false", "eval.images=1"];

fn sweep() -> Vec<&'static str> {
    let mut args = vec!["sweep", "scene", "--out", "swept", "--over", "density.cap=160,200", "--over", "seed=1"];
    args.extend(COMMON.iter().flat_map(|set| ["--set", set]));
    args
}

#[test]
fn a_sweep_continues_where_it_was_cut_off() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = common::tiny_scene(folder);
    // The first of its runs, cut off after two steps as Ctrl-C would.
    let overrides = COMMON.iter().chain(&["density.cap=160", "seed=1"]).map(|text| text.to_string());
    let config = resolve_overrides(&overrides.collect::<Vec<_>>()).expect("valid").config;
    let first = folder.join("swept/cap-160_seed-1");
    let job = Job { stop_at: Some(2), ..common::job(&scene, &first, &config) };
    assert!(matches!(common::train(&job), Ok(Ending::Interrupted(2))));

    let [table, said] = says(folder, &sweep());
    assert!(said.contains("resuming after step 2") && said.contains("run 2 of 2: cap-200_seed-1"), "{said}");
    assert!(table.contains("cap-160_seed-1") && table.contains("cap-200_seed-1"), "{table}");
    for file in ["chart.svg", "chart.md", "chart.csv", "index.html"] {
        assert!(folder.join("swept").join(file).is_file(), "{file}");
    }
    let page = fs::read_to_string(folder.join("swept/index.html")).expect("read");
    assert!(page.contains("href=\"cap-200_seed-1/report.html\"") && page.contains("gsburn sweep scene"), "{page}");
    let steps: Vec<usize> =
        RunFolder::at(&first).read_metrics(6).expect("metrics").iter().map(MetricsLine::step).collect();
    assert!(steps.windows(2).all(|pair| pair[0] <= pair[1]), "{steps:?}");

    let eval = || fs::metadata(first.join("eval.json")).and_then(|file| file.modified()).expect("a file");
    let before = eval();
    let [_, said] = says(folder, &sweep());
    assert_eq!(said.matches("finished already").count(), 2, "{said}");
    assert_eq!(eval(), before, "a finished run is left alone");

    let mut other = sweep();
    other.extend(["--set", "loss.dssim=0.1"]);
    let refused = gsburn(folder, &other);
    let error = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(1) && error.contains("another configuration"), "{error}");
}

#[test]
fn each_of_several_data_sets_has_a_folder_and_seeds_are_one_curve() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    fs::create_dir(folder.join("other")).expect("made");
    common::tiny_scene(&folder.join("other"));
    let common = COMMON.iter().flat_map(|set| ["--set", set]);
    let sweep = |own: &[&'static str]| -> Vec<&'static str> {
        let args = ["sweep", "--out", "swept", "--over", "seed=1,2", "--set", "density.cap=160"];
        args.into_iter().chain(common.clone()).chain(own.iter().copied()).collect()
    };
    let refused = |own: &[&'static str]| {
        let output = gsburn(folder, &sweep(own));
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(refused(&["scene", "other/scene"]).contains("would have the folder swept/scene"));
    assert!(refused(&["scene", "nowhere"]).contains("nowhere: expected a data set"));
    fs::rename(folder.join("other/scene"), folder.join("door")).expect("renamed");
    let three = ["scene", "door", "--recipe", "static/base,static/base,static/base"];
    assert!(refused(&three).contains("one for each of 2 data sets, found 3"));

    let [tables, said] = says(folder, &sweep(&["scene", "door", "--recipe", "static/base,static/demo"]));
    assert!(said.contains("data set door") && said.matches("run 2 of 2: seed-2").count() == 2, "{said}");
    assert!(tables.contains("2 seeds"), "{tables}");
    let saved = |name: &str| fs::read_to_string(folder.join("swept").join(name)).expect("read");
    assert!(
        saved("door/chart.md").contains("2 seeds") && saved("door/index.html").contains("href=\"seed-2/report.html\"")
    );
    assert!(saved("index.html").contains("href=\"door/seed-2/report.html\""));
    assert!(saved("chart.svg").contains("scene: Whole image") && saved("chart.svg").contains("door: Whole image"));
}

#[test]
fn a_chart_names_what_it_leaves_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let scene = common::tiny_scene(folder);
    let finish = |name: &str, scene: &Path| {
        common::finish(&common::job(scene, &folder.join(name), &common::config(3, &["eval.at=[1]"])));
    };
    finish("a", &scene);
    finish("b", &scene);
    let elsewhere = folder.join("elsewhere");
    fs::create_dir(&elsewhere).expect("made");
    finish("c", &common::tiny_scene(&elsewhere));
    let cut = Job { stop_at: Some(2), ..common::job(&scene, &folder.join("d"), &common::config(3, &["eval.at=[1]"])) };
    common::train(&cut).expect("it runs");
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

    let args = ["chart", "a", "b", "c", "--out", "all.html", "--csv", "all.csv", "--report", "a"];
    let [table, errors] = says(folder, &args);
    assert!(table.contains("CPU s") || !cfg!(target_os = "linux"), "{table}");
    assert!(errors.contains("warning: c: trained on"), "{errors}");
    let report = fs::read_to_string(folder.join("a/report.html")).expect("read");
    assert!(report.contains("Accuracy against cost") && report.contains("gsburn chart a b c"), "{report}");
    assert!(fs::read_to_string(folder.join("all.csv")).expect("read").starts_with("run,cap,step"));
    // The section is still there after the report is written anew.
    let folder_a = RunFolder::at(folder.join("a"));
    let (config, _) = folder_a.read_config().expect("a run");
    let eval = folder_a.read_eval().expect("figures");
    let contents = Contents { config: config.to_string(), ..Contents::default() };
    gs_train::report::write(&folder_a, &eval, &contents).expect("written");
    assert!(fs::read_to_string(folder_a.report()).expect("read").contains("gsburn chart a b c"));
}

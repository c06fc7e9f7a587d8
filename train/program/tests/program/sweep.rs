//! A sweep continues where it was cut off.

use crate::common;

use std::fs;

use gs_pipelines::resolve_overrides;
use gs_train::run::folder::{MetricsLine, RunFolder};
use gs_train::run::watch::{Ending, Job};

use crate::common::program::{gsburn, says};

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
    let saved = |name: &str| fs::read_to_string(folder.join("swept").join(name)).expect("read");
    let (markdown, csv) = (saved("chart.md"), saved("chart.csv"));
    assert!(
        markdown.contains("| cap-200\\_seed-1 | 200 |") && csv.contains("\ncap-200_seed-1,200,"),
        "{markdown}{csv}"
    );
    assert!(saved("chart.svg").contains("best at its cost"));
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
fn each_of_several_data_sets_has_a_folder() {
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
    assert_eq!(tables.matches("\nseed-2").count(), 2, "{tables}");
    for file in ["scene/chart.md", "door/chart.md", "door/chart.svg", "door/seed-2/report.html"] {
        assert!(folder.join("swept").join(file).is_file(), "{file}");
    }
}

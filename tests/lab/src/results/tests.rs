//! Tables equal their data.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::runs::cell;
use super::*;

/// The repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// One sentence for each table that does not equal its data file, or has none, and each data file without a table.
fn faults(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut shown = Vec::new();
    for page in pages(root).expect("pages") {
        let text = fs::read_to_string(&page).expect("a page");
        for name in table::names(&text) {
            let is_equal = || {
                let data = Data::read(root, name)?;
                Ok::<_, anyhow::Error>(table::replaced(&text, name, &data)?.as_ref() == Some(&text))
            };
            match is_equal() {
                Ok(true) => shown.push(name.to_string()),
                Ok(false) => found.push(format!("{name}: another table in {}", page.display())),
                Err(error) => found.push(format!("{name}: {error:#}")),
            }
        }
    }
    for entry in fs::read_dir(root.join(FOLDER)).into_iter().flatten().flatten() {
        let path = entry.path();
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if path.extension().is_some_and(|end| end == "json") && !shown.contains(&name) {
            found.push(format!("{name}: no page shows it"));
        }
    }
    found
}

/// `cargo run --release -p gs-lab -- results NAME` writes a table anew.
#[test]
fn tables_equal_their_data() {
    let faults = faults(&root());
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn a_table_is_written_between_its_marks() {
    let temporary = tempfile::tempdir().expect("a folder");
    let root = temporary.path();
    fs::create_dir_all(root.join("docs/results")).expect("made");
    fs::create_dir_all(root.join(FOLDER)).expect("made");
    let page = root.join("docs/results/a.md");
    let (begin, end) = ("<!-- results speed begin -->\n", "<!-- results speed end -->");
    fs::write(&page, format!("Before.\n\n{begin}{end}\n\nBehind.\n")).expect("written");
    let mut data = json!({
        "title": "Speed", "commit": "abc1234", "command": "gsburn bench", "seeds": [1, 2], "machine": "two cores",
        "superseded": null, "columns": ["a", "b"], "rows": [["x", "1.0"], ["y", "–"]]
    });
    let write = |data: &serde_json::Value| {
        fs::write(path_of(root, "speed"), data.to_string()).expect("written");
    };
    let args = ResultsArgs { names: vec!["speed".into()], out: None, root: root.into(), device: "auto".into() };
    write(&data);
    assert_eq!(faults(root).len(), 2, "an empty table is none, and the data have no page");
    run(&args).expect("written");
    let table =
        "| a | b |\n|---|---|\n| x | 1.0 |\n| y | – |\n\nCommit `abc1234`; command: `gsburn bench`; seeds: 1, 2.\n";
    let text = || fs::read_to_string(&page).expect("a page");
    assert_eq!(text(), format!("Before.\n\n{begin}{table}{end}\n\nBehind.\n"));
    assert!(faults(root).is_empty());

    data["superseded"] = json!("rates (1234567)");
    write(&data);
    assert_eq!(faults(root).len(), 2);
    run(&args).expect("written");
    assert!(text().contains("seeds: 1, 2. Measured with superseded defaults: rates (1234567).\n<!--"), "{}", text());

    let refused = |args: &ResultsArgs| format!("{:#}", run(args).expect_err("a sentence"));
    data["rows"][0] = json!(["x"]);
    write(&data);
    assert!(refused(&args).contains("rows of 2 cells, found one of 1"));
    data["rows"][0] = json!(["x", "a|b"]);
    write(&data);
    assert!(refused(&args).contains("without |"));
    let unknown = ResultsArgs { names: vec!["none".into()], ..args };
    assert!(refused(&unknown).contains("none.json"));
}

#[test]
fn cells_are_means_over_seeds() {
    let (moving, figures) = (json!({"psnr": 2.0}), json!([{"key": "e", "value": 0.5}]));
    let eval = |psnr: f64| json!({"psnr": psnr, "regions": {"moving": moving}, "figures": figures});
    let figure = |key: &str| serde_json::from_value(json!({"key": key, "digits": 1})).expect("a figure");
    let both = [eval(30.0), eval(31.0)];
    assert_eq!(cell(&figure("psnr"), &both), "30.5 (30.0 to 31.0)");
    assert_eq!(cell(&figure("regions.moving.psnr"), &both[..1]), "2.0");
    assert_eq!(cell(&figure("figures.e"), &both[..1]), "0.5");
    assert_eq!(cell(&figure("figures.none"), &both), "–");
}

/// Runs are trained where they are missing, and kept where they are finished.
#[test]
fn runs_fill_the_rows() {
    let temporary = tempfile::tempdir().expect("a folder");
    let root = temporary.path();
    let scene = crate::tests::tiny_scene(root);
    let git = |args: &[&str]| std::process::Command::new("git").args(args).current_dir(root).output();
    let made = git(&["init"])
        .and_then(|_| git(&["-c", "user.name=t", "-c", "user.email=t@t", "commit", "--allow-empty", "-m", "first"]));
    assert!(made.expect("git").status.success());
    let sets = ["steps=2", "density.cap=160", "eval.ms_ssim=false"];
    let file = json!({
        "title": "t", "commit": "", "command": "", "seeds": [1, 2], "machine": "m", "superseded": "x",
        "columns": ["run", "PSNR", "Gaussians"], "rows": [],
        "runs": [{"name": "few", "recipe": null, "data": scene, "set": sets}],
        "figures": [{"key": "psnr", "digits": 2}, {"key": "gaussians", "digits": 0}], "chart": "chart.svg"
    });
    let mut data: Data = serde_json::from_value(file).expect("a data file");
    let out = root.join("runs");
    let mut fill =
        || runs::fill(&mut data, (root, "t"), &out, "auto").map(|done| (done, data.clone())).expect("trained");
    let (done, first) = fill();
    assert!(done && first.superseded.is_none() && !first.commit.is_empty());
    assert!(first.rows[0][0] == "few" && first.rows[0][1].contains(" to "), "{:?}", first.rows);
    assert!(root.join("chart.svg").is_file());
    assert_eq!(fill().1, first, "finished runs are kept");
}

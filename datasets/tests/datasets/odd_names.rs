//! Names that a terminal, a file system or a string cannot hold.

use gs_datasets::{Holdout, LoadOptions, check, load, printable};
use serde_json::json;

use crate::colmap;
use crate::fixtures::{Folder, ring_scene};

/// A title for the terminal's window, a line of its own, and a name that reads backwards.
const EVIL: &str = "a\u{1b}]0;owned\u{7}b\nc\u{202e}gnp\u{85}";

fn options() -> LoadOptions {
    LoadOptions { holdout: Holdout::None, ..LoadOptions::default() }
}

fn is_clean(text: &str) -> bool {
    !text.chars().any(|c| c.is_control() || ('\u{202a}'..='\u{202e}').contains(&c))
}

/// Everything that `load` and `check` say, and the names that files get.
fn said(folder: &Folder) -> Vec<String> {
    let mut all = Vec::new();
    match load(folder.path(), &options()) {
        Ok(scene) => {
            all.extend(scene.warnings.clone());
            all.extend(scene.train.iter().map(|view| view.name.clone()));
            all.extend(scene.train.iter().filter_map(|view| view.camera_id.clone()));
            all.extend(scene.held_out.iter().map(|split| split.name.clone()));
        }
        Err(error) => all.push(error.to_string()),
    }
    let report = check(folder.path(), &options());
    all.extend(report.to_string().lines().map(str::to_string));
    all.extend([report.facts, report.warnings, report.errors].concat());
    all
}

fn assert_clean(what: &str, folder: &Folder) {
    let said = said(folder);
    assert!(said.iter().all(|text| is_clean(text)), "{what}: {said:?}");
    assert!(said.iter().all(|text| !text.starts_with('c')), "no line of its own, {what}: {said:?}");
}

#[test]
fn control_characters_are_escaped() {
    assert_eq!(printable("a photo/ä 写真.png"), "a photo/ä 写真.png");
    assert!(matches!(printable("plain"), std::borrow::Cow::Borrowed(_)));
    assert_eq!(printable("a\u{1b}[31m\nb\u{202e}"), "a\\u{1b}[31m\\u{a}b\\u{202e}");
    assert!(is_clean(&printable(EVIL)));
}

#[cfg(unix)]
#[test]
fn control_characters_of_names_reach_no_message() {
    // Photos that exist, a photo that does not, a broken one, and a pose that is none.
    for broken in 0..4 {
        let (folder, mut top) = ring_scene(3);
        let name = format!("images/{EVIL}.png");
        folder.photo(&name, 32, 24);
        top["frames"][1]["file_path"] = json!(name);
        top["frames"][1]["camera_id"] = json!(EVIL);
        top["frames"][1]["time"] = json!(1.0);
        match broken {
            1 => std::fs::remove_file(folder.file(&name)).expect("removed"),
            2 => folder.write(&name, "no image"),
            3 => top["frames"][1]["transform_matrix"] = json!(EVIL),
            _ => {}
        }
        folder.write_json("transforms.json", &top);
        assert_clean(&format!("broken {broken}"), &folder);
    }
    for key in ["mask_meaning", "depth_kind", "camera_model", "blur_space", "ply_file_path", "fl_x"] {
        let (folder, mut top) = ring_scene(3);
        top[key] = json!(EVIL);
        folder.write_json("transforms.json", &top);
        assert_clean(key, &folder);
    }
    let (folder, mut top) = ring_scene(4);
    top["train_filenames"] = json!(["images/00.png", "images/01.png"]);
    top[format!("{EVIL}_filenames")] = json!(["images/02.png"]);
    folder.write_json("transforms.json", &top);
    assert_clean("split", &folder);

    let (folder, mut top) = ring_scene(3);
    top["ply_file_path"] = json!("points.ply");
    folder.write_json("transforms.json", &top);
    let header = |x: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty {x} x\nproperty float y\nproperty float z\nend_header\n"
        )
    };
    for text in [header("\u{1b}[31m"), header("float") + "\u{1b}[31m 1 2\n"] {
        folder.write("points.ply", text);
        assert_clean("ply", &folder);
    }
    for is_binary in [true, false] {
        let folder = Folder::new();
        let mut model = colmap::example(&folder);
        model.images[1].name = EVIL.replace('\n', "");
        if is_binary {
            model.write_binary(&folder, "sparse/0")
        } else {
            model.write_text(&folder, "sparse/0")
        }
        assert_clean("colmap", &folder);
    }
    let folder = Folder::new();
    folder.write(&format!("{EVIL}.txt"), "");
    assert_clean("a folder of something else", &folder);
    let folder = Folder::new();
    let inner = format!("{EVIL}/images/0.png");
    folder.photo(&inner, 8, 6);
    let error = load(&folder.file(EVIL), &options()).expect_err("no poses").to_string();
    assert!(is_clean(&error), "{error:?}");
    assert!(check(&folder.file(EVIL), &options()).to_string().lines().all(is_clean));
}

#[test]
fn names_that_differ_in_control_characters_stay_apart() {
    let (folder, mut top) = ring_scene(2);
    for (i, name) in ["images/a\u{1}.png", "images/a\u{2}.png"].into_iter().enumerate() {
        folder.photo(name, 32, 24);
        top["frames"][i]["file_path"] = json!(name);
    }
    folder.write_json("transforms.json", &top);
    let scene = load(folder.path(), &options()).expect("loads");
    assert_eq!(crate::fixtures::names(&scene.train), ["images/a_", "images/a__2"]);
}

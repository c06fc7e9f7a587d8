//! Names that a terminal, a file system or a string cannot hold.

use gs_base::printable;
use gs_datasets::{check, load, load_cameras};
use serde_json::json;

use crate::colmap;
use crate::fixtures::{Folder, all, rig, ring, ring_scene};

/// A title for the terminal's window, a line of its own, and a name that reads backwards.
const EVIL: &str = "a\u{1b}]0;owned\u{7}b\nc\u{202e}gnp\u{85}";

fn is_clean(text: &str) -> bool {
    !text.chars().any(|c| c.is_control() || ('\u{202a}'..='\u{202e}').contains(&c))
}

/// Everything that `load` and `check` say, and the names that files get.
fn said(folder: &Folder) -> Vec<String> {
    let mut said = Vec::new();
    match load(folder.path(), &all()) {
        Ok(scene) => {
            said.extend(scene.warnings.clone());
            said.extend(scene.train.iter().map(|view| view.name.clone()));
            said.extend(scene.train.iter().filter_map(|view| view.camera_id.clone()));
            said.extend(scene.held_out.iter().map(|split| split.name.clone()));
        }
        Err(error) => said.push(error.to_string()),
    }
    let report = check(folder.path(), &all());
    said.extend(report.to_string().lines().map(str::to_string));
    said.extend([report.facts, report.warnings, report.errors].concat());
    said
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
    for (write, _) in colmap::ENCODINGS {
        let folder = Folder::new();
        let mut model = colmap::example(&folder);
        model.images[1].name = EVIL.replace('\n', "");
        write(&model, &folder, "sparse/0");
        assert_clean("colmap", &folder);
    }
    let folder = Folder::new();
    folder.write(&format!("{EVIL}.txt"), "");
    assert_clean("a folder of something else", &folder);
    let folder = Folder::new();
    let inner = format!("{EVIL}/images/0.png");
    folder.photo(&inner, 8, 6);
    let error = load(&folder.file(EVIL), &all()).expect_err("no poses").to_string();
    assert!(is_clean(&error), "{error:?}");
    assert!(check(&folder.file(EVIL), &all()).to_string().lines().all(is_clean));
}

#[test]
fn names_that_differ_in_control_characters_stay_apart() {
    let (folder, mut top) = ring_scene(2);
    for (i, name) in ["images/a\u{1}.png", "images/a\u{2}.png"].into_iter().enumerate() {
        folder.photo(name, 32, 24);
        top["frames"][i]["file_path"] = json!(name);
    }
    let scene = folder.scene(&top, &all());
    assert_eq!(crate::fixtures::names(&scene.train), ["images/a_", "images/a__2"]);
}

/// Rendered images are named after views, with something appended.
#[test]
fn a_name_too_long_for_an_output_file_is_refused_when_it_is_loaded() {
    let refused = |folder: &Folder, bytes: usize| {
        let error = load(folder.path(), &all()).expect_err("too long").to_string();
        let report = check(folder.path(), &all());
        for text in [&error, &report.to_string()] {
            assert!(text.contains("at most 215 bytes") && text.contains(&format!("{bytes} bytes")), "{text}");
            assert!(text.len() < 1000 + 2 * folder.path().as_os_str().len(), "{text}");
        }
        assert!(!report.is_ok(), "{report}");
    };
    // A file of 300 bytes cannot exist; of 240 it can, and its rendering cannot.
    for length in [300, 240] {
        let (folder, mut top) = ring_scene(3);
        let name = format!("images/{}.png", "n".repeat(length));
        if length < 255 {
            folder.photo(&name, 32, 24);
        }
        top["frames"][1]["file_path"] = json!(name);
        folder.write_json("transforms.json", &top);
        refused(&folder, length);
        let error = load_cameras(folder.path()).expect_err("too long").to_string();
        assert!(error.contains("at most 215 bytes"), "{error}");
    }
    let folder = Folder::new();
    let mut model = colmap::example(&folder);
    model.images[1].name = format!("{}.png", "é".repeat(110));
    std::fs::rename(folder.file("images/left/a.png"), folder.file(&format!("images/{}", model.images[1].name)))
        .expect("moved");
    model.write_binary(&folder, "sparse/0");
    refused(&folder, 220);
    // The longest that is allowed.
    let (folder, mut top) = ring_scene(3);
    let name = format!("images/{}.png", "n".repeat(215));
    folder.photo(&name, 32, 24);
    top["frames"][1]["file_path"] = json!(name);
    let scene = folder.scene(&top, &all());
    let longest = folder.file(&format!("out/{}_4294967295_depth_color.png", scene.train[2].name));
    gs_datasets::image_io::write_png(&longest, 1, 1, &[0]).expect("written");
}

/// Thousands of frames may show one photo at different times.
#[test]
fn many_equal_names_take_no_time() {
    let (folder, mut top) = ring_scene(1);
    let frames: Vec<_> = (0..30_000)
        .map(|i| {
            let pose = ring(0);
            json!({ "file_path": "images/00.png", "time": f64::from(i), "transform_matrix": pose, "w": 32, "h": 24 })
        })
        .collect();
    top["frames"] = json!(frames);
    folder.write_json("transforms.json", &top);
    let cameras = load_cameras(folder.path()).expect("cameras");
    assert_eq!(cameras.last().expect("one").name, "images/00_30000");
}

#[cfg(target_os = "linux")]
mod not_utf8 {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    use super::*;
    use crate::fixtures::npy;

    fn poses(rows: usize) -> Vec<u8> {
        let row = [0.0, 1.0, 0.0, 0.0, 6.0, 1.0, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, -1.0, 0.0, 9.5, 1.0, 9.0_f64];
        let bytes: Vec<u8> = (0..rows).flat_map(|_| row).flat_map(f64::to_le_bytes).collect();
        npy(1, "<f8", false, &format!("({rows}, 17)"), &bytes)
    }

    #[test]
    fn file_names_that_are_not_utf8_are_refused() {
        for odd in [&b"images/0\xff.png"[..], b"cam\xff/0.png"] {
            let folder = Folder::new();
            let odd = folder.path().join(OsStr::from_bytes(odd));
            folder.photo("photo.png", 8, 6);
            std::fs::create_dir_all(odd.parent().expect("a parent")).expect("made");
            std::fs::rename(folder.file("photo.png"), odd).expect("renamed");
            folder.write("poses_bounds.npy", poses(1));
            let error = load(folder.path(), &all()).expect_err("refused").to_string();
            let report = check(folder.path(), &all());
            assert!(error.contains('\u{fffd}') && error.contains("UTF-8"), "{error}");
            assert!(!report.is_ok() && report.to_string().contains("UTF-8"), "{report}");
        }
    }

    /// The folder of a data set may have any name.
    #[test]
    fn a_folder_whose_name_is_not_utf8_is_read() {
        let folder = Folder::new();
        let odd = folder.path().join(OsStr::from_bytes(b"set\xff"));
        let (ring, mut top) = ring_scene(3);
        for i in 0..3 {
            // The extension is left out, and the depth prior has none either.
            top["frames"][i]["file_path"] = json!(format!("images/{i:02}"));
            top["frames"][i]["depth_file_path"] = json!(format!("depth/{i:02}"));
            ring.grey(&format!("depth/{i:02}.png"), 32, 24, |x, y| (x + y) as u8 + 1);
        }
        ring.write_json("transforms.json", &top);
        std::fs::rename(ring.path(), &odd).expect("renamed");
        let scene = load(&odd, &all()).expect("loads");
        assert_eq!(crate::fixtures::names(&scene.train), ["images/00", "images/01", "images/02"]);
        assert!(scene.train.iter().all(|view| view.priors.depth.is_some()), "{:?}", scene.warnings);
        assert!(check(&odd, &all()).is_ok());
        std::fs::rename(&odd, ring.path()).expect("renamed");

        let odd = folder.path().join(OsStr::from_bytes(b"set\xfe"));
        let set = Folder::new();
        rig(&set, ".", 0, 2, 2);
        set.write("poses_bounds.npy", poses(2));
        std::fs::rename(set.path(), &odd).expect("renamed");
        let scene = load(&odd, &all()).expect("loads");
        assert_eq!(crate::fixtures::names(&scene.train), ["cam00/0000", "cam00/0001", "cam01/0000", "cam01/0001"]);
        std::fs::rename(&odd, set.path()).expect("renamed");
    }
}

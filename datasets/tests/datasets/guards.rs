//! Files that are no files, and files that are too large: a sentence at once, from `load` and from `check`.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use gs_base::guarded;
use gs_datasets::{check, load_cameras};
use serde_json::json;

use crate::colmap;
use crate::fixtures::{Folder, all, cloud, npy_f32, rig, ring_scene, warned};

/// An entry that may lie where a file should be, and how the sentence calls it.
const IMPOSTORS: [(&str, &str); 3] = [("/dev/zero", "a device"), ("pipe", "a pipe"), ("folder", "a folder")];

/// Puts an impostor in the place of a file. A pipe has no writer: whoever opens it waits for ever.
fn replace(path: &Path, impostor: &str) {
    if path.exists() {
        fs::remove_file(path).expect("removed");
    }
    fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
    match impostor {
        "pipe" => assert!(Command::new("mkfifo").arg(path).status().expect("mkfifo runs").success()),
        "folder" => fs::create_dir(path).expect("made"),
        device => symlink(device, path).expect("linked"),
    }
}

#[test]
fn a_description_that_is_no_file_is_named() {
    for (impostor, found) in IMPOSTORS {
        for name in ["transforms.json", "transforms_train.json", "train_meta.json", "poses_bounds.npy"] {
            let folder = Folder::new();
            folder.photo("images/0.png", 8, 6);
            replace(&folder.file(name), impostor);
            folder.refused_by_both(&all(), &[name, found]);
        }
        for stem in colmap::STEMS {
            for (write, ending) in colmap::ENCODINGS {
                let folder = Folder::new();
                write(&colmap::example(&folder), &folder, "sparse/0");
                let name = format!("sparse/0/{stem}.{ending}");
                replace(&folder.file(&name), impostor);
                folder.refused_by_both(&all(), &[&name, found]);
            }
        }
        let folder = Folder::new();
        replace(&folder.file("path.json"), impostor);
        let error = load_cameras(&folder.file("path.json")).expect_err("no file").to_string();
        assert!(error.contains("path.json") && (impostor == "folder" || error.contains(found)), "{error}");
    }
}

#[test]
fn a_file_that_a_description_names_is_refused_where_it_is_none() {
    for (impostor, found) in IMPOSTORS {
        let (folder, mut top) = ring_scene(3);
        top["ply_file_path"] = json!("points.ply");
        folder.write_json("transforms.json", &top);
        replace(&folder.file("points.ply"), impostor);
        folder.refused_by_both(&all(), &["points.ply", found]);

        let (folder, mut top) = ring_scene(3);
        folder.write_json("transforms.json", &top);
        replace(&folder.file("images/01.png"), impostor);
        folder.refused_by_both(&all(), &["images/01.png", found]);

        let (folder, _) = ring_scene(3);
        top["frames"][1]["mask_path"] = json!("masks/01.png");
        folder.write_json("transforms.json", &top);
        replace(&folder.file("masks/01.png"), impostor);
        folder.refused_by_both(&all(), &["masks/01.png", found]);
    }
}

/// A prior is a guess: without it the scene loads, with a word about it.
#[test]
fn a_prior_that_is_no_file_is_left_out() {
    for (impostor, found) in IMPOSTORS {
        for key in ["depth_file_path", "mask_path", "pseudo_sharp_path"] {
            for extension in ["npy", "exr", "png"] {
                let folder = Folder::new();
                let mut top = rig(&folder, "train", 0, 1, 1);
                top["mask_meaning"] = json!("dynamic");
                top["frames"][0][key] = json!(format!("prior.{extension}"));
                folder.write_json("transforms.json", &top);
                replace(&folder.file(&format!("prior.{extension}")), impostor);
                let scene = folder.load(&all());
                let said = |warnings: &[String]| warnings.iter().any(|w| w.contains("prior.") && w.contains(found));
                assert!(said(&scene.warnings), "{key} {extension} {impostor}: {:?}", scene.warnings);
                let report = check(folder.path(), &all());
                assert!(report.is_ok() && said(&report.warnings), "{key} {extension} {impostor}: {report}");
            }
        }
    }
}

/// Sparse files take no room on the disk: their lengths are what a header of a damaged disk might say.
#[test]
fn a_file_of_absurd_size_is_refused_before_it_is_read() {
    const HUGE: u64 = 1 << 40;
    let stretched = |folder: &Folder, name: &str| {
        let file = fs::OpenOptions::new().write(true).create(true).truncate(false).open(folder.file(name));
        file.expect("opened").set_len(HUGE).expect("stretched");
    };
    for name in ["transforms.json", "points.ply", "images/01.png", "masks/01.png"] {
        let (folder, mut top) = ring_scene(3);
        folder.write("points.ply", cloud("float", &[]));
        folder.grey("masks/01.png", 32, 24, |_, _| 255);
        top["ply_file_path"] = json!("points.ply");
        top["frames"][1]["mask_path"] = json!("masks/01.png");
        folder.write_json("transforms.json", &top);
        stretched(&folder, name);
        folder.refused_by_both(&all(), &[name, "at most", "1.0 TiB"]);
    }
    for stem in colmap::STEMS {
        for (write, ending) in colmap::ENCODINGS {
            let folder = Folder::new();
            write(&colmap::example(&folder), &folder, "sparse/0");
            let name = format!("sparse/0/{stem}.{ending}");
            stretched(&folder, &name);
            folder.refused_by_both(&all(), &[&name, "at most", "1.0 TiB"]);
        }
    }
    let folder = Folder::new();
    folder.write("poses_bounds.npy", npy_f32("(1, 17)", &[0.0; 17]));
    stretched(&folder, "poses_bounds.npy");
    folder.refused_by_both(&all(), &["poses_bounds.npy", "at most", "1.0 TiB"]);
}

#[test]
fn guarded_reading_is_bounded() {
    let folder = Folder::new();
    folder.write("a.toml", "seed = 1\n");
    assert_eq!(guarded::read_to_string(&folder.file("a.toml"), 9).expect("read"), "seed = 1\n");
    let error = guarded::read(&folder.file("a.toml"), 8).expect_err("one byte too many").to_string();
    assert!(error.contains("a.toml") && error.contains("at most 8 bytes") && error.contains("9 bytes"), "{error}");
    folder.write("a.toml", [b'a', 0xff]);
    let error = guarded::read_to_string(&folder.file("a.toml"), 9).expect_err("no text").to_string();
    assert!(error.contains("byte 1") && error.contains("UTF-8"), "{error}");
    let error = guarded::read(&folder.file("none"), 9).expect_err("nothing there").to_string();
    assert!(error.contains("none") && error.contains("cannot read"), "{error}");
    // Files of the kernel say that they have no bytes, and have some.
    let kernel = Path::new("/proc/self/status");
    if kernel.exists() {
        assert!(!guarded::read(kernel, 1 << 20).expect("read").is_empty());
        assert!(guarded::read(kernel, 10).expect_err("longer").to_string().contains("more than 10 bytes"));
    }
}

/// NumPy itself has no more than 64 axes; a header has room for 32 000, and bringing values into order takes a step for
/// each.
#[test]
fn an_array_has_few_axes() {
    let folder = Folder::new();
    let mut top = rig(&folder, "train", 0, 1, 1);
    top["frames"][0]["depth_file_path"] = json!("prior.npy");
    folder.write_json("transforms.json", &top);
    let shape = format!("({}48)", "1, ".repeat(100));
    let values: Vec<u8> = (0..48).flat_map(|i| (i as f32).to_le_bytes()).collect();
    folder.write("prior.npy", crate::fixtures::npy(1, "<f4", true, &shape, &values));
    let scene = folder.load(&all());
    warned(&scene.warnings, &["at most 64 axes"]);
}

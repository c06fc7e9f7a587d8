//! Several COLMAP models of one capture, and photos in none.

use gs_datasets::{check, load, load_cameras};

use crate::colmap::{ENCODINGS, Model, example};
use crate::fixtures::{Folder, all, names};

/// A capture that fell apart: one image in `small`, three in `large`.
fn apart(write: fn(&Model, &Folder, &str), small: &str, large: &str) -> Folder {
    let folder = Folder::new();
    let mut model = example(&folder);
    let three = model.images.split_off(1);
    write(&model, &folder, small);
    write(&Model { images: three, ..model }, &folder, large);
    folder
}

#[test]
fn the_largest_model_is_read_and_the_others_are_said() {
    for (write, _) in ENCODINGS {
        for (small, large) in
            [("sparse/0", "sparse/1"), ("sparse/1", "sparse/0"), ("sparse/2", "sparse/10"), ("0", "1")]
        {
            let folder = apart(write, small, large);
            let scene = folder.load(&all());
            assert_eq!(names(&scene.train), ["a photo", "left/a", "z"], "{large}");
            let said = scene.warnings.join(" ");
            let number = |path: &str| path.rsplit('/').next().expect("a part").to_string();
            let parts = [
                format!("of 2 models the largest is read, {} with 3 images", number(large)),
                format!("({} with 1)", number(small)),
                folder.file(small).display().to_string(),
            ];
            assert!(parts.iter().all(|part| said.contains(part)), "{parts:?}: {said}");
            let report = check(folder.path(), &all());
            assert!(report.is_ok() && report.to_string().contains("1 of 4 photos in "), "{report}");
            assert_eq!(load_cameras(folder.path()).expect("cameras").len(), 3);
            // The way out that the sentence names.
            let scene = load(&folder.file(small), &all()).expect("loads");
            assert_eq!(names(&scene.train), ["b"]);
            assert!(!scene.warnings.join(" ").contains("largest"), "{:?}", scene.warnings);
        }
    }
}

/// A count that the file cannot hold is no count.
#[test]
fn a_broken_model_is_not_the_largest() {
    let folder = apart(Model::write_binary, "sparse/0", "sparse/1");
    let mut bytes = std::fs::read(folder.file("sparse/0/images.bin")).expect("read");
    bytes[..8].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    folder.write("sparse/0/images.bin", bytes);
    assert_eq!(folder.load(&all()).train.len(), 3);
}

#[test]
fn a_model_with_few_of_the_photos_is_warned_about() {
    let folder = Folder::new();
    let mut model = example(&folder);
    model.images.truncate(2);
    model.write_text(&folder, "sparse/0");
    folder.write("images/._z.png", b"");
    for photo in ["b", "left/a"] {
        folder.grey(&format!("images/{photo}.mask.png"), 40, 30, |x, _| (x * 6) as u8);
    }
    let report = check(folder.path(), &all());
    assert!(report.warnings.is_empty() && report.to_string().contains("2 of 4 photos in "), "{report}");
    folder.photo("images/c.png", 40, 30);
    let report = check(folder.path(), &all());
    assert!(
        report.warnings[0].contains("3 of 5 photos in ") && report.warnings[0].contains("not in the model"),
        "{report}"
    );
}

/// As 3DGS's convert.py leaves a capture before it is undistorted: a model with lens distortion, and its photos in
/// `input`.
#[test]
fn a_distorted_model_is_read_with_its_input() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "distorted/sparse/0");
    std::fs::rename(folder.file("images"), folder.file("input")).expect("moved");
    for path in ["", "distorted", "distorted/sparse/0"] {
        assert_eq!(load(&folder.file(path), &all()).expect("loads").train.len(), 4, "{path}");
    }
    // Undistorted photos of the same names belong to the undistorted model.
    for name in ["b.png", "left/a.png", "a photo.png", "z.png"] {
        folder.photo(&format!("images/{name}"), 44, 34);
    }
    let scene = folder.load(&all());
    assert!(scene.train.iter().all(|view| view.width == 40), "input goes with the distorted model");
    let mut model = example(&Folder::new());
    model.cameras.iter_mut().for_each(|camera| (camera.width, camera.height) = (44, 34));
    model.write_binary(&folder, "sparse/0");
    assert!(folder.load(&all()).train.iter().all(|view| view.width == 44));
}

//! Which photo goes with which row of an LLFF pose file.

use gs_datasets::{LoadOptions, RowOrder, Scene, check};

use crate::fixtures::{Folder, all, npy, warned};

/// Rows of cameras that look along -z from these places: columns down, right, back and position, then height, width and
/// focal length.
fn pose_file(places: &[[f64; 3]]) -> Vec<u8> {
    let mut values = Vec::new();
    for [x, y, z] in places {
        values.extend([0.0, 1.0, 0.0, *x, 6.0, -1.0, 0.0, 0.0, *y, 8.0, 0.0, 0.0, 1.0, *z, 9.5, 0.5, 20.0]);
    }
    let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
    npy(1, "<f8", false, &format!("({}, 17)", places.len()), &bytes)
}

/// A video of `count` photos whose numbers have no leading zeros; the k-th stands at `at(k)`. Rows are sorted as text
/// or by number.
fn video(count: usize, as_text: bool, name: impl Fn(usize) -> String, at: impl Fn(usize) -> [f64; 3]) -> Folder {
    let folder = Folder::new();
    let mut order: Vec<usize> = (0..count).collect();
    if as_text {
        order.sort_by_key(|k| name(*k));
    }
    (0..count).for_each(|k| folder.photo(&name(k), 8, 6));
    folder.write("poses_bounds.npy", pose_file(&order.iter().map(|k| at(*k)).collect::<Vec<_>>()));
    folder
}

fn still(k: usize) -> String {
    format!("images/IMG_{k}.png")
}

fn line(k: usize) -> [f64; 3] {
    [0.1 * k as f64, 2.0, -1.0]
}

fn assert_in_place(scene: &Scene, at: impl Fn(usize) -> [f64; 3]) {
    for view in &scene.train {
        let digits = view.name.split(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty());
        let k = digits.and_then(|digits| digits.parse().ok()).expect("a number");
        assert_eq!(view.c2w.w_axis.truncate().to_array(), at(k), "{}", view.name);
    }
}

#[test]
fn rows_go_with_names_as_text_where_the_path_is_short_then() {
    let folder = video(30, true, still, line);
    let scene = folder.load(&all());
    assert_in_place(&scene, line);
    let report = check(folder.path(), &all());
    assert!(report.warnings.is_empty(), "{report}");
    let said = report.facts.iter().find(|fact| fact.contains("names as text")).expect("said");
    assert!(said.contains("IMG_10.png before IMG_2.png") && said.contains("2.90 long then, and 9.50"), "{said}");
}

#[test]
fn rows_go_by_number_where_the_path_is_short_then() {
    let folder = video(30, false, still, line);
    let scene = folder.load(&all());
    assert_in_place(&scene, line);
    let said = scene.warnings.join(" ");
    assert!(
        said.contains("rows go with the numbers") && said.contains("data.row_order=text reads them the other way"),
        "{said}"
    );
    assert!(said.contains("2.90 long then, and 7.60"), "{said}");
}

#[test]
fn rows_go_with_names_as_text_where_paths_do_not_tell() {
    // A walk to and fro between two places is as long in any order.
    let zigzag = |k: usize| [(7 * k % 12) as f64, 0.0, (5 * k % 12) as f64];
    let folder = video(12, true, still, zigzag);
    let scene = folder.load(&all());
    assert_in_place(&scene, zigzag);
    warned(&scene.warnings, &["does not tell; data.row_order=number"]);
    // The user says it, without a word more.
    let folder = video(12, false, still, zigzag);
    let by_number = LoadOptions { row_order: RowOrder::Number, ..all() };
    let scene = folder.load(&by_number);
    assert_in_place(&scene, zigzag);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    // With leading zeros there is no doubt and no word.
    let folder = video(12, true, |k| format!("images/IMG_{k:02}.png"), zigzag);
    let scene = folder.load(&all());
    assert_in_place(&scene, zigzag);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn folders_of_cameras_go_likewise() {
    for as_text in [true, false] {
        let folder = video(24, as_text, |k| format!("cam{k}/0001.png"), line);
        let scene = folder.load(&all());
        assert_eq!(scene.train.len(), 24);
        assert_in_place(&scene, line);
    }
}

/// LLFF's sets have `images_4` and `images_8` beside `images`, or without it.
#[test]
fn a_folder_of_smaller_photos_is_named_with_its_key() {
    let folder = video(3, true, |k| format!("images_4/{k}.png"), line);
    folder.photo("thumbnails/1.png", 8, 6);
    folder.refused(&all(), &["0 images in", "images_4 holds 3: --set data.images=images_4"]);
    let options = LoadOptions { images: Some("images_4".into()), ..all() };
    for view in folder.load(&options).train {
        assert_eq!(view.c2w.w_axis.truncate().to_array(), line(view.name[9..].parse().expect("a number")));
    }
    folder.grey("images_4/1.mask.png", 8, 6, |x, _| x as u8);
    let scene = folder.load(&options);
    assert!(scene.train[1].mask.is_some() && scene.train[0].mask.is_none());
}

/// macOS writes `._NAME` beside every file, and keeps `.DS_Store` in every folder.
#[test]
fn hidden_files_are_no_photos() {
    let folder = video(3, true, still, line);
    for name in ["images/._IMG_0.png", "images/._IMG_1.png", "images/.DS_Store", "._poses_bounds.npy"] {
        folder.write(name, b"\0\x05\x16\x07");
    }
    assert_in_place(&folder.load(&all()), line);
    let folder = video(2, true, |k| format!("cam0{k}/0001.png"), line);
    folder.write("._cam00", b"\0\x05\x16\x07");
    folder.write("cam00/._0001.png", b"\0\x05\x16\x07");
    folder.write(".cam02/0001.png", b"");
    assert_eq!(folder.load(&all()).train.len(), 2);
}

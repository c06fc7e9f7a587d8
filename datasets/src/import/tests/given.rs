//! Folders with a text for each camera and a depth for each photo, as OmniVGGT takes them.

use std::fmt::Write as _;
use std::path::Path;

use gs_base::write_atomic;

use super::archive::floats;
use super::{errors, world, worst};
use crate::import::{ImportOptions, import};
use crate::{Holdout, LoadOptions, View, load};
use gs_worlds::extrapolation::World;

/// The views as such a folder. Where nothing is, the depth is 1e10, as Infinigen writes the sky.
fn written(folder: &Path, views: &[View]) {
    for (index, view) in views.iter().enumerate() {
        let mut text = "# camera to world\n".to_string();
        for row in 0..3 {
            let row = view.c2w.row(row);
            writeln!(text, " {:.9e}\t{:.9e}\t{:.9e}\t{:.9e}\t", row.x, row.y, row.z, row.w).expect("a string");
        }
        let k = view.intrinsics;
        write!(text, "{} 0 {}\n0 {} {}\n0 0 1 # pixels of the photo\n", k.fx, k.cx, k.fy, k.cy).expect("a string");
        write_atomic(&folder.join(format!("cameras/{index:02}.txt")), text.as_bytes()).expect("a text");
        let truth = view.truth.depth.as_ref().expect("true depth");
        let depth = truth.iter().map(|z| if *z > 0.0 { *z } else { 1e10 });
        let bytes = floats(&[view.height, view.width], depth);
        write_atomic(&folder.join(format!("depths/{index:02}.npy")), &bytes).expect("a depth");
        let photo = folder.join(format!("images/{index:02}.png"));
        std::fs::create_dir_all(photo.parent().expect("a folder")).expect("a folder");
        std::fs::copy(&view.image_path, photo).expect("a photo");
    }
}

/// Cameras, depth and photos are those of the world, so that nothing has to be aligned: depth comes out as it went in, to the rounding of the
/// fits of scale and shift.
#[test]
fn a_folder_of_camera_texts_is_read_and_imported_into_itself() {
    let (_data, views) = world(World::Duo, 160, 120, 4);
    let set = tempfile::tempdir().expect("a folder");
    written(set.path(), &views);
    let plain = LoadOptions { holdout: Holdout::None, ..LoadOptions::default() };
    let scene = load(set.path(), &plain).expect("a data set");
    assert_eq!((scene.format.to_string().as_str(), scene.train.len()), ("cameras/NAME.txt", 4));
    assert!(scene.train.iter().zip(&views).all(|(found, view)| found.c2w.abs_diff_eq(view.c2w, 1e-6)));

    let out = set.path().join("with priors");
    let options = ImportOptions { out: Some(out.clone()), ..ImportOptions::default() };
    let report = import(set.path(), set.path(), &options).expect("an import");
    assert!((report.scale - 1.0).abs() < 1e-6 && report.views.iter().all(|view| view.known < 0.9), "{report}");
    let scene = load(&out, &plain).expect("a scene");
    let depth = |view: usize, pixel: usize| scene.train[view].priors.depth.as_ref().expect("a prior").values[pixel];
    let off = errors(&views, depth);
    assert!(worst(&off) < 0.002, "{off:?}");
    let sky = views.iter().enumerate().flat_map(|(index, view)| {
        let truth = view.truth.depth.as_ref().expect("true depth").iter().enumerate();
        truth.filter(|(_, z)| **z == 0.0).map(move |(pixel, _)| (index, pixel))
    });
    assert!(
        sky.clone().count() > 1000 && sky.clone().all(|(view, pixel)| depth(view, pixel) == 0.0),
        "the sky is unknown"
    );
}

#[test]
fn folders_of_another_content_are_refused_in_a_sentence() {
    let (_data, views) = world(World::Duo, 32, 24, 3);
    let set = tempfile::tempdir().expect("a folder");
    written(set.path(), &views);
    let refused = |expected: &str| {
        let options = ImportOptions { out: Some(set.path().join("out")), ..ImportOptions::default() };
        let error = import(set.path(), set.path(), &options).expect_err("refused").to_string();
        assert!(error.contains(expected), "{error}");
    };
    let file = |name: &str| set.path().join(name);
    write_atomic(&file("depths/01.npy"), &floats(&[12, 16], vec![1.0; 192])).expect("a depth");
    refused("expected (24, 32), as the first depth has");
    write_atomic(&file("cameras/02.txt"), b"1 0 0 0\n0 1 0 0\n").expect("a text");
    refused("21 numbers, found 8 numbers");
    (0..3).for_each(|index| std::fs::remove_file(file(&format!("depths/{index:02}.npy"))).expect("a depth"));
    write_atomic(&file("cameras/02.txt"), &std::fs::read(file("cameras/01.txt")).expect("a text")).expect("a text");
    refused("depths (NAME.npy) of 1 to 512 cameras, found 0");
}

//! COLMAP models: what loading them gives.

use glam::DVec3;
use gs_datasets::{Holdout, LoadOptions, MaskUse, Scene, SceneFormat};

pub use crate::colmap_writer::*;
use crate::fixtures::{Folder, all, names};

type Writer = fn(&Model, &Folder, &str);

/// Writers of both encodings, with the endings of their files.
pub const ENCODINGS: [(Writer, &str); 2] = [(Model::write_text, "txt"), (Model::write_binary, "bin")];

fn load_all(folder: &Folder) -> Scene {
    folder.load(&all())
}

#[test]
fn text_and_binary_give_equal_scenes_in_every_place() {
    for (text, binary) in [("sparse/0", "sparse/0"), ("sparse", "colmap/sparse/0"), ("dense/sparse", "sparse_bin/0")] {
        let (one, two) = (Folder::new(), Folder::new());
        example(&one).write_text(&one, text);
        example(&two).write_binary(&two, binary);
        let (one, two) = (load_all(&one), load_all(&two));
        assert_eq!((one.format, two.format), (SceneFormat::ColmapText, SceneFormat::ColmapBinary));
        assert_eq!(names(&one.train), ["a photo", "b", "left/a", "z"]);
        for (a, b) in one.train.iter().zip(&two.train) {
            assert_eq!((&a.name, a.c2w, a.intrinsics, &a.image), (&b.name, b.c2w, b.intrinsics, &b.image));
        }
        assert_eq!(one.points, two.points);
        assert_eq!(one.points.expect("points").len(), 20);
        assert!(one.warnings.is_empty() && two.warnings.is_empty());
    }
}

#[test]
fn points_project_where_images_see_them() {
    let folder = Folder::new();
    let model = example(&folder);
    model.write_binary(&folder, "sparse/0");
    let scene = load_all(&folder);
    for view in &scene.train {
        let image = model.images.iter().find(|image| image.name == format!("{}.png", view.name)).expect("an image");
        for ((x, y, _), point) in image.seen.iter().zip(&model.points) {
            let c = view.c2w.inverse().transform_point3(DVec3::from_array(point.position));
            let k = view.intrinsics;
            let (u, v) = (k.fx * c.x / c.z + k.cx, k.fy * c.y / c.z + k.cy);
            assert!((u - x).hypot(v - y) < 1e-9, "{}: ({u}, {v}) against ({x}, {y})", view.name);
        }
    }
}

#[test]
fn a_camera_model_that_is_not_read_is_refused_by_name_if_used() {
    let folder = Folder::new();
    let mut model = example(&folder);
    model.write_text(&folder, "sparse/0");
    load_all(&folder);
    model.images[1].camera_id = 77;
    model.write_text(&folder, "sparse/0");
    folder.refused(&LoadOptions::default(), &["model DIVISION", "cameras.txt", "SIMPLE_RADIAL"]);
    model.images[1].camera_id = 1000;
    model.write_text(&folder, "sparse/0");
    folder.refused(&LoadOptions::default(), &["camera 1000", "images.txt"]);
}

#[test]
fn images_can_lie_elsewhere_and_be_smaller() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    std::fs::rename(folder.file("images"), folder.file("photos")).expect("moved");
    folder.refused(&LoadOptions::default(), &["none of the 4 images"]);
    let options = LoadOptions { images: Some("photos".into()), holdout: Holdout::None, ..LoadOptions::default() };
    assert_eq!(folder.load(&options).train.len(), 4);
    for name in ["a photo.png", "b.png", "left/a.png"] {
        folder.photo(&format!("images_2/{name}"), 20, 15);
    }
    let options = LoadOptions { images: Some("images_2".into()), ..options };
    let scene = folder.load(&options);
    assert_eq!((scene.train.len(), scene.train[1].intrinsics.fx, scene.train[1].intrinsics.cy), (3, 20.0, 7.5));
    assert_eq!(scene.warnings.len(), 2, "one image is missing, three are smaller: {:?}", scene.warnings);
    folder.refused(&LoadOptions { images: Some("nowhere".into()), ..options }, &["nowhere"]);
}

#[test]
fn masks_lie_beside_the_images() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    folder.grey("masks/b.png.png", 40, 30, |x, _| if x < 10 { 0 } else { 255 });
    folder.grey("masks/left/a.png", 40, 30, |x, _| if x < 10 { 0 } else { 255 });
    let masked: Vec<bool> = load_all(&folder).train.iter().map(|view| view.mask.is_some()).collect();
    assert_eq!(masked, [false, true, true, false]);
    let options = LoadOptions { masks: MaskUse::Ignore, ..LoadOptions::default() };
    assert!(folder.load(&options).train.iter().all(|view| view.mask.is_none()));
}

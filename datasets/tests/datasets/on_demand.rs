//! Sets larger than the memory they may take: views whose photos are decoded when they are asked for.

use gs_datasets::{LoadOptions, Scene, View, load, surveyed};
use gs_worlds::deblur::DeblurOptions;
use serde_json::json;

use crate::fixtures::{Folder, ring_scene, warned, written};

/// A set of which nothing may be kept.
fn none_kept(folder: &Folder, options: &LoadOptions) -> Scene {
    load(folder.path(), &LoadOptions { memory: Some(0), ..options.clone() }).expect("loaded")
}

fn assert_same_when_asked(folder: &Folder, options: &LoadOptions) {
    let whole = load(folder.path(), options).expect("loaded");
    let asked = none_kept(folder, options);
    let views = |scene: &Scene| scene.train.iter().chain(scene.held_out_views()).cloned().collect::<Vec<View>>();
    for (whole, view) in views(&whole).iter().zip(views(&asked)) {
        assert!(view.image.data.is_empty() && view.mask.is_none() && view.source.is_some());
        let facts = |view: &View| (view.c2w, view.intrinsics, view.width, view.height, view.time, view.exposure);
        assert_eq!((&view.name, facts(&view)), (&whole.name, facts(whole)));
        assert_eq!(&*view.decoded(), whole);
        let half = (whole.reduced(whole.width / 2), view.reduced(view.width / 2));
        assert_eq!((half.1.width, half.1.intrinsics), (half.0.width, half.0.intrinsics));
        assert_eq!(*half.1.decoded(), half.0);
    }
    assert_eq!(surveyed(&asked.train), whole.train, "a small set is surveyed as it is");
    assert_eq!((asked.time_range, &asked.points), (whole.time_range, &whole.points));
}

#[test]
fn photos_are_the_same_when_they_are_asked_for() {
    let world = written(&DeblurOptions { width: 48, height: 36, cameras: 4, frames: 4, ..DeblurOptions::default() });
    assert_same_when_asked(&world, &LoadOptions::default());
    let (folder, mut top) = ring_scene(6);
    top["k1"] = json!(0.05);
    for i in 0..6 {
        folder.grey(&format!("masks/{i}.png"), 32, 24, |x, _| if x < 5 { 0 } else { 255 });
        top["frames"][i]["mask_path"] = json!(format!("masks/{i}.png"));
    }
    folder.write_json("transforms.json", &top);
    assert_same_when_asked(&folder, &LoadOptions { max_width: Some(20), ..LoadOptions::default() });
}

#[test]
fn a_set_that_fits_is_decoded_at_once() {
    let (folder, top) = ring_scene(6);
    folder.write_json("transforms.json", &top);
    let bytes = 6 * 3 * 32 * 24;
    let is_asked = |memory| {
        let scene = load(folder.path(), &LoadOptions { memory: Some(memory), ..LoadOptions::default() });
        scene.expect("loaded").train[0].source.is_some()
    };
    assert_eq!([is_asked(bytes), is_asked(bytes - 1)], [false, true]);
}

/// The pose of a view may be changed, as where a scene has another origin than its photos.
#[test]
fn a_view_keeps_its_pose_when_it_is_asked_for() {
    let (folder, top) = ring_scene(6);
    folder.write_json("transforms.json", &top);
    let mut view = none_kept(&folder, &LoadOptions::default()).train.remove(0);
    view.c2w.w_axis.x += 1.0;
    assert_eq!(view.decoded().c2w, view.c2w);
}

/// A file that is lost, broken or of another size after loading takes no photo but its own along.
#[test]
fn no_pixel_of_a_photo_that_became_unreadable_counts() {
    let (folder, top) = ring_scene(6);
    folder.write_json("transforms.json", &top);
    let scene = none_kept(&folder, &LoadOptions::default());
    let path = |view: usize| scene.train[view].image_path.clone();
    std::fs::remove_file(path(0)).expect("removed");
    let whole = std::fs::read(path(1)).expect("read");
    std::fs::write(path(1), &whole[..whole.len() - 20]).expect("written");
    image::RgbImage::new(16, 12).save(path(2)).expect("written");
    for view in &scene.train[..3] {
        let shown = view.decoded();
        assert_eq!(shown.image.data.len(), 3 * view.width * view.height);
        assert!(shown.mask.as_ref().is_some_and(|mask| mask.iter().all(|counts| *counts == 0)), "{}", view.name);
    }
    assert!(scene.train[3].decoded().mask.is_none());
}

#[test]
fn surveyed_photos_are_checked_and_headers_are_read_of_all() {
    let (folder, mut top) = ring_scene(6);
    for i in 0..6 {
        folder.grey(&format!("masks/{i}.png"), 32, 24, |_, _| 0);
        top["frames"][i]["mask_path"] = json!(format!("masks/{i}.png"));
    }
    folder.write_json("transforms.json", &top);
    let scene = none_kept(&folder, &LoadOptions::default());
    warned(&scene.warnings, &["no pixel counts in"]);
    folder.write("images/00.png", b"not an image");
    let refused = load(folder.path(), &LoadOptions { memory: Some(0), ..LoadOptions::default() });
    assert!(refused.expect_err("no image").to_string().contains("00.png"));
}

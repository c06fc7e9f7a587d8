//! Frames that are described first and decoded when asked, and the cache of their views.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use gs_datasets::{DatasetError, FrameDescription, FrameSource, LoadOptions, Log, LogCache, Split, View, check, load};
use gs_worlds::deblur::DeblurOptions;
use proptest::prelude::*;
use serde_json::json;

use crate::fixtures::{Folder, rig, ring_scene, written};

/// The log's views are those of `load`, in its order; what is described is what is decoded.
fn assert_same_as_load(folder: &Folder, options: &LoadOptions) {
    let scene = load(folder.path(), options).expect("loaded");
    let log = Log::open(folder.path(), options).expect("opened");
    let mut loaded = scene.train.iter().map(|view| (Split::TRAIN, view)).collect::<Vec<_>>();
    for split in &scene.held_out {
        loaded.extend(split.views.iter().map(|view| (split.name.as_str(), view)));
    }
    assert_eq!(log.frames().len(), loaded.len());
    // Last frame first: no view depends on the others having been decoded.
    for (index, (split, view)) in loaded.iter().enumerate().rev() {
        assert_eq!(&log.decode(index).expect("decoded"), *view);
        let View { name, image_path, c2w, intrinsics, width, height, time, camera_id, exposure, .. } = (*view).clone();
        let described = FrameDescription {
            name,
            split: split.to_string(),
            time,
            camera_id,
            c2w,
            size: Some((width, height)),
            intrinsics: Some(intrinsics),
            image_path,
            exposure,
        };
        assert_eq!(log.frames()[index], described);
    }
    assert_eq!((log.points(), log.origin(), log.format()), (scene.points.as_ref(), scene.origin, scene.format));
    let counts: Vec<usize> = log.splits().map(|(_, frames)| frames.len()).collect();
    assert_eq!(counts.iter().sum::<usize>(), loaded.len());
    assert_eq!(counts[0], scene.train.len());
}

#[test]
fn every_view_is_the_one_that_loading_gives() {
    // Blur, priors, truth; a held-out camera whose views are their sharp truth.
    let world = written(&DeblurOptions { width: 48, height: 36, cameras: 4, frames: 4, ..DeblurOptions::default() });
    assert_same_as_load(&world, &LoadOptions::default());
    assert_same_as_load(&world, &LoadOptions { max_width: Some(31), training_truth: true, ..LoadOptions::default() });
    // Lens distortion, a world far from its origin, three splits, masks, images of another size than declared.
    let (folder, mut top) = ring_scene(6);
    top["k1"] = json!(0.05);
    top["w"] = json!(64);
    top["h"] = json!(48);
    top["cx"] = json!(31.0);
    for i in 0..6 {
        top["frames"][i]["transform_matrix"][0][3] = json!(5e6 + i as f64);
        folder.grey(&format!("masks/{i}.png"), 32, 24, |x, _| if x < 5 { 0 } else { 255 });
        top["frames"][i]["mask_path"] = json!(format!("masks/{i}.png"));
    }
    top["train_filenames"] = json!(["images/00.png", "images/01.png", "images/02.png"]);
    top["val_filenames"] = json!(["images/03.png"]);
    top["test_filenames"] = json!(["images/05.png", "images/04.png"]);
    folder.write_json("transforms.json", &top);
    assert_same_as_load(&folder, &LoadOptions { max_width: Some(20), ..LoadOptions::default() });
}

/// Masks of moving objects that are all black are left out of all views, and a black one among others is kept.
#[test]
fn black_masks_are_judged_by_the_whole_set() {
    let folder = Folder::new();
    let mut top = rig(&folder, "train", 0, 2, 3);
    top["mask_meaning"] = json!("dynamic");
    for i in 0..6 {
        folder.grey(&format!("masks/{i}.png"), 8, 6, |_, _| 0);
        top["frames"][i]["mask_path"] = json!(format!("masks/{i}.png"));
    }
    folder.write_json("transforms_train.json", &top);
    assert_same_as_load(&folder, &LoadOptions::default());
    let log = Log::open(folder.path(), &LoadOptions::default()).expect("opened");
    assert!(log.decode(0).expect("decoded").priors.moving.is_none());
    folder.grey("masks/4.png", 8, 6, |x, _| if x == 3 { 255 } else { 0 });
    assert_same_as_load(&folder, &LoadOptions::default());
    let log = Log::open(folder.path(), &LoadOptions::default()).expect("opened");
    assert!((0..6).all(|index| log.decode(index).expect("decoded").priors.moving.is_some()));
}

/// Opening decodes no pixel: whatever is in the images, it succeeds, and says so where a frame is decoded.
#[test]
fn broken_images_are_errors_when_they_are_decoded() {
    let (folder, top) = ring_scene(9);
    folder.write_json("transforms.json", &top);
    let whole = std::fs::read(folder.file("images/02.png")).expect("read");
    folder.write("images/01.png", b"not an image");
    folder.write("images/02.png", &whole[..whole.len() - 20]);
    let log = Log::open(folder.path(), &LoadOptions::default()).expect("opened");
    std::fs::remove_file(folder.file("images/03.png")).expect("removed");
    let index = |name: &str| log.frames().iter().position(|frame| frame.name == name).expect("a frame");
    for (name, known) in [("images/01", false), ("images/02", true), ("images/04", true)] {
        let frame = &log.frames()[index(name)];
        assert_eq!((frame.size, frame.intrinsics.is_some()), (known.then_some((32, 24)), known), "{name}");
    }
    for name in ["images/01", "images/02"] {
        let error = log.decode(index(name)).expect_err("broken");
        assert!(matches!(&error, DatasetError::Image { path, .. } if path.ends_with(format!("{name}.png"))), "{error}");
    }
    let error = log.decode(index("images/03")).expect_err("missing");
    assert!(
        matches!(&error, DatasetError::File(gs_base::FileError::Io { path, .. }) if path.ends_with("images/03.png")),
        "{error}"
    );
    log.decode(index("images/04")).expect("a sound frame beside broken ones");
    assert!(load(folder.path(), &LoadOptions::default()).is_err());
    let report = check(folder.path(), &LoadOptions::default());
    assert_eq!(report.errors.len(), 2, "{report}");
}

#[test]
fn warnings_of_the_description_are_kept() {
    let (folder, mut top) = ring_scene(9);
    top["frames"][8]["file_path"] = json!("images/nowhere.png");
    folder.write_json("transforms.json", &top);
    let log = Log::open(folder.path(), &LoadOptions::default()).expect("opened");
    assert_eq!(log.warnings(), folder.load(&LoadOptions::default()).warnings);
    assert!(log.warnings()[0].contains("nowhere"), "{:?}", log.warnings());
    assert!(Log::open(&folder.file("nowhere"), &LoadOptions::default()).is_err());
}

/// Views of known sizes, and how often each was decoded.
struct Counted {
    frames: Vec<FrameDescription>,
    sizes: Vec<usize>,
    decoded: Vec<AtomicUsize>,
}

impl Counted {
    /// A black square of `sizes[i]` pixels a side for each frame; 0 is a frame that cannot be decoded.
    fn new(sizes: &[usize]) -> Self {
        let describe = |index: usize| FrameDescription {
            name: index.to_string(),
            split: Split::TRAIN.to_string(),
            time: None,
            camera_id: None,
            c2w: glam::DMat4::IDENTITY,
            size: None,
            intrinsics: None,
            image_path: "none.png".into(),
            exposure: None,
        };
        Self {
            frames: (0..sizes.len()).map(describe).collect(),
            sizes: sizes.to_vec(),
            decoded: sizes.iter().map(|_| AtomicUsize::new(0)).collect(),
        }
    }

    fn times(&self, index: usize) -> usize {
        self.decoded[index].load(Ordering::Relaxed)
    }
}

impl FrameSource for Counted {
    fn frames(&self) -> &[FrameDescription] {
        &self.frames
    }

    fn decode(&self, index: usize) -> Result<View, DatasetError> {
        self.decoded[index].fetch_add(1, Ordering::Relaxed);
        match self.sizes[index] {
            0 => Err(DatasetError::Image { path: format!("{index}.png").into(), found: "nothing".to_string() }),
            side => Ok(View { name: index.to_string(), ..View::blank(side, side) }),
        }
    }
}

fn bytes(side: usize) -> usize {
    View { name: "0".to_string(), ..View::blank(side, side) }.bytes()
}

#[test]
fn bytes_are_those_of_the_buffers() {
    assert_eq!(View::blank(10, 20).bytes() - View::blank(0, 0).bytes(), 3 * 200);
    let mut view = View::blank(10, 20);
    let empty = view.bytes();
    (view.truth.velocity, view.priors.moving) = (Some(vec![0.0; 600]), Some(vec![0; 200]));
    (view.mask, view.truth.sharp) = (Some(vec![0; 200]), Some(view.image.clone()));
    assert_eq!(view.bytes() - empty, 2400 + 200 + 200 + 600);
}

#[test]
fn the_view_asked_for_longest_ago_goes_first() {
    let cache = LogCache::new(Counted::new(&[8; 4]), 2 * bytes(8));
    for index in [0, 1, 0, 2, 0, 1] {
        assert_eq!(cache.get(index).expect("decoded").name, index.to_string());
    }
    let times: Vec<usize> = (0..4).map(|index| cache.source().times(index)).collect();
    assert_eq!(times, [1, 2, 1, 0], "0 was in use all the time, 1 made room for 2");
}

#[test]
fn views_that_do_not_fit_are_handed_out_and_not_held() {
    let cache = LogCache::new(Counted::new(&[8, 20]), bytes(8));
    let held = cache.get(0).expect("decoded");
    for _ in 0..2 {
        assert_eq!(cache.get(1).expect("decoded").width, 20);
    }
    assert!(Arc::ptr_eq(&held, &cache.get(0).expect("held")), "a large view costs no other its room");
    assert_eq!((cache.source().times(0), cache.source().times(1)), (1, 2));
    let none = LogCache::new(Counted::new(&[8]), 0);
    assert_eq!((none.get(0).expect("decoded").width, none.bytes()), (8, 0));
}

#[test]
fn prefetched_views_are_not_decoded_again() {
    let cache = LogCache::new(Counted::new(&[8; 50]), 1 << 20);
    cache.prefetch(&[3, 4, 5, 3]).expect("decoded");
    let before: usize = (0..50).map(|index| cache.source().times(index)).sum();
    assert!([3, 4, 5].iter().all(|index| cache.get(*index).is_ok()));
    assert_eq!((0..50).map(|index| cache.source().times(index)).sum::<usize>(), before);
    // What there is no room for is not decoded, but for the rest of a round.
    let small = LogCache::new(Counted::new(&[8; 5000]), 2 * bytes(8));
    small.prefetch(&(0..5000).collect::<Vec<_>>()).expect("decoded");
    let decoded = (0..5000).filter(|index| small.source().times(*index) > 0).count();
    assert!(decoded <= 2 * rayon::current_num_threads() + 2 && small.bytes() <= 2 * bytes(8), "{decoded}");
    let error = LogCache::new(Counted::new(&[8, 0, 0]), 1 << 20).prefetch(&[0, 2, 1]).expect_err("broken");
    assert!(error.to_string().contains("2.png"), "{error}");
}

proptest! {
    /// Views come right and the bound holds, whoever asks for what.
    #[test]
    fn the_bound_holds_under_random_access(
        sizes in proptest::collection::vec(0..24_usize, 1..12),
        asked in proptest::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 1..60),
        room in 0..8000_usize,
    ) {
        let cache = LogCache::new(Counted::new(&sizes), room);
        let mut shown = HashMap::new();
        std::thread::scope(|scope| {
            for part in asked.chunks(20) {
                let (cache, sizes) = (&cache, &sizes);
                scope.spawn(move || {
                    for (index, prefetch) in part {
                        let index = index.index(sizes.len());
                        if *prefetch {
                            let _ = cache.prefetch(&[index, (index + 1) % sizes.len()]);
                        }
                        let view = cache.get(index);
                        assert_eq!(view.is_ok(), sizes[index] > 0);
                        assert!(view.is_ok_and(|view| view.name == index.to_string()) || sizes[index] == 0);
                        assert!(cache.bytes() <= room);
                    }
                });
            }
        });
        for (index, _) in asked {
            let index = index.index(sizes.len());
            if let Ok(view) = cache.get(index) {
                prop_assert!(cache.bytes() <= room);
                // What was just asked for and fits is held.
                let again = cache.get(index).expect("a view");
                prop_assert_eq!(Arc::ptr_eq(&view, &again), view.bytes() <= room);
                shown.insert(index, view);
            }
        }
        prop_assert!(shown.iter().all(|(index, view)| view.width == sizes[*index]));
    }
}

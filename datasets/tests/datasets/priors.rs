//! Priors and truth beside the photos.

use gs_datasets::{
    DepthKind, DepthSpace, LoadOptions, MaskUse, PriorUse, Scene, View, check, image_io::write_exr, load,
};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use serde_json::{Value, json};

use crate::fixtures::{Folder, all, held_out, npy, npy_f32, rig, warned};

/// 8 x 6 values 1, 2, 3 and on.
fn ramp() -> Vec<f32> {
    (1..=48).map(|i| i as f32).collect()
}

/// One camera at `times` times.
fn one_camera(times: usize) -> (Folder, Value) {
    let folder = Folder::new();
    let top = rig(&folder, "train", 0, 1, times);
    (folder, top)
}

fn scene(folder: &Folder, top: &Value, options: &LoadOptions) -> Scene {
    folder.write_json("transforms_train.json", top);
    load(folder.path(), options).expect("loaded")
}

/// The first view of a scene whose first frame has this depth file, and the warnings.
fn with_depth(name: &str, write: impl Fn(&Folder), kind: Option<&str>, options: &LoadOptions) -> (View, Vec<String>) {
    let (folder, mut top) = one_camera(1);
    write(&folder);
    top["frames"][0]["depth_file_path"] = json!(name);
    if let Some(kind) = kind {
        top["depth_kind"] = json!(kind);
    }
    let mut scene = scene(&folder, &top, options);
    (scene.train.remove(0), scene.warnings)
}

fn png16(folder: &Folder, name: &str, values: &[u16]) {
    let data: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(&data, 8, 6, ExtendedColorType::L16).expect("encoded");
    folder.write(name, png);
}

#[test]
fn everything_a_frame_names_is_loaded() {
    let (folder, mut top) = one_camera(2);
    let plane = ramp();
    let velocity: Vec<Vec<f32>> = (0..3).map(|axis| plane.iter().map(|v| v * 0.1 - axis as f32).collect()).collect();
    let write = |name: &str, channels: &[(&str, &[f32])]| {
        write_exr(&folder.file(name), 8, 6, channels).expect("written");
    };
    write("priors/depth.exr", &[("Y", &plane)]);
    write("depth.exr", &[("R", &[9.0; 48]), ("Z", &plane)]);
    write("velocity.exr", &[("X", &velocity[0]), ("Y", &velocity[1]), ("Z", &velocity[2])]);
    folder.grey("priors/mask.png", 8, 6, |x, _| if x < 2 { 255 } else { 0 });
    folder.grey("mask.png", 8, 6, |x, _| u8::from(x == 3));
    folder.grey("union.png", 8, 6, |x, _| u8::from(x == 3 || x == 4));
    folder.photo("priors/sharp.png", 8, 6);
    folder.photo("sharp.png", 8, 6);
    folder.photo("blurry.png", 8, 6);
    top["exposure"] = json!(0.05);
    top["mask_meaning"] = json!("dynamic");
    top["depth_kind"] = json!("inverse_depth");
    let first = &mut top["frames"][0];
    first["mask_path"] = json!("priors/mask.png");
    first["depth_file_path"] = json!("priors/depth.exr");
    first["pseudo_sharp_path"] = json!("priors/sharp");
    first["truth"] = json!({
        "sharp_path": "sharp.png", "blurry_path": "blurry.png", "depth_path": "./depth.exr",
        "velocity_path": "velocity.exr", "mask_path": "mask.png", "mask_union_path": "union.png"
    });
    top["frames"][1]["exposure"] = json!(0.02);
    let Scene { train, warnings, .. } = scene(&folder, &top, &all());
    let View { priors, truth, exposure, mask, .. } = &train[0];
    assert_eq!((*exposure, train[1].exposure), (Some(0.05), Some(0.02)));
    assert_eq!(*mask, None, "masks of moving objects do not hide pixels");
    let depth = priors.depth.as_ref().expect("depth");
    assert_eq!((&depth.values, depth.space, depth.metric), (&plane, DepthSpace::InverseDepth, false));
    assert_eq!(priors.moving.as_ref().expect("mask")[..4], [255, 255, 0, 0]);
    let image = |name: &str| image::open(folder.file(name)).expect("image").into_rgb8().into_raw();
    assert_eq!(priors.sharp.as_ref().expect("sharp").data, image("priors/sharp.png"));
    assert_eq!(truth.sharp.as_ref().expect("sharp").data, image("sharp.png"));
    assert_eq!(truth.blurry.as_ref().expect("blurry").data, image("blurry.png"));
    assert_eq!(truth.depth.as_ref(), Some(&plane), "channel Z, though there is a colour");
    let expected: Vec<f32> = (0..48).flat_map(|i| velocity.iter().map(move |axis| axis[i])).collect();
    assert_eq!(truth.velocity.as_ref(), Some(&expected));
    assert_eq!(truth.moving.as_ref().expect("mask")[2..6], [0, 255, 0, 0]);
    assert_eq!(truth.moving_union.as_ref().expect("mask")[2..6], [0, 255, 255, 0]);
    // The second frame has none of the three priors, which is said; truth is not owed.
    assert_eq!((train[1].priors.clone(), train[1].truth.clone()), Default::default());
    let missing = warnings.iter().filter(|text| text.contains("1 of 2 views do not exist")).count();
    assert_eq!((missing, warnings.len()), (3, 4), "and that exposures differ: {warnings:?}");
}

#[test]
fn priors_that_are_not_wanted_are_not_read() {
    let (folder, mut top) = one_camera(1);
    folder.write("broken", "broken");
    top["mask_meaning"] = json!("dynamic");
    for key in ["depth_file_path", "mask_path", "pseudo_sharp_path"] {
        top["frames"][0][key] = json!("broken");
    }
    let scene = scene(&folder, &top, &LoadOptions { priors: PriorUse::NONE, ..all() });
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.train[0].priors, Default::default());
}

#[test]
fn numpy_arrays_of_any_kind_are_the_same_map() {
    let plane = ramp();
    let bytes = |convert: fn(f32) -> Vec<u8>| plane.iter().flat_map(|v| convert(*v)).collect::<Vec<u8>>();
    // The same numbers column by column.
    let columns: Vec<u8> = (0..8).flat_map(|x| (0..6).map(move |y| y * 8 + x + 1)).map(|v: usize| v as u8).collect();
    // Half floats of 1 to 48: 2^e (1 + m / 1024).
    let half = |v: f32| {
        let exponent = v.log2().floor();
        let mantissa = ((v / exponent.exp2() - 1.0) * 1024.0) as u16;
        (((exponent as u16 + 15) << 10) | mantissa).to_le_bytes().to_vec()
    };
    let files = [
        npy(1, "<f4", false, "(6, 8)", &bytes(|v| v.to_le_bytes().to_vec())),
        npy(2, ">f4", false, "(1, 6, 8)", &bytes(|v| v.to_be_bytes().to_vec())),
        npy(3, "<f8", false, "(6, 8, 1)", &bytes(|v| f64::from(v).to_le_bytes().to_vec())),
        npy(1, "<f2", false, "(6, 8)", &bytes(half)),
        npy(1, "|u1", false, "(6, 8)", &bytes(|v| vec![v as u8])),
        npy(1, "<u2", false, "(6L, 8L)", &bytes(|v| (v as u16).to_le_bytes().to_vec())),
        npy(1, ">i4", false, "(6,8,)", &bytes(|v| (v as i32).to_be_bytes().to_vec())),
        npy(1, "|u1", true, "(6, 8)", &columns),
    ];
    for (i, file) in files.iter().enumerate() {
        let (view, warnings) = with_depth("d.npy", |folder| folder.write("d.npy", file), Some("depth"), &all());
        assert!(warnings.is_empty(), "file {i}: {warnings:?}");
        assert_eq!(view.priors.depth.expect("depth").values, plane, "file {i}");
    }
}

#[test]
fn depth_means_what_the_set_or_the_user_says() {
    let values: Vec<u16> = (0..48).map(|i| i * 500).collect();
    let write = |folder: &Folder| png16(folder, "d.png", &values);
    let depth = |kind: Option<&str>, options: &LoadOptions| {
        let (view, warnings) = with_depth("d.png", write, kind, options);
        (view.priors.depth.expect("depth"), warnings)
    };
    let (metric, _) = depth(Some("metric_z"), &all());
    assert!(metric.metric && metric.space == DepthSpace::Depth);
    // Thousandths of a unit; 0 stays 0, which is unknown.
    assert!((metric.values[3] - 1.5).abs() < 1e-6 && metric.values[0] == 0.0);
    // Spelled as in a configuration file.
    assert!(depth(Some("metric-z"), &all()).0.metric);
    let (relative, _) = depth(Some("disparity"), &all());
    assert!(!relative.metric && relative.space == DepthSpace::InverseDepth && relative.values[3] == 1500.0);
    let (user, _) = depth(Some("metric_z"), &LoadOptions { depth_kind: Some(DepthKind::Depth), ..all() });
    assert!(!user.metric && user.space == DepthSpace::Depth);
    let (guess, warnings) = depth(None, &all());
    assert!(!guess.metric && guess.space == DepthSpace::Depth);
    assert!(warnings.len() == 1 && warnings[0].contains("depth_kind"), "{warnings:?}");
    let grey = |folder: &Folder| folder.grey("d.png", 8, 6, |x, _| x as u8);
    let (view, _) = with_depth("d.png", grey, None, &all());
    assert_eq!(view.priors.depth.expect("depth").space, DepthSpace::InverseDepth, "as single-image networks save it");
}

#[test]
fn unknown_depths_are_zero() {
    let mut plane = ramp();
    plane[..5].copy_from_slice(&[f32::NAN, f32::INFINITY, 1e10, -3.0, -f32::INFINITY]);
    let write = |folder: &Folder| folder.write("d.npy", npy_f32("(6, 8)", &plane));
    let (view, _) = with_depth("d.npy", write, Some("metric_z"), &all());
    assert_eq!(view.priors.depth.expect("depth").values[..6], [0.0, 0.0, 0.0, 0.0, 0.0, 6.0]);
    let (view, _) = with_depth("d.npy", write, Some("depth"), &all());
    assert_eq!(view.priors.depth.expect("depth").values[..5], [0.0, 0.0, 0.0, -3.0, 0.0], "up to a shift");
}

#[test]
fn maps_follow_the_photo_to_its_training_size() {
    let (folder, mut top) = one_camera(1);
    folder.write("d.npy", npy_f32("(6, 8)", &ramp()));
    folder.rgb("sharp.png", 8, 6, |x, y| [(x * 16) as u8, (y * 16) as u8, 0]);
    folder.grey("m.png", 16, 12, |x, y| if x < 8 && y < 6 { 3 } else { 0 });
    top["depth_kind"] = json!("depth");
    top["mask_meaning"] = json!("dynamic");
    top["frames"][0]["depth_file_path"] = json!("d.npy");
    top["frames"][0]["pseudo_sharp_path"] = json!("sharp.png");
    top["frames"][0]["mask_path"] = json!("m.png");
    let Scene { train, warnings, .. } = scene(&folder, &top, &LoadOptions { max_width: Some(4), ..all() });
    let View { priors, width, height, .. } = &train[0];
    assert_eq!((*width, *height), (4, 3));
    // The old pixel under the centre of a new one at (2x + 1, 2y + 1), whose corner it is: the one right and below.
    assert_eq!(priors.depth.as_ref().expect("depth").values[..5], [10.0, 12.0, 14.0, 16.0, 26.0]);
    assert_eq!(priors.sharp.as_ref().expect("sharp").data[..6], [8, 8, 0, 40, 8, 0], "means of four");
    assert_eq!(*priors.moving.as_ref().expect("mask"), [255, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], "rows 2, 6 and 10");
    assert!(warnings.len() == 1 && warnings[0].contains("another size"), "{warnings:?}");
}

#[test]
fn a_prior_that_cannot_be_used_is_left_out_and_counted() {
    let (folder, mut top) = one_camera(5);
    folder.write("0.npy", npy_f32("(6, 8)", &ramp()));
    folder.write("1.npy", npy_f32("(8, 6)", &ramp()));
    folder.write("2.npy", &npy_f32("(6, 8)", &ramp())[..100]);
    folder.rgb("3.png", 8, 6, |x, _| [200, 10 * x as u8, 30]);
    folder.photo("small.png", 4, 3);
    top["depth_kind"] = json!("depth");
    for (i, name) in ["0.npy", "1.npy", "2.npy", "3.png", "nowhere.exr"].iter().enumerate() {
        top["frames"][i]["depth_file_path"] = json!(name);
        top["frames"][i]["pseudo_sharp_path"] = json!("small.png");
    }
    let Scene { train, warnings, .. } = scene(&folder, &top, &all());
    let has: Vec<bool> = train.iter().map(|view| view.priors.depth.is_some()).collect();
    assert_eq!(has, [true, false, false, false, false]);
    assert!(train.iter().all(|view| view.priors.sharp.is_none()), "too small to be sharp");
    for part in [
        "depth priors of 1 of 5 views do not exist; they are left out (train/cam00/0004)",
        "depth priors of 1 of 5 views have another shape than their photos",
        "6 x 8 pixels beside a photo of 8 x 6",
        "depth priors of 2 of 5 views cannot be read",
        "pseudo-sharp images of 5 of 5 views have another shape",
    ] {
        assert!(warnings.iter().any(|text| text.contains(part)), "{part:?} is not in\n{}", warnings.join("\n"));
    }
    assert_eq!(warnings.len(), 4, "{}", warnings.join("\n"));
    for flat in [[0.0_f32; 48], [f32::NAN; 48], [-3.0; 48], [3.0; 48]] {
        let (folder, mut top) = one_camera(1);
        folder.write("0.npy", npy_f32("(6, 8)", &flat));
        top["depth_kind"] = json!("depth");
        top["frames"][0]["depth_file_path"] = json!("0.npy");
        let Scene { train, warnings, .. } = scene(&folder, &top, &all());
        assert!(train[0].priors.depth.is_none());
        warned(&warnings, &["hold one value, or none above 0"]);
    }
    let report = check(folder.path(), &all());
    assert!(report.is_ok() && report.warnings[..4] == warnings, "{report}");
    assert!(report.to_string().contains("1 view has depth priors, depth, to be aligned"), "{report}");
}

#[test]
fn masks_that_mark_nothing() {
    let (folder, mut top) = one_camera(3);
    for i in 0..3 {
        folder.grey(&format!("m{i}.png"), 8, 6, |x, _| if x == 0 && i == 2 { 255 } else { 0 });
        top["frames"][i]["mask_path"] = json!("m0.png");
    }
    top["mask_meaning"] = json!("dynamic");
    let all_black = scene(&folder, &top, &all());
    assert!(all_black.train.iter().all(|view| view.priors.moving.is_none()));
    assert!(all_black.warnings[0].contains("no mask marks a moving pixel"), "{:?}", all_black.warnings);
    top["frames"][2]["mask_path"] = json!("m2.png");
    let some = scene(&folder, &top, &all());
    assert!(some.train.iter().all(|view| view.priors.moving.is_some()));
    assert!(some.warnings[0].contains("masks of 2 of 3 views mark no moving pixel"), "{:?}", some.warnings);
}

#[test]
fn masks_of_objects_may_be_arrays_of_numbers() {
    let (folder, mut top) = one_camera(1);
    let labels: Vec<u8> = (0..48).map(|i| if i == 5 { 2 } else { 0 }).collect();
    folder.write("m.npy", npy(1, "|u1", false, "(6, 8)", &labels));
    top["frames"][0]["mask_path"] = json!("m.npy");
    let moving = scene(&folder, &top, &LoadOptions { masks: MaskUse::Moving, ..all() }).train.remove(0).priors.moving;
    assert_eq!(moving.expect("a mask").iter().position(|value| *value == 255), Some(5));
}

#[test]
fn masks_of_blurry_video_mark_what_moves_unless_it_says_otherwise() {
    let (folder, mut top) = one_camera(2);
    folder.grey("m.png", 8, 6, |x, _| if x == 0 { 255 } else { 0 });
    for frame in top["frames"].as_array_mut().expect("frames") {
        frame["mask_path"] = json!("m.png");
    }
    let sharp = scene(&folder, &top, &all());
    assert!(sharp.train.iter().all(|view| view.priors.moving.is_none() && view.mask.is_some()));
    top["exposure"] = json!(0.05);
    let blurry = scene(&folder, &top, &all());
    assert!(blurry.train.iter().all(|view| view.priors.moving.is_some() && view.mask.is_none()));
    warned(&blurry.warnings, &["white where something moves"]);
    top["mask_meaning"] = json!("keep");
    assert!(scene(&folder, &top, &all()).train.iter().all(|view| view.mask.is_some()));
}

#[test]
fn held_out_views_are_their_sharp_truth() {
    let (folder, train) = one_camera(2);
    folder.write_json("transforms_train.json", &train);
    let mut test = rig(&folder, "test", 1, 1, 1);
    folder.rgb("truth.png", 8, 6, |x, _| [x as u8, 7, 9]);
    test["frames"][0]["truth"] = json!({ "sharp_path": "truth.png" });
    folder.write_json("transforms_test.json", &test);
    let found = folder.load(&LoadOptions::default());
    let view = &held_out(&found)[0];
    assert_eq!(view.image.data[3..6], [1, 7, 9]);
    assert!(view.truth.blurry.as_ref().is_some_and(|photo| photo.data != view.image.data));
}

#[test]
fn side_folders_go_by_the_photos_names() {
    let (folder, mut top) = one_camera(2);
    folder.write("depth/train/cam00/0000.npy", npy_f32("(6, 8)", &ramp()));
    folder.write("depth/cam00/0001.npy", npy_f32("(6, 8)", &ramp()));
    folder.photo("sharp/train/cam00/0000.png", 8, 6);
    folder.grey("masks/train/cam00/0000.png", 8, 6, |x, _| if x == 0 { 255 } else { 0 });
    let found = scene(&folder, &top, &all());
    assert!(found.train.iter().all(|view| view.priors.depth.is_some()));
    assert_eq!([0, 1].map(|i| found.train[i].priors.moving.is_some()), [true, false]);
    assert_eq!([0, 1].map(|i| found.train[i].priors.sharp.is_some()), [true, false]);
    for part in ["guesses to learn from", "pseudo-sharp images of 1 of 2 views do not exist", "depth_kind"] {
        assert!(found.warnings.iter().any(|text| text.contains(part)), "{part:?}: {:?}", found.warnings);
    }
    for meaning in ["keep", "dynamic"] {
        top["mask_meaning"] = json!(meaning);
        assert_eq!(scene(&folder, &top, &all()).train[0].priors.moving.is_some(), meaning == "dynamic");
        let marked = scene(&folder, &top, &LoadOptions { masks: MaskUse::Moving, ..all() });
        assert!(marked.train[0].priors.moving.is_some());
    }
    // A set that names its truth keeps it in such folders; they are no priors.
    top["frames"][0]["truth"] = json!({ "sharp_path": "sharp/train/cam00/0000.png" });
    let told = scene(&folder, &top, &all());
    assert!(told.train[0].truth.sharp.is_some() && told.train[0].priors == Default::default());
    assert!(told.warnings.is_empty(), "{:?}", told.warnings);
}

#[test]
fn held_out_views_owe_no_priors() {
    let (folder, mut top) = one_camera(1);
    folder.write("d.npy", npy_f32("(6, 8)", &ramp()));
    top["depth_kind"] = json!("depth");
    top["frames"][0]["depth_file_path"] = json!("d.npy");
    let mut test = rig(&folder, "test", 1, 1, 1);
    test["frames"][0]["depth_file_path"] = json!("nowhere.npy");
    folder.write_json("transforms_test.json", &test);
    let scene = scene(&folder, &top, &LoadOptions::default());
    assert!(scene.train[0].priors.depth.is_some() && scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn priors_are_not_undistorted() {
    let (folder, mut top) = one_camera(1);
    folder.write("d.npy", npy_f32("(6, 8)", &ramp()));
    top["depth_kind"] = json!("depth");
    top["k1"] = json!(0.1);
    top["frames"][0]["depth_file_path"] = json!("d.npy");
    let scene = scene(&folder, &top, &all());
    assert!(scene.train[0].priors.depth.is_none());
    warned(&scene.warnings, &["lens distortion"]);
}

/// Confidence goes with depth: named or in its side folder, at least 1, at the photo's size; a broken file is counted
/// and left out.
#[test]
fn confidence_is_read_with_depth() {
    let values: Vec<f32> = (0..48).map(|i| if i == 5 { f32::NAN } else { i as f32 / 4.0 }).collect();
    for key in ["confidence_file_path", "confidence_path", ""] {
        let (folder, mut top) = one_camera(1);
        write_exr(&folder.file("d.exr"), 8, 6, &[("Z", &ramp())]).expect("written");
        write_exr(&folder.file("priors/confidence/train/cam00/0000.exr"), 8, 6, &[("Y", &values)]).expect("written");
        top["depth_kind"] = json!("depth");
        top["frames"][0]["depth_file_path"] = json!("d.exr");
        if !key.is_empty() {
            top["frames"][0][key] = json!("priors/confidence/train/cam00/0000.exr");
        }
        let loaded = scene(&folder, &top, &all());
        assert_eq!(loaded.warnings, Vec::<String>::new());
        let confidence = loaded.train[0].priors.confidence.as_ref().expect("a confidence");
        assert_eq!(confidence[..9], [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.5, 1.75, 2.0], "key {key:?}");
        let half = scene(&folder, &top, &LoadOptions { max_width: Some(4), ..all() });
        assert_eq!(half.train[0].priors.confidence.as_ref().map(Vec::len), Some(4 * 3));
        assert!(loaded.train[0].bytes() > half.train[0].bytes() + 4 * (48 - 12) * 2, "both maps count");
        let none = scene(&folder, &top, &LoadOptions { priors: PriorUse { depth: false, ..PriorUse::ALL }, ..all() });
        assert_eq!(none.train[0].priors.confidence, None);
        folder.write("priors/confidence/train/cam00/0000.exr", "broken");
        let broken = scene(&folder, &top, &all());
        assert!(broken.train[0].priors.depth.is_some() && broken.train[0].priors.confidence.is_none());
        warned(&broken.warnings, &["confidences of depth of 1 of 1 view"]);
    }
}

/// A reconstruction of the first frame gives priors of that time alone; what it lacks there is a gap, what it lacks
/// later is none.
#[test]
fn priors_of_one_time_have_gaps_at_that_time_only() {
    let folder = Folder::new();
    let mut top = rig(&folder, "train", 0, 3, 4);
    top["depth_kind"] = json!("depth");
    write_exr(&folder.file("d.exr"), 8, 6, &[("Z", &ramp())]).expect("written");
    for camera in [0, 1] {
        top["frames"][4 * camera]["depth_file_path"] = json!("d.exr");
    }
    let warnings = scene(&folder, &top, &all()).warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("train/cam02/0000"), "{warnings:?}");
    top["frames"][8]["depth_file_path"] = json!("d.exr");
    assert_eq!(scene(&folder, &top, &all()).warnings, Vec::<String>::new());
}

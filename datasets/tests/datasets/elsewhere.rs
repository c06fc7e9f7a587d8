//! Photos and masks that are not where a description says: found, or named.

use gs_datasets::{LoadOptions, MaskUse, check};
use serde_json::json;

use crate::colmap::example;
use crate::fixtures::{Folder, all, names, ring_scene, warned};

#[test]
fn paths_of_another_machine_are_found_by_their_ends() {
    for prefix in ["C:\\Users\\u\\scan\\", "/home/u/scan/", "D:/scan/", "//server/share/scan/", "../../scan/"] {
        let (folder, mut top) = ring_scene(3);
        std::fs::create_dir(folder.file("images/deep")).expect("made");
        std::fs::rename(folder.file("images/01.png"), folder.file("images/deep/01.png")).expect("moved");
        folder.grey("masks/00.png", 32, 24, |x, _| (8 * x) as u8);
        let there = |path: &str| {
            json!(format!("{prefix}{}", if prefix.contains('\\') { path.replace('/', "\\") } else { path.into() }))
        };
        for (i, path) in ["images/00.png", "images/deep/01.png", "images/02.png"].into_iter().enumerate() {
            top["frames"][i]["file_path"] = there(path);
        }
        top["frames"][0]["mask_path"] = there("masks/00.png");
        top["train_filenames"] = json!([there("images/00.png"), there("images/deep/01.png"), there("images/02.png")]);
        let scene = folder.scene(&top, &all());
        assert_eq!(names(&scene.train), ["images/00", "images/02", "images/deep/01"], "{prefix}");
        assert!(scene.train[0].mask.is_some() && scene.train[1].mask.is_none());
        let said = scene.warnings.join(" ");
        assert!(said.contains("3 photos were found under another name") && said.contains("as images/00.png"), "{said}");
        // By the last part of the name alone, if only one file has it.
        std::fs::rename(folder.file("images/deep"), folder.file("images/deeper")).expect("moved");
        assert_eq!(folder.load(&all()).train.len(), 3);
        folder.photo("images/other/01.png", 32, 24);
        let scene = folder.load(&all());
        assert_eq!(names(&scene.train), ["images/00", "images/02"]);
        assert!(scene.warnings.join(" ").contains("more than one file"), "{:?}", scene.warnings);
    }
    // Two machines, one file here.
    let (folder, mut top) = ring_scene(3);
    top["frames"][0]["file_path"] = json!("/a/images/02.png");
    top["frames"][1]["file_path"] = json!("/b/images/02.png");
    folder.write_json("transforms.json", &top);
    folder.refused_by_both(&all(), &["another pose"]);
}

/// A frame whose own photo is missing does not take one of another list.
#[test]
fn relative_paths_are_not_looked_for_in_other_folders() {
    let (folder, mut top) = ring_scene(3);
    folder.photo("test/01.png", 32, 24);
    std::fs::remove_file(folder.file("images/01.png")).expect("removed");
    let scene = folder.scene(&top, &all());
    assert_eq!(names(&scene.train), ["images/00", "images/02"]);
    assert!(!scene.warnings.join(" ").contains("test/01.png"), "{:?}", scene.warnings);
    // Another extension in the same place is the photo, converted.
    folder.photo("images/01.png", 32, 24);
    top["frames"][1]["file_path"] = json!("images/01.heic");
    folder.write_json("transforms.json", &top);
    assert_eq!(folder.load(&all()).train.len(), 3);
}

#[test]
fn photos_in_another_container_beside_the_names_are_named() {
    let gif = b"GIF89a\x08\0\x06\0";
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    std::fs::remove_dir_all(folder.file("images")).expect("removed");
    for name in ["b", "left/a"] {
        folder.write(&format!("images/{name}.gif"), gif);
    }
    folder.refused_by_both(&all(), &["2 of them are there as GIF (b.gif): convert"]);
    let (folder, top) = ring_scene(2);
    for name in ["00", "01"] {
        std::fs::remove_file(folder.file(&format!("images/{name}.png"))).expect("removed");
        folder.write(&format!("images/{name}.gif"), gif);
    }
    folder.write_json("transforms.json", &top);
    folder.refused_by_both(&all(), &["2 of them are there as GIF (images/00.gif): convert"]);
}

#[test]
fn a_folder_of_smaller_photos_is_read_or_named_with_its_key() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    std::fs::rename(folder.file("images"), folder.file("images_4")).expect("moved");
    assert_eq!(folder.load(&all()).train.len(), 4, "it has all, and images none");
    let options = LoadOptions { images: Some("images_4".into()), ..all() };
    assert_eq!(folder.load(&options).train.len(), 4);
    folder.photo("images/b.png", 40, 30);
    let scene = folder.load(&all());
    warned(&scene.warnings, &["images of these names are in images_4: --set data.images=images_4"]);
    let (folder, top) = ring_scene(2);
    folder.write_json("transforms.json", &top);
    std::fs::rename(folder.file("images"), folder.file("images_4")).expect("moved");
    folder.refused_by_both(&options, &["images/00.png is there as images_4/00.png"]);
}

#[test]
fn names_in_another_unicode_form_are_found() {
    let folder = Folder::new();
    let mut model = example(&folder);
    for (i, (written, there)) in
        [("me\u{301}nage.png", "m\u{e9}nage.png"), ("ga\u{304c}/a.png", "ga\u{304b}\u{3099}/a.png")]
            .into_iter()
            .enumerate()
    {
        std::fs::remove_file(folder.file(&format!("images/{}", model.images[i].name))).expect("removed");
        model.images[i].name = written.to_string();
        folder.photo(&format!("images/{there}"), 40, 30);
    }
    model.write_text(&folder, "sparse/0");
    let scene = folder.load(&all());
    assert_eq!(scene.train.len(), 4);
    assert!(scene.warnings.join(" ").contains("in another Unicode form (NFC, NFD)"), "{:?}", scene.warnings);
    // Another accent at the same place could be meant too.
    folder.photo("images/m\u{ea}nage.png", 40, 30);
    assert_eq!(folder.load(&all()).train.len(), 3);
}

#[test]
fn an_empty_mask_path_is_no_mask() {
    let (folder, mut top) = ring_scene(2);
    top["frames"][0]["mask_path"] = json!("");
    top["frames"][1]["mask_path"] = json!(" ");
    let scene = folder.scene(&top, &all());
    assert!(scene.train.iter().all(|view| view.mask.is_none()) && scene.warnings.is_empty(), "{:?}", scene.warnings);
}

/// `NAME.mask.png`, as Postshot and Brush have it.
#[test]
fn masks_beside_photos_are_used() {
    let (folder, mut top) = ring_scene(2);
    folder.grey("images/00.mask.png", 32, 24, |x, _| if x < 8 { 0 } else { 255 });
    folder.write_json("transforms.json", &top);
    let mask = |masks| folder.load(&LoadOptions { masks, ..all() }).train.remove(0).mask;
    let kept = mask(MaskUse::Auto).expect("a mask");
    assert_eq!((kept[7], kept[8]), (0, 255));
    assert_eq!(mask(MaskUse::KeepBlack).expect("a mask")[7], 255);
    assert_eq!((mask(MaskUse::Ignore), mask(MaskUse::Moving)), (None, None));
    let said = check(folder.path(), &all()).to_string();
    assert!(
        said.contains("1 file named after photos is a mask, black is ignored; 1 photo without one counts"),
        "{said}"
    );
    // Where things move, they mark what moves.
    for i in 0..2 {
        top["frames"][i]["time"] = json!(i);
    }
    folder.write_json("transforms.json", &top);
    let view = folder.load(&all()).train.remove(0);
    assert!(view.mask.is_none() && view.priors.moving.is_some());
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    folder.grey("images/left/a.mask.png", 40, 30, |x, _| if x < 10 { 0 } else { 255 });
    let masked: Vec<bool> = folder.load(&all()).train.iter().map(|view| view.mask.is_some()).collect();
    assert_eq!(masked, [false, false, true, false]);
}

#[test]
fn masks_by_other_names_are_named() {
    for name in ["sky_masks/00.png", "mattes/images/00.png", "images/alpha/00.jpg", "segments/00.png.png"] {
        let (folder, top) = ring_scene(2);
        folder.write_json("transforms.json", &top);
        folder.grey(name, 32, 24, |x, _| (8 * x) as u8);
        let scene = folder.load(&all());
        let warned: Vec<&String> =
            scene.warnings.iter().filter(|text| text.contains("1 mask named after photos is not used")).collect();
        assert_eq!((scene.train.len(), warned.len()), (2, 1), "{name}: {:?}", scene.warnings);
        assert!(folder.load(&LoadOptions { masks: MaskUse::Ignore, ..all() }).warnings.is_empty());
    }
}

#[test]
fn a_photo_of_no_bytes_is_empty() {
    let (folder, top) = ring_scene(2);
    folder.write_json("transforms.json", &top);
    folder.write("images/01.png", "");
    folder.refused_by_both(&all(), &["images/01.png", "an empty file"]);
}

#[test]
fn one_photo_is_told_how_to_train_it() {
    let (folder, top) = ring_scene(1);
    folder.write_json("transforms.json", &top);
    folder.refused_by_both(&LoadOptions::default(), &["--set data.holdout=none"]);
    assert_eq!(folder.load(&all()).train.len(), 1);
}

#[test]
fn photos_of_one_colour_are_refused() {
    let (folder, top) = ring_scene(4);
    folder.write_json("transforms.json", &top);
    for color in [[0, 0, 0, 255], [255, 255, 255, 255], [9, 200, 30, 0]] {
        for i in 0..4 {
            folder.rgba(&format!("images/{i:02}.png"), 32, 24, |_, _| color);
        }
        for options in [all(), LoadOptions::default()] {
            folder.refused_by_both(&options, &["one colour all over"]);
        }
        // One pixel is something.
        folder.rgba("images/02.png", 32, 24, |x, y| if (x, y) == (31, 23) { [1, 2, 3, 255] } else { color });
        folder.load(&all());
        assert!(check(folder.path(), &all()).to_string().contains("Good to load"));
    }
}

/// Powers of ten in place of hundreds of digits.
#[test]
fn large_numbers_are_short() {
    let (folder, mut top) = ring_scene(4);
    top["frames"][0]["transform_matrix"][0][3] = json!(1e14);
    top["frames"][1]["transform_matrix"][0][3] = json!(1e308);
    top["frames"][2]["transform_matrix"][0][0] = json!(1e200);
    top["frames"][3]["fl_x"] = json!(-1e300);
    folder.write_json("transforms.json", &top);
    let report = check(folder.path(), &all()).to_string();
    let run = report.split(|c: char| !c.is_ascii_digit()).map(str::len).max();
    assert!(report.contains("e14") && run.is_some_and(|run| run < 20), "{report}");
}

//! Which pixels count, by each convention.

use gs_datasets::{Holdout, LoadOptions, MaskUse};
use serde_json::json;

use crate::fixtures::{Folder, all, ring_scene, warned};

fn mask_of(folder: &Folder, masks: MaskUse, max_width: Option<usize>) -> (Option<Vec<u8>>, Vec<String>) {
    let options = LoadOptions { holdout: Holdout::None, masks, max_width, ..LoadOptions::default() };
    let mut scene = folder.load(&options);
    (scene.train.remove(0).mask, scene.warnings)
}

/// One photo of 32 x 24 whose mask is black in the left quarter.
fn masked() -> (Folder, serde_json::Value) {
    let (folder, mut top) = ring_scene(1);
    folder.grey("masks/00.png", 32, 24, |x, _| if x < 8 { 0 } else { 255 });
    top["frames"][0]["mask_path"] = json!("masks/00.png");
    folder.write_json("transforms.json", &top);
    (folder, top)
}

#[test]
fn nerfstudio_masks_ignore_where_black() {
    let (folder, mut top) = masked();
    let (mask, _) = mask_of(&folder, MaskUse::Auto, None);
    let mask = mask.expect("a mask");
    assert_eq!((mask[7], mask[8], mask.len()), (0, 255, 32 * 24));
    let (reversed, _) = mask_of(&folder, MaskUse::KeepBlack, None);
    assert!(mask.iter().zip(reversed.expect("a mask")).all(|(a, b)| *a == 255 - b));
    assert_eq!(mask_of(&folder, MaskUse::Ignore, None).0, None);
    top["mask_meaning"] = json!("dynamic");
    folder.write_json("transforms.json", &top);
    let (none, warnings) = mask_of(&folder, MaskUse::Auto, None);
    assert!(none.is_none() && warnings.len() == 1 && warnings[0].contains("AS MOVING"), "{warnings:?}");
    assert_eq!(mask_of(&folder, MaskUse::KeepWhite, None).0, Some(mask));
}

#[test]
fn masks_that_are_all_missing_are_an_error() {
    let (folder, mut top) = masked();
    top["frames"][0]["mask_path"] = json!("masks/none.png");
    folder.write_json("transforms.json", &top);
    folder.refused(&LoadOptions::default(), &["mask_path", "masks/none.png"]);
    assert_eq!(mask_of(&folder, MaskUse::Ignore, None).0, None);
}

#[test]
fn a_resized_pixel_counts_only_if_all_of_it_does() {
    let (folder, _) = masked();
    // 32 -> 12: new pixel 3 covers old [8, 10.67) and counts; 2 covers [5.33, 8) and does not.
    let mask = mask_of(&folder, MaskUse::Auto, Some(12)).0.expect("a mask");
    assert_eq!((mask.len(), mask[2], mask[3]), (12 * 9, 0, 255));
    // 32 -> 10: new pixel 2 covers old [6.4, 9.6), part of it ignored.
    let mask = mask_of(&folder, MaskUse::Auto, Some(10)).0.expect("a mask");
    assert_eq!((mask[2], mask[3]), (0, 255));
}

#[test]
fn masks_of_another_size_are_scaled_and_of_other_proportions_refused() {
    let (folder, _) = masked();
    folder.grey("masks/00.png", 16, 12, |x, _| if x < 4 { 0 } else { 1 });
    let mask = mask_of(&folder, MaskUse::Auto, None).0.expect("a mask");
    assert_eq!((mask[7], mask[8]), (0, 255), "any pixel that is not black counts");
    folder.grey("masks/00.png", 16, 24, |_, _| 0);
    folder.refused(&all(), &["16 x 24", "32 x 24"]);
}

#[test]
fn instant_ngp_masks_ignore_where_white() {
    let (folder, top) = ring_scene(1);
    folder.write_json("transforms.json", &top);
    folder.rgb("images/dynamic_mask_00.png", 32, 24, |_, y| if y < 6 { [0, 9, 0] } else { [0; 3] });
    let mask = mask_of(&folder, MaskUse::Auto, None).0.expect("a mask");
    assert_eq!((mask[5 * 32], mask[6 * 32]), (0, 255));
}

/// Masks that no description names: each pattern alone, at the photo's size and at half of it.
#[test]
fn masks_by_usual_names_ignore_where_black() {
    let patterns = [
        "masks/@.png.png",
        "masks/@.png",
        "masks/images/@.png",
        "mask/@.jpg",
        "Mask/@_mask.png",
        "images_masks/@.png",
        "segmentation/@.png",
        "images/masks/@.png.png",
        "images/@.mask.png",
        "images/@_mask.png",
    ];
    for (pattern, half) in patterns.iter().flat_map(|pattern| [1, 2].map(|half| (pattern, half))) {
        let (folder, top) = ring_scene(2);
        folder.write_json("transforms.json", &top);
        let write = |photo: &str| {
            folder.grey(&pattern.replace('@', photo), 32 / half, 24 / half, |x, _| if x < 8 / half { 0 } else { 255 });
        };
        write("00");
        let (mask, warnings) = mask_of(&folder, MaskUse::Auto, None);
        let mask = mask.unwrap_or_else(|| panic!("{pattern}: no mask"));
        assert_eq!((mask[7], mask[8], mask.len()), (0, 255, 32 * 24), "{pattern}");
        assert_eq!(warnings.len(), 1, "{pattern}: {warnings:?}");
        assert!(warnings[0].contains("is a mask, black is ignored; 1 photo without one counts whole"), "{warnings:?}");
        assert_eq!(mask_of(&folder, MaskUse::Ignore, None), (None, Vec::new()));
        assert_eq!(mask_of(&folder, MaskUse::KeepBlack, None).0.expect("a mask")[7], 255);
        write("01");
        assert_eq!(mask_of(&folder, MaskUse::Auto, None).1, [""; 0], "{pattern}");
    }
}

#[test]
fn masks_that_ignore_nearly_everything_raise_suspicion() {
    let (folder, _) = masked();
    let (_, warnings) = mask_of(&folder, MaskUse::Auto, None);
    assert!(warnings.is_empty(), "{warnings:?}");
    let (_, warnings) = mask_of(&folder, MaskUse::KeepBlack, None);
    assert!(warnings[0].contains("75 %") && warnings[0].contains("data.masks=keep-white"), "{warnings:?}");
}

#[test]
fn a_view_without_a_pixel_that_counts_is_reported() {
    let (folder, _) = masked();
    folder.grey("masks/00.png", 32, 24, |_, _| 0);
    let (_, warnings) = mask_of(&folder, MaskUse::Auto, None);
    warned(&warnings, &["no pixel counts in 1 view,"]);
}

//! Masks and background of photos 256 pixels wide, pinned to the bit: defaults keep their meaning at the width they
//! were chosen at.
//!
//! The photos are made of integers alone, and masks of additions, multiplications and square roots, so that no
//! mathematical library has a say.

use glam::DMat4;
use gs_base::Intrinsics;
use gs_datasets::{PoseConvention, Priors, RgbImage8, Scene, SceneFormat, Truth, View};
use gs_multiview::{MaskOptions, MaskSource, background, moving_masks, static_cameras};

const WIDTH: usize = 256;
const HEIGHT: usize = 192;
const FRAMES: usize = 10;

/// A number from 0 to 2^32 - 1 for each key.
fn hash(key: [usize; 4]) -> usize {
    key.iter().fold(0x9E37_79B9_u32, |sum, part| {
        let mixed = (sum ^ *part as u32).wrapping_mul(0x85EB_CA6B);
        (mixed ^ mixed >> 13).wrapping_mul(0xC2B2_AE35) ^ mixed >> 16
    }) as usize
}

/// How much light a soft shadow, a disc of radius 26 with an edge of 16 pixels, leaves at a pixel, in hundredths.
fn light(x: usize, y: usize, frame: usize) -> usize {
    let (dx, dy) = (x.abs_diff(20 + 18 * frame), y.abs_diff(150));
    let inside = (26 * 26_usize).saturating_sub(dx * dx + dy * dy);
    100 - (inside * 40 / (26 * 26)).min(40)
}

/// A textured box that crosses the picture, a plain one that moves by less than its width, and specks of 1 to 12 pixels
/// for a frame.
fn object(x: usize, y: usize, frame: usize, c: usize) -> Option<usize> {
    let textured = 10 + 20 * frame;
    if (textured..textured + 44).contains(&x) && (40..76).contains(&y) {
        return Some(90 + hash([(x - textured) / 3, y / 3, c, 7]) % 150);
    }
    let plain = 100 + 3 * frame;
    if (plain..plain + 60).contains(&x) && (90..120).contains(&y) {
        return Some([210, 120, 40][c]);
    }
    let area = frame + 3;
    let speck =
        (x.wrapping_sub(30 + 9 * frame) < 4) && (10..13).contains(&y) && (y - 10) * 4 + x - 30 - 9 * frame < area;
    speck.then_some([250, 250, 60][c])
}

fn value(pixel: usize, frame: usize, c: usize) -> u8 {
    let (x, y) = (pixel % WIDTH, pixel / WIDTH);
    let still = || (70 + hash([x / 5, y / 5, c, 1]) % 110) * light(x, y, frame) / 100;
    let noise = hash([pixel, frame, c, 3]) % 5;
    (object(x, y, frame, c).unwrap_or_else(still) + noise - 2).min(255) as u8
}

fn view(frame: usize) -> View {
    let data = (0..3 * WIDTH * HEIGHT).map(|i| value(i / 3, frame, i % 3)).collect();
    View {
        name: format!("cam/{frame:04}"),
        image_path: "none.png".into(),
        c2w: DMat4::IDENTITY,
        intrinsics: Intrinsics { fx: 280.0, fy: 280.0, cx: 128.0, cy: 96.0 },
        width: WIDTH,
        height: HEIGHT,
        time: Some(frame as f64),
        camera_id: Some("cam".into()),
        image: RgbImage8 { width: WIDTH, height: HEIGHT, data },
        fine: None,
        alpha: None,
        mask: None,
        exposure: None,
        priors: Priors::default(),
        truth: Truth::default(),
        source: None,
    }
}

fn fnv<'a>(bytes: impl Iterator<Item = &'a u8>) -> u64 {
    bytes.fold(0xCBF2_9CE4_8422_2325, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01B3))
}

fn scene() -> Scene {
    Scene {
        train: (0..FRAMES).map(view).collect(),
        held_out: Vec::new(),
        points: None,
        origin: glam::DVec3::ZERO,
        format: SceneFormat::Transforms,
        poses: PoseConvention::of(SceneFormat::Transforms),
        warnings: Vec::new(),
        time_range: Some((0.0, FRAMES as f64 - 1.0)),
    }
}

fn masks(scene: &Scene, options: &MaskOptions) -> Vec<Vec<u8>> {
    let masks = moving_masks(scene, MaskSource::Inferred, options).masks;
    masks.into_iter().map(|mask| mask.expect("a mask")).collect()
}

fn moving(masks: &[Vec<u8>]) -> usize {
    masks.iter().flatten().filter(|value| **value > 0).count()
}

#[test]
fn masks_and_background_at_256_pixels() {
    let scene = scene();
    let masks = masks(&scene, &MaskOptions::default());
    let counts: Vec<usize> = masks.iter().map(|mask| mask.iter().filter(|value| **value > 0).count()).collect();
    assert_eq!(counts, [2380, 2202, 2022, 1841, 1682, 1737, 1928, 2113, 2295, 2474]);
    let camera = &static_cameras(&scene.train)[0];
    let background = background(&scene.train, camera, &MaskOptions::default()).expect("a background");
    assert_eq!(
        [fnv(masks.iter().flatten()), fnv(background.image.data.iter())],
        [14_349_288_528_572_314_047, 6_818_621_504_075_734_124]
    );
}

/// The shade counts as moving where no shadow is accepted; specks stay or go by their size.
#[test]
fn options_do_what_they_say() {
    let scene = scene();
    let usual = moving(&masks(&scene, &MaskOptions::default()));
    let dark = moving(&masks(&scene, &MaskOptions { shadow: 0.0, ..MaskOptions::default() }));
    // Two thirds of a disc of radius 26 are darker than the noise, in ten frames.
    assert!(dark > usual + 10_000, "{dark} of {usual}");
    let coarse = moving(&masks(&scene, &MaskOptions { speck: 4e-4, ..MaskOptions::default() }));
    assert!(coarse < usual && coarse > usual - 10 * 20, "{coarse} of {usual}");
}

/// Nothing inferred enters the scene.
#[test]
fn a_scene_keeps_what_it_was_given() {
    let scene = scene();
    let before = scene.clone();
    masks(&scene, &MaskOptions::default());
    assert_eq!(scene, before);
    assert!(scene.train.iter().all(|view| view.priors.moving.is_none()));
}

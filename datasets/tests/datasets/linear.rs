//! Photos of more than 8 bits: 16-bit ones keep their levels, those in linear light become sRGB.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes,
    SmallVec, Vec2, WritableImage,
};
use gs_datasets::image_io::encode_exr;
use gs_datasets::light::to_encoded;
use gs_datasets::{LoadOptions, View, check, load};
use image::{DynamicImage, ImageFormat};
use serde_json::json;

use crate::fixtures::{Folder, all, ring_scene};

const SIZE: (usize, usize) = (32, 24);
const PIXELS: usize = 32 * 24;

/// One step of 16 bits.
const STEP: f32 = 1.0 / 65535.0;

/// Three photos, the second of them this file.
fn set(name: &str, bytes: &[u8]) -> Folder {
    let (folder, mut top) = ring_scene(3);
    folder.write(name, bytes);
    top["frames"][1]["file_path"] = json!(name);
    folder.write_json("transforms.json", &top);
    folder
}

fn last(folder: &Folder, options: &LoadOptions) -> View {
    // By name, behind the digits of the others.
    folder.load(options).train.pop().expect("a view")
}

/// An OpenEXR file of these channels.
fn exr(channels: &[(&str, &[f32])]) -> Vec<u8> {
    encode_exr(Path::new("a.exr"), SIZE, channels, None).expect("encoded")
}

/// Light from 0 to 1.25: every fifth pixel is brighter than white.
fn light() -> Vec<f32> {
    (0..PIXELS).map(|pixel| 1.25 * pixel as f32 / (PIXELS - 1) as f32).collect()
}

fn assert_near(view: &View, expected: impl Fn(usize) -> f32, most: f32) {
    for index in 0..3 * PIXELS {
        let (found, wanted) = (view.level(index) / 255.0, expected(index / 3));
        assert!((found - wanted).abs() <= most, "{index}: {found} for {wanted}");
    }
}

#[test]
fn photos_of_16_bits_keep_their_levels() {
    let ramp = |pixel: usize| (85 * pixel) as u16;
    let photo = image::ImageBuffer::from_fn(32, 24, |x, y| image::Rgb([ramp((32 * y + x) as usize); 3]));
    for format in [ImageFormat::Png, ImageFormat::Tiff] {
        let mut bytes = Vec::new();
        DynamicImage::ImageRgb16(photo.clone()).write_to(&mut Cursor::new(&mut bytes), format).expect("encoded");
        let folder = set("images/deep.png", &bytes);
        let view = last(&folder, &all());
        assert_near(&view, |pixel| f32::from(ramp(pixel)) * STEP, STEP);
        let levels = |view: &View| {
            let levels = (0..view.image.data.len()).map(|index| view.level(index).to_bits());
            levels.collect::<std::collections::BTreeSet<_>>().len()
        };
        assert_eq!(levels(&view), PIXELS);
        assert_eq!(levels(&view.reduced(16)), 16 * 12, "the depth stays at a reduced width");
        assert!(check(folder.path(), &all()).to_string().contains("1 photo has more than 8 bits"));
        assert_eq!(folder.load(&all()).train[0].fine, None, "a photo of 8 bits takes no more memory");
        // Two photos of 3 bytes a pixel, one of 6.
        let is_asked = |memory| {
            let scene = load(folder.path(), &LoadOptions { memory: Some(memory), ..all() }).expect("loaded");
            scene.train[0].source.is_some()
        };
        assert_eq!([is_asked(12 * PIXELS), is_asked(12 * PIXELS - 1)], [false, true]);
    }
}

#[test]
fn light_becomes_srgb_and_what_is_brighter_than_white_is_white() {
    let (light, grey) = (light(), [("Y", &light()[..])]);
    for channels in [&[("R", &light[..]), ("G", &light), ("B", &light)][..], &grey[..]] {
        let folder = set("images/a.exr", &exr(channels));
        assert_near(&last(&folder, &all()), |pixel| to_encoded(light[pixel].min(1.0)), STEP);
        let said = check(folder.path(), &all()).to_string();
        assert!(said.contains("1 photo is in linear light and brought to sRGB") && said.contains("20.05 %"), "{said}");
        let whole = LoadOptions { levels: Some([0.0, 1.25]), ..all() };
        assert_near(&last(&folder, &whole), |pixel| to_encoded(light[pixel] / 1.25), STEP);
        let report = check(folder.path(), &whole);
        assert!(report.warnings.is_empty() && report.to_string().contains("in which the loss is taken."), "{report}");
    }
}

#[test]
fn alpha_of_light_is_a_share_of_it() {
    let (half, quarter) = ([0.5; PIXELS], [0.25; PIXELS]);
    let folder = set("images/a.exr", &exr(&[("A", &half), ("R", &quarter), ("G", &quarter), ("B", &quarter)]));
    let white = LoadOptions { background: [1.0; 3], ..all() };
    let view = last(&folder, &white);
    assert_near(&view, |_| to_encoded(0.25 + 0.5), STEP);
    assert_eq!(view.alpha, Some(vec![128; PIXELS]));
}

#[test]
fn radiance_is_read_and_a_description_may_still_name_the_png() {
    let light = light();
    let photo = image::ImageBuffer::from_fn(32, 24, |x, y| image::Rgb([light[(32 * y + x) as usize]; 3]));
    let mut bytes = Vec::new();
    DynamicImage::ImageRgb32F(photo).write_to(&mut Cursor::new(&mut bytes), ImageFormat::Hdr).expect("encoded");
    let folder = set("images/a.hdr", &bytes);
    // Eight bits of mantissa.
    assert_near(&last(&folder, &all()), |pixel| to_encoded(light[pixel].min(1.0)), 1.0 / 256.0);
    let (folder, top) = ring_scene(3);
    std::fs::rename(folder.file("images/01.png"), folder.file("images/01.jpg")).expect("renamed");
    folder.write("images/01.hdr", &bytes);
    std::fs::remove_file(folder.file("images/01.jpg")).expect("removed");
    assert_eq!(folder.scene(&top, &all()).train[1].image_path, folder.file("images/01.hdr"));
}

#[test]
fn photos_that_are_no_light_are_refused() {
    let light = light();
    let mut unknown = light.clone();
    unknown[5] = f32::NAN;
    let colors = |red: &[f32]| exr(&[("R", red), ("G", &light), ("B", &light)]);
    let whole = colors(&light);
    for (bytes, part) in [
        (colors(&unknown), "1 value that is no number"),
        (exr(&[("Z", &light)]), "found Z"),
        (whole[..whole.len() / 2].to_vec(), "a.exr"),
        (whole[..20].to_vec(), "a.exr"),
        (without_channels(), "a.exr"),
        (cropped(), "a data window of 16 x 24"),
    ] {
        set("images/a.exr", &bytes).refused_by_both(&all(), &[part]);
    }
    // Light without an end is white.
    let mut endless = light.clone();
    endless[5] = f32::INFINITY;
    let view = last(&set("images/a.exr", &colors(&endless)), &all());
    assert_eq!(view.image.data[15], 255);
}

fn channels(width: usize, height: usize, names: &[&str]) -> Layer<AnyChannels<FlatSamples>> {
    let values = || FlatSamples::F32(vec![0.5; width * height]);
    let list: SmallVec<[_; 4]> = names.iter().map(|name| AnyChannel::new(*name, values())).collect();
    Layer::new(Vec2(width, height), LayerAttributes::default(), Encoding::UNCOMPRESSED, AnyChannels::sort(list))
}

/// Pixels for a half of the image.
fn cropped() -> Vec<u8> {
    let window = ImageAttributes::new(IntegerBounds::from_dimensions(Vec2(32, 24)));
    let image = Image::new(window, channels(16, 24, &["R", "G", "B"]));
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).expect("encoded");
    bytes.into_inner()
}

/// A list of channels that ends before the first one: its length is 1, for the zero at the end.
fn without_channels() -> Vec<u8> {
    let light = light();
    let bytes = exr(&[("R", &light)]);
    let word = b"chlist\0";
    let at = bytes.windows(word.len()).position(|part| part == word).expect("a list") + word.len();
    let length = u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
    [&bytes[..at], &1_u32.to_le_bytes(), &[0], &bytes[at + 4 + length..]].concat()
}

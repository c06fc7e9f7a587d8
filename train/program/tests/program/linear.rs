//! Photos in linear light train as those that a display shows.

use std::fs;
use std::path::Path;

use gs_datasets::image_io::{write_exr, write_png};
use gs_datasets::light::to_linear;

use crate::common;

/// Replaces the photos of a set by opaque ones, on black: in bytes, or in linear light.
fn rewrite(scene: &Path, is_linear: bool) {
    let folders = ["train", "test"].map(|folder| fs::read_dir(scene.join(folder)).expect("a folder"));
    for path in folders.into_iter().flatten().map(|entry| entry.expect("a file").path()) {
        let photo = image::open(&path).expect("a photo").into_rgba8();
        let (width, height) = (photo.width() as usize, photo.height() as usize);
        let level =
            |pixel: &image::Rgba<u8>, channel: usize| (u16::from(pixel.0[channel]) * u16::from(pixel.0[3]) / 255) as u8;
        if !is_linear {
            let data: Vec<u8> = photo.pixels().flat_map(|pixel| [0, 1, 2].map(|c| level(pixel, c))).collect();
            write_png(&path, width, height, &data).expect("written");
            continue;
        }
        let plane = |c: usize| -> Vec<f32> {
            photo.pixels().map(|pixel| to_linear(f32::from(level(pixel, c)) / 255.0)).collect()
        };
        let (red, green, blue) = (plane(0), plane(1), plane(2));
        let channels = [("R", &red[..]), ("G", &green), ("B", &blue)];
        write_exr(&path.with_extension("exr"), width, height, &channels).expect("written");
        fs::remove_file(&path).expect("removed");
    }
}

#[test]
fn photos_in_linear_light_train_as_their_pngs() {
    let temporary = tempfile::tempdir().expect("a folder");
    let psnr = |name: &str, is_linear: bool| {
        let folder = temporary.path().join(name);
        let scene = common::tiny_scene(&folder);
        rewrite(&scene, is_linear);
        let job = common::job(&scene, &folder.join("run"), &common::config(60, &[]));
        common::finish(&job).last.measured.quality.mean.psnr
    };
    let (bytes, light) = (psnr("bytes", false), psnr("light", true));
    // The photos differ by a 500th of a byte's step.
    assert!(bytes > 10.0 && (bytes - light).abs() < 0.05, "{bytes} dB of PNG, {light} dB of OpenEXR");
}

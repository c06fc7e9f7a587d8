//! PLY files of other programs: compressed ones, harmonics of degree 4, and the comment that says how to draw.

use std::fs;
use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::ply::{SplatRenderMode, read_ply, read_ply_scene, write_ply_as};
use gs_burn::{Gaussians, device::select};

fn device() -> Device {
    select("auto").expect("a backend")
}

fn values<const D: usize>(tensor: &Tensor<D>) -> Vec<f64> {
    tensor.to_data().iter::<f64>().collect()
}

fn header_len(bytes: &[u8]) -> usize {
    let end = b"end_header\n";
    bytes.windows(end.len()).position(|window| window == end).expect("a header") + end.len()
}

#[track_caller]
fn assert_refused(path: &Path, bytes: &[u8], message: &str) {
    fs::write(path, bytes).expect("written");
    let error = read_ply(path, &device()).expect_err("refused").to_string();
    assert!(error.contains(message) && error.contains("scene.ply"), "{error}");
}

/// The layout of 3DGS with harmonics of degree 4, and one vertex.
fn header_of_degree_4() -> String {
    let fixed = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"];
    let names = fixed.into_iter().chain(["rot_0", "rot_1", "rot_2", "rot_3"]).map(str::to_owned);
    let names = names.chain((0..72).map(|k| format!("f_rest_{k}")));
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{properties}end_header\n")
}

/// A vertex of degree 4 whose harmonics count up: of each channel's 24 the first 15 stay.
#[test]
fn harmonics_of_degree_4_are_cut() {
    let folder = tempfile::tempdir().expect("no error");
    let path = folder.path().join("scene.ply");
    let mut bytes = header_of_degree_4().into_bytes();
    let numbers = (0..14).map(|_| 0.5).chain((0..72).map(|k| k as f32));
    numbers.for_each(|x: f32| bytes.extend(x.to_le_bytes()));
    fs::write(&path, bytes).expect("no error");
    let scene = read_ply_scene(&path, &device()).expect("no error");
    assert_eq!((scene.gaussians.sh_degree(), scene.sh_degree), (3, 4));
    let sh = values(&scene.gaussians.sh.val());
    assert_eq!(sh.len(), 48);
    assert_eq!((&sh[3..6], &sh[45..48]), (&[0.0, 24.0, 48.0][..], &[14.0, 38.0, 62.0][..]));
}

#[test]
fn the_render_mode_comes_back() {
    let tensor = |values: &[f32]| TensorData::new(values.to_vec(), [1, values.len()]);
    let gaussians = Gaussians::from_tensors(
        Tensor::from_data(tensor(&[1.0, 2.0, 3.0]), &device()),
        Tensor::from_data(tensor(&[1.0, 0.0, 0.0, 0.0]), &device()),
        Tensor::from_data(tensor(&[-1.0; 3]), &device()),
        Tensor::from_data(TensorData::new(vec![0.5_f32], [1]), &device()),
        Tensor::from_data(TensorData::new(vec![0.5_f32; 3], [1, 1, 3]), &device()),
    );
    let folder = tempfile::tempdir().expect("no error");
    let path = folder.path().join("scene.ply");
    for mode in [None, Some(SplatRenderMode::Default), Some(SplatRenderMode::Mip)] {
        write_ply_as(&path, &gaussians, mode, [0.0; 3]).expect("no error");
        assert_eq!(read_ply_scene(&path, &device()).expect("no error").render_mode, mode);
    }
    let bytes = fs::read(&path).expect("no error");
    let text = String::from_utf8_lossy(&bytes).into_owned();
    assert!(text.contains("comment SplatRenderMode: mip\n"));
}

/// Two Gaussians by hand: the ends of their chunk's ranges, a turn by 180 degrees about x, and harmonics at 0, 128 and
/// 255.
#[test]
fn compressed_files_are_read() {
    let folder = tempfile::tempdir().expect("no error");
    let path = folder.path().join("scene.ply");
    let bytes = compressed();
    fs::write(&path, &bytes).expect("no error");
    let scene = read_ply_scene(&path, &device()).expect("no error");
    assert_eq!((scene.gaussians.len(), scene.sh_degree), (2, 1));
    let g = &scene.gaussians;
    assert_eq!(values(&g.means.val()), [-1.0, -2.0, -3.0, 1.0, 2.0, 3.0]);
    assert_eq!(values(&g.log_scales.val()), [-5.0, -5.0, -5.0, 0.0, 0.0, 0.0]);
    // Ten bits have no exact middle: 511 / 1023 - 0.5 is -0.0005.
    let quats = values(&g.quats.val());
    assert!((quats[0] - 1.0).abs() < 1e-3 && (quats[5] - 1.0).abs() < 1e-3 && quats[1].abs() < 1e-3, "{quats:?}");
    let opacities = values(&g.opacity_logits.val());
    assert!(opacities[0] < -6.0 && opacities[0].is_finite() && opacities[1] > 6.0 && opacities[1].is_finite());
    let sh = values(&g.sh.val());
    assert!((sh[0] - 1.772).abs() < 1e-3 && (sh[1] + 1.772).abs() < 1e-3, "{sh:?}");
    assert_eq!(&sh[3..6], [-4.0, 0.015625, 4.0], "red, green and blue of the first coefficient");
    for length in (0..bytes.len()).step_by(13).chain([bytes.len() - 1]) {
        fs::write(&path, &bytes[..length]).expect("no error");
        assert!(read_ply(&path, &device()).is_err(), "{length} bytes");
    }
    let header = String::from_utf8_lossy(&bytes[..header_len(&bytes)]).into_owned();
    let with = |from: &str, to: &str| {
        [header.replacen(from, to, 1).into_bytes(), bytes[header_len(&bytes)..].to_vec()].concat()
    };
    assert_refused(&path, &with("vertex 2", "vertex 3"), "cut short");
    assert_refused(&path, &with("chunk 1", "chunk 0"), "chunks of 256");
    assert_refused(&path, &with("sh 2", "sh 1"), "harmonics");
    assert_refused(&path, &with("vertex 2", "vertex 20000000000"), "at most");
    assert_refused(&path, &with("packed_scale", "packed_scales"), "`packed_scale`");
    assert_refused(&path, &with("binary_little_endian", "ascii"), "in binary");
}

fn compressed() -> Vec<u8> {
    let ranges: String = ["x", "y", "z", "scale_x", "scale_y", "scale_z"]
        .iter()
        .map(|name| format!("property float min_{name}\nproperty float max_{name}\n"))
        .collect();
    let words: String = ["position", "rotation", "scale", "color"]
        .iter()
        .map(|name| format!("property uint packed_{name}\n"))
        .collect();
    let harmonics: String = (0..9).map(|k| format!("property uchar f_rest_{k}\n")).collect();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk 1\n{ranges}element vertex 2\n{words}element sh 2\n{harmonics}\
         end_header\n"
    );
    let mut bytes = header.into_bytes();
    [-1.0_f32, 1.0, -2.0, 2.0, -3.0, 3.0, -5.0, 0.0, -5.0, 0.0, -5.0, 0.0]
        .iter()
        .for_each(|x| bytes.extend(x.to_le_bytes()));
    let middle = 511 << 20 | 511 << 10 | 511;
    [0, middle, 0, 0xff00_8000, u32::MAX, 1 << 30 | middle, u32::MAX, 0x0000_00ff]
        .iter()
        .for_each(|word: &u32| bytes.extend(word.to_le_bytes()));
    bytes.extend([0, 128, 128, 128, 128, 128, 255, 128, 128].repeat(2));
    bytes
}

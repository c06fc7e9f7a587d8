//! PLY files of other programs: compressed ones, and harmonics of degree 4.

use super::*;

/// A vertex of degree 4 whose harmonics count up: of each channel's 24 the first 15 stay.
#[test]
fn harmonics_of_degree_4_are_cut() {
    let (_folder, path) = place();
    let mut bytes = header_of_degree(4).replace("vertex 0", "vertex 1").into_bytes();
    let numbers = (0..14).map(|_| 0.5).chain((0..72).map(|k| k as f32));
    numbers.for_each(|x: f32| bytes.extend(x.to_le_bytes()));
    fs::write(&path, bytes).unwrap();
    let scene = read(&path).unwrap();
    assert_eq!((scene.splats.degree, scene.sh_degree), (3, 4));
    let sh = &scene.splats.sh;
    assert_eq!((sh.len(), sh[1], sh[15]), (16, [0.0, 24.0, 48.0], [14.0, 38.0, 62.0]));
}

/// Two Gaussians by hand: the ends of their chunk's ranges, a turn by 180 degrees about x, and harmonics at 0, 128 and
/// 255.
#[test]
fn compressed_files_are_read() {
    let (_folder, path) = place();
    let bytes = compressed();
    fs::write(&path, &bytes).unwrap();
    let scene = read(&path).unwrap();
    let g = &scene.splats;
    assert_eq!((g.len(), scene.sh_degree), (2, 1));
    assert_eq!(g.means, [[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]]);
    assert_eq!(g.log_scales, [[-5.0; 3], [0.0; 3]]);
    // Ten bits have no exact middle: 511 / 1023 - 0.5 is -0.0005.
    let quats = g.quats.as_flattened();
    assert!((quats[0] - 1.0).abs() < 1e-3 && (quats[5] - 1.0).abs() < 1e-3 && quats[1].abs() < 1e-3, "{quats:?}");
    let opacities = &g.opacity_logits;
    assert!(opacities[0] < -6.0 && opacities[0].is_finite() && opacities[1] > 6.0 && opacities[1].is_finite());
    let sh = &g.sh;
    assert!((sh[0][0] - 1.772).abs() < 1e-3 && (sh[0][1] + 1.772).abs() < 1e-3, "{sh:?}");
    assert_eq!(sh[1], [-4.0, 0.015625, 4.0], "red, green and blue of the first coefficient");
    for length in (0..bytes.len()).step_by(13).chain([bytes.len() - 1]) {
        fs::write(&path, &bytes[..length]).unwrap();
        assert!(read(&path).is_err(), "{length} bytes");
    }
    let with = |from: &str, to: &str| with(&bytes, from, to);
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
        "ply\nformat binary_little_endian 1.0\nelement chunk 1\n{ranges}element vertex 2\n{words}element sh \
         2\n{harmonics}\
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

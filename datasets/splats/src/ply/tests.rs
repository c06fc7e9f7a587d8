use std::fs;
use std::path::PathBuf;

use super::*;
use crate::Splats;
use crate::splats::testing::random;

mod formats;

/// A place for a scene, in a folder that disappears.
fn place() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.ply");
    (folder, path)
}

/// Five Gaussians and a place for them.
fn scene(degree: usize) -> (Splats, tempfile::TempDir, PathBuf) {
    let (folder, path) = place();
    (random(5, degree, 30), folder, path)
}

/// Bytes of a written scene of degree 1, for tampering.
fn written() -> (Vec<u8>, tempfile::TempDir, PathBuf) {
    let (splats, folder, path) = scene(1);
    write(&path, &splats).unwrap();
    (fs::read(&path).unwrap(), folder, path)
}

/// The file with a part of its header replaced.
fn with(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let (header, data) = bytes.split_at(header_len(bytes));
    [String::from_utf8_lossy(header).replacen(from, to, 1).as_bytes(), data].concat()
}

fn header_len(bytes: &[u8]) -> usize {
    let end = b"end_header\n";
    bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len()
}

#[track_caller]
fn assert_refused(path: &std::path::Path, bytes: &[u8], message: &str) {
    fs::write(path, bytes).unwrap();
    let error = read(path).unwrap_err().to_string();
    assert!(error.contains(message) && error.contains("scene.ply"), "{error}");
}

#[test]
fn a_scene_comes_back() {
    for degree in 0..=3 {
        let (splats, folder, path) = scene(degree);
        write(&path, &splats).unwrap();
        let back = read(&path).unwrap();
        assert_eq!((&back.splats, back.sh_degree), (&splats, degree));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside the file");
    }
}

#[test]
fn the_layout_is_that_of_3dgs() {
    let (bytes, _folder, _) = written();
    let header = String::from_utf8_lossy(&bytes[..header_len(&bytes)]).into_owned();
    let names: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
    let expected = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 f_rest_0 f_rest_1 f_rest_2 f_rest_3 f_rest_4 f_rest_5 \
                    f_rest_6 f_rest_7 f_rest_8 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    assert_eq!(names.join(" "), expected);
    // f_rest goes channel by channel: f_rest_3 is the first coefficient above degree 0 of green.
    let float = |place: usize| {
        let bytes: [u8; 4] = bytes[header_len(&bytes) + 4 * place..][..4].try_into().unwrap();
        f32::from_le_bytes(bytes)
    };
    assert_eq!(float(9 + 3), random(5, 1, 30).sh[1][1]);
}

#[test]
fn any_encoding_and_order_is_read() {
    let names = ["red", "opacity", "x", "y", "z", "f_dc_2", "f_dc_1", "f_dc_0", "rot_3", "rot_0", "rot_1", "rot_2"];
    let names = names.into_iter().chain(["scale_0", "scale_1", "scale_2"]);
    let numbers: Vec<f64> = (0..30).map(|i| 0.25 * f64::from(i)).collect();
    let header = |format: &str| {
        let types = |name: &str| if name == "red" { "uchar" } else { "double" };
        let properties: String = names.clone().map(|name| format!("property {} {name}\r\n", types(name))).collect();
        format!(
            "ply\r\nformat {format} 1.0\r\ncomment made by hand\r\nelement camera 2\r\nproperty short id\r\n\
             element vertex 2\r\n{properties}element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
        )
    };
    let text: String =
        numbers.chunks(15).map(|row| row.iter().map(|x| format!("{x} ")).collect::<String>() + "\n").collect();
    let binary = |bytes: fn(f64) -> [u8; 8]| {
        let mut data = vec![7_u8; 4];
        for (i, x) in numbers.iter().enumerate() {
            if i % 15 == 0 { data.push(1) } else { data.extend(bytes(*x)) }
        }
        data.extend([9_u8; 5]);
        data
    };
    let files = [
        [header("ascii").into_bytes(), format!("1\n\n2\n{text}3 0 1 1\n").into_bytes()].concat(),
        [header("binary_little_endian").into_bytes(), binary(f64::to_le_bytes)].concat(),
        [header("binary_big_endian").into_bytes(), binary(f64::to_be_bytes)].concat(),
    ];
    let (_folder, path) = place();
    for bytes in files {
        fs::write(&path, bytes).unwrap();
        let scene = read(&path).unwrap().splats;
        assert_eq!(scene.means, [[0.5, 0.75, 1.0], [4.25, 4.5, 4.75]]);
        assert_eq!(scene.quats, [[2.25, 2.5, 2.75, 2.0], [6.0, 6.25, 6.5, 5.75]]);
        assert_eq!(scene.opacity_logits, [0.25, 4.0]);
        assert_eq!(scene.sh, [[1.75, 1.5, 1.25], [5.5, 5.25, 5.0]]);
    }
}

#[test]
fn cut_files_are_refused_at_every_length() {
    let (bytes, _folder, path) = written();
    for len in (0..bytes.len()).step_by(7) {
        fs::write(&path, &bytes[..len]).unwrap();
        assert!(read(&path).is_err(), "{len} bytes");
    }
    assert_refused(&path, &bytes[..bytes.len() - 1], &format!("expected at least {} bytes", bytes.len()));
}

#[test]
fn bad_headers_are_refused() {
    let (bytes, _folder, path) = written();
    let with = |from: &str, to: &str| with(&bytes, from, to);
    assert_refused(&path, &with("ply", "obj"), "which begins with `ply`");
    assert_refused(&path, &with("vertex 5", "vertex 18446744073709551615"), "expected at least");
    assert_refused(&path, &with("vertex 5", "vertex 4000000000"), "expected at least");
    assert_refused(&path, &with("vertex 5", "vertex -1"), "element vertex -1");
    assert_refused(&path, &with("element vertex", "element point"), "element `vertex`");
    assert_refused(&path, &with("float opacity", "float opaque"), "`opacity`");
    assert_refused(&path, &with("float rot_3", "float rot_4"), "`rot_3`");
    assert_refused(&path, &with("float f_rest_8", "float f_rest_9"), "`f_rest_8`");
    assert_refused(&path, &with("float f_rest_8", "float other"), "found 8");
    assert_refused(&path, &with("float nx", "list uchar float nx"), "list `nx`");
    assert_refused(&path, &with("float nx", "half nx"), "property half nx");
    assert_refused(&path, &with("little", "middle"), "binary_middle_endian");
    assert_refused(&path, &[b"ply\n".to_vec(), vec![b'a'; 1 << 20]].concat(), "end_header");
    assert_refused(&path, b"", "end_header");
    let ascii = "ply\nformat ascii 1.0\nelement vertex 99999999\nproperty float x\nend_header\n1\n";
    assert_refused(&path, ascii.replace("float x", "float y").as_bytes(), "`x`");
}

#[test]
fn vertices_that_are_not_finite_are_left_out() {
    let (bytes, folder, path) = written();
    let whole = read(&path).unwrap().splats;
    let mut bad = bytes.clone();
    // Vertex 2, property `x`: 26 floats a vertex.
    let place = header_len(&bytes) + 2 * 26 * 4;
    bad[place..place + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    bad[place + 2 * 26 * 4..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    fs::write(&path, &bad).unwrap();
    let PlyScene { splats, left_out, .. } = read(&path).unwrap();
    assert_eq!(splats, whole.select(&[0, 1, 3]));
    let left_out = left_out.unwrap();
    assert!(left_out.contains("2 of 5 vertices") && left_out.contains("`x` of vertex 2 is NaN"), "{left_out}");
    for vertex in 0..5 {
        bad[header_len(&bytes) + vertex * 26 * 4..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    }
    assert_refused(&path, &bad, "vertex 0: expected a finite number for `x`, found NaN; all 5 vertices");

    let mut scene = random(3, 0, 31);
    scene.quats[1][3] = f32::INFINITY;
    let target = folder.path().join("bad.ply");
    let error = write(&target, &scene).unwrap_err().to_string();
    assert!(error.contains("Gaussian 1: expected a rotation") && error.contains("1 of 3"), "{error}");
    assert!(!target.exists());
}

#[test]
fn a_missing_folder_is_named_and_made() {
    let (splats, folder, _) = scene(0);
    let path = folder.path().join("missing").join("scene.ply");
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("missing"), "{error}");
    write(&path, &splats).unwrap();
    assert_eq!(read(&path).unwrap().splats, splats, "the folder is made");
}

#[test]
fn an_empty_scene_comes_back() {
    let (_folder, path) = place();
    write(&path, &random(0, 2, 32)).unwrap();
    assert_eq!(read(&path).unwrap().splats, random(0, 2, 32));
}

/// The layout of 3DGS with the coefficients of a degree, and no vertex.
fn header_of_degree(degree: usize) -> String {
    let rest = 3 * ((degree + 1).pow(2) - 1);
    let fixed = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"];
    let names = fixed.into_iter().chain(["rot_0", "rot_1", "rot_2", "rot_3"]).map(str::to_owned);
    let names = names.chain((0..rest).map(|k| format!("f_rest_{k}")));
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    format!("ply\nformat binary_little_endian 1.0\nelement vertex 0\n{properties}end_header\n")
}

#[test]
fn a_degree_that_is_not_supported_is_named() {
    let (_folder, path) = place();
    for degree in 0..=3 {
        fs::write(&path, header_of_degree(degree)).unwrap();
        assert_eq!(read(&path).unwrap().splats.degree, degree);
    }
    fs::write(&path, header_of_degree(4)).unwrap();
    let cut = read(&path).unwrap();
    assert_eq!((cut.splats.degree, cut.sh_degree), (3, 4), "degree 4 is cut to 3");
    for degree in [5, 6, 10] {
        let message = format!("SH degree {degree} is not supported (at most 3)");
        assert_refused(&path, header_of_degree(degree).as_bytes(), &message);
    }
}

#[test]
fn control_characters_of_a_header_reach_no_message() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a\u{1b}[31m\nscene.ply");
    let header = header_of_degree(0);
    let text = header.replace("binary_little_endian", "ascii").replace("vertex 0", "vertex 1");
    for bytes in [
        header.replace("float x", "\u{1b}[31m x"),
        header.replace("float x", "list uchar float \u{1b}[31m"),
        header.replace("float x", "float y"),
        text.clone() + &"\u{1b}[31m ".repeat(14),
        text + &"1 ".repeat(LONG),
    ] {
        fs::write(&path, bytes).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(!error.chars().any(char::is_control) && error.len() < 400, "{error:?}");
    }
}

/// Words of a line that is longer than any vertex.
const LONG: usize = 1 << 17;

#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.ply");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for path in [folder.path(), std::path::Path::new("/dev/zero"), &pipe] {
        let error = read(path).unwrap_err().to_string();
        assert!(error.contains("expected a file, found a"), "{error}");
    }
}

/// A sparse file is as long as a header likes, and takes no room.
#[test]
fn a_count_is_bounded_however_long_the_file_is() {
    let (_folder, path) = place();
    for format in ["binary_little_endian", "ascii"] {
        let header = header_of_degree(3).replace("vertex 0", "vertex 20000000000");
        fs::write(&path, header.replace("binary_little_endian", format)).unwrap();
        fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(6 << 40).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("at most 67108864 vertices, found 20000000000"), "{error}");
    }
}

/// Doubles in map coordinates keep their millimetres: positions are local, with an offset of whole units.
#[test]
fn far_doubles_become_local() {
    let (_folder, path) = place();
    let header = header_of_degree(0).replace("vertex 0", "vertex 3").replace("binary_little_endian", "ascii");
    let header =
        ["x", "y", "z"].iter().fold(header, |text, a| text.replace(&format!("float {a}\n"), &format!("double {a}\n")));
    let row = |i: usize| format!("450123.{:03} 5200456.5 300.25 0 0 0 inf -1 -1 -1 1 0 0 0\n", 125 + i);
    fs::write(&path, header + &(0..3).map(row).collect::<String>()).unwrap();
    let scene = read(&path).unwrap().splats;
    assert_eq!(scene.offset, [450_123.0, 5_200_457.0, 300.0]);
    let means = &scene.means;
    assert!(
        (means[0][0] - 0.125).abs() < 1e-6 && (means[2][0] - 0.127).abs() < 1e-6 && means[0][1] == -0.5,
        "{means:?}"
    );
    assert_eq!(scene.opacity_logits, [16.118_f32; 3], "inf is quite opaque");
}

/// The comment comes back to the last digit, beside positions that stay as they were; the length is that of the file.
#[test]
fn an_offset_is_written_and_read() {
    let (splats, _folder, path) = scene(1);
    let offset = [450_123.123_456_789, -5_200_456.1, 1.0 / 3.0];
    for offset in [offset, [0.0; 3]] {
        let splats = Splats { offset, antialiased: Some(true), ..splats.clone() };
        write(&path, &splats).unwrap();
        let back = read(&path).unwrap();
        assert_eq!((back.splats, back.render_mode), (splats.clone(), Some(SplatRenderMode::Mip)));
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes.len(), encoded_len(&splats));
        assert_eq!(
            String::from_utf8_lossy(&bytes).contains("comment SplatOffset: 450123.123456789 -5200456.1 0.333"),
            offset[0] != 0.0
        );
    }
    let (bytes, _folder, _) = written();
    let with = |line: &str| with(&bytes, "element vertex", &format!("comment {line}\nelement vertex"));
    for wrong in
        ["SplatOffset: 1 2", "SplatOffset: 1 2 x", "SplatOffset: nan 0 0", "SplatOffset: 0 0 1e16", "SplatOffset:"]
    {
        assert_refused(&path, &with(wrong), "three numbers up to 1e15 as offset");
    }
    fs::write(&path, with("SplatOffset: 10 20 30")).unwrap();
    let near = read(&path).unwrap().splats;
    assert_eq!(near.offset, [0.0; 3]);
    let (moved, means) = (near.means, splats.means);
    assert!(
        (moved[0][0] - means[0][0] - 10.0).abs() < 1e-5 && (moved[1][2] - means[1][2] - 30.0).abs() < 1e-5,
        "added up"
    );
}

//! Writers of small data sets.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gs_datasets::{Holdout, LoadOptions, Scene, check, load};
use gs_worlds::deblur::{DeblurOptions, write};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A traced world with blur, in a folder of its own.
pub fn written(options: &DeblurOptions) -> Folder {
    let folder = Folder::new();
    write(folder.path(), options, |_, _| {}).expect("written");
    folder
}

/// A folder that disappears with the test.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.file(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        std::fs::write(path, bytes).expect("written");
    }

    pub fn write_json(&self, name: &str, value: &Value) {
        self.write(name, value.to_string());
    }

    /// The data set in the folder.
    #[track_caller]
    pub fn load(&self, options: &LoadOptions) -> Scene {
        load(self.path(), options).expect("loaded")
    }

    /// Writes the description and loads the data set.
    #[track_caller]
    pub fn scene(&self, top: &Value, options: &LoadOptions) -> Scene {
        self.write_json("transforms.json", top);
        self.load(options)
    }

    /// Loading ends with a sentence that holds all of `parts`.
    #[track_caller]
    pub fn refused(&self, options: &LoadOptions, parts: &[&str]) {
        let error = load(self.path(), options).expect_err("refused").to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{parts:?}: {error}");
    }

    /// Loading and checking both refuse the data set, with sentences that hold all of `parts`.
    #[track_caller]
    pub fn refused_by_both(&self, options: &LoadOptions, parts: &[&str]) {
        self.refused(options, parts);
        let report = check(self.path(), options);
        assert!(!report.is_ok() && parts.iter().all(|part| report.to_string().contains(part)), "{parts:?}: {report}");
    }

    /// An RGB image of one colour that depends on the name, so that images differ.
    pub fn photo(&self, name: &str, width: usize, height: usize) {
        let tint = name.bytes().fold(17_u8, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte));
        self.rgb(name, width, height, |x, y| [tint, (x * 7 % 256) as u8, (y * 5 % 256) as u8]);
    }

    pub fn rgb(&self, name: &str, width: usize, height: usize, color: impl Fn(usize, usize) -> [u8; 3]) {
        self.pixels(name, width, height, color);
    }

    pub fn rgba(&self, name: &str, width: usize, height: usize, color: impl Fn(usize, usize) -> [u8; 4]) {
        self.pixels(name, width, height, color);
    }

    pub fn grey(&self, name: &str, width: usize, height: usize, level: impl Fn(usize, usize) -> u8) {
        self.pixels(name, width, height, |x, y| [level(x, y)]);
    }

    fn pixels<const N: usize>(&self, name: &str, width: usize, height: usize, color: impl Fn(usize, usize) -> [u8; N]) {
        let data: Vec<u8> = (0..width * height).flat_map(|i| color(i % width, i / width)).collect();
        let kind = [ExtendedColorType::L8, ExtendedColorType::Rgb8, ExtendedColorType::Rgba8][N / 2];
        let mut png = Vec::new();
        PngEncoder::new(&mut png).write_image(&data, width as u32, height as u32, kind).expect("encoded");
        self.write(name, png);
    }
}

/// Rows of a camera at `eye` that looks at `target` with z up, OpenGL axes, as transforms.json stores it.
pub fn look_at(eye: DVec3, target: DVec3) -> Value {
    let back = (eye - target).normalize();
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    rows(DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0)))
}

/// Rows of a matrix.
pub fn rows(matrix: DMat4) -> Value {
    json!([0, 1, 2, 3].map(|row| matrix.row(row).to_array()))
}

/// The `index`-th of a ring of cameras around the origin.
pub fn ring(index: usize) -> Value {
    let turn = index as f64 * 0.9;
    look_at(DVec3::new(4.0 * turn.cos(), 4.0 * turn.sin(), 1.0), DVec3::ZERO)
}

/// A folder with `count` photos of 32 x 24 pixels, images/00.png and on, and the JSON that describes them.
pub fn ring_scene(count: usize) -> (Folder, Value) {
    let folder = Folder::new();
    let frames: Vec<Value> = (0..count)
        .map(|i| {
            folder.photo(&format!("images/{i:02}.png"), 32, 24);
            json!({ "file_path": format!("images/{i:02}.png"), "transform_matrix": ring(i) })
        })
        .collect();
    (folder, json!({ "fl_x": 30.0, "fl_y": 31.0, "cx": 15.5, "cy": 12.5, "w": 32, "h": 24, "frames": frames }))
}

/// Puts a camera at `scale` times its position, and `by` further.
pub fn move_camera(frame: &mut Value, scale: f64, by: [f64; 3]) {
    for (row, by) in by.into_iter().enumerate() {
        let value = &mut frame["transform_matrix"][row][3];
        *value = json!(scale * value.as_f64().expect("a number") + by);
    }
}

/// Text of a PLY file of points with coordinates of the type `kind`.
pub fn cloud(kind: &str, points: &[[f64; 3]]) -> String {
    let properties = ["x", "y", "z"].map(|axis| format!("property {kind} {axis}\n")).concat();
    let rows: String = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    format!("ply\nformat ascii 1.0\nelement vertex {}\n{properties}end_header\n{rows}", points.len())
}

/// Names of views.
pub fn names(views: &[gs_datasets::View]) -> Vec<&str> {
    views.iter().map(|view| view.name.as_str()).collect()
}

/// Bytes of a NumPy file: `descr` like "<f4", `data` in the order the file holds it.
pub fn npy(version: u8, descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    match version {
        1 => bytes.extend((header.len() as u16).to_le_bytes()),
        _ => bytes.extend((header.len() as u32).to_le_bytes()),
    }
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

/// A version 1 file of little-endian f32.
pub fn npy_f32(shape: &str, values: &[f32]) -> Vec<u8> {
    npy(1, "<f4", false, shape, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
}

/// `cameras` static cameras of 8 x 6 pixels at `times` times 0, 0.1 and on: train/cam00/0000.png and on; the
/// description.
pub fn rig(folder: &Folder, part: &str, first: usize, cameras: usize, times: usize) -> Value {
    let mut frames = Vec::new();
    for camera in first..first + cameras {
        for time in 0..times {
            let name = format!("{part}/cam{camera:02}/{time:04}.png");
            folder.photo(&name, 8, 6);
            frames.push(json!({
                "file_path": name,
                "time": time as f64 / 10.0,
                "camera_id": format!("cam{camera:02}"),
                "transform_matrix": ring(camera),
            }));
        }
    }
    json!({ "camera_angle_x": 0.8, "w": 8, "h": 6, "frames": frames })
}

/// The views that figures are quoted on; none where none is held out.
pub fn held_out(scene: &Scene) -> &[gs_datasets::View] {
    scene.reported().map_or(&[], |split| &split.views)
}

/// Options with which all views train.
pub fn all() -> LoadOptions {
    LoadOptions { holdout: Holdout::None, ..LoadOptions::default() }
}

/// Loading said something that holds all of `parts`, in one sentence.
#[track_caller]
pub fn warned(warnings: &[String], parts: &[&str]) {
    let says = |text: &String| parts.iter().all(|part| text.contains(part));
    assert!(warnings.iter().any(says), "{parts:?}: {warnings:?}");
}

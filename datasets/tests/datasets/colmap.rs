//! COLMAP models: writers of both encodings from one set of structs, and what loading them gives.

use std::fmt::Write;

use glam::{DQuat, DVec3};
use gs_datasets::{Holdout, LoadOptions, MaskUse, Scene, SceneFormat, load};

use crate::fixtures::{Folder, names};

pub struct Camera {
    pub id: u32,
    pub model: i32,
    pub width: u64,
    pub height: u64,
    pub params: Vec<f64>,
}

pub struct Image {
    pub id: u32,
    /// w x y z, world to camera.
    pub q: [f64; 4],
    pub t: [f64; 3],
    pub camera_id: u32,
    pub name: String,
    pub seen: Vec<(f64, f64, Option<u64>)>,
}

pub struct Point {
    pub id: u64,
    pub position: [f64; 3],
    pub color: [u8; 3],
}

pub struct Model {
    pub cameras: Vec<Camera>,
    pub images: Vec<Image>,
    pub points: Vec<Point>,
}

const MODEL_NAMES: [&str; 7] =
    ["SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV"];

impl Model {
    pub fn write_text(&self, folder: &Folder, below: &str) {
        let mut cameras = "# Camera list\n".to_string();
        for camera in &self.cameras {
            let name = MODEL_NAMES[camera.model as usize];
            write!(cameras, "{} {name} {} {}", camera.id, camera.width, camera.height).expect("text");
            camera.params.iter().for_each(|value| write!(cameras, " {value:?}").expect("text"));
            cameras.push('\n');
        }
        let mut images = "# Image list with two lines of data per image:\n".to_string();
        for image in &self.images {
            let ([w, x, y, z], [a, b, c]) = (image.q, image.t);
            writeln!(
                images,
                "{} {w:?} {x:?} {y:?} {z:?} {a:?} {b:?} {c:?} {} {}",
                image.id, image.camera_id, image.name
            )
            .expect("text");
            let seen: Vec<String> = image
                .seen
                .iter()
                .map(|(x, y, id)| format!("{x:?} {y:?} {}", id.map_or("-1".to_string(), |id| id.to_string())))
                .collect();
            writeln!(images, "{}", seen.join(" ")).expect("text");
        }
        let mut points = "# 3D point list\n".to_string();
        for Point { id, position: [x, y, z], color: [r, g, b] } in &self.points {
            writeln!(points, "{id} {x:?} {y:?} {z:?} {r} {g} {b} 0.5 3 0 7 1").expect("text");
        }
        folder.write(&format!("{below}/cameras.txt"), cameras);
        folder.write(&format!("{below}/images.txt"), images);
        folder.write(&format!("{below}/points3D.txt"), points);
    }

    pub fn write_binary(&self, folder: &Folder, below: &str) {
        let [cameras, images, points] = self.binary();
        folder.write(&format!("{below}/cameras.bin"), cameras);
        folder.write(&format!("{below}/images.bin"), images);
        folder.write(&format!("{below}/points3D.bin"), points);
    }

    pub fn binary(&self) -> [Vec<u8>; 3] {
        let floats =
            |out: &mut Vec<u8>, values: &[f64]| values.iter().for_each(|value| out.extend(value.to_le_bytes()));
        let mut cameras = (self.cameras.len() as u64).to_le_bytes().to_vec();
        for camera in &self.cameras {
            cameras.extend(camera.id.to_le_bytes());
            cameras.extend(camera.model.to_le_bytes());
            cameras.extend(camera.width.to_le_bytes());
            cameras.extend(camera.height.to_le_bytes());
            floats(&mut cameras, &camera.params);
        }
        let mut images = (self.images.len() as u64).to_le_bytes().to_vec();
        for image in &self.images {
            images.extend(image.id.to_le_bytes());
            floats(&mut images, &image.q);
            floats(&mut images, &image.t);
            images.extend(image.camera_id.to_le_bytes());
            images.extend(image.name.as_bytes());
            images.push(0);
            images.extend((image.seen.len() as u64).to_le_bytes());
            for (x, y, id) in &image.seen {
                floats(&mut images, &[*x, *y]);
                images.extend(id.unwrap_or(u64::MAX).to_le_bytes());
            }
        }
        let mut points = (self.points.len() as u64).to_le_bytes().to_vec();
        for point in &self.points {
            points.extend(point.id.to_le_bytes());
            floats(&mut points, &point.position);
            points.extend(point.color);
            floats(&mut points, &[0.5]);
            points.extend(2_u64.to_le_bytes());
            for number in [3_u32, 0, 7, 1] {
                points.extend(number.to_le_bytes());
            }
        }
        [cameras, images, points]
    }
}

/// Four images of two cameras with ids that have gaps, in an order that is not by name, one without observations, one
/// with a space in its name, one in a sub-folder; and their photos.
pub fn example(folder: &Folder) -> Model {
    let points: Vec<Point> = (0..20)
        .map(|i| Point {
            id: 5 + 3 * i,
            position: [0.3 * i as f64 - 3.0, (i as f64).sin(), 6.0 + (i as f64 * 1.7).cos()],
            color: [i as u8, 200, 255 - i as u8],
        })
        .collect();
    let names = ["b.png", "left/a.png", "a photo.png", "z.png"];
    let images = names
        .iter()
        .enumerate()
        .map(|(i, name)| {
            let rotation = DQuat::from_euler(glam::EulerRot::XYZ, 0.05 * i as f64, -0.1 * i as f64, 0.02);
            let t = DVec3::new(0.2 * i as f64, -0.1, 0.3);
            let seen = points.iter().filter(|_| i != 3).map(|point| {
                let c = rotation * DVec3::from_array(point.position) + t;
                (40.0 * c.x / c.z + 20.0, 41.0 * c.y / c.z + 15.0, Some(point.id))
            });
            folder.photo(&format!("images/{name}"), 40, 30);
            Image {
                id: 90 - 7 * i as u32,
                // Not quite normalised, as in real files.
                q: [rotation.w, rotation.x, rotation.y, rotation.z].map(|value| value * 1.0001),
                t: t.to_array(),
                camera_id: if i == 3 { 12 } else { 4 },
                name: (*name).to_string(),
                seen: seen.chain((i == 0).then_some((1.0, 2.0, None))).collect(),
            }
        })
        .collect();
    let camera = |id, model, params: &[f64]| Camera { id, model, width: 40, height: 30, params: params.to_vec() };
    let cameras =
        vec![camera(12, 0, &[40.0, 20.0, 15.0]), camera(4, 1, &[40.0, 41.0, 20.0, 15.0]), camera(77, 5, &[1.0; 8])];
    Model { cameras, images, points }
}

fn load_all(folder: &Folder) -> Scene {
    load(folder.path(), &LoadOptions { holdout: Holdout::None, ..LoadOptions::default() }).expect("loaded")
}

#[test]
fn text_and_binary_give_equal_scenes_in_every_place() {
    for (text, binary) in [("sparse/0", "sparse/0"), ("sparse", "colmap/sparse/0"), ("dense/sparse", "sparse_bin/0")] {
        let (one, two) = (Folder::new(), Folder::new());
        example(&one).write_text(&one, text);
        example(&two).write_binary(&two, binary);
        let (one, two) = (load_all(&one), load_all(&two));
        assert_eq!((one.format, two.format), (SceneFormat::ColmapText, SceneFormat::ColmapBinary));
        assert_eq!(names(&one.train), ["a photo", "b", "left/a", "z"]);
        for (a, b) in one.train.iter().zip(&two.train) {
            assert_eq!((&a.name, a.c2w, a.intrinsics, &a.image), (&b.name, b.c2w, b.intrinsics, &b.image));
        }
        assert_eq!(one.points, two.points);
        assert_eq!(one.points.expect("points").len(), 20);
        assert!(one.warnings.is_empty() && two.warnings.is_empty());
    }
}

#[test]
fn points_project_where_images_see_them() {
    let folder = Folder::new();
    let model = example(&folder);
    model.write_binary(&folder, "sparse/0");
    let scene = load_all(&folder);
    for view in &scene.train {
        let image = model.images.iter().find(|image| image.name == format!("{}.png", view.name)).expect("an image");
        for ((x, y, _), point) in image.seen.iter().zip(&model.points) {
            let c = view.c2w.inverse().transform_point3(DVec3::from_array(point.position));
            let k = view.intrinsics;
            let (u, v) = (k.fx * c.x / c.z + k.cx, k.fy * c.y / c.z + k.cy);
            assert!((u - x).hypot(v - y) < 1e-9, "{}: ({u}, {v}) against ({x}, {y})", view.name);
        }
    }
}

#[test]
fn a_camera_model_that_is_no_pinhole_is_refused_by_name_if_used() {
    let folder = Folder::new();
    let mut model = example(&folder);
    model.write_text(&folder, "sparse/0");
    load_all(&folder);
    model.images[1].camera_id = 77;
    model.write_text(&folder, "sparse/0");
    let error = load(folder.path(), &LoadOptions::default()).expect_err("fisheye").to_string();
    assert!(
        error.contains("OPENCV_FISHEYE") && error.contains("cameras.txt") && error.contains("SIMPLE_RADIAL"),
        "{error}"
    );
    model.images[1].camera_id = 1000;
    model.write_text(&folder, "sparse/0");
    let error = load(folder.path(), &LoadOptions::default()).expect_err("no camera").to_string();
    assert!(error.contains("camera 1000") && error.contains("images.txt"), "{error}");
}

#[test]
fn images_can_lie_elsewhere_and_be_smaller() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    std::fs::rename(folder.file("images"), folder.file("photos")).expect("moved");
    let error = load(folder.path(), &LoadOptions::default()).expect_err("no images").to_string();
    assert!(error.contains("none of the 4 images"), "{error}");
    let options = LoadOptions { images: Some("photos".into()), holdout: Holdout::None, ..LoadOptions::default() };
    assert_eq!(load(folder.path(), &options).expect("loaded").train.len(), 4);
    for name in ["a photo.png", "b.png", "left/a.png"] {
        folder.photo(&format!("images_2/{name}"), 20, 15);
    }
    let options = LoadOptions { images: Some("images_2".into()), ..options };
    let scene = load(folder.path(), &options).expect("loaded");
    assert_eq!((scene.train.len(), scene.train[1].intrinsics.fx, scene.train[1].intrinsics.cy), (3, 20.0, 7.5));
    assert_eq!(scene.warnings.len(), 2, "one image is missing, three are smaller: {:?}", scene.warnings);
    let options = LoadOptions { images: Some("nowhere".into()), ..options };
    assert!(load(folder.path(), &options).expect_err("no folder").to_string().contains("nowhere"));
}

#[test]
fn masks_lie_beside_the_images() {
    let folder = Folder::new();
    example(&folder).write_binary(&folder, "sparse/0");
    folder.grey("masks/b.png.png", 40, 30, |x, _| if x < 10 { 0 } else { 255 });
    folder.grey("masks/left/a.png", 40, 30, |x, _| if x < 10 { 0 } else { 255 });
    let masked: Vec<bool> = load_all(&folder).train.iter().map(|view| view.mask.is_some()).collect();
    assert_eq!(masked, [false, true, true, false]);
    let options = LoadOptions { masks: MaskUse::Ignore, ..LoadOptions::default() };
    assert!(load(folder.path(), &options).expect("loaded").train.iter().all(|view| view.mask.is_none()));
}

#[test]
fn a_missing_second_line_is_noticed() {
    let folder = Folder::new();
    example(&folder).write_text(&folder, "sparse/0");
    let text = std::fs::read_to_string(folder.file("sparse/0/images.txt")).expect("read");
    let headers: Vec<&str> =
        text.lines().enumerate().filter(|(i, _)| *i == 0 || i % 2 == 1).map(|(_, line)| line).collect();
    folder.write("sparse/0/images.txt", headers.join("\n"));
    let error = load(folder.path(), &LoadOptions::default()).expect_err("lines are missing").to_string();
    assert!(error.contains("line 3") && error.contains("observations"), "{error}");
}

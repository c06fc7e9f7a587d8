//! COLMAP models: writers of both encodings from one set of structs.

use std::fmt::Write;

use glam::{DQuat, DVec3};

use crate::fixtures::Folder;

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

const MODEL_NAMES: [&str; 14] = [
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
    "SIMPLE_DIVISION",
    "DIVISION",
];

/// Names of a model's files.
pub const STEMS: [&str; 3] = ["cameras", "images", "points3D"];

fn write_files(folder: &Folder, below: &str, ending: &str, files: [impl AsRef<[u8]>; 3]) {
    for (stem, bytes) in STEMS.into_iter().zip(files) {
        folder.write(&format!("{below}/{stem}.{ending}"), bytes);
    }
}

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
        write_files(folder, below, "txt", [cameras, images, points]);
    }

    pub fn write_binary(&self, folder: &Folder, below: &str) {
        write_files(folder, below, "bin", self.binary());
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
        vec![camera(12, 0, &[40.0, 20.0, 15.0]), camera(4, 1, &[40.0, 41.0, 20.0, 15.0]), camera(77, 13, &[1.0; 5])];
    Model { cameras, images, points }
}

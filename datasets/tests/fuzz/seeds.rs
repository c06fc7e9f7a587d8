//! Small sound data sets, one for each reader.

use gs_datasets::image_io::write_exr;
use serde_json::{Value, json};

use crate::colmap_writer;
use crate::fixtures::{Folder, npy, npy_f32, rig, ring, ring_scene};

/// A data set and its files that are damaged.
pub struct Seed {
    pub name: &'static str,
    pub write: fn() -> Folder,
    pub files: &'static [&'static str],
}

pub const SEEDS: &[Seed] = &[
    Seed { name: "transforms.json", write: ring_of_cameras, files: &["transforms.json"] },
    Seed { name: "transforms.json with priors", write: blurred_video, files: &["transforms.json"] },
    Seed { name: "PLY", write: ring_of_cameras, files: &["text.ply", "little.ply", "big.ply"] },
    Seed { name: "NPY", write: blurred_video, files: &["depth/0.npy", "depth/1.npy"] },
    Seed { name: "EXR", write: blurred_video, files: &["depth/2.exr", "velocity.exr"] },
    Seed {
        name: "COLMAP binary",
        write: binary_model,
        files: &["sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin"],
    },
    Seed {
        name: "COLMAP text",
        write: text_model,
        files: &["sparse/0/cameras.txt", "sparse/0/images.txt", "sparse/0/points3D.txt"],
    },
    Seed {
        name: "COLMAP of several models",
        write: two_models,
        files: &["sparse/0/images.txt", "sparse/1/images.bin", "sparse/1/cameras.bin", "sparse/2/cameras.txt"],
    },
    Seed { name: "LLFF", write: poses_and_cameras, files: &["poses_bounds.npy"] },
    Seed { name: "LLFF of photos", write: poses_and_photos, files: &["poses_bounds.npy"] },
    Seed { name: "RealityScan", write: table_of_cameras, files: &["cameras.csv"] },
    Seed { name: "paths of another machine", write: moved_here, files: &["transforms.json"] },
    Seed { name: "lenses", write: bent_lens, files: &["transforms.json"] },
    Seed { name: "wide lenses", write: fisheye_and_panorama, files: &["transforms.json"] },
    Seed { name: "Panoptic", write: dome, files: &["train_meta.json", "test_meta.json"] },
    Seed { name: "photos", write: ring_of_cameras, files: &["images/00.png", "images/01.jpg", "masks/02.png"] },
    Seed { name: "photos in light", write: ring_in_light, files: &["images/00.exr", "images/01.hdr"] },
];

/// Still photos in linear light.
fn ring_in_light() -> Folder {
    let (folder, top) = ring_scene(3);
    let light: Vec<f32> = (0..32 * 24).map(|i| i as f32 / 600.0).collect();
    let channels = [("A", &light[..]), ("B", &light), ("G", &light), ("R", &light)];
    write_exr(&folder.file("images/00.exr"), 32, 24, &channels).expect("written");
    let photo = image::Rgb32FImage::from_fn(32, 24, |x, y| image::Rgb([light[(32 * y + x) as usize]; 3]));
    photo.save(folder.file("images/01.hdr")).expect("written");
    for name in ["images/00.png", "images/01.png"] {
        std::fs::remove_file(folder.file(name)).expect("removed");
    }
    folder.write_json("transforms.json", &top);
    folder
}

/// Still photos with masks, a JPEG among them, and points in three encodings.
fn ring_of_cameras() -> Folder {
    let (folder, mut top) = ring_scene(4);
    let photo = image::RgbImage::from_fn(32, 24, |x, y| image::Rgb([(x * 8) as u8, (y * 10) as u8, 77]));
    photo.save(folder.file("images/01.jpg")).expect("written");
    top["frames"][1]["file_path"] = json!("images/01.jpg");
    folder.grey("masks/02.png", 32, 24, |x, _| if x < 4 { 0 } else { 255 });
    top["frames"][2]["mask_path"] = json!("masks/02.png");
    top["k1"] = json!(0.01);
    top["train_filenames"] = json!(["images/00.png", "images/01.jpg", "images/02.png"]);
    top["test_filenames"] = json!(["images/03.png"]);
    top["ply_file_path"] = json!("little.ply");
    for (name, bytes) in [("text.ply", ply("ascii")), ("little.ply", ply(LITTLE)), ("big.ply", ply(BIG))] {
        folder.write(name, bytes);
    }
    folder.write_json("transforms.json", &top);
    folder
}

const LITTLE: &str = "binary_little_endian";
const BIG: &str = "binary_big_endian";

fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment by hand\nelement vertex 5\nproperty float x\nproperty double y\nproperty \
         float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 0\n\
         property list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for i in 0..5_u8 {
        let (x, y, z) = (0.5 * f32::from(i), -0.25 * f64::from(i), 1.0 + f32::from(i));
        match format {
            LITTLE => bytes.extend([&x.to_le_bytes()[..], &y.to_le_bytes(), &z.to_le_bytes(), &[i, 2, 3]].concat()),
            BIG => bytes.extend([&x.to_be_bytes()[..], &y.to_be_bytes(), &z.to_be_bytes(), &[i, 2, 3]].concat()),
            _ => bytes.extend(format!("{x} {y} {z} {i} 2 3\n").bytes()),
        }
    }
    bytes
}

/// Blurred frames of two cameras with priors of every kind and truth.
fn blurred_video() -> Folder {
    let folder = Folder::new();
    let mut top = rig(&folder, "train", 0, 2, 3);
    top["exposure"] = json!(0.05);
    top["mask_meaning"] = json!("dynamic");
    top["depth_kind"] = json!("metric_z");
    let depth: Vec<f32> = (0..48).map(|i| 1.0 + i as f32).collect();
    let doubles: Vec<u8> = depth.iter().flat_map(|value| f64::from(*value).to_be_bytes()).collect();
    folder.write("depth/0.npy", npy_f32("(6, 8)", &depth));
    folder.write("depth/1.npy", npy(2, ">f8", true, "(6, 8)", &doubles));
    write_exr(&folder.file("depth/2.exr"), 8, 6, &[("Z", &depth)]).expect("written");
    write_exr(&folder.file("velocity.exr"), 8, 6, &[("X", &depth), ("Y", &depth), ("Z", &depth)]).expect("written");
    folder.grey("moving.png", 8, 6, |x, y| ((x + y) % 2 * 255) as u8);
    for (i, path) in ["depth/0.npy", "depth/1", "depth/2.exr"].into_iter().enumerate() {
        top["frames"][i]["depth_file_path"] = json!(path);
        top["frames"][i]["mask_path"] = json!("moving.png");
        top["frames"][i]["truth"] = json!({ "velocity_path": "velocity.exr", "sharp_path": "train/cam00/0000.png" });
    }
    folder.write_json("transforms.json", &top);
    folder
}

fn binary_model() -> Folder {
    let folder = Folder::new();
    colmap_writer::example(&folder).write_binary(&folder, "sparse/0");
    folder
}

fn text_model() -> Folder {
    let folder = Folder::new();
    colmap_writer::example(&folder).write_text(&folder, "sparse/0");
    folder
}

/// Three models, whose largest is the second; the third has no lines of observations.
fn two_models() -> Folder {
    let folder = Folder::new();
    let mut model = colmap_writer::example(&folder);
    model.write_binary(&folder, "sparse/1");
    model.images.truncate(3);
    model.images.iter_mut().for_each(|image| image.seen.clear());
    model.write_text(&folder, "sparse/2");
    model.images.truncate(2);
    model.write_text(&folder, "sparse/0");
    folder
}

/// Photos whose numbers have no leading zeros.
fn poses_and_photos() -> Folder {
    let folder = Folder::new();
    let mut values = Vec::new();
    for k in 0..12 {
        folder.photo(&format!("images/{k}.png"), 8, 6);
        let x = f64::from(k);
        values.extend([0.0, 1.0, 0.0, x, 6.0, -1.0, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 1.0, 0.0, 9.5, 0.5, 20.0]);
    }
    let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
    folder.write("poses_bounds.npy", npy(1, "<f8", false, "(12, 17)", &bytes));
    folder
}

fn table_of_cameras() -> Folder {
    let folder = Folder::new();
    let mut table = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n".to_string();
    for (name, x) in [("a.png", 1), ("left/b.png", 2), ("c.jpg", 3)] {
        folder.photo(&format!("images/{}", name.replace("jpg", "png")), 8, 6);
        table += &format!("{name},{x},2,3,10,80,0,36,0.01,0,-0.1,0.01,0,0,0.001,0\n");
    }
    folder.write("cameras.csv", table);
    folder
}

/// Absolute paths of Windows and Linux, and a name in another Unicode form.
fn moved_here() -> Folder {
    let (folder, mut top) = ring_scene(3);
    folder.photo("images/m\u{e9}nage.png", 32, 24);
    top["frames"][0]["file_path"] = json!("C:\\scan\\images\\00.png");
    top["frames"][0]["mask_path"] = json!("");
    top["frames"][1]["file_path"] = json!("/home/u/photos/01.png");
    top["frames"][2]["file_path"] = json!("images/me\u{301}nage.png");
    folder.write_json("transforms.json", &top);
    folder
}

/// Every coefficient of a lens.
fn bent_lens() -> Folder {
    let (folder, mut top) = ring_scene(2);
    for (key, value) in [("k1", -0.21), ("k2", 0.08), ("k3", -0.013), ("k4", 0.002), ("p1", 0.0013), ("p2", -0.0021)] {
        top[key] = json!(value);
    }
    folder.write_json("transforms.json", &top);
    folder
}

fn fisheye_and_panorama() -> Folder {
    let (folder, mut top) = ring_scene(2);
    for (key, value) in [("fl_x", 10.0), ("fl_y", 10.5), ("k1", 0.02), ("k2", -0.01), ("k3", 0.002), ("k4", -0.0001)] {
        top[key] = json!(value);
    }
    top["frames"][0]["is_fisheye"] = json!(true);
    top["frames"][1]["camera_model"] = json!("EQUIRECTANGULAR");
    folder.write_json("transforms.json", &top);
    folder
}

/// Entry of a camera's OpenGL matrix.
fn entry(matrix: &Value, row: usize, column: usize) -> f64 {
    matrix[row][column].as_f64().expect("a number")
}

/// Frames of two cameras, with LLFF's rows: down, right and back.
fn poses_and_cameras() -> Folder {
    let folder = Folder::new();
    rig(&folder, ".", 0, 2, 2);
    let mut values = Vec::new();
    for camera in 0..2 {
        let m = ring(camera);
        for (row, last) in [6.0, 8.0, 9.5].into_iter().enumerate() {
            values.extend([-entry(&m, row, 1), entry(&m, row, 0), entry(&m, row, 2), entry(&m, row, 3), last]);
        }
        values.extend([1.0, 9.0]);
    }
    let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
    folder.write("poses_bounds.npy", npy(1, "<f8", false, "(2, 17)", &bytes));
    folder
}

/// World to camera, OpenCV axes.
fn w2c(camera: usize) -> Value {
    let m = ring(camera);
    let rows = [(0, 1.0), (1, -1.0), (2, -1.0)].map(|(axis, sign)| {
        let r = [0, 1, 2].map(|row| sign * entry(&m, row, axis));
        let t = -(0..3).map(|row| r[row] * entry(&m, row, 3)).sum::<f64>();
        vec![r[0], r[1], r[2], t]
    });
    json!([rows[0], rows[1], rows[2], [0, 0, 0, 1]])
}

/// Two cameras that train and one that is held out, at two times.
fn dome() -> Folder {
    let folder = Folder::new();
    for (name, cameras) in [("train_meta.json", vec![0, 1]), ("test_meta.json", vec![2])] {
        let over = |value: &dyn Fn(usize, usize) -> Value| -> Vec<Vec<Value>> {
            (0..2).map(|t| cameras.iter().map(|c| value(t, *c)).collect()).collect()
        };
        for c in &cameras {
            for t in 0..2 {
                folder.photo(&format!("ims/{c}/{t:06}.png"), 8, 6);
                folder.grey(&format!("seg/{c}/{t:06}.png"), 8, 6, |x, _| if x < 3 { 255 } else { 0 });
            }
        }
        let meta = json!({
            "w": 8,
            "h": 6,
            "fn": over(&|t, c| json!(format!("{c}/{t:06}.png"))),
            "cam_id": over(&|_, c| json!(c)),
            "k": over(&|_, _| json!([[9.5, 0, 4], [0, 9.5, 3], [0, 0, 1]])),
            "w2c": over(&|_, c| w2c(c)),
        });
        folder.write_json(name, &meta);
    }
    folder
}

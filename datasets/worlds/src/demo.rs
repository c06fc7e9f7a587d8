//! [`demo_scene`]: the world photographed from a dome of cameras, written as a Blender data set with points.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use glam::{DMat4, DVec3};
use gs_base::{FileError, write_atomic};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde_json::json;

use super::random::gaussian;
use super::world::World;
use crate::tracer::shape::Ray;
use gs_datasets::DatasetError;
use gs_datasets::image_io::write_png;

/// Horizontal angle of view, radians.
const ANGLE_X: f64 = 0.85;

/// Cameras stand on a dome of this radius, metres, and look at [`TARGET`].
const DISTANCE: f64 = 3.9;
const TARGET: DVec3 = DVec3::new(0.0, 0.0, 0.3);

/// Lowest and highest camera above the floor, radians.
const ELEVATION: (f64, f64) = (0.25, 1.05);

/// Rays along each side of a pixel.
const SUBPIXELS: usize = 3;

/// Standard deviation of the points' places, metres: about what structure from motion leaves in such a scene.
const POINT_NOISE: f64 = 0.01;

/// Options of [`demo_scene`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DemoOptions {
    /// Views to learn from, 1 to 10 000.
    pub train_views: usize,
    /// Views held out, at most 10 000.
    pub test_views: usize,
    /// Image width, 1 to 8192 pixels.
    pub width: usize,
    /// Image height, 1 to 8192 pixels.
    pub height: usize,
    /// Points to start from, at most 10 million; 0 writes none.
    pub points: usize,
    /// Seed of all random draws. The same options write the same bytes.
    pub seed: u64,
}

impl Default for DemoOptions {
    fn default() -> Self {
        Self { train_views: 40, test_views: 5, width: 160, height: 120, points: 2000, seed: 0 }
    }
}

/// Writes a small scene to `dir`: `transforms_train.json` and `transforms_test.json`, RGBA images (transparent where
/// there is nothing), and `points3d.ply` with sparse, noisy, coloured surface points as structure from motion finds
/// them.
///
/// A checkered floor, a box and four spheres under a soft lamp. All surfaces are matt, so colours do not depend on the
/// view; edges are anti-aliased.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn demo_scene(dir: &Path, options: &DemoOptions) -> Result<(), DatasetError> {
    check(dir, options)?;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let world = World::demo();
    let points = ply(&world, options.points, &mut rng);
    for (part, count) in [("train", options.train_views), ("test", options.test_views)] {
        let turn = rng.random_range(0.0..TAU);
        let cameras: Vec<DMat4> = (0..count).map(|i| camera(i, count, turn)).collect();
        let written: Vec<Result<(), FileError>> = cameras
            .par_iter()
            .enumerate()
            .map(|(i, c2w)| {
                let pixels = photograph(&world, c2w, options);
                write_png(&dir.join(part).join(format!("r_{i:03}.png")), options.width, options.height, &pixels)
            })
            .collect();
        written.into_iter().collect::<Result<(), _>>()?;
        if count > 0 {
            let text = format!("{:#}\n", transforms(part, &cameras, options));
            write_atomic(&dir.join(format!("transforms_{part}.json")), text.as_bytes())?;
        }
    }
    if options.points > 0 {
        write_atomic(&dir.join("points3d.ply"), points.as_bytes())?;
    }
    Ok(())
}

fn check(dir: &Path, options: &DemoOptions) -> Result<(), DatasetError> {
    let ranges = [
        ("train_views", options.train_views, 1..=10_000),
        ("test_views", options.test_views, 0..=10_000),
        ("width", options.width, 1..=8192),
        ("height", options.height, 1..=8192),
        ("points", options.points, 0..=10_000_000),
    ];
    for (option, value, range) in ranges {
        if !range.contains(&value) {
            return Err(DatasetError::Option {
                path: dir.to_path_buf(),
                option,
                expected: format!("{} to {}", range.start(), range.end()),
                found: value.to_string(),
            });
        }
    }
    Ok(())
}

/// Camera to world, OpenGL axes (x right, y up, z back), of the `index`-th of `count` cameras. Golden-angle steps
/// around the dome and even steps in height leave no side unseen.
fn camera(index: usize, count: usize, turn: f64) -> DMat4 {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    let azimuth = turn + index as f64 * golden_angle;
    let share = (index as f64 + 0.5) / count as f64;
    let elevation = ELEVATION.0 + (ELEVATION.1 - ELEVATION.0) * share;
    let (sin, cos) = elevation.sin_cos();
    let back = DVec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), (TARGET + DISTANCE * back).extend(1.0))
}

fn focal(options: &DemoOptions) -> f64 {
    0.5 * options.width as f64 / (0.5 * ANGLE_X).tan()
}

/// `[height, width, 4]`: the mean encoded colour of what a pixel's rays meet, and the share that meets something.
fn photograph(world: &World, c2w: &DMat4, options: &DemoOptions) -> Vec<u8> {
    let (width, height) = (options.width, options.height);
    let focal = focal(options);
    let origin = c2w.w_axis.truncate();
    let mut pixels = vec![0; 4 * width * height];
    for (index, pixel) in pixels.chunks_exact_mut(4).enumerate() {
        let (column, row) = (index % width, index / width);
        let (mut sum, mut hits) = (DVec3::ZERO, 0);
        for sub in 0..SUBPIXELS * SUBPIXELS {
            let place = |pixel: usize, sub: usize| pixel as f64 + (sub as f64 + 0.5) / SUBPIXELS as f64;
            let (u, v) = (place(column, sub % SUBPIXELS), place(row, sub / SUBPIXELS));
            let local = DVec3::new(u - 0.5 * width as f64, 0.5 * height as f64 - v, -focal);
            let ray = Ray { origin, direction: c2w.transform_vector3(local).normalize() };
            if let Some(color) = world.trace(&ray) {
                sum += color;
                hits += 1;
            }
        }
        if hits > 0 {
            let color = 255.0 * sum / f64::from(hits);
            let alpha = 255.0 * f64::from(hits) / (SUBPIXELS * SUBPIXELS) as f64;
            for (out, value) in pixel.iter_mut().zip([color.x, color.y, color.z, alpha]) {
                *out = value.round() as u8;
            }
        }
    }
    pixels
}

fn transforms(part: &str, cameras: &[DMat4], options: &DemoOptions) -> serde_json::Value {
    let frames: Vec<serde_json::Value> = cameras
        .iter()
        .enumerate()
        .map(|(i, c2w)| {
            let rows = [0, 1, 2, 3].map(|row| c2w.row(row).to_array());
            json!({ "file_path": format!("{part}/r_{i:03}.png"), "transform_matrix": rows })
        })
        .collect();
    let mut top = json!({
        "camera_angle_x": ANGLE_X,
        "fl_x": focal(options),
        "fl_y": focal(options),
        "cx": 0.5 * options.width as f64,
        "cy": 0.5 * options.height as f64,
        "w": options.width,
        "h": options.height,
        "frames": frames,
    });
    if options.points > 0 {
        top["ply_file_path"] = json!("points3d.ply");
    }
    top
}

/// Points on all surfaces in proportion to their area, displaced by [`POINT_NOISE`], with the colour cameras see there.
fn ply(world: &World, count: usize, rng: &mut ChaCha8Rng) -> String {
    let properties = "property float x\nproperty float y\nproperty float z\n\
                      property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n");
    let total: f64 = world.objects.iter().map(|object| object.shape.area()).sum();
    for _ in 0..count {
        let mut pick = rng.random_range(0.0..total);
        let object = world.objects.iter().find(|object| {
            pick -= object.shape.area();
            pick < 0.0
        });
        // Rounding may leave a remainder after the last object.
        let Some(object) = object.or(world.objects.last()) else { break };
        let (place, normal) = object.shape.sample(rng);
        let color = (255.0 * world.shade(object, place, normal)).round();
        let noisy = place + POINT_NOISE * DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng));
        text += &format!("{:.5} {:.5} {:.5} {} {} {}\n", noisy.x, noisy.y, noisy.z, color.x, color.y, color.z);
    }
    text
}

#[cfg(test)]
mod tests {
    use glam::DMat2;

    use super::super::shapes::Shape;
    use super::super::world::RED_SPHERE;
    use super::*;
    use gs_datasets::{LoadOptions, View, load};

    #[test]
    fn same_options_same_bytes_other_seed_other_cameras() {
        let options = DemoOptions { train_views: 2, test_views: 1, width: 16, height: 12, points: 50, seed: 7 };
        let folders: Vec<_> = (0..3).map(|_| tempfile::tempdir().expect("a temporary folder")).collect();
        for (folder, seed) in folders.iter().zip([7, 7, 8]) {
            demo_scene(folder.path(), &DemoOptions { seed, ..options.clone() }).expect("written");
        }
        let bytes = |i: usize, file: &str| std::fs::read(folders[i].path().join(file)).expect("read");
        for file in ["train/r_001.png", "transforms_train.json", "test/r_000.png", "points3d.ply"] {
            assert_eq!(bytes(0, file), bytes(1, file), "{file}");
            assert_ne!(bytes(0, file), bytes(2, file), "{file}");
        }
    }

    /// The loaded camera must put the red sphere where the loaded picture shows it. The outline of a sphere is an
    /// ellipse whose centre is not the projected centre: with c the centre in camera coordinates, the outline is the
    /// conic x^T (c c^T - (|c|^2 - r^2) I) x = 0.
    #[test]
    fn the_red_sphere_is_where_the_camera_says() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let options = DemoOptions { train_views: 6, test_views: 1, width: 320, height: 240, ..DemoOptions::default() };
        demo_scene(folder.path(), &options).expect("written");
        let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
        assert_eq!((scene.train.len(), scene.held_out_views().count()), (6, 1));
        assert_eq!(scene.points.as_ref().map(|points| points.len()), Some(2000));
        let mut whole = 0;
        for view in scene.train.iter().chain(scene.held_out_views()) {
            let (centre, area) = outline(view);
            let (seen_centre, seen_area) = red_pixels(view);
            if (seen_area / area - 1.0).abs() < 0.06 {
                whole += 1;
                // Half-covered pixels count as red before the empty background and not before wood, which moves the
                // centre by up to a quarter of a pixel whatever the sphere's size.
                assert!((seen_centre - centre).length() < 0.4, "{}: {seen_centre} against {centre}", view.name);
            }
        }
        assert!(whole >= 5, "only {whole} views show all of the sphere");
    }

    /// Centre (pixels) and area (square pixels) of the sphere's outline.
    fn outline(view: &View) -> (glam::DVec2, f64) {
        let Shape::Sphere { centre, radius } = RED_SPHERE else { panic!("the red sphere is a sphere") };
        let c = view.c2w.inverse().transform_point3(centre);
        let s = c.length_squared() - radius * radius;
        let a = DMat2::from_cols_array(&[c.x * c.x - s, c.x * c.y, c.x * c.y, c.y * c.y - s]);
        let b = glam::DVec2::new(c.x * c.z, c.y * c.z);
        let middle = -(a.inverse() * b);
        let k = c.z * c.z - s + b.dot(middle);
        let area = PI * (k * k / a.determinant()).sqrt() * view.intrinsics.fx * view.intrinsics.fy;
        let scale = glam::DVec2::new(view.intrinsics.fx, view.intrinsics.fy);
        (middle * scale + glam::DVec2::new(view.intrinsics.cx, view.intrinsics.cy), area)
    }

    fn red_pixels(view: &View) -> (glam::DVec2, f64) {
        let (mut sum, mut count) = (glam::DVec2::ZERO, 0.0);
        for (i, pixel) in view.image.data.chunks_exact(3).enumerate() {
            let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(f64::from);
            if r > 2.2 * g && r > 2.2 * b && r > 20.0 {
                sum += glam::DVec2::new((i % view.width) as f64 + 0.5, (i / view.width) as f64 + 0.5);
                count += 1.0;
            }
        }
        (sum / count, count)
    }
}

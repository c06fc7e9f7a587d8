//! Still scenes photographed from a dome of cameras, written as Blender data sets.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use glam::DVec3;
use gs_base::{FileError, write_atomic};
use gs_datasets::DatasetError;
use gs_datasets::image_io::write_png;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::film::{Exposure, Order, film};
use crate::named::named;
use crate::points::Points;
use crate::ranges::check_ranges;
use crate::tracer::camera::{Camera, Rig};
use crate::tracer::scene::Scene;

mod digger;

named! {
    /// The scenes.
    pub enum World {
        /// A checkered floor, a box and four spheres.
        Table = "table",
        /// A digger of bricks: studs, links and bars of a few pixels, seen from the horizon up to straight above.
        Digger = "digger",
    }
}

/// Where the cameras stand.
struct Dome {
    /// Horizontal angle of view, radians.
    angle_x: f64,
    /// Radius, metres, around `target`, at which all cameras look.
    distance: f64,
    target: DVec3,
    /// Lowest and highest camera above the floor, radians.
    elevation: (f64, f64),
}

impl World {
    fn scene(self, rng: &mut ChaCha8Rng) -> Scene {
        match self {
            Self::Table => Scene::described(&[include_str!("../scenes/still/table.toml")], rng),
            Self::Digger => digger::scene(rng),
        }
    }

    fn dome(self) -> Dome {
        match self {
            Self::Table => {
                Dome { angle_x: 0.85, distance: 3.9, target: DVec3::new(0.0, 0.0, 0.3), elevation: (0.25, 1.05) }
            }
            // Angle and distance are those of NeRF's synthetic objects.
            Self::Digger => Dome {
                angle_x: 0.691_111_2,
                distance: 4.031_129,
                target: DVec3::new(0.0, 0.0, 0.4),
                elevation: (0.02, 1.5),
            },
        }
    }
}

/// Options of [`write()`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StillOptions {
    /// The scene.
    pub world: World,
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

impl Default for StillOptions {
    fn default() -> Self {
        Self { world: World::Table, train_views: 40, test_views: 5, width: 160, height: 120, points: 2000, seed: 0 }
    }
}

/// Writes a scene to `dir`: `transforms_train.json` and `transforms_test.json`, RGBA images (transparent where
/// there is nothing), and `points3d.ply` with sparse, noisy, coloured surface points as structure from motion finds
/// them.
///
/// All surfaces are matt, so colours do not depend on the view; edges are anti-aliased.
///
/// # Errors
/// When an option is out of its range or a file cannot be written.
pub fn write(dir: &Path, options: &StillOptions, progress: impl Fn(usize, usize) + Sync) -> Result<(), DatasetError> {
    let ranges = [
        ("train_views", options.train_views, 1..=10_000),
        ("test_views", options.test_views, 0..=10_000),
        ("width", options.width, 1..=8192),
        ("height", options.height, 1..=8192),
        ("points", options.points, 0..=10_000_000),
    ];
    check_ranges(dir, &ranges)?;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let scene = options.world.scene(&mut rng);
    let done = AtomicUsize::new(0);
    let told = || progress(1 + done.fetch_add(1, Relaxed), options.train_views + options.test_views);
    for (part, count) in [("train", options.train_views), ("test", options.test_views)] {
        let cameras = cameras(count, rng.random_range(0.0..TAU), options);
        photograph(&dir.join(part), &scene, &cameras, &told)?;
        if part == "train" && options.points > 0 {
            let points = Points::matched(&scene, &cameras, options.points, 0.0, &mut rng);
            write_atomic(&dir.join("points3d.ply"), &points.ascii())?;
        }
        if count > 0 {
            let text = format!("{:#}\n", transforms(part, &cameras, options));
            write_atomic(&dir.join(format!("transforms_{part}.json")), text.as_bytes())?;
        }
    }
    Ok(())
}

/// Golden-angle steps around the dome from `turn` on and even steps in height leave no side unseen.
fn cameras(count: usize, turn: f64, options: &StillOptions) -> Vec<Camera> {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    let Dome { angle_x, distance, target, elevation } = options.world.dome();
    let direction = |index: usize| {
        let share = (index as f64 + 0.5) / count as f64;
        let azimuth = FRAC_PI_2 + turn + index as f64 * golden_angle;
        (azimuth, elevation.0 + (elevation.1 - elevation.0) * share)
    };
    let directions: Vec<(f64, f64)> = (0..count).map(direction).collect();
    let StillOptions { width, height, .. } = *options;
    Rig { target, distance, angle_x, width, height }.cameras(0, &directions)
}

fn file_name(index: usize) -> String {
    format!("r_{index:03}.png")
}

fn photograph(folder: &Path, scene: &Scene, cameras: &[Camera], told: &(impl Fn() + Sync)) -> Result<(), DatasetError> {
    let exposure = [Exposure::instant(scene, 0.0)];
    let written = cameras.par_iter().enumerate().map(|(index, camera)| {
        let path = folder.join(file_name(index));
        let mut shots = film(scene, camera, &exposure, Order::Rows).into_iter();
        shots.try_for_each(|shot| write_png(&path, camera.width, camera.height, &shot.rgba()))?;
        told();
        Ok(())
    });
    // Collected first, so that the error of the first photo is reported and not of the fastest.
    let written: Vec<Result<(), FileError>> = written.collect();
    Ok(written.into_iter().collect::<Result<(), _>>()?)
}

fn transforms(part: &str, cameras: &[Camera], options: &StillOptions) -> Value {
    let frame = |(index, camera): (usize, &Camera)| {
        let path = format!("{part}/{}", file_name(index));
        json!({ "file_path": path, "transform_matrix": camera.rows() })
    };
    let mut top = cameras.first().map_or(Value::Null, Camera::intrinsics);
    top["frames"] = cameras.iter().enumerate().map(frame).collect();
    if options.points > 0 {
        top["ply_file_path"] = json!("points3d.ply");
    }
    top
}

#[cfg(test)]
mod tests {
    use glam::DMat2;

    use super::*;
    use gs_datasets::{LoadOptions, View, load};

    /// Its centre and radius in the description.
    const RED_SPHERE: (DVec3, f64) = (DVec3::new(-0.45, 0.40, 0.84), 0.26);

    #[test]
    fn same_options_same_bytes_other_seed_other_cameras() {
        let options =
            StillOptions { train_views: 2, width: 16, height: 12, points: 50, seed: 7, ..StillOptions::default() };
        let folders: Vec<_> = (0..3).map(|_| tempfile::tempdir().expect("a temporary folder")).collect();
        for (folder, seed) in folders.iter().zip([7, 7, 8]) {
            write(folder.path(), &StillOptions { seed, ..options.clone() }, |_, _| ()).expect("written");
        }
        let bytes = |i: usize, file: &str| std::fs::read(folders[i].path().join(file)).expect("read");
        for file in ["train/r_001.png", "transforms_train.json", "test/r_000.png", "points3d.ply"] {
            assert_eq!(bytes(0, file), bytes(1, file), "{file}");
            assert_ne!(bytes(0, file), bytes(2, file), "{file}");
        }
    }

    #[test]
    fn every_world_is_transparent_around_what_stands_in_it() {
        for world in World::ALL {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let options =
                StillOptions { world, train_views: 2, test_views: 1, width: 24, height: 24, points: 0, seed: 1 };
            write(folder.path(), &options, |_, total| assert_eq!(total, 3)).expect("written");
            let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
            assert!(scene.points.is_none());
            for view in &scene.train {
                let alpha = view.alpha.as_ref().expect("straight alpha");
                let solid = alpha.iter().filter(|alpha| **alpha > 200).count();
                assert!((50..500).contains(&solid), "{world}: {solid} of 576 pixels");
            }
        }
    }

    /// The loaded camera must put the red sphere where the loaded picture shows it. The outline of a sphere is an
    /// ellipse whose centre is not the projected centre: with c the centre in camera coordinates, the outline is the
    /// conic x^T (c c^T - (|c|^2 - r^2) I) x = 0.
    #[test]
    fn the_red_sphere_is_where_the_camera_says() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let options =
            StillOptions { train_views: 6, test_views: 1, width: 320, height: 240, ..StillOptions::default() };
        write(folder.path(), &options, |_, _| ()).expect("written");
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
        let (centre, radius) = RED_SPHERE;
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

//! The synthetic blur worlds, judged by the files they write.

use std::fs::{read, read_to_string};
use std::path::{Path, PathBuf};

use exr::prelude::read_all_flat_layers_from_file;
use gs_datasets::light::{to_encoded, to_linear};
use gs_datasets::{LoadOptions, load};
use gs_worlds::deblur::{DeblurOptions, PriorFault, PriorFaults, World, write};
use serde_json::Value;
use tempfile::{TempDir, tempdir};

use glam::{DMat4, DQuat, DVec3};

use crate::fixtures::{held_out, written};

/// Small and quick: three cameras, the middle one held out.
fn small(world: World) -> DeblurOptions {
    DeblurOptions {
        world,
        width: 64,
        height: 48,
        cameras: 3,
        held_out: 1,
        frames: 3,
        subframes: 16,
        exposure: 0.2,
        points: 200,
        ..DeblurOptions::default()
    }
}

fn json(folder: &TempDir, part: &str) -> Value {
    let text = read_to_string(folder.path().join(format!("transforms_{part}.json"))).expect("a JSON file");
    serde_json::from_str(&text).expect("JSON")
}

fn bytes(path: &Path) -> Vec<u8> {
    image::open(path).expect("an image").into_bytes()
}

fn channels(path: PathBuf) -> Vec<Vec<f32>> {
    let image = read_all_flat_layers_from_file(path).expect("an EXR image");
    let channels = &image.layer_data[0].channel_data.list;
    channels.iter().map(|channel| channel.sample_data.values_as_f32().collect()).collect()
}

fn vector(value: &Value) -> DVec3 {
    let numbers: [f64; 3] = serde_json::from_value(value.clone()).expect("three numbers");
    DVec3::from_array(numbers)
}

/// Camera to world, OpenGL axes.
fn c2w(frame: &Value) -> DMat4 {
    let rows: [[f64; 4]; 4] = serde_json::from_value(frame["transform_matrix"].clone()).expect("a matrix");
    DMat4::from_cols_array_2d(&rows).transpose()
}

/// The place in the world that pixel `index` of a frame shows.
fn place(set: &Value, frame: &Value, index: usize, z: f32) -> DVec3 {
    let (width, height) = (set["w"].as_f64().expect("a width"), set["h"].as_f64().expect("a height"));
    let focal = set["fl_x"].as_f64().expect("a focal length");
    let (x, y) = ((index % width as usize) as f64 + 0.5, (index / width as usize) as f64 + 0.5);
    let direction = DVec3::new((x - 0.5 * width) / focal, (0.5 * height - y) / focal, -1.0);
    c2w(frame).transform_point3(direction * f64::from(z))
}

/// A blurry photo against the mean of sharp photos at 25 instants of its exposure, both of 8 bits. The mean of 25
/// roundings is off by 0.1 of 255. An edge of contrast c that passes a pixel is integrated in 25 steps here and in 16
/// steps at each of 16 places in the pixel there, so that single pixels are off by up to c (1/25 + 1/64) = 0.06 and all
/// by far less. Averaging encoded values gives darker pixels and must fit worse.
#[test]
fn blurry_is_the_mean_of_sharp_in_linear_light() {
    let blurred = DeblurOptions { cameras: 1, held_out: 0, exposure: 0.5, subframes: 256, ..small(World::Cube) };
    let fine = DeblurOptions { frames: 101, exposure: 0.0, subframes: 16, ..blurred.clone() };
    let (blurred, fine) = (written(&blurred), written(&fine));
    // Of [0.375, 0.625] the middles of 25 parts: 0.38, 0.39, ... 0.62.
    let sharp: Vec<Vec<u8>> =
        (38..=62).map(|i| bytes(&fine.path().join(format!("truth/sharp/train/cam00/{i:04}.png")))).collect();
    let blurry = bytes(&blurred.path().join("train/cam00/0001.png"));
    let centre = bytes(&blurred.path().join("truth/sharp/train/cam00/0001.png"));
    assert_eq!(
        centre,
        bytes(&fine.path().join("truth/sharp/train/cam00/0050.png")),
        "sharp photos depend on time only"
    );
    let (mut off, mut off_encoded, mut off_sharp, mut worst) = (0.0, 0.0, 0.0, 0.0_f32);
    for i in 0..blurry.len() {
        let light = to_linear(f32::from(blurry[i]) / 255.0);
        let encoded: Vec<f32> = sharp.iter().map(|image| f32::from(image[i]) / 255.0).collect();
        let mean = encoded.iter().map(|value| to_linear(*value)).sum::<f32>() / 25.0;
        let mean_encoded = to_linear(encoded.iter().sum::<f32>() / 25.0);
        worst = worst.max((light - mean).abs());
        off += (light - mean).abs();
        off_encoded += (light - mean_encoded).abs();
        off_sharp += (light - to_linear(f32::from(centre[i]) / 255.0)).abs();
    }
    let count = blurry.len() as f32;
    let (off, off_encoded, off_sharp) = (off / count, off_encoded / count, off_sharp / count);
    assert!(worst < 0.06 && off < 0.002, "worst {worst}, mean {off}");
    assert!(off_encoded > 2.0 * off, "linear {off}, encoded {off_encoded}");
    assert!(off_sharp > 10.0 * off, "the photo is hardly blurred: {off_sharp} against {off}");
}

#[test]
fn without_exposure_or_motion_photos_are_sharp() {
    for (exposure, speed) in [(0.0, 1.0), (0.9, 0.0)] {
        let folder = written(&DeblurOptions { exposure, speed, ..small(World::Monkey) });
        for frame in 0..3 {
            let stem = format!("train/cam00/{frame:04}.png");
            assert_eq!(bytes(&folder.path().join(&stem)), bytes(&folder.path().join(format!("truth/sharp/{stem}"))));
            let velocity = channels(folder.path().join(format!("truth/velocity/train/cam00/{frame:04}.exr")));
            assert_eq!(velocity.concat().iter().any(|v| *v != 0.0), speed != 0.0);
        }
    }
}

/// Depth and velocity of a ball, whose surface and motion the JSON tells exactly: every pixel in the mask must lie on
/// the ball and move with it. Depth is stored in f32, which leaves 4e-7 of 4 m.
#[test]
fn depth_and_velocity_lie_on_the_ball() {
    let folder = written(&small(World::Sphere));
    for part in ["train", "test"] {
        let set = json(&folder, part);
        let mover = &set["movers"][0];
        let radius = mover["radius"].as_f64().expect("a radius");
        for frame in set["frames"].as_array().expect("frames") {
            let file = |key: &str| folder.path().join(frame["truth"][key].as_str().expect("a path"));
            let (depth, velocity) = (channels(file("depth_path")).remove(0), channels(file("velocity_path")));
            let (mask, union) = (bytes(&file("mask_path")), bytes(&file("mask_union_path")));
            let time = frame["time"].as_f64().expect("a time");
            let pose = &mover["poses"][(2.0 * time).round() as usize];
            assert_eq!(pose["time"].as_f64(), Some(time));
            let centre = vector(&pose["position"]);
            let (linear, angular) = (vector(&pose["velocity"]), vector(&pose["angular_velocity"]));
            for i in 0..mask.len() {
                let found = DVec3::new(velocity[0][i].into(), velocity[1][i].into(), velocity[2][i].into());
                let place = place(&set, frame, i, depth[i]);
                if mask[i] == 255 {
                    assert!((place.distance(centre) - radius).abs() < 1e-5, "{place} is not on the ball");
                    assert!((linear + angular.cross(place - centre) - found).length() < 1e-5);
                    assert_eq!(union[i], 255, "the union holds the centre's mask");
                } else {
                    assert!(found == DVec3::ZERO && depth[i] > 1.0 && place.z > -1e-5, "{place} is outside the room");
                }
            }
            let moving = |mask: &[u8]| mask.iter().filter(|m| **m == 255).count();
            assert!(moving(&mask) > 40 && moving(&union) > moving(&mask), "{} in {}", moving(&mask), moving(&union));
        }
    }
}

/// A surface that one camera sees must be where another sees it: nothing may lie behind what the other one sees there.
/// Depth of the nearest pixel stands in for the depth at a place, so slanted surfaces and edges may differ by more than
/// 3 %.
#[test]
fn depth_agrees_between_cameras() {
    let options = DeblurOptions { cameras: 2, held_out: 0, frames: 1, ..small(World::Monkey) };
    let folder = written(&options);
    let set = json(&folder, "train");
    let frames = set["frames"].as_array().expect("frames");
    let depths: Vec<Vec<f32>> = (0..2)
        .map(|i| channels(folder.path().join(frames[i]["truth"]["depth_path"].as_str().expect("a path"))).remove(0))
        .collect();
    let focal = set["fl_x"].as_f64().expect("a focal length");
    let (mut inside, mut equal, mut behind) = (0, 0, 0);
    for (i, z) in depths[0].iter().enumerate() {
        let local = c2w(&frames[1]).inverse().transform_point3(place(&set, &frames[0], i, *z));
        let (u, v) = (32.0 + focal * local.x / -local.z, 24.0 - focal * local.y / -local.z);
        if !(0.0..64.0).contains(&u) || !(0.0..48.0).contains(&v) || local.z > 0.0 {
            continue;
        }
        let seen = f64::from(depths[1][v as usize * 64 + u as usize]) / -local.z;
        inside += 1;
        equal += usize::from((seen - 1.0).abs() < 0.03);
        behind += usize::from(seen > 1.03);
    }
    assert!(inside > 500 && equal * 10 > inside * 6 && behind * 20 < inside, "{equal} and {behind} of {inside}");
}

/// The JSON's velocities are derivatives of its poses: central differences over 1/200, whose error is h^2 / 6 times the
/// third derivative, here 4e-6 x 40 / 6 (the monkey's bend at its fastest).
#[test]
fn velocities_in_the_json_are_derivatives_of_its_poses() {
    let options = DeblurOptions {
        width: 8,
        height: 8,
        cameras: 1,
        held_out: 0,
        frames: 401,
        points: 0,
        exposure: 0.0,
        ..small(World::Monkey)
    };
    let folder = written(&options);
    let set = json(&folder, "train");
    let poses = set["movers"][0]["poses"].as_array().expect("poses");
    let turn = |pose: &Value| {
        let [w, x, y, z]: [f64; 4] = serde_json::from_value(pose["quaternion_wxyz"].clone()).expect("a quaternion");
        DQuat::from_xyzw(x, y, z, w)
    };
    for three in poses.windows(3) {
        let difference = 200.0 * (vector(&three[2]["position"]) - vector(&three[0]["position"]));
        assert!((difference - vector(&three[1]["velocity"])).length() < 1e-4);
        let spin = 200.0 * (turn(&three[2]) * turn(&three[0]).conjugate()).to_scaled_axis();
        assert!((spin - vector(&three[1]["angular_velocity"])).length() < 1e-6);
    }
}

#[test]
fn same_options_same_bytes_on_any_number_of_threads() {
    let options = small(World::Lychee);
    let folders: Vec<TempDir> = [(1, 0), (3, 0), (3, 1)]
        .into_iter()
        .map(|(threads, seed)| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| written(&DeblurOptions { seed, ..options.clone() }))
        })
        .collect();
    let files = [
        "train/cam00/0001.png",
        "test/cam02/0002.png",
        "priors/depth/train/cam01/0000.exr",
        "priors/masks/train/cam01/0001.png",
        "priors/sharp/train/cam01/0002.png",
        "truth/velocity/train/cam00/0001.exr",
        "points3d.ply",
        "transforms_train.json",
        "transforms_test.json",
    ];
    for name in files {
        let [one, same, other] = [0, 1, 2].map(|i: usize| read(folders[i].path().join(name)).expect("a file"));
        assert!(one == same, "{name} differs between runs");
        assert!(one != other, "{name} is the same for another seed");
    }
}

/// The priors (depth, mask, pseudo-sharp) that are the truth in every training frame, and how the set names its depths.
fn exact(faults: PriorFaults) -> ([bool; 3], String) {
    let folder = written(&DeblurOptions { priors: faults, ..small(World::Cube) });
    let set = json(&folder, "train");
    let mut exact = [true; 3];
    for frame in set["frames"].as_array().expect("frames") {
        let (prior, truth) = (|key: &str| file(&folder, &frame[key]), |key: &str| file(&folder, &frame["truth"][key]));
        exact[0] &= channels(prior("depth_file_path")) == channels(truth("depth_path"));
        exact[1] &= bytes(&prior("mask_path")) == bytes(&truth("mask_path"));
        exact[2] &= bytes(&prior("pseudo_sharp_path")) == bytes(&truth("sharp_path"));
    }
    (exact, set["depth_kind"].as_str().expect("a kind").into())
}

#[test]
fn faults_switch_one_by_one() {
    assert_eq!(exact(PriorFaults::none()), ([true; 3], "metric_z".into()));
    let cases = [
        (PriorFault::DepthAffine, [false, true, true], "depth"),
        (PriorFault::DepthNoise, [false, true, true], "metric_z"),
        (PriorFault::DepthOutliers, [false, true, true], "metric_z"),
        (PriorFault::InverseDepth, [false, true, true], "inverse_depth"),
        (PriorFault::Masks, [true, false, true], "metric_z"),
        (PriorFault::Sharp, [true, true, false], "metric_z"),
    ];
    for (fault, expected, kind) in cases {
        assert_eq!(exact(PriorFaults::of(&[fault])), (expected, kind.into()), "{fault:?}");
    }
}

fn file(folder: &TempDir, path: &Value) -> PathBuf {
    folder.path().join(path.as_str().expect("a path"))
}

/// Each fault must do what it says: depth is affine in the truth up to its noise but not equal to it, masks stray by a
/// few pixels, pseudo-sharp images lie between sharp and blurry.
#[test]
fn faults_are_of_the_size_they_say() {
    let folder = written(&DeblurOptions { width: 128, height: 96, exposure: 0.3, ..small(World::Cube) });
    let set = json(&folder, "train");
    assert_eq!(set["depth_kind"], "depth");
    let (mut scales, mut biases) = (Vec::new(), Vec::new());
    for frame in set["frames"].as_array().expect("frames") {
        let (prior, truth) = (|key: &str| file(&folder, &frame[key]), |key: &str| file(&folder, &frame["truth"][key]));
        let (wrong, right) = (channels(prior("depth_file_path")).remove(0), channels(truth("depth_path")).remove(0));
        let (scale, shift) = line(&right, &wrong);
        let residual = right.iter().zip(&wrong).map(|(z, w)| (scale * f64::from(*z) + shift - f64::from(*w)).powi(2));
        let spread = (residual.sum::<f64>() / right.len() as f64).sqrt() / mean(&right);
        // One percent, of which interpolating the coarse half takes up to half away.
        assert!((0.005..0.02).contains(&(spread / scale)), "noise of {spread}");
        assert!((0.8..1.25).contains(&scale), "{scale}");
        scales.push(scale);
        let (mask, exact) = (bytes(&prior("mask_path")), bytes(&truth("mask_path")));
        let count = |keep: &dyn Fn(u8, u8) -> bool| mask.iter().zip(&exact).filter(|(a, b)| keep(**a, **b)).count();
        let share = count(&|a, b| a & b > 0) as f64 / count(&|a, b| a | b > 0) as f64;
        assert!((0.6..0.99).contains(&share), "masks overlap by {share}");
        biases.push(count(&|a, _| a > 0) as f64 / count(&|_, b| b > 0) as f64);
        let (sharp, blurry) = (bytes(&truth("sharp_path")), bytes(&truth("blurry_path")));
        let (near, far) = (error(&bytes(&prior("pseudo_sharp_path")), &sharp), error(&blurry, &sharp));
        assert!(near > 0.005 && near < 0.75 * far, "pseudo-sharp is off by {near}, the photo by {far}");
    }
    for values in [scales, biases] {
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
        assert!(high - low > 0.02, "faults are the same in all frames: {low} to {high}");
    }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// Slope and intercept of the least-squares line.
fn line(x: &[f32], y: &[f32]) -> (f64, f64) {
    let (mx, my) = (mean(x), mean(y));
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, y) in x.iter().zip(y) {
        let dx = f64::from(*x) - mx;
        xy += dx * (f64::from(*y) - my);
        xx += dx * dx;
    }
    (xy / xx, my - xy / xx * mx)
}

/// Root mean square difference, 0 to 1.
fn error(a: &[u8], b: &[u8]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
    (squares / a.len() as f64).sqrt() / 255.0
}

#[test]
fn the_reader_reads_it() {
    let folder = written(&small(World::Sphere));
    let scene = load(folder.path(), &LoadOptions::default()).expect("loaded");
    assert_eq!((scene.train.len(), held_out(&scene).len()), (6, 3));
    assert_eq!(scene.time_range, Some((0.0, 1.0)));
    assert_eq!(scene.points.as_ref().map(|points| points.len()), Some(200));
    let cameras: Vec<&str> = held_out(&scene).iter().filter_map(|view| view.camera_id.as_deref()).collect();
    assert_eq!(cameras, ["cam02"; 3]);
    assert_eq!(held_out(&scene)[1].image.data, bytes(&folder.path().join("test/cam02/0001.png")));
    // A surface point is inside the room but for its noise and 1 % of outliers.
    let points = scene.points.expect("points").positions;
    let inside = points.iter().filter(|p| p[2] > -0.05 && p[1] < 2.35 && p[0].abs() < 3.05).count();
    assert!(inside >= 190, "{inside} of 200 points are in the room");
}

#[test]
fn options_out_of_range_are_refused() {
    let base = small(World::Cube);
    let cases = [
        (DeblurOptions { width: 4, ..base.clone() }, "`width`: expected 8 to 8192, found 4"),
        (DeblurOptions { held_out: 2, ..base.clone() }, "`held_out`: expected 0 to 1, found 2"),
        (DeblurOptions { subframes: 8, ..base.clone() }, "`subframes`: expected 16 to 4096, found 8"),
        (DeblurOptions { exposure: f64::NAN, ..base.clone() }, "`exposure`: expected 0 to 2, found NaN"),
        (
            DeblurOptions { priors: PriorFaults { depth_outliers: 1.5, ..PriorFaults::none() }, ..base },
            "`priors.depth_outliers`: expected 0 to 1, found 1.5",
        ),
    ];
    for (options, expected) in cases {
        let folder = tempdir().expect("a temporary folder");
        let error = write(folder.path(), &options, |_, _| {}).expect_err("refused").to_string();
        assert!(error.ends_with(expected), "{error}");
        assert_eq!(folder.path().read_dir().expect("a folder").count(), 0, "nothing is written");
    }
}

#[test]
fn a_ring_of_cameras_sees_its_world_under_a_sky() {
    let folder = tempdir().expect("a temporary folder");
    let options = DeblurOptions { ring: true, cameras: 8, held_out: 1, frames: 1, ..small(World::Lychee) };
    write(folder.path(), &options, |_, _| {}).expect("written");
    let scene = load(folder.path(), &LoadOptions { training_truth: true, ..LoadOptions::default() }).expect("loaded");
    let directions: Vec<_> = scene.train.iter().map(|view| view.c2w.z_axis.truncate()).collect();
    let sum: glam::DVec3 = directions.iter().sum();
    // Seven of eight directions all around: what is left is the one that is missing, flat; each looks down.
    assert!((0.8..1.1).contains(&sum.truncate().length()) && sum.z < -1.5, "{sum}");
    for view in &scene.train {
        let depth = view.truth.depth.as_ref().expect("a depth");
        let (top, middle) = (depth[view.width / 2], depth[(view.height / 2) * view.width + view.width / 2]);
        assert_eq!(top, 0.0, "{}: the sky is nowhere", view.name);
        assert!((2.0..6.0).contains(&middle), "{}: {middle}", view.name);
        let sky = &view.image.data[3 * (view.width / 2)..][..3];
        assert!(sky[2] > sky[0] && sky[2] > 150, "{}: {sky:?}", view.name);
    }
}

#[test]
fn progress_counts_all_photos() {
    let folder = tempdir().expect("a temporary folder");
    let heard = std::cell::RefCell::new(Vec::new());
    let options = DeblurOptions { width: 16, height: 12, ..small(World::Sphere) };
    write(folder.path(), &options, |done, total| heard.borrow_mut().push((done, total))).expect("written");
    assert_eq!(*heard.borrow(), [(0, 9), (3, 9), (6, 9), (9, 9)]);
}

#[test]
fn worlds_are_read_by_name() {
    for world in World::ALL {
        assert_eq!(world.to_string().parse(), Ok(world));
    }
    let error = "box".parse::<World>().expect_err("no such world");
    assert_eq!(error, "expected cube, lychee, monkey, sphere or pair, found \"box\"");
    // The encoded mid grey, so that this file's use of the curve is tied to a number.
    assert!((to_encoded(0.214_041) - 0.5).abs() < 1e-5);
}

//! Files of scenes as others bring them: far from the origin, with broken Gaussians, in formats that are not read, with
//! cameras of other viewers.

use std::fs;
use std::path::Path;

use crate::common::program::{fails, says, succeeds};
use crate::common::{self, read_json};
use glam::{DMat4, DVec3};
use gs_datasets::{load_cameras, load_cameras_by};
use gs_pipelines::load_scene;
use gs_splats::Splats;
use gs_train::run::exchange::{Format, Packed, read_packed};
use serde_json::json;

const QUICK: [&str; 8] =
    ["--steps", "12", "--set", "eval.ms_ssim=false", "--set", "init.random_points=150", "--cap=160", "--seed=1"];

/// A place in map coordinates.
const PLACE: [f64; 3] = [450_123.4, 5_200_456.7, 312.5];

/// Trains the tiny scene without points, moved by `offset`; returns what was said meanwhile.
fn trained_at(folder: &Path, offset: [f64; 3]) -> String {
    common::tiny_scene(folder);
    for name in ["train", "test"] {
        let file = folder.join(format!("scene/transforms_{name}.json"));
        let mut top = read_json(&file);
        top.as_object_mut().expect("an object").remove("ply_file_path");
        for frame in top["frames"].as_array_mut().expect("frames") {
            for (axis, shift) in offset.iter().enumerate() {
                let x = frame["transform_matrix"][axis][3].as_f64().expect("a number");
                frame["transform_matrix"][axis][3] = json!(x + shift);
            }
        }
        fs::write(&file, top.to_string()).expect("written");
    }
    fs::remove_file(folder.join("scene/points3d.ply")).expect("removed");
    let train: Vec<&str> = ["train", "scene", "--out", "run"].into_iter().chain(QUICK).collect();
    let [_, said] = says(folder, &train);
    said
}

/// PSNR of `gsburn eval`, mean over views.
fn measured(folder: &Path, scene: &str) -> f64 {
    let said = succeeds(folder, &["eval", scene, "--data", "scene", "--set", "eval.ms_ssim=false"]);
    let mean = said.lines().find(|line| line.starts_with("mean  ")).expect("a mean");
    mean.split_whitespace().nth(1).expect("a figure").parse().expect("a number")
}

/// A scene in map coordinates: its files have local positions and name the offset to the last digit; whatever is read
/// and written again keeps it, and every command sees the run's own scene. Only SPZ rounds.
#[test]
fn far_scenes_keep_their_digits() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let said = trained_at(folder, PLACE);
    assert!(said.contains("scene.ply: positions are relative to (450"), "{said}");
    let checked = succeeds(folder, &["check", "scene"]);
    assert!(checked.contains("units from its world's origin") && checked.contains("relative to [450"), "{checked}");
    let header = String::from_utf8_lossy(&fs::read(folder.join("run/scene.ply")).expect("read")[..300]).into_owned();
    let comment = header.lines().find_map(|line| line.strip_prefix("comment SplatOffset: ")).expect("a comment");
    let offset: Vec<f64> = comment.split(' ').map(|word| word.parse().expect("a number")).collect();
    assert!((0..3).all(|axis| (offset[axis] - PLACE[axis]).abs() < 10.0), "{comment}");
    let exact = measured(folder, "run");
    assert_eq!(measured(folder, "run/scene.ply"), exact);

    for file in ["a.ply", "a.glb", "a.spz", "a.usda"] {
        let said = succeeds(folder, &["export", "run", "--out", file]);
        assert!(said.contains("positions are relative to (450"), "{said}");
    }
    assert!(fs::read_to_string(folder.join("a.usda")).expect("read").contains("double3 offset = (450"));
    for (from, to) in
        [("a.ply", "b.spz"), ("b.spz", "c.glb"), ("c.glb", "d.ply"), ("a.glb", "e.ply"), ("e.ply", "f.glb")]
    {
        assert!(succeeds(folder, &["convert", from, to]).contains("positions are relative to (450"));
    }
    let found = |file: &str| read_packed(&folder.join(file)).expect("read").expect("a scene").splats;
    for file in ["a.ply", "a.glb", "a.spz", "b.spz", "c.glb", "d.ply", "e.ply", "f.glb"] {
        let splats = found(file);
        // A number in JSON is read to one unit in the last place.
        assert!((0..3).all(|axis| (splats.offset[axis] - offset[axis]).abs() < 2e-9), "{file}: {:?}", splats.offset);
        assert!(splats.means.iter().flatten().all(|x| x.abs() < 900.0), "{file}");
        assert!(succeeds(folder, &["info", file]).contains("offset       450"), "{file}");
        let bound = if ["a.spz", "b.spz", "c.glb", "d.ply"].contains(&file) { 0.5 } else { 0.02 };
        assert!((measured(folder, file) - exact).abs() < bound, "{file}: {} and {exact} dB", measured(folder, file));
    }
    assert_eq!(found("a.ply").means, found("e.ply").means);
    // Cameras are in the data set's world; a turned scene stands where its world turned to.
    let shown = |scene: &str, out: &str| {
        succeeds(folder, &["render", scene, "--cameras", "scene/transforms_test.json", "--out", out]);
        fs::read(folder.join(out).join("test/r_000.png")).expect("read")
    };
    assert!(shown("run", "r1") == shown("a.ply", "r2"), "the same pictures");
    succeeds(folder, &["export", "run", "--out", "up.ply", "--up", "z"]);
    let turned = found("up.ply").offset;
    assert!((turned[1] + offset[2]).abs() < 1e-3 && turned != [0.0; 3], "z became -y: {turned:?}");
}

/// A scene near its origin has the world's positions in its files, and no offset.
#[test]
fn near_scenes_stay_in_their_world() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let said = trained_at(folder, [30.0, 0.0, 0.0]);
    assert!(!said.contains("relative"), "{said}");
    let said = succeeds(folder, &["export", "run", "--out", "a.glb"]);
    assert!(!said.contains("relative") && !succeeds(folder, &["info", "a.glb"]).contains("offset"), "{said}");
    for file in ["run/scene.ply", "a.glb"] {
        let bytes = fs::read(folder.join(file)).expect("read");
        assert!(!String::from_utf8_lossy(&bytes).to_lowercase().contains("offset\":["), "{file}");
        assert!(!String::from_utf8_lossy(&bytes).contains("SplatOffset"), "{file}");
    }
    assert!(measured(folder, "run") == measured(folder, "run/scene.ply"));
    // The header counts, too.
    for mb in ["0.003", "0.005", "0.02"] {
        let said = succeeds(folder, &["export", "run", "--out", "small.ply", "--target-mb", mb]);
        let size = fs::metadata(folder.join("small.ply")).expect("a file").len();
        assert!(size as f64 <= mb.parse::<f64>().expect("a number") * 1e6, "{size}: {said}");
    }
    let [_, warned] = says(folder, &["view", "run/scene.ply", "--out", "scene.html"]);
    assert!(!warned.contains("WARN"), "{warned}");
    fs::rename(folder.join("run"), folder.join("v1.2-test")).expect("renamed");
    succeeds(folder, &["view", "v1.2-test"]);
    assert!(fs::read_to_string(folder.join("v1.2-test/view.html")).expect("read").contains("<title>v1.2-test"));
}

/// Small Gaussians in a cube of side 2.
fn cloud(count: usize) -> Splats {
    let at = |i: usize, k: usize| ((13 * i + 7 * k) as f32 * 0.731).sin();
    Splats {
        means: (0..count).map(|i| [at(i, 0), at(i, 1), at(i, 2)]).collect(),
        quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
        log_scales: vec![[-5.0; 3]; count],
        opacity_logits: vec![1.0; count],
        sh: vec![[0.5; 3]; count],
        ..Splats::default()
    }
}

fn write(folder: &Path, name: &str, splats: Splats) {
    let packed = Packed { splats, motion: None, samples: 0 };
    packed.write(&folder.join(name), Format::Ply).expect("written");
}

/// Two Gaussians far from 398 others: left out of an SPZ with a sentence, kept when asked for, and named where nothing
/// holds them.
#[test]
fn far_gaussians_are_left_out_of_spz() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let mut splats = cloud(400);
    splats.means[17] = [1e5, 0.0, 0.0];
    splats.means[200] = [0.0, -9e4, 0.0];
    write(folder, "far.ply", splats.clone());
    let [said, warned] = says(folder, &["convert", "far.ply", "a.spz"]);
    assert!(said.contains("398 Gaussians, positions in steps of 1/4096 units"), "{said}");
    for word in
        ["2 Gaussians of 400 were left out", "row 17 and 1 more", "90000 units", "--keep-far keeps them", "1/64 units"]
    {
        assert!(warned.contains(word), "{word} in {warned}");
    }
    let [said, warned] = says(folder, &["convert", "far.ply", "a.spz", "--keep-far"]);
    let step = "400 Gaussians, positions in steps of 1/64 units, since one is 100000 units from the origin";
    assert!(said.contains(step) && warned.is_empty(), "{said} {warned}");
    let [said, _] = says(folder, &["export", "far.ply", "--out", "b.spz"]);
    assert!(said.contains("398 Gaussians"), "{said}");
    assert!(succeeds(folder, &["convert", "far.ply", "a.glb"]).contains("400 Gaussians"), "glTF holds them");
    splats.means[17] = [5e8, 0.0, 0.0];
    write(folder, "far.ply", splats);
    let [said, warned] = says(folder, &["convert", "far.ply", "a.spz"]);
    assert!(said.contains("398 Gaussians") && warned.contains("no SPZ file holds them"), "{said} {warned}");
    let refused = fails(folder, &["convert", "far.ply", "a.spz", "--keep-far"]);
    assert!(refused.contains("Gaussian 17") && refused.contains("5e8") && refused.contains("1 of 400"), "{refused}");
}

/// Rows of zeros are no Gaussians: every command leaves them out and says so.
#[test]
fn rows_of_zeros_are_left_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let zeros = |count: usize| {
        let mut splats = cloud(count);
        splats.means = vec![[0.0; 3]; count];
        splats.quats = vec![[0.0; 4]; count];
        splats
    };
    let mut splats = cloud(20);
    let empty = zeros(30);
    splats.means.extend(empty.means);
    splats.quats.extend(empty.quats);
    splats.log_scales.extend(empty.log_scales);
    splats.opacity_logits.extend(empty.opacity_logits);
    splats.sh.extend(empty.sh);
    write(folder, "zeros.ply", splats);
    let keys =
        r#"{"keyframes": [{"position": [0, 0, -4], "look_at": [0, 0, 0]}], "width": 32, "height": 24, "images": 1}"#;
    fs::write(folder.join("path.json"), keys).expect("written");
    for args in [
        &["info", "zeros.ply"][..],
        &["convert", "zeros.ply", "a.spz"],
        &["convert", "zeros.ply", "a.glb"],
        &["convert", "zeros.ply", "a.usda"],
        &["export", "zeros.ply", "--out", "b.ply"],
        &["view", "zeros.ply"],
        &["render", "zeros.ply", "--cameras", "path.json", "--out", "r"],
    ] {
        let [_, warned] = says(folder, args);
        assert!(
            warned.contains("30 rows of 50 have no rotation") && warned.contains("row 20 and row 49"),
            "{args:?}: {warned}"
        );
    }
    assert!(succeeds(folder, &["info", "b.ply"]).contains("Gaussians    20"));
    write(folder, "none.ply", zeros(3));
    assert!(fails(folder, &["info", "none.ply"]).contains("found 3 rows with no rotation"));
}

/// Every command that takes a scene names the format that it does not read, and the command that converts it.
#[test]
fn formats_that_are_not_read_are_named() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::create_dir(folder.join("sog")).expect("a folder");
    for name in ["a.lcc", "a.gltf", "a.sog", "a.usda"] {
        fs::write(folder.join(name), "x").expect("written");
    }
    fs::write(folder.join("sog/meta.json"), r#"{"version": 1}"#).expect("written");
    let spz = [&b"NGSP"[..], &5_u32.to_le_bytes(), &[0; 24]].concat();
    fs::write(folder.join("a.spz"), spz).expect("written");
    for (scene, words) in [
        ("a.lcc", ["LCC", "`npx @playcanvas/splat-transform a.lcc a.ply`"]),
        ("a.sog", ["a.sog", "no zip archive"]),
        ("sog", ["SOG of version 2", "found version 1"]),
        ("sog/meta.json", ["SOG of version 2", "found version 1"]),
        ("a.gltf", ["glTF as text", "`npx @gltf-transform/cli copy a.gltf a.glb`"]),
        ("a.spz", ["SPZ 5", "not read"]),
        ("a.usda", ["OpenUSD", "written and not read"]),
    ] {
        for args in [
            &["info", scene][..],
            &["view", scene],
            &["eval", scene, "--data", "nothing"],
            &["export", scene, "--out", "x.ply"],
            &["convert", scene, "x.ply"],
            &["render", scene, "--cameras", "nothing", "--out", "x"],
        ] {
            let refused = fails(folder, args);
            assert!(words.iter().all(|word| refused.contains(word)), "{args:?}: {refused}");
        }
    }
}

/// Cameras of the data set's folder are read as the training read them; elsewhere, as their format has them.
#[test]
fn cameras_of_a_training_keep_its_convention() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    let sound = load_cameras(&folder.join("scene/transforms_test.json")).expect("cameras");
    // OpenGL's axes become OpenCV's: y and z of the cameras are negated.
    for name in ["train", "test"] {
        let file = folder.join(format!("scene/transforms_{name}.json"));
        let mut top = read_json(&file);
        for frame in top["frames"].as_array_mut().expect("frames") {
            for (row, column) in (0..3).flat_map(|row| [(row, 1), (row, 2)]) {
                let value = &mut frame["transform_matrix"][row][column];
                *value = json!(-value.as_f64().expect("a number"));
            }
        }
        fs::write(&file, top.to_string()).expect("written");
    }
    let meant = ["train", "scene", "--out", "run", "--set", "data.poses=c2w-opencv"];
    says(folder, &meant.into_iter().chain(QUICK).collect::<Vec<_>>());
    let run = load_scene(&folder.join("run"), &common::device()).expect("a scene").run.expect("a run");
    let of = |file: &Path| load_cameras_by(file, run.poses_in(file)).expect("cameras");
    let (inside, outside) = (folder.join("scene/transforms_test.json"), folder.join("cameras.json"));
    fs::copy(&inside, &outside).expect("copied");
    for (camera, sound) in of(&inside).iter().zip(&sound) {
        assert!(camera.c2w.abs_diff_eq(sound.c2w, 1e-12), "{}", camera.name);
    }
    assert!(!of(&outside)[0].c2w.abs_diff_eq(sound[0].c2w, 0.1));
    let rendered = |cameras: &str, out: &str| {
        succeeds(folder, &["render", "run", "--cameras", cameras, "--out", out]);
        image::open(folder.join(out).join("test/r_000.png")).expect("an image").to_rgb8()
    };
    assert!(rendered("scene/transforms_test.json", "a") != rendered("cameras.json", "b"));
}

/// Cameras of Inria's and nerfstudio's viewers show what the same cameras of a transforms.json show.
#[test]
fn cameras_of_other_viewers_are_rendered() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    trained_at(folder, [0.0; 3]);
    let camera = load_cameras(&folder.join("scene/transforms_test.json")).expect("cameras").remove(0);
    let row = |m: &DMat4, i: usize| m.row(i).to_array();
    let rotation: Vec<Vec<f64>> = (0..3).map(|i| row(&camera.c2w, i)[..3].to_vec()).collect();
    let DVec3 { x, y, z } = camera.c2w.w_axis.truncate();
    let (width, height) = (camera.width, camera.height);
    let inria = json!([{"id": 0, "img_name": "one", "width": width, "height": height, "position": [x, y, z],
        "rotation": rotation, "fx": camera.intrinsics.fx, "fy": camera.intrinsics.fy}]);
    fs::write(folder.join("cameras.json"), inria.to_string()).expect("written");
    let opengl = camera.c2w * DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0));
    let flat: Vec<f64> = (0..4).flat_map(|i| row(&opengl, i)).collect();
    let fov = 2.0 * (0.5 * height as f64 / camera.intrinsics.fy).atan().to_degrees();
    let path = json!({"camera_type": "perspective", "render_width": width, "render_height": height,
        "fps": 24, "seconds": 1, "camera_path": [{"camera_to_world": flat, "fov": fov, "aspect": 1.3}], "keyframes": []});
    fs::write(folder.join("camera_path.json"), path.to_string()).expect("written");
    let shown = |cameras: &str, out: &str, name: &str| {
        succeeds(folder, &["render", "run", "--cameras", cameras, "--out", out]);
        image::open(folder.join(out).join(name)).expect("an image").to_rgb8()
    };
    let expected = shown("scene/transforms_test.json", "a", "test/r_000.png");
    for found in [shown("cameras.json", "b", "one.png"), shown("camera_path.json", "c", "path_0000.png")] {
        assert_eq!(found.dimensions(), expected.dimensions());
        let most = found.as_raw().iter().zip(expected.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
        // Rounding of the focal length may turn a value at the edge of a step.
        assert!(most <= Some(2), "{most:?}");
    }
}

//! Scenes in files of other programs: written, read and rendered again.

use crate::common;

use std::fs;
use std::path::Path;

use crate::common::program::{QUICK, fails, fails_with, says, succeeds};
use glam::{DMat3, DMat4, DVec3};
use gs_base::Intrinsics;
use gs_burn::{Camera, RenderOptions, render};
use gs_splats::Splats;
use gs_train::run::exchange::{Packed, host::gaussians_of};

fn trained(folder: &Path) {
    common::tiny_scene(folder);
    let train: Vec<&str> = ["train", "scene", "--out", "run"].into_iter().chain(QUICK).collect();
    succeeds(folder, &train);
}

/// PSNR between two 8-bit pictures, dB; 100 where they are equal.
fn psnr(a: &Path, b: &Path) -> f64 {
    let read = |path: &Path| image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8();
    let (a, b) = (read(a), read(b));
    assert_eq!(a.dimensions(), b.dimensions());
    let squares = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
    let mse = squares / a.as_raw().len() as f64 / 255.0_f64.powi(2);
    -10.0 * mse.max(1e-10).log10()
}

#[test]
fn a_scene_goes_through_every_format() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    trained(folder);
    let header = fs::read(folder.join("run/scene.ply")).expect("read");
    assert!(String::from_utf8_lossy(&header[..200]).contains("comment SplatRenderMode: default"));
    for ending in ["ply", "spz", "glb", "usda"] {
        let file = format!("out/scene.{ending}");
        assert!(succeeds(folder, &["export", "run", "--out", &file]).contains("Gaussians"));
        // A file of ours is written over.
        succeeds(folder, &["export", "run", "--out", &file]);
    }
    succeeds(folder, &["convert", "out/scene.glb", "out/again.ply"]);
    succeeds(folder, &["convert", "out/again.ply", "out/again.spz"]);
    succeeds(folder, &["convert", "out/scene.spz", "out/from.glb", "--sh-degree", "1"]);
    assert!(succeeds(folder, &["info", "out/from.glb"]).contains("SH degree    1"));
    let shown = |scene: &str, out: &str| {
        succeeds(folder, &["render", scene, "--cameras", "scene/transforms_test.json", "--out", out]);
        folder.join(out).join("test/r_000.png")
    };
    let reference = shown("out/scene.ply", "a");
    // glTF keeps all but the rounding of exp and ln; SPZ rounds, to what a viewer's 8 bits hardly show.
    assert!(psnr(&reference, &shown("out/again.ply", "b")) > 60.0);
    assert!(psnr(&reference, &shown("out/scene.spz", "c")) > 38.0);
    assert!(psnr(&reference, &shown("out/again.spz", "d")) > 38.0);
    assert!(psnr(&reference, &shown("run", "e")) > 60.0);

    let sentence = succeeds(folder, &["export", "run", "--out", "small.spz", "--target-mb", "0.002"]);
    assert!(fs::metadata(folder.join("small.spz")).expect("a file").len() <= 2000, "{sentence}");
    assert!(sentence.contains("in place of") && sentence.contains("held-out photos"), "{sentence}");
    assert!(
        fails(folder, &["export", "run", "--out", "no.spz", "--target-mb", "0.00001"]).contains("not one Gaussian")
    );
    assert!(
        fails(folder, &["export", "out/scene.ply", "--out", "no.spz", "--target-mb", "0.002"]).contains("needs a run")
    );

    for (args, word) in [
        (["convert", "out/scene.usda", "x.ply"], "written and not read"),
        (["convert", "out/scene.ply", "x.splat"], ".ply, .spz, .glb or .usda"),
        (["convert", "none.ply", "x.spz"], "found nothing"),
        (["convert", "scene", "x.spz"], "expected a scene (.ply, .spz, .glb, .sog, .splat or .ksplat)"),
        (["convert", "out/scene.ply", "out/scene.ply"], "the file to read"),
    ] {
        assert!(fails(folder, &args).contains(word), "{args:?}: {}", fails(folder, &args));
    }
    fs::write(folder.join("broken.spz"), b"not gzip at all").expect("written");
    fs::write(folder.join("broken.glb"), b"glTF and no more").expect("written");
    for file in ["broken.spz", "broken.glb"] {
        assert!(fails(folder, &["convert", file, "x.ply"]).contains(file));
        assert!(fails(folder, &["info", file]).contains(file));
    }
    fails_with(2, folder, &["export", "run", "--out", "x.spz", "--up", "w"]);
}

/// The demo's world has z up. A scene that was turned has its cameras' up at -y; `auto` finds the same within the
/// cameras' tilt.
#[test]
fn up_is_turned() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    trained(folder);
    for up in ["z", "auto"] {
        succeeds(folder, &["export", "run", "--out", "up.ply", "--up", up]);
        let means =
            |file: &str| gs_splats::ply::read(&folder.join(file)).expect("a scene").splats.means.into_flattened();
        let (before, after) = (means("run/scene.ply"), means("up.ply"));
        let most = before.chunks(3).zip(after.chunks(3)).map(|(a, b)| (a[2] + b[1]).abs()).fold(0.0, f32::max);
        let bound = if up == "z" { 1e-4 } else { 2.0 };
        assert!(most < bound, "{up}: z became {most} off -y");
    }
    assert!(fails(folder, &["export", "run/scene.ply", "--out", "no.ply", "--up", "auto"]).contains("name the axis"));
}

/// Turning the scene and the camera alike changes no picture but for rounding: a Gaussian at the edge of what is
/// blended (1/255) may appear or vanish in single pixels, all others differ by rounding of f32.
#[test]
fn a_turned_scene_looks_as_before_from_the_turned_camera() {
    let device = common::device();
    let at = |i: usize, k: usize| ((13 * i + 7 * k) as f32 * 0.731).sin();
    let splats = Splats {
        means: (0..60).map(|i| [at(i, 0), at(i, 1), at(i, 2)]).collect(),
        quats: (0..60).map(|i| [1.2 + at(i, 3), at(i, 4), at(i, 5), at(i, 6)]).collect(),
        log_scales: (0..60).map(|i| [at(i, 7) - 2.0, at(i, 8) - 2.0, at(i, 9) - 2.0]).collect(),
        opacity_logits: (0..60).map(|i| 2.0 * at(i, 10)).collect(),
        degree: 3,
        sh: (0..960).map(|i| [0.4 * at(i, 11), 0.4 * at(i, 12), 0.4 * at(i, 13)]).collect(),
        ..Splats::default()
    };
    let k = Intrinsics { fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 };
    let c2w = DMat4::from_translation(DVec3::new(0.2, -0.1, -4.0));
    let shown = |scene: &Packed, c2w: DMat4| -> Vec<f32> {
        let camera = Camera::from_c2w(c2w, k, 64, 48, &device);
        let options = RenderOptions { sh_degree: 3, ..RenderOptions::default() };
        render(&gaussians_of(&scene.splats, &device), &camera, &options).color.into_data().iter::<f32>().collect()
    };
    let scene = Packed { splats, motion: None, samples: 0 };
    let reference = shown(&scene, c2w);
    assert!(reference.iter().any(|x| *x > 0.2));
    for rotation in [
        DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.1),
        DMat3::from_rotation_x(std::f64::consts::PI),
        DMat3::from_rotation_z(0.4),
    ] {
        let turned = shown(&scene.turned(rotation), DMat4::from_mat3(rotation) * c2w);
        let differences: Vec<f32> = reference.iter().zip(&turned).map(|(a, b)| (a - b).abs()).collect();
        let mean = differences.iter().sum::<f32>() / differences.len() as f32;
        let most = differences.iter().copied().fold(0.0, f32::max);
        assert!(mean < 1e-5 && most < 0.02, "mean {mean}, most {most}");
    }
}

/// A moving scene: a glTF file moves where it is read again, and its middle is the scene's middle.
#[test]
fn a_motion_is_written_and_read() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = ["--size", "48x36", "--cameras", "4", "--frames", "4", "--subframes", "16", "--points", "100"];
    succeeds(folder, &["synth", "deblur", "cube", "--out", "world"].into_iter().chain(world).collect::<Vec<_>>());
    let train = ["train", "world", "--out", "run", "--set", "pipeline=taylormode"];
    succeeds(folder, &train.into_iter().chain(QUICK).collect::<Vec<_>>());
    succeeds(folder, &["export", "run", "--out", "moving.glb"]);
    succeeds(folder, &["export", "run", "--out", "still.glb", "--time", "0.25"]);
    succeeds(folder, &["export", "run", "--out", "moving.usda", "--frames", "3", "--up", "z"]);
    let usda = fs::read_to_string(folder.join("moving.usda")).expect("read");
    assert!(usda.contains("endTimeCode = 2") && usda.contains("positions.timeSamples"));
    let shown = |scene: &str, t: &str, out: &str| {
        let args = ["render", scene, "--cameras", "world/transforms_test.json", "--time", t, "--out", out];
        succeeds(folder, &args);
        let camera =
            fs::read_dir(folder.join(out).join("test")).expect("a folder").next().expect("a camera").expect("read");
        let mut pictures: Vec<_> =
            fs::read_dir(camera.path()).expect("a folder").map(|file| file.expect("read").path()).collect();
        pictures
            .retain(|path| !path.to_string_lossy().contains("_alpha") && !path.to_string_lossy().contains("_depth"));
        pictures.sort();
        pictures.remove(0)
    };
    for t in ["0", "0.5", "1"] {
        let (run, file) = (shown("run", t, &format!("run{t}")), shown("moving.glb", t, &format!("glb{t}")));
        assert!(psnr(&run, &file) > 50.0, "at {t}: {} dB", psnr(&run, &file));
    }
    let [_, told] = says(folder, &["convert", "moving.glb", "middle.ply"]);
    assert!(told.contains("one moment"), "{told}");
    succeeds(folder, &["convert", "moving.glb", "again.glb"]);
    assert!(
        fails(folder, &["render", "still.glb", "--cameras", "world", "--time", "0.5", "--out", "no"]).contains("moves")
    );
}

#[test]
fn paths_become_images_and_a_film() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    trained(folder);
    let path = ["--images", "3", "--size", "31x24"];
    let said = succeeds(
        folder,
        &["render", "run", "--orbit", "--out", "orbit", "--video"].into_iter().chain(path).collect::<Vec<_>>(),
    );
    assert!(folder.join("orbit/orbit_0002.png").is_file() && said.contains("a film"), "{said}");
    let film = ["mp4", "gif"].map(|ending| folder.join(format!("orbit/video.{ending}")));
    let film = film.iter().find(|path| path.is_file()).expect("a film");
    assert!(fs::metadata(film).expect("a film").len() > 200);
    // Written over, since it is ours.
    succeeds(
        folder,
        &["render", "run", "--orbit", "--out", "orbit", "--video"].into_iter().chain(path).collect::<Vec<_>>(),
    );
    succeeds(folder, &["render", "run", "--spiral", "--out", "spiral"].into_iter().chain(path).collect::<Vec<_>>());
    let between =
        ["render", "run/scene.ply", "--cameras", "scene/transforms_test.json", "--between", "test/r_000", "test/r_001"];
    succeeds(folder, &between.into_iter().chain(["--out", "between"]).chain(path).collect::<Vec<_>>());
    assert!(folder.join("between/between_0002.png").is_file());
    let keys = r#"{"keyframes": [{"position": [0, -4, 1], "look_at": [0, 0, 0], "up": [0, 0, 1]}], "width": 32, "height": 24, "images": 1}"#;
    fs::write(folder.join("path.json"), keys).expect("written");
    succeeds(folder, &["render", "run/scene.ply", "--cameras", "path.json", "--out", "keys"]);
    assert!(folder.join("keys/path_0000.png").is_file());
    assert!(fails(folder, &["render", "run/scene.ply", "--orbit", "--out", "no"]).contains("--cameras"));
    let nobody = ["render", "run", "--between", "test/r_000", "nobody", "--out", "no"];
    assert!(fails(folder, &nobody).contains("name of a camera"));
    assert!(fails(folder, &["render", "run", "--orbit", "--size", "0x5", "--out", "no"]).contains("--size"));
    fails_with(2, folder, &["render", "run", "--orbit", "--spiral", "--out", "no"]);
}

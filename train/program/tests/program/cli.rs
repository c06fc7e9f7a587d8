//! The program itself: commands work end to end, and bad input ends with one sentence and a non-zero exit.

use std::fs;
use std::process::Command;

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_train::run::exchange::host::splats_of;
use gsburn::report::comparison::{Table, gather};

use crate::common::program::{QUICK, fails, fails_with, gsburn, program, succeeds};
use crate::common::{self, read_json};

#[test]
fn a_scene_goes_from_photos_to_frames() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    assert!(succeeds(folder, &["check", "scene"]).contains("5"));
    let train: Vec<&str> = ["train", "scene", "--out", "run"].into_iter().chain(QUICK).collect();
    assert!(succeeds(folder, &train).contains("report.html"));
    for file in ["config.toml", "metrics.jsonl", "eval.json", "scene.ply", "report.html", "plots/psnr.svg"] {
        assert!(folder.join("run").join(file).is_file(), "{file}");
    }
    let eval = read_json(&folder.join("run/eval.json"));
    assert!(eval["psnr"].as_f64().expect("a number") > 5.0);
    assert!(eval["lpips"].is_number() || eval["lpips_reason"].is_string(), "LPIPS or a reason");
    assert_eq!(eval["step"], 12);
    let page = fs::read_to_string(folder.join("run/report.html")).expect("read");
    assert!(page.contains("data:image/png;base64,") && !page.contains("http://") || page.contains("w3.org"));

    assert!(succeeds(folder, &["eval", "run", "--renders", "shown"]).contains("mean"));
    assert!(succeeds(folder, &["eval", "run/scene.ply", "--data", "scene"]).contains("mean"));
    assert!(succeeds(folder, &["info", "run"]).contains("SH degree    3"));
    assert!(succeeds(folder, &["info"]).contains("flex"));
    succeeds(folder, &["export", "run", "--out", "ply/out.ply", "--no-floaters", "--sh-degree", "1"]);
    assert!(succeeds(folder, &["info", "ply/out.ply"]).contains("SH degree    1"));

    let cameras = "scene/transforms_test.json";
    succeeds(folder, &["render", "run", "--cameras", cameras, "--out", "png"]);
    succeeds(
        folder,
        &["render", "ply/out.ply", "--cameras", cameras, "--out", "exr", "--format", "exr", "--background", "white"],
    );
    for file in ["png/test/r_000.png", "png/test/r_000_depth.png", "png/test/r_000_alpha.png", "exr/test/r_001.exr"] {
        assert!(folder.join(file).is_file(), "{file}");
    }
    let runs = gather(&[folder.join("run")]).expect("a finished run").runs;
    assert!(Table::new(&runs).markdown().contains("| run | 160 | 12 |"));
}

/// A moving scene at times of the user's own: each camera once, times outside the recording said, still scenes refused.
#[test]
fn a_moving_scene_is_shown_at_any_time() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = ["--size", "48x36", "--cameras", "4", "--frames", "4", "--subframes", "16", "--points", "100"];
    let synth: Vec<&str> = ["synth", "deblur", "cube", "--out", "world"].into_iter().chain(world).collect();
    succeeds(folder, &synth);
    let train: Vec<&str> =
        ["train", "world", "--out", "run", "--set", "pipeline=taylormode"].into_iter().chain(QUICK).collect();
    succeeds(folder, &train);
    assert!(succeeds(folder, &["info", "run"]).contains("recording    0 to 1"));

    let render = |more: &[&'static str]| -> Vec<&str> {
        let scene = if more.contains(&"still") { "run/scene.ply" } else { "run" };
        let args = ["render", scene, "--cameras", "world/transforms_test.json", "--out", "shown"];
        args.into_iter().chain(more.iter().copied().filter(|arg| *arg != "still")).collect()
    };
    succeeds(folder, &render(&["--frames", "2", "--gif"]));
    let shown = fs::read_dir(folder.join("shown/test")).expect("a folder").map(|entry| entry.expect("read").path());
    let names: Vec<_> = shown.flat_map(|camera| fs::read_dir(camera).expect("a folder")).collect();
    // Of one held-out camera two moments (colour, depth, alpha) and one animation, not of each of its four frames.
    assert_eq!(names.len(), 7, "{names:?}");

    let late = gsburn(folder, &render(&["--time", "7"]));
    let said = String::from_utf8_lossy(&late.stderr).into_owned();
    assert!(late.status.success() && said.contains("outside the recording, which is from 0 to 1"), "{said}");
    assert!(fails(folder, &render(&["still", "--time", "0.5"])).contains("expected a scene that moves"));
    assert!(fails(folder, &["export", "run/scene.ply", "--out", "a.ply", "--frames", "2"]).contains("stands still"));

    // Resumed when it is finished, and on a folder of another name: measured once in the figures, and the move said.
    fs::rename(folder.join("world"), folder.join("moved")).expect("moved");
    let resumed = gsburn(folder, &["train", "moved", "--resume", "--out", "run"]);
    let said = String::from_utf8_lossy(&resumed.stderr).into_owned();
    assert!(resumed.status.success() && said.contains("the run began on"), "{said}");
    let eval = read_json(&folder.join("run/eval.json"));
    assert_eq!(eval["evaluations"].as_array().map(Vec::len), Some(1));

    // With a photo fewer it is another data set, for a run that still has something to write.
    fs::remove_file(folder.join("run/report.html")).expect("removed");
    let frames = folder.join("moved/transforms_train.json");
    let mut cameras = read_json(&frames);
    cameras["frames"].as_array_mut().expect("frames").pop();
    fs::write(&frames, cameras.to_string()).expect("written");
    let error = fails(folder, &["train", "moved", "--resume", "--out", "run"]);
    assert!(error.contains("expected the 12 training views") && error.contains("found 11"), "{error}");
}

#[test]
fn a_killed_run_continues() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    let mut running = program(folder)
        .args(["train", "scene", "--out", "run", "--quiet", "--steps", "100000", "--set", "checkpoint.every=5"])
        .spawn()
        .expect("the program starts");
    let saved = || gs_train::run::folder::RunFolder::at(folder.join("run")).saved();
    while saved().is_empty() {
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(running.try_wait().expect("a process").is_none(), "it runs until it is killed");
    }
    running.kill().expect("killed");
    running.wait().expect("ended");
    assert!(!saved().is_empty(), "the last checkpoint is whole");

    let config = fs::read_to_string(folder.join("run/config.toml")).expect("read");
    fs::write(folder.join("run/config.toml"), config.replace("steps = 100000", "steps = 99999")).expect("written");
    let error = fails(folder, &["train", "--resume", "--out", "run", "--quiet"]);
    assert!(error.contains("expected the configuration of"), "{error}");
}

/// Ctrl-C and a batch system's SIGTERM save, leave, and are continued.
#[cfg(unix)]
#[test]
fn an_interrupted_run_saves_and_continues() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let begin = ["train", "scene", "--out", signal, "--quiet", "--steps", "100000"];
        let mut running = program(folder).args(begin).spawn().expect("the program starts");
        let lines =
            || fs::read_to_string(folder.join(signal).join("metrics.jsonl")).unwrap_or_default().lines().count();
        while lines() == 0 {
            std::thread::sleep(std::time::Duration::from_millis(20));
            assert!(running.try_wait().expect("a process").is_none(), "it runs until it is interrupted");
        }
        let id = running.id().to_string();
        assert!(Command::new("kill").args([format!("-{signal}"), id]).status().expect("kill").success());
        assert_eq!(running.wait().expect("ended").code(), Some(code), "{signal}");
        let saved = gs_train::run::folder::RunFolder::at(folder.join(signal)).saved();
        let step = saved.last().expect("it saved").0;
        assert!(step >= 10, "{signal}: step {step}");
    }
}

/// A picture that needs more pairs of tile and Gaussian than can be counted is an error, not a panic.
/// The plan is in the configuration, which a resumed run reads; nothing asks a clock again.
#[test]
fn a_budget_of_minutes_becomes_a_number_of_steps() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    let sets = ["--quiet", "--cap=160", "--set", "eval.ms_ssim=false", "--set", "eval.images=1"];
    let train = |minutes: &'static str| -> Vec<&str> {
        ["train", "scene", "--out", "run", "--minutes", minutes].into_iter().chain(sets).collect()
    };
    let refused = fails_with(2, folder, &train("0"));
    assert!(refused.contains("expected a number above 0"), "{refused}");
    let refused = fails(folder, &train("1e-9"));
    assert!(refused.contains("expected more") && !folder.join("run").exists(), "{refused}");
    let both: Vec<&str> = train("1").into_iter().chain(["--steps", "5"]).collect();
    assert!(fails_with(2, folder, &both).contains("cannot be used with"));

    succeeds(folder, &train("0.03"));
    let text = fs::read_to_string(folder.join("run/config.toml")).expect("read");
    let steps = text.parse::<toml::Table>().expect("TOML")["steps"].as_integer().expect("a number");
    let eval = read_json(&folder.join("run/eval.json"));
    assert_eq!(eval["step"].as_i64(), Some(steps));
}

#[test]
fn a_picture_too_large_is_said() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    // 875 x 875 tiles, each reached by 3000 Gaussians.
    let device = common::named("flex");
    let (count, side) = (3000, 14_000);
    let gaussians = Gaussians::from_tensors(
        Tensor::zeros([count, 3], &device),
        Tensor::ones([count, 4], &device),
        Tensor::full([count, 3], 3.0, &device),
        Tensor::zeros([count], &device),
        Tensor::zeros([count, 1, 3], &device),
    );
    gs_splats::ply::write(&folder.join("large.ply"), &splats_of(&gaussians, None)).expect("written");
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,9],[0,0,0,1]]";
    let frames = format!(r#"[{{"file_path": "a", "transform_matrix": {pose}}}]"#);
    let camera = format!(r#"{{"fl_x": {side}, "w": {side}, "h": {side}, "frames": {frames}}}"#);
    fs::write(folder.join("large.json"), camera).expect("written");
    let error = fails(folder, &["render", "large.ply", "--cameras", "large.json", "--out", "x", "--device", "flex"]);
    assert!(error.contains("2^31 pairs") && error.contains("a smaller image"), "{error}");
}

#[test]
fn bad_input_is_one_sentence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    common::tiny_scene(folder);
    fs::write(folder.join("garbage.ply"), "not a ply").expect("written");
    fs::write(folder.join("garbage.safetensors"), "not a checkpoint").expect("written");
    fs::write(folder.join("bad.toml"), "steps = = 3").expect("written");
    fs::write(folder.join("wrong.toml"), "[density]\ncapp = 3").expect("written");
    fs::create_dir(folder.join("empty")).expect("made");
    fs::create_dir(folder.join("full")).expect("made");
    fs::write(folder.join("full/config.toml"), "").expect("written");

    for frame in 0..5 {
        let mask = folder.join(format!("masked/masks/{frame}.png"));
        gs_datasets::image_io::write_png(&mask, 4, 3, &[0; 36]).expect("written");
        let photo: [u8; 36] = std::array::from_fn(|i| i as u8);
        gs_datasets::image_io::write_png(&folder.join(format!("masked/{frame}.png")), 4, 3, &photo).expect("written");
    }
    let frame = |i: usize| {
        let pose = format!("[[1,0,0,{i}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]");
        format!(r#"{{"file_path": "{i}.png", "mask_path": "masks/{i}.png", "transform_matrix": {pose}}}"#)
    };
    let frames = (0..5).map(frame).collect::<Vec<_>>().join(",");
    let cameras = format!(r#"{{"fl_x": 4, "frames": [{frames}]}}"#);
    fs::write(folder.join("masked/transforms.json"), cameras).expect("written");

    let absent = if cfg!(feature = "cuda") { "metal" } else { "cuda" };
    let table: [(&[&str], &[&str]); 20] = [
        (&["synth", "deblur", "cube", "--out", "scene"], &["scene", "expected an empty or a new folder"]),
        (&["train", "nowhere"], &["nowhere", "found nothing"]),
        (&["train", "empty"], &["empty", "expected"]),
        (&["train", "masked"], &["masked", "expected photos with pixels that count"]),
        (&["train", "scene", "--out", "full"], &["full", "already holds a run"]),
        (&["train", "scene", "--set", "density.capp=1"], &["density.capp", "density.cap"]),
        (&["train", "scene", "--config", "wrong.toml"], &["wrong.toml", "density.cap"]),
        (&["train", "scene", "--config", "bad.toml"], &["bad.toml", "TOML"]),
        (&["train", "scene", "--config", "none.toml"], &["none.toml", "cannot read"]),
        (&["train", "scene", "--set", "steps=-1"], &["steps"]),
        (&["train", "scene", "--set", "loss.dssim=2"], &["loss.dssim", "from 0 to 1", "2"]),
        (&["train", "scene", "--device", absent], &[absent, "--features"]),
        (&["train", "scene", "--device", "abacus"], &["abacus", "expected"]),
        (&["train", "--resume"], &["--out"]),
        (&["train", "--resume", "--out", "empty"], &["empty", "run folder"]),
        (&["eval", "garbage.ply", "--data", "scene"], &["garbage.ply"]),
        (&["eval", "garbage.safetensors"], &["garbage.safetensors", "expected a gsburn checkpoint"]),
        (&["render", "empty", "--cameras", "scene/transforms_test.json", "--out", "x"], &["empty", "checkpoint"]),
        (&["export", "none.ply", "--out", "x.ply"], &["none.ply", "found nothing"]),
        (&["export", "garbage.ply", "--out", "x.txt"], &["x.txt", ".ply"]),
    ];
    for (args, expected) in table {
        let error = fails(folder, args);
        assert!(expected.iter().all(|part| error.contains(part)), "{args:?}: {error}");
    }
    assert_eq!(fs::read_dir(folder.join("empty")).expect("read").count(), 0, "nothing is left half-written");
    assert!(!folder.join("runs").exists(), "no run folder is made for a run that cannot start");
    assert!(!folder.join("x").exists() && !folder.join("x.ply").exists());
}

//! Failures around a run: damaged and missing files, full disks, a second writer, names that steer a terminal,
//! signals.

use crate::common;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::common::{config, finish, job, tiny_scene, train};
use gs_train::run::folder::{MetricsLine, RunFolder};
use gs_train::run::lock::Lock;
use gs_train::run::watch::{Ending, Job};

/// The program in `folder`, with a cache of its own.
fn gsburn(folder: &Path) -> Command {
    let mut program = common::program::program(folder);
    program.env("XDG_CACHE_HOME", folder.join("cache"));
    program
}

fn output(folder: &Path, args: &[&str]) -> Output {
    gsburn(folder).args(args).output().expect("the program starts")
}

fn succeeds(folder: &Path, args: &[&str]) -> [String; 2] {
    let output = output(folder, args);
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{args:?}: {err}");
    [out, err]
}

/// The text on stderr of a command that must fail, and not by a panic.
fn fails(folder: &Path, args: &[&str]) -> String {
    let output = output(folder, args);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{args:?}: {errors}");
    assert!(errors.contains("error: ") && !errors.contains("panicked"), "{args:?}: {errors}");
    errors
}

/// A run of 40 steps on the tiny scene that saves twice. It keeps as many checkpoints as runs do by default.
fn short(folder: &Path) -> Job {
    let config = config(40, &["checkpoint.every=20", "density.start=10", "density.every=10"]);
    job(&tiny_scene(folder), &folder.join("run"), &config)
}

const QUICK: [&str; 6] = ["--set", "eval.ms_ssim=false", "--set", "eval.lpips=false", "--set", "eval.images=1"];

/// Names and contents of all files below a folder.
fn content(folder: &Path) -> Vec<(std::path::PathBuf, Vec<u8>, std::time::SystemTime)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(content(&path));
        } else {
            let changed = entry.metadata().and_then(|data| data.modified()).expect("a time");
            found.push((path.clone(), fs::read(&path).expect("read"), changed));
        }
    }
    found.sort();
    found
}

#[test]
fn renderings_are_never_written_over_photos() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    finish(&short(folder));
    let photos = content(&folder.join("scene"));
    for out in ["scene", "scene/.", "link"] {
        #[cfg(unix)]
        if out == "link" {
            std::os::unix::fs::symlink(folder.join("scene"), folder.join("link")).expect("linked");
        }
        let said = fails(folder, &["render", "run", "--cameras", "scene/transforms_train.json", "--out", out]);
        assert!(said.contains("r_000.png"), "{said}");
    }
    assert_eq!(content(&folder.join("scene")), photos);
    // Into a folder of its own, twice: a rendering may be renewed.
    for _ in 0..2 {
        succeeds(folder, &["render", "run", "--cameras", "scene/transforms_test.json", "--out", "frames", "--maps"]);
    }
    fs::write(folder.join("mine.ply"), "my points").expect("written");
    assert!(fails(folder, &["export", "run", "--out", "mine.ply"]).contains("mine.ply"));
    fs::write(folder.join("mine.json"), "{}").expect("written");
    assert!(fails(folder, &["eval", "run", "--out", "mine.json"]).contains("mine.json"));
    for _ in 0..2 {
        succeeds(folder, &["export", "run", "--out", "ours.ply"]);
        succeeds(folder, &["eval", "run", "--out", "ours.json", "--renders", "pictures"]);
    }
}

#[cfg(unix)]
#[test]
fn paths_that_are_not_utf8_are_refused_before_the_first_step() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    tiny_scene(folder);
    let odd = OsStr::from_bytes(b"sc\xffene");
    fs::rename(folder.join("scene"), folder.join(odd)).expect("renamed");
    let refused = |command: &mut Command| {
        let output = command.output().expect("the program starts");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(errors.contains("UTF-8") && !errors.contains("panicked"), "{errors}");
    };
    refused(gsburn(folder).arg("train").arg(odd).args(["--out", "run", "--steps", "3"]));
    refused(gsburn(folder).arg("check").arg(odd));
    refused(gsburn(folder).arg("sweep").arg(odd).args(["--out", "sweep", "--over", "seed=1,2", "--set", "steps=3"]));
    assert!(!folder.join("run").exists());
    fs::rename(folder.join(odd), folder.join("scene")).expect("renamed");
    refused(gsburn(folder).args(["train", "scene", "--steps", "3", "--out"]).arg(OsStr::from_bytes(b"r\xfe")));
}

#[test]
fn a_log_without_a_terminal_shows_steps_and_time() {
    let temporary = tempfile::tempdir().expect("a folder");
    tiny_scene(temporary.path());
    let train = [&["train", "scene", "--out", "run", "--steps", "5"][..], &QUICK].concat();
    let [_, errors] = succeeds(temporary.path(), &train);
    assert!(errors.contains("reading scene ..."), "{errors}");
    assert!(errors.contains("step 5 of 5") && errors.contains("s left"), "{errors}");
}

#[cfg(unix)]
#[test]
fn files_without_end_are_refused() {
    use std::os::unix::fs::symlink;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    finish(&short(folder));
    assert!(fails(folder, &["train", "scene", "--config", "/dev/zero"]).contains("a device"));
    fs::write(folder.join("based.toml"), "base = \"zero\"\n").expect("written");
    symlink("/dev/zero", folder.join("zero")).expect("linked");
    assert!(fails(folder, &["train", "scene", "--config", "based.toml"]).contains("a device"));
    let run = folder.join("run");
    for (file, command) in [
        ("config.toml", &["train", "--resume", "--out", "run"][..]),
        ("checkpoints/step-0000040.safetensors", &["info", "run"]),
    ] {
        fs::rename(run.join(file), folder.join("kept")).expect("renamed");
        symlink("/dev/zero", run.join(file)).expect("linked");
        assert!(fails(folder, command).contains("a device"), "{file}");
        fs::rename(folder.join("kept"), run.join(file)).expect("renamed");
    }
    fs::remove_file(run.join("checkpoints/step-0000040.safetensors")).expect("removed");
    fs::remove_file(run.join("metrics.jsonl")).expect("removed");
    symlink("/dev/zero", run.join("metrics.jsonl")).expect("linked");
    assert!(fails(folder, &["train", "--resume", "--out", "run"]).contains("a device"));
}

#[test]
fn a_damaged_newest_checkpoint_is_set_aside() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut job = short(temporary.path());
    finish(&job);
    assert_eq!(job.folder.saved().iter().map(|(step, _)| *step).collect::<Vec<_>>(), [20, 40]);
    let newest = job.folder.checkpoint(40);
    let whole = fs::read(&newest).expect("read");
    job.resume = true;
    for damage in [&whole[..whole.len() / 2], &[&whole[..whole.len() - 1], &[!whole[whole.len() - 1]]].concat(), b""] {
        fs::write(&newest, damage).expect("written");
        finish(&job);
        assert!(newest.with_extension("damaged").is_file());
        assert!(fs::read(&newest).expect("read") == whole, "it goes on from step 20 to the same bits");
    }
    for (_, path) in job.folder.saved() {
        fs::write(path, "").expect("written");
    }
    let said = format!("{:#}", train(&job).expect_err("nothing is whole"));
    assert!(said.contains("no whole checkpoint") && said.contains("step-0000040"), "{said}");
}

#[test]
fn a_save_that_fails_is_tried_again() {
    let temporary = tempfile::tempdir().expect("a folder");
    let job = short(temporary.path());
    // A folder where the checkpoint's temporary file would be: the first save fails, the last one does not.
    fs::create_dir_all(job.folder.checkpoint(20).with_extension("part").join("x")).expect("made");
    finish(&job);
    assert_eq!(job.folder.saved().iter().map(|(step, _)| *step).collect::<Vec<_>>(), [40]);
    let last = Job { folder: RunFolder::at(temporary.path().join("other")), ..job };
    fs::create_dir_all(last.folder.checkpoint(40).with_extension("part").join("x")).expect("made");
    let said = format!("{:#}", train(&last).expect_err("the last save fails"));
    assert!(said.contains("cannot write the checkpoint"), "{said}");
    assert_eq!(said.matches("os error").count(), 1, "{said}");
    // What fits is written all the same.
    assert!(said.ends_with("scene.ply, eval.json, metrics.jsonl and report.html are written"), "{said}");
    let folder = &last.folder;
    assert!([folder.ply(), folder.eval(), folder.report()].iter().all(|path| path.is_file()));
    assert_eq!(folder.read_eval().expect("figures").last.step, 40);
}

/// A run that is killed while its report is written is measured again when it is resumed.
#[test]
fn the_last_measurement_is_in_the_metrics_once() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut job = short(temporary.path());
    finish(&job);
    fs::remove_file(job.folder.report()).expect("removed");
    job.resume = true;
    finish(&job);
    let lines = job.folder.read_metrics(40).expect("metrics");
    let measured = lines.iter().filter(|line| matches!(line, MetricsLine::Eval(_))).map(MetricsLine::step);
    assert_eq!(measured.collect::<Vec<_>>(), [40]);
}

/// Figures of the last step are the result on standard output, and not progress as well.
#[test]
fn the_result_is_said_once() {
    let temporary = tempfile::tempdir().expect("a folder");
    tiny_scene(temporary.path());
    let train = [&["train", "scene", "--out", "run", "--steps", "5"][..], &QUICK].concat();
    let [said, errors] = succeeds(temporary.path(), &train);
    let line = said.lines().find(|line| line.contains("PSNR")).expect("figures");
    assert!(line.contains("step 5") && !errors.contains(line), "{line}\n{errors}");
}

#[test]
fn a_data_set_that_was_moved_is_told() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let mut job = short(folder);
    job.stop_at = Some(20);
    train(&job).expect("stopped");
    fs::rename(folder.join("scene"), folder.join("moved")).expect("moved");
    let said = fails(folder, &["train", "--resume", "--out", "run"]);
    assert!(said.contains("gsburn train NEWPLACE --resume --out run"), "{said}");
    succeeds(folder, &["train", "moved", "--resume", "--out", "run"]);
}

/// Commands that fill a folder refuse those of others before they compute, and say who writes one.
#[test]
fn folders_of_results_are_our_own_and_have_one_writer() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    tiny_scene(folder);
    let before = content(&folder.join("scene"));
    let sweep = ["sweep", "scene", "--over", "seed=1,2", "--set", "steps=2", "--out"];
    let said = fails(folder, &[&sweep[..], &["scene"]].concat());
    assert!(said.contains("expected an empty folder") && said.contains("in it"), "{said}");
    let out = folder.join("out");
    let held = Lock::of_results(&out).expect("free");
    let said = fails(folder, &[&sweep[..], &["out"]].concat());
    assert!(said.contains(&format!("process {} is writing", std::process::id())), "{said}");
    drop(held);
    assert!(!out.exists());
    assert!(content(&folder.join("scene")) == before);
}

#[test]
fn a_finished_run_that_is_resumed_writes_nothing() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut job = short(temporary.path());
    let first = finish(&job);
    let before = content(job.folder.path());
    job.resume = true;
    assert_eq!(finish(&job).last.step, first.last.step);
    assert!(content(job.folder.path()) == before, "bytes and times are the same");
}

#[test]
fn one_folder_has_one_writer() {
    let temporary = tempfile::tempdir().expect("a folder");
    let mut job = short(temporary.path());
    job.stop_at = Some(20);
    assert!(matches!(train(&job), Ok(Ending::Interrupted(20))));
    let held = Lock::take(job.folder.path()).expect("free");
    let said = fails(temporary.path(), &["train", "--resume", "--out", "run"]);
    assert!(said.contains(&format!("process {} is writing", std::process::id())), "{said}");
    drop(held);
    // The file of the lock is still there, as after a kill.
    succeeds(temporary.path(), &["train", "--resume", "--out", "run"]);
}

#[test]
fn folders_of_others_are_no_run_folders() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    tiny_scene(folder);
    let said = fails(folder, &["train", "scene", "--out", "scene", "--steps", "3"]);
    assert!(said.contains("empty folder"), "{said}");
    fs::write(folder.join("file"), "").expect("written");
    assert!(fails(folder, &["train", "scene", "--out", "file", "--steps", "3"]).contains("found a file"));
    fs::create_dir_all(folder.join("begun/checkpoints")).expect("made");
    succeeds(folder, &[&["train", "scene", "--out", "begun", "--steps", "3"][..], &QUICK].concat());
}

#[cfg(unix)]
#[test]
fn all_files_of_a_run_have_the_same_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let temporary = tempfile::tempdir().expect("a folder");
    let job = short(temporary.path());
    finish(&job);
    let mode = |path: &Path| fs::metadata(path).expect("there").permissions().mode() & 0o777;
    for (path, ..) in content(job.folder.path()) {
        assert_eq!(mode(&path), mode(&job.folder.eval()), "{}", path.display());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error() {
    let temporary = tempfile::tempdir().expect("a folder");
    let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("a device");
    let output = gsburn(temporary.path()).arg("info").stdout(full).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("standard output"));
}

#[test]
fn a_run_is_measured_on_other_data() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    finish(&short(folder));
    fs::create_dir(folder.join("b")).expect("made");
    fs::rename(tiny_scene(&folder.join("b")), folder.join("other")).expect("renamed");
    let [table, _] =
        succeeds(folder, &["eval", "run", "--data", "other", "--set", "data.max_width=20", "--split", "train"]);
    assert!(table.contains("5 training views") || table.contains("5 train"), "{table}");
    assert!(fails(folder, &["eval", "run", "--recipe", "static/base"]).contains("leave out"));
}

#[test]
fn what_is_missing_on_a_machine_is_said_once() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    finish(&short(folder));
    let eval = ["eval", "run", "--set", "eval.lpips=true"];
    let [first, second] = [0, 1].map(|_| succeeds(folder, &eval)[0].clone());
    assert!(first.contains("no LPIPS"), "{first}");
    assert!(!second.contains("no LPIPS"), "{second}");
}

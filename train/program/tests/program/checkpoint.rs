//! Checkpoints: what is read is what was written, and what is damaged says so in one sentence.

use crate::common;

use std::fs;
use std::path::{Path, PathBuf};

use burn::tensor::Tensor;
use gs_pipelines::fit::read_model;
use gs_pipelines::still::Still;
use gs_pipelines::taylormode::Taylormode;
use gs_train::fit::parameters::{Group, Table, to_host};
use gs_train::fit::snapshot::{Snapshot, restore};
use gs_train::fit::trainer::Trainer;
use gs_train::run::checkpoint::{Checkpoint, Origin, save};
use gs_train::run::fingerprint::Fingerprint;
use gs_worlds::deblur::{self, DeblurOptions};

/// A checkpoint on disk and what it holds.
struct Saved {
    path: PathBuf,
    origin: Origin,
    begun: common::Begun,
}

fn saved(folder: &Path) -> Saved {
    let config = common::config(10, &["density.strategy=default"]);
    let mut begun = common::begun(&config);
    begun.step();
    begun.trainer.facts.extent = 1.0 / 3.0;
    let views = Fingerprint::of(&begun.data.scene);
    let world = glam::DVec3::new(0.1, 1e9, -7.0);
    let origin = Origin::new("static", begun.config.to_toml(), folder.join("scene"), world, views);
    let path = folder.join("a.safetensors");
    save(&path, &origin, &Snapshot::of(&begun.trainer)).expect("saved");
    Saved { path, origin, begun }
}

/// Everything of a trainer that is saved.
fn content(trainer: &Trainer<Still>) -> (Vec<Vec<f32>>, Vec<Vec<f32>>) {
    let parameters = Group::ALL.map(|group| trainer.gaussians().read(group)).to_vec();
    let tensors = trainer.adam.moments.values().flat_map(|moments| [moments.first.clone(), moments.second.clone()]);
    (parameters, tensors.map(|tensor: Tensor<2>| to_host(tensor)).collect())
}

#[test]
fn what_is_read_is_what_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let Saved { path, origin, begun } = saved(folder.path());
    let file = Checkpoint::load(&path).expect("loads");
    assert_eq!(file.origin, origin);
    assert_eq!(file.origin.world(), glam::DVec3::new(0.1, 1e9, -7.0));
    let after = restore::<Still>(&file, &begun.config, &common::device()).expect("restored");
    let before = begun.trainer;
    assert_eq!((before.step, before.skipped, before.facts), (after.step, after.skipped, after.facts));
    assert_eq!(before.adam.updates, after.adam.updates);
    let (parameters, moments) = content(&before);
    assert!(moments.len() == 2 * Group::ALL.len() && moments.iter().flatten().any(|x| *x != 0.0));
    assert_eq!((parameters, moments), content(&after));
    assert_eq!(fs::read_dir(folder.path()).expect("read").count(), 1, "nothing but the checkpoint is left");
}

/// Tensors without columns are written too: paths and rotations of order 0.
#[test]
fn motion_of_order_0_is_saved() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let options =
        DeblurOptions { width: 32, height: 24, cameras: 4, held_out: 1, frames: 3, ..DeblurOptions::default() };
    deblur::write(&folder.join("world"), &options, |_, _| {}).expect("the world is written");
    let orders = ["pipeline=taylormode", "motion.order=0", "motion.order_max=0", "motion.rotation_order=0"];
    let config =
        common::config(2, &[&orders[..], &["motion.kinks=0", "motion.remainder=off", "blur.samples=3"]].concat());
    let job = common::job(&folder.join("world"), &folder.join("run"), &config);
    common::finish(&job);
    let file = Checkpoint::load(&job.folder.saved()[0].1).expect("loads");
    let (model, ..) = read_model::<Taylormode>(&file, &common::device()).expect("a moving scene");
    let motion = model.method.motion;
    assert_eq!((motion.position.dims()[1], motion.rotation.dims()[1]), (0, 0));
}

/// The sentence for a file of these bytes, read to the last tensor.
fn complaint(folder: &Path, bytes: &[u8]) -> String {
    let path = folder.join("bad.safetensors");
    fs::write(&path, bytes).expect("written");
    let read = || -> anyhow::Result<()> {
        read_model::<Still>(&Checkpoint::load(&path)?, &common::device())?;
        Ok(())
    };
    let error = read().expect_err("refused").to_string();
    assert!(error.contains("bad.safetensors") && !error.contains('\n'), "{error}");
    error
}

#[test]
fn damage_is_said_in_one_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = fs::read(saved(folder.path()).path).expect("read");

    for length in [0, 4, 8, 100, bytes.len() / 2, bytes.len() - 1] {
        let error = complaint(folder.path(), &bytes[..length]);
        assert!(error.contains("damaged") || error.contains("expected a gsburn checkpoint"), "{length}: {error}");
    }
    let (whole, half) = (bytes.len(), bytes.len() / 2);
    let said = complaint(folder.path(), &bytes[..half]);
    assert!(said.contains(&format!("damaged: it is cut short, expected {whole} bytes, found {half}")), "{said}");
    assert!(complaint(folder.path(), &[0xff; 5000]).contains("another kind of file"));
    assert!(complaint(folder.path(), b"ply\nformat ascii 1.0\nend_header\n").contains("expected a gsburn checkpoint"));

    let means = first_byte(&bytes, "model.gaussians.means");
    let flipped = |place: usize| {
        let mut bytes = bytes.clone();
        bytes[place] ^= 1;
        bytes
    };
    assert!(complaint(folder.path(), &flipped(means)).contains("checksum"));
    // A run that goes on reads all there is.
    let config = common::typed::<Still>(&common::config(10, &["density.strategy=default"]));
    let path = folder.path().join("bad.safetensors");
    fs::write(&path, flipped(bytes.len() - 1)).expect("written");
    let file = Checkpoint::load(&path).expect("tensors are checked when they are asked for");
    let error = restore::<Still>(&file, &config, &common::device()).expect_err("refused");
    assert!(error.contains("checksum"), "{error}");
}

/// Where a tensor begins in a safetensors file.
fn first_byte(bytes: &[u8], name: &str) -> usize {
    let header = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[8..8 + header]).expect("a header");
    8 + header + json[name]["data_offsets"][0].as_u64().expect("an offset") as usize
}

/// `bytes` as a program would have written them that called its format `version`; `program` is what the file says of
/// its writer.
fn of_version(bytes: &[u8], version: &str, program: Option<&str>) -> Vec<u8> {
    let header = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&bytes[8..8 + header]).expect("a header");
    let text = json["__metadata__"]["gsburn-checkpoint"].as_str().expect("a text");
    let mut said: serde_json::Value = serde_json::from_str(text).expect("JSON");
    said["version"] = version.into();
    let content = said["content"].as_object_mut().expect("the rest");
    content.remove("program");
    content.extend(program.map(|program| ("program".to_string(), program.into())));
    json["__metadata__"]["gsburn-checkpoint"] = said.to_string().into();
    let text = json.to_string();
    [&(text.len() as u64).to_le_bytes()[..], text.as_bytes(), &bytes[8 + header..]].concat()
}

/// Every command that reads a scene refuses other formats with a sentence that says who wrote them.
#[test]
fn other_formats_say_which_program_wrote_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = fs::read(saved(folder.path()).path).expect("read");
    // Format 3 did not name its program.
    let old = complaint(folder.path(), &of_version(&bytes, "3", None));
    assert!(old.contains("expected checkpoint format 4, found format 3"), "{old}");
    assert!(old.contains("written by an earlier gsburn") && old.contains("that program reads it"), "{old}");
    let newer = complaint(folder.path(), &of_version(&bytes, "9", Some("7.8.9")));
    assert!(newer.contains("found format 9") && newer.contains("written by gsburn 7.8.9"), "{newer}");
    assert!(newer.contains(&format!("this is {}", env!("CARGO_PKG_VERSION"))), "{newer}");

    fs::write(folder.path().join("old.safetensors"), of_version(&bytes, "3", None)).expect("written");
    for command in ["eval old.safetensors", "export old.safetensors --out a.ply", "info old.safetensors"] {
        let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_gsburn"));
        let program = program.current_dir(folder.path()).env("XDG_RUNTIME_DIR", folder.path());
        let output = program.args(command.split(' ')).output().expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains("written by an earlier gsburn"), "{command}: {said}");
    }
}

#[test]
fn a_write_that_fails_leaves_the_old_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let Saved { path, origin, begun } = saved(folder.path());
    let before = fs::read(&path).expect("read");
    // A folder in the way of the temporary file stands for a disk that refuses.
    fs::create_dir(path.with_extension("part")).expect("made");
    fs::write(path.with_extension("part").join("x"), "x").expect("written");
    let error = save(&path, &origin, &Snapshot::of(&begun.trainer)).expect_err("refused").to_string();
    assert!(error.contains("a.safetensors: cannot write the checkpoint"), "{error}");
    assert_eq!(before, fs::read(&path).expect("read"));
}

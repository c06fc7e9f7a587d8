//! Damaged configurations, checkpoints and files of scenes: nothing panics, and what is not read is refused in a
//! sentence of one line.
//!
//! Each reader gets [`SHORT`] cases with all other tests. The long run is asked for, with as many cases as wanted:
//!
//! ```text
//! GS_FUZZ_CASES=100000 cargo test --release -p gsburn --test program fuzz:: -- --ignored
//! ```

use crate::common;

use std::fs;
use std::path::Path;

use gs_pipelines::{PIPELINES, Sources, of_checkpoint, resolve};
use gs_splats::Splats;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::exchange::{Format, Packed, read_packed};
use gs_worlds::deblur::{self, DeblurOptions};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestCaseError, TestRunner};

use crate::mutate::{Step, damaged};

/// Cases for each reader with all other tests.
const SHORT: u32 = 256;

/// Cases for each reader when no number is given.
const LONG: u32 = 20_000;

/// The variable with the number of cases of the long run.
const CASES: &str = "GS_FUZZ_CASES";

fn long() -> u32 {
    std::env::var(CASES).ok().map_or(LONG, |text| text.parse().expect("a number of cases"))
}

/// Damages `seeds` and gives each to `read`, which returns the sentence of a refusal.
fn fuzz(cases: u32, seeds: &[Vec<u8>], read: impl Fn(&[u8]) -> Option<String>) {
    let step = (any::<u8>(), any::<u32>(), any::<u64>());
    let strategy = (0..seeds.len(), proptest::collection::vec(step, 1..6));
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    let outcome = runner.run(&strategy, |(seed, steps): (usize, Vec<Step>)| {
        let sentence = read(&damaged(&seeds[seed], &steps)).unwrap_or_default();
        if sentence.contains('\n') {
            return Err(TestCaseError::fail(format!("more than one line: {sentence}")));
        }
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

fn configurations(cases: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("config.toml");
    // Every key of each pipeline, and a recipe as people write it.
    let seeds: Vec<Vec<u8>> = PIPELINES
        .map(|pipeline| format!("pipeline={}", pipeline.name()))
        .map(|pipeline| common::resolved(10, &[pipeline.as_str()]).text.into_bytes())
        .into_iter()
        .chain(gs_recipes::find("taylormode/base").map(|recipe| recipe.text.as_bytes().to_vec()))
        .collect();
    fuzz(cases, &seeds, |bytes| {
        fs::write(&file, bytes).expect("written");
        let resolved = resolve(Sources { file: Some(&file), ..Sources::default() });
        resolved.err().map(|error| gs_train::sentence::one_sentence(&error.into()))
    });
}

/// The last checkpoint of a run of so many steps.
fn checkpoint(dataset: &Path, run: &Path, steps: usize, overrides: &[&str]) -> Vec<u8> {
    let job = common::job(dataset, run, &common::config(steps, overrides));
    common::finish(&job);
    fs::read(job.folder.checkpoint(steps)).expect("read")
}

/// A checkpoint of each pipeline.
fn checkpoint_seeds(folder: &Path) -> Vec<Vec<u8>> {
    let still = common::tiny_scene(folder);
    let video = folder.join("video");
    let options = DeblurOptions {
        width: 32,
        height: 24,
        cameras: 4,
        held_out: 1,
        frames: 3,
        points: 100,
        ..DeblurOptions::default()
    };
    deblur::write(&video, &options, |_, _| {}).expect("the world is written");
    let few = "init.random_points=20";
    vec![
        checkpoint(&still, &folder.join("static"), 3, &[few]),
        checkpoint(&still, &folder.join("corrected"), 1, &["correction.mode=affine", few]),
        checkpoint(&still, &folder.join("shaken"), 1, &["camera.motion=1", few]),
        checkpoint(&video, &folder.join("moving"), 1, &["pipeline=taylormode", "blur.samples=3", "motion.points=30"]),
    ]
}

fn checkpoints(cases: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let device = common::device();
    let file = folder.path().join("x.safetensors");
    fuzz(cases, &checkpoint_seeds(folder.path()), |bytes| {
        fs::write(&file, bytes).expect("written");
        let read = || -> anyhow::Result<()> {
            let checkpoint = Checkpoint::load(&file)?;
            of_checkpoint(&checkpoint)?.open(&checkpoint, None, &device)?;
            checkpoint.whole()?;
            Ok(())
        };
        read().err().map(|error| gs_train::sentence::one_sentence(&error))
    });
}

/// A scene far from its world's origin, with a row of zeros.
fn far_scene() -> Splats {
    let count = 6;
    let mut quats = vec![[1.0, 0.0, 0.0, 0.0]; count];
    quats[4] = [0.0; 4];
    Splats {
        means: (0..count).map(|i| [i as f32, 1.0, -0.5]).collect(),
        offset: [450_123.5, 5_200_456.25, 300.0],
        quats,
        log_scales: vec![[-3.0; 3]; count],
        opacity_logits: vec![0.5; count],
        degree: 1,
        sh: vec![[0.25, -0.5, 0.125]; 4 * count],
        antialiased: Some(true),
    }
}

/// An SPZ of version 4 with arrays of these lengths, each as a zstd frame of one raw block.
fn spz_4(lengths: [u8; 6]) -> Vec<u8> {
    let frame = |length: u8| {
        let block = u32::from(length) << 3 | 1;
        let head = [0x28, 0xb5, 0x2f, 0xfd, 0x20, length];
        [&head[..], &block.to_le_bytes()[..3], &vec![77; usize::from(length)]].concat()
    };
    let header = [&b"NGSP"[..], &4_u32.to_le_bytes(), &6_u32.to_le_bytes(), &[1, 12, 0, 6, 32], &[0; 15]].concat();
    let lengths_of = |length: u8| [frame(length).len() as u64, u64::from(length)].map(u64::to_le_bytes).concat();
    [header, lengths.map(lengths_of).concat(), lengths.map(frame).concat()].concat()
}

/// A `.ksplat` of level 1: six Gaussians without harmonics in one bucket that is not full.
fn ksplat() -> Vec<u8> {
    let mut file = vec![0; 4096 + 1024];
    let words = [(0, 256_u32), (4, 1), (20, 1), (4096, 6), (4100, 6), (4104, 256), (4108, 1), (4132, 1)];
    words.iter().for_each(|(at, word)| file[*at..at + 4].copy_from_slice(&word.to_le_bytes()));
    file[4112..4116].copy_from_slice(&5.0_f32.to_le_bytes());
    file[4116] = 12;
    [file, 6_u32.to_le_bytes().to_vec(), vec![0; 12], vec![52; 6 * 24]].concat()
}

/// A `.sog` archive of six Gaussians of degree 1, files stored as they are.
fn sog() -> Vec<u8> {
    use std::io::{Cursor, Write};
    let codebook = || (0..256).map(|i| (i as f32 / 64.0 - 2.0).to_string()).collect::<Vec<_>>().join(",");
    let part = |files: &str| format!(r#"{{"codebook":[{}],"files":[{files}],"bands":1}}"#, codebook());
    let meta = format!(
        r#"{{"version":2,"count":6,"means":{{"mins":[-1,-1,-1],"maxs":[1,1,1],"files":["a.webp","b.webp"]}},
        "quats":{{"files":["a.webp"]}},"scales":{},"sh0":{},"shN":{}}}"#,
        part(r#""a.webp""#),
        part(r#""b.webp""#),
        part(r#""c.webp","d.webp""#)
    );
    let webp = |width: u32, height: u32, value: u8| {
        let mut file = Cursor::new(Vec::new());
        let image = image::RgbaImage::from_pixel(width, height, image::Rgba([value, value, value, 253]));
        image.write_to(&mut file, image::ImageFormat::WebP).expect("encoded");
        file.into_inner()
    };
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let images = [
        ("a.webp", webp(3, 2, 200)),
        ("b.webp", webp(3, 2, 9)),
        ("c.webp", webp(192, 1, 77)),
        ("d.webp", webp(3, 2, 0)),
    ];
    for (name, bytes) in std::iter::once(("meta.json", meta.into_bytes())).chain(images) {
        archive.start_file(name, stored).expect("a file");
        archive.write_all(&bytes).expect("written");
    }
    archive.finish().expect("an archive").into_inner()
}

/// The scene in each format that is read, by its ending; an SPZ without its gzip, one of version 4, a glTF with nodes.
fn scene_seeds(folder: &Path) -> [(&'static str, Vec<Vec<u8>>); 6] {
    let packed = Packed { splats: far_scene(), motion: None, samples: 0 };
    let written = |name: &str, format: Format| {
        let path = folder.join(name);
        packed.write(&path, format).expect("written");
        fs::read(&path).expect("read")
    };
    let ply = written("seed.ply", Format::Ply);
    let (spz, glb) = (written("seed.spz", Format::Spz), written("seed.glb", Format::Glb));
    let arrays = 6 * (9 + 1 + 3 + 3 + 4 + 9);
    let raw = [&b"NGSP"[..], &3_u32.to_le_bytes(), &6_u32.to_le_bytes(), &[1, 12, 0, 0], &vec![77; arrays]].concat();
    // As long as the node that it takes the place of, with spaces from behind.
    let text = String::from_utf8_lossy(&glb).into_owned();
    assert!(text.contains(r#""nodes":[{"mesh":0}]"#), "{text}");
    let place = glb.windows(12).position(|bytes| bytes == br#"[{"mesh":0}]"#).expect("a node");
    let node = br#"[{"mesh":0,"scale":[2,1,1],"translation":[1e6,0,0]}]"#;
    let mut nodes = glb.clone();
    nodes.splice(place..place + 12, node.iter().copied());
    let length = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) + (node.len() - 12) as u32;
    nodes[12..16].copy_from_slice(&length.to_le_bytes());
    let newer = spz_4([54, 6, 18, 18, 24, 54]);
    let spz = vec![spz, raw, newer];
    let splat = vec![52; 6 * 32];
    let read = [("splat", vec![splat]), ("ksplat", vec![ksplat()]), ("sog", vec![sog()])];
    let [splat, ksplat, sog] = read;
    [("ply", vec![ply]), ("spz", spz), ("glb", vec![glb, nodes]), splat, ksplat, sog]
}

fn scenes(cases: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    for (ending, seeds) in scene_seeds(folder.path()) {
        let file = folder.path().join(format!("scene.{ending}"));
        for seed in &seeds {
            fs::write(&file, seed).expect("written");
            let read = read_packed(&file).expect("a sound seed").expect("a scene");
            // SPZ and glTF are written with rotations of norm 1.
            assert_eq!(read.splats.len(), if ending == "ply" { 5 } else { 6 }, "{ending}");
        }
        fuzz(cases, &seeds, |bytes| {
            fs::write(&file, bytes).expect("written");
            match read_packed(&file) {
                Ok(packed) => {
                    packed.expect("an ending that is read").splats.check().expect("finite numbers");
                    None
                }
                Err(error) => Some(gs_train::sentence::one_sentence(&error)),
            }
        });
    }
}

#[test]
fn damaged_scenes_are_refused() {
    scenes(SHORT);
}

#[test]
#[ignore = "long: GS_FUZZ_CASES cases"]
fn damaged_scenes_are_refused_long() {
    scenes(long());
}

#[test]
fn damaged_configurations_are_refused() {
    configurations(SHORT);
}

#[test]
fn damaged_checkpoints_are_refused() {
    checkpoints(SHORT);
}

#[test]
#[ignore = "long: GS_FUZZ_CASES cases"]
fn damaged_configurations_are_refused_long() {
    configurations(long());
}

#[test]
#[ignore = "long: GS_FUZZ_CASES cases"]
fn damaged_checkpoints_are_refused_long() {
    checkpoints(long());
}

//! `--profile` says where the time of a step goes and changes no bit of what is learned.

use crate::common;

use gs_train::run::profile::{Profile, begin};
use gs_train::run::watch::Job;
use gs_worlds::deblur::{self, DeblurOptions, World};

const OVERRIDES: [&str; 6] = [
    "pipeline=taylormode",
    "density.cap=1500",
    "motion.points=200",
    "motion.select_every=5",
    "blur.samples=3",
    "prior.until=1.0",
];
const STEPS: usize = 12;

#[test]
fn a_profile_adds_up_and_changes_nothing() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = folder.join("world");
    let options = DeblurOptions {
        world: World::Cube,
        width: 64,
        height: 48,
        cameras: 4,
        held_out: 1,
        frames: 5,
        ..DeblurOptions::default()
    };
    deblur::write(&world, &options, |_, _| {}).expect("the world is written");
    let config = common::config(STEPS, &OVERRIDES);
    let plain = common::job(&world, &folder.join("plain"), &config);
    common::finish(&plain);
    assert!(Profile::read(&plain.folder).is_none());

    let profiled = common::job(&world, &folder.join("profiled"), &config);
    begin(&profiled.device);
    common::finish(&profiled);
    gs_burn::profile::end();
    let bits = |job: &Job| std::fs::read(job.folder.checkpoint(STEPS)).expect("saved");
    assert!(bits(&plain) == bits(&profiled), "measuring changes what is learned");

    let profile = Profile::read(&profiled.folder).expect("profile.json");
    assert_eq!(profile.steps, STEPS as u64);
    let sum: f64 = profile.stages.iter().map(|stage| stage.wall_seconds).sum();
    assert!((sum - profile.wall_seconds).abs() < 1e-9 * STEPS as f64, "{sum} {}", profile.wall_seconds);
    let names: Vec<&str> = profile.stages.iter().map(|stage| stage.name.as_str()).collect();
    for expected in [
        "photo upload",
        "motion samples",
        "project",
        "project, backward",
        "spherical harmonics",
        "spherical harmonics, backward",
        "sort into tiles",
        "rasterize",
        "rasterize, backward",
        "average over the exposure",
        "average over the exposure, backward",
        "photometric loss",
        "photometric loss, backward",
        "depth loss",
        "depth alignment",
        "regularisers",
        "backward, rest of the graph",
        "Adam",
        "density control",
        "selection of orders",
        "everything else",
    ] {
        assert!(names.contains(&expected), "{expected}: {names:?}");
    }
    let report = std::fs::read_to_string(profiled.folder.report()).expect("read");
    assert!(report.contains("One training step by stage") && report.contains("rasterize, backward"));
}

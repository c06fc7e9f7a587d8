//! It trains with every formation of blur, with and without priors.

use gs_datasets::synthetic::deblur::{DeblurOptions, World};

use gs_train::pipelines::fit::load;
use gs_train::pipelines::taylormode::{Taylormode, cues};

use crate::{STEPS, common, finish_in, tiny_world, written};

#[test]
fn every_formation_trains_and_is_measured() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = tiny_world(folder);
    let modes: [(&str, &[&str]); 5] = [
        ("integrate", &["blur.mode=integrate"]),
        ("decoupled", &["blur.mode=integrate", "blur.decouple=true"]),
        ("warp", &["blur.mode=warp"]),
        ("network", &["blur.mode=warp", "blur.velocity=network"]),
        ("none", &["blur.mode=none"]),
    ];
    for (name, more) in modes {
        let eval = finish_in(folder, &world, name, more);
        assert_eq!(eval.skipped_steps, 0, "{name}");
        assert!(eval.last.moving().expect("the truth's mask").psnr > 5.0, "{name}");
        assert!(eval.last.figure("blurry_psnr").expect("the truth's blurry photo") > 5.0, "{name}");
        let moving = eval.last.figure("moving_gaussians").expect("a moving scene");
        assert!(eval.last.figure("velocity_angle").is_some() && moving > 0.0, "{name}: {moving} move");
    }
}

#[test]
fn without_priors_it_goes_on_by_evidence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let path = written(folder, DeblurOptions { world: World::Cube, points: 0, ..DeblurOptions::default() });
    for masks in ["auto", "none"] {
        let masks_key = format!("motion.masks={masks}");
        // More points for what stands still than the cap has room for.
        let more = [masks_key.as_str(), "data.priors=[]", "init.random_points=2000"];
        let eval = finish_in(folder, &path, masks, &more);
        let moving = eval.last.figure("moving_gaussians").expect("a moving scene");
        // Half of the 200 that a hull may have: some are of a hull's far side and stop.
        assert!(moving >= 100.0, "{masks}: {moving} move");
        assert!(eval.last.measured.size.gaussians <= 1500, "{masks}: {} Gaussians", eval.last.measured.size.gaussians);
    }
    let warnings = |priors: &str| {
        let config = common::config(STEPS, &["pipeline=taylormode", priors]);
        let config = common::typed::<Taylormode>(&config);
        let scene = load::<Taylormode>(&path, &config).expect("loads");
        cues::find_cues(&scene, &config).warnings.join("; ")
    };
    let (with, without) = (warnings("data.priors=[\"depth\", \"masks\", \"sharp\"]"), warnings("data.priors=[]"));
    assert!(!with.contains("no depth priors") && !with.contains("no pseudo-sharp"), "{with}");
    assert!(without.contains("no depth priors") && without.contains("no pseudo-sharp"), "{without}");
}

/// The exposure that the data set states is held, its moments are not.
#[test]
fn a_stated_exposure_is_held_for_its_share_of_the_run() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = tiny_world(folder);
    let exposure = |name: &str, more: &[&str]| {
        finish_in(folder, &world, name, more).last.figure("exposure").expect("a moving scene")
    };
    let stated = DeblurOptions { frames: 5, ..DeblurOptions::default() }.exposure_time();
    let near = |value: f64, other: f64| (value / other - 1.0).abs() < 1e-6;
    assert!(near(exposure("held", &["blur.exposure_from=1"]), stated));
    assert!(!near(exposure("learned", &["blur.exposure_from=0.5"]), stated));
    // One that the user guessed is no statement of the data set.
    let guess = format!("blur.exposure={stated}");
    assert!(!near(exposure("guessed", &["blur.exposure_from=1", &guess]), stated));
}

//! The third band of the SH coefficients in a tensor of its own: the same training, files and continuation as without, and a million
//! Gaussians on a device whose buffers hold 128 MiB.
#![recursion_limit = "256"]

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use burn::tensor::Device;
use gs_burn::ply::write_ply;
use gs_train::config::FitConfig;
use gs_train::fit::method::Method;
use gs_train::fit::session::{Data, Session};
use gs_train::fit::snapshot::{Snapshot, restore_within};
use gs_train::fit::trainer::Trainer;
use gs_train::pipelines::fit;
use gs_train::pipelines::sparsedyn::Sparsedyn;
use gs_train::pipelines::still::Still;
use gs_train::pipelines::taylormode::Taylormode;
use gs_train::run::checkpoint::{Checkpoint, Origin, save};
use gs_train::run::fingerprint::Fingerprint;
use gs_worlds::deblur::{self, DeblurOptions};
use gs_worlds::extrapolation::{self, ExtrapolationOptions};

/// A buffer that holds no scene: the third band is always apart.
const TINY: Option<u64> = Some(1);

/// A training that can be stopped.
struct Trial<M: Method> {
    config: FitConfig<M::Config>,
    data: Data<M>,
    folder: PathBuf,
}

impl<M: Method> Trial<M> {
    fn new(world: &Path, folder: &Path, steps: usize, overrides: &[&str]) -> Self {
        let config = common::typed::<M>(&common::config(steps, overrides));
        let data = Data::new(fit::load::<M>(world, &config).expect("loads"), &config);
        Self { config, data, folder: folder.to_path_buf() }
    }

    /// The bytes of the checkpoint after all steps where a buffer holds `largest` bytes, stopped and read again after each of `stops`;
    /// and of the PLY file.
    fn run(&self, largest: Option<u64>, stops: &[usize]) -> [Vec<u8>; 2] {
        let mut trainer = None;
        let mut ends = stops.to_vec();
        ends.push(self.config.steps);
        for end in ends {
            let mut session = Session::begin(&self.data, &self.config, trainer, &common::device());
            session.trainer.largest_buffer = largest;
            while session.trainer.step < end {
                session.step();
            }
            let gaussians = session.trainer.gaussians();
            let is_apart = largest.is_some() && gaussians.sh_degree() == 3;
            assert_eq!(gaussians.sh_third.is_some(), is_apart, "step {end}");
            self.save(&session.into_trainer());
            trainer = Some(self.read(&common::device(), largest));
        }
        let trainer = trainer.expect("at least one end");
        assert_eq!((trainer.gaussians().sh_degree(), trainer.skipped), (3, 0));
        let ply = self.folder.join("scene.ply");
        write_ply(&ply, trainer.gaussians()).expect("written");
        [self.file(), ply].map(|path| fs::read(path).expect("read"))
    }

    fn file(&self) -> PathBuf {
        self.folder.join("state.safetensors")
    }

    fn save(&self, trainer: &Trainer<M>) {
        let views = Fingerprint::of(&self.data.scene);
        let origin = Origin::new(M::NAME, self.config.to_toml(), "scene".into(), glam::DVec3::ZERO, views);
        save(&self.file(), &origin, &Snapshot::of(trainer)).expect("saved");
    }

    fn read(&self, device: &Device, largest: Option<u64>) -> Trainer<M> {
        let file = Checkpoint::load(&self.file()).expect("loads");
        restore_within(&file, &self.config, device, largest).expect("restored")
    }

    /// One training, whole and split, straight through and interrupted before and after the third band is there: the same files.
    fn is_the_same_in_two_tensors(&self, stops: &[usize]) {
        let whole = self.run(None, &[]);
        for (largest, stops) in [(TINY, &[][..]), (TINY, stops)] {
            let [checkpoint, ply] = self.run(largest, stops);
            assert!(whole[0] == checkpoint, "{stops:?}: another checkpoint");
            assert!(whole[1] == ply, "{stops:?}: another PLY file");
        }
    }
}

#[test]
fn a_static_training_is_the_same_in_two_tensors() {
    let folder = tempfile::tempdir().expect("a folder");
    let world = common::tiny_scene(folder.path());
    let grows = ["density.start=4", "density.every=10", "density.cap=260", "density.prune_share=0.01"];
    let mcmc = ["density.strategy=mcmc", "density.mcmc.growth=0.2", "density.mcmc.full=0"];
    let classic = ["density.strategy=default", "density.default.gradient=1e-5"];
    for strategy in [&mcmc[..], &classic] {
        let keys = [&grows[..], strategy].concat();
        // Degree 3 begins with step 37 of 48.
        Trial::<Still>::new(&world, folder.path(), 48, &keys).is_the_same_in_two_tensors(&[20, 41]);
    }
}

#[test]
fn a_moving_training_is_the_same_in_two_tensors() {
    let folder = tempfile::tempdir().expect("a folder");
    let world = folder.path().join("deblur");
    let options =
        DeblurOptions { width: 64, height: 48, cameras: 5, held_out: 1, frames: 5, ..DeblurOptions::default() };
    deblur::write(&world, &options, |_, _| {}).expect("the world is written");
    let own = [
        "pipeline=taylormode",
        "model.sh_degree=3",
        "density.cap=700",
        "motion.points=200",
        "motion.select_every=5",
        "blur.samples=3",
    ];
    for formation in [&[][..], &["blur.mode=warp", "blur.decouple=true"]] {
        let keys = [&own[..], formation].concat();
        Trial::<Taylormode>::new(&world, folder.path(), 24, &keys).is_the_same_in_two_tensors(&[8, 21]);
    }

    let world = folder.path().join("extrapolation");
    let of = ExtrapolationOptions::of(extrapolation::World::Fan);
    let options = ExtrapolationOptions { width: 24, height: 24, cameras: 4, held_out: 1, frames: 32, ..of };
    extrapolation::write(&world, &options, |_, _| {}).expect("the world is written");
    let own = ["pipeline=sparsedyn", "model.sh_degree=3", "data.background=[1.0,1.0,1.0]", "density.cap=700"];
    Trial::<Sparsedyn>::new(&world, folder.path(), 24, &own).is_the_same_in_two_tensors(&[8, 21]);
}

/// A file does not depend on the split: a run goes on where nothing needs to be split, and where something does.
#[test]
fn a_checkpoint_moves_between_devices() {
    let folder = tempfile::tempdir().expect("a folder");
    let world = common::tiny_scene(folder.path());
    let trial = Trial::<Still>::new(&world, folder.path(), 24, &["density.strategy=mcmc"]);
    trial.run(TINY, &[]);
    let [whole, apart] = [None, TINY].map(|largest| trial.read(&common::device(), largest));
    assert!(whole.gaussians().sh_third.is_none() && apart.gaussians().sh_third.is_some());
    let values = |trainer: &Trainer<Still>| trainer.gaussians().sh_coefficients().to_host::<f32>();
    assert_eq!(values(&whole), values(&apart));
    assert_eq!(whole.adam.moments.len() + 1, apart.adam.moments.len());
}

/// A million Gaussians of degree 3 need 192 MB for their coefficients; lavapipe binds 128 MiB. The training goes through every degree and
/// a relocation, and is continued from its checkpoint.
///
/// ```text
/// cargo test --release -p gs-train --features ndarray,wgpu --test=third_band -- --ignored --nocapture
/// ```
#[cfg(feature = "wgpu")]
#[test]
#[ignore = "minutes and gigabytes on software Vulkan"]
fn a_million_gaussians_train_where_a_buffer_holds_128_mib() {
    use std::time::Instant;

    use gs_burn::limits::{gaussians_within, largest_buffer};
    use gs_burn::ply::read_ply;
    use gs_train::fit::parameters::{Group, to_host};
    use gs_train::run::resources::peak_memory;
    use gs_worlds::{DemoOptions, demo_scene};

    const GAUSSIANS: usize = 1_000_000;
    const STEPS: usize = 12;
    let device = common::named("wgpu");
    let largest = largest_buffer(&device).expect("a GPU");
    assert!(gaussians_within(largest, 3) >= GAUSSIANS as u64, "{largest} bytes in a buffer");
    let temporary = tempfile::tempdir().expect("a folder");
    let (folder, world) = (temporary.path(), temporary.path().join("scene"));
    let options = DemoOptions { train_views: 2, test_views: 1, width: 320, height: 240, points: GAUSSIANS, seed: 1 };
    demo_scene(&world, &options).expect("the scene is written");
    // Degrees 1 to 3 begin with steps 4, 7 and 10. Opacities fall below this bound by then, and step 11 relocates.
    let keys = [
        "density.cap=1000000",
        "density.start=2",
        "density.every=11",
        "density.stop=1.0",
        "density.min_opacity=0.15",
        "init.dense_share=0",
    ];
    let trial = Trial::<Still>::new(&world, folder, STEPS, &keys);

    let mut session = Session::begin(&trial.data, &trial.config, None, &device);
    // A device with larger buffers is treated as one with 128 MiB.
    session.trainer.largest_buffer = Some(largest.min(128 << 20));
    let (mut losses, mut moved) = (Vec::new(), 0);
    while session.trainer.step < STEPS {
        let begun = Instant::now();
        let report = session.step().report;
        let gaussians = session.trainer.gaussians();
        println!(
            "step {}: degree {}, {} Gaussians, {} pairs, loss {:.4}, {} moved, {:.1} s",
            session.trainer.step,
            gaussians.sh_degree(),
            gaussians.len(),
            report.intersections,
            report.loss,
            report.changes.moved,
            begun.elapsed().as_secs_f64()
        );
        assert!(report.loss.is_finite() && !report.skipped);
        losses.push(report.loss);
        moved += report.changes.moved;
    }
    let trainer = session.into_trainer();
    let gaussians = trainer.gaussians();
    assert_eq!((gaussians.len(), gaussians.sh_degree()), (GAUSSIANS, 3));
    assert!(gaussians.sh_third.is_some() && moved > 0);
    let mean = |losses: &[f32]| losses.iter().sum::<f32>() / losses.len() as f32;
    assert!(mean(&losses[6..10]) < mean(&losses[..4]), "{losses:?}");
    for group in [Group::Sh, Group::ShThird] {
        let moments = &trainer.adam.moments[group.path()].first;
        let columns = moments.dims()[1];
        let mut learned = vec![false; columns];
        for row in to_host(moments.clone()).chunks_exact(columns) {
            learned.iter_mut().zip(row).for_each(|(learned, moment)| *learned |= *moment != 0.0);
        }
        assert!(learned.iter().all(|learned| *learned), "{}: {learned:?}", group.path());
    }

    let coefficients = gaussians.sh_coefficients().to_host::<f32>();
    let ply = folder.join("scene.ply");
    write_ply(&ply, gaussians).expect("written");
    assert_eq!(read_ply(&ply, &device).expect("read").sh_coefficients().to_host::<f32>(), coefficients);
    trial.save(&trainer);
    drop(trainer);
    let restored = trial.read(&device, Some(largest.min(128 << 20)));
    assert_eq!(restored.gaussians().sh_coefficients().to_host::<f32>(), coefficients);
    let mut session = Session::begin(&trial.data, &trial.config, Some(restored), &device);
    let report = session.step().report;
    assert!(report.loss.is_finite() && !report.skipped);
    println!("peak memory {:.2} GB", peak_memory().unwrap_or(0) as f64 / 1e9);
}

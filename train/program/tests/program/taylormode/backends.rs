//! It trains the same scene on every backend.

use gs_train::run::watch::Job;
use gs_worlds::deblur::{DeblurOptions, World};

use crate::common;
use crate::taylormode::{job, written};

/// Largest difference between backends, dB. Sums in another order differ in the seventh digit; forty steps of Adam,
/// whose first have full length whatever the gradient, made 4e-4 dB of that.
const BACKENDS_APART: f64 = 0.01;

/// The whole pipeline, on each backend of the build: the same scene but for rounding.
#[test]
fn every_backend_trains_the_same_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    // Two bodies, each with a common motion.
    let world = written(folder, DeblurOptions { world: World::Pair, ..DeblurOptions::default() });
    for more in [["blur.mode=integrate", "motion.remainder=on"], ["blur.mode=warp", "blur.decouple=true"]] {
        let trained = common::backends().map(|backend| {
            let run = Job {
                device: common::named(backend),
                ..job(&world, &folder.join(format!("{backend} {}", more[0])), &more)
            };
            let last = common::finish(&run).last;
            (backend, [last.mean().psnr, last.moving().expect("the truth's mask").psnr])
        });
        let trained: Vec<(&str, [f64; 2])> = trained.collect();
        let (_, first) = trained[0];
        for (backend, psnr) in &trained {
            let apart = (0..2).map(|i| (psnr[i] - first[i]).abs()).fold(0.0, f64::max);
            assert!(apart <= BACKENDS_APART, "{more:?} on {backend}: {psnr:?} dB, on {}: {first:?}", trained[0].0);
        }
    }
}

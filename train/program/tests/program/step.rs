//! One step: it learns, it refuses what is not finite, and it costs no Gaussian its place.

use crate::common;

use burn::tensor::Tensor;
use gs_base::Intrinsics;
use gs_burn::Camera;
use gs_train::fit::parameters::{Group, Table};
use gs_train::fit::trainer::Trainer;

#[test]
fn steps_lower_the_loss() {
    let mut begun = common::begun(&common::config(60, &[]));
    let losses: Vec<f32> = (0..60).map(|_| begun.step().loss).collect();
    assert!(losses[59] < 0.7 * losses[0], "{} -> {}", losses[0], losses[59]);
    assert_eq!(begun.trainer.gaussians().sh_degree(), 3, "a short run reaches the full degree");
}

#[test]
fn a_loss_that_is_not_finite_is_skipped_and_counted() {
    let mut begun = common::begun(&common::config(10, &["density.mcmc.noise=0"]));
    let before = Group::ALL.map(|group| begun.trainer.gaussians().read(group));
    // The size regulariser divides by the extent.
    let extent = std::mem::replace(&mut begun.trainer.facts.extent, 0.0);
    let report = begun.step();
    assert!(report.skipped && !report.loss.is_finite());
    let trainer = &mut begun.trainer;
    assert_eq!((trainer.skipped, trainer.step, trainer.adam.updates), (1, 1, 0));
    assert_eq!(before, Group::ALL.map(|group| trainer.gaussians().read(group)), "nothing was updated");
    trainer.facts.extent = extent;
    assert!(!begun.step().skipped, "the next step is unaffected");
}

#[test]
fn ignored_pixels_teach_nothing() {
    let still = ["loss.opacity_reg=0", "loss.scale_reg=0", "density.strategy=none"];
    let config = common::config(10, &still);
    let mut begun = common::begun(&config);
    let [height, width, _] = begun.photo.image.dims();
    begun.photo.mask = Some(Tensor::zeros([height, width, 1], &common::device()));
    let before = begun.trainer.gaussians().read(Group::Means);
    begun.step();
    assert_eq!(before, begun.trainer.gaussians().read(Group::Means));
}

/// A GPU makes its lists as long as the steps before tell. The first step near the scene has many times the pairs of
/// those far from it, so the pass is done again; the next one has room. Neither differs in a bit from a trainer that
/// counts first.
#[test]
fn room_for_intersections_changes_no_bit() {
    for backend in common::backends() {
        let device = common::named(backend);
        let mut begun = common::begun_on(&common::config(10, &["density.mcmc.noise=0"]), &device);
        let near = &begun.photo.camera;
        let Intrinsics { fx, fy, cx, cy } = near.intrinsics;
        let intrinsics = Intrinsics { fx: 8.0 * fx, fy: 8.0 * fy, cx: 8.0 * cx, cy: 8.0 * cy };
        let back =
            Tensor::from_floats([[0., 0., 0., 0.], [0., 0., 0., 0.], [0., 0., 0., 300.], [0., 0., 0., 0.]], &device);
        let far = Camera { viewmat: near.viewmat.clone() + back, intrinsics, width: 320, height: 240 };
        let near = Camera { viewmat: near.viewmat.clone(), ..far.clone() };
        begun.photo.image = Tensor::zeros([240, 320, 3], &device);

        begun.photo.camera = far;
        let few = begun.step().intersections;
        begun.photo.camera = near;
        for step in ["the pass is done again", "there is room"] {
            let mut counting = Trainer::from_model(begun.trainer.model().clone(), begun.data.facts, &begun.config);
            (counting.adam, counting.step) = (begun.trainer.adam.clone(), begun.trainer.step);
            let photos = std::slice::from_ref(&begun.photo);
            let expected = counting.step(photos, &begun.data.scene.train, &begun.data.cues, &begun.config);
            let report = begun.step();
            assert_eq!(
                (report.intersections, report.loss),
                (expected.intersections, expected.loss),
                "{backend}: {step}"
            );
            assert!(report.intersections > 4096.max(4 * few), "{backend}: {few}, then {}", report.intersections);
            for group in Group::ALL {
                let [ours, theirs] = [&begun.trainer, &counting].map(|trainer| trainer.gaussians().read(group));
                assert_eq!(ours, theirs, "{backend}: {step}: {}", group.path());
            }
        }
    }
}

//! One step: it learns, it refuses what is not finite, and it costs no Gaussian its place.

mod common;

use gs_train::fit::parameters::{Group, Table};

#[test]
fn steps_lower_the_loss() {
    let mut begun = common::begun(&common::config(60, &[]));
    let losses: Vec<f32> = (0..60).map(|_| begun.step().loss).collect();
    assert!(losses[59] < 0.7 * losses[0], "{} -> {}", losses[0], losses[59]);
    assert_eq!(begun.trainer.gaussians().sh_degree(), 3, "a short run reaches the full degree");
}

#[test]
fn a_loss_that_is_not_finite_is_skipped_and_counted() {
    let mut begun = common::begun(&common::config(10, &["density.noise=0"]));
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
    begun.photo.mask = Some(burn::tensor::Tensor::zeros([height, width, 1], &common::device()));
    let before = begun.trainer.gaussians().read(Group::Means);
    begun.step();
    assert_eq!(before, begun.trainer.gaussians().read(Group::Means));
}

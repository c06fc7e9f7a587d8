//! One step: it learns, it refuses what is not finite, and it costs no Gaussian its place.

mod common;

use gs_train::parameters::Group;

#[test]
fn steps_lower_the_loss() {
    let config = common::config(60, &[]);
    let (_, mut trainer, photo) = common::begun(&config);
    let losses: Vec<f32> = (0..60).map(|_| trainer.step(&photo, &config).loss).collect();
    assert!(losses[59] < 0.7 * losses[0], "{} -> {}", losses[0], losses[59]);
    assert_eq!(trainer.parameters.sh_degree(), 3, "a short run reaches the full degree");
}

#[test]
fn a_loss_that_is_not_finite_is_skipped_and_counted() {
    let config = common::config(10, &["density.noise=0"]);
    let (_, mut trainer, photo) = common::begun(&config);
    let before = Group::ALL.map(|group| trainer.parameters.read(group));
    // The size regulariser divides by the extent.
    let extent = std::mem::replace(&mut trainer.extent, 0.0);
    let report = trainer.step(&photo, &config);
    assert!(report.skipped && !report.loss.is_finite());
    assert_eq!((trainer.skipped, trainer.step, trainer.optimiser.updates), (1, 1, 0));
    assert_eq!(before, Group::ALL.map(|group| trainer.parameters.read(group)), "nothing was updated");
    trainer.extent = extent;
    assert!(!trainer.step(&photo, &config).skipped, "the next step is unaffected");
}

#[test]
fn ignored_pixels_teach_nothing() {
    let config = common::config(10, &["loss.opacity_reg=0", "loss.scale_reg=0", "density.noise=0"]);
    let (_, mut trainer, mut photo) = common::begun(&config);
    let [height, width, _] = photo.image.dims();
    photo.mask = Some(burn::tensor::Tensor::zeros([height, width, 1], &common::device()));
    let before = trainer.parameters.read(Group::Means);
    trainer.step(&photo, &config);
    assert_eq!(before, trainer.parameters.read(Group::Means));
}

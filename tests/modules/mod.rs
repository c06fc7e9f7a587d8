//! Modules by the paths of their parameters: what is found, replaced and learned.

mod adam;
mod named_parameters;

use gs_burn::Gaussians;
use gs_tests::devices::reference;
use gs_tests::scenes::{Leaves, Scene};

/// `count` Gaussians of SH degree 1, outside autodiff.
fn gaussians(count: usize) -> Gaussians {
    let Leaves { means, quats, log_scales, opacity_logits, sh, .. } = Scene::random(count, 7).leaves(reference());
    let sh = sh.inner().narrow(1, 0, 4);
    Gaussians::from_tensors(means.inner(), quats.inner(), log_scales.inner(), opacity_logits.inner(), sh)
}

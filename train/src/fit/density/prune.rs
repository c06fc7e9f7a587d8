//! Pruning by contribution, once the count is fixed: the Gaussians that together contribute next to nothing to the
//! training images are removed. The others have the rest of the run to compensate.
//!
//! The contribution of a Gaussian is the sum of its blending weights over all pixels and training views, `sum_p T_p
//! alpha_p`: the derivative of the summed image of a feature with respect to that feature. (RadSplat prunes by the
//! largest weight; the sum bounds the loss if many are removed at once.) After growth to the cap, a fifth of the
//! Gaussians have 0.5 % of the contribution: hidden ones, ones outside every photo, and faint copies.

use burn::tensor::Tensor;
use gs_burn::{Extras, Gaussians, RenderOptions, render_with};
use gs_datasets::View;
use gs_models::DynamicScene;
use rand::seq::index;

use super::ops::Draft;
use crate::fit::parameters::to_host;
use crate::fit::photos::camera;
use crate::fit::random::{Purpose, stream};
use crate::fit::times::each_view;
use gs_burn::RowMap;
use gs_burn::adam::Adam;

/// At most this many views are sampled. A Gaussian seen in 2 % of the views is missed by all samples with probability
/// 1/170.
const VIEWS: usize = 256;

/// Contribution of each Gaussian of `model` over `views`, `[N]`, pixels.
pub fn contributions(model: &dyn DynamicScene, views: &[View], options: &RenderOptions, seed: u64) -> Vec<f64> {
    let mut sampler = stream(seed, Purpose::Prune, 0);
    let mut chosen = index::sample(&mut sampler, views.len(), VIEWS.min(views.len())).into_vec();
    chosen.sort_unstable();
    let chosen: Vec<&View> = chosen.into_iter().map(|index| &views[index]).collect();
    let mut sums = Vec::new();
    each_view(model, &chosen, |scene, index| {
        let weights = weights(scene, chosen[index], options);
        sums.resize(weights.len(), 0.0);
        sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += f64::from(weight));
    });
    sums
}

/// Contribution of each Gaussian in one view, `[N]`, pixels.
fn weights(scene: &Gaussians, view: &View, options: &RenderOptions) -> Vec<f32> {
    let feature = Tensor::<2>::ones([scene.len(), 1], &scene.device()).autodiff().require_grad();
    let scene = Gaussians::from_tensors(
        scene.means.val().autodiff(),
        scene.quats.val().autodiff(),
        scene.log_scales.val().autodiff(),
        scene.opacity_logits.val().autodiff(),
        scene.sh.val().autodiff(),
    );
    let extras = Extras { features: Some(feature.clone()), ..Extras::default() };
    let rendering = render_with(&scene, &camera(view, &feature.device()), options, extras);
    let gradients = rendering.features.expect("a feature was given").sum().backward();
    to_host(feature.grad(&gradients).expect("the feature is a leaf"))
}

/// Removes the Gaussians of the least `contributions`, as many as have together at most `share` of the sum.
pub fn prune_by_contribution(
    gaussians: &mut Gaussians,
    adam: &mut Adam,
    contributions: &[f64],
    share: f64,
) -> Option<RowMap> {
    let kept = kept(contributions, share);
    let mut draft = Draft::read(gaussians);
    draft.retain(|_, row| kept[row]);
    (draft.len() < gaussians.len()).then(|| draft.commit(gaussians, adam))
}

/// Whether each Gaussian is kept. Of equal contributions the lower row is removed first.
fn kept(contributions: &[f64], share: f64) -> Vec<bool> {
    let allowed = share * contributions.iter().sum::<f64>();
    let mut order: Vec<usize> = (0..contributions.len()).collect();
    order.sort_by(|a, b| contributions[*a].total_cmp(&contributions[*b]));
    let (mut kept, mut dropped) = (vec![true; contributions.len()], 0.0);
    for row in order {
        dropped += contributions[row];
        // If nothing is seen at all, nothing is removed.
        if !(dropped <= allowed && allowed > 0.0) {
            break;
        }
        kept[row] = false;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_go_up_to_the_share() {
        let contributions = [0.0, 50.0, 1.0, 1.0, 30.0, 0.0, 18.0];
        assert_eq!(kept(&contributions, 0.0105), [false, true, false, true, true, false, true]);
        assert_eq!(kept(&contributions, 0.0), [true; 7]);
        assert_eq!(kept(&[0.0; 3], 0.5), [true; 3], "nothing is seen");
        assert_eq!(kept(&[f64::NAN, 1.0], 0.5), [true; 2], "not a number is not little");
    }
}

//! Likelihood check of the simpler motion that [`select`](super::select) proposes: does it explain the photos as well?
//!
//! The check judges all Gaussians together, with the residual variance of training photos: a single Gaussian changes
//! too few pixels, and no photo is set aside. The check rejects visible changes; for single Gaussians, the threshold in
//! pixels of [`select`](super::select) decides.

use burn::tensor::{Device, Tensor};
use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_datasets::View;
use gs_models::taylormode::shrinkage::{norm, pixels_per_unit};
use gs_models::taylormode::{Evidence, TaylorMotion};

use super::blur::exposed;
use super::config::BlurMode;
use super::select::{Selected, Selection, select, view_scales};
use super::update::follow_moments;
use super::{Step, Taylormode};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{colors_of, mask_of};

/// Photos that judge a proposal, spread evenly over the training views: enough that no single one decides.
const PHOTOS: usize = 6;

/// Factors on the threshold in pixels that are tried in turn until the photos agree: where they do not ask for the
/// motion, much more than the threshold may go.
const SHARES: [f64; 5] = [4.0, 2.0, 1.0, 0.5, 0.25];

/// Share of the run after which no block is shrunk: the orders that are left regain the amplitude that they lost.
const SHRINK_UNTIL: f64 = 0.8;

/// A scene to be judged.
struct Candidate<'a> {
    gaussians: &'a Gaussians,
    motion: &'a TaylorMotion,
    /// The model that the motion was proposed for; its exposure forms the blur.
    model: &'a Taylormode,
}

/// Selects, and reverts the selection if the photos need the removed motion (Schwarz's criterion, with pixels that
/// share a blur counted as one).
pub fn select_with_check(
    model: Taylormode,
    gaussians: &mut Gaussians,
    adam: &mut Adam,
    views: &[View],
    at: &Step,
) -> (Taylormode, Selected) {
    if model.motion.is_empty() || views.is_empty() {
        return (model, Selected::default());
    }
    let device = gaussians.device();
    let judges: Vec<&View> = views.iter().step_by(views.len().div_ceil(PHOTOS)).collect();
    let present = Candidate { gaussians, motion: &model.motion, model: &model };
    let before: Vec<Tensor<3>> = judges.iter().map(|view| present.formed(view, at)).collect();
    let area = present.blur_area(views);
    let mut config = at.config.method.motion.clone();
    if at.step as f64 > SHRINK_UNTIL * at.config.steps as f64 {
        config.shrink_pixels = 0.0;
    }
    let limit = config.select_pixels;
    for share in SHARES {
        config.select_pixels = limit * share;
        let selection = select(gaussians, &model.motion, views, &config);
        let dropped = model.motion.numbers() as f64 - selection.motion.numbers() as f64;
        let simpler = Candidate { gaussians: &selection.gaussians, motion: &selection.motion, model: &model };
        let one =
            |(view, before): (&&View, &Tensor<3>)| compared(view, simpler.formed(view, at), before.clone(), &device);
        let [lower, higher, pixels] = judges.iter().zip(&before).map(one).fold([0.0; 3], add);
        let evidence = Evidence {
            lower,
            higher,
            variance: (higher / pixels).max(f64::MIN_POSITIVE),
            pixels,
            blur_area: area,
            parameters: dropped,
        };
        if !evidence.accepts() {
            let Selection { gaussians: moved, motion, kept, selected } = selection;
            *gaussians = moved;
            let mut score = model.score;
            if let Some(kept) = &kept {
                follow_moments(adam, kept);
                score = score.map(|score| score.follow(kept));
            }
            return (Taylormode { motion, score, ..model }.held_to_orders(gaussians, adam), selected);
        }
        tracing::debug!(share, lower, higher, pixels, dropped, "the photos want the motion kept");
    }
    (model, Selected::default())
}

impl Candidate<'_> {
    /// The image that the scene forms for a view.
    fn formed(&self, view: &View, at: &Step) -> Tensor<3> {
        let blur = &at.config.method.blur;
        let count = if blur.mode == BlurMode::None { 1 } else { blur.samples };
        exposed(self.gaussians, self.motion, (self.model.exposure_of(view), count), view, at)
    }

    /// Mean path of the moving Gaussians during one exposure, pixels: the length over which blur correlates pixels.
    fn blur_area(&self, views: &[View]) -> f64 {
        let paths = self.motion.paths(&self.gaussians.means.val());
        let speeds = to_host(paths.velocity(paths.window.t0));
        let means = to_host(self.gaussians.means.val());
        let scales = pixels_per_unit(&means, &self.motion.rows, &view_scales(views));
        let exposure = self.model.exposure_on_host();
        let seen = speeds.chunks_exact(3).zip(&scales).filter(|(_, scale)| scale.is_finite());
        let lengths: Vec<f64> = seen.map(|(velocity, scale)| norm(velocity) * exposure * scale).collect();
        (lengths.iter().sum::<f64>() / lengths.len().max(1) as f64).max(1.0)
    }
}

/// Sums of squared differences from the photo with the simpler and with the present motion, and the number of
/// differences, over the pixels in which the two images differ. The other pixels do not distinguish the two, and are
/// explained better than moving ones.
fn compared(view: &View, simpler: Tensor<3>, present: Tensor<3>, device: &Device) -> [f64; 3] {
    let differs = (simpler.clone() - present.clone()).abs().max_dim(2).greater_elem(NOTICED).float();
    let counts = match mask_of(view, device) {
        Some(mask) => differs * mask,
        None => differs,
    };
    let photo = colors_of(view, device);
    let sum = |tensor: Tensor<3>| f64::from(tensor.sum().into_scalar::<f32>());
    let misses = |image: Tensor<3>| sum((image - photo.clone()).square() * counts.clone());
    [misses(simpler), misses(present), 3.0 * sum(counts.clone())]
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] + b[i])
}

/// Difference of a colour channel (0 to 1) from which on two images differ: half a step of an 8-bit photo.
const NOTICED: f64 = 0.5 / 255.0;

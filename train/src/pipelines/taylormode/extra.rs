//! What the method adds to a photo: priors and moving pixels on the device.

use std::sync::Arc;

use burn::tensor::{Device, Tensor};
use gs_datasets::{DepthPrior, DepthSpace, View};
use gs_models::Pixels;

use super::Cues;
use crate::fit::photos::{Extra, to_tensor};

/// Priors and moving pixels of a photo; each is optional.
#[derive(Debug, Clone, Default)]
pub struct PhotoPriors {
    /// `[H, W, 1]`: 1 where something moves.
    pub moving: Option<Tensor<3>>,
    /// The pixels at which a formed blur is compared.
    pub compared: ComparedPixels,
    /// The photo as a deblurring network would have it, `[H, W, 3]`.
    pub sharp: Option<Tensor<3>>,
    /// `[H * W]`, 0 where unknown, with what its values mean and whether they are in scene units; on the host, where priors
    /// are aligned.
    pub depth: Option<(Arc<Vec<f32>>, DepthSpace, bool)>,
    /// World velocity of the moving object's centre (Eq. 17), scene units per unit of time.
    pub guide: Option<[f64; 3]>,
}

/// The pixels at which a formed blur is compared.
#[derive(Debug, Clone, Default)]
#[allow(clippy::large_enum_variant)] // there is one per photo
pub enum ComparedPixels {
    /// All: nothing is known of motion, and no pixel is ignored.
    #[default]
    All,
    /// These: moving pixels that the mask does not ignore (all that are not ignored, where nothing is known of motion).
    Some(Pixels),
    /// None: nothing moves in the photo.
    None,
}

impl PhotoPriors {
    /// The priors of `view`, the `index`-th of the views that `cues` are about.
    pub fn new(cues: &Cues, index: usize, view: &View, device: &Device) -> Self {
        // Where no motion was looked for (`motion.masks = "none"`) every Gaussian may move, but the pseudo-sharp photo still
        // stands only where the data set says that something does.
        let moving = cues.masks.masks.get(index).unwrap_or(&view.priors.moving).as_deref();
        let depth = |prior: &DepthPrior| (Arc::new(prior.values.clone()), prior.space, prior.metric);
        // Pixels that do not count have no colour that a blurred one could be compared with.
        let compared: Option<Vec<u8>> = match (moving, view.mask.as_deref()) {
            (Some(moving), Some(counts)) => Some(moving.iter().zip(counts).map(|(a, b)| *a.min(b)).collect()),
            (one, None) | (None, one) => one.map(<[u8]>::to_vec),
        };
        let listed = compared.map(|mask| Pixels::masked(&mask, view.width, view.height, device));
        Self {
            moving: moving.map(|mask| to_tensor(view, mask, 1, device)),
            compared: match (listed, moving) {
                (None, _) | (Some(None), None) => ComparedPixels::All,
                (Some(Some(pixels)), _) => ComparedPixels::Some(pixels),
                (Some(None), Some(_)) => ComparedPixels::None,
            },
            sharp: view.priors.sharp.as_ref().map(|image| to_tensor(view, &image.data, 3, device)),
            depth: view.priors.depth.as_ref().map(depth),
            guide: cues.guides.get(index).copied().flatten(),
        }
    }
}

impl Extra for PhotoPriors {
    fn floats_per_pixel(&self) -> usize {
        let single = usize::from(self.moving.is_some()) + usize::from(self.depth.is_some());
        single + 3 * usize::from(self.sharp.is_some())
    }
}

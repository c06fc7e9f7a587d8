//! The method's device data of a photo: priors and moving pixels.

use burn::tensor::{Device, Tensor};
use gs_datasets::View;
use gs_models::Pixels;

use super::Cues;
use gs_train::fit::depth::PhotoDepth;
use gs_train::fit::photos::{Extra, to_tensor};

/// Priors and moving pixels of a photo; each is optional.
#[derive(Debug, Clone, Default)]
pub struct PhotoPriors {
    /// `[H, W, 1]`: 1 at moving pixels.
    pub moving: Option<Tensor<3>>,
    /// The pixels at which a formed blur is compared.
    pub compared: ComparedPixels,
    /// The pseudo-sharp photo, `[H, W, 3]`.
    pub sharp: Option<Tensor<3>>,
    /// The depth prior.
    pub depth: PhotoDepth,
    /// World velocity of the moving object's centre (Eq. 17), scene units per unit of time.
    pub guide: Option<[f64; 3]>,
    /// How long the shutter was open, as the data set states it, its unit of time.
    pub exposure: Option<f64>,
    /// The camera's name.
    pub camera: Option<String>,
}

/// The pixels at which a formed blur is compared.
#[derive(Debug, Clone, Default)]
#[allow(clippy::large_enum_variant)] // there is one per photo
pub enum ComparedPixels {
    /// All: no motion is known, and no pixel is ignored.
    #[default]
    All,
    /// These: moving pixels that the mask does not ignore (all that are not ignored, if no motion is known).
    Some(Pixels),
    /// None: nothing moves in the photo.
    None,
}

impl PhotoPriors {
    /// The priors of `view`, the `index`-th of the views of `cues`.
    pub fn new(cues: &Cues, index: usize, view: &View, device: &Device) -> Self {
        // If no motion was searched for (`motion.masks = "none"`) every Gaussian may move, but the pseudo-sharp photo
        // still replaces only the pixels that the data set marks as moving.
        let moving = cues.masks.masks.get(index).unwrap_or(&view.priors.moving).as_deref();
        // Ignored pixels have no colour that a blurred one could be compared with.
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
            depth: PhotoDepth::of(view),
            guide: cues.guides.get(index).copied().flatten(),
            exposure: view.exposure,
            camera: view.camera_id.clone(),
        }
    }
}

impl Extra for PhotoPriors {
    fn floats_per_pixel(&self) -> usize {
        let single = usize::from(self.moving.is_some()) + self.depth.floats_per_pixel();
        single + 3 * usize::from(self.sharp.is_some())
    }
}

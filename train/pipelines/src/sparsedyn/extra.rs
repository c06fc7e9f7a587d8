//! The method's device data of a photo: the depth prior of the first frame, and the outline of what stands before a
//! plain background.

use burn::tensor::{Device, Tensor, TensorData};
use gs_datasets::View;

use super::Cues;
use gs_train::fit::photos::Extra;

/// The cues of a photo beside its colours.
#[derive(Debug, Clone, Default)]
pub struct PhotoCues {
    /// Camera z `[H, W, 1]`, scene units, and its weight `[H, W, 1]`, 0 (unknown) to 1.
    pub depth: Option<(Tensor<3>, Tensor<3>)>,
    /// `[H, W, 1]`: 1 inside the outline, -1 before the background, 0 where that is not known.
    pub outline: Option<Tensor<3>>,
}

impl PhotoCues {
    /// The cues of the `index`-th training view.
    pub fn new(cues: &Cues, view: &View, index: usize, device: &Device) -> Self {
        let tensor =
            |values: &[f32]| Tensor::from_data(TensorData::new(values.to_vec(), [view.height, view.width, 1]), device);
        let prior = cues.depths.get(&index);
        let sides = |outline: &Vec<i8>| tensor(&outline.iter().map(|side| f32::from(*side)).collect::<Vec<f32>>());
        Self {
            depth: prior.map(|prior| (tensor(&prior.depth), tensor(&prior.weights))),
            outline: cues.outlines.get(&index).map(sides),
        }
    }
}

impl Extra for PhotoCues {
    fn floats_per_pixel(&self) -> usize {
        2 * usize::from(self.depth.is_some()) + usize::from(self.outline.is_some())
    }
}

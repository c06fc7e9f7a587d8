//! The method's device data of a photo: the depth prior of the first frame.

use burn::tensor::{Device, Tensor, TensorData};
use gs_datasets::View;

use super::Cues;
use crate::fit::photos::Extra;

/// The depth prior of a photo, if it is of the first frame and has one.
#[derive(Debug, Clone, Default)]
pub struct DepthCue {
    /// Camera z `[H, W, 1]`, scene units, and its weight `[H, W, 1]`, 0 (unknown) to 1.
    pub depth: Option<(Tensor<3>, Tensor<3>)>,
}

impl DepthCue {
    /// The prior of the `index`-th training view.
    pub fn new(cues: &Cues, view: &View, index: usize, device: &Device) -> Self {
        let tensor =
            |values: &[f32]| Tensor::from_data(TensorData::new(values.to_vec(), [view.height, view.width, 1]), device);
        let prior = cues.depths.get(&index);
        Self { depth: prior.map(|prior| (tensor(&prior.depth), tensor(&prior.weights))) }
    }
}

impl Extra for DepthCue {
    fn floats_per_pixel(&self) -> usize {
        2 * usize::from(self.depth.is_some())
    }
}

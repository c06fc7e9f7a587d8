//! Gaussians between tensors and the host.

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::Gaussians;
use gs_splats::Splats;

/// The Gaussians on the host, without an offset.
pub fn splats_of(gaussians: &Gaussians, antialiased: Option<bool>) -> Splats {
    fn rows<const D: usize, const C: usize>(tensor: Tensor<D>) -> Vec<[f32; C]> {
        let values: Vec<f32> = tensor.inner().into_data().iter::<f32>().collect();
        values.as_chunks::<C>().0.to_vec()
    }
    Splats {
        means: rows(gaussians.means.val()),
        offset: [0.0; 3],
        quats: rows(gaussians.quats.val()),
        log_scales: rows(gaussians.log_scales.val()),
        opacity_logits: rows::<1, 1>(gaussians.opacity_logits.val()).into_iter().map(|[x]| x).collect(),
        degree: gaussians.sh_degree(),
        sh: rows(gaussians.sh.val()),
        antialiased,
    }
}

/// The Gaussians on a device.
pub fn gaussians_of(splats: &Splats, device: &Device) -> Gaussians {
    fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
        Tensor::from_data(TensorData::new(values, shape), device)
    }
    let n = splats.len();
    Gaussians::from_tensors(
        tensor(splats.means.as_flattened().to_vec(), [n, 3], device),
        tensor(splats.quats.as_flattened().to_vec(), [n, 4], device),
        tensor(splats.log_scales.as_flattened().to_vec(), [n, 3], device),
        tensor(splats.opacity_logits.clone(), [n], device),
        tensor(splats.sh.as_flattened().to_vec(), [n, splats.coefficients(), 3], device),
    )
}

//! Gaussians from the axes of a snippet to the world of the data set.

use glam::{DMat3, DMat4, DVec3};
use gs_burn::{Gaussians, exact_matmul};
use gs_train::fit::parameters::from_host;

/// The Gaussians turned into the world's axes, and the position that is still to be added. Colours do not depend on
/// the direction.
pub fn in_world(gaussians: &Gaussians, to_world: &DMat4, origin: DVec3) -> (Gaussians, DVec3) {
    let device = gaussians.device();
    let square = |values: &[f64], n: usize| from_host(values.iter().map(|x| *x as f32).collect(), n, &device);
    // Rows are multiplied from the left: the columns of a matrix in glam's order are the rows of its transpose.
    let turn = square(&DMat3::from_mat4(*to_world).to_cols_array(), 3);
    let means = exact_matmul(gaussians.means.val().inner(), turn);
    // (c, 0, 0, s) times the quaternion w x y z (Hamilton), as a matrix on rows.
    let (s, c) = (0.5 * to_world.x_axis.y.atan2(to_world.x_axis.x)).sin_cos();
    let product = [c, 0.0, 0.0, s, 0.0, c, s, 0.0, 0.0, -s, c, 0.0, -s, 0.0, 0.0, c];
    let quats = exact_matmul(gaussians.quats.val().inner(), square(&product, 4));
    let (scales, opacities) = (gaussians.log_scales.val().inner(), gaussians.opacity_logits.val().inner());
    let turned = Gaussians::from_tensors(means, quats, scales, opacities, gaussians.sh.val().inner());
    (turned, origin + to_world.w_axis.truncate())
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, Tensor};

    /// A quarter turn takes x to y, for a position and for the axes of a Gaussian that is turned by a quarter already.
    #[test]
    fn positions_and_orientations_turn() {
        let device = Device::default();
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let row = |values: &[f32]| from_host(values.to_vec(), values.len(), &device);
        let gaussians = Gaussians::from_tensors(
            row(&[1.0, 0.0, 2.0]),
            row(&[half, 0.0, 0.0, half]),
            row(&[0.0; 3]),
            Tensor::zeros([1], &device),
            Tensor::zeros([1, 1, 3], &device),
        );
        let to_world = DMat4::from_translation(DVec3::X) * DMat4::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let (turned, origin) = in_world(&gaussians, &to_world, DVec3::Y);
        assert_eq!(origin, DVec3::new(1.0, 1.0, 0.0));
        let near = |tensor: Tensor<2>, expected: &[f64]| {
            let found: Vec<f64> = tensor.to_data().iter::<f64>().collect();
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
        };
        assert!(near(turned.means.val(), &[0.0, 1.0, 2.0]));
        // Two quarter turns are a half turn about z.
        assert!(near(turned.quats.val(), &[0.0, 0.0, 0.0, 1.0]));
    }
}

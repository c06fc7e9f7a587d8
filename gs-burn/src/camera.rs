//! A pinhole camera, and the conventions of the whole workspace.
//!
//! - Camera axes as in OpenCV: x right, y down, z forward.
//! - `viewmat` maps world to camera: `p_camera = viewmat p_world`, a rotation and a translation, `[4, 4]` row-major.
//! - Pixels: x to the right, y down; the centre of the first pixel is (0.5, 0.5), so an image spans 0 to its width.
//! - Quaternions are w x y z; images are `[H, W, C]` with floats in 0..1.

use burn::tensor::{DType, Device, Tensor, TensorData};
use glam::{DMat4, DVec3};
use gs_base::Intrinsics;

/// A pinhole camera: pose, intrinsics, image size.
#[derive(Clone, Debug)]
pub struct Camera {
    /// World to camera, `[4, 4]`. Let it require a gradient to optimise the pose.
    pub viewmat: Tensor<2>,
    /// Focal lengths and principal point for an image of `width` x `height`.
    pub intrinsics: Intrinsics,
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
}

impl Camera {
    /// From the camera's pose in the world (camera to world, OpenCV axes, rotation and translation).
    pub fn from_c2w(c2w: DMat4, intrinsics: Intrinsics, width: usize, height: usize, device: &Device) -> Self {
        // The inverse of a rigid motion is [R^T | -R^T t]: exact where a general inverse would round.
        let rotation = glam::DMat3::from_mat4(c2w).transpose();
        let translation = -(rotation * c2w.w_axis.truncate());
        let viewmat = DMat4::from_mat3(rotation);
        let viewmat = DMat4::from_cols(viewmat.x_axis, viewmat.y_axis, viewmat.z_axis, translation.extend(1.0));
        Self { viewmat: matrix(viewmat, (device, DType::F32)), intrinsics, width, height }
    }

    /// The camera's centre in the world, `-R^T t`, scene units. Reads `viewmat` back from the device.
    pub fn centre(&self) -> DVec3 {
        let rows: Vec<f64> = self.viewmat.to_data().iter::<f64>().collect();
        let column = |j: usize| DVec3::new(rows[j], rows[4 + j], rows[8 + j]);
        let translation = column(3);
        -DVec3::new(column(0).dot(translation), column(1).dot(translation), column(2).dot(translation))
    }
}

/// A matrix as a `[4, 4]` tensor.
fn matrix(matrix: DMat4, options: (&Device, DType)) -> Tensor<2> {
    // glam stores columns.
    let rows = matrix.transpose().to_cols_array();
    Tensor::from_data(TensorData::new(rows.to_vec(), [4, 4]), options)
}

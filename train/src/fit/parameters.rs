//! The parameters of Gaussians as one table: a row per Gaussian, a group of columns per kind of parameter.
//!
//! Between steps the Gaussians live outside autodiff and each tensor has one owner, so that an update can happen in
//! place.

use burn::module::Param;
use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::Gaussians;

use super::initialise::InitialGaussians;

/// A group of columns with one learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Means, 3 columns, scene units.
    Means = 0,
    /// Rotations w x y z, 4 columns.
    Quats = 1,
    /// Logarithms of the standard deviations, 3 columns.
    LogScales = 2,
    /// Opacity logit, 1 column.
    Opacity = 3,
    /// SH coefficients, 3 columns (red, green, blue) each, of the active degree only.
    Sh = 4,
}

impl Group {
    /// All groups in the order of the table.
    pub const ALL: [Self; 5] = [Self::Means, Self::Quats, Self::LogScales, Self::Opacity, Self::Sh];

    /// The group's name in [`Gaussians`].
    pub fn name(self) -> &'static str {
        self.path().trim_start_matches("gaussians.")
    }

    /// The group's path in a [`Model`](super::trainer::Model).
    pub fn path(self) -> &'static str {
        match self {
            Self::Means => "gaussians.means",
            Self::Quats => "gaussians.quats",
            Self::LogScales => "gaussians.log_scales",
            Self::Opacity => "gaussians.opacity_logits",
            Self::Sh => "gaussians.sh",
        }
    }

    /// Columns of the group when SH coefficients up to `degree` are stored.
    pub fn columns(self, degree: usize) -> usize {
        match self {
            Self::Means | Self::LogScales => 3,
            Self::Quats => 4,
            Self::Opacity => 1,
            Self::Sh => 3 * (degree + 1) * (degree + 1),
        }
    }
}

/// Gaussians read and written by [`Group`].
pub trait Table {
    /// One group, `[N, columns]`.
    fn group(&self, group: Group) -> Tensor<2>;

    /// Replaces one group by `[N, columns]`.
    fn set(&mut self, group: Group, values: Tensor<2>);

    /// One group as host numbers, row by row.
    fn read(&self, group: Group) -> Vec<f32> {
        to_host(self.group(group))
    }
}

impl Table for Gaussians {
    fn group(&self, group: Group) -> Tensor<2> {
        match group {
            Group::Means => self.means.val(),
            Group::Quats => self.quats.val(),
            Group::LogScales => self.log_scales.val(),
            Group::Opacity => self.opacity_logits.val().unsqueeze_dim(1),
            Group::Sh => self.sh.val().flatten(1, 2),
        }
    }

    fn set(&mut self, group: Group, values: Tensor<2>) {
        match group {
            Group::Means => self.means = Param::from_tensor(values),
            Group::Quats => self.quats = Param::from_tensor(values),
            Group::LogScales => self.log_scales = Param::from_tensor(values),
            Group::Opacity => self.opacity_logits = Param::from_tensor(values.squeeze_dim(1)),
            Group::Sh => self.sh = Param::from_tensor(by_channel(values)),
        }
    }
}

/// Gaussians from their groups in the order of [`Group::ALL`], each `[N, columns]`, outside autodiff.
pub fn gaussians(groups: [Tensor<2>; 5]) -> Gaussians {
    let [means, quats, log_scales, opacity, sh] = groups;
    Gaussians::from_tensors(means, quats, log_scales, opacity.squeeze_dim(1), by_channel(sh))
}

/// `[N, 3 S]` as `[N, S, 3]`.
fn by_channel(table: Tensor<2>) -> Tensor<3> {
    let [rows, columns] = table.dims();
    match rows {
        // In Burn's `reshape`, a 0 means "as before".
        0 => Tensor::empty([0, columns / 3, 3], &table.device()),
        _ => table.reshape([rows, columns / 3, 3]),
    }
}

/// The Gaussians of some rows.
pub fn rows_of(scene: &Gaussians, rows: &[u32]) -> Gaussians {
    let rows = indices(rows, &scene.device());
    gaussians(Group::ALL.map(|group| scene.group(group).select(0, rows.clone())))
}

/// The Gaussians of step 0 on `device` (without autodiff).
pub fn first(initial: &InitialGaussians, device: &Device) -> Gaussians {
    let n = initial.means.len();
    let tensor = |values: Vec<f32>, columns| from_host(values, columns, device);
    gaussians([
        tensor(initial.means.as_flattened().to_vec(), 3),
        tensor([1.0, 0.0, 0.0, 0.0].repeat(n), 4),
        tensor(initial.log_scales.iter().flat_map(|s| [*s; 3]).collect(), 3),
        tensor(vec![initial.opacity_logit; n], 1),
        tensor(initial.sh_dc.as_flattened().to_vec(), 3),
    ])
}

/// `values`, row by row, as `[N, columns]` on `device`.
pub fn from_host(values: Vec<f32>, columns: usize, device: &Device) -> Tensor<2> {
    let rows = values.len() / columns.max(1);
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

/// The values of a tensor, row by row.
pub fn to_host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().as_slice::<f32>().expect("tensors of this crate hold f32").to_vec()
}

/// Row numbers as a tensor.
pub fn indices(rows: &[u32], device: &Device) -> Tensor<1, Int> {
    let rows: Vec<i32> = rows.iter().map(|row| *row as i32).collect();
    let count = rows.len();
    Tensor::from_data(TensorData::new(rows, [count]), device)
}

/// `tensor` with zero columns appended up to `columns`.
pub fn widen(tensor: Tensor<2>, columns: usize) -> Tensor<2> {
    let [rows, present] = tensor.dims();
    if present >= columns {
        return tensor;
    }
    let zeros = Tensor::zeros([rows, columns - present], &tensor.device());
    Tensor::cat(vec![tensor, zeros], 1)
}

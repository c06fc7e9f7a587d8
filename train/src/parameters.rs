//! What is trained, as one table: a row per Gaussian, a group of columns per kind of parameter.
//!
//! Between steps the table lives outside autodiff, one tensor per group, uniquely owned so that an update can happen in
//! place. [`Parameters::tracked`] lends it to autodiff for one step.

use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::Gaussians;

use crate::scene_init::FirstGaussians;

/// A group of columns with one learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Centres, 3 columns, scene units.
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

    /// The group's name in checkpoints and logs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Quats => "quats",
            Self::LogScales => "log_scales",
            Self::Opacity => "opacity_logits",
            Self::Sh => "sh",
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

/// One `[N, columns]` tensor per [`Group`], without autodiff.
#[derive(Debug, Clone)]
pub struct Parameters {
    groups: [Tensor<2>; 5],
}

impl Parameters {
    /// A table from its groups, in the order of [`Group::ALL`], each `[N, columns]`.
    pub fn new(groups: [Tensor<2>; 5]) -> Self {
        Self { groups }
    }

    /// The table of step 0 on `device` (without autodiff).
    pub fn first(first: &FirstGaussians, device: &Device) -> Self {
        let n = first.means.len();
        let tensor = |values: Vec<f32>| {
            let columns = values.len() / n.max(1);
            from_host(values, columns, device)
        };
        Self::new([
            tensor(first.means.as_flattened().to_vec()),
            tensor([1.0, 0.0, 0.0, 0.0].repeat(n)),
            tensor(first.log_scales.iter().flat_map(|s| [*s; 3]).collect()),
            tensor(vec![first.opacity_logit; n]),
            tensor(first.sh_dc.as_flattened().to_vec()),
        ])
    }

    /// The table of existing Gaussians.
    pub fn from_gaussians(gaussians: &Gaussians) -> Self {
        let n = gaussians.len();
        let sh = gaussians.sh.val().inner();
        let columns = sh.dims()[1] * 3;
        Self::new([
            gaussians.means.val().inner(),
            gaussians.quats.val().inner(),
            gaussians.log_scales.val().inner(),
            gaussians.opacity_logits.val().inner().reshape([n, 1]),
            sh.reshape([n, columns]),
        ])
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.groups[0].dims()[0]
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The SH degree stored, which is the active one.
    pub fn sh_degree(&self) -> usize {
        let columns = self.get(Group::Sh).dims()[1];
        (0..=3).find(|degree| Group::Sh.columns(*degree) == columns).expect("SH columns of a degree from 0 to 3")
    }

    /// Bytes of the parameters alone.
    pub fn bytes(&self) -> usize {
        self.groups.iter().map(|group| 4 * group.dims().iter().product::<usize>()).sum()
    }

    /// Where the table lives.
    pub fn device(&self) -> Device {
        self.groups[0].device()
    }

    /// One group, `[N, columns]`.
    pub fn get(&self, group: Group) -> &Tensor<2> {
        &self.groups[group as usize]
    }

    /// One group, to replace.
    pub fn get_mut(&mut self, group: Group) -> &mut Tensor<2> {
        &mut self.groups[group as usize]
    }

    /// One group as host numbers, row by row.
    pub fn read(&self, group: Group) -> Vec<f32> {
        to_host(self.get(group).clone())
    }

    /// The Gaussians, without autodiff.
    pub fn gaussians(&self) -> Gaussians {
        self.build(|tensor| tensor)
    }

    /// The Gaussians as leaves of a new autodiff graph; see [`Gradients::take`] for their gradients.
    pub fn tracked(&self) -> Gaussians {
        self.build(Tensor::autodiff)
    }

    fn build(&self, lift: impl Fn(Tensor<2>) -> Tensor<2>) -> Gaussians {
        let n = self.len();
        let coefficients = self.get(Group::Sh).dims()[1] / 3;
        // Reshaped before the lift's result becomes a leaf: Gaussians marks its parameters as such.
        let [means, quats, log_scales, opacity, sh] = Group::ALL.map(|group| lift(self.get(group).clone()));
        Gaussians::from_tensors(means, quats, log_scales, opacity.reshape([n]), sh.reshape([n, coefficients, 3]))
    }

    /// Stores SH coefficients up to `degree`, the new ones zero. A coefficient that was inactive would have stayed zero
    /// with zero moments, so nothing is lost by not storing it before: not its bytes and not its share of each update.
    pub fn grow_sh(&mut self, degree: usize) {
        let sh = self.get(Group::Sh).clone();
        *self.get_mut(Group::Sh) = widen(sh, Group::Sh.columns(degree));
    }
}

/// The gradient of the loss by each group, `[N, columns]`, without autodiff.
#[derive(Debug)]
pub struct Gradients {
    groups: [Tensor<2>; 5],
}

impl Gradients {
    /// Takes the gradients of the leaves of [`Parameters::tracked`] out of a finished backward pass. A parameter that the
    /// loss does not reach has gradient zero.
    pub fn take(tracked: &Gaussians, gradients: &mut burn::tensor::Gradients) -> Self {
        fn one<const D: usize>(leaf: Tensor<D>, gradients: &mut burn::tensor::Gradients) -> Tensor<2> {
            // Not by dividing the number of elements: there may be no Gaussian left.
            let [rows, columns] = [leaf.dims()[0], leaf.dims()[1..].iter().product()];
            let gradient = leaf.grad_remove(gradients).unwrap_or_else(|| leaf.inner().zeros_like());
            if rows == 0 { Tensor::zeros([0, columns], &gradient.device()) } else { gradient.reshape([rows, columns]) }
        }
        Self {
            groups: [
                one(tracked.means.val(), gradients),
                one(tracked.quats.val(), gradients),
                one(tracked.log_scales.val(), gradients),
                one(tracked.opacity_logits.val(), gradients),
                one(tracked.sh.val(), gradients),
            ],
        }
    }

    /// One number that is finite only if every gradient is, `[1]`: sums carry NaN and infinity along.
    pub fn finiteness(&self) -> Tensor<1> {
        let sums = self.groups.iter().map(|group| group.clone().sum());
        sums.reduce(|a, b| a + b).expect("five groups")
    }

    /// The groups in the order of [`Group::ALL`].
    pub fn into_groups(self) -> [Tensor<2>; 5] {
        self.groups
    }
}

/// `values` row by row as `[N, columns]` on `device`.
pub fn from_host(values: Vec<f32>, columns: usize, device: &Device) -> Tensor<2> {
    let rows = values.len() / columns.max(1);
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

/// A tensor's numbers, row by row.
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

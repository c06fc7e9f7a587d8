//! Coefficients of spherical harmonics, in one tensor or with the third band in a tensor of its own.
//!
//! All sixteen coefficients of a Gaussian take 192 bytes, three times as much as the next largest tensor of a scene. A tensor is one
//! buffer of a device, and some adapters (phones, software Vulkan) bind 128 MiB at most: 699,050 Gaussians. With the seven coefficients
//! of the third degree apart, the largest tensor takes 108 bytes a Gaussian, and 1,242,756 fit. Where one tensor fits, nothing is split.

use burn::tensor::{Device, Element, Tensor, TensorData};
use gs_kernels::config::{SH_BELOW_THIRD, SH_THIRD};

use crate::limits::{bytes_of_coefficients, largest_buffer, third_band_apart};
use crate::ops::sh::{sh_colors, sh_colors_of_bands};

/// Coefficients of `N` Gaussians, `S` for each and channel.
#[derive(Clone, Debug)]
pub struct ShCoefficients {
    /// All of them, `[N, S, 3]`, `S` = 1, 4, 9 or 16; those below the third degree, `[N, 9, 3]`, if that is apart.
    pub sh: Tensor<3>,
    /// Those of the third degree, `[N, 7, 3]`, if they are apart.
    pub third: Option<Tensor<3>>,
}

impl From<Tensor<3>> for ShCoefficients {
    fn from(sh: Tensor<3>) -> Self {
        Self { sh, third: None }
    }
}

impl ShCoefficients {
    /// Coefficients `[rows, coefficients, 3]` of the host, in tensors that fit the buffers of `device`.
    ///
    /// # Panics
    /// When there are more or fewer values.
    pub fn upload(values: Vec<f32>, rows: usize, coefficients: usize, device: &Device) -> Self {
        let apart = third_band_apart(largest_buffer(device), rows as u64, coefficients);
        Self::from_host(values, rows, coefficients, apart, device)
    }

    /// Coefficients `[rows, coefficients, 3]` of the host, with the third band `apart` if there is one.
    ///
    /// # Panics
    /// When there are more or fewer values.
    pub fn from_host(values: Vec<f32>, rows: usize, coefficients: usize, apart: bool, device: &Device) -> Self {
        let tensor = |values: Vec<f32>, of: usize| Tensor::from_data(TensorData::new(values, [rows, of, 3]), device);
        if !apart || coefficients <= SH_BELOW_THIRD {
            return Self { sh: tensor(values, coefficients), third: None };
        }
        let [sh, third] = split_columns(&values, 3 * SH_BELOW_THIRD, 3 * SH_THIRD);
        Self { sh: tensor(sh, SH_BELOW_THIRD), third: Some(tensor(third, SH_THIRD)) }
    }

    /// Coefficients of a Gaussian and channel, `S`.
    pub fn coefficients(&self) -> usize {
        self.sh.dims()[1] + self.third.as_ref().map_or(0, |third| third.dims()[1])
    }

    /// The stored degree, 0 to 3.
    pub fn degree(&self) -> usize {
        self.coefficients().isqrt() - 1
    }

    /// How often the coefficients of `rows` rows fit one tensor of at most `largest_buffer` bytes; at least once.
    pub(crate) fn copies_within(&self, largest_buffer: Option<u64>, rows: usize) -> usize {
        let most = self.sh.dims()[1].max(self.third.as_ref().map_or(0, |third| third.dims()[1]));
        let bytes = (rows as u64).saturating_mul(bytes_of_coefficients(most)).max(1);
        largest_buffer.map_or(usize::MAX, |largest| (largest / bytes).max(1) as usize)
    }

    /// The coefficients after `f` of each tensor, which must keep the number of coefficients: a change of rows, of graph or of device.
    pub fn map(self, f: impl Fn(Tensor<3>) -> Tensor<3>) -> Self {
        Self { sh: f(self.sh), third: self.third.map(f) }
    }

    /// Without a third band that colours of `degree` do not read.
    pub(crate) fn up_to(self, degree: usize) -> Self {
        Self { third: self.third.filter(|_| degree > 2), ..self }
    }

    /// All values on the host, `[N, S, 3]`, row by row.
    pub fn to_host<E: Element>(&self) -> Vec<E> {
        let values = |tensor: &Tensor<3>| -> Vec<E> { tensor.to_data().iter::<E>().collect() };
        match &self.third {
            None => values(&self.sh),
            Some(third) => join_columns(&values(&self.sh), 3 * SH_BELOW_THIRD, &values(third), 3 * SH_THIRD),
        }
    }

    /// Colours `[N, 3]` seen from a camera, 0 for culled Gaussians; see [`sh_colors`]. Only tensors of the active `degree` are in the
    /// result's graph.
    ///
    /// # Panics
    /// When shapes or float types disagree, or `degree` exceeds the stored degree.
    pub fn colors(self, means: Tensor<2>, viewmat: Tensor<2>, projected: Tensor<2>, degree: usize) -> Tensor<2> {
        match self.third {
            Some(third) if degree > 2 => sh_colors_of_bands(means, self.sh, third, viewmat, projected),
            _ => sh_colors(means, self.sh, viewmat, projected, degree),
        }
    }
}

/// Rows of `a_columns` values of `a`, each followed by its row of `b_columns` values of `b`.
pub fn join_columns<T: Copy>(a: &[T], a_columns: usize, b: &[T], b_columns: usize) -> Vec<T> {
    let rows = a.chunks_exact(a_columns).zip(b.chunks_exact(b_columns));
    rows.flat_map(|(a, b)| a.iter().chain(b)).copied().collect()
}

/// Rows of `a_columns + b_columns` values as rows of their first and of their other values; the inverse of [`join_columns`].
pub fn split_columns<T: Copy>(values: &[T], a_columns: usize, b_columns: usize) -> [Vec<T>; 2] {
    let rows = || values.chunks_exact(a_columns + b_columns);
    [
        rows().flat_map(|row| &row[..a_columns]).copied().collect(),
        rows().flat_map(|row| &row[a_columns..]).copied().collect(),
    ]
}

#[cfg(test)]
mod tests;

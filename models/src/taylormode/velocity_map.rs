//! What becomes of the splatted velocity map: the paper's remainder network (Eq. 5), and its ablation.
//!
//! The map itself (Eq. 4), `V_render(u) = sum_i T_i alpha_i v_i`, is three more channels of the rasterizer's one pass, fed
//! with [`TaylorMotion::velocities`](super::TaylorMotion::velocities).
//!
//! `V_final = V_render + F_p(V_render, gamma(t))`. The network sees and gives velocities in a unit of about the fastest
//! motion, so that its numbers are of order 1 whatever the scene's. Its last layer starts at zero: at first, and
//! wherever it learns nothing, `V_final` is `V_render` exactly.

use std::f64::consts::PI;

use burn::tensor::{Device, Tensor, TensorData};

use crate::network::Mlp;

/// Octaves of `gamma`: the finest has 8 half-waves in half the window. More separate neighbouring frames better, and
/// let the network learn each frame by heart.
pub const OCTAVES: usize = 4;
/// Units of each of the two hidden layers; the paper says only "lightweight".
const HIDDEN: usize = 32;

/// `gamma(s)` = `sin(2^l pi s), cos(2^l pi s)`, `l = 0..4`, of time in window units, as one row `[1, 8]`.
pub fn time_embedding(s: f64, like: &Tensor<2>) -> Tensor<2> {
    let waves = (0..OCTAVES).flat_map(|octave| {
        let (sin, cos) = (f64::from(1_u32 << octave) * PI * s).sin_cos();
        [sin, cos]
    });
    let values: Vec<f64> = waves.collect();
    Tensor::from_data(TensorData::new(values, [1, 2 * OCTAVES]), (&like.device(), like.dtype()))
}

/// The Peano remainder network `F_p` on the velocity map, Eq. 5.
#[derive(Debug, Clone)]
pub struct PeanoMap {
    /// `[P, 3 + 8]` to `[P, 3]`.
    pub mlp: Mlp,
    /// The unit of velocity, scene units per unit of time.
    pub unit: f64,
}

impl PeanoMap {
    /// A network that adds nothing yet; `unit` is about the fastest motion, positive, scene units per unit of time.
    pub fn new(unit: f64, seed: u64, device: &Device) -> Self {
        Self { mlp: Mlp::new(&[3 + 2 * OCTAVES, HIDDEN, HIDDEN, 3], seed, true, device), unit }
    }

    /// `V_final` of `V_render`, both `[P, 3]`, scene units per unit of time, world axes; `s` in window units.
    pub fn forward(&self, rendered: Tensor<2>, s: f64) -> Tensor<2> {
        let embedding = time_embedding(s, &rendered);
        rendered.clone() + self.mlp.forward_shared(rendered / self.unit, embedding) * self.unit
    }

    /// With `f` of every learned tensor.
    pub fn map(&self, f: impl FnMut(Tensor<2>) -> Tensor<2>) -> Self {
        Self { mlp: self.mlp.map(f), ..self.clone() }
    }
}

/// Velocity from place and time by a network alone: the ablation "w/o Taylor expansion" of Table 2.
#[derive(Debug, Clone)]
pub struct DirectVelocity {
    /// `[P, 3 + 8]` to `[P, 3]`.
    pub mlp: Mlp,
    /// `[1, 3]`, subtracted from places, scene units.
    pub centre: Tensor<2>,
    /// Places are divided by this, scene units: about the scene's size.
    pub scale: f64,
    /// The unit of velocity, scene units per unit of time.
    pub unit: f64,
}

impl DirectVelocity {
    /// A network that says nothing moves, yet; see the fields.
    pub fn new(centre: [f64; 3], scale: f64, unit: f64, seed: u64, device: &Device) -> Self {
        Self {
            mlp: Mlp::new(&[3 + 2 * OCTAVES, HIDDEN, HIDDEN, 3], seed, true, device),
            centre: Tensor::from_data(TensorData::new(centre.to_vec(), [1, 3]), device),
            scale,
            unit,
        }
    }

    /// Velocity `[P, 3]` (scene units per unit of time, world axes) of what is seen at `places` `[P, 3]` (world); `s` in
    /// window units.
    pub fn forward(&self, places: Tensor<2>, s: f64) -> Tensor<2> {
        let embedding = time_embedding(s, &places);
        let centre = self.centre.clone().cast(places.dtype());
        self.mlp.forward_shared((places - centre) / self.scale, embedding) * self.unit
    }

    /// With `f` of every learned tensor.
    pub fn map(&self, f: impl FnMut(Tensor<2>) -> Tensor<2>) -> Self {
        Self { mlp: self.mlp.map(f), ..self.clone() }
    }
}

//! No more motion than a scene needs: every Gaussian keeps the lowest order whose path stays within a fraction of a pixel of
//! the present one in every training view; order 0 is a static Gaussian, which pays for no motion at all.
//!
//! How a path is lowered is in [`order`](gs_models::taylormode::order). Coefficient blocks are also shrunk by a soft threshold
//! in pixels at each selection ([`shrinkage`](gs_models::taylormode::shrinkage)), so that what the photos do not support fades.

use gs_burn::Gaussians;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sh_bands;
use gs_models::taylormode::order::lower;
use gs_models::taylormode::shrinkage::{Sight, norm, pixels_per_unit, shrink};

use crate::parameters::{Group, Parameters, from_host, to_host};
use crate::taylormode::config::MotionConfig;
use crate::taylormode::state::MotionState;

/// What a selection did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Selected {
    /// Orders taken from paths.
    pub lowered: usize,
    /// Gaussians that stopped moving.
    pub stopped: usize,
}

/// Selects once.
pub fn select(parameters: &mut Parameters, state: &mut MotionState, views: &[View], config: &MotionConfig) -> Selected {
    if state.rows.is_empty() {
        return Selected::default();
    }
    let device = parameters.device();
    let mut means = parameters.read(Group::Means);
    let log_scales = parameters.read(Group::LogScales);
    let scales = pixels_per_unit(&means, &state.rows, &sights(views));
    let (mut position, mut rotation) = (to_host(state.position.value.clone()), to_host(state.rotation.value.clone()));
    let columns = [state.position.value.dims()[1], state.rotation.value.dims()[1]];
    let mut selected = Selected::default();

    for (index, row) in state.rows.iter().enumerate() {
        let mean: &mut [f32; 3] = (&mut means[3 * *row as usize..][..3]).try_into().expect("three columns");
        let path = &mut position[columns[0] * index..][..columns[0]];
        shrink(path, scales[index], config.shrink_pixels);
        let order = usize::from(state.orders[index]);
        let left = lower(path, order, scales[index], config.select_pixels, mean);
        selected.lowered += order - left;
        state.orders[index] = left as u8;

        // A rotation moves the surface of a Gaussian by its angle times its size. The constant that lowering an even order adds
        // is left out and costs as much again: half the threshold.
        let size = log_scales[3 * *row as usize..][..3].iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
        let pixels = f64::from(size).exp() * scales[index];
        let turn = &mut rotation[columns[1] * index..][..columns[1]];
        let order = usize::from(state.rotation_orders[index]);
        state.rotation_orders[index] = lower(turn, order, pixels, 0.5 * config.select_pixels, &mut [0.0; 3]) as u8;
    }
    *parameters.get_mut(Group::Means) = from_host(means, 3, &device);
    if columns[0] > 0 {
        state.position.value = from_host(position, columns[0], &device);
    }
    if columns[1] > 0 {
        state.rotation.value = from_host(rotation, columns[1], &device);
    }
    let jumps = to_host(state.kinks.value.clone());
    let hits = 3 * state.contacts.len();
    let is_hit =
        |i: usize| jumps[hits * i..][..hits].chunks_exact(3).any(|jump| norm(jump) * scales[i] > config.select_pixels);
    let strayed = remainder_moves(&parameters.gaussians(), state);
    let is_strayed = |i: usize| strayed.get(i).is_some_and(|moves| moves * scales[i] > config.select_pixels);
    let moving: Vec<u32> = (0..state.rows.len())
        .filter(|i| state.orders[*i] + state.rotation_orders[*i] > 0 || is_hit(*i) || is_strayed(*i))
        .map(|i| i as u32)
        .collect();
    selected.stopped = state.rows.len() - moving.len();
    if selected.stopped > 0 {
        state.retain(&moving);
    }
    state.hold_orders();
    selected
}

/// Farthest that the 3D remainder moves each moving Gaussian, scene units; empty without one.
fn remainder_moves(gaussians: &Gaussians, state: &MotionState) -> Vec<f64> {
    let Some(remainder) = state.motion(gaussians).remainder else { return Vec::new() };
    let functions: Vec<Vec<f64>> = (-REMAINDER_TIMES..=REMAINDER_TIMES)
        .map(|i| remainder.functions(f64::from(i) / f64::from(REMAINDER_TIMES)))
        .map(|samples| samples.into_iter().map(|sample| sample.value).collect())
        .collect();
    let columns = remainder.weights.dims()[1];
    let moved = |weights: &[f32], values: &Vec<f64>| {
        let axis = |axis: usize| values.iter().enumerate().map(|(j, f)| f * f64::from(weights[3 * j + axis])).sum();
        DVec3::from([0, 1, 2].map(axis)).length()
    };
    let weights = to_host(remainder.weights);
    weights
        .chunks_exact(columns)
        .map(|one| functions.iter().map(|values| moved(one, values)).fold(0.0, f64::max))
        .collect()
}

/// Times on each side of `t0` at which the remainder is looked at: four to each half oscillation of its fastest function.
const REMAINDER_TIMES: i32 = 8;

/// Shrinks the bands of view-dependent colour; at the end of a run, drops those that nobody sees.
pub fn select_bands(parameters: &mut Parameters, config: &MotionConfig, is_last: bool) {
    let columns = parameters.get(Group::Sh).dims()[1];
    if columns <= 3 {
        return;
    }
    let device = parameters.device();
    let mut sh = parameters.read(Group::Sh);
    for one in sh.chunks_exact_mut(columns) {
        sh_bands::shrink(one, config.shrink_color);
        if is_last {
            sh_bands::lower(one, config.select_color);
        }
    }
    *parameters.get_mut(Group::Sh) = from_host(sh, columns, &device);
}

/// Where `views` are seen from, each place once.
pub(crate) fn sights(views: &[View]) -> Vec<Sight> {
    let mut cameras: Vec<Sight> = Vec::new();
    for view in views {
        let sight = Sight { viewmat: view.c2w.inverse(), focal: view.intrinsics.fx.max(view.intrinsics.fy) };
        if !cameras.contains(&sight) {
            cameras.push(sight);
        }
    }
    cameras
}

//! Selection of orders: every Gaussian keeps the lowest order whose path stays within a fraction of a pixel of the
//! present one in every training view. A Gaussian of order 0 is static and stores no motion.
//!
//! [`order`](gs_models::taylormode::order) lowers a path. Each selection also applies a soft threshold in pixels to
//! coefficient blocks ([`shrinkage`](gs_models::taylormode::shrinkage)), so that coefficients without support in the
//! photos decay.

use burn::module::Param;
use burn::tensor::Tensor;
use gs_burn::glam::DVec3;
use gs_burn::{Gaussians, RowMap};
use gs_datasets::View;
use gs_models::sh_bands;
use gs_models::taylormode::TaylorMotion;
use gs_models::taylormode::order::lower;
use gs_models::taylormode::shrinkage::{ViewScale, norm, pixels_per_unit, shrink};

use super::config::MotionConfig;
use gs_train::fit::parameters::{Group, Table, from_host, to_host};

/// The outcome of a selection.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Selected {
    /// Orders removed from paths.
    pub lowered: usize,
    /// Gaussians that became static.
    pub stopped: usize,
}

/// A motion with lower orders, and its Gaussians.
pub struct Selection {
    /// The Gaussians; their means include the constants left over from lowered orders.
    pub gaussians: Gaussians,
    /// The motion.
    pub motion: TaylorMotion,
    /// The moving rows that are left; `None`: all.
    pub kept: Option<RowMap>,
    /// The outcome.
    pub selected: Selected,
}

/// Lowers orders once.
pub fn select(gaussians: &Gaussians, motion: &TaylorMotion, views: &[View], config: &MotionConfig) -> Selection {
    let (mut gaussians, mut motion) = (gaussians.clone(), motion.clone());
    if motion.is_empty() {
        return Selection { gaussians, motion, kept: None, selected: Selected::default() };
    }
    let device = gaussians.device();
    let mut means = gaussians.read(Group::Means);
    let log_scales = gaussians.read(Group::LogScales);
    let scales = pixels_per_unit(&means, &motion.rows, &view_scales(views));
    let (mut position, mut rotation) = (to_host(motion.position.val()), to_host(motion.rotation.val()));
    let columns = [motion.position.dims()[1], motion.rotation.dims()[1]];
    let mut selected = Selected::default();

    for (index, row) in motion.rows.iter().enumerate() {
        let mean: &mut [f32; 3] = (&mut means[3 * *row as usize..][..3]).try_into().expect("three columns");
        let path = &mut position[columns[0] * index..][..columns[0]];
        shrink(path, scales[index], config.shrink_pixels);
        let order = usize::from(motion.orders[index]);
        let left = lower(path, order, scales[index], config.select_pixels, mean);
        selected.lowered += order - left;
        motion.orders[index] = left as u8;

        // A rotation moves the surface of a Gaussian by its angle times its scale. The constant from lowering an even
        // order is ignored and is as large again, hence half the threshold.
        let size = log_scales[3 * *row as usize..][..3].iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
        let pixels = f64::from(size).exp() * scales[index];
        let turn = &mut rotation[columns[1] * index..][..columns[1]];
        let order = usize::from(motion.rotation_orders[index]);
        motion.rotation_orders[index] = lower(turn, order, pixels, 0.5 * config.select_pixels, &mut [0.0; 3]) as u8;
    }
    gaussians.set(Group::Means, from_host(means, 3, &device));
    let table = |values: Vec<f32>, columns: usize| -> Param<Tensor<2>> {
        Param::from_tensor(from_host(values, columns, &device))
    };
    if columns[0] > 0 {
        motion.position = table(position, columns[0]);
    }
    if columns[1] > 0 {
        motion.rotation = table(rotation, columns[1]);
    }
    let jumps = motion.kinks.as_ref().map_or(Vec::new(), |kinks| to_host(kinks.jumps.val()));
    let width = 3 * motion.contacts().len();
    let is_kinked = |i: usize| {
        jumps[width * i..][..width].chunks_exact(3).any(|jump| norm(jump) * scales[i] > config.select_pixels)
    };
    let strayed = remainder_moves(&gaussians, &motion);
    let is_strayed = |i: usize| strayed.get(i).is_some_and(|moves| moves * scales[i] > config.select_pixels);
    let moving: Vec<u32> = (0..motion.rows.len())
        .filter(|i| motion.orders[*i] + motion.rotation_orders[*i] > 0 || is_kinked(*i) || is_strayed(*i))
        .map(|i| i as u32)
        .collect();
    selected.stopped = motion.rows.len() - moving.len();
    let mut kept = None;
    if selected.stopped > 0 {
        let (left, own) = motion.retain(&moving);
        (motion, kept) = (left, Some(own));
    }
    Selection { gaussians, motion: motion.hold_orders(), kept, selected }
}

/// Largest displacement of each moving Gaussian by the 3D remainder, scene units; empty without one.
fn remainder_moves(gaussians: &Gaussians, motion: &TaylorMotion) -> Vec<f64> {
    let Some(remainder) = motion.paths(&gaussians.means.val()).remainder else { return Vec::new() };
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

/// Times on each side of `t0` at which the remainder is evaluated: four to each half oscillation of its fastest
/// function.
const REMAINDER_TIMES: i32 = 8;

/// Shrinks the bands of view-dependent colour; at the end of a run, removes bands that are not visible.
pub fn select_bands(gaussians: &mut Gaussians, is_last: bool) {
    let columns = Group::Sh.columns(gaussians.sh_degree());
    if columns <= 3 {
        return;
    }
    let mut sh = gaussians.read(Group::Sh);
    for one in sh.chunks_exact_mut(columns) {
        sh_bands::shrink(one, sh_bands::NOTICEABLE);
        if is_last {
            sh_bands::lower(one, sh_bands::NOTICEABLE);
        }
    }
    gaussians.set(Group::Sh, from_host(sh, columns, &gaussians.device()));
}

/// The poses and focal lengths of `views`, without duplicates.
pub fn view_scales(views: &[View]) -> Vec<ViewScale> {
    let mut cameras: Vec<ViewScale> = Vec::new();
    for view in views {
        let camera = ViewScale { viewmat: view.c2w.inverse(), focal: view.intrinsics.fx.max(view.intrinsics.fy) };
        if !cameras.contains(&camera) {
            cameras.push(camera);
        }
    }
    cameras
}

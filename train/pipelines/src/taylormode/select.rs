//! Selection of orders: every Gaussian keeps the lowest order, beside its body's motion or without a body, whose path
//! stays within a fraction of a pixel of the present one in every training view. A Gaussian of order 0 without a body
//! is static and stores no motion.
//!
//! [`order`](gs_models::taylormode::order) lowers a path. Each selection also applies a soft threshold in pixels to
//! coefficient blocks ([`shrinkage`](gs_models::taylormode::shrinkage)), so that coefficients without support in the
//! photos decay.

use burn::module::Param;
use burn::tensor::{Device, Tensor};
use gs_burn::glam::DVec3;
use gs_burn::{Gaussians, RowMap};
use gs_datasets::View;
use gs_models::sh_bands;
use gs_models::taylormode::bodies::NO_BODY;
use gs_models::taylormode::order::lower;
use gs_models::taylormode::shrinkage::{ViewScale, norm, pixels_per_unit, shrink};
use gs_models::taylormode::{Body, TaylorMotion};

use super::carriers::{Carrier, PathTable};
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

/// Lowers orders once. Each row is told by its body, or without one, whichever takes fewer numbers.
pub fn select(gaussians: &Gaussians, motion: &TaylorMotion, views: &[View], config: &MotionConfig) -> Selection {
    let (mut gaussians, mut motion) = (gaussians.clone(), motion.clone());
    if motion.is_empty() {
        return Selection { gaussians, motion, kept: None, selected: Selected::default() };
    }
    let device = gaussians.device();
    let mut means = gaussians.read(Group::Means);
    let log_scales = gaussians.read(Group::LogScales);
    let rows = Rows::of(&motion, &means, &log_scales, views, config);
    let carriers = rows.carriers(&motion);
    let mut selected = Selected::default();
    let mut told: Vec<Told> = Vec::with_capacity(motion.len());
    for index in 0..motion.len() {
        let alone = rows.told(index, &motion, None);
        let ways = carriers.iter().enumerate().filter_map(|(body, carrier)| Some((body as u8, carrier.as_ref()?)));
        let ways = ways.map(|way| rows.told(index, &motion, Some(way)));
        // Of equal numbers the row keeps its body, or takes the first; a row that rests needs none.
        let cost = |told: &Told| {
            (told.numbers, told.body != NO_BODY && alone.numbers == 0, told.body != motion.body_of[index])
        };
        let best = ways.min_by_key(cost).filter(|way| cost(way) <= cost(&alone) && alone.numbers > 0);
        let best = best.unwrap_or(alone);
        selected.lowered += usize::from(motion.orders[index]).saturating_sub(best.order);
        told.push(best);
    }
    rows.settle(&told, &carriers, &mut motion, &device);
    for (row, told) in motion.rows.iter().zip(&told) {
        means[3 * *row as usize..][..3].copy_from_slice(&told.mean);
    }
    gaussians.set(Group::Means, from_host(means, 3, &device));
    let strayed = remainder_moves(&gaussians, &motion);
    let is_strayed = |i: usize| strayed.get(i).is_some_and(|moves| moves * rows.table.scales[i] > config.select_pixels);
    let moves = |i: &usize| told[*i].numbers > 0 || told[*i].body != NO_BODY || is_strayed(*i);
    let moving: Vec<u32> = (0..motion.rows.len()).filter(moves).map(|i| i as u32).collect();
    selected.stopped = motion.rows.len() - moving.len();
    let mut kept = None;
    if selected.stopped > 0 {
        let (left, own) = motion.retain(&moving);
        (motion, kept) = (left, Some(own));
    }
    let motion = motion.hold_orders(&gaussians.means.val());
    Selection { gaussians, motion, kept, selected }
}

/// All moving rows on the host.
struct Rows<'a> {
    table: PathTable,
    /// `[M * 3 Kr]`.
    rotation: Vec<f32>,
    /// `[M]`, pixels by which a turn of one radian moves the surface of a Gaussian.
    sizes: Vec<f64>,
    config: &'a MotionConfig,
}

/// A row by one way of telling its motion.
struct Told {
    body: u8,
    /// The centre at `t0`, with the constants of lowered orders.
    mean: [f32; 3],
    /// The path, `[3 (K + J)]`.
    path: Vec<f32>,
    /// The blocks of the rotation, `[3 Kr]`.
    turn: Vec<f32>,
    order: usize,
    rotation_order: usize,
    own_jumps: bool,
    /// Numbers of its own.
    numbers: usize,
}

impl<'a> Rows<'a> {
    fn of(motion: &TaylorMotion, means: &[f32], log_scales: &[f32], views: &[View], config: &'a MotionConfig) -> Self {
        let scales = pixels_per_unit(means, &motion.rows, &view_scales(views));
        let (position, rotation) = (to_host(motion.position.val()), to_host(motion.rotation.val()));
        let jumps = motion.kinks.as_ref().map_or(Vec::new(), |kinks| to_host(kinks.jumps.val()));
        let columns = [motion.position.dims()[1], 3 * motion.contacts().len()];
        let path =
            |i: usize| [&position[columns[0] * i..][..columns[0]], &jumps[columns[1] * i..][..columns[1]]].concat();
        let largest = |row: &u32| log_scales[3 * *row as usize..][..3].iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
        let sizes = motion.rows.iter().zip(&scales).map(|(row, scale)| f64::from(largest(row)).exp() * scale).collect();
        let table = PathTable {
            positions: motion.rows.iter().map(|row| [0, 1, 2].map(|axis| means[3 * *row as usize + axis])).collect(),
            paths: (0..motion.len()).map(path).collect(),
            order: motion.order(),
            scales,
        };
        Self { rotation, sizes, table, config }
    }

    /// The bodies, each fitted to its rows; `None` where there are too few.
    fn carriers(&self, motion: &TaylorMotion) -> Vec<Option<Carrier>> {
        let fit = |(index, body): (usize, &Body)| {
            Carrier::fit(body.frame, &motion.rows_of(index), &self.table, motion.rotation_order())
        };
        motion.bodies.iter().enumerate().map(fit).collect()
    }

    /// A row with the lowest orders of its own, beside a body or without one.
    fn told(&self, index: usize, motion: &TaylorMotion, body: Option<(u8, &Carrier)>) -> Told {
        let (config, scale) = (self.config, self.table.scales[index]);
        let columns = 3 * self.table.order;
        let turns = motion.rotation.dims()[1];
        let mut mean = self.table.positions[index];
        let mut path = self.table.paths[index].clone();
        let mut turn = self.rotation[turns * index..][..turns].to_vec();
        let carried = body.map(|(_, carrier)| carrier.carried(index, &self.table));
        let turned = body.map(|(_, carrier)| &carrier.turn);
        if let (Some(carried), Some(turned)) = (&carried, turned) {
            path.iter_mut().zip(carried).for_each(|(own, carried)| *own -= carried);
            turn.iter_mut().zip(turned).for_each(|(own, turned)| *own -= *turned as f32);
        }
        shrink(&mut path[..columns], scale, config.shrink_pixels);
        // Blocks that the row does not have beside this body are zero, and fall first.
        let order = lower(&mut path[..columns], self.table.order, scale, config.select_pixels, &mut mean);
        let shows = |jump: &[f32]| norm(jump) * scale;
        let own_jumps =
            path[columns..].chunks_exact(3).any(|jump| shows(jump).is_nan() || shows(jump) > config.select_pixels);
        if !own_jumps {
            path[columns..].fill(0.0);
        }
        // A rotation moves the surface of a Gaussian by its angle times its scale. The constant from lowering an even
        // order is ignored and is as large again, hence half the threshold.
        let limit = 0.5 * config.select_pixels;
        let rotation_order = lower(&mut turn, turns / 3, self.sizes[index], limit, &mut [0.0; 3]);
        if let (Some(carried), Some(turned)) = (&carried, turned) {
            path.iter_mut().zip(carried).for_each(|(own, carried)| *own += carried);
            turn.iter_mut().zip(turned).for_each(|(own, turned)| *own += *turned as f32);
        }
        let jumps = if own_jumps { motion.contacts().len() } else { 0 };
        let numbers = 3 * (order + rotation_order + jumps);
        let body = body.map_or(NO_BODY, |(body, _)| body);
        Told { body, mean, path, turn, order, rotation_order, own_jumps, numbers }
    }

    /// Writes rows and bodies into the motion.
    fn settle(&self, told: &[Told], carriers: &[Option<Carrier>], motion: &mut TaylorMotion, device: &Device) {
        let columns = 3 * self.table.order;
        let table = |part: &dyn Fn(&Told) -> Vec<f32>, columns: usize| -> Param<Tensor<2>> {
            Param::from_tensor(from_host(told.iter().flat_map(part).collect(), columns, device))
        };
        if columns > 0 {
            motion.position = table(&|told| told.path[..columns].to_vec(), columns);
        }
        let turns = motion.rotation.dims()[1];
        if turns > 0 {
            motion.rotation = table(&|told| told.turn.clone(), turns);
        }
        if let Some(kinks) = &mut motion.kinks {
            kinks.jumps = table(&|told| told.path[columns..].to_vec(), 3 * kinks.contacts.len());
        }
        motion.orders = told.iter().map(|told| told.order as u8).collect();
        motion.rotation_orders = told.iter().map(|told| told.rotation_order as u8).collect();
        motion.own_jumps = told.iter().map(|told| told.own_jumps).collect();
        motion.body_of = told.iter().map(|told| told.body).collect();
        for (body, carrier) in motion.bodies.iter_mut().zip(carriers) {
            if let Some(carrier) = carrier {
                *body = carrier.body(body, device);
            }
        }
    }
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

//! The fit of one pair of sweeps: a network from position to flow, descending on the distance of the moved points to
//! the second sweep.
//!
//! As in FastNSF: eight hidden layers of 128 units with ReLU, Adam at 8e-3, at most 5,000 iterations, an early end, the
//! best flow kept. Ours: the grid is capped in memory; the last layer starts at zero, so the search starts at rest;
//! positions enter in units of 20 m; a fit on a share of the points is possible, and the flow is then evaluated on all.

use burn::module::Module;
use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::{NamedGradients, profile};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::distance::DistanceGrid;
use crate::flux4d::error::{FluxError, check_range};
use crate::mlp::{Mlp, MlpConfig};

/// Hidden layers and their units (FastNSF).
const HIDDEN: [usize; 8] = [128; 8];
/// Unit of the network's input, metres: coordinates of a sweep become of order 1.
const UNIT: f64 = 20.0;

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FastNsfConfig {
    /// Learning rate of Adam.
    pub rate: f64,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Iterations without a gain after which the fit ends.
    pub patience: usize,
    /// Smallest gain of the mean distance that counts, metres.
    pub gain: f64,
    /// Edge of the distance grid's cells, metres.
    pub cell: f64,
    /// Most cells of the grid; memory is 8 bytes a cell while it is made and 4 after.
    pub most_cells: usize,
    /// Most points of the fit, evenly chosen; all without it.
    pub points: Option<usize>,
    /// Seed of the weights.
    pub seed: u64,
}

impl Default for FastNsfConfig {
    fn default() -> Self {
        Self {
            rate: 8e-3,
            iterations: 5000,
            patience: 100,
            gain: 1e-4,
            cell: 0.1,
            most_cells: 32 << 20,
            points: None,
            seed: 0,
        }
    }
}

/// A fitted flow.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowFit {
    /// Flow of each point of the first sweep, metres between the sweeps.
    pub flow: Vec<[f32; 3]>,
    /// Mean distance to the second sweep at rest and for the best flow, metres, over the points of the fit.
    pub distances: [f64; 2],
    /// Iterations done.
    pub iterations: usize,
    /// Edge of the grid's cells, metres.
    pub cell: f64,
}

/// The flow of `source` towards `target`, both in one frame of axes (world, or after compensation of the ego motion),
/// metres.
///
/// # Errors
/// When a sweep is empty, a coordinate is not usable, or a setting is out of range.
pub fn fit_flow(
    source: &[[f32; 3]],
    target: &[[f32; 3]],
    config: &FastNsfConfig,
    device: &Device,
) -> Result<FlowFit, FluxError> {
    let _stage = profile::stage("flow by optimisation");
    check(source, config)?;
    let grid = DistanceGrid::new(target, source, config.cell, config.most_cells)?;
    let step = source.len().div_ceil(config.points.unwrap_or(source.len()).max(1)).max(1);
    let chosen: Vec<[f32; 3]> = source.iter().copied().step_by(step).collect();
    let (network, distances, iterations) = descend(&chosen, &grid, config, device);
    let flow = rows(&network.forward(input(source, device)));
    Ok(FlowFit { flow, distances, iterations, cell: grid.cell() })
}

fn check(source: &[[f32; 3]], config: &FastNsfConfig) -> Result<(), FluxError> {
    if source.is_empty() {
        return Err(FluxError::TooFew { what: "the flow", needed: 1, found: 0 });
    }
    check_range("the learning rate", config.rate, [1e-9, 10.0], "1e-9 to 10")?;
    check_range("the number of iterations", config.iterations as f64, [1.0, 1e7], "1 to 1e7")?;
    check_range("the gain that counts", config.gain, [0.0, 1e3], "0 to 1000 metres")?;
    config.points.map_or(Ok(()), |points| check_range("the points of the fit", points as f64, [1.0, 1e12], "1 or more"))
}

/// The best network, its distances, and the iterations done.
fn descend(
    points: &[[f32; 3]],
    grid: &DistanceGrid,
    config: &FastNsfConfig,
    device: &Device,
) -> (Mlp, [f64; 2], usize) {
    let sizes: Vec<usize> = [3].into_iter().chain(HIDDEN).chain([3]).collect();
    let mut network = MlpConfig::new(sizes).with_zero_last(true).with_seed(config.seed).init(device);
    let mut adam = Adam::new();
    let input = input(points, device);
    let (mut best, mut least, mut marked, mut idle) = (network.clone(), f64::INFINITY, f64::INFINITY, 0);
    let mut first = f64::INFINITY;
    for iteration in 0..config.iterations {
        let tracked = network.clone().train();
        let flow = tracked.forward(input.clone());
        let (distance, slopes) = distances(points, &rows(&flow), grid);
        if iteration == 0 {
            first = distance;
        }
        if distance < least {
            (best, least) = (network.clone(), distance);
        }
        // A NaN is no gain, so a fit that diverges ends.
        idle = if distance < marked - config.gain { 0 } else { idle + 1 };
        if idle == 0 {
            marked = distance;
        }
        if idle > config.patience {
            return (best, [first, least], iteration + 1);
        }
        // The gradient of the mean distance by the flow is known, and enters as a constant.
        let slopes = Tensor::from_data(TensorData::new(slopes, [points.len(), 3]), (device, DType::F32));
        let mut gradients = (flow * slopes).sum().backward();
        let gradients = NamedGradients::take(&tracked, &mut gradients);
        drop(tracked);
        network = adam.step(network, gradients, |_| Some(AdamRate { eps: 1e-8, ..AdamRate::new(config.rate) }));
    }
    (best, [first, least], config.iterations)
}

/// The mean distance of the moved points, metres, and its gradient by each flow.
fn distances(points: &[[f32; 3]], flow: &[[f32; 3]], grid: &DistanceGrid) -> (f64, Vec<f32>) {
    let one = |(point, flow): (&[f32; 3], &[f32; 3])| {
        grid.sample([0, 1, 2].map(|a| f64::from(point[a]) + f64::from(flow[a])))
    };
    let sampled: Vec<(f64, [f64; 3])> = points.par_iter().zip(flow).map(one).collect();
    let share = 1.0 / points.len() as f64;
    let distance = sampled.iter().map(|(distance, _)| distance).sum::<f64>() * share;
    (distance, sampled.iter().flat_map(|(_, slope)| slope.map(|x| (x * share) as f32)).collect())
}

fn input(points: &[[f32; 3]], device: &Device) -> Tensor<2> {
    let values: Vec<f32> = points.iter().flatten().map(|x| (f64::from(*x) / UNIT) as f32).collect();
    Tensor::from_data(TensorData::new(values, [points.len(), 3]), (device, DType::F32))
}

fn rows(tensor: &Tensor<2>) -> Vec<[f32; 3]> {
    let values: Vec<f32> = tensor.to_data().iter::<f32>().collect();
    values.chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect()
}

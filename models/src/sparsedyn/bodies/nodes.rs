//! Nodes that bend a body: rigid motions of places in it, mixed by distance in the first frame (linear blend skinning,
//! as the control points of SC-GS).

use burn::tensor::activation::softmax;
use burn::tensor::{Int, Tensor, TensorData};
use gs_burn::exact_matmul;
use gs_burn::glam::DVec3;
use serde::{Deserialize, Serialize};

use super::transforms::{Way, constant};
use crate::sparsedyn::state::State;

/// Neighbours that a node is tied to: those around it on a surface.
const NEIGHBOURS: usize = 4;

/// The logarithm of the weight of another body's node: zero in any type.
const NEVER: f64 = -1e9;

/// A node's constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NodeFrame {
    /// Its place in the first frame, world, scene units.
    #[serde(with = "crate::bits")]
    pub centre: [f64; 3],
    /// Standard deviation of its weight by distance, scene units.
    #[serde(with = "crate::bits")]
    pub width: f64,
    /// The body that it bends, by number.
    pub body: usize,
}

/// The weights of nodes for Gaussians.
#[derive(Debug, Clone)]
pub(super) struct Skin {
    /// `[M, K]`; rows sum to 1, or to 0 for a Gaussian whose body has no nodes.
    weights: Tensor<2>,
    /// A point amid the nodes, from which positions are measured: far from the origin digits would be lost.
    reference: [f64; 3],
}

impl Skin {
    /// Of Gaussians at `positions` `[M, 3]` in the first frame; weights get no gradient.
    pub fn of(positions: &Tensor<2>, labels: &[u32], nodes: &[NodeFrame]) -> Self {
        let (rows, count) = (labels.len(), nodes.len());
        let own = labels
            .iter()
            .flat_map(|label| nodes.iter().map(move |node| if node.body == *label as usize { 0.0 } else { NEVER }));
        let own = constant(positions, own.collect(), [rows, count]);
        let bends =
            labels.iter().map(|label| f64::from(u8::from(nodes.iter().any(|node| node.body == *label as usize))));
        let bends = constant(positions, bends.collect(), [rows, 1]);
        let options = (&positions.device(), positions.dtype());
        let centres: Vec<f64> = nodes.iter().flat_map(|node| node.centre).collect();
        let centres = Tensor::<3>::from_data(TensorData::new(centres, [1, count, 3]), options);
        let apart = positions.clone().detach().reshape([rows, 1, 3]) - centres;
        let scale =
            constant(positions, nodes.iter().map(|node| -0.5 / (node.width * node.width)).collect(), [1, count]);
        let squared = apart.square().sum_dim(2).reshape([rows, count]);
        let middle = |axis: usize| nodes.iter().map(|node| node.centre[axis]).sum::<f64>() / count.max(1) as f64;
        Self { weights: softmax(squared * scale + own, 1) * bends, reference: std::array::from_fn(middle) }
    }

    /// The Gaussians at `positions` as the nodes of `way` bend them.
    pub fn bent(&self, way: &Way, positions: &Tensor<2>) -> State {
        let mixed = exact_matmul(self.weights.clone(), way.affine(self.reference));
        let from = positions.clone() - constant(positions, self.reference.to_vec(), [1, 3]);
        let mut moved = positions.clone() + mixed.clone().narrow(1, 9, 3);
        for axis in 0..3 {
            moved = moved + mixed.clone().narrow(1, 3 * axis, 3) * from.clone().narrow(1, axis, 1);
        }
        let identity = State::at_rest(positions.clone()).turns;
        let turned = way.quaternions() - State::at_rest(way.shift.clone()).turns;
        let turns = identity + exact_matmul(self.weights.clone(), turned);
        let norm = turns.clone().square().sum_dim(1).sqrt();
        State { positions: moved, turns: turns / norm }
    }
}

/// The mean over neighbouring nodes of `sqrt(e^2 / u^2 + 1) - 1` with `u` = `unit`, scene units: `e` is how far the
/// two place the point half way between them from each other, and how far their rotations move either's centre
/// about it. `None` without neighbours. Quadratic below `unit`, so that errors of tracking are shared; linear above
/// it, so that a joint or two bodies part.
pub(super) fn strain(way: &Way, nodes: &[NodeFrame], unit: f64) -> Option<Tensor<1>> {
    let pairs = neighbours(nodes);
    if pairs.is_empty() {
        return None;
    }
    let affine = way.affine([0.0; 3]);
    let rows = |which: usize| {
        let rows: Vec<i64> = pairs.iter().map(|pair| pair[which] as i64).collect();
        Tensor::<1, Int>::from_data(TensorData::new(rows, [pairs.len()]), &affine.device())
    };
    let apart = affine.clone().select(0, rows(0)) - affine.clone().select(0, rows(1));
    let column = |of: &dyn Fn(&[usize; 2]) -> f64| constant(&affine, pairs.iter().map(of).collect(), [pairs.len(), 1]);
    let at = |node: usize| DVec3::from_array(nodes[node].centre);
    let arms = column(&|[a, b]| 0.25 * at(*a).distance_squared(at(*b)));
    let mut gap = apart.clone().narrow(1, 9, 3);
    for axis in 0..3 {
        let middle = column(&|[a, b]| 0.5 * (nodes[*a].centre[axis] + nodes[*b].centre[axis]));
        gap = gap + apart.clone().narrow(1, 3 * axis, 3) * middle;
    }
    let turned = apart.narrow(1, 0, 9).square().sum_dim(1) * arms;
    let squared = (turned + gap.square().sum_dim(1)) / (unit * unit);
    Some(((squared + 1.0).sqrt() - 1.0).mean())
}

/// Pairs of neighbouring nodes of one body, each once.
fn neighbours(nodes: &[NodeFrame]) -> Vec<[usize; 2]> {
    let at = |node: usize| DVec3::from_array(nodes[node].centre);
    let mut pairs = Vec::new();
    for a in 0..nodes.len() {
        let mut near: Vec<usize> = (0..nodes.len()).filter(|b| *b != a && nodes[*b].body == nodes[a].body).collect();
        near.sort_by(|b, c| at(a).distance_squared(at(*b)).total_cmp(&at(a).distance_squared(at(*c))));
        pairs.extend(near.into_iter().take(NEIGHBOURS).map(|b| [a.min(b), a.max(b)]));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

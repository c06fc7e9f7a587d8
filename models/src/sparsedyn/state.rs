//! Where Gaussians are and how they are turned: the state that a rollout integrates.

use burn::tensor::{Device, Gradients, Tensor, TensorData};
use gs_burn::ops::sum::sum;

/// Positions, and the rotations since the start, of `M` Gaussians.
#[derive(Debug, Clone)]
pub struct State {
    /// `[M, 3]`, world, scene units.
    pub positions: Tensor<2>,
    /// `[M, 4]` quaternions w x y z, world axes: the rotation since the start, multiplied from the left to the
    /// orientation there.
    pub turns: Tensor<2>,
}

impl State {
    /// Gaussians at `positions` `[M, 3]` that have not turned yet.
    pub fn at_rest(positions: Tensor<2>) -> Self {
        let rows = positions.dims()[0];
        let turns = identity(&positions.device(), &positions).repeat_dim(0, rows);
        Self { positions, turns }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.positions.dims()[0]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The state outside autodiff.
    pub fn inner(self) -> Self {
        Self { positions: self.positions.inner(), turns: self.turns.inner() }
    }

    /// The state as leaves of a new graph.
    pub fn leaf(self) -> Self {
        let leaf = |tensor: Tensor<2>| tensor.autodiff().require_grad();
        Self { positions: leaf(self.positions), turns: leaf(self.turns) }
    }

    /// `[1]`: the sum of all numbers times those of `gradient`, which gets no gradient itself.
    pub(super) fn product(&self, gradient: &Self) -> Tensor<1> {
        product(&self.positions, &gradient.positions) + product(&self.turns, &gradient.turns)
    }

    /// Takes the gradients of these leaves out of a finished backward pass; zero where the loss does not reach.
    pub fn take_gradient(&self, graph: &mut Gradients) -> Self {
        Self { positions: take_gradient(&self.positions, graph), turns: take_gradient(&self.turns, graph) }
    }

    /// Both tensors plus those of `other`.
    pub fn plus(self, other: Self) -> Self {
        Self { positions: self.positions + other.positions, turns: self.turns + other.turns }
    }

    /// A state of zeros of the same shape.
    pub fn zeros_like(&self) -> Self {
        Self { positions: self.positions.zeros_like(), turns: self.turns.zeros_like() }
    }
}

/// `[1, 4]`, the rotation by zero, in the type of `like`.
fn identity(device: &Device, like: &Tensor<2>) -> Tensor<2> {
    Tensor::from_data(TensorData::new(vec![1.0_f64, 0.0, 0.0, 0.0], [1, 4]), (device, like.dtype()))
}

/// `[1]`: the sum of products with a gradient from outside the graph.
pub(super) fn product(value: &Tensor<2>, gradient: &Tensor<2>) -> Tensor<1> {
    sum(value.clone() * gradient.clone().autodiff())
}

/// The gradient of a leaf, outside autodiff; zero where the loss does not reach it.
pub(super) fn take_gradient(leaf: &Tensor<2>, graph: &mut Gradients) -> Tensor<2> {
    leaf.grad_remove(graph).unwrap_or_else(|| leaf.clone().inner().zeros_like())
}

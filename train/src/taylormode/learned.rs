//! A tensor that is learned, with its Adam moments: what motion, networks and exposure are made of.

use burn::tensor::{Int, Tensor};
use gs_burn::ops::adam::{AdamConfig, adam_step};

/// A tensor `[R, C]` outside autodiff and its moments.
#[derive(Debug, Clone)]
pub struct Learned {
    /// The tensor.
    pub value: Tensor<2>,
    /// First moment, same shape.
    pub first: Tensor<2>,
    /// Second moment, same shape.
    pub second: Tensor<2>,
}

impl Learned {
    /// A tensor with zero moments.
    pub fn new(value: Tensor<2>) -> Self {
        Self { first: value.zeros_like(), second: value.zeros_like(), value }
    }

    /// The tensor as a leaf of a new graph.
    pub fn tracked(&self) -> Tensor<2> {
        self.value.clone().autodiff().require_grad()
    }

    /// One update.
    pub fn step(&mut self, gradient: Tensor<2>, adam: &AdamConfig) {
        // Taken out of their places, so that each buffer has one owner and is updated in place.
        let nothing = || Tensor::empty([0, 1], &gradient.device());
        let value = std::mem::replace(&mut self.value, nothing());
        let first = std::mem::replace(&mut self.first, nothing());
        let second = std::mem::replace(&mut self.second, nothing());
        (self.value, self.first, self.second) = adam_step(value, gradient, first, second, adam);
    }

    /// The rows `rows`, with their moments multiplied by `keep` `[rows, 1]` (0 to forget, 1 to keep).
    pub fn select(&mut self, rows: &Tensor<1, Int>, keep: &Tensor<2>) {
        self.value = self.value.clone().select(0, rows.clone());
        self.first = self.first.clone().select(0, rows.clone()) * keep.clone();
        self.second = self.second.clone().select(0, rows.clone()) * keep.clone();
    }
}

/// The gradient of a leaf, or zero where the loss does not reach it; without autodiff.
pub fn gradient_of(leaf: &Tensor<2>, gradients: &mut burn::tensor::Gradients) -> Tensor<2> {
    leaf.grad_remove(gradients).unwrap_or_else(|| leaf.clone().inner().zeros_like())
}

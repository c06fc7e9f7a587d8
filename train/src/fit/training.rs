//! A module in training: with its optimiser and its counters, whatever the module is.

use burn::module::Module;
use burn::tensor::Tensor;
use gs_burn::NamedGradients;
use gs_burn::adam::{Adam, AdamRate};

/// A module with its optimiser and its counters.
#[derive(Debug, Clone)]
pub struct Training<N: Module> {
    /// The module, outside autodiff. It is taken out only during a change, because an update in place needs a single
    /// owner.
    module: Option<N>,
    /// The optimiser's moments.
    pub adam: Adam,
    /// Steps taken.
    pub step: usize,
    /// Contributions whose loss or gradients were not finite, or that could not be used; they changed nothing.
    pub skipped: usize,
}

impl<N: Module> Training<N> {
    /// The state before the first step.
    pub fn new(module: N) -> Self {
        Self { module: Some(module), adam: Adam::new(), step: 0, skipped: 0 }
    }

    /// The module, outside autodiff.
    pub fn module(&self) -> &N {
        self.module.as_ref().expect("the module is taken out only within a change")
    }

    /// Replaces the module by `change` of it, which may change the optimiser too.
    pub fn change(&mut self, change: impl FnOnce(N, &mut Adam) -> N) {
        let module = self.module.take().expect("the module is taken out only within a change");
        self.module = Some(change(module, &mut self.adam));
    }

    /// One update of each parameter that has a rate, by the gradient of the loss `[1]` of the module.
    pub fn descend(&mut self, loss: impl FnOnce(&N) -> Tensor<1>, rate: impl Fn(&str) -> Option<AdamRate>) {
        let tracked = self.module().clone().train();
        let mut graph = loss(&tracked).backward();
        let gradients = NamedGradients::take(&tracked, &mut graph);
        drop(tracked);
        self.update(gradients, rate);
    }

    /// One update of each parameter that has a gradient and a rate.
    pub fn update(&mut self, gradients: NamedGradients, rate: impl Fn(&str) -> Option<AdamRate>) {
        self.change(|module, adam| adam.step(module, gradients, rate));
    }
}

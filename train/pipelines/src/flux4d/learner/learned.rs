//! The network as burn-train sees it.

use std::sync::Arc;

use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor};
use burn_optim::lr_scheduler::module_lr_scheduler::ModuleLearningRate;
use burn_optim::{GradientsParams, ModuleOptimizer};
use burn_train::{InferenceStep, ModuleSharder, TrainOutput, TrainStep};
use gs_burn::{NamedGradients, named_parameters};

use super::super::feed::Drawn;
use super::super::network::FluxNetwork;
use super::super::trainer::contribution;
use super::session::Session;

/// The network of a training by burn-train.
#[derive(Module, Debug)]
pub struct Learned {
    /// The network, on a device with autodiff.
    network: FluxNetwork,
    /// The training.
    #[module(skip)]
    session: Option<Arc<Session>>,
}

impl Learned {
    /// The network, which is outside autodiff, before its training.
    pub fn new(network: &FluxNetwork) -> Self {
        Self { network: network.clone().train(), session: None }
    }

    /// The network in a training.
    pub fn within(self, session: &Arc<Session>) -> Self {
        Self { session: Some(session.clone()), ..self }
    }

    fn session(&self) -> Arc<Session> {
        self.session.clone().expect("a learner's network is in a training")
    }

    /// The device of the network, without autodiff.
    fn device(&self) -> Device {
        self.network.devices().first().expect("a network has parameters").clone().inner()
    }
}

impl TrainStep for Learned {
    type Input = Drawn;
    type Output = ();

    /// The gradients of one snippet. Those of its passes are computed beside Burn's graph, on leaves of their own; one backward of
    /// the sum of `parameter * gradient` then hands them to Burn. So each snippet has one backward pass over all parameters, whether
    /// it has passes, fails between them or is skipped, which DDP needs: a device with fewer would keep the others waiting.
    fn step(&self, drawn: Drawn) -> TrainOutput<()> {
        let session = self.session();
        session.begin_step();
        let leaves = self.network.valid().train();
        let found = contribution(&leaves, &drawn, session.setting(&self.device()));
        drop(leaves);
        let (gradients, outcome) = match found {
            Ok((gradients, used)) => (gradients, Ok(used)),
            Err(reason) => (NamedGradients::default(), Err(reason)),
        };
        let graph = surrogate(&self.network, gradients).backward();
        session.add_outcome(drawn.draw, outcome);
        TrainOutput::new(self, graph, ())
    }

    /// Ends a step.
    fn optimize(self, _: &mut ModuleOptimizer, _: ModuleLearningRate, gradients: GradientsParams) -> Self {
        let session = self.session();
        let sum = named(&self.network, gradients);
        let network = session.end_step(&self.device(), sum).train();
        let network = if session.is_distributed() { network.map(&mut ModuleSharder) } else { network };
        Self { network, ..self }
    }
}

impl InferenceStep for Learned {
    type Input = ();
    type Output = ();

    /// Never called: the run measures the network itself.
    fn step(&self, (): ()) {}
}

/// The sum of `parameter * gradient` over all leaves of `network`; its gradients are the given ones, zero where there is none.
fn surrogate(network: &FluxNetwork, mut gradients: NamedGradients) -> Tensor<1> {
    struct Visitor<'a> {
        paths: std::vec::IntoIter<String>,
        gradients: &'a mut NamedGradients,
        sum: Option<Tensor<1>>,
    }
    impl ModuleVisitor for Visitor<'_> {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let path = self.paths.next().expect("as many paths as parameters");
            let leaf = param.val();
            if !leaf.is_require_grad() {
                return;
            }
            let gradient = match self.gradients.remove(&path) {
                Some(table) => table.reshape(leaf.dims()),
                None => leaf.clone().inner().zeros_like(),
            };
            let part = (leaf * Tensor::from_inner(gradient)).sum();
            self.sum = Some(match self.sum.take() {
                Some(sum) => sum + part,
                None => part,
            });
        }
    }
    let mut visitor = Visitor { paths: paths(network).into_iter(), gradients: &mut gradients, sum: None };
    network.visit(&mut visitor);
    visitor.sum.expect("a network has parameters")
}

/// Burn's gradients by path.
fn named(network: &FluxNetwork, mut gradients: GradientsParams) -> NamedGradients {
    struct Visitor<'a> {
        paths: std::vec::IntoIter<String>,
        gradients: &'a mut GradientsParams,
        named: NamedGradients,
    }
    impl ModuleVisitor for Visitor<'_> {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let path = self.paths.next().expect("as many paths as parameters");
            if let Some(gradient) = self.gradients.remove::<D>(param.id) {
                let shape = gradient.dims();
                self.named.insert(path, gradient.reshape([shape[0], shape[1..].iter().product()]));
            }
        }
    }
    let paths = paths(network).into_iter();
    let mut visitor = Visitor { paths, gradients: &mut gradients, named: NamedGradients::default() };
    network.visit(&mut visitor);
    visitor.named
}

/// The path of each parameter, in the order of a visit.
fn paths(network: &FluxNetwork) -> Vec<String> {
    named_parameters(network).into_iter().map(|parameter| parameter.path).collect()
}

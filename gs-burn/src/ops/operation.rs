//! The way of an operation through Burn, written once for all of them: dispatch to the backend of the tensors, and the
//! step in the graph of gradients.
//!
//! An operation is a struct of its settings. [`Operation`] has its two directions on the CPU backends, [`OnCube`] the
//! same on CubeCL's; [`differentiable`] runs it. A [`Computation`] has no gradient and may return several tensors.

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{
    Autodiff, Backend, BackendTensor, Dispatch, DispatchAutodiffContext, DispatchTensor, DispatchTensorKind,
    ExtensionType, backend_extension,
};
use burn::tensor::{Int, Tensor};
#[cfg(feature = "cube")]
use burn_cubecl::{CubeBackend, tensor::CubeTensor};

use crate::profile;
use crate::slices::{HostBackend, HostTensor};

/// Tensors that pass Burn's dispatch together.
#[derive(Clone, Debug)]
pub struct Tensors<B: Backend> {
    pub floats: Vec<FloatTensor<B>>,
    pub ints: Vec<IntTensor<B>>,
}

impl<B: Backend> Tensors<B> {
    pub fn none() -> Self {
        Self::of_floats([])
    }

    pub fn of_floats<const N: usize>(floats: [FloatTensor<B>; N]) -> Self {
        Self { floats: floats.into(), ints: Vec::new() }
    }

    /// # Panics
    /// When there are other numbers of tensors.
    pub fn into_arrays<const N: usize, const M: usize>(self) -> ([FloatTensor<B>; N], [IntTensor<B>; M]) {
        (array(self.floats), array(self.ints))
    }
}

fn array<T, const N: usize>(tensors: Vec<T>) -> [T; N] {
    let found = tensors.len();
    tensors.try_into().unwrap_or_else(|_| panic!("expected {N} tensors, found {found}"))
}

impl<B: Backend> ExtensionType<B> for Tensors<B> {
    type Target = Tensors<Dispatch>;

    fn map_to_dispatch<F>(self, kind: F, autodiff: DispatchAutodiffContext) -> Tensors<Dispatch>
    where
        F: Fn(BackendTensor<B>) -> DispatchTensorKind,
    {
        let wrap = |tensor| DispatchTensor { kind: kind(tensor), autodiff };
        Tensors {
            floats: self.floats.into_iter().map(|tensor| wrap(BackendTensor::Float(tensor))).collect(),
            ints: self.ints.into_iter().map(|tensor| wrap(BackendTensor::Int(tensor))).collect(),
        }
    }

    fn map_from_dispatch<F>(target: Tensors<Dispatch>, unwrap: F) -> Self
    where
        F: Fn(DispatchTensor) -> BackendTensor<B>,
    {
        Self {
            floats: target.floats.into_iter().map(|tensor| unwrap(tensor).float()).collect(),
            ints: target.ints.into_iter().map(|tensor| unwrap(tensor).int()).collect(),
        }
    }

    fn routing_tensor(target: &Tensors<Dispatch>) -> Option<&DispatchTensor> {
        target.floats.first().or(target.ints.first())
    }

    fn routing_float_tensor(target: &Tensors<Dispatch>) -> Option<&DispatchTensor> {
        target.floats.first()
    }

    fn autodiff_context(target: &Tensors<Dispatch>) -> DispatchAutodiffContext {
        let tensors = target.floats.iter().chain(&target.ints);
        tensors.fold(DispatchAutodiffContext::Disabled, |context, tensor| context.merge(tensor.autodiff))
    }
}

/// The result of an operation.
pub struct Output<B: Backend> {
    pub tensor: FloatTensor<B>,
    /// Tensors that the backward pass reads beside the inputs; kept only where a gradient is tracked.
    pub saved: Tensors<B>,
}

impl<B: Backend> Output<B> {
    /// A result with nothing saved.
    pub fn of(tensor: FloatTensor<B>) -> Self {
        Self { tensor, saved: Tensors::none() }
    }
}

/// The tensors that a backward pass reads.
#[derive(Clone, Debug)]
pub struct State<B: Backend, const N: usize, const M: usize> {
    inputs: Option<[FloatTensor<B>; N]>,
    pub lists: [IntTensor<B>; M],
    /// [`Output::saved`]
    pub saved: Tensors<B>,
}

impl<B: Backend, const N: usize, const M: usize> State<B, N, M> {
    /// # Panics
    /// When the operation does not keep its inputs ([`Operation::READS_INPUTS`]), or on a second call.
    pub fn inputs(&mut self) -> [FloatTensor<B>; N] {
        self.inputs.take().expect("an operation whose backward pass reads the inputs keeps them")
    }
}

/// A differentiable operation on `N` tensors of floats and `M` of whole numbers, with its two directions on the CPU
/// backends. There all tensors arrive contiguous.
pub trait Operation<const N: usize, const M: usize = 0>: OnCube<N, M> + Clone + Debug + Send + 'static {
    /// The stage of the profile that the backward pass is charged to, if it has one of its own.
    const BACKWARD: Option<&'static str> = None;
    /// Whether the backward pass reads the inputs, which are kept for it.
    const READS_INPUTS: bool = true;

    /// The result; `tracked` says whether a backward pass may follow.
    fn forward<B: HostBackend>(
        &self,
        inputs: [FloatTensor<B>; N],
        lists: [IntTensor<B>; M],
        tracked: bool,
    ) -> Output<B>;

    /// The gradients by the inputs from that by the result, `v`. Those that are not `wanted` may be `None` or are not
    /// used.
    fn backward<B: HostBackend>(
        &self,
        state: State<B, N, M>,
        v: FloatTensor<B>,
        wanted: [bool; N],
    ) -> [Option<FloatTensor<B>>; N];
}

/// An operation without gradient on `N` tensors of floats and `M` of whole numbers. On the CPU backends all tensors
/// arrive contiguous.
pub trait Computation<const N: usize, const M: usize = 0>: ComputeOnCube<N, M> {
    fn compute<B: HostBackend>(&self, inputs: [FloatTensor<B>; N], lists: [IntTensor<B>; M]) -> Tensors<B>;
}

/// The two directions of an [`Operation`] on a GPU. Tensors may be strided.
#[cfg(feature = "cube")]
pub trait OnCube<const N: usize, const M: usize> {
    /// See [`Operation::forward`].
    fn forward(&self, inputs: [CubeTensor; N], lists: [CubeTensor; M], tracked: bool) -> Output<CubeBackend>;

    /// See [`Operation::backward`].
    fn backward(&self, state: State<CubeBackend, N, M>, v: CubeTensor, wanted: [bool; N]) -> [Option<CubeTensor>; N];
}

/// A [`Computation`] on a GPU. Tensors may be strided.
#[cfg(feature = "cube")]
pub trait ComputeOnCube<const N: usize, const M: usize> {
    /// See [`Computation::compute`].
    fn compute(&self, inputs: [CubeTensor; N], lists: [CubeTensor; M]) -> Tensors<CubeBackend>;
}

/// A build without CubeCL asks nothing more of an operation.
#[cfg(not(feature = "cube"))]
pub trait OnCube<const N: usize, const M: usize> {}
#[cfg(not(feature = "cube"))]
impl<T, const N: usize, const M: usize> OnCube<N, M> for T {}

/// A build without CubeCL asks nothing more of a computation.
#[cfg(not(feature = "cube"))]
pub trait ComputeOnCube<const N: usize, const M: usize> {}
#[cfg(not(feature = "cube"))]
impl<T, const N: usize, const M: usize> ComputeOnCube<N, M> for T {}

/// A backend with kernels, without gradient tracking.
pub trait Kernels: Backend {
    fn forward<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: &O,
        inputs: [FloatTensor<Self>; N],
        lists: [IntTensor<Self>; M],
        tracked: bool,
    ) -> Output<Self>;

    fn backward<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: &O,
        state: State<Self, N, M>,
        v: FloatTensor<Self>,
        wanted: [bool; N],
    ) -> [Option<FloatTensor<Self>>; N];

    fn compute<C: Computation<N, M>, const N: usize, const M: usize>(
        computation: &C,
        inputs: [FloatTensor<Self>; N],
        lists: [IntTensor<Self>; M],
    ) -> Tensors<Self>;
}

impl<B: HostBackend> Kernels for B {
    fn forward<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: &O,
        inputs: [FloatTensor<B>; N],
        lists: [IntTensor<B>; M],
        tracked: bool,
    ) -> Output<B> {
        Operation::forward::<B>(
            operation,
            inputs.map(HostTensor::contiguous),
            lists.map(HostTensor::contiguous),
            tracked,
        )
    }

    fn backward<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: &O,
        state: State<B, N, M>,
        v: FloatTensor<B>,
        wanted: [bool; N],
    ) -> [Option<FloatTensor<B>>; N] {
        let State { inputs, lists, saved } = state;
        let inputs = inputs.map(|inputs| inputs.map(HostTensor::contiguous));
        let state = State { inputs, lists: lists.map(HostTensor::contiguous), saved };
        Operation::backward::<B>(operation, state, v.contiguous(), wanted)
    }

    fn compute<C: Computation<N, M>, const N: usize, const M: usize>(
        computation: &C,
        inputs: [FloatTensor<B>; N],
        lists: [IntTensor<B>; M],
    ) -> Tensors<B> {
        Computation::compute::<B>(computation, inputs.map(HostTensor::contiguous), lists.map(HostTensor::contiguous))
    }
}

/// Burn's dispatch of an [`Operation`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait Differentiable: Backend {
    fn differentiable<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: O,
        #[extension_type] tensors: Tensors<Self>,
    ) -> FloatTensor<Self>;
}

/// Burn's dispatch of a [`Computation`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube")
)]
pub trait Computable: Backend {
    fn computed<C: Computation<N, M>, const N: usize, const M: usize>(
        computation: C,
        #[extension_type] tensors: Tensors<Self>,
    ) -> Tensors<Self>;
}

impl<B: Kernels> Computable for B {
    fn computed<C: Computation<N, M>, const N: usize, const M: usize>(
        computation: C,
        tensors: Tensors<B>,
    ) -> Tensors<B> {
        let (inputs, lists) = tensors.into_arrays();
        B::compute(&computation, inputs, lists)
    }
}

impl<B: Kernels> Differentiable for B {
    fn differentiable<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: O,
        tensors: Tensors<B>,
    ) -> FloatTensor<B> {
        let (inputs, lists) = tensors.into_arrays();
        B::forward(&operation, inputs, lists, false).tensor
    }
}

impl<B: Kernels, C: CheckpointStrategy> Differentiable for Autodiff<B, C> {
    fn differentiable<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: O,
        tensors: Tensors<Self>,
    ) -> FloatTensor<Self> {
        let (inputs, lists) = tensors.into_arrays::<N, M>();
        let nodes = inputs.each_ref().map(|input| input.node());
        let inputs = inputs.map(|input| input.into_primitive());
        let step = Step { operation: operation.clone() };
        match step.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                // Kept before the forward pass, which may write into an input that nobody else holds.
                let kept = O::READS_INPUTS.then(|| inputs.clone());
                let output = B::forward(&operation, inputs, lists.clone(), true);
                prep.finish(State { inputs: kept, lists, saved: output.saved }, output.tensor)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::forward(&operation, inputs, lists, false).tensor),
        }
    }
}

/// The step of an operation in the graph of gradients.
#[derive(Debug)]
struct Step<O, const M: usize> {
    operation: O,
}

impl<B: Kernels, O: Operation<N, M>, const N: usize, const M: usize> Backward<B, N> for Step<O, M> {
    type State = State<B, N, M>;

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = O::BACKWARD.map(profile::stage);
        let v = grads.consume::<B>(&ops.node);
        let wanted = ops.parents.each_ref().map(Option::is_some);
        let gradients = B::backward(&self.operation, ops.state, v, wanted);
        for (parent, gradient) in ops.parents.into_iter().zip(gradients) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, gradient.expect("every wanted gradient is made"));
            }
        }
    }
}

/// The result of an operation on Burn's tensors, `[floats, whole numbers]` from their `into_dispatch`.
pub fn differentiable<O: Operation<N, M>, const N: usize, const M: usize, const D: usize>(
    operation: O,
    floats: [FloatTensor<Dispatch>; N],
    ints: [IntTensor<Dispatch>; M],
) -> Tensor<D> {
    let tensors = Tensors { floats: floats.into(), ints: ints.into() };
    Tensor::from_dispatch(Dispatch::differentiable::<O, N, M>(operation, tensors))
}

/// The results of a computation on Burn's tensors, outside any graph.
pub fn computed<C: Computation<N, M>, const N: usize, const M: usize>(
    computation: C,
    floats: [FloatTensor<Dispatch>; N],
    ints: [IntTensor<Dispatch>; M],
) -> Tensors<Dispatch> {
    Dispatch::computed::<C, N, M>(computation, Tensors { floats: floats.into(), ints: ints.into() })
}

/// The single result of a computation.
pub fn computed_tensor<C: Computation<N>, const N: usize, const D: usize>(
    computation: C,
    floats: [FloatTensor<Dispatch>; N],
) -> Tensor<D> {
    let ([tensor], []) = computed(computation, floats, []).into_arrays();
    Tensor::from_dispatch(tensor)
}

/// Lists as Burn's tensors.
pub fn lists<const M: usize>(ints: [IntTensor<Dispatch>; M]) -> [Tensor<1, Int>; M] {
    ints.map(Tensor::from_dispatch)
}

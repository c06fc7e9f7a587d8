//! Shared code of all backward steps.

pub use burn::backend::Autodiff;
pub use burn::backend::autodiff::NodeId;
pub use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
pub use burn::backend::autodiff::grads::Gradients;
pub use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;

/// Gives each parent its gradient; a parent outside the graph gets none.
///
/// Parents are given as ids because Burn keeps the type of its nodes private.
pub fn register<B: Backend, const N: usize>(
    grads: &mut Gradients,
    parents: [Option<NodeId>; N],
    gradients: [FloatTensor<B>; N],
) {
    for (parent, gradient) in parents.into_iter().zip(gradients) {
        if let Some(parent) = parent {
            grads.register::<B>(parent, gradient);
        }
    }
}

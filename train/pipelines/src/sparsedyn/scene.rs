//! The scene at any time: the Gaussians of the first frame, moved by the rollout.

use burn::module::Param;
use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_burn::ops::rows::{add_rows, take_rows};
use gs_models::DynamicScene;
use gs_models::rotation::product;

use super::Sparsedyn;
use super::motion::Moved;

/// Gaussians with their dynamics.
#[derive(Debug, Clone)]
pub struct RolledScene {
    /// The Gaussians of the first frame.
    pub gaussians: Gaussians,
    /// Their dynamics.
    pub method: Sparsedyn,
}

impl Sparsedyn {
    /// The positions of the moving Gaussians in the first frame, `[M, 3]`.
    pub fn first_positions(&self, gaussians: &Gaussians) -> Tensor<2> {
        let means = gaussians.means.val();
        let rows = self.row_tensor(&means.device());
        take_rows(means, &rows)
    }

    /// `gaussians` with the moving ones as in `moved`.
    pub fn placed(&self, gaussians: &Gaussians, moved: &Moved) -> Gaussians {
        let (means, quats, sizes) = (gaussians.means.val(), gaussians.quats.val(), &gaussians.log_scales);
        let rows = self.row_tensor(&means.device());
        let own = take_rows(quats.clone(), &rows);
        let shift = moved.state.positions.clone() - take_rows(means.clone(), &rows);
        let turned = product(moved.state.turns.clone(), own.clone()) - own;
        let add = |to: Tensor<2>, what: Tensor<2>| held(add_rows(to, &rows, what));
        Gaussians {
            means: add(means, shift),
            quats: add(quats, turned),
            log_scales: match &moved.growth {
                Some(growth) => add(sizes.val(), growth.clone()),
                None => sizes.clone(),
            },
            ..gaussians.clone()
        }
    }
}

/// A tensor as a parameter of a module that stays in its graph.
fn held(tensor: Tensor<2>) -> Param<Tensor<2>> {
    Param::initialized(burn::module::ParamId::new(), tensor)
}

impl DynamicScene for RolledScene {
    fn at(&self, t: f64) -> Gaussians {
        self.at_times(&[t]).remove(0)
    }

    fn at_times(&self, times: &[f64]) -> Vec<Gaussians> {
        if self.method.frame.rows.is_empty() {
            return times.iter().map(|_| self.gaussians.clone()).collect();
        }
        let first = self.method.first_positions(&self.gaussians);
        let times: Vec<f64> = times.iter().map(|time| self.method.frame.clock.inner(*time)).collect();
        self.method.moved(&first, &times).iter().map(|moved| self.method.placed(&self.gaussians, moved)).collect()
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        let means = self.gaussians.means.val();
        let zeros = means.zeros_like();
        if self.method.frame.rows.is_empty() {
            return zeros;
        }
        let rows = self.method.row_tensor(&means.device());
        let first = take_rows(means, &rows);
        let clock = &self.method.frame.clock;
        let velocities = self.method.velocities(&first, clock.inner(t)) / clock.unit;
        add_rows(zeros, &rows, velocities)
    }

    fn span(&self) -> Option<[f64; 2]> {
        Some(self.method.frame.span.map(|time| self.method.frame.clock.outer(time)))
    }

    fn reach(&self) -> Option<[f64; 2]> {
        let of_rollout = self.method.options.reach().map(|time| self.method.frame.clock.outer(time));
        (!self.method.frame.rows.is_empty()).then_some(of_rollout)
    }
}

//! SparseDynGS: physical motion of Gaussians from videos of few cameras, and future frames by integrating it.
//!
//! A dynamics field gives velocity, acceleration, angular velocity and angular acceleration at a position and time; a
//! rollout integrates positions and orientations from the first frame on. The paper is "SparseDynGS: Learning
//! Physically Grounded Gaussian Dynamics from Sparse-View Videos".
//!
//! | Paper | Here |
//! |---|---|
//! | 3.1, Eq. 3: dynamics field | [`field`]; its answer: [`dynamics`] |
//! | 3.1, Eq. 4: one step of a second-order Runge-Kutta method | [`integrators`], with a fourth-order method and the exact exponential |
//! | 3.2, Eq. 5 and 6: opacity sparsity and depth | [`refinement`] |
//! | 3.3, Eq. 8 to 10: sliding window, late-horizon sampling, early-horizon replay | [`curriculum`] |
//! | 3.3, Eq. 9: rollout | [`rollout`], of a [`State`]; its gradient without stored activations: [`recorded`] |
//! | the baselines of Table 1: a deformation field beside the velocity field (TRACE), rigid bases mixed by codes (FreeGave) | [`deformation`], [`codes`] |
//! | beyond the paper: rigid bodies and their laws | [`bodies`] |
//! | beyond the paper: how well laws and field are known | [`uncertainty`] |
//! | rotations by a vector, smooth at zero | [`turning`] |

pub mod bodies;
pub mod codes;
pub mod curriculum;
pub mod deformation;
pub mod dynamics;
pub mod field;
pub mod integrators;
pub mod recorded;
pub mod refinement;
pub mod rollout;
pub mod state;
pub mod turning;
pub mod uncertainty;

pub use codes::{CodedField, CodedFieldConfig};
pub use curriculum::{Curriculum, Phase, Sampled};
pub use deformation::{Deformation, DeformationConfig};
pub use dynamics::Dynamics;
pub use field::{Asked, DynamicsField, DynamicsFieldConfig};
pub use integrators::Integrator;
pub use recorded::Recorded;
pub use rollout::{Ask, Rollout, RolloutOptions};
pub use state::State;

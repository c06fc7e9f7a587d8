//! The physical quantities of Gaussians at one time (Eq. 3).

use burn::tensor::{Gradients, Tensor};

use super::state::{product, take_gradient};

/// Velocity, acceleration, angular velocity and angular acceleration of `M` Gaussians, `[M, 3]` each, world axes.
///
/// `velocity` is that of a rigid body's point at the reference point `c` of the field, so a Gaussian at `x` moves at
/// `v + w x (x - c)`: a rotation about any fixed axis has constant `v` and `w`. A velocity of the Gaussian itself would
/// turn with it.
#[derive(Debug, Clone)]
pub struct Dynamics {
    /// Scene units per unit of time.
    pub velocity: Tensor<2>,
    /// Scene units per unit of time squared.
    pub acceleration: Tensor<2>,
    /// Radians per unit of time.
    pub angular: Tensor<2>,
    /// Radians per unit of time squared.
    pub angular_acceleration: Tensor<2>,
}

/// Linear and angular velocity of `M` Gaussians, `[M, 3]` each.
#[derive(Debug, Clone)]
pub struct Twist {
    /// Of the point at the reference point, scene units per unit of time.
    pub velocity: Tensor<2>,
    /// Radians per unit of time.
    pub angular: Tensor<2>,
}

impl Dynamics {
    /// The twist `since` after the quantities were given, their accelerations held.
    pub fn twist(&self, since: f64) -> Twist {
        if since == 0.0 {
            return Twist { velocity: self.velocity.clone(), angular: self.angular.clone() };
        }
        Twist {
            velocity: self.velocity.clone() + self.acceleration.clone() * since,
            angular: self.angular.clone() + self.angular_acceleration.clone() * since,
        }
    }

    /// The same Gaussians' acceleration at `offsets` from the reference point, without the part that the change of
    /// position makes: `a + b x (x - c)`.
    pub fn acceleration_at(&self, offsets: &Tensor<2>) -> Tensor<2> {
        self.acceleration.clone() + self.angular_acceleration.clone().cross(offsets.clone(), 1)
    }
}

impl Dynamics {
    fn map(&self, mut f: impl FnMut(&Tensor<2>) -> Tensor<2>) -> Self {
        let Self { velocity, acceleration, angular, angular_acceleration } = self;
        Self {
            velocity: f(velocity),
            acceleration: f(acceleration),
            angular: f(angular),
            angular_acceleration: f(angular_acceleration),
        }
    }

    fn vectors(&self) -> [&Tensor<2>; 4] {
        [&self.velocity, &self.acceleration, &self.angular, &self.angular_acceleration]
    }

    /// The quantities outside autodiff as leaves of a new graph.
    pub(super) fn leaf(self) -> Self {
        self.map(|vector| vector.clone().autodiff().require_grad())
    }

    /// Takes the gradients of these leaves out of a finished backward pass; zero where the loss does not reach.
    pub(super) fn take_gradient(&self, graph: &mut Gradients) -> Self {
        self.map(|vector| take_gradient(vector, graph))
    }

    pub(super) fn zeros_like(&self) -> Self {
        self.map(Tensor::zeros_like)
    }

    pub(super) fn plus(&self, other: Self) -> Self {
        let mut others = other.vectors().map(Clone::clone).into_iter();
        self.map(|vector| vector.clone() + others.next().expect("four vectors"))
    }

    /// `[1]`: the sum of all numbers times those of `gradient`, which gets no gradient itself.
    pub(super) fn product(&self, gradient: &Self) -> Tensor<1> {
        let products =
            self.vectors().into_iter().zip(gradient.vectors()).map(|(value, gradient)| product(value, gradient));
        products.reduce(|a, b| a + b).expect("four vectors")
    }
}

impl Twist {
    /// Velocities at `offsets` `[M, 3]` from the reference point.
    pub fn at(&self, offsets: &Tensor<2>) -> Tensor<2> {
        self.velocity.clone() + self.angular.clone().cross(offsets.clone(), 1)
    }
}

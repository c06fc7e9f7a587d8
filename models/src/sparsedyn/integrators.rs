//! One step of positions and orientations along a twist that may change over the step (Eq. 4).

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use super::dynamics::Twist;
use super::state::State;
use super::turning::Factors;
use crate::rotation::turn;

/// How a step integrates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// The explicit midpoint rule (the paper): order 2. A rotation's radius grows by `(w h)^4 / 8` a step.
    Rk2,
    /// The classical Runge-Kutta method, the orientation by a Magnus expansion: order 4.
    Rk4,
    /// The exponential of the twist in the middle of the step: order 2, exact while the twist is constant.
    Screw,
}

impl Integrator {
    /// The state `h` later. `twist(positions, since)` gives the twist of the Gaussians at `positions`, `since` after
    /// the step began; `centre` `[1, 3]` is the reference point of velocities. `bend` `[M, 3]`, if it is given, is the
    /// Gaussians' acceleration at the beginning, which then bends the way to the middle.
    pub fn step(
        self,
        state: &State,
        h: f64,
        centre: &Tensor<2>,
        bend: Option<Tensor<2>>,
        twist: impl Fn(&Tensor<2>, f64) -> Twist,
    ) -> State {
        let x = &state.positions;
        let from_centre = |positions: &Tensor<2>| positions.clone() - centre.clone();
        let velocity = |twist: &Twist, positions: &Tensor<2>| twist.at(&from_centre(positions));
        let turned = |rotation: Tensor<2>| state.turns.clone() + turn(state.turns.clone(), rotation);
        let first = twist(x, 0.0);
        let k1 = velocity(&first, x);
        let straight = x.clone() + k1.clone() * (0.5 * h);
        let middle = match bend {
            Some(bend) => straight + bend * (0.125 * h * h),
            None => straight,
        };
        let second = twist(&middle, 0.5 * h);
        match self {
            Self::Rk2 => {
                let positions = x.clone() + velocity(&second, &middle) * h;
                State { positions, turns: turned(second.angular * h) }
            }
            Self::Screw => {
                let rotation = second.angular * h;
                let factors = Factors::of(&rotation);
                let translation = second.velocity * h;
                let moved = translation.clone() + factors.integrated(&rotation, &translation);
                let positions = x.clone() + factors.turned_by(&rotation, &from_centre(x)) + moved;
                State { positions, turns: turned(rotation) }
            }
            Self::Rk4 => {
                let k2 = velocity(&second, &middle);
                let again = x.clone() + k2.clone() * (0.5 * h);
                let third = twist(&again, 0.5 * h);
                let k3 = velocity(&third, &again);
                let end = x.clone() + k3.clone() * h;
                let last = twist(&end, h);
                let k4 = velocity(&last, &end);
                let positions = x.clone() + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
                // Magnus, fourth order: the mean of the angular velocity, and the commutator with its slope.
                let mean =
                    (first.angular.clone() + (second.angular + third.angular) * 2.0 + last.angular.clone()) / 6.0;
                let slope = (last.angular - first.angular) / h;
                let rotation = mean.clone() * h + slope.cross(mean, 1) * (h * h * h / 12.0);
                State { positions, turns: turned(rotation) }
            }
        }
    }
}

//! Bodies of a snippet and the points that belong to them.

use super::in_plan;
use super::search::PlanarMotion;

/// The motions of the points of all sweeps.
#[derive(Debug, Clone, Default)]
pub struct Aligned {
    /// The bodies that move, by sweep; a body has the same place in all sweeps.
    pub bodies: Vec<Vec<PlanarMotion>>,
    /// The body of each point, by sweep; `None` rests.
    pub of_point: Vec<Vec<Option<u32>>>,
    /// Whether the sweeps show how each point moves, by sweep: points of bodies, of the ground, and of surfaces that
    /// other sweeps show at the same place, and points too high or too far for bodies. The others are of no body, and
    /// still may move.
    pub is_known: Vec<Vec<bool>>,
}

impl Aligned {
    /// With the bodies of others, whose points have none of these.
    pub fn with(mut self, others: Self) -> Self {
        let others = others.bodies.into_iter().zip(others.of_point);
        for ((bodies, of_point), (more, of_more)) in self.bodies.iter_mut().zip(&mut self.of_point).zip(others) {
            let before = bodies.len() as u32;
            bodies.extend(more);
            for (body, other) in of_point.iter_mut().zip(of_more) {
                *body = body.or(other.map(|other| before + other));
            }
        }
        self
    }

    /// Velocity and acceleration of a point of a sweep, metres and seconds; zero at rest.
    pub fn motion(&self, sweep: usize, point: usize, position: [f32; 3]) -> ([f64; 2], [f64; 2]) {
        let body = self.of_point[sweep][point].map(|body| &self.bodies[sweep][body as usize]);
        body.map_or(([0.0; 2], [0.0; 2]), |body| body.at(in_plan(&position)))
    }
}

//! A scene that moves by Taylor series: its Gaussians at any time, and its motion for readers without this module.

use burn::module::Module;
use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_burn::ops::rows::take_rows;

use super::bodies::{Body, NO_BODY};
use super::kinks::Contact;
use super::paths::{Paths, taylor_coefficients};
use super::taylor_motion::TaylorMotion;
use super::window::described_powers;
use crate::DynamicScene;
use crate::basis::{Carried, Carrier, MotionBasis};

/// A scene some of whose Gaussians move.
#[derive(Module, Debug)]
pub struct TaylorScene {
    /// All Gaussians, as they are at `t0`.
    pub gaussians: Gaussians,
    /// How some of them move.
    pub motion: TaylorMotion,
}

impl TaylorScene {
    /// The paths of the moving Gaussians, for many questions.
    pub fn paths(&self) -> Paths {
        self.motion.paths(&self.gaussians.means.val())
    }
}

impl DynamicScene for TaylorScene {
    fn at(&self, t: f64) -> Gaussians {
        self.paths().moved(&self.gaussians, t)
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        self.paths().velocities(self.gaussians.len(), t)
    }

    fn span(&self) -> Option<[f64; 2]> {
        (!self.motion.is_empty()).then_some(self.motion.recording)
    }

    fn at_times(&self, times: &[f64]) -> Vec<Gaussians> {
        let paths = self.paths();
        times.iter().map(|t| paths.moved(&self.gaussians, *t)).collect()
    }

    fn basis(&self) -> Option<MotionBasis> {
        if self.motion.is_empty() {
            return None;
        }
        let paths = self.paths();
        let mut functions = described_powers(paths.order());
        let beyond = paths.remainder.as_ref().map_or(0, |remainder| remainder.described().len());
        let mut position = vec![taylor_coefficients(&paths.position.inner())];
        if let Some(remainder) = paths.remainder {
            functions.extend(remainder.described());
            position.push(remainder.weights.inner());
        }
        if let Some(kinks) = paths.kinks {
            functions.extend(kinks.contacts.iter().map(Contact::described));
            position.push(kinks.jumps.val().inner());
        }
        // A tensor without columns cannot be joined.
        position.retain(|part| part.dims()[1] > 0);
        let position = match position.len() {
            0 => Tensor::zeros([self.motion.len(), 0], &self.gaussians.device()),
            _ => Tensor::cat(position, 1),
        };
        Some(MotionBasis {
            base: self.gaussians.clone(),
            rows: self.motion.rows.clone(),
            t0: self.motion.window.t0,
            half: self.motion.window.half,
            functions,
            position,
            turns: described_powers(self.motion.rotation_order()),
            rotation: taylor_coefficients(&paths.rotation.inner()),
            carried: (!self.motion.bodies.is_empty()).then(|| self.motion.carried(&self.gaussians.means.val(), beyond)),
        })
    }
}

impl TaylorMotion {
    /// The vectors that rows have in common are told by powers; `remainder` functions stand between these and those of
    /// the contacts. `means` `[N, 3]` are the centres at `t0`.
    fn carried(&self, means: &Tensor<2>, remainder: usize) -> Carried {
        let (columns, contacts) = (3 * self.order(), self.contacts().len());
        let positions: Vec<f32> = take_rows(means.clone(), &self.row_tensor()).to_data().iter::<f32>().collect();
        // A row that has strayed follows its body's shift alone, and has all vectors of its own here.
        let carries = |row: usize| {
            let body = self.bodies.get(usize::from(self.body_of[row]));
            body.is_some_and(|body| body.frame.carries(&positions[3 * row..][..3]))
        };
        let of_body = |body: &Body| {
            let blocks = body.blocks.val().inner();
            let part = |from: usize, to: usize| blocks.clone().slice([0..4, from..to]);
            let none = Tensor::zeros([4, 3 * remainder], (&blocks.device(), blocks.dtype()));
            let parts = [taylor_coefficients(&part(0, columns)), none, part(columns, columns + 3 * contacts)];
            let parts = parts.into_iter().filter(|part| part.dims()[1] > 0);
            Carrier {
                centre: body.frame.centre,
                scale: body.frame.scale,
                position: Tensor::cat(parts.collect(), 1),
                rotation: taylor_coefficients(&body.turn.val().inner()),
            }
        };
        let own = |row: usize| {
            let strayed = self.body_of[row] != NO_BODY && !carries(row);
            if strayed {
                return [self.order() + remainder + contacts, self.rotation_order()].map(|count| count as u16);
            }
            let order = match (contacts > 0 && self.own_jumps[row], remainder > 0) {
                (true, _) => self.order() + remainder + contacts,
                (false, true) => self.order() + remainder,
                (false, false) => usize::from(self.orders[row]),
            };
            [order as u16, u16::from(self.rotation_orders[row])]
        };
        Carried {
            body_of: (0..self.len()).map(|row| if carries(row) { self.body_of[row] } else { NO_BODY }).collect(),
            own: (0..self.len()).map(own).collect(),
            bodies: self.bodies.iter().map(of_body).collect(),
        }
    }
}

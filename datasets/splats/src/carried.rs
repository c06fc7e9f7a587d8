//! Bodies that carry rows of a series: what their rows have in common is stored once.

use glam::{DMat3, DVec3};

/// Which rows bodies carry, and how much each row has beside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Carried {
    /// `[M]`, the body of each row, by its place in `bodies`; [`NO_BODY`](Self::NO_BODY): none.
    pub body_of: Vec<u8>,
    /// `[M]`, how many of the first functions of position and rotation a row has vectors of its own for; the others are
    /// those of its body, or zero.
    pub own: Vec<[u16; 2]>,
    /// The bodies.
    pub bodies: Vec<Carrier>,
}

/// A body: its rows have the vectors `W_j [1, (mean - centre) / scale]`, with the mean where all functions are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Carrier {
    /// Scene units.
    pub centre: [f64; 3],
    /// Scene units, positive.
    pub scale: f64,
    /// `[J]`, `W_j` by column, scene units.
    pub position: Vec<[[f32; 3]; 4]>,
    /// `[K]`, the rotation of all its rows, radians.
    pub rotation: Vec<[f32; 3]>,
}

/// Vectors of position and of rotation.
pub(crate) type Vectors<'a> = (Vec<[f32; 3]>, &'a [[f32; 3]]);

impl Carried {
    /// The body of a row that has none.
    pub const NO_BODY: u8 = u8::MAX;

    /// Checks that the lists fit `rows` rows and series of `functions` functions, and that every number is finite.
    pub(crate) fn is_right(&self, rows: usize, functions: [usize; 2]) -> bool {
        let known = |body: &u8| *body == Self::NO_BODY || usize::from(*body) < self.bodies.len();
        let right = |body: &Carrier| {
            let numbers = body.position.iter().flatten().chain(&body.rotation).flatten();
            [body.position.len(), body.rotation.len()] == functions
                && body.scale.is_finite()
                && body.scale > 0.0
                && body.centre.iter().all(|x| x.is_finite())
                && numbers.into_iter().all(|x| x.is_finite())
        };
        self.body_of.len() == rows
            && self.own.len() == rows
            && self.body_of.iter().all(known)
            && self.bodies.iter().all(right)
    }

    /// The vectors of a row's body at its mean, of position and rotation; `None` where it has no body.
    pub(crate) fn of(&self, row: usize, mean: [f32; 3]) -> Option<Vectors<'_>> {
        let body = self.bodies.get(usize::from(self.body_of[row]))?;
        Some((body.position.iter().map(|block| body.at(block, mean)).collect(), &body.rotation))
    }

    /// The lists of the rows `kept`, in this order, with all bodies.
    pub(crate) fn select(&self, kept: &[usize]) -> Self {
        Self {
            body_of: kept.iter().map(|row| self.body_of[*row]).collect(),
            own: kept.iter().map(|row| self.own[*row]).collect(),
            bodies: self.bodies.clone(),
        }
    }

    /// The bodies after a similarity of all vectors: displacements by `linear`, positions by `linear` and `shift`,
    /// rotation vectors by `turn`.
    pub(crate) fn moved(&mut self, linear: DMat3, shift: DVec3, turn: DMat3) {
        let size = linear.x_axis.length();
        let axes = linear * (1.0 / size);
        for body in &mut self.bodies {
            body.centre = (linear * DVec3::from(body.centre) + shift).to_array();
            body.scale *= size;
            for block in &mut body.position {
                let [constant, x, y, z] = block.map(|v| DVec3::from(v.map(f64::from)));
                // The offset of a turned mean is the turned offset, at the same unit.
                let gradient = linear * DMat3::from_cols(x, y, z) * axes.transpose();
                let turned = [linear * constant, gradient.x_axis, gradient.y_axis, gradient.z_axis];
                *block = turned.map(|v| v.to_array().map(|x| x as f32));
            }
            for vector in &mut body.rotation {
                *vector = (turn * DVec3::from(vector.map(f64::from))).to_array().map(|x| x as f32);
            }
        }
    }
}

impl Carrier {
    fn at(&self, block: &[[f32; 3]; 4], mean: [f32; 3]) -> [f32; 3] {
        let offset = [0, 1, 2].map(|axis| (f64::from(mean[axis]) - self.centre[axis]) / self.scale);
        let basis = [1.0, offset[0], offset[1], offset[2]];
        [0, 1, 2].map(|axis| basis.iter().zip(block).map(|(x, v)| x * f64::from(v[axis])).sum::<f64>() as f32)
    }
}

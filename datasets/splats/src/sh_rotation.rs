//! Spherical harmonics of a world that is turned: each band is turned by a matrix of its own.
//!
//! A colour `c(d) = sum_m b_m Y_m(d)` of a world turned by `R` is `c'(d) = c(R^T d)`. Band `l` maps onto itself, so
//! there is a matrix `D` of `2 l + 1` rows with `Y(R^T d) = D^T Y(d)` for all directions, and `b' = D b`. It is found
//! from as many directions as it has rows, which determine it: `D^T = Y(R^T d_1 ..) Y(d_1 ..)^-1`.

use glam::{DMat3, DVec3};

/// Highest band.
pub(crate) const BANDS: usize = 3;

/// Entries nearer to 0, 1 or -1 than this are these: a turn by a quarter then loses nothing. Rounding leaves 1e-15.
const SNAP: f64 = 1e-12;

/// The basis of 3DGS at a unit direction: 16 values.
pub(crate) fn basis(d: DVec3) -> [f64; 16] {
    let (x, y, z) = (d.x, d.y, d.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_791_773_878_14,
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * zz - xx - yy),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
        2.890_611_442_640_554 * x * y * z,
        -0.457_045_799_464_465_8 * y * (4.0 * zz - xx - yy),
        0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_799_464_465_8 * x * (4.0 * zz - xx - yy),
        1.445_305_721_320_277 * z * (xx - yy),
        -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
    ]
}

/// The matrices of bands 1 to 3 for a turn.
pub(crate) struct BandTurn(Vec<Vec<Vec<f64>>>);

impl BandTurn {
    pub fn new(rotation: DMat3) -> Self {
        Self((1..=BANDS).map(|l| matrix(rotation, l)).collect())
    }

    /// Turns one Gaussian's coefficients, of which there are 1, 4, 9 or 16.
    pub fn turn(&self, sh: &mut [[f32; 3]]) {
        for (index, matrix) in self.0.iter().enumerate() {
            let l = index + 1;
            let Some(band) = sh.get_mut(l * l..(l + 1) * (l + 1)) else { return };
            let before: Vec<[f32; 3]> = band.to_vec();
            for (row, value) in matrix.iter().zip(band) {
                let sum = |c: usize| row.iter().zip(&before).map(|(d, b)| d * f64::from(b[c])).sum::<f64>();
                *value = [0, 1, 2].map(|c| sum(c) as f32);
            }
        }
    }
}

/// `D` of band `l`.
fn matrix(rotation: DMat3, l: usize) -> Vec<Vec<f64>> {
    let n = 2 * l + 1;
    let band = |d: DVec3| basis(d)[l * l..l * l + n].to_vec();
    // Directions on a spiral, which lie in no zero of a band together: the system is well conditioned.
    let direction = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / (2 * n) as f64 * 1.9;
        let (angle, r) = (2.399_963 * i as f64, (1.0 - z * z).sqrt());
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    };
    // Rows: Y(d_i) D = Y(R^T d_i), as a row vector.
    let mut rows: Vec<(Vec<f64>, Vec<f64>)> =
        (0..n).map(|i| (band(direction(i)), band(rotation.transpose() * direction(i)))).collect();
    eliminate(&mut rows);
    // Y(R^T d) = Y(d) D, so c'(d) = Y(R^T d) b = Y(d) (D b).
    let snapped = |x: f64| if (x - x.round()).abs() < SNAP { x.round() } else { x };
    rows.into_iter().map(|(_, right)| right.into_iter().map(snapped).collect()).collect()
}

/// Solves `A X = B` given as rows of (A, B), with pivots; X stands in place of B.
fn eliminate(rows: &mut [(Vec<f64>, Vec<f64>)]) {
    for column in 0..rows.len() {
        let size = |row: &usize| rows[*row].0[column].abs();
        let pivot = (column..rows.len()).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(column);
        rows.swap(column, pivot);
        let factor = 1.0 / rows[column].0[column];
        let (left, right) = &mut rows[column];
        left.iter_mut().chain(right).for_each(|x| *x *= factor);
        let (left, right) = rows[column].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(index, _)| *index != column) {
            let factor = row.0[column];
            row.0.iter_mut().zip(&left).for_each(|(x, y)| *x -= factor * y);
            row.1.iter_mut().zip(&right).for_each(|(x, y)| *x -= factor * y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::testing::{numbers, random};

    /// The colour of turned coefficients at a direction is the colour before at the direction turned back. f32 storage
    /// leaves 16 coefficients of at most 0.5 with rounding 6e-8 each: below 1e-6.
    #[test]
    fn a_turned_scene_has_the_colours_of_the_turned_direction() {
        let mut x = numbers(5);
        for trial in 0..20 {
            let axis = DVec3::new(f64::from(x()), f64::from(x()), f64::from(x())).normalize();
            let rotation = DMat3::from_axis_angle(axis, 3.0 * f64::from(x()));
            let splats = random(1, 3, trial);
            let mut turned = splats.sh.clone();
            BandTurn::new(rotation).turn(&mut turned);
            for i in 0..40 {
                let z = 1.0 - (2 * i + 1) as f64 / 40.0;
                let (a, r) = (2.4 * i as f64, (1.0 - z * z).sqrt());
                let d = DVec3::new(r * a.cos(), r * a.sin(), z);
                let colour =
                    |sh: &[[f32; 3]], d| basis(d).iter().zip(sh).map(|(y, b)| y * f64::from(b[0])).sum::<f64>();
                let (before, after) = (colour(&splats.sh, rotation.transpose() * d), colour(&turned, d));
                assert!((before - after).abs() < 1e-6, "{before} and {after}");
            }
        }
    }

    /// A half turn is a change of signs, and the one that SPZ's library makes.
    #[test]
    fn a_half_turn_about_x_is_exact() {
        let splats = random(1, 3, 3);
        let mut turned = splats.sh.clone();
        BandTurn::new(DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))).turn(&mut turned);
        for (i, sign) in crate::turn::FLIPPED_SH.iter().enumerate() {
            assert_eq!(turned[i], splats.sh[i].map(|x| sign * x), "coefficient {i}");
        }
    }
}

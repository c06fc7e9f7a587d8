//! How well dynamics are known: draws of a law's numbers from the covariance of their least-squares fit, and of a
//! field's last layer.

use burn::module::Param;
use burn::tensor::{Tensor, TensorData};
use gs_base::eigen::diagonalise;
use gs_burn::glam::DVec3;

use super::bodies::fit::MARKERS;
use super::bodies::law::NUMBERS;

use super::bodies::{Law, LawValues};
use super::field::DynamicsField;

/// The poses by which a body's law is known.
#[derive(Debug, Clone)]
pub struct Observed {
    /// The body's centre in the first frame, world, scene units.
    pub first: DVec3,
    /// Distance of the markers from the centre, scene units.
    pub size: f64,
    /// Times since the first frame at which the body was seen.
    pub times: Vec<f64>,
    /// Poses among them that are independent of each other.
    pub independent: f64,
    /// Standard deviation of a marker's coordinate, scene units.
    pub noise: f64,
}

/// Numbers that determine a pose: the coordinates of its markers are not independent of each other.
const POSE_NUMBERS: f64 = 6.0;

/// Step of the central differences, as a share of a number or of 1: the error of the difference is then about 1e-10.
const DIFFERENCE: f64 = 1e-5;

/// Times the rounding of a coordinate that a derivative must exceed: a coordinate is the result of some ten operations.
const ROUNDING: f64 = 100.0;

/// Share of the largest eigenvalue of the scaled normal matrix below which a direction changes no pose: the offset of a
/// pivot along its axis. Differences are exact to 1e-10, and so are eigenvalues of zero.
const NO_EFFECT: f64 = 1e-9;

/// A draw that moves the markers over the seen times by more than this many times what the linear model says is halved:
/// the poses contradict it, and the covariance holds near the fit alone.
const CONTRADICTED: f64 = 2.0;

/// Halvings of a draw at most.
const HALVINGS: usize = 30;

/// Sweeps of Jacobi's method: it converges quadratically, matrices of this size reach rounding in about eight.
const SWEEPS: usize = 16;

/// The directions in which a fitted law may be wrong, each as long as its standard deviation.
#[derive(Debug, Clone)]
pub struct LawUncertainty {
    observed: Observed,
    values: LawValues,
    directions: Vec<[f64; NUMBERS]>,
}

impl LawUncertainty {
    /// The uncertainty of a law's `values` that were fitted to poses.
    ///
    /// The normal matrix `J^T J` of the markers' coordinates by the law's numbers is made by differences and divided by
    /// the variance of a coordinate; the information is that of the independent poses. Directions that change no pose
    /// are left out.
    pub fn of(law: Law, values: LawValues, observed: Observed) -> Self {
        let free: Vec<usize> = (0..NUMBERS).filter(|index| law.mask()[*index] > 0.0).collect();
        let columns: Vec<Vec<f64>> = free.iter().map(|index| derivative(&values, *index, &observed)).collect();
        let lengths: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt()).collect();
        let least = observed.rounding();
        let used: Vec<usize> = (0..free.len()).filter(|i| lengths[*i] > least && lengths[*i].is_finite()).collect();
        let entry = |i: &usize, j: &usize| dot(&columns[*i], &columns[*j]) / (lengths[*i] * lengths[*j]);
        let matrix: Vec<Vec<f64>> = used.iter().map(|i| used.iter().map(|j| entry(i, j)).collect()).collect();
        let (eigenvalues, vectors) = eigen(matrix);
        let largest = eigenvalues.iter().copied().fold(0.0, f64::max);
        let deviation = observed.noise * observed.repeats().sqrt();
        let mut directions = Vec::new();
        for (k, eigenvalue) in eigenvalues.iter().enumerate().filter(|(_, value)| **value > NO_EFFECT * largest) {
            let mut direction = [0.0; NUMBERS];
            for (row, i) in used.iter().enumerate() {
                direction[free[*i]] = deviation * vectors[row][k] / (eigenvalue.sqrt() * lengths[*i]);
            }
            directions.push(direction);
        }
        Self { observed, values, directions }
    }

    /// The values changed by a draw; `normal` gives independent standard normal numbers.
    pub fn draw(&self, mut normal: impl FnMut() -> f64) -> LawValues {
        let factors: Vec<f64> = self.directions.iter().map(|_| normal()).collect();
        let squares: f64 = factors.iter().map(|factor| factor * factor).sum();
        // Each direction moves all coordinates together by its standard deviation.
        let expected = self.observed.noise * (self.observed.repeats() * squares).sqrt();
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let values = self.moved(&factors, share);
            let change = self.observed.change(&values, &self.values);
            if change <= CONTRADICTED * expected {
                return values;
            }
            share *= 0.5;
        }
        self.values
    }

    fn moved(&self, factors: &[f64], share: f64) -> LawValues {
        let mut values = self.values;
        for (factor, direction) in factors.iter().zip(&self.directions) {
            values.0.iter_mut().zip(direction).for_each(|(value, part)| *value += share * factor * part);
        }
        values
    }
}

impl Observed {
    /// Coordinates for each independent number of the poses.
    fn repeats(&self) -> f64 {
        let coordinates = (3 * MARKERS.len() * self.times.len().max(1)) as f64;
        coordinates / (POSE_NUMBERS * self.independent.max(1.0))
    }

    /// The length below which a derivative of all coordinates is the rounding of its differences.
    fn rounding(&self) -> f64 {
        let coordinates = (3 * MARKERS.len() * self.times.len()) as f64;
        ROUNDING * f64::EPSILON * (self.first.length() + self.size) / DIFFERENCE * coordinates.sqrt()
    }

    /// The coordinates of the markers at all times.
    fn markers(&self, values: &LawValues) -> Vec<f64> {
        let mut coordinates = Vec::with_capacity(3 * MARKERS.len() * self.times.len());
        for s in &self.times {
            let pose = values.pose(self.first, *s);
            for marker in MARKERS {
                coordinates.extend(pose.apply(self.first + self.size * marker, self.first).to_array());
            }
        }
        coordinates
    }

    /// The length of the change of all coordinates together, scene units.
    fn change(&self, a: &LawValues, b: &LawValues) -> f64 {
        let (a, b) = (self.markers(a), self.markers(b));
        a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }
}

/// The derivative of the markers' coordinates by one number of a law.
fn derivative(values: &LawValues, index: usize, observed: &Observed) -> Vec<f64> {
    let h = DIFFERENCE * values.0[index].abs().max(1.0);
    let at = |by: f64| {
        let mut moved = *values;
        moved.0[index] += by;
        observed.markers(&moved)
    };
    at(h).iter().zip(at(-h)).map(|(after, before)| (after - before) / (2.0 * h)).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Eigenvalues, and eigenvectors as columns, of a symmetric matrix.
fn eigen(mut matrix: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut vectors = matrix.clone();
    diagonalise(&mut matrix, &mut vectors, SWEEPS);
    (matrix.iter().enumerate().map(|(i, row)| row[i]).collect(), vectors)
}

/// Normal numbers that [`field_draw`] takes.
pub fn field_numbers(field: &DynamicsField) -> usize {
    field.mlp.layers.last().map_or(0, |layer| layer.weight.dims().iter().product::<usize>() + layer.weight.dims()[1])
}

/// The field with its last layer moved by `scale` times `normal`, weights first, then biases. A weight moves by less
/// the more inputs there are, so that a bias and all weights of an output together move it alike.
///
/// # Panics
/// When there are not [`field_numbers`] normal numbers.
pub fn field_draw(field: &DynamicsField, normal: &[f64], scale: f64) -> DynamicsField {
    assert_eq!(normal.len(), field_numbers(field), "a number for each weight and bias of the last layer");
    let mut field = field.clone();
    let Some(last) = field.mlp.layers.last_mut() else { return field };
    let weight = last.weight.val();
    let [inputs, outputs] = weight.dims();
    let (of_weight, of_bias) = normal.split_at(inputs * outputs);
    let options = (&weight.device(), weight.dtype());
    let by = |numbers: &[f64], scale: f64| numbers.iter().map(|x| x * scale).collect::<Vec<f64>>();
    let change = TensorData::new(by(of_weight, scale / (inputs as f64).sqrt()), [inputs, outputs]);
    last.weight = Param::from_tensor(weight.clone() + Tensor::<2>::from_data(change, options));
    if let Some(bias) = &last.bias {
        let change = Tensor::<1>::from_data(TensorData::new(by(of_bias, scale), [outputs]), options);
        last.bias = Some(Param::from_tensor(bias.val() + change));
    }
    field
}

#[cfg(test)]
mod tests {
    use super::super::bodies::Term;
    use super::*;

    fn observed(times: usize) -> Observed {
        Observed {
            first: DVec3::new(0.2, 0.1, -0.3),
            size: 0.5,
            times: (0..times).map(|k| k as f64 / 60.0).collect(),
            independent: times as f64,
            noise: 0.01,
        }
    }

    /// Independent standard normal numbers: Box and Muller on a linear congruential generator.
    fn normals(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        move || (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
    }

    /// A velocity alone: its variance is known in closed form, `sigma^2 repeats / (4 sum s^2)` for four markers.
    #[test]
    fn a_velocity_has_the_variance_of_least_squares() {
        let observed = observed(46);
        let squares: f64 = observed.times.iter().map(|s| s * s).sum();
        let expected = observed.noise * (observed.repeats() / (4.0 * squares)).sqrt();
        let mut values = LawValues::REST;
        values.set(Term::Velocity, DVec3::new(1.0, 2.0, 3.0));
        let uncertainty = LawUncertainty::of(Law::of(&[Term::Velocity]), values, observed);
        let mut normal = normals(5);
        let draws: Vec<f64> = (0..2000).map(|_| uncertainty.draw(&mut normal).vector(Term::Velocity).x - 1.0).collect();
        let deviation = (draws.iter().map(|x| x * x).sum::<f64>() / draws.len() as f64).sqrt();
        // The deviation of 2000 draws is known to 1.6 %; 8 % is five times that.
        assert!((deviation / expected - 1.0).abs() < 0.08, "{deviation} for {expected}");
    }

    /// A shift of the pivot along the axis of an even rotation changes no pose and is never drawn; no draw contradicts
    /// the poses.
    #[test]
    fn what_changes_no_pose_is_not_drawn() {
        let mut values = LawValues::REST;
        values.set(Term::Spin, DVec3::new(0.0, 0.0, 6.0));
        values.set(Term::Pivot, DVec3::new(0.3, 0.0, 0.0));
        let observed = observed(46);
        let law = Law::of(&[Term::Spin, Term::Pivot]);
        let uncertainty = LawUncertainty::of(law, values, observed.clone());
        assert_eq!(uncertainty.directions.len(), law.freedom());
        let mut normal = normals(9);
        for _ in 0..50 {
            let draw = uncertainty.draw(&mut normal);
            assert!(draw.vector(Term::Pivot).z.abs() < 0.05, "{:?}", draw.vector(Term::Pivot));
            // Five directions of six sigma together, of 552 coordinates.
            assert!(observed.change(&draw, &values) < 6.0 * observed.noise * (5.0 * observed.repeats()).sqrt());
        }
    }

    /// Where a derivative is rounding alone, as that of a pivot along the axis, it says nothing, however often it is
    /// divided by itself.
    #[test]
    fn rounding_is_no_direction() {
        let mut values = LawValues::REST;
        values.set(Term::Spin, DVec3::new(0.0, 0.0, 6.0));
        for size in [0.695_521_384_437_703_4, 0.5, 3e-4, 700.0] {
            let observed = Observed { first: DVec3::ZERO, size, noise: 0.02 * size, ..observed(46) };
            let uncertainty = LawUncertainty::of(Law::of(&[Term::Spin, Term::Pivot]), values, observed);
            let mut normal = normals(4);
            let draw = uncertainty.draw(&mut normal);
            let change = draw.vector(Term::Spin) - values.vector(Term::Spin);
            assert!(change.abs().min_element() > 1e-4 && change.length() < 0.5, "size {size}: {change}");
            assert!(draw.vector(Term::Pivot).length() < 0.1 * size, "size {size}: {:?}", draw.vector(Term::Pivot));
        }
    }

    #[test]
    fn rest_has_nothing_to_draw_and_hostile_values_stay_themselves() {
        let rest = LawUncertainty::of(Law::of(&[]), LawValues::REST, observed(5));
        assert_eq!(rest.draw(|| 1.0), LawValues::REST);
        let mut values = LawValues::REST;
        values.set(Term::Velocity, DVec3::splat(f64::NAN));
        let hostile = LawUncertainty::of(Law::of(&[Term::Velocity]), values, observed(5));
        assert!(hostile.draw(|| 1.0).vector(Term::Velocity).is_nan());
    }
}

//! The degree of each actor's velocity, by sweeps that were no input: "as simple as what was held out bears out".
//!
//! A network gives every point a velocity of one degree. A car that keeps its speed needs none of the higher
//! coefficients, and those it has are noise. An actor is brought to the times of the sweeps between the inputs, and its
//! points' distances to these sweeps are compared: the lowest degree whose distances are no larger than those of the
//! full one, to one standard error over the sweeps, is kept. Images take no part, so that the PSNR of the frames
//! between the inputs judges what it has not chosen.

use std::collections::BTreeMap;

use anyhow::Result;
use burn::module::Param;
use burn::tensor::{Tensor, TensorData};
use gs_driving::DrivingLog;
use gs_models::flux4d::{FluxScene, PolynomialMotion};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde::Serialize;

use super::prepare::HostSnippet;
use gs_train::fit::parameters::to_host;

/// Largest distance of a point to a sweep that counts, metres: beyond it the sweep does not show the surface, whose
/// distance says nothing then.
const FARTHEST: f64 = 0.5;

/// Fewest sweeps that judge: two give no scatter to speak of.
const FEWEST_SWEEPS: usize = 3;

/// The result of the choice of degrees.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Degrees {
    /// Actors of each degree.
    pub actors: BTreeMap<usize, usize>,
    /// Numbers of velocities that are zero since.
    pub numbers_saved: usize,
    /// Numbers of velocities of all moving Gaussians before.
    pub numbers: usize,
}

impl Degrees {
    /// Adds those of another snippet.
    pub fn add(&mut self, other: &Self) {
        other.actors.iter().for_each(|(degree, count)| *self.actors.entry(*degree).or_default() += count);
        self.numbers_saved += other.numbers_saved;
        self.numbers += other.numbers;
    }

    /// The choice in words; `None` without actors.
    pub fn line(&self) -> Option<String> {
        let describe = |(degree, count): (&usize, &usize)| match degree {
            0 => format!("{count} with a constant velocity"),
            _ => format!("{count} with one of degree {degree}"),
        };
        let all: Vec<String> = self.actors.iter().map(describe).collect();
        (!all.is_empty())
            .then(|| format!("actors: {}; {} of {} numbers saved", all.join(", "), self.numbers_saved, self.numbers))
    }
}

/// The lowest degree of each actor that the sweeps between the inputs bear out. `actors` are their moving
/// rows; their velocities are lowered in `scene`.
///
/// # Errors
/// When a sweep is broken.
pub fn choose_degrees(
    scene: &mut FluxScene,
    actors: &[Vec<u32>],
    log: &DrivingLog,
    host: &HostSnippet,
) -> Result<(Vec<usize>, Degrees)> {
    let columns = scene.motion.columns();
    let mut told = Degrees { numbers: columns * scene.moving(), ..Degrees::default() };
    let mut degrees = Vec::new();
    let mut sweeps = Vec::new();
    for frame in host.frames.targets.iter().filter(|_| !actors.is_empty() && scene.motion.degree() > 0) {
        let sweep = host.labelled_sweep(log, *frame)?;
        if !sweep.points.is_empty() {
            let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&sweep.points);
            sweeps.push((scene.in_window(log.frames()[*frame].time), tree));
        }
    }
    let means: Vec<f64> = to_host(scene.gaussians.means.val()).into_iter().map(f64::from).collect();
    let means = &means[3 * scene.resting()..];
    let mut velocity: Vec<f64> = to_host(scene.velocity.val()).into_iter().map(f64::from).collect();
    for actor in actors {
        let rows: Vec<Row> = actor.iter().map(|row| Row::of(*row as usize, means, &velocity, scene)).collect();
        let degree = lowest(scene.motion, &rows, |row, motion, velocity| {
            sweeps.iter().map(|(time, tree)| distance(tree, row.at(motion, velocity, *time))).collect()
        });
        if degree < scene.motion.degree() {
            for (row, at) in rows.iter().zip(actor) {
                let own = &mut velocity[columns * *at as usize..columns * (*at as usize + 1)];
                own.copy_from_slice(&scene.motion.lowered(&row.velocity, degree));
            }
            told.numbers_saved += 3 * (scene.motion.degree() - degree) * rows.len();
        }
        degrees.push(degree);
        *told.actors.entry(degree).or_default() += 1;
    }
    if told.numbers_saved > 0 {
        let before = scene.velocity.val();
        let data = TensorData::new(velocity, [scene.moving(), columns]);
        scene.velocity = Param::from_tensor(Tensor::from_data(data, (&before.device(), before.dtype())));
    }
    Ok((degrees, told))
}

/// A moving Gaussian on the host.
struct Row {
    mean: [f64; 3],
    time: f64,
    velocity: Vec<f64>,
}

impl Row {
    fn of(row: usize, means: &[f64], velocity: &[f64], scene: &FluxScene) -> Self {
        let columns = scene.motion.columns();
        Self {
            mean: [0, 1, 2].map(|axis| means[3 * row + axis]),
            time: f64::from(scene.times[row]),
            velocity: velocity[columns * row..columns * (row + 1)].to_vec(),
        }
    }

    /// Its position at `time` (0 to 1 in the window) with another velocity.
    fn at(&self, motion: PolynomialMotion, velocity: &[f64], time: f64) -> [f64; 3] {
        let shift = motion.shift(velocity, self.time, time);
        [0, 1, 2].map(|axis| self.mean[axis] + shift[axis])
    }
}

/// Distance of a point to the nearest of a sweep, metres, at most [`FARTHEST`].
fn distance(sweep: &ImmutableKdTree<f32, 3>, point: [f64; 3]) -> f64 {
    let nearest = sweep.nearest_one::<SquaredEuclidean>(&point.map(|x| x as f32));
    f64::from(nearest.distance).sqrt().min(FARTHEST)
}

/// The lowest degree whose distances, averaged over `rows`, are no larger than those of the full degree, to one
/// standard error of the difference over the sweeps. `distances` gives those of a row to each sweep.
fn lowest(
    motion: PolynomialMotion,
    rows: &[Row],
    distances: impl Fn(&Row, PolynomialMotion, &[f64]) -> Vec<f64>,
) -> usize {
    let summed = |degree: usize| {
        let each = rows.iter().map(|row| distances(row, motion, &motion.lowered(&row.velocity, degree)));
        each.reduce(|sum, one| sum.iter().zip(one).map(|(a, b)| a + b).collect()).unwrap_or_default()
    };
    let full = summed(motion.degree());
    let count = full.len() as f64;
    if full.len() < FEWEST_SWEEPS {
        return motion.degree();
    }
    let is_as_good = |degree: &usize| {
        let more: Vec<f64> = summed(*degree).iter().zip(&full).map(|(lower, full)| lower - full).collect();
        let mean = more.iter().sum::<f64>() / count;
        let variance = more.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
        mean <= (variance / count).sqrt()
    };
    (0..motion.degree()).find(is_as_good).unwrap_or(motion.degree())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane across the motion whose points are in five sweeps where `truth` (metres per window) takes them; its rows
    /// have `found`.
    fn degree_of(found: [f64; 2], truth: [f64; 2]) -> usize {
        let motion = PolynomialMotion::new(1).expect("a degree");
        let times = [0.1, 0.3, 0.5, 0.7, 0.9];
        let along = |[first, second]: [f64; 2], time: f64| first * time + 0.5 * second * time * time;
        let places: Vec<[f64; 2]> = (0..40).map(|k| [f64::from(k % 8), f64::from(k / 8)]).collect();
        let sweep = |time: &f64| {
            let points: Vec<[f32; 3]> =
                places.iter().map(|[y, z]| [along(truth, *time) as f32, *y as f32, *z as f32]).collect();
            ImmutableKdTree::<f32, 3>::new_from_slice(&points)
        };
        let sweeps: Vec<_> = times.iter().map(|time| (*time, sweep(time))).collect();
        let velocity = vec![found[0], 0.0, 0.0, found[1], 0.0, 0.0];
        let row = |[y, z]: &[f64; 2]| Row { mean: [0.0, *y, *z], time: 0.0, velocity: velocity.clone() };
        let rows: Vec<Row> = places.iter().map(row).collect();
        lowest(motion, &rows, |row, motion, velocity| {
            sweeps.iter().map(|(time, tree)| distance(tree, row.at(motion, velocity, *time))).collect()
        })
    }

    #[test]
    fn a_constant_velocity_is_kept_where_sweeps_show_no_other() {
        assert_eq!(degree_of([1.0, 0.0], [1.0, 0.0]), 0);
        // The noise of an acceleration that the sweeps do not show.
        assert_eq!(degree_of([0.9, 0.2], [1.0, 0.0]), 0);
        assert_eq!(degree_of([1.0, -1.5], [1.0, -1.5]), 1, "a car that brakes");
    }

    #[test]
    fn without_sweeps_nothing_is_lowered() {
        let motion = PolynomialMotion::new(2).expect("a degree");
        let rows = [Row { mean: [0.0; 3], time: 0.0, velocity: vec![0.0; 9] }];
        assert_eq!(lowest(motion, &rows, |_, _, _| vec![0.0, 0.0]), 2);
    }

    #[test]
    fn the_choice_is_told() {
        assert_eq!(Degrees::default().line(), None);
        let mut all = Degrees { actors: [(0, 2), (1, 1)].into(), numbers_saved: 12, numbers: 60 };
        all.add(&all.clone());
        let line = all.line().expect("actors");
        assert_eq!(line, "actors: 4 with a constant velocity, 2 with one of degree 1; 24 of 120 numbers saved");
    }
}

//! Motions that the network alone predicts, held against the sweeps.
//!
//! Where the sweeps show no body the network answers, and on logs unlike those of its training it errs. A motion counts
//! if it brings a row, and the rows around it that move, nearer to the rows of the other sweeps than rest does.

use burn::tensor::Tensor;
use gs_models::flux4d::channels::CHANNELS;
use gs_models::flux4d::{PolynomialMotion, SnippetFrame};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::prepare::HostSnippet;
use gs_train::fit::parameters::{from_host, to_host};

/// Slowest motion that a network alone is believed, metres per second: below it are its errors of what rests.
const SLOWEST: f64 = 0.5;
/// Distance from which on a row of another sweep says nothing, metres: rows are up to so far apart on a car at 40 m.
const REACH: f64 = 0.8;
/// Radius around a row in which the rows of its sweep that move are asked with it, metres: half a car.
const AROUND: f32 = 2.0;
/// Share of [`REACH`] by which motion must be nearer than rest, in the mean over rows and sweeps. More: what rests is
/// surer to rest, and the sides of cars, which fit rest as well, rest too.
const NEARER: f64 = 0.03;

/// The velocities `[N, 3 (l + 1)]` that count of those that a network predicts where the sweeps show none: a row rests
/// that the network says to be slow, or whose motion the sweeps do not bear out.
pub fn settled(host: &HostSnippet, frame: &SnippetFrame, predicted: Tensor<2>) -> Tensor<2> {
    if frame.shown.is_none() {
        return predicted;
    }
    let (mut rows, columns) = (to_host(predicted.clone()), frame.motion.columns());
    // What is not finite is refused with the losses and the scene, and not taken for rest.
    if rows.iter().any(|value| !value.is_finite()) {
        return predicted;
    }
    let slowest = SLOWEST * (host.window[1] - host.window[0]);
    let is_asked = |row: &usize| {
        let own = wide(&rows[columns * row..columns * (row + 1)]);
        !host.start[*row].is_known && frame.motion.speed(&own, f64::from(host.rows.times[*row])) >= slowest
    };
    let asked: Vec<usize> = (0..host.start.len()).filter(is_asked).collect();
    let mut moves = vec![false; host.rows.times.len()];
    for (row, is_confirmed) in asked.iter().zip(confirmed(host, &asked, &rows, frame.motion)) {
        moves[*row] = is_confirmed;
    }
    rows.chunks_exact_mut(columns).zip(moves).filter(|(_, moves)| !moves).for_each(|(row, _)| row.fill(0.0));
    from_host(rows, columns, &predicted.device())
}

fn wide(row: &[f32]) -> Vec<f64> {
    row.iter().map(|value| f64::from(*value)).collect()
}

/// Whether the sweeps bear out the motion of each of the rows `asked`, which are not far; `velocity` has the
/// coefficients of all rows, metres per window.
fn confirmed(host: &HostSnippet, asked: &[usize], velocity: &[f32], motion: PolynomialMotion) -> Vec<bool> {
    let columns = motion.columns();
    let sweeps = Sweeps::of(host);
    let gain = |row: &usize| sweeps.gain(*row, motion, &wide(&velocity[columns * row..columns * (row + 1)]));
    let gains: Vec<f64> = asked.par_iter().map(gain).collect();
    let positions: Vec<[f32; 3]> = asked.iter().map(|row| position(host, *row)).collect();
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&positions);
    let is_confirmed = |index: usize| {
        let is_beside = |other: &usize| host.row_frames[asked[*other]] == host.row_frames[asked[index]];
        let near = tree.within::<SquaredEuclidean>(&positions[index], AROUND * AROUND);
        let own = near.iter().map(|near| near.item as usize).filter(is_beside);
        let (sum, count) = own.fold((0.0, 0), |(sum, count), other| (sum + gains[other], count + 1));
        sum >= NEARER * f64::from(count)
    };
    (0..asked.len()).into_par_iter().map(is_confirmed).collect()
}

fn position(host: &HostSnippet, row: usize) -> [f32; 3] {
    std::array::from_fn(|axis| host.rows.raw[CHANNELS * row + axis])
}

/// The rows of each input sweep of a snippet.
struct Sweeps<'a> {
    host: &'a HostSnippet,
    sweeps: Vec<SweepRows>,
}

/// The rows of a sweep, of all its LiDARs.
struct SweepRows {
    /// None without rows.
    tree: Option<ImmutableKdTree<f32, 3>>,
    /// The time of each row in the window.
    times: Vec<f64>,
}

impl<'a> Sweeps<'a> {
    fn of(host: &'a HostSnippet) -> Self {
        let of_sweep = |sweep: usize| {
            let own = || (0..host.row_frames.len()).filter(|row| usize::from(host.row_frames[*row]) == sweep);
            let points: Vec<[f32; 3]> = own().map(|row| position(host, row)).collect();
            let tree = (!points.is_empty()).then(|| ImmutableKdTree::new_from_slice(&points));
            SweepRows { tree, times: own().map(|row| f64::from(host.rows.times[row])).collect() }
        };
        Self { host, sweeps: (0..host.times.len()).into_par_iter().map(of_sweep).collect() }
    }

    /// Nearness of a row to the rows of the other sweeps by a motion over that at rest, -1 to 1, in the mean.
    fn gain(&self, row: usize, motion: PolynomialMotion, velocity: &[f64]) -> f64 {
        let (own, place) = (f64::from(self.host.rows.times[row]), usize::from(self.host.row_frames[row]));
        let at = position(self.host, row);
        let moved = |time: f64| {
            let shift = motion.shift(velocity, own, time);
            std::array::from_fn(|axis| at[axis] + shift[axis] as f32)
        };
        let others = self.sweeps.iter().enumerate().filter(|(sweep, _)| *sweep != place);
        let gains = others.filter_map(|(other, SweepRows { tree, times })| {
            let tree = tree.as_ref()?;
            // A LiDAR sees a direction at the same time of each turn; another one has seen the nearest row, at its own.
            let expected = own + self.host.times[other] - self.host.times[place];
            let nearest = tree.nearest_one::<SquaredEuclidean>(&moved(expected)).item as usize;
            Some(nearness(tree, moved(times[nearest])) - nearness(tree, at))
        });
        let (sum, count) = gains.fold((0.0, 0), |(sum, count), gain| (sum + gain, count + 1));
        sum / f64::from(count.max(1))
    }
}

/// 1 at a row, 0 from [`REACH`] on.
fn nearness(rows: &ImmutableKdTree<f32, 3>, at: [f32; 3]) -> f64 {
    let distance = f64::from(rows.nearest_one::<SquaredEuclidean>(&at).distance).sqrt();
    (1.0 - distance / REACH).max(0.0)
}

#[cfg(test)]
mod tests {
    use glam::DMat4;
    use gs_driving::Snippet;
    use gs_models::flux4d::{LiftedRows, ScaleLimits};

    use super::*;

    /// Six sweeps over a second of a car of 10 m/s along x, 4.2 m long, beside a wall that is seen at the same places.
    fn street() -> HostSnippet {
        let (mut raw, mut times, mut row_frames) = (Vec::new(), Vec::new(), Vec::new());
        for sweep in 0..6 {
            let time = 0.2 * sweep as f32;
            let car = (0..8).map(|i| [10.0 * time + 0.6 * i as f32, 0.0, 0.8]);
            let wall = (0..40).map(|i| [0.6 * i as f32 - 2.0, 5.0, 1.0]);
            for place in car.chain(wall) {
                raw.extend(place.into_iter().chain([0.0; CHANNELS - 3]));
                times.push(time);
                row_frames.push(sweep as u16);
            }
        }
        HostSnippet {
            name: "street".into(),
            frames: Snippet::new(0, 11),
            to_world: DMat4::IDENTITY,
            window: [0.0, 1.0],
            times: (0..6).map(|sweep| 0.2 * f64::from(sweep)).collect(),
            interval: 0.1,
            rows: LiftedRows { raw, times, far: 0, limits: ScaleLimits::default() },
            row_frames,
            start: Vec::new(),
            inputs: Vec::new(),
            targets: Vec::new(),
            future: Vec::new(),
            blank: 0,
        }
    }

    /// The share of the car's rows and of the wall's whose motion by `velocity` counts.
    fn shares(velocity: [f32; 3]) -> [f64; 2] {
        let host = street();
        let all: Vec<f32> = velocity.repeat(host.row_frames.len());
        let motion = PolynomialMotion::new(0).expect("a degree");
        let of = |is_car: bool| {
            let rows: Vec<usize> = (0..host.row_frames.len()).filter(|row| (row % 48 < 8) == is_car).collect();
            let found = confirmed(&host, &rows, &all, motion);
            found.iter().filter(|found| **found).count() as f64 / rows.len() as f64
        };
        [of(true), of(false)]
    }

    #[test]
    fn the_sweeps_bear_out_what_moves_and_nothing_else() {
        assert_eq!(shares([10.0, 0.0, 0.0]), [1.0, 0.0]);
        assert_eq!(shares([-10.0, 0.0, 0.0])[0], 0.0, "the other way");
        assert_eq!(shares([0.0, 10.0, 0.0]), [0.0, 0.0], "across");
        let host = street();
        assert!(confirmed(&host, &[], &[], PolynomialMotion::new(1).expect("a degree")).is_empty());
        // One sweep alone bears nothing out.
        let mut alone = host.clone();
        alone.row_frames.fill(0);
        let velocity = [10.0, 0.0, 0.0].repeat(alone.row_frames.len());
        assert_eq!(confirmed(&alone, &[0], &velocity, PolynomialMotion::new(0).expect("a degree")), [false]);
    }
}

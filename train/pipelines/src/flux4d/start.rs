//! The motion of rows that the sweeps of a snippet themselves show (`lift.velocity = "aligned"`).

use std::collections::BTreeMap;

use glam::DMat4;
use gs_driving::{DrivingLog, Sweep};
use gs_models::flux4d::PolynomialMotion;
use gs_models::flux4d::alignment::{Aligned, AlignedSweep, align};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Horizontal motion of a row at its own time; zero at rest.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RowMotion {
    /// Metres per window.
    pub velocity: [f32; 2],
    /// Metres per squared window.
    pub acceleration: [f32; 2],
    /// Whether the sweeps show it.
    pub is_known: bool,
}

/// Weight of a row that moves among those of known motion, where one that rests has 1: nearly all rows rest, and a
/// network that said so of all would be nearly right. With more weight, more of what rests would be said to move.
const MOVING_WEIGHT: f32 = 4.0;

impl RowMotion {
    /// Whether the row moves.
    pub fn moves(&self) -> bool {
        self.velocity != [0.0; 2]
    }

    /// The weight of the row in the difference from what the sweeps show.
    pub fn weight(&self) -> f32 {
        match (self.is_known, self.moves()) {
            (false, _) => 0.0,
            (true, true) => MOVING_WEIGHT,
            (true, false) => 1.0,
        }
    }

    /// The coefficients of Eq. 2, `v_0`, `v_1`, ..., of a row with the own time `time` (0 to 1).
    pub fn coefficients(&self, motion: PolynomialMotion, time: f32) -> Vec<f32> {
        let mut row = vec![0.0; motion.columns()];
        let bent = motion.degree() > 0;
        for axis in 0..2 {
            row[axis] = self.velocity[axis] - if bent { self.acceleration[axis] * time } else { 0.0 };
            if bent {
                row[3 + axis] = self.acceleration[axis];
            }
        }
        row
    }
}

/// The motions of the points of some sweeps.
pub struct SweepMotions {
    /// Of parts: a part is what one LiDAR saw in one sweep.
    aligned: Aligned,
    /// The part of each point of each sweep, and its place there.
    places: Vec<Vec<(usize, usize)>>,
}

impl SweepMotions {
    /// The motions that the sweeps of some frames show, in the axes that `from_world` leads to.
    pub fn of<'a>(log: &DrivingLog, sweeps: impl IntoIterator<Item = (usize, &'a Sweep)>, from_world: &DMat4) -> Self {
        let (mut parts, mut places): (Vec<Part>, Vec<Vec<(usize, usize)>>) = (Vec::new(), Vec::new());
        for (frame, sweep) in sweeps {
            let mut of_sensor = BTreeMap::new();
            let mut part_of = |sensor: u8| {
                *of_sensor.entry(sensor).or_insert_with(|| {
                    let origin = from_world.transform_point3(log.lidar_position(frame, sensor)).to_array();
                    parts.push(Part { points: Vec::new(), times: Vec::new(), origin });
                    parts.len() - 1
                })
            };
            // A file may number as many LiDARs as it likes, each of which would be searched on its own.
            let known = |sensor: &u8| if usize::from(*sensor) < log.lidars() { *sensor } else { 0 };
            let numbers: Vec<usize> = sweep.sensor.iter().map(|sensor| part_of(known(sensor))).collect();
            let mut add = |(index, number): (usize, &usize)| {
                let part = &mut parts[*number];
                part.points.push(sweep.points[index]);
                part.times.push(sweep.times[index]);
                (*number, part.points.len() - 1)
            };
            places.push(numbers.iter().enumerate().map(&mut add).collect());
        }
        let swept: Vec<AlignedSweep> = parts
            .iter()
            .map(|part| AlignedSweep { points: &part.points, times: &part.times, origin: part.origin })
            .collect();
        Self { aligned: align(&swept), places }
    }

    /// Whether a point of a sweep moves.
    pub fn moves(&self, sweep: usize, point: usize) -> bool {
        let (part, index) = self.places[sweep][point];
        self.aligned.of_point[part][index].is_some()
    }

    /// Whether the sweeps show how a point of a sweep moves.
    pub fn knows(&self, sweep: usize, point: usize) -> bool {
        let (part, index) = self.places[sweep][point];
        self.aligned.is_known[part][index]
    }

    /// Velocity and acceleration of a point of a sweep, metres and seconds; zero at rest.
    pub fn at(&self, sweep: usize, point: usize, position: [f32; 3]) -> ([f64; 2], [f64; 2]) {
        let (part, index) = self.places[sweep][point];
        self.aligned.motion(part, index, position)
    }
}

/// The points that one LiDAR saw in one sweep.
struct Part {
    points: Vec<[f32; 3]>,
    times: Vec<f64>,
    origin: [f64; 3],
}

/// The motions of all points of a snippet.
pub struct Motions {
    /// In metres and seconds.
    pub found: SweepMotions,
    /// Seconds.
    window: f64,
}

impl Motions {
    /// The motions of the input sweeps, in the axes of the snippet. Points that no image shows help to find the others.
    pub fn of(
        log: &DrivingLog,
        frames: &[usize],
        sweeps: &[Sweep],
        from_world: &DMat4,
        [begin, end]: [f64; 2],
    ) -> Self {
        let _stage = gs_burn::profile::stage("alignment");
        Self { found: SweepMotions::of(log, frames.iter().copied().zip(sweeps), from_world), window: end - begin }
    }

    /// The motion of a point at a position.
    pub fn of_point(&self, sweep: usize, point: usize, position: [f32; 3]) -> RowMotion {
        let (velocity, acceleration) = self.found.at(sweep, point, position);
        RowMotion {
            velocity: velocity.map(|v| (v * self.window) as f32),
            acceleration: acceleration.map(|a| (a * self.window * self.window) as f32),
            is_known: true,
        }
    }
}

/// The motion of each of the points `after`: that of the nearest of the points `before` that were merged into them.
pub fn motions_of(before: &[[f32; 3]], motions: &[RowMotion], after: &[[f32; 3]]) -> Vec<RowMotion> {
    if before == after {
        return motions.to_vec();
    }
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(before);
    after.iter().map(|point| motions[tree.nearest_one::<SquaredEuclidean>(point).item as usize]).collect()
}

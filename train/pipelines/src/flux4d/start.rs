//! The velocities that rows start with: what the sweeps of a snippet themselves show (`lift.velocity = "aligned"`).

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
}

impl RowMotion {
    /// Whether the row moves.
    pub fn moves(&self) -> bool {
        self.velocity != [0.0; 2]
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

/// The motion that the sweeps of some frames show, in the axes that `from_world` leads to.
pub fn aligned<'a>(
    log: &DrivingLog,
    sweeps: impl IntoIterator<Item = (usize, &'a Sweep)>,
    from_world: &DMat4,
) -> Aligned {
    let input = |(frame, sweep): (usize, &'a Sweep)| AlignedSweep {
        points: &sweep.points,
        time: log.frames()[frame].time,
        origin: from_world.transform_point3(log.lidar_position(frame)).to_array(),
    };
    align(&sweeps.into_iter().map(input).collect::<Vec<_>>())
}

/// The motions of all points of a snippet.
pub struct Motions {
    aligned: Aligned,
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
        let aligned = aligned(log, frames.iter().copied().zip(sweeps), from_world);
        Self { aligned, window: end - begin }
    }

    /// Whether a point of a sweep moves.
    pub fn moves(&self, sweep: usize, point: usize) -> bool {
        self.aligned.of_point[sweep][point].is_some()
    }

    /// The motion of a point at a position.
    pub fn of_point(&self, sweep: usize, point: usize, position: [f32; 3]) -> RowMotion {
        let (velocity, acceleration) = self.aligned.motion(sweep, point, position);
        RowMotion {
            velocity: velocity.map(|v| (v * self.window) as f32),
            acceleration: acceleration.map(|a| (a * self.window * self.window) as f32),
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

//! A street of boxes seen by a turning LiDAR, with known motions.

use super::{Aligned, AlignedSweep, align};

const TIMES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
/// Beams from 15 degrees down to 3 degrees up, and directions in one turn.
const BEAMS: usize = 40;
const COLUMNS: usize = 900;

/// A box on the ground.
#[derive(Clone, Copy)]
struct Block {
    /// Of the middle at the time 0.
    place: [f64; 2],
    heading: f64,
    /// Length, width and height.
    size: [f64; 3],
    speed: f64,
    acceleration: f64,
    turn: f64,
}

impl Block {
    fn still(place: [f64; 2], size: [f64; 3]) -> Self {
        Self { place, heading: 0.0, size, speed: 0.0, acceleration: 0.0, turn: 0.0 }
    }

    /// Middle and heading; the path is integrated in small steps.
    fn at(&self, time: f64) -> ([f64; 2], f64) {
        const STEPS: usize = 200;
        let (mut place, dt) = (self.place, time / STEPS as f64);
        for step in 0..STEPS {
            let t = (step as f64 + 0.5) * dt;
            let (speed, heading) = (self.speed + self.acceleration * t, self.heading + self.turn * t);
            place = [place[0] + dt * speed * heading.cos(), place[1] + dt * speed * heading.sin()];
        }
        (place, self.heading + self.turn * time)
    }

    /// Velocity of a position on it.
    fn velocity(&self, (time, (place, heading)): (f64, ([f64; 2], f64)), at: [f64; 2]) -> [f64; 2] {
        let speed = self.speed + self.acceleration * time;
        [speed * heading.cos() - self.turn * (at[1] - place[1]), speed * heading.sin() + self.turn * (at[0] - place[0])]
    }

    /// Of a ray; the box stands at a place with a heading.
    fn hit(&self, (place, heading): ([f64; 2], f64), origin: [f64; 3], direction: [f64; 3]) -> Option<f64> {
        let (sin, cos) = heading.sin_cos();
        let turned = |v: [f64; 3]| [cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]];
        let from = turned([origin[0] - place[0], origin[1] - place[1], origin[2] - 0.5 * self.size[2]]);
        let along = turned(direction);
        let (mut low, mut high) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let half = 0.5 * self.size[axis];
            let (a, b) = ((-half - from[axis]) / along[axis], (half - from[axis]) / along[axis]);
            (low, high) = (low.max(a.min(b)), high.min(a.max(b)));
        }
        (low < high && low > 0.0).then_some(low)
    }
}

struct Shot {
    points: Vec<[f32; 3]>,
    /// Seconds, one a point.
    times: Vec<f64>,
    /// The block of each point; `None`: the ground.
    on: Vec<Option<usize>>,
    origin: [f64; 3],
}

/// The sweep at a time from a LiDAR that drives at 8 m/s along x.
fn shot(blocks: &[Block], time: f64) -> Shot {
    shot_from([8.0 * time, 0.0, 1.9], blocks, time)
}

fn shot_from(origin: [f64; 3], blocks: &[Block], time: f64) -> Shot {
    let stands: Vec<([f64; 2], f64)> = blocks.iter().map(|block| block.at(time)).collect();
    let mut shot = Shot { points: Vec::new(), times: Vec::new(), on: Vec::new(), origin };
    for beam in 0..BEAMS {
        let elevation = (-15.0 + 18.0 * beam as f64 / (BEAMS - 1) as f64).to_radians();
        for column in 0..COLUMNS {
            let azimuth = std::f64::consts::TAU * (column as f64 + 0.5) / COLUMNS as f64;
            let direction = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
            let ground = if direction[2] < 0.0 { -origin[2] / direction[2] } else { f64::INFINITY };
            let hits =
                blocks.iter().enumerate().filter_map(|(b, block)| Some((block.hit(stands[b], origin, direction)?, b)));
            let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(t, _)| *t < ground);
            let t = nearest.map_or(ground, |(t, _)| t);
            if t < 120.0 {
                shot.points.push([0, 1, 2].map(|axis| (origin[axis] + t * direction[axis]) as f32));
                shot.on.push(nearest.map(|(_, block)| block));
            }
        }
    }
    shot.times = vec![time; shot.points.len()];
    shot
}

fn street() -> Vec<Block> {
    let car = [4.5, 1.8, 1.5];
    let moving =
        |place, heading, speed, acceleration, turn| Block { place, heading, size: car, speed, acceleration, turn };
    vec![
        // Oncoming, away at the LiDAR's own speed and more, braking, turning.
        moving([35.0, 4.0], std::f64::consts::PI, 10.0, 0.0, 0.0),
        moving([14.0, -3.0], 0.0, 12.0, 0.0, 0.0),
        moving([22.0, 0.5], 0.0, 9.0, -4.0, 0.0),
        moving([30.0, 6.0], 2.8, 7.0, 0.0, 0.5),
        // A person.
        Block { size: [0.6, 0.6, 1.7], ..moving([15.0, 6.5], -1.3, 1.5, 0.0, 0.0) },
        // A row of parked cars, house fronts, a lamp post.
        Block::still([12.0, -6.5], car),
        Block::still([18.5, -6.5], car),
        Block::still([25.0, -6.5], car),
        Block::still([20.0, -12.0], [60.0, 2.0, 8.0]),
        Block::still([20.0, 14.0], [50.0, 2.0, 8.0]),
        Block::still([17.0, 7.5], [0.2, 0.2, 5.0]),
    ]
}

/// The blocks that move come first.
const MOVING: usize = 5;
/// The one that brakes and the one that turns.
const CHANGING: [usize; 2] = [2, 3];

fn aligned(shots: &[Shot]) -> Aligned {
    let swept: Vec<AlignedSweep> = shots
        .iter()
        .map(|shot| AlignedSweep { points: &shot.points, times: &shot.times, origin: shot.origin })
        .collect();
    align(&swept)
}

/// Most of every block's points are found and move as the block does: in the mean within 0.5 m/s, since an offset of a
/// cell, 0.1 m, to the sweep next in time is that much, and sweeps farther in time leave less; 1 m/s for those that
/// brake and turn, whose velocities are that far in the mean from constant ones over the window. A quarter may be
/// missed: the braking car is hidden by itself in the last two sweeps. What rests does not move.
#[test]
fn blocks_move_as_they_do_and_the_street_rests() {
    let blocks = street();
    let shots: Vec<Shot> = TIMES.iter().map(|time| shot(&blocks, *time)).collect();
    let aligned = aligned(&shots);
    let (mut error, mut count, mut found) = ([0.0; MOVING], [0; MOVING], [0; MOVING]);
    let (mut resting, mut wrong) = (0, 0);
    for (sweep, (shot, time)) in shots.iter().zip(TIMES).enumerate() {
        let stands: Vec<([f64; 2], f64)> = blocks.iter().map(|block| block.at(time)).collect();
        for (index, point) in shot.points.iter().enumerate() {
            let ([x, y], _) = aligned.motion(sweep, index, *point);
            // The road under a car and the lowest points of the car are told from each other by height alone.
            match shot.on[index].filter(|block| *block < MOVING) {
                Some(block) if point[2] > 0.35 => {
                    let truth =
                        blocks[block].velocity((time, stands[block]), [f64::from(point[0]), f64::from(point[1])]);
                    count[block] += 1;
                    if aligned.of_point[sweep][index].is_some() {
                        found[block] += 1;
                        error[block] += (x - truth[0]).hypot(y - truth[1]);
                    }
                }
                Some(_) => {}
                None => {
                    resting += 1;
                    wrong += usize::from(aligned.of_point[sweep][index].is_some());
                }
            }
        }
    }
    for block in 0..MOVING {
        let (share, mean) = (found[block] as f64 / count[block] as f64, error[block] / found[block] as f64);
        assert!(count[block] > 50 && share > 0.75, "block {block}: {share} of {} found", count[block]);
        assert!(mean < if CHANGING.contains(&block) { 1.0 } else { 0.5 }, "block {block}: {mean} m/s");
    }
    assert!((wrong as f64) < 1e-3 * resting as f64, "{wrong} of {resting}");
    // Of what has no body, the street is known to rest; a twentieth may be beside bodies or too sparse to say.
    let known = |points: &mut dyn Iterator<Item = bool>| {
        let (known, all) = points.fold((0, 0), |(known, all), is_known| (known + usize::from(is_known), all + 1));
        known as f64 / f64::from(all)
    };
    let of = |is_wanted: fn(Option<usize>, [f32; 3]) -> bool| {
        let shots = shots.iter().zip(&aligned.is_known).zip(&aligned.of_point);
        let points = shots.flat_map(move |((shot, known), of_point)| {
            let free = (0..known.len()).filter(|index| of_point[*index].is_none());
            let wanted = free.filter(move |index| is_wanted(shot.on[*index], shot.points[*index]));
            wanted.map(|index| known[index]).collect::<Vec<_>>()
        });
        known(&mut points.into_iter())
    };
    let street = of(|on, _| on.is_none_or(|block| block >= MOVING));
    assert!(street > 0.95, "{street} of the street is known to rest");
    // What was missed of the blocks that move is not said to rest where other points of them move.
    let missed = of(|on, [.., z]| z > 0.35 && on.is_some_and(|block| block < MOVING));
    assert!(missed < 0.5, "{missed} of the missed points are said to rest");
}

#[test]
fn a_street_at_rest_has_no_body() {
    let blocks: Vec<Block> = street().split_off(MOVING);
    let shots: Vec<Shot> = TIMES.iter().map(|time| shot(&blocks, *time)).collect();
    assert!(aligned(&shots).bodies.iter().all(Vec::is_empty));
}

#[test]
fn hostile_sweeps_move_nothing() {
    assert!(align(&[]).bodies.is_empty());
    let empty = AlignedSweep { points: &[], times: &[], origin: [0.0; 3] };
    assert_eq!(align(&[empty; 3]).bodies, vec![vec![]; 3]);
    // One place, one time, far coordinates, a direction without a length.
    let points: Vec<[f32; 3]> = [[0.0; 3], [1e3, -1e3, 1e3], [5.0, 5.0, 1.0]].repeat(20);
    let sweep = AlignedSweep { points: &points, times: &[1.0; 60], origin: [0.0; 3] };
    let later = AlignedSweep { times: &[2.0; 60], ..sweep };
    for pair in [[sweep; 2], [sweep, later], [sweep, AlignedSweep { times: &[f64::NAN; 60], ..sweep }]] {
        assert!(align(&pair).of_point.iter().flatten().all(Option::is_none));
    }
    assert!(align(&[sweep]).of_point.iter().flatten().all(Option::is_none));
    // Poses that jump: the plans and shadows of all that lies between would not fit any memory.
    let near_and_far: Vec<Vec<[f32; 3]>> =
        [0.0, 4e6].map(|x| (0..40).map(|i| [x + i as f32, 5.0, (i % 4) as f32]).collect()).into();
    let times = [[0.0; 40], [1.0; 40]];
    let jump =
        |at: usize| AlignedSweep { points: &near_and_far[at], times: &times[at], origin: [4e6 * at as f64, 0.0, 2.0] };
    assert_eq!(align(&[jump(0), jump(1)]).of_point.iter().map(Vec::len).collect::<Vec<_>>(), [40, 40]);
}

#[test]
fn threads_change_nothing() {
    let blocks = street();
    let shots: Vec<Shot> = TIMES[..3].iter().map(|time| shot(&blocks, *time)).collect();
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| aligned(&shots))
    };
    let (one, five) = (of(1), of(5));
    assert_eq!(one.bodies, five.bodies);
    assert_eq!(one.of_point, five.of_point);
}

/// The points of blocks of the sweeps, and how many of them a body has.
fn found_of(block: usize, shots: &[Shot], aligned: &Aligned) -> [usize; 2] {
    let points = shots.iter().enumerate().flat_map(|(sweep, shot)| (0..shot.points.len()).map(move |i| (sweep, i)));
    let own = points.filter(|(sweep, i)| shots[*sweep].on[*i] == Some(block));
    own.fold([0; 2], |[all, found], (sweep, i)| [all + 1, found + usize::from(aligned.of_point[sweep][i].is_some())])
}

/// A car 45 m away and nearer has some ten points a sweep, in two or three beams that are on another part of it in the
/// next sweep, and the road between the rings of the LiDAR has no point. Half of its points or more are found, with 1.5
/// m/s at most of error: the reach of 1.2 m over 0.8 s.
#[test]
fn a_far_car_of_few_beams_moves() {
    let car = Block { heading: std::f64::consts::PI, speed: 9.0, ..Block::still([47.0, 3.0], [4.5, 1.8, 1.5]) };
    let house = Block::still([30.0, 14.0], [60.0, 2.0, 8.0]);
    let mut shots: Vec<Shot> = TIMES.iter().map(|time| shot(&[car, house], *time)).collect();
    // Every third beam and every second direction.
    for shot in &mut shots {
        let kept = |point: &[f32; 3]| {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(point[axis]) - shot.origin[axis]);
            let beam = ((z.atan2(x.hypot(y)).to_degrees() + 15.0) / 18.0 * (BEAMS - 1) as f64).round() as usize;
            let column =
                (y.atan2(x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU * COLUMNS as f64) as usize;
            beam.is_multiple_of(3) && column.is_multiple_of(2)
        };
        let keep: Vec<bool> = shot.points.iter().map(kept).collect();
        let mut left = keep.iter();
        shot.points.retain(|_| *left.next().unwrap_or(&false));
        let mut left = keep.iter();
        shot.on.retain(|_| *left.next().unwrap_or(&false));
        shot.times.truncate(shot.points.len());
    }
    let aligned = aligned(&shots);
    let [all, found] = found_of(0, &shots, &aligned);
    assert!((30..120).contains(&all) && 2 * found >= all, "{found} of {all}");
    for (sweep, bodies) in aligned.bodies.iter().enumerate() {
        for body in bodies {
            let error = (body.velocity[0] + 9.0).hypot(body.velocity[1]);
            assert!(error <= 1.5, "sweep {sweep}: {:?}", body.velocity);
        }
    }
    assert_eq!(found_of(1, &shots, &aligned)[1], 0, "the house rests");
}

/// A bus that comes the other way hides a car in the middle of the snippet; three sweeps or fewer show the car. Where
/// it is seen, most of its points are found, with 1 m/s at most of error: an offset of a cell over the nearest sweep,
/// 0.2 s, twice.
#[test]
fn a_car_that_a_bus_hides_keeps_its_motion() {
    let car = Block { speed: 9.0, ..Block::still([17.0, 5.25], [4.5, 1.8, 1.5]) };
    let bus = Block { heading: std::f64::consts::PI, speed: 10.0, ..Block::still([20.8, 1.75], [6.0, 2.5, 3.0]) };
    let house = Block::still([20.0, 14.0], [80.0, 2.0, 8.0]);
    let shots: Vec<Shot> = TIMES.iter().map(|time| shot(&[car, bus, house], *time)).collect();
    let shown: Vec<usize> = shots.iter().map(|shot| shot.on.iter().filter(|on| **on == Some(0)).count()).collect();
    assert!(shown.iter().filter(|points| **points < 10).count() >= 3, "the bus hides the car: {shown:?}");
    let aligned = aligned(&shots);
    let [all, found] = found_of(0, &shots, &aligned);
    assert!(4 * found >= 3 * all, "{found} of {all} in {shown:?}");
    for (sweep, shot) in shots.iter().enumerate() {
        for (index, point) in shot.points.iter().enumerate().filter(|(index, _)| shot.on[*index] == Some(0)) {
            let Some(_) = aligned.of_point[sweep][index] else { continue };
            let ([x, y], _) = aligned.motion(sweep, index, *point);
            assert!((x - 9.0).hypot(y) <= 1.0, "sweep {sweep}: {x} {y}");
        }
    }
    assert_eq!(found_of(2, &shots, &aligned)[1], 0, "the house rests");
}

/// Mean error of the speed of the points of the first block that a body has, metres per second, and how many have one.
fn speed_error(shots: &[Shot], aligned: &Aligned, speed: f64) -> (f64, usize) {
    let (mut sum, mut count) = (0.0, 0);
    for (sweep, shot) in shots.iter().enumerate() {
        for (index, point) in shot.points.iter().enumerate() {
            if shot.on[index] == Some(0) && aligned.of_point[sweep][index].is_some() {
                let ([x, y], _) = aligned.motion(sweep, index, *point);
                (sum, count) = (sum + (x - speed).hypot(y), count + 1);
            }
        }
    }
    (sum / f64::from(count.max(1)), count as usize)
}

/// A second LiDAR, ahead of the first and below it, whose turns slip, sees a car 20 to 150 ms after it. The car has one
/// velocity, known to an offset of a cell over half a second; with the times of the first LiDAR for both it has not.
#[test]
fn lidars_of_different_times_agree() {
    const LATER: [f64; 6] = [0.15, 0.05, 0.02, 0.09, 0.03, 0.08];
    let car = Block { speed: 12.0, ..Block::still([14.0, -3.0], [4.5, 1.8, 1.5]) };
    let blocks = [car, Block::still([20.0, -12.0], [80.0, 2.0, 8.0]), Block::still([20.0, 14.0], [80.0, 2.0, 8.0])];
    let both = |(time, later): (f64, f64)| {
        let second = shot_from([8.0 * (time + later) + 0.6, 0.0, 1.6], &blocks, time + later);
        [shot(&blocks, time), second]
    };
    let shots: Vec<Shot> = TIMES.iter().map(|time| 0.5 * time).zip(LATER).flat_map(both).collect();
    let right = aligned(&shots);
    let [all, _] = found_of(0, &shots, &right);
    let (error, count) = speed_error(&shots, &right, 12.0);
    assert!(error < 0.2 && 4 * count >= 3 * all, "{error} m/s, {count} of {all}");
    // The second alone, with its own times and with those of the first.
    let first: Vec<f64> = shots.iter().step_by(2).map(|shot| shot.times[0]).collect();
    let mut alone: Vec<Shot> = shots.into_iter().skip(1).step_by(2).collect();
    let (error, found) = speed_error(&alone, &aligned(&alone), 12.0);
    for (shot, time) in alone.iter_mut().zip(first) {
        shot.times.fill(time);
    }
    let (wrong, count) = speed_error(&alone, &aligned(&alone), 12.0);
    assert!(error < 0.2 && 4 * found >= all, "{error} m/s, {found} of {all} in both");
    assert!(wrong > 3.0 * error || count == 0, "{wrong} m/s with the first one's times");
}

/// A car of 2 m/s whose side faces the LiDAR: its ends alone are evident, and its side fits rest. Nine tenths of its
/// points move in every sweep, as the ends do, and the parked cars beside it rest.
#[test]
fn a_slow_car_moves_in_every_sweep() {
    let size = [4.5, 1.8, 1.5];
    let car = Block { speed: 2.0, ..Block::still([9.0, 3.5], size) };
    let parked = [4.0, 10.0, 16.0, 22.0].map(|x| Block::still([x, 6.2], size));
    let blocks: Vec<Block> = [car, Block::still([20.0, 14.0], [80.0, 2.0, 8.0])].into_iter().chain(parked).collect();
    let shots: Vec<Shot> = TIMES.iter().map(|time| shot(&blocks, 0.5 * time)).collect();
    let aligned = aligned(&shots);
    for sweep in 0..shots.len() {
        let shot = &shots[sweep];
        // The lowest points are told from the road by their height alone.
        let is_own = |i: &usize| shot.on[*i] == Some(0) && shot.points[*i][2] > 0.35;
        let own: Vec<usize> = (0..shot.points.len()).filter(is_own).collect();
        let found = own.iter().filter(|i| aligned.of_point[sweep][**i].is_some()).count();
        assert!(10 * found >= 9 * own.len(), "sweep {sweep}: {found} of {}", own.len());
    }
    let (error, _) = speed_error(&shots, &aligned, 2.0);
    assert!(error < 0.2, "{error} m/s");
    let [all, moved] =
        (2..6).map(|block| found_of(block, &shots, &aligned)).fold([0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    assert!((moved as f64) < 0.01 * all as f64, "{moved} of {all} points of parked cars");
}

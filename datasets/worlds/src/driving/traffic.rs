//! Movers: eight kinds in turn, so that a log with eight movers or more has all of them.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::body::{self, Body};
use super::options::Encounter;
use super::paint::{CURB, LANE, SIDE, vehicle_color};
use super::path::{Change, Path, Stand, Turn};

/// Bodies on their paths. Later ones of a kind stand farther back, so that they keep their distance.
pub(super) fn movers(count: usize, crossing: f64, ego: &Path, rng: &mut ChaCha8Rng) -> Vec<(Body, Path)> {
    (0..count).map(|index| mover(index % 8, (index / 8) as f64, crossing, ego, rng)).collect()
}

/// A straight path at one speed.
fn path(x: f64, y: f64, yaw: f64, speed: f64) -> Path {
    Path { speed, ..Path::still(Stand { position: DVec2::new(x, y), yaw }) }
}

/// The bodies of an encounter, the car last.
pub(super) fn encounter(encounter: Encounter, rng: &mut ChaCha8Rng) -> Vec<(Body, Path)> {
    let car = (body::car(vehicle_color(rng), 4.5, rng.random()), path(17.0, 1.5 * LANE, 0.0, 9.0));
    // Seen from an ego vehicle at 8 m/s the bus is before all of the car from 0.3 s to 1.0 s.
    let bus = (body::bus(DVec3::new(0.5, 0.5, 0.45), 6.0, rng.random()), path(20.8, 0.5 * LANE, PI, 10.0));
    match encounter {
        Encounter::None => Vec::new(),
        Encounter::Car => vec![car],
        Encounter::HiddenCar => vec![bus, car],
    }
}

/// The mover of a kind; `rank` counts those of the kind.
fn mover(kind: usize, rank: f64, crossing: f64, ego: &Path, rng: &mut ChaCha8Rng) -> (Body, Path) {
    let car = |rng: &mut ChaCha8Rng| body::car(vehicle_color(rng), rng.random_range(4.0..5.0), rng.random());
    match kind {
        // Ahead of the ego vehicle: brakes to a crawl.
        0 => {
            let begin = rng.random_range(0.3..1.5);
            let change = Some(Change { begin, acceleration: -2.2, end: 0.35 * ego.speed });
            (
                car(rng),
                Path { change, ..path(22.0 + 24.0 * rank + rng.random_range(0.0..6.0), -0.5 * LANE, 0.0, ego.speed) },
            )
        }
        // Oncoming at a steady speed.
        1 => (
            car(rng),
            path(46.0 + 28.0 * rank + rng.random_range(0.0..8.0), 0.5 * LANE, PI, rng.random_range(8.0..10.0)),
        ),
        // From behind in the lane to the right: turns off at the crossing.
        2 => {
            let x = crossing - 26.0 - 20.0 * rank;
            let radius = SIDE - 0.5 * LANE;
            let turn = Some(Turn { after: crossing - SIDE - x, radius, angle: -FRAC_PI_2 });
            (car(rng), Path { turn, ..path(x, -1.5 * LANE, 0.0, rng.random_range(6.5..8.0)) })
        }
        // Along the curb on two wheels.
        3 => {
            let cloth = vehicle_color(rng);
            let body = body::cyclist(cloth, rng.random());
            (body, path(10.0 + 17.0 * rank + rng.random_range(0.0..5.0), -2.0 * LANE, 0.0, rng.random_range(3.5..6.0)))
        }
        // On the sidewalk.
        4 => {
            let cloth = vehicle_color(rng);
            let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let yaw = if rng.random_bool(0.5) { PI } else { 0.0 };
            let x = 9.0 + 11.0 * rank + rng.random_range(0.0..8.0);
            (body::pedestrian(cloth, rng.random()), path(x, side * (CURB + 2.2), yaw, rng.random_range(1.0..1.9)))
        }
        // In the crossing street: brakes and stops at the corner.
        5 => {
            let speed = rng.random_range(6.0..8.0);
            let side = if rank % 2.0 == 0.0 { 1.0 } else { -1.0 };
            let y = CURB + 4.0 + 0.5 * speed * speed / 2.5 + speed * 0.5 + 9.0 * (0.5 * rank).floor();
            let change = Some(Change { begin: 0.5, acceleration: -2.5, end: 0.0 });
            let x = crossing - side * 0.5 * LANE;
            (car(rng), Path { change, ..path(x, side * y, -side * FRAC_PI_2, speed) })
        }
        // A bus in the far lane, then oncoming cars that turn off.
        6 if rank == 0.0 => {
            let color = DVec3::new(0.55, 0.3, 0.04);
            (body::bus(color, 11.0, rng.random()), path(58.0, 1.5 * LANE, PI, rng.random_range(6.0..8.0)))
        }
        6 => {
            let x = crossing + 24.0 + 18.0 * rank;
            let turn = Some(Turn { after: x - crossing - SIDE, radius: SIDE - 0.5 * LANE, angle: -FRAC_PI_2 });
            (car(rng), Path { turn, ..path(x, 1.5 * LANE, PI, rng.random_range(6.0..7.5)) })
        }
        // Across the crossing street on foot.
        _ => {
            let cloth = vehicle_color(rng);
            let y = -(CURB + 0.8 + 0.9 * rank);
            let x = crossing - SIDE - rng.random_range(0.0..2.5);
            (body::pedestrian(cloth, rng.random()), path(x, y, 0.0, rng.random_range(1.1..1.7)))
        }
    }
}

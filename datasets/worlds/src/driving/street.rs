//! The street of a seed: houses, trees, posts and parked cars on both sides, a crossing, and what moves.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::body::{self, Body};
use super::options::StreetOptions;
use super::paint::{CURB, HOUSES, LANE, SIDE, vehicle_color};
use super::path::{Change, Path, Stand};
use super::traffic;

/// The street reaches this far behind and ahead of the start, metres.
const BEHIND: f64 = -70.0;
const AHEAD: f64 = 230.0;

/// A body on its path. `number` is 0 for what is part of the street, and counts vehicles and people from 1.
#[derive(Debug, Clone)]
pub(super) struct Thing {
    pub body: Body,
    pub path: Path,
    pub number: u32,
}

/// Everything there is.
#[derive(Debug)]
pub(super) struct Street {
    pub things: Vec<Thing>,
    /// Where the other street crosses, metres along this one.
    pub crossing: f64,
    /// Towards the sun, length 1.
    pub sun: DVec3,
    /// The path of the ego vehicle.
    pub ego: Path,
    /// Heading of the street in the world, radians.
    pub heading: f64,
    pub salt: u32,
}

impl Street {
    /// The street of the options' seed.
    pub fn new(options: &StreetOptions) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let crossing = rng.random_range(38.0..62.0);
        let turn: f64 = rng.random_range(0.0..TAU);
        let height: f64 = rng.random_range(0.6..1.1);
        let sun = DVec3::new(turn.cos() * height.cos(), turn.sin() * height.cos(), height.sin());
        let start = Stand { position: DVec2::new(0.0, -0.5 * LANE), yaw: 0.0 };
        let speed = rng.random_range(6.0..10.0);
        let change = match rng.random_range(0..3) {
            0 => Some(Change { begin: rng.random_range(1.0..3.0), acceleration: -1.8, end: 0.3 * speed }),
            1 => Some(Change { begin: rng.random_range(0.5..2.0), acceleration: 1.2, end: 1.3 * speed }),
            _ => None,
        };
        let ego = Path { start, speed, change, turn: None };
        let heading = rng.random_range(-PI..PI);
        let salt = rng.random();
        let mut street = Self { things: Vec::new(), crossing, sun, ego, heading, salt };
        street.build(&mut rng);
        street.park(&mut rng);
        for (body, path) in traffic::movers(options.movers, crossing, &ego, &mut rng) {
            street.add_actor(body, path);
        }
        for (body, path) in traffic::encounter(options.encounter, &mut rng) {
            street.add_actor(body, path);
        }
        street
    }

    fn add(&mut self, body: Body, x: f64, y: f64, yaw: f64) {
        let path = Path::still(Stand { position: DVec2::new(x, y), yaw });
        self.things.push(Thing { body, path, number: 0 });
    }

    fn add_actor(&mut self, body: Body, path: Path) {
        let number = 1 + self.things.iter().map(|thing| thing.number).max().unwrap_or(0);
        self.things.push(Thing { body, path, number });
    }

    /// Houses, trees and posts.
    fn build(&mut self, rng: &mut ChaCha8Rng) {
        for side in [-1.0, 1.0] {
            let mut x = BEHIND;
            while x < AHEAD {
                let size =
                    DVec3::new(rng.random_range(9.0..20.0), rng.random_range(8.0..14.0), rng.random_range(6.0..22.0));
                let middle = x + 0.5 * size.x;
                x += size.x + if rng.random_bool(0.25) { rng.random_range(2.0..7.0) } else { 0.2 };
                if (middle - self.crossing).abs() < 0.5 * size.x + SIDE + 4.0 {
                    continue;
                }
                let color = wall_color(rng);
                let window = DVec2::new(rng.random_range(1.8..3.4), rng.random_range(2.8..3.6));
                let y = side * (HOUSES + 0.5 * size.y + rng.random_range(0.0..1.5));
                self.add(body::house(size, color, window, rng.random()), middle, y, 0.0);
            }
            // Houses that close the view into the crossing street.
            let end = body::house(DVec3::new(24.0, 10.0, 14.0), wall_color(rng), DVec2::new(2.4, 3.2), rng.random());
            self.add(end, self.crossing, side * 70.0, 0.0);
            let mut x = BEHIND + rng.random_range(0.0..8.0);
            while x < AHEAD {
                let is_clear = (x - self.crossing).abs() > SIDE + 4.0;
                if is_clear && rng.random_bool(0.6) {
                    let tree = body::tree(rng.random_range(4.5..8.0), rng.random_range(0.0..TAU), rng.random());
                    self.add(tree, x, side * (CURB + 1.0), 0.0);
                } else if is_clear {
                    self.add(body::post(rng.random()), x, side * (CURB + 0.5), if side > 0.0 { PI } else { 0.0 });
                }
                x += rng.random_range(8.0..14.0);
            }
        }
        let end = body::house(DVec3::new(12.0, 40.0, 18.0), wall_color(rng), DVec2::new(2.6, 3.2), rng.random());
        self.add(end, AHEAD + 10.0, 0.0, 0.0);
    }

    /// Cars that stand along the curb.
    fn park(&mut self, rng: &mut ChaCha8Rng) {
        for side in [-1.0, 1.0] {
            let mut x = BEHIND + rng.random_range(0.0..6.0);
            while x < AHEAD - 40.0 {
                let length = rng.random_range(3.9..5.0);
                if rng.random_bool(0.55) && (x - self.crossing).abs() > SIDE + 8.0 {
                    let stand = Stand {
                        position: DVec2::new(x, side * (CURB - 1.15)),
                        yaw: if side > 0.0 { PI } else { 0.0 } + rng.random_range(-0.03..0.03),
                    };
                    self.add_actor(body::car(vehicle_color(rng), length, rng.random()), Path::still(stand));
                }
                x += rng.random_range(6.0..9.0);
            }
        }
    }
}

fn wall_color(rng: &mut ChaCha8Rng) -> DVec3 {
    let colors = [
        [0.42, 0.3, 0.22],
        [0.5, 0.46, 0.38],
        [0.35, 0.16, 0.11],
        [0.4, 0.42, 0.45],
        [0.55, 0.5, 0.3],
        [0.3, 0.35, 0.3],
    ];
    DVec3::from(colors[rng.random_range(0..colors.len())]) * rng.random_range(0.75..1.25)
}

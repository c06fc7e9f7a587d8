//! Paint with detail at all scales: a texture without fine detail would look the same blurred and sharp.
//!
//! Textures are functions of the position in an object's own coordinates, so they turn with it. Cells get their colours
//! from a hash of their numbers and a salt, which comes from the seed.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::Deserialize;

/// A pattern in three colours (linear light, 0 to 1).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Texture {
    pub pattern: Pattern,
    /// Side of the largest cells, metres.
    pub size: f64,
    pub colors: [DVec3; 3],
    pub salt: u32,
}

/// How a texture's colours are laid out.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Pattern {
    /// Cubes of random colours with dark joints.
    Mosaic,
    /// Boards along x with grain, for floors.
    Planks,
    /// Staggered tiles with light joints on upright walls.
    Bricks,
    /// Blotches and speckles.
    Plaster,
    /// Bent stripes with speckles.
    Fur,
    /// Patches between meridians and circles of latitude, with spots.
    Ball,
    /// The skin of a bumpy sphere: colour by height, pale and dark marks.
    Skin,
    /// Squares of the first two colours, seen from above.
    Checker,
    /// Cubes of the first two colours.
    Blocks,
    /// Soft level bands of the first two colours.
    Bands,
    /// Soft swirls of the first two colours.
    Swirls,
}

/// Cells are moved by this share of their side, so that no face of an object or room lies in the plane between two.
const CELL_OFFSET: f64 = 0.37;

impl Texture {
    /// The share of light that is reflected per channel at a position in the object's coordinates.
    pub fn color(&self, position: DVec3) -> DVec3 {
        let [a, b, c] = self.colors;
        let p = position / self.size;
        let parity = |cells: DVec3| (cells.x + cells.y + cells.z).rem_euclid(2.0);
        let wave = |u: f64| 0.5 + 0.5 * (TAU * u).sin();
        match self.pattern {
            Pattern::Mosaic => {
                let shifted = p + CELL_OFFSET;
                let cell = shifted.floor();
                let edge = (shifted - cell - 0.5).abs().max_element();
                let tile = self.pick(cell);
                if edge > 0.455 { 0.25 * a } else { tile * (0.75 + 0.5 * noise(5.0 * p, self.salt)) }
            }
            Pattern::Planks => {
                let row = (p.y + CELL_OFFSET).floor();
                let along = p.x / 7.0 + unit(hash(row as i32, 0, 0, self.salt));
                let board = DVec3::new(row, along.floor(), 0.0);
                let joint = (p.y + CELL_OFFSET - row).min(30.0 * (along - along.floor()));
                let grain = noise(DVec3::new(0.7 * p.x, 9.0 * p.y, 4.0 * p.z + 3.0 * row), self.salt);
                let tint = unit(hash(board.x as i32, board.y as i32, 1, self.salt));
                let color = a.lerp(b, tint) * (0.62 + 0.76 * grain);
                if joint < 0.06 { 0.3 * c } else { color }
            }
            Pattern::Bricks => {
                let row = (2.0 * p.z + CELL_OFFSET).floor();
                let along = p.x + p.y + 0.5 * row.rem_euclid(2.0) + CELL_OFFSET;
                let brick = DVec3::new(along.floor(), row, 2.0);
                let (x, z) = (along - along.floor(), 2.0 * p.z + CELL_OFFSET - row);
                let tint = unit(hash(brick.x as i32, brick.y as i32, 2, self.salt));
                let grain = 0.7 + 0.6 * noise(8.0 * p, self.salt);
                if x < 0.06 || z < 0.12 { c * (0.8 + 0.2 * grain) } else { a.lerp(b, tint) * grain }
            }
            Pattern::Plaster => {
                let coarse = noise(p, self.salt);
                let fine = noise(6.0 * p, self.salt ^ 1);
                let color = a.lerp(b, smooth(0.3, 0.7, coarse)) * (0.75 + 0.5 * fine);
                if noise(3.1 * p, self.salt ^ 2) > 0.74 { c } else { color }
            }
            Pattern::Fur => {
                let bend = 1.6 * noise(0.9 * p, self.salt);
                let stripe = wave(p.z + 0.4 * p.x + bend);
                let color = a.lerp(b, smooth(0.35, 0.65, stripe)) * (0.6 + 0.8 * noise(4.0 * p, self.salt ^ 1));
                if noise(2.3 * p, self.salt ^ 2) > 0.73 { c } else { color }
            }
            Pattern::Ball => {
                let turns = position.y.atan2(position.x) / TAU;
                let height = position.z / position.length().max(1e-9);
                let (column, row) = ((12.0 * turns).floor(), (3.5 * height).floor());
                let (x, z) = (12.0 * turns - column - 0.5, 3.5 * height - row - 0.5);
                let patch = self.pick(DVec3::new(column, row, 3.0));
                if x * x + z * z < 0.06 {
                    DVec3::splat(0.85)
                } else if x.abs() > 0.45 || z.abs() > 0.44 {
                    DVec3::splat(0.03)
                } else {
                    patch * (0.75 + 0.5 * noise(p, self.salt))
                }
            }
            Pattern::Checker => a.lerp(b, parity(p.with_z(0.0).floor())),
            // Half a cell off, so that a cell lies in the middle of each face.
            Pattern::Blocks => a.lerp(b, parity((p + 0.5).floor())),
            Pattern::Bands => a.lerp(b, wave(p.z)),
            Pattern::Swirls => a.lerp(b, wave(p.x + 0.35 * (9.0 * position.y).sin() + 0.5 * p.z)),
            Pattern::Skin => {
                let height = smooth(-0.5, 0.6, bumps(position));
                let mark = noise(p, self.salt);
                let color = a.lerp(b, height) * (0.65 + 0.7 * noise(3.0 * p, self.salt ^ 1));
                if mark > 0.70 {
                    c
                } else if mark < 0.28 {
                    0.25 * a
                } else {
                    color
                }
            }
        }
    }

    /// One of the three colours, at a random brightness.
    fn pick(&self, cell: DVec3) -> DVec3 {
        let h = hash(cell.x as i32, cell.y as i32, cell.z as i32, self.salt);
        self.colors[(h % 3) as usize] * (0.6 + 0.7 * unit(h.rotate_left(13)))
    }
}

/// Half waves of the relief over one radius: a bump is about a quarter of a radius wide.
const BUMPS: f64 = 3.5;

/// The relief of a bumpy sphere in the direction of `position`: -1 in pits to 1 on bumps.
pub(crate) fn bumps(position: DVec3) -> f64 {
    // Parabolas in place of sines, and a cast in place of a rounding: marching evaluates this more than anything else.
    let wave = |u: f64| {
        let u = u - 2.0 * f64::from((0.5 * u + 64.5) as i32 - 64);
        4.0 * u * (1.0 - u.abs())
    };
    let u = position * (BUMPS / position.length().max(1e-9));
    wave(u.x) * wave(u.y) * wave(u.z)
}

/// 0 below `low`, 1 above `high`, a smooth step between.
fn smooth(low: f64, high: f64, value: f64) -> f64 {
    let x = ((value - low) / (high - low)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Random numbers on the corners of a unit grid, interpolated smoothly: 0 to 1, mostly around 0.5.
pub fn noise(p: DVec3, salt: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (3.0 - 2.0 * f);
    let (x, y, z) = (cell.x as i32, cell.y as i32, cell.z as i32);
    let corner = |dx: i32, dy: i32, dz: i32| unit(hash(x + dx, y + dy, z + dz, salt));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let edge = |dy: i32, dz: i32| mix(corner(0, dy, dz), corner(1, dy, dz), f.x);
    mix(mix(edge(0, 0), edge(1, 0), f.y), mix(edge(0, 1), edge(1, 1), f.y), f.z)
}

/// A hash of a cell (Murmur3's last step over odd multiples of its numbers).
fn hash(x: i32, y: i32, z: i32, salt: u32) -> u32 {
    let mut h = salt.wrapping_mul(0x9e37_79b9)
        ^ (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

fn unit(hash: u32) -> f64 {
    f64::from(hash) / 4_294_967_296.0
}

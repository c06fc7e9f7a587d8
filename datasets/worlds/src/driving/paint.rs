//! Colours of surfaces: the share of light that is reflected, linear, 0 to 1.

use crate::tracer::texture::noise;
use glam::{DVec2, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// How a part is painted.
#[derive(Debug, Clone, Copy)]
pub(super) enum Paint {
    /// One colour with blotches of this size, metres.
    Plain { color: DVec3, grain: f64 },
    /// A vehicle of half this length with lamps in front and behind, and a dark sill.
    Bodywork { color: DVec3, half_length: f64 },
    /// Dark, and only half of the LiDAR's beams return.
    Glass,
    /// A wall with windows.
    Facade { color: DVec3, window: DVec2 },
    /// Leaves.
    Foliage { color: DVec3 },
}

impl Paint {
    /// The colour at a position and normal in the axes of the body.
    pub fn color(&self, p: DVec3, normal: DVec3, salt: u32) -> DVec3 {
        match *self {
            Self::Plain { color, grain } => color * (0.75 + 0.5 * noise(p / grain, salt)),
            Self::Bodywork { color, half_length } => bodywork(color, half_length, p, salt),
            Self::Glass => DVec3::new(0.03, 0.04, 0.05) * (0.7 + 0.6 * noise(3.0 * p, salt)),
            Self::Facade { color, window } => facade(color, window, p, normal, salt),
            Self::Foliage { color } => {
                color * (0.35 + 1.1 * noise(2.5 * p, salt)) * (0.6 + 0.8 * noise(9.0 * p, salt ^ 1))
            }
        }
    }

    /// The share of beams that return nothing.
    pub fn swallows(&self) -> f64 {
        if matches!(self, Self::Glass) { 0.5 } else { 0.0 }
    }
}

fn bodywork(color: DVec3, half_length: f64, p: DVec3, salt: u32) -> DVec3 {
    let is_end = p.x.abs() > half_length - 0.02;
    let is_lamp = is_end && p.y.abs() > 0.45 && p.z > 0.55 && p.z < 0.78;
    if is_lamp {
        return if p.x > 0.0 { DVec3::new(0.85, 0.85, 0.75) } else { DVec3::new(0.6, 0.03, 0.03) };
    }
    if p.z < 0.38 {
        return DVec3::splat(0.04);
    }
    // The gap of a door, and dust.
    let gap = if p.x.abs() < 0.03 && !is_end { 0.45 } else { 1.0 };
    color * gap * (0.9 + 0.2 * noise(2.0 * p, salt))
}

fn facade(color: DVec3, window: DVec2, p: DVec3, normal: DVec3, salt: u32) -> DVec3 {
    let wall = color * (0.8 + 0.25 * noise(0.7 * p, salt) + 0.2 * noise(6.0 * p, salt ^ 1));
    if normal.z.abs() > 0.5 {
        return 0.5 * wall;
    }
    let along = if normal.x.abs() > 0.5 { p.y } else { p.x };
    let cell = DVec2::new(along, p.z) / window;
    let place = cell - cell.floor();
    let is_window = (0.22..0.78).contains(&place.x) && (0.3..0.85).contains(&place.y);
    let is_sill = (0.18..0.82).contains(&place.x) && (0.24..0.3).contains(&place.y);
    if is_window {
        let tint = noise(DVec3::new(cell.x.floor(), cell.y.floor(), 7.3) * 1.7, salt ^ 2);
        DVec3::new(0.05, 0.07, 0.1) + 0.25 * tint * tint * DVec3::new(0.9, 0.8, 0.6)
    } else if is_sill {
        DVec3::splat(0.55)
    } else {
        wall
    }
}

/// Widths of the street, metres from its middle.
pub(super) const LANE: f64 = 3.5;
pub(super) const CURB: f64 = 9.4;
pub(super) const HOUSES: f64 = 13.5;

/// Half the width of the crossing street, metres.
pub(super) const SIDE: f64 = 7.0;

/// The kind of ground at a position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ground {
    Road,
    Marking,
    Sidewalk,
    Soil,
}

impl Ground {
    /// The ground of a street that another one crosses at `crossing` along it.
    pub fn at(p: DVec2, crossing: f64) -> Self {
        let (across, along) = (p.y.abs(), (p.x - crossing).abs());
        let on_side = along < SIDE;
        if across < CURB || on_side {
            let on_street = across < 2.0 * LANE + 0.3 && along > SIDE + 2.5;
            let dashed = p.x.rem_euclid(9.0) < 3.0;
            let is_line = on_street
                && (across < 0.12
                    || ((across - LANE).abs() < 0.08 && dashed)
                    || (across - 2.0 * LANE).abs() < 0.07
                    || (along < SIDE + 3.0 && across < 2.0 * LANE));
            let is_beside = (SIDE + 3.4..SIDE + 6.4).contains(&along);
            let is_zebra = is_beside && across < CURB && p.y.rem_euclid(1.0) < 0.5;
            return if is_line || is_zebra { Self::Marking } else { Self::Road };
        }
        if across < HOUSES || along < SIDE + 4.0 { Self::Sidewalk } else { Self::Soil }
    }

    /// Colour; `footprint` is the size of what is looked at, metres: finer detail is left out, as it would flicker.
    pub fn color(self, p: DVec2, footprint: f64, salt: u32) -> DVec3 {
        let p3 = p.extend(0.0);
        let fade = |cell: f64| 1.0 / (1.0 + (footprint / cell).powi(2));
        let detail = |scale: f64, salt: u32| fade(1.0 / scale) * (noise(scale * p3, salt) - 0.5);
        let coarse = 1.0 + 0.35 * detail(0.4, salt);
        match self {
            Self::Road => DVec3::new(0.105, 0.108, 0.115) * (coarse + 0.5 * detail(7.0, salt ^ 1)),
            Self::Marking => DVec3::splat(0.62) * (coarse + 0.3 * detail(5.0, salt ^ 1)),
            Self::Sidewalk => {
                let joint = p.rem_euclid(DVec2::splat(1.2)).min_element() < 0.05;
                let dark = if joint { 1.0 - 0.4 * fade(0.2) } else { 1.0 };
                DVec3::new(0.33, 0.31, 0.29) * dark * (coarse + 0.35 * detail(5.0, salt ^ 1))
            }
            Self::Soil => DVec3::new(0.12, 0.17, 0.07) * (coarse + 0.6 * detail(3.0, salt ^ 1)),
        }
    }
}

/// The paint of a vehicle.
pub(super) fn vehicle_color(rng: &mut ChaCha8Rng) -> DVec3 {
    let colors = [
        [0.7, 0.7, 0.7],
        [0.03, 0.03, 0.035],
        [0.25, 0.26, 0.28],
        [0.5, 0.04, 0.03],
        [0.03, 0.09, 0.35],
        [0.04, 0.25, 0.12],
        [0.65, 0.42, 0.03],
        [0.45, 0.45, 0.42],
    ];
    DVec3::from(colors[rng.random_range(0..colors.len())])
}

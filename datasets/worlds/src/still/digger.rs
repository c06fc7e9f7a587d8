//! The digger's many small parts: what a photo of 800 pixels shows in three to eight of them.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

use rand_chacha::ChaCha8Rng;

use crate::tracer::scene::Scene;

/// Distance of studs, metres; the plate has as many as fit in patches of 5 x 4.
const PITCH: f64 = 0.1;
const PATCH: [usize; 2] = [5, 4];
const PATCHES: [usize; 2] = [4, 3];

/// Links around each of the two tracks, and the half length and the radius of a track, metres.
const LINKS: usize = 36;
const TRACK: (f64, f64) = (0.34, 0.13);

/// Bars of the grille behind the cabin, and teeth of the bucket.
const BARS: usize = 9;
const TEETH: usize = 7;

/// The whole digger; salts of textures come from `rng`.
pub(super) fn scene(rng: &mut ChaCha8Rng) -> Scene {
    let parts = [studs(), track(0.3), track(-0.3), grille(), teeth()].concat();
    Scene::described(&[include_str!("../../scenes/still/digger.toml"), &parts], rng)
}

/// One body of parts, each a texture, a position and the rest of its description.
fn body(origin: [f64; 3], parts: impl Iterator<Item = (&'static str, [f64; 3], String)>) -> String {
    let mut text = format!("[[still]]\nposition = {origin:?}\nparts = [\n");
    for (texture, position, rest) in parts {
        writeln!(text, "  {{ texture = \"{texture}\", position = {position:?}, {rest} }},")
            .expect("a string takes all");
    }
    text + "]\n"
}

fn cuboid(half: [f64; 3], turn: f64) -> String {
    format!("turn = [{{ y = {turn:?} }}], shape.cuboid.half = {half:?}")
}

/// Studs in patches, so that a ray asks few of them.
fn studs() -> String {
    let patch = |index: usize| {
        let side = |axis: usize, place: usize| (place as f64 - (PATCHES[axis] - 1) as f64 / 2.0) * PATCH[axis] as f64;
        let origin = [PITCH * side(0, index % PATCHES[0]), PITCH * side(1, index / PATCHES[0]), 0.075];
        let stud = |stud: usize| {
            let place = |axis: usize, at: usize| PITCH * (at as f64 - (PATCH[axis] - 1) as f64 / 2.0);
            let position = [place(0, stud % PATCH[0]), place(1, stud / PATCH[0]), 0.0];
            ("stud", position, "shape.column = { radius = 0.03, half_height = 0.016 }".to_string())
        };
        body(origin, (0..PATCH[0] * PATCH[1]).map(stud))
    };
    (0..PATCHES[0] * PATCHES[1]).map(patch).collect()
}

/// Links on a stadium around three wheels, at `side` of the middle.
fn track(side: f64) -> String {
    let (half, radius) = TRACK;
    let around = 4.0 * half + 2.0 * PI * radius;
    let link = |index: usize| {
        let along = around * index as f64 / LINKS as f64;
        let bend = PI * radius;
        let (x, z, turn) = if along < 2.0 * half {
            (along - half, radius, 0.0)
        } else if along < 2.0 * half + bend {
            let angle = (along - 2.0 * half) / radius;
            (half + radius * angle.sin(), radius * angle.cos(), angle)
        } else if along < 4.0 * half + bend {
            (half - (along - 2.0 * half - bend), -radius, PI)
        } else {
            let angle = PI + (along - 4.0 * half - bend) / radius;
            (-half + radius * angle.sin(), radius * angle.cos(), angle)
        };
        ("black", [x, 0.0, z], cuboid([0.018, 0.085, 0.012], turn))
    };
    let wheel = |index: usize| {
        let turn = format!("turn = [{{ x = {FRAC_PI_2:?} }}], shape.column = {{ radius = 0.1, half_height = 0.05 }}");
        ("steel", [(index as f64 - 1.0) * half, 0.0, 0.0], turn)
    };
    body([-0.15, side, 0.235], (0..LINKS).map(link).chain((0..3).map(wheel)))
}

fn grille() -> String {
    let bar = |index: usize| ("black", [0.0, 0.036 * (index as f64 - 4.0), 0.0], cuboid([0.006, 0.006, 0.16], 0.0));
    body([-0.14, 0.0, 0.68], (0..BARS).map(bar))
}

fn teeth() -> String {
    let tooth = |index: usize| ("steel", [0.0, 0.09 * (index as f64 - 3.0), 0.0], cuboid([0.04, 0.018, 0.01], 0.15));
    body([0.92, 0.0, 0.235], (0..TEETH).map(tooth))
}

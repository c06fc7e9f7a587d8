//! A world as the ray tracer takes it: bodies, planes and light.

use glam::{DQuat, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::super::tracer::motion::Pose;
use super::super::tracer::stage::{Lamp, Stage};
use super::super::tracer::texture::Texture;
use super::objects::{self, Paint};
use super::{World, room};

/// Builds a world; textures come from `rng`.
pub(super) fn stage(world: World, rng: &mut ChaCha8Rng) -> Stage {
    let mut paint = |pattern, size, colors: [[f64; 3]; 3]| Texture {
        pattern,
        size,
        colors: colors.map(DVec3::from_array),
        salt: rng.random(),
    };
    let paint: &mut Paint = &mut paint;
    let bodies = match world {
        World::Fan => objects::fan(paint),
        World::FallingBall => objects::falling_ball(paint),
        World::Slider => objects::slider(paint),
        World::Pendulum => objects::pendulum(paint),
        World::Hinge => objects::hinge(paint),
        World::Telescope => objects::telescope(paint),
        World::Spinner => objects::spinner(paint),
        World::Duo => objects::duo(paint),
        World::Room => room::bodies(paint),
    };
    let planes = if world.is_room() { room::planes(paint) } else { Vec::new() };
    let lamp = if world.is_room() { room::lamp() } else { Lamp::new(DVec3::new(2.4, -2.8, 4.2), 0.7) };
    let still = bodies.still.into_iter();
    let still =
        still.map(|(position, solid)| (lamp.posed(Pose { rotation: DQuat::IDENTITY, position }), solid)).collect();
    Stage {
        planes,
        still,
        objects: bodies.moving,
        lamp,
        // More light from all around than from the lamp: the shade of a body that turns changes mildly.
        lamp_color: DVec3::new(0.48, 0.45, 0.40),
        sky: [DVec3::new(0.56, 0.58, 0.62), DVec3::new(0.40, 0.39, 0.38)],
    }
}

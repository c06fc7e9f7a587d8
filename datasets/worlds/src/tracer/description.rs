//! Scenes as TOML describes them: textures, planes, bodies at rest, moving bodies and the light.

use glam::{DQuat, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

use super::motion::{Motion, Path, Pose, Turn};
use super::scene::{Lamp, MovingBody, Plane, Scene};
use super::shape::Shape;
use super::solid::{Part, Solid};
use super::texture::{Pattern, Texture};

/// One file; every list may be empty.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Description {
    textures: Vec<Named>,
    planes: Vec<Wall>,
    still: Vec<Still>,
    moving: Vec<Moving>,
    light: Option<Light>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Named {
    name: String,
    pattern: Pattern,
    size: f64,
    colors: [[f64; 3]; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wall {
    normal: [f64; 3],
    offset: f64,
    texture: String,
    /// Other cells of the same texture.
    #[serde(default)]
    salt: u32,
    reach: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Still {
    #[serde(default)]
    position: [f64; 3],
    /// The body is turned about z by up to this, radians, as the seed says.
    #[serde(default)]
    yaw_range: f64,
    parts: Vec<Piece>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Moving {
    name: String,
    path: Path,
    /// World axis of the turn, of any length.
    #[serde(default = "upright")]
    axis: [f64; 3],
    turn: Option<Turn>,
    /// Orientation at the angle 0.
    #[serde(default)]
    orientation: Vec<Rotation>,
    parts: Vec<Piece>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Piece {
    shape: Shape,
    texture: String,
    #[serde(default)]
    position: [f64; 3],
    #[serde(default)]
    turn: Vec<Rotation>,
}

/// A rotation about an axis, radians; of several the last is the first to be done.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Rotation {
    X(f64),
    Y(f64),
    Z(f64),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Light {
    centre: [f64; 3],
    radius: f64,
    color: [f64; 3],
    /// From straight above and from straight below.
    ambient: [[f64; 3]; 2],
    #[serde(default)]
    sky: bool,
}

fn upright() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// Descriptions are files of the program, and a test reads all of them.
const VALID: &str = "descriptions of worlds are valid";

impl Scene {
    /// The scene that descriptions make together. Salts of textures and turns of bodies at rest come from `rng`.
    pub fn described(texts: &[&str], rng: &mut ChaCha8Rng) -> Self {
        let mut whole = Description::default();
        for text in texts {
            let part: Description = toml::from_str(text).expect(VALID);
            whole.textures.extend(part.textures);
            whole.planes.extend(part.planes);
            whole.still.extend(part.still);
            whole.moving.extend(part.moving);
            whole.light = part.light.or(whole.light);
        }
        let textures: Vec<(String, Texture)> = whole.textures.into_iter().map(|named| named.salted(rng)).collect();
        let texture = |name: &str| textures.iter().find(|(known, _)| known == name).expect(VALID).1;
        let solid = |pieces: Vec<Piece>| Solid::new(pieces.into_iter().map(|piece| piece.part(&texture)).collect());
        let light = whole.light.expect(VALID);
        let lamp = Lamp::new(light.centre.into(), light.radius);
        let still = whole.still.into_iter().map(|Still { position, yaw_range, parts }| {
            let yaw = if yaw_range > 0.0 { rng.random_range(-yaw_range..yaw_range) } else { 0.0 };
            let pose = Pose { rotation: DQuat::from_rotation_z(yaw), position: position.into() };
            (lamp.posed(pose), solid(parts))
        });
        Self {
            still: still.collect(),
            planes: whole.planes.into_iter().map(|wall| wall.plane(&texture)).collect(),
            moving: whole.moving.into_iter().map(|moving| moving.body(&solid)).collect(),
            lamp,
            lamp_color: light.color.into(),
            ambient: light.ambient.map(DVec3::from_array),
            has_sky: light.sky,
        }
    }
}

impl Named {
    fn salted(self, rng: &mut ChaCha8Rng) -> (String, Texture) {
        let colors = self.colors.map(DVec3::from_array);
        (self.name, Texture { pattern: self.pattern, size: self.size, colors, salt: rng.random() })
    }
}

impl Wall {
    fn plane(self, texture: &impl Fn(&str) -> Texture) -> Plane {
        let mut texture = texture(&self.texture);
        texture.salt ^= self.salt;
        let reach = self.reach.unwrap_or(f64::INFINITY);
        Plane { normal: self.normal.into(), offset: self.offset, reach, texture }
    }
}

impl Piece {
    fn part(self, texture: &impl Fn(&str) -> Texture) -> Part {
        let turn = together(&self.turn);
        Part { shape: self.shape, position: self.position.into(), turn, paint: texture(&self.texture) }
    }
}

impl Moving {
    fn body(self, solid: &impl Fn(Vec<Piece>) -> Solid) -> MovingBody {
        let motion = Motion {
            path: self.path,
            axis: DVec3::from(self.axis).normalize(),
            turn: self.turn.unwrap_or(Turn::Steady { rate: 0.0, acceleration: 0.0 }),
            orientation: together(&self.orientation),
            zero: 0.0,
            speed: 1.0,
        };
        MovingBody { name: self.name, solid: solid(self.parts), motion }
    }
}

fn together(rotations: &[Rotation]) -> DQuat {
    let single = |rotation: &Rotation| match *rotation {
        Rotation::X(angle) => DQuat::from_rotation_x(angle),
        Rotation::Y(angle) => DQuat::from_rotation_y(angle),
        Rotation::Z(angle) => DQuat::from_rotation_z(angle),
    };
    rotations.iter().map(single).reduce(|a, b| a * b).unwrap_or(DQuat::IDENTITY)
}

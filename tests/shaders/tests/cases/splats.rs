//! Kernels of rendering.

use gs_kernels::config::{ProjectionConfig, RasterizeConfig, Room, ShConfig};
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::error::CubeError;
use gs_kernels::cube::intersect::{Found, InstantRows, Intersections, intersect, intersect_instants};
use gs_kernels::cube::rasterize::{self, Inputs};
use gs_kernels::cube::{projection, sh};
use gs_kernels::rows::PROJECTED;

use super::{Case, On};
use crate::scenes::{Random, Scene};

pub const CASES: &[Case] = &[
    ("projection", projection),
    ("sh", sh),
    ("intersect", intersected),
    ("rasterize", rasterized),
    ("rasterize many channels", of_many_channels),
    ("rasterize most channels", of_most_channels),
    ("instants", instants),
];

/// Gaussians: two cubes of rows, the second not full.
const COUNT: usize = 300;

fn projection(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let scene = Scene::<f32>::random(COUNT, 1);
    let [means, quats, log_scales, viewmat] =
        [&scene.means, &scene.quats, &scene.log_scales, &scene.viewmat].map(|values| on.up(values));
    let v = on.list(2, COUNT * PROJECTED, -1.0, 1.0);
    let mut made = Vec::new();
    for (antialiased, of_pose) in [(false, true), (true, false)] {
        let config = ProjectionConfig { antialiased, ..scene.config };
        let rows = projection::forward(on.client, &means, &quats, &log_scales, &viewmat, &config)?;
        let found =
            projection::backward(on.client, &means, &quats, &log_scales, &viewmat, &config, &rows, &v, of_pose)?;
        made.extend([rows, found.means, found.quats, found.log_scales]);
        made.extend(found.viewmat);
    }
    Ok(made)
}

fn sh(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let scene = Scene::<f32>::random(COUNT, 3);
    let [means, viewmat, rows] = [&scene.means, &scene.viewmat, &scene.project()].map(|values| on.up(values));
    let v = on.list(4, COUNT * 3, -1.0, 1.0);
    let mut made = Vec::new();
    let stored = [(0, 1, true), (1, 4, true), (2, 9, false), (3, 16, true), (1, 16, true), (0, 9, false)];
    for (degree, coefficients, of_pose) in stored {
        let config = ShConfig { degree, coefficients };
        let values = on.list(5, COUNT * 3 * coefficients, -0.6, 0.6);
        made.push(sh::forward(on.client, &means, &values, &viewmat, &rows, &config)?);
        let found = sh::backward(on.client, &means, &values, &viewmat, &rows, &config, &v, of_pose)?;
        made.extend([found.means, found.sh]);
        made.extend(found.viewmat);
    }
    Ok(made)
}

/// A scene's rows on a device.
struct Rows {
    projected: Buffer,
    opacities: Buffer,
    features: Buffer,
    size: [u32; 2],
    channels: usize,
}

impl Rows {
    fn of(on: &On, count: usize, channels: usize) -> Self {
        Self::of_scene(on, Scene::random(count, 6), channels)
    }

    /// Gaussians that are large and hide each other.
    fn opaque(on: &On, count: usize, channels: usize) -> Self {
        let mut scene = Scene::random(count, 6);
        scene.log_scales.iter_mut().for_each(|scale| *scale += 1.5);
        scene.logits.iter_mut().for_each(|logit| *logit += 4.0);
        Self::of_scene(on, scene, channels)
    }

    fn of_scene(on: &On, mut scene: Scene<f32>, channels: usize) -> Self {
        let count = scene.count();
        // Some are behind the camera.
        scene.means.iter_mut().skip(2).step_by(3 * 17).for_each(|z| *z = -1.0);
        Self {
            projected: on.up(&scene.project()),
            opacities: on.up(&scene.opacities()),
            features: on.list(7, count * channels, 0.0, 1.0),
            size: [scene.config.width, scene.config.height],
            channels,
        }
    }

    fn found(&self, on: &On, room: Option<usize>) -> Result<Found, CubeError> {
        let Self { projected, opacities, features, size, channels } = self;
        intersect(on.client, projected, opacities, features, *size, *channels, room)
    }
}

fn lists(found: Intersections) -> [Buffer; 4] {
    [found.tile_offsets, found.gaussian_ids, found.gaussian_offsets, found.positions]
}

fn intersected(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (rows, mut made) = (Rows::of(on, COUNT, 3), Vec::new());
    // The number is read; there is more room than pairs; there is too little.
    for room in [None, Some(9000), Some(40)] {
        let found = rows.found(on, room)?;
        made.extend(found.words.clone());
        made.extend(lists(found.lists));
    }
    Ok(made)
}

/// The image and all gradients, in launches of at most `pair_bytes`.
fn rendered(
    on: &On,
    rows: &Rows,
    lists: &Intersections,
    depth: bool,
    of_background: bool,
    pair_bytes: usize,
) -> Result<Vec<Buffer>, CubeError> {
    let Rows { projected, opacities, features, size: [width, height], channels } = rows;
    let config = RasterizeConfig { width: *width, height: *height, channels: *channels, depth };
    let background = &on.list(8, *channels, 0.0, 1.0);
    let inputs = Inputs { projected, opacities, features, background, lists };
    let shown = rasterize::forward(on.client, &config, &inputs, false)?.output;
    let image = rasterize::forward(on.client, &config, &inputs, true)?;
    let saved = image.saved.expect("was asked for");
    let v = on.list(9, image.output.len(), -1.0, 1.0);
    let found = rasterize::backward_within(on.client, &config, &inputs, &saved, &v, of_background, pair_bytes)?;
    let mut made = vec![shown, image.output, found.projected, found.opacities, found.features, found.screen];
    made.extend(found.background);
    Ok(made)
}

fn rasterized(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let rows = Rows::of(on, 160, 3);
    let without_room = rows.found(on, None)?.lists;
    let mut made = rendered(on, &rows, &without_room, true, true, rasterize::PAIR_BYTES)?;
    let opaque = Rows::opaque(on, 160, 3);
    let long = opaque.found(on, None)?.lists;
    made.extend(rendered(on, &opaque, &long, false, true, rasterize::PAIR_BYTES)?);
    let within = rows.found(on, Some(6000))?.lists;
    made.extend(rendered(on, &rows, &within, false, false, rasterize::PAIR_BYTES)?);
    // Several launches of the backward pass.
    made.extend(rendered(on, &rows, &without_room, false, true, 8 << 10)?);
    Ok(made)
}

fn of_many_channels(on: &On) -> Result<Vec<Buffer>, CubeError> {
    // A row of one channel, and one of many.
    Ok([of_channels(on, &Rows::of(on, 40, 1))?, of_channels(on, &Rows::of(on, 40, 20))?].concat())
}

/// Rows so long that a batch has one word of Gaussians, that loops over channels are not unrolled, and that a row is
/// added piece by piece; lists are longer than a batch, and pixels end before them.
fn of_most_channels(on: &On) -> Result<Vec<Buffer>, CubeError> {
    of_channels(on, &Rows::opaque(on, 80, 50))
}

fn of_channels(on: &On, rows: &Rows) -> Result<Vec<Buffer>, CubeError> {
    let found = rows.found(on, None)?.lists;
    rendered(on, rows, &found, rows.channels == 1, true, rasterize::PAIR_BYTES)
}

fn instants(on: &On) -> Result<Vec<Buffer>, CubeError> {
    let (scene, further) = (Scene::<f32>::random(120, 10), 3);
    let moving: Vec<u32> = (0..120).filter(|row| row % 9 == 8).collect();
    let (mut projected, mut opacities) = (scene.project(), scene.opacities());
    let steps = Random::new(11).values::<f32>(2 * moving.len(), -6.0, 6.0);
    for instant in 1..=further {
        for (k, row) in moving.iter().map(|row| *row as usize).enumerate() {
            let mut at = projected[row * PROJECTED..][..PROJECTED].to_vec();
            at[0] += instant as f32 * steps[2 * k];
            at[1] += instant as f32 * steps[2 * k + 1];
            projected.extend(at);
            opacities.push(opacities[row]);
        }
    }
    let rows = Rows {
        features: on.list(12, opacities.len() * 3, 0.0, 1.0),
        projected: on.up(&projected),
        opacities: on.up(&opacities),
        size: [scene.config.width, scene.config.height],
        channels: 3,
    };
    let mut made = Vec::new();
    for room in [None, Some(Room { pairs: 9000, tiles: 60 }), Some(Room { pairs: 40, tiles: 12 })] {
        let Rows { projected, opacities, features, size, channels } = &rows;
        let table = InstantRows { projected, opacities, features, scene: 120, moving: &on.up_u32(&moving) };
        let found = intersect_instants(on.client, table, *size, *channels, room)?;
        made.extend(found.words.into_iter().flatten());
        made.extend([found.shares, found.places.clone()]);
        let lists = placed(found.tile_offsets, &found.places, on);
        let found = Intersections {
            tile_offsets: lists,
            placed: found.places.len(),
            gaussian_ids: found.gaussian_ids,
            gaussian_offsets: found.gaussian_offsets,
            positions: found.positions,
        };
        made.extend(rendered(on, &rows, &found, true, true, rasterize::PAIR_BYTES)?);
        let [_, ids, offsets, positions] = self::lists(found);
        made.extend([ids, offsets, positions]);
    }
    Ok(made)
}

/// The offsets of lists with the lists' tiles behind them, as gs-burn joins both.
fn placed(tile_offsets: Buffer, places: &Buffer, on: &On) -> Buffer {
    let read = |buffer: &Buffer| buffer.download::<u32>(on.client).expect("the device works");
    on.up_u32(&[read(&tile_offsets), read(places)].concat())
}

//! The motion of a scene on the host, and a scene from it.

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::Gaussians;
use gs_models::DynamicScene;
use gs_models::basis::{self, Form, MotionBasis};
use gs_splats::{Carried, Carrier, Keys, Law, Motion, Series, SeriesLaw, Shape, Splats, TimeFunction};

use super::host::{gaussians_of, splats_of};

/// How a scene moves: as series where it is that, else by `count` key frames spread over the recording. `None` where
/// nothing moves.
pub fn motion_of(scene: &dyn DynamicScene, middle: f64, count: usize) -> Option<Motion> {
    let span = scene.span()?;
    if let Some(basis) = scene.basis() {
        return Some(Motion { span, middle, law: Law::Series(series_of(&basis)), rows: basis.rows });
    }
    let count = count.max(2);
    let step = (span[1] - span[0]) / (count - 1) as f64;
    let times: Vec<f64> = (0..count).map(|index| span[0] + step * index as f64).collect();
    let frames: Vec<Splats> = scene.at_times(&times).iter().map(|gaussians| splats_of(gaussians, None)).collect();
    let first = &frames[0];
    let differs = |frame: &Splats, row: usize| {
        frame.means[row] != first.means[row]
            || frame.quats[row] != first.quats[row]
            || frame.log_scales[row] != first.log_scales[row]
    };
    let moves = |row: &u32| frames.iter().any(|frame| differs(frame, *row as usize));
    let rows: Vec<u32> = (0..first.len() as u32).filter(moves).collect();
    let grows = frames.iter().any(|frame| frame.log_scales != first.log_scales);
    fn picked<'a, T: Copy + 'a>(
        frames: &'a [Splats],
        rows: &'a [u32],
        values: fn(&'a Splats) -> &'a [T],
    ) -> impl Iterator<Item = T> + 'a {
        frames.iter().flat_map(move |frame| rows.iter().map(move |row| values(frame)[*row as usize]))
    }
    let keys = Keys {
        means: picked(&frames, &rows, |frame| frame.means.as_slice()).collect(),
        quats: picked(&frames, &rows, |frame| frame.quats.as_slice()).collect(),
        log_scales: picked(&frames, if grows { rows.as_slice() } else { &[] }, |frame| frame.log_scales.as_slice())
            .collect(),
        times,
    };
    Some(Motion { span, middle, rows, law: Law::Keys(keys) })
}

/// A motion as the series of a file. Nothing is lost but the rounding to `f32`.
fn series_of(basis: &MotionBasis) -> SeriesLaw {
    let series = |functions: &[basis::TimeFunction], vectors: &Tensor<2>| Series {
        functions: functions.iter().map(time_function).collect(),
        vectors: if functions.is_empty() { Vec::new() } else { vectors_of(vectors) },
    };
    SeriesLaw {
        t0: basis.t0,
        half: basis.half,
        position: series(&basis.functions, &basis.position),
        rotation: series(&basis.turns, &basis.rotation),
        carried: basis.carried.as_ref().map(carried_of),
    }
}

fn carried_of(carried: &basis::Carried) -> Carried {
    let of_body = |body: &basis::Carrier| {
        let rows = vectors_of(&body.position);
        let width = rows.len() / 4;
        Carrier {
            centre: body.centre,
            scale: body.scale,
            position: (0..width).map(|j| [0, 1, 2, 3].map(|row| rows[row * width + j])).collect(),
            rotation: if body.rotation.dims()[1] == 0 { Vec::new() } else { vectors_of(&body.rotation) },
        }
    };
    let bodies = carried.bodies.iter().map(of_body).collect();
    Carried { body_of: carried.body_of.clone(), own: carried.own.clone(), bodies }
}

/// A function of time as files name it.
pub fn time_function(function: &basis::TimeFunction) -> TimeFunction {
    // Rates of a scene are whole numbers of half oscillations a window.
    let wave = |power, rate: f64, sine| Shape::Wave { power, n: (rate / std::f64::consts::PI).round() as u32, sine };
    let shape = match function.form {
        Form::Cosine { power, rate: 0.0 } => Shape::Power(power),
        Form::Cosine { power, rate } => wave(power, rate, false),
        Form::Sine { power, rate } => wave(power, rate, true),
        Form::Ramp { near, far } => Shape::Ramp { near, far },
    };
    match function.past {
        Some(past) => TimeFunction::returning(shape, past.line, past.fade),
        None => TimeFunction { shape, beyond: None },
    }
}

/// The vectors of all rows, `[M, 3 J]` as `[M * J]`.
fn vectors_of(table: &Tensor<2>) -> Vec<[f32; 3]> {
    let values: Vec<f32> = table.to_data().iter::<f32>().collect();
    values.as_chunks::<3>().0.to_vec()
}

/// A scene that was read from a file with its motion.
#[derive(Debug, Clone)]
pub struct MotionScene {
    middle: Splats,
    motion: Motion,
    device: Device,
}

impl MotionScene {
    /// Gaussians of the motion's middle, and how they move.
    pub fn new(middle: Splats, motion: Motion, device: &Device) -> Self {
        Self { middle, motion, device: device.clone() }
    }
}

impl DynamicScene for MotionScene {
    fn at(&self, t: f64) -> Gaussians {
        gaussians_of(&self.motion.at(&self.middle, t), &self.device)
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        let mut velocities = vec![[0.0; 3]; self.middle.len()];
        for (row, velocity) in self.motion.rows.iter().zip(self.motion.velocities(t)) {
            velocities[*row as usize] = velocity;
        }
        let data = TensorData::new(velocities.as_flattened().to_vec(), [velocities.len(), 3]);
        Tensor::from_data(data, &self.device)
    }

    fn span(&self) -> Option<[f64; 2]> {
        (!self.motion.rows.is_empty()).then_some(self.motion.span)
    }
}

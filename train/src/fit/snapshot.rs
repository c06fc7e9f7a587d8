//! The state of a training as named tensors and a JSON text: the content of a checkpoint, independent of files.

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::adam::{Adam, Moments};
use gs_burn::{Gaussians, NamedParameter, named_parameters, try_map_parameters};
use serde::{Deserialize, Serialize};

use super::camera_paths::{CameraPaths, PathFrame};
use super::correction::{Correction, CorrectionFrame};
use super::density::{Adaptive, Density};
use super::facts::SceneFacts;
use super::parameters::Group;
use super::region::Region;
use super::saved::Saved;
use super::trainer::{Model, Trainer};
use super::training::Training;
use crate::config::{FitConfig, Strategy};

/// A tensor on its way to or from a file.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its values, flat; read from the device one column at a time, so that only one copy exists.
    tensor: Tensor<1>,
    /// Its shape.
    shape: Vec<usize>,
}

impl Column {
    /// A tensor of any rank.
    pub fn new<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        // Not `reshape`: in Burn a 0 there means "as before", and a motion of order 0 has no columns.
        Self { tensor: tensor.flatten(0, D - 1), shape }
    }

    /// A tensor of `shape` from its table.
    pub fn of_table(table: Tensor<2>, shape: Vec<usize>) -> Self {
        Self { tensor: table.flatten(0, 1), shape }
    }

    /// Its shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its values on the host, flat.
    pub fn values(&self) -> TensorData {
        self.tensor.to_data()
    }
}

/// The counters of any training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Steps taken.
    pub step: usize,
    /// Steps or contributions skipped.
    pub skipped: usize,
    /// Updates of the optimiser.
    pub updates: u64,
}

impl Counters {
    /// The counters of a training.
    pub fn of<N: Module>(training: &Training<N>) -> Self {
        Self { step: training.step, skipped: training.skipped, updates: training.adam.updates }
    }

    /// The counters of a snapshot.
    ///
    /// # Errors
    /// A sentence if they are not in this version's format.
    pub fn read(source: &dyn Source) -> Result<Self, String> {
        serde_json::from_value(source.notes().clone()).map_err(|error| error.to_string())
    }
}

/// The JSON text beside the tensors of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Notes {
    /// The counters.
    #[serde(flatten)]
    pub counters: Counters,
    /// Values fixed by the data set.
    facts: FactBits,
    /// The structure of the photos' corrections, if there are any.
    #[serde(default)]
    correction: Option<CorrectionFrame>,
    /// The structure of the cameras' paths, if they are learned.
    #[serde(default)]
    cameras: Option<PathFrame>,
    /// The method's frame.
    #[serde(default)]
    pub frame: serde_json::Value,
}

/// [`SceneFacts`] as bits: a JSON number may lose the last one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct FactBits {
    extent: u64,
    near: u64,
    background: [u32; 3],
    subject_distance: Option<u64>,
    #[serde(default)]
    pixel: Option<u64>,
    #[serde(default)]
    region: Option<[[u32; 3]; 2]>,
}

impl FactBits {
    fn of(facts: &SceneFacts) -> Self {
        Self {
            extent: facts.extent.to_bits(),
            near: facts.near.to_bits(),
            background: facts.background.map(f32::to_bits),
            subject_distance: facts.subject_distance.map(f64::to_bits),
            pixel: facts.pixel.map(f64::to_bits),
            region: facts.region.map(|region| region.corners.map(|corner| corner.map(f32::to_bits))),
        }
    }
}

impl Notes {
    /// The notes of a snapshot.
    ///
    /// # Errors
    /// A sentence if they are not in this version's format.
    pub fn read(source: &dyn Source) -> Result<Self, String> {
        serde_json::from_value(source.notes().clone()).map_err(|error| error.to_string())
    }

    /// Values fixed by the data set.
    pub fn facts(&self) -> SceneFacts {
        SceneFacts {
            extent: f64::from_bits(self.facts.extent),
            near: f64::from_bits(self.facts.near),
            background: self.facts.background.map(f32::from_bits),
            subject_distance: self.facts.subject_distance.map(f64::from_bits),
            pixel: self.facts.pixel.map(f64::from_bits),
            region: self
                .facts
                .region
                .map(|corners| Region { corners: corners.map(|corner| corner.map(f32::from_bits)) }),
        }
    }
}

/// The state of a training.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// Tensors by name.
    pub columns: BTreeMap<String, Column>,
    /// The JSON text beside them: [`Counters`] or, of a scene, [`Notes`].
    pub notes: serde_json::Value,
}

/// A snapshot being read: the notes, and tensors by name on demand.
pub trait Source {
    /// The notes.
    fn notes(&self) -> &serde_json::Value;

    /// Names of all tensors.
    fn names(&self) -> Vec<String>;

    /// The values and the shape of a tensor.
    ///
    /// # Errors
    /// A sentence if there is none of this name, or it is damaged.
    fn read(&self, name: &str) -> Result<(Vec<f32>, Vec<usize>), String>;
}

/// Prefixes of the names of tensors.
const MODEL: &str = "model.";
const FIRST: &str = "first.";
const SECOND: &str = "second.";
const DENSITY: [&str; 2] = ["density.gradient", "density.views"];

impl Snapshot {
    /// The state of a training of any module: its learned tensors, the moments of its optimiser and its counters.
    pub fn of_training<N: Module>(training: &Training<N>) -> Self {
        let mut columns = BTreeMap::new();
        for NamedParameter { path, shape, table } in learned(training.module()) {
            columns.insert(format!("{MODEL}{path}"), Column::of_table(table, shape));
        }
        for (path, moments) in &training.adam.moments {
            columns.insert(format!("{FIRST}{path}"), Column::new(moments.first.clone()));
            columns.insert(format!("{SECOND}{path}"), Column::new(moments.second.clone()));
        }
        Self { columns, notes: serde_json::to_value(Counters::of(training)).expect("numbers are JSON") }
    }

    /// The state of `trainer`.
    pub fn of<M: Saved>(trainer: &Trainer<M>) -> Self {
        let mut columns = Self::of_training(trainer).columns;
        if let Density::Adaptive(adaptive) = &trainer.density {
            for (name, tensor) in DENSITY.into_iter().zip([&adaptive.gradient, &adaptive.views]) {
                columns.insert(name.into(), Column::new(tensor.clone()));
            }
        }
        let notes = Notes {
            counters: Counters::of(trainer),
            facts: FactBits::of(&trainer.facts),
            correction: trainer.model().correction.as_ref().map(Correction::frame),
            cameras: trainer.model().cameras.as_ref().map(CameraPaths::frame),
            frame: trainer.method().frame(),
        };
        Self { columns, notes: serde_json::to_value(notes).expect("notes are JSON") }
    }
}

/// The learned tensors of a module. Running statistics are left out: batch norm takes those of the snippet at hand.
pub fn learned<N: Module>(module: &N) -> impl Iterator<Item = NamedParameter> + use<N> {
    named_parameters(module).into_iter().filter(|parameter| is_learned(&parameter.path))
}

fn is_learned(path: &str) -> bool {
    !path.ends_with("running_mean") && !path.ends_with("running_var")
}

/// The Gaussians of a snapshot on `device` (without autodiff).
///
/// # Errors
/// A sentence when their tensors are damaged or do not fit each other.
pub fn read_gaussians(source: &dyn Source, device: &Device) -> Result<Gaussians, String> {
    let mut groups = Vec::new();
    let mut rows = None;
    for group in Group::ALL {
        let (values, shape) = source.read(&format!("{MODEL}{}", group.path()))?;
        let found = *shape.first().ok_or_else(|| format!("{} has no dimension", group.name()))?;
        let columns: usize = shape[1..].iter().product();
        if *rows.get_or_insert(found) != found {
            return Err(format!("{} has {found} rows, others another number", group.name()));
        }
        if !(0..=3).any(|degree| group.columns(degree) == columns) {
            return Err(format!("{} has {columns} columns", group.name()));
        }
        groups.push(Tensor::<2>::from_data(TensorData::new(values, [found, columns]), device));
    }
    let groups: [Tensor<2>; 5] = groups.try_into().expect("one per group");
    Ok(super::parameters::gaussians(groups))
}

/// The method's module, for `gaussians` Gaussians, on `device` (without autodiff).
///
/// # Errors
/// A sentence if the frame or a tensor is damaged, or they do not fit each other.
pub fn read_method<M: Saved>(
    source: &dyn Source,
    gaussians: usize,
    config: &FitConfig<M::Config>,
    device: &Device,
) -> Result<M, String> {
    let shell = M::from_frame(&Notes::read(source)?.frame, config, device)?;
    // Rows and columns are those of the file.
    let fits = |found: &[usize], own: &[usize]| found.len() == own.len() && found.iter().skip(2).eq(own.iter().skip(2));
    let method = read_module(source, "method.", shell, fits, device)?;
    method.fits(gaussians)?;
    Ok(method)
}

/// The corrections of the photos, on `device` (without autodiff); `None` if the photos agree.
///
/// # Errors
/// A sentence if a tensor is missing or damaged.
pub fn read_correction(source: &dyn Source, device: &Device) -> Result<Option<Correction>, String> {
    let Some(frame) = Notes::read(source)?.correction else { return Ok(None) };
    let shell = Correction::of_frame(&frame, device);
    read_module(source, "correction.", shell, |found, own| found == own, device).map(Some)
}

/// The poses of the cameras, on `device` (without autodiff); `None` if they are as given.
///
/// # Errors
/// A sentence if a tensor is missing or damaged.
pub fn read_cameras(source: &dyn Source, device: &Device) -> Result<Option<CameraPaths>, String> {
    let Some(frame) = Notes::read(source)?.cameras else { return Ok(None) };
    let shell = CameraPaths::of_frame(&frame, device);
    read_module(source, "cameras.", shell, |found, own| found == own, device).map(Some)
}

/// The module whose parameters have `prefix` before their paths: `shell` with the values of the file. `fits` compares
/// the shape in the file with that in the shell.
///
/// # Errors
/// A sentence if a tensor is missing or damaged, or has another shape.
pub fn read_module<N: Module>(
    source: &dyn Source,
    prefix: &str,
    shell: N,
    fits: impl Fn(&[usize], &[usize]) -> bool,
    device: &Device,
) -> Result<N, String> {
    try_map_parameters(shell, |NamedParameter { path, shape: own, table }| {
        if !is_learned(&path) {
            return Ok(table);
        }
        let name = format!("{MODEL}{prefix}{path}");
        let (values, shape) = source.read(&name)?;
        if !fits(&shape, &own) {
            return Err(format!("{name} has the shape {shape:?}, the configuration says {own:?}"));
        }
        let columns = shape[1..].iter().product::<usize>();
        Ok(Tensor::from_data(TensorData::new(values, [shape[0], columns]), device))
    })
}

/// The training of a module that was read, on `device`.
///
/// # Errors
/// A sentence when counters or moments are missing or damaged, or do not fit the module.
pub fn read_training<N: Module>(source: &dyn Source, module: N, device: &Device) -> Result<Training<N>, String> {
    let Counters { step, skipped, updates } = Counters::read(source)?;
    let adam = read_moments(source, &module, updates, device)?;
    let mut training = Training::new(module);
    (training.adam, training.step, training.skipped) = (adam, step, skipped);
    Ok(training)
}

/// The trainer of a snapshot, on `device` (without autodiff).
///
/// # Errors
/// A sentence when a part is missing or damaged, or parts do not fit each other.
pub fn restore<M: Saved>(
    source: &dyn Source,
    config: &FitConfig<M::Config>,
    device: &Device,
) -> Result<Trainer<M>, String> {
    let gaussians = read_gaussians(source, device)?;
    let rows = gaussians.len();
    let method = read_method::<M>(source, rows, config, device)?;
    let correction = read_correction(source, device)?;
    let cameras = read_cameras(source, device)?;
    let training = read_training(source, Model { gaussians, correction, cameras, method }, device)?;
    let mut trainer = Trainer::from_training(training, Notes::read(source)?.facts(), config);
    if config.density.strategy == Strategy::Default {
        let statistic = |name: &str| -> Result<Tensor<1>, String> {
            let (values, shape) = source.read(name)?;
            if shape != [rows] {
                return Err(format!("density statistics of another number of Gaussians than {rows}"));
            }
            Ok(Tensor::from_data(TensorData::new(values, [rows]), device))
        };
        trainer.density =
            Density::Adaptive(Adaptive { gradient: statistic(DENSITY[0])?, views: statistic(DENSITY[1])? });
    }
    Ok(trainer)
}

fn read_moments<N: Module>(source: &dyn Source, module: &N, updates: u64, device: &Device) -> Result<Adam, String> {
    let tables: BTreeMap<String, [usize; 2]> =
        learned(module).map(|parameter| (parameter.path, parameter.table.dims())).collect();
    let mut adam = Adam { updates, ..Adam::new() };
    for name in source.names() {
        let Some(path) = name.strip_prefix(FIRST) else { continue };
        let expected = tables.get(path).ok_or_else(|| format!("{name} belongs to nothing that is learned"))?;
        let moment = |prefix: &str| -> Result<Tensor<2>, String> {
            let (values, shape) = source.read(&format!("{prefix}{path}"))?;
            if shape != *expected {
                return Err(format!("{path} and its moments have different shapes"));
            }
            Ok(Tensor::from_data(TensorData::new(values, *expected), device))
        };
        let moments = Moments { first: moment(FIRST)?, second: moment(SECOND)? };
        adam.moments.insert(path.into(), moments);
    }
    Ok(adam)
}

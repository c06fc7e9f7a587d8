//! The state of a training as named tensors and a JSON text: the content of a checkpoint, independent of files.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::adam::{Adam, Moments};
use gs_burn::limits::{largest_buffer, third_band_apart};
use gs_burn::sh_coefficients::{join_columns, split_columns};
use gs_burn::{Gaussians, NamedParameter, ShCoefficients, named_parameters, try_map_parameters};
use gs_kernels::cpu::sh::MAX_COEFFICIENTS;
use serde::{Deserialize, Serialize};

use super::density::{Adaptive, Density};
use super::facts::SceneFacts;
use super::method::Method;
use super::parameters::{Group, to_host};
use super::trainer::{Model, Trainer, keeps_third_apart};
use crate::config::{FitConfig, Strategy};

/// A tensor on its way to or from a file.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its values, flat; read from the device one column at a time, so that only one copy exists.
    tensor: Tensor<1>,
    /// Its shape.
    shape: Vec<usize>,
    /// The rest of each row and its number of values, where no buffer of the device holds whole rows.
    rest: Option<(Tensor<1>, usize)>,
}

impl Column {
    /// A tensor of any rank.
    pub fn new<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        // Not `reshape`: in Burn a 0 there means "as before", and a motion of order 0 has no columns.
        Self { tensor: tensor.flatten(0, D - 1), shape, rest: None }
    }

    /// A tensor of `shape` from its table.
    pub fn of_table(table: Tensor<2>, shape: Vec<usize>) -> Self {
        Self { tensor: table.flatten(0, 1), shape, rest: None }
    }

    /// The same rows, each followed by its row of `other`.
    fn beside(mut self, other: Self) -> Self {
        self.shape[1] += other.shape[1];
        Self { rest: Some((other.tensor, other.shape[1..].iter().product())), ..self }
    }

    /// Its shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its values on the host, flat.
    pub fn values(&self) -> TensorData {
        let Some((rest, columns)) = &self.rest else { return self.tensor.to_data() };
        let own = self.shape[1..].iter().product::<usize>() - columns;
        let joined = join_columns(&to_host(self.tensor.clone()), own, &to_host(rest.clone()), *columns);
        let length = joined.len();
        TensorData::new(joined, [length])
    }
}

/// The JSON text beside the tensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Notes {
    /// Steps taken.
    pub step: usize,
    /// Steps skipped.
    pub skipped: usize,
    /// Updates of the optimiser.
    pub updates: u64,
    /// Values fixed by the data set.
    facts: FactBits,
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
}

impl FactBits {
    fn of(facts: &SceneFacts) -> Self {
        Self {
            extent: facts.extent.to_bits(),
            near: facts.near.to_bits(),
            background: facts.background.map(f32::to_bits),
            subject_distance: facts.subject_distance.map(f64::to_bits),
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
        }
    }
}

/// The state of a training.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// Tensors by name.
    pub columns: BTreeMap<String, Column>,
    /// [`Notes`].
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
    /// The state of `trainer`.
    pub fn of<M: Method>(trainer: &Trainer<M>) -> Self {
        let mut columns = BTreeMap::new();
        for NamedParameter { path, shape, table } in named_parameters(trainer.model()) {
            columns.insert(format!("{MODEL}{path}"), Column::of_table(table, shape));
        }
        for (path, moments) in &trainer.adam.moments {
            columns.insert(format!("{FIRST}{path}"), Column::new(moments.first.clone()));
            columns.insert(format!("{SECOND}{path}"), Column::new(moments.second.clone()));
        }
        if let Density::Adaptive(adaptive) = &trainer.density {
            for (name, tensor) in DENSITY.into_iter().zip([&adaptive.gradient, &adaptive.views]) {
                columns.insert(name.into(), Column::new(tensor.clone()));
            }
        }
        join_bands(&mut columns);
        let notes = Notes {
            step: trainer.step,
            skipped: trainer.skipped,
            updates: trainer.adam.updates,
            facts: FactBits::of(&trainer.facts),
            frame: trainer.method().frame(),
        };
        Self { columns, notes: serde_json::to_value(notes).expect("notes are JSON") }
    }
}

/// Puts the third band of the SH coefficients and of their moments beside the others: a file does not depend on the device's buffers.
fn join_bands(columns: &mut BTreeMap<String, Column>) {
    for prefix in [MODEL, FIRST, SECOND] {
        if let Some(third) = columns.remove(&format!("{prefix}{}", Group::ShThird.path())) {
            let name = format!("{prefix}{}", Group::Sh.path());
            let sh = columns.remove(&name).expect("a third band apart has the others beside it");
            columns.insert(name, sh.beside(third));
        }
    }
}

/// The Gaussians of a snapshot on `device` (without autodiff).
///
/// # Errors
/// A sentence when their tensors are damaged or do not fit each other.
pub fn read_gaussians(source: &dyn Source, device: &Device) -> Result<Gaussians, String> {
    let largest = largest_buffer(device);
    gaussians_apart(source, device, |rows| third_band_apart(largest, rows as u64, MAX_COEFFICIENTS))
}

/// [`read_gaussians`] with the third band of their SH coefficients apart if `apart` says so of their number.
fn gaussians_apart(source: &dyn Source, device: &Device, apart: impl Fn(usize) -> bool) -> Result<Gaussians, String> {
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
        groups.push((values, [found, columns]));
    }
    let groups: [(Vec<f32>, [usize; 2]); 5] = groups.try_into().expect("one per group");
    let [means, quats, log_scales, opacity, (sh, [rows, columns])] = groups;
    let [means, quats, log_scales, opacity] = [means, quats, log_scales, opacity]
        .map(|(values, shape)| Tensor::<2>::from_data(TensorData::new(values, shape), device));
    let sh = ShCoefficients::from_host(sh, rows, columns / 3, apart(rows), device);
    Ok(Gaussians::from_tensors(means, quats, log_scales, opacity.squeeze_dim(1), sh))
}

/// The method's module, for `gaussians` Gaussians, on `device` (without autodiff).
///
/// # Errors
/// A sentence if the frame or a tensor is damaged, or they do not fit each other.
pub fn read_method<M: Method>(
    source: &dyn Source,
    gaussians: usize,
    config: &FitConfig<M::Config>,
    device: &Device,
) -> Result<M, String> {
    let shell = M::from_frame(&Notes::read(source)?.frame, config, device)?;
    let method = try_map_parameters(shell, |parameter| {
        let name = format!("{MODEL}method.{}", parameter.path);
        let (values, shape) = source.read(&name)?;
        let same = shape.len() == parameter.shape.len() && shape.iter().skip(2).eq(parameter.shape.iter().skip(2));
        if !same {
            return Err(format!("{name} has shape {shape:?}"));
        }
        let columns = shape[1..].iter().product::<usize>();
        Ok(Tensor::from_data(TensorData::new(values, [shape[0], columns]), device))
    })?;
    method.fits(gaussians)?;
    Ok(method)
}

/// The trainer of a snapshot, on `device` (without autodiff).
///
/// # Errors
/// A sentence when a part is missing or damaged, or parts do not fit each other.
pub fn restore<M: Method>(
    source: &dyn Source,
    config: &FitConfig<M::Config>,
    device: &Device,
) -> Result<Trainer<M>, String> {
    restore_within(source, config, device, largest_buffer(device))
}

/// [`restore`] where a buffer holds at most `largest_buffer` bytes.
///
/// # Errors
/// As [`restore`].
pub fn restore_within<M: Method>(
    source: &dyn Source,
    config: &FitConfig<M::Config>,
    device: &Device,
    largest_buffer: Option<u64>,
) -> Result<Trainer<M>, String> {
    let gaussians = gaussians_apart(source, device, |rows| keeps_third_apart(largest_buffer, rows, config))?;
    let rows = gaussians.len();
    let method = read_method::<M>(source, rows, config, device)?;
    let notes = Notes::read(source)?;
    let mut trainer = Trainer::from_model(Model { gaussians, method }, notes.facts(), config);
    trainer.largest_buffer = largest_buffer;
    trainer.step = notes.step;
    trainer.skipped = notes.skipped;
    trainer.adam = read_moments(source, trainer.model(), notes.updates, device)?;
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

fn read_moments<M: Method>(
    source: &dyn Source,
    model: &Model<M>,
    updates: u64,
    device: &Device,
) -> Result<Adam, String> {
    let tables: BTreeMap<String, [usize; 2]> =
        named_parameters(model).into_iter().map(|parameter| (parameter.path, parameter.table.dims())).collect();
    let mut adam = Adam { updates, ..Adam::new() };
    for name in source.names() {
        let Some(path) = name.strip_prefix(FIRST) else { continue };
        let [rows, own] = *tables.get(path).ok_or_else(|| format!("{name} belongs to nothing that is learned"))?;
        // The file has the third band of the SH coefficients beside the others.
        let third = tables.get(Group::ShThird.path()).filter(|_| path == Group::Sh.path()).map(|[_, columns]| *columns);
        let tensor = |values, columns| Tensor::<2>::from_data(TensorData::new(values, [rows, columns]), device);
        let moment = |prefix: &str| -> Result<(Tensor<2>, Option<Tensor<2>>), String> {
            let (values, shape) = source.read(&format!("{prefix}{path}"))?;
            if shape != [rows, own + third.unwrap_or(0)] {
                return Err(format!("{path} and its moments have different shapes"));
            }
            Ok(match third {
                None => (tensor(values, own), None),
                Some(third) => {
                    let [values, rest] = split_columns(&values, own, third);
                    (tensor(values, own), Some(tensor(rest, third)))
                }
            })
        };
        let ((first, first_third), (second, second_third)) = (moment(FIRST)?, moment(SECOND)?);
        adam.moments.insert(path.into(), Moments { first, second });
        if let Some((first, second)) = first_third.zip(second_third) {
            adam.moments.insert(Group::ShThird.path().into(), Moments { first, second });
        }
    }
    Ok(adam)
}

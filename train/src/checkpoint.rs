//! The whole state of a run in one safetensors file: parameters, moments, density statistics, step and configuration.
//!
//! A checkpoint appears under its name only when it is whole and on the disk: it is written beside it, synchronised, renamed,
//! and the folder synchronised. Random numbers need no state (see [`crate::random`]), the order of views follows from seed and
//! step, and no clock enters, so equal runs write equal files.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use burn::tensor::{Device, Tensor, TensorData};
use glam::DVec3;
use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, View};
use serde::{Deserialize, Serialize};

use crate::data::Fingerprint;
use crate::density::{Adaptive, Density, Strategy};
use crate::experiment::{Config, ConfigError};
use crate::optimiser::Optimiser;
use crate::parameters::{Group, Parameters};
use crate::step::Trainer;
use crate::taylormode::saved::{self, SavedMotion};

/// What the metadata calls the format.
const FORMAT: &str = "gsburn-checkpoint";

/// Changes whenever an older program could misread a file.
const VERSION: &str = "3";

/// When the state is saved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CheckpointConfig {
    /// Steps from one checkpoint to the next, which is also what a killed run loses at most; 0: only at the end.
    pub every: usize,
    /// Checkpoints kept; older ones are removed once a new one is whole.
    pub keep: usize,
}

impl Default for CheckpointConfig {
    fn default() -> Self {
        Self { every: 1000, keep: 1 }
    }
}

/// A saved run.
#[derive(Debug, Clone)]
pub struct Checkpoint {
    /// The state after [`Trainer::step`] steps.
    pub trainer: Trainer,
    /// The resolved configuration.
    pub config: Config,
    /// The data set's path.
    pub dataset: PathBuf,
    /// What was subtracted from every position of the data set's world.
    pub origin: DVec3,
    /// The views it was trained on; `None` in files of older programs.
    pub views: Option<Fingerprint>,
}

/// What can be wrong with a checkpoint; one sentence each.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// It cannot be opened or read.
    #[error("{}: cannot read the checkpoint: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's answer.
        source: io::Error,
    },
    /// It cannot be written; nothing was changed.
    #[error("{}: cannot write the checkpoint: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's answer.
        source: io::Error,
    },
    /// It is no checkpoint at all.
    #[error("{}: expected a gsburn checkpoint, found {found}", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
        /// What it looks like.
        found: String,
    },
    /// It was written by another version of the format.
    #[error("{}: expected checkpoint format {VERSION}, found format {found}: it was written by another version of gsburn", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The version it names.
        found: String,
    },
    /// It was a checkpoint and is cut short or changed.
    #[error("{}: the checkpoint is damaged: {found}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        found: String,
    },
    /// Its configuration is not one of this version.
    #[error("{}: the checkpoint's configuration does not fit this version of gsburn: {source}", path.display())]
    Config {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        source: ConfigError,
    },
}

impl Checkpoint {
    /// Writes the checkpoint atomically.
    ///
    /// # Errors
    /// When it cannot be written (a full disk, for one); then nothing is left behind and older checkpoints are untouched.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let failed = |source| CheckpointError::Write { path: path.into(), source };
        let columns: Vec<(String, Column)> = self.columns();
        let content = serde_json::json!({ "version": VERSION, "content": self.metadata(&columns) });
        let metadata = HashMap::from([(FORMAT.to_string(), content.to_string())]);
        let temporary = path.with_extension("part");
        let written = safetensors::serialize_to_file(columns, Some(metadata), &temporary)
            .map_err(|error| match error {
                SafeTensorError::IoError(error) => error,
                other => io::Error::other(other.to_string()),
            })
            .and_then(|()| File::open(&temporary)?.sync_all())
            .and_then(|()| fs::rename(&temporary, path))
            .and_then(|()| sync_folder(path));
        written.map_err(|error| {
            // The write error is the one to report.
            let _ = fs::remove_file(&temporary);
            failed(error)
        })
    }

    /// Reads a checkpoint to `device` (without autodiff).
    ///
    /// # Errors
    /// A sentence that names the file and says what is wrong with it.
    pub fn load(path: &Path, device: &Device) -> Result<Self, CheckpointError> {
        let bytes = fs::read(path).map_err(|source| CheckpointError::Read { path: path.into(), source })?;
        let damaged = |found: String| CheckpointError::Damaged { path: path.into(), found };
        let metadata = read_metadata(&bytes, path)?;
        let file = SafeTensors::deserialize(&bytes)
            .map_err(|error| damaged(format!("{error} ({} bytes in the file)", bytes.len())))?;
        let reader = Reader { file, crc32: &metadata.crc32, path };

        let config = Config::from_toml(&metadata.config, "configuration")
            .map_err(|source| CheckpointError::Config { path: path.into(), source })?;
        let groups = |prefix: &str| -> Result<[Tensor<2>; 5], CheckpointError> {
            let mut tensors = Vec::new();
            for group in Group::ALL {
                tensors.push(reader.tensor::<2>(&format!("{prefix}.{}", group.name()), device)?);
            }
            Ok(tensors.try_into().expect("one tensor per group"))
        };
        let (parameters, first, second) = (groups("parameters")?, groups("first")?, groups("second")?);
        check_shapes(&parameters, &first, &second).map_err(damaged)?;
        let rows = parameters[0].dims()[0];
        let density = match config.density.strategy {
            Strategy::None => Density::None,
            Strategy::Mcmc => Density::Mcmc,
            Strategy::Default => {
                let (gradient, views) =
                    (reader.tensor::<1>("density.gradient", device)?, reader.tensor::<1>("density.views", device)?);
                if gradient.dims() != [rows] || views.dims() != [rows] {
                    return Err(damaged(format!("density statistics of another number of Gaussians than {rows}")));
                }
                Density::Adaptive(Adaptive { gradient, views })
            }
        };
        let motion = match &metadata.motion {
            None => None,
            Some(saved) => Some(saved.restore(|name| reader.tensor::<2>(name, device), damaged, rows)?),
        };
        let trainer = Trainer {
            motion,
            parameters: Parameters::new(parameters),
            optimiser: Optimiser { first, second, updates: metadata.updates },
            density,
            step: metadata.step,
            skipped: metadata.skipped,
            extent: f64::from_bits(metadata.extent_bits),
        };
        Ok(Self {
            trainer,
            config,
            dataset: metadata.dataset,
            origin: DVec3::from(metadata.origin_bits.map(f64::from_bits)),
            views: metadata.views,
        })
    }

    fn columns(&self) -> Vec<(String, Column)> {
        let trainer = &self.trainer;
        let mut columns = Vec::new();
        for group in Group::ALL {
            let mut add = |prefix: &str, tensor: &Tensor<2>| {
                columns.push((format!("{prefix}.{}", group.name()), Column::new(tensor.clone())));
            };
            add("parameters", trainer.parameters.get(group));
            add("first", &trainer.optimiser.first[group as usize]);
            add("second", &trainer.optimiser.second[group as usize]);
        }
        if let Density::Adaptive(adaptive) = &trainer.density {
            columns.push(("density.gradient".into(), Column::new(adaptive.gradient.clone())));
            columns.push(("density.views".into(), Column::new(adaptive.views.clone())));
        }
        if let Some(state) = &trainer.motion {
            columns.extend(saved::columns(state).into_iter().map(|(name, tensor)| (name, Column::new(tensor))));
        }
        columns
    }

    fn metadata(&self, columns: &[(String, Column)]) -> Metadata {
        let trainer = &self.trainer;
        Metadata {
            step: trainer.step,
            skipped: trainer.skipped,
            updates: trainer.optimiser.updates,
            extent_bits: trainer.extent.to_bits(),
            origin_bits: self.origin.to_array().map(f64::to_bits),
            views: self.views,
            dataset: self.dataset.clone(),
            config: self.config.to_toml(),
            motion: trainer.motion.as_ref().map(SavedMotion::of),
            crc32: columns.iter().map(|(name, column)| (name.clone(), crc32fast::hash(&column.data()))).collect(),
        }
    }
}

/// What a checkpoint says beside its tensors. It is one JSON text under one key of the safetensors header, because the
/// header's own keys come in no fixed order and equal runs must write equal files.
#[derive(Debug, Serialize, Deserialize)]
struct Metadata {
    step: usize,
    skipped: usize,
    updates: u64,
    /// As bits, because JSON numbers may lose the last one.
    extent_bits: u64,
    origin_bits: [u64; 3],
    #[serde(default)]
    views: Option<Fingerprint>,
    dataset: PathBuf,
    config: String,
    /// `None` for a static scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    motion: Option<SavedMotion>,
    /// Checksum of each tensor.
    crc32: BTreeMap<String, u32>,
}

/// A tensor on its way into the file; read from the device only when it is its turn, so that one copy exists at a time.
struct Column {
    tensor: Tensor<1>,
    shape: Vec<usize>,
}

impl Column {
    fn new<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        // Not `reshape`: to Burn a 0 there means "as before", and a motion of order 0 has no columns.
        Self { tensor: tensor.flatten(0, D - 1), shape }
    }
}

impl View for Column {
    fn dtype(&self) -> Dtype {
        Dtype::F32
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        let data = self.tensor.to_data();
        let values = data.as_slice::<f32>().expect("tensors of this crate hold f32");
        if cfg!(target_endian = "little") {
            return Cow::Owned(data.as_bytes().to_vec());
        }
        Cow::Owned(values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    fn data_len(&self) -> usize {
        4 * self.shape.iter().product::<usize>()
    }
}

/// A file whose header was understood.
struct Reader<'a> {
    file: SafeTensors<'a>,
    crc32: &'a BTreeMap<String, u32>,
    path: &'a Path,
}

impl Reader<'_> {
    fn damaged(&self, found: String) -> CheckpointError {
        CheckpointError::Damaged { path: self.path.into(), found }
    }

    fn tensor<const D: usize>(&self, name: &str, device: &Device) -> Result<Tensor<D>, CheckpointError> {
        let view = self.file.tensor(name).map_err(|error| self.damaged(error.to_string()))?;
        let shape: [usize; D] = match view.shape().try_into() {
            Ok(shape) if view.dtype() == Dtype::F32 => shape,
            _ => return Err(self.damaged(format!("{name} has type {:?} and shape {:?}", view.dtype(), view.shape()))),
        };
        if self.crc32.get(name) != Some(&crc32fast::hash(view.data())) {
            return Err(self.damaged(format!("the checksum of {name} does not match its content")));
        }
        let values: Vec<f32> = view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        Ok(Tensor::from_data(TensorData::new(values, shape), device))
    }
}

/// The metadata of a file that calls itself a checkpoint of this version. The header is read by hand, so that a file cut
/// short still says what it was.
fn read_metadata(bytes: &[u8], path: &Path) -> Result<Metadata, CheckpointError> {
    let foreign = |found: &str| CheckpointError::NotACheckpoint { path: path.into(), found: found.into() };
    let damaged = |found: String| CheckpointError::Damaged { path: path.into(), found };
    let Some((length, rest)) = bytes.split_first_chunk::<8>() else {
        return Err(foreign(&format!("a file of {} bytes", bytes.len())));
    };
    let length = u64::from_le_bytes(*length);
    let Some(header) = usize::try_from(length).ok().and_then(|length| rest.get(..length)) else {
        // A header that starts like JSON but goes on beyond the end belongs to a safetensors file cut short.
        return Err(if rest.first() == Some(&b'{') && length < 1 << 30 {
            damaged(format!("it is cut short within its header ({} bytes in the file)", bytes.len()))
        } else {
            foreign("another kind of file")
        });
    };
    #[derive(Deserialize)]
    struct Header {
        #[serde(rename = "__metadata__", default)]
        metadata: HashMap<String, String>,
        #[serde(flatten)]
        tensors: HashMap<String, serde_json::Value>,
    }
    #[derive(Deserialize)]
    struct Versioned {
        version: String,
        content: serde_json::Value,
    }
    let header: Header = serde_json::from_slice(header).map_err(|_| foreign("another kind of file"))?;
    let text = header.metadata.get(FORMAT).ok_or_else(|| foreign("a safetensors file of something else"))?;
    let versioned: Versioned = serde_json::from_str(text).map_err(|error| damaged(error.to_string()))?;
    if versioned.version != VERSION {
        return Err(CheckpointError::Version { path: path.into(), found: versioned.version });
    }
    let ends = header.tensors.values().filter_map(|tensor| tensor["data_offsets"][1].as_u64());
    let whole = 8 + length.saturating_add(ends.max().unwrap_or(0));
    if (bytes.len() as u64) < whole {
        return Err(damaged(format!("it is cut short, expected {whole} bytes, found {}", bytes.len())));
    }
    serde_json::from_value(versioned.content).map_err(|error| damaged(error.to_string()))
}

/// Each group must have its columns, and all the same number of rows.
fn check_shapes(parameters: &[Tensor<2>; 5], first: &[Tensor<2>; 5], second: &[Tensor<2>; 5]) -> Result<(), String> {
    let rows = parameters[0].dims()[0];
    for group in Group::ALL {
        let i = group as usize;
        let [found, columns] = parameters[i].dims();
        if found != rows || first[i].dims() != [rows, columns] || second[i].dims() != [rows, columns] {
            return Err(format!("{} and its moments do not all have {rows} rows", group.name()));
        }
        if !(0..=3).any(|degree| group.columns(degree) == columns) {
            return Err(format!("{} has {columns} columns", group.name()));
        }
    }
    Ok(())
}

/// Makes a rename in the folder of `path` survive a power cut.
fn sync_folder(path: &Path) -> io::Result<()> {
    // Only Unix lets a folder be opened as a file; elsewhere the file system orders the rename itself.
    if cfg!(unix)
        && let Some(folder) = path.parent()
    {
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

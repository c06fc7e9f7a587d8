//! A checkpoint is one safetensors file: named tensors with their checksums, and one JSON text with everything else. It
//! knows tensors by name alone, independent of the method.
//!
//! The file is written under a temporary name and renamed, so an existing file is complete; its checksums detect
//! damage.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;
use gs_base::atomic::PartialFile;
use gs_base::guarded;
use safetensors::tensor::{Metadata as Layout, View};
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use serde::{Deserialize, Serialize};

use super::fingerprint::Fingerprint;
use crate::fit::snapshot::{Column, Snapshot, Source};

/// The key of the metadata that marks a file as a checkpoint.
const FORMAT: &str = "gsburn-checkpoint";

/// Largest checkpoint, bytes: 100 million Gaussians with their moments take 60 GB, and the file is read whole.
const FILE_MAX: u64 = 64 << 30;

/// Changes whenever an older program could misread a file.
const VERSION: &str = "4";

/// The run that wrote a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Name of the pipeline.
    pub pipeline: String,
    /// The resolved configuration as TOML.
    pub config: String,
    /// The data set's path.
    pub dataset: PathBuf,
    /// Position that was subtracted from the data set's world, as bits: a JSON number may lose the last one.
    origin_bits: [u64; 3],
    /// The views it was trained on.
    pub views: Fingerprint,
    /// The convention by which the data set's poses were read, if it is not its format's own.
    #[serde(default)]
    pub poses: Option<String>,
}

impl Origin {
    /// A run on `dataset`, with `origin` subtracted from its world.
    pub fn new(pipeline: &str, config: String, dataset: PathBuf, origin: DVec3, views: Fingerprint) -> Self {
        let origin_bits = origin.to_array().map(f64::to_bits);
        Self { pipeline: pipeline.into(), config, dataset, origin_bits, views, poses: None }
    }

    /// Position that was subtracted from the data set's world, scene units.
    pub fn world(&self) -> DVec3 {
        DVec3::from(self.origin_bits.map(f64::from_bits))
    }
}

/// A checkpoint that was read.
#[derive(Debug)]
pub struct Checkpoint {
    /// The run it is from.
    pub origin: Origin,
    /// The file.
    pub path: PathBuf,
    notes: serde_json::Value,
    crc32: BTreeMap<String, u32>,
    layout: Layout,
    bytes: Vec<u8>,
    /// Offset of the tensors in the file, bytes.
    begin: usize,
}

/// An error of a checkpoint; the message is one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// It cannot be opened or read, or is no file.
    #[error(transparent)]
    Read(#[from] gs_base::FileError),
    /// It cannot be written; nothing was changed.
    #[error("{}: cannot write the checkpoint: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The operating system's answer.
        source: io::Error,
    },
    /// The file is not a checkpoint.
    #[error("{}: expected a gsburn checkpoint, found {found}", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
        /// A description of the file.
        found: String,
    },
    /// It was written by another version of the format.
    #[error("{}: expected checkpoint format {VERSION}, found format {found}: {writer}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The version it names.
        found: String,
        /// The program that wrote it.
        writer: String,
    },
    /// The file is a checkpoint, but cut short or changed.
    #[error("{}: the checkpoint is damaged: {found}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The mismatch.
        found: String,
    },
}

impl CheckpointError {
    /// Whether the file was a checkpoint of this version, or may have been, and cannot be read any more.
    pub fn is_damage(&self) -> bool {
        matches!(self, Self::Damaged { .. } | Self::NotACheckpoint { .. })
    }
}

/// Writes a checkpoint atomically.
///
/// # Errors
/// When it cannot be written (a full disk, for one); then no partial file is left and older checkpoints are untouched.
pub fn save(path: &Path, origin: &Origin, snapshot: &Snapshot) -> Result<(), CheckpointError> {
    let columns: Vec<(String, Column)> = snapshot.columns.iter().map(|(name, c)| (name.clone(), c.clone())).collect();
    let content = Metadata {
        program: env!("CARGO_PKG_VERSION").into(),
        origin: origin.clone(),
        notes: snapshot.notes.clone(),
        crc32: columns.iter().map(|(name, column)| (name.clone(), crc32fast::hash(&column.data()))).collect(),
    };
    let content = serde_json::json!({ "version": VERSION, "content": content });
    let metadata = HashMap::from([(FORMAT.to_string(), content.to_string())]);
    let partial = PartialFile::named(path.with_extension("part"), path);
    // The permissions that all other files of a run get; safetensors makes its file for the owner alone.
    let permissions = File::create(partial.temporary()).and_then(|file| Ok(file.metadata()?.permissions()));
    let written = permissions
        .map_err(SafeTensorError::IoError)
        .and_then(|permissions| {
            safetensors::serialize_to_file(columns, Some(metadata), partial.temporary())?;
            Ok(fs::set_permissions(partial.temporary(), permissions)?)
        })
        .map_err(|error| match error {
            SafeTensorError::IoError(error) => error,
            other => io::Error::other(other.to_string()),
        })
        .and_then(|()| partial.finish())
        .and_then(|()| sync_folder(path));
    written.map_err(|source| CheckpointError::Write { path: path.into(), source })
}

impl Checkpoint {
    /// Opens a checkpoint; tensors are checked when they are read.
    ///
    /// # Errors
    /// A sentence that names the file and the error.
    pub fn load(path: &Path) -> Result<Self, CheckpointError> {
        Self::parse(path, guarded::read(path, FILE_MAX)?)
    }

    /// A checkpoint of these bytes; `path` names them in errors.
    ///
    /// # Errors
    /// A sentence that names the file and the error.
    pub fn parse(path: &Path, bytes: Vec<u8>) -> Result<Self, CheckpointError> {
        let Metadata { origin, notes, crc32, .. } = read_metadata(&bytes, path)?;
        let damaged = |error: SafeTensorError| CheckpointError::Damaged {
            path: path.into(),
            found: format!("{error} ({} bytes in the file)", bytes.len()),
        };
        let (header, layout) = SafeTensors::read_metadata(&bytes).map_err(damaged)?;
        // The header's length, eight bytes, precedes the header.
        let begin = header + 8;
        Ok(Self { origin, path: path.into(), notes, crc32, layout, begin, bytes })
    }

    /// The checkpoint, when every tensor has the checksum that was written with it.
    ///
    /// # Errors
    /// [`CheckpointError::Damaged`], with the first tensor that has another.
    pub fn whole(self) -> Result<Self, CheckpointError> {
        let found = self.crc32.keys().find_map(|name| self.tensor(name).err());
        found.map_or(Ok(()), |found| Err(self.damaged(found)))?;
        Ok(self)
    }

    /// The bytes and the shape of a tensor whose checksum is right.
    fn tensor(&self, name: &str) -> Result<(&[u8], &[usize]), String> {
        let info = self.layout.info(name).ok_or_else(|| format!("it has no tensor {name}"))?;
        let (from, to) = (self.begin + info.data_offsets.0, self.begin + info.data_offsets.1);
        let data = self.bytes.get(from..to).ok_or_else(|| format!("{name} lies outside of the file"))?;
        if info.dtype != Dtype::F32 {
            return Err(format!("{name} has type {:?}", info.dtype));
        }
        if self.crc32.get(name) != Some(&crc32fast::hash(data)) {
            return Err(format!("the checksum of {name} does not match its content"));
        }
        Ok((data, &info.shape))
    }

    /// The error that something found in the file is.
    pub fn damaged(&self, found: String) -> CheckpointError {
        CheckpointError::Damaged { path: self.path.clone(), found }
    }
}

impl Source for Checkpoint {
    fn notes(&self) -> &serde_json::Value {
        &self.notes
    }

    fn names(&self) -> Vec<String> {
        self.crc32.keys().cloned().collect()
    }

    fn read(&self, name: &str) -> Result<(Vec<f32>, Vec<usize>), String> {
        let (data, shape) = self.tensor(name)?;
        Ok((data.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect(), shape.to_vec()))
    }
}

/// The metadata of a checkpoint: one JSON text under one key of the safetensors header, because the order of the
/// header's own keys is not fixed and equal runs must write equal files.
#[derive(Debug, Serialize, Deserialize)]
struct Metadata {
    /// Version of the program that wrote it.
    program: String,
    origin: Origin,
    notes: serde_json::Value,
    /// Checksum of each tensor.
    crc32: BTreeMap<String, u32>,
}

impl View for Column {
    fn dtype(&self) -> Dtype {
        Dtype::F32
    }

    fn shape(&self) -> &[usize] {
        Column::shape(self)
    }

    fn data(&self) -> Cow<'_, [u8]> {
        let data = self.values();
        let values = data.as_slice::<f32>().expect("tensors of this crate hold f32");
        if cfg!(target_endian = "little") {
            return Cow::Owned(data.as_bytes().to_vec());
        }
        Cow::Owned(values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    fn data_len(&self) -> usize {
        4 * Column::shape(self).iter().product::<usize>()
    }
}

/// The metadata of a file that is marked as a checkpoint of this version. The header is parsed by hand, so that a
/// truncated file can still be identified.
fn read_metadata(bytes: &[u8], path: &Path) -> Result<Metadata, CheckpointError> {
    let foreign = |found: &str| CheckpointError::NotACheckpoint { path: path.into(), found: found.into() };
    let damaged = |found: String| CheckpointError::Damaged { path: path.into(), found };
    let Some((length, rest)) = bytes.split_first_chunk::<8>() else {
        return Err(foreign(&format!("a file of {} bytes", bytes.len())));
    };
    let length = u64::from_le_bytes(*length);
    let Some(header) = usize::try_from(length).ok().and_then(|length| rest.get(..length)) else {
        // A header that starts like JSON but continues beyond the end belongs to a truncated safetensors file.
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
        let writer = match versioned.content["program"].as_str() {
            Some(program) => format!("it was written by gsburn {program}, this is {}", env!("CARGO_PKG_VERSION")),
            // Before format 4 the metadata did not name the program.
            None => "it was written by an earlier gsburn, before pipelines had configurations of their own; that program reads it".into(),
        };
        return Err(CheckpointError::Version { path: path.into(), found: versioned.version, writer });
    }
    let ends = header.tensors.values().filter_map(|tensor| tensor["data_offsets"][1].as_u64());
    let whole = 8 + length.saturating_add(ends.max().unwrap_or(0));
    if (bytes.len() as u64) < whole {
        return Err(damaged(format!("it is cut short, expected {whole} bytes, found {}", bytes.len())));
    }
    serde_json::from_value(versioned.content).map_err(|error| damaged(error.to_string()))
}

/// Makes a rename in the folder of `path` durable across a power failure.
fn sync_folder(path: &Path) -> io::Result<()> {
    // Only Unix opens a folder as a file; elsewhere the file system orders the rename itself.
    if cfg!(unix)
        && let Some(folder) = path.parent()
    {
        // The parent of a bare file name is empty and means the current folder.
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

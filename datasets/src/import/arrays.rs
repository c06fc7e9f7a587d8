//! Named NumPy arrays: a `.npz` archive, or a folder of `.npy` files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use gs_base::guarded;
use gs_base::npy::{self, Array};
use zip::ZipArchive;

use super::texts;
use crate::error::DatasetError;
use crate::findings::Findings;

/// Bytes of each array's head that are looked at to tell a pickled array: NumPy pads a usual header to 128 bytes.
const HEAD: u64 = 1024;

/// Most entries of an archive, or files of a folder, that are looked at. A dictionary of predictions has about a dozen.
const ENTRIES_MAX: usize = 4096;

/// Longest archive, bytes. The arrays of 100 views with all keys take about 3 GB.
const ARCHIVE_MAX: u64 = 16 << 30;

/// Arrays by name. They are read when asked for, because a dictionary holds photos and points that nobody needs here.
pub(super) struct Arrays {
    /// The archive or the folder.
    path: PathBuf,
    places: BTreeMap<String, Place>,
    archive: Option<ZipArchive<BufReader<File>>>,
}

/// Where an array is.
enum Place {
    /// The index of an entry.
    Entry(usize),
    File(PathBuf),
}

impl Arrays {
    /// Lists the arrays of an archive or a folder. Pickled arrays are left out with a warning, since only Python can read them.
    ///
    /// # Errors
    /// When there is no archive or folder at `path`, when it is cut short, or when it holds no array.
    pub fn open(path: &Path, findings: &mut Findings) -> Result<Self, DatasetError> {
        let metadata = std::fs::metadata(path).map_err(|error| DatasetError::read(path, error))?;
        let mut arrays = if metadata.is_dir() { Self::folder(path)? } else { Self::archive(path)? };
        let pickled: Vec<String> = arrays.names().into_iter().filter(|name| arrays.is_pickled(name)).collect();
        for name in pickled {
            arrays.places.remove(&name);
            findings.warn(format!("{}: `{name}` is a pickled object array and is skipped", path.display()));
        }
        if arrays.places.is_empty() {
            let found = "none".to_string();
            return Err(DatasetError::malformed(path, "content", "arrays as numpy.savez writes them", found));
        }
        Ok(arrays)
    }

    fn folder(path: &Path) -> Result<Self, DatasetError> {
        let mut places = BTreeMap::new();
        let entries = std::fs::read_dir(path).map_err(|error| DatasetError::read(path, error))?;
        for file in entries.take(ENTRIES_MAX).flatten().map(|entry| entry.path()) {
            let is_array = file.extension().is_some_and(|end| end.eq_ignore_ascii_case("npy"));
            let name = file.file_stem().and_then(|stem| stem.to_str()).map(str::to_string);
            if let (true, Some(name)) = (is_array, name) {
                places.insert(name, Place::File(file));
            }
        }
        Ok(Self { path: path.to_path_buf(), places, archive: None })
    }

    fn archive(path: &Path) -> Result<Self, DatasetError> {
        let file = guarded::open_regular(path, ARCHIVE_MAX)?;
        let archive = ZipArchive::new(BufReader::new(file)).map_err(|error| {
            DatasetError::malformed(path, "archive", "a whole .npz file, or a folder of .npy files", error.to_string())
        })?;
        if archive.len() > ENTRIES_MAX {
            let expected = format!("at most {ENTRIES_MAX} entries");
            return Err(DatasetError::malformed(path, "archive", expected, archive.len().to_string()));
        }
        let mut places = BTreeMap::new();
        for index in 0..archive.len() {
            let Some(Ok(name)) = archive.name_for_index(index) else { continue };
            if let Some(name) = name.strip_suffix(".npy") {
                places.insert(name.to_string(), Place::Entry(index));
            }
        }
        Ok(Self { path: path.to_path_buf(), places, archive: Some(archive) })
    }

    /// The archive or the folder, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The names of all arrays, sorted.
    pub fn names(&self) -> Vec<String> {
        self.places.keys().cloned().collect()
    }

    /// The array of numbers under a name; `None` where there is none.
    ///
    /// # Errors
    /// When its bytes are cut short, too many, or hold no numbers.
    pub fn numbers(&mut self, name: &str) -> Result<Option<Array>, DatasetError> {
        let Some(bytes) = self.bytes(name, guarded::IMAGE_MAX)? else { return Ok(None) };
        Ok(Some(npy::parse(&self.label(name), &bytes)?))
    }

    /// The list of texts under a name; `None` where there is none, or where it holds no texts.
    ///
    /// # Errors
    /// When its bytes are cut short or too many.
    pub fn texts(&mut self, name: &str) -> Result<Option<Vec<String>>, DatasetError> {
        Ok(self.bytes(name, texts::BYTES_MAX)?.and_then(|bytes| texts::parse(&bytes)))
    }

    /// "predictions.npz/depth.npy", for messages.
    pub fn label(&self, name: &str) -> PathBuf {
        self.path.join(format!("{name}.npy"))
    }

    fn is_pickled(&mut self, name: &str) -> bool {
        self.start(name, HEAD).is_ok_and(|head| texts::descr(&head).is_some_and(|descr| descr.contains('O')))
    }

    /// All bytes of an array.
    fn bytes(&mut self, name: &str, limit: u64) -> Result<Option<Vec<u8>>, DatasetError> {
        if !self.places.contains_key(name) {
            return Ok(None);
        }
        let bytes = self.start(name, limit + 1)?;
        if bytes.len() as u64 > limit {
            let found = "more".to_string();
            return Err(DatasetError::malformed(&self.label(name), "length", format!("at most {limit} bytes"), found));
        }
        Ok(Some(bytes))
    }

    /// At most `limit` first bytes of an array. Memory grows with what arrives, so that a header cannot ask for it.
    fn start(&mut self, name: &str, limit: u64) -> Result<Vec<u8>, DatasetError> {
        let label = self.label(name);
        let unreadable = |error| DatasetError::read(&label, error);
        let mut bytes = Vec::new();
        match (self.places.get(name), &mut self.archive) {
            (Some(Place::File(file)), _) => {
                let file = guarded::open_regular(file, guarded::IMAGE_MAX)?;
                file.take(limit).read_to_end(&mut bytes).map_err(unreadable)?;
            }
            (Some(Place::Entry(index)), Some(archive)) => {
                let entry = archive.by_index(*index).map_err(|error| {
                    DatasetError::malformed(&label, "archive", "an entry that is stored or deflated", error.to_string())
                })?;
                entry.take(limit).read_to_end(&mut bytes).map_err(unreadable)?;
            }
            _ => {}
        }
        Ok(bytes)
    }
}

//! Record batches of a Feather file, and columns over all of them.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use gs_base::guarded;
use gs_datasets::DatasetError;

use super::flat::{Flat, array};
use super::lz4;
use super::schema::{Field, Kind, fields};

/// Longest file, bytes. A sweep of Argoverse 2 has 1 MB, the annotations of a log 2 MB.
const FILE_MAX: u64 = 256 << 20;

/// Most rows of a file, and most record batches: five million points, 65 536 a batch.
const ROWS_MAX: usize = 8 << 20;
const BATCHES_MAX: usize = 4096;

/// The first and last bytes of a file.
const MAGIC: &[u8] = b"ARROW1";

/// Bytes of the structs Block, FieldNode and Buffer.
const BLOCK: usize = 24;
const BUFFER: usize = 16;

/// A file in memory.
pub(crate) struct Feather {
    path: PathBuf,
    bytes: Vec<u8>,
}

/// Rows of a file that lie together.
struct Batch<'a> {
    rows: usize,
    /// Start and length of each buffer in `body`.
    buffers: Vec<(usize, usize)>,
    body: &'a [u8],
    is_compressed: bool,
}

impl Feather {
    /// Reads a file.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        Ok(Self { path: path.to_path_buf(), bytes: guarded::read(path, FILE_MAX)? })
    }

    fn wrong(&self, location: &str, expected: &str, found: impl Into<String>) -> DatasetError {
        DatasetError::malformed(&self.path, location, expected, found)
    }

    /// A column of numbers.
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, DatasetError> {
        self.values(name, number)
    }

    /// A column of integers, exact to 64 bits.
    pub fn integers(&self, name: &str) -> Result<Vec<i64>, DatasetError> {
        self.values(name, |kind, bytes, row| integer(kind, bytes, row).filter(|_| kind != Kind::Bool))
    }

    /// A column by a function of its type, bytes for all rows, and a row.
    fn values<T>(&self, name: &str, value: impl Fn(Kind, &[u8], usize) -> Option<T>) -> Result<Vec<T>, DatasetError> {
        let mut all = Vec::new();
        self.column(name, |kind, batch, first| {
            let need = kind.bytes(batch.rows).ok_or("a column of another type")?;
            let data = batch.buffer(first + 1)?;
            if data.len() < need {
                return Err(format!("{} bytes for {} rows", data.len(), batch.rows));
            }
            for row in 0..batch.rows {
                all.push(value(kind, &data, row).ok_or("a column of another type")?);
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// A column of strings.
    pub fn texts(&self, name: &str) -> Result<Vec<String>, DatasetError> {
        let mut all = Vec::new();
        self.column(name, |kind, batch, first| {
            let Kind::Text(size) = kind else { return Err("a column of another type".to_string()) };
            let (offsets, data) = (batch.buffer(first + 1)?, batch.buffer(first + 2)?);
            for row in 0..batch.rows {
                let at = |index: usize| match size {
                    4 => array(&offsets, 4 * index).map(|b| u32::from_le_bytes(b) as usize),
                    _ => array(&offsets, 8 * index).and_then(|b| usize::try_from(u64::from_le_bytes(b)).ok()),
                };
                let range = at(row).zip(at(row + 1)).and_then(|(start, end)| data.get(start..end));
                let text = range.and_then(|bytes| std::str::from_utf8(bytes).ok()).ok_or("a string beyond the end")?;
                all.push(text.to_string());
            }
            Ok(())
        })?;
        Ok(all)
    }

    /// Visits a column batch by batch: its type, the batch, and the place of its first buffer.
    fn column(
        &self,
        name: &str,
        mut visit: impl FnMut(Kind, &Batch<'_>, usize) -> Result<(), String>,
    ) -> Result<(), DatasetError> {
        let (fields, batches) =
            self.parts().map_err(|found| self.wrong("the file", "a Feather file of flat columns", found))?;
        let Some(index) = fields.iter().position(|field| field.name == name) else {
            let known: Vec<&str> = fields.iter().map(|field| field.name).collect();
            return Err(self.wrong("the columns", &format!("a column {name:?}"), format!("{known:?}")));
        };
        let first = fields[..index].iter().map(|field| field.kind.buffers()).sum();
        for batch in &batches {
            visit(fields[index].kind, batch, first)
                .map_err(|found| self.wrong(&format!("column {name:?}"), "values for every row", found))?;
        }
        Ok(())
    }

    /// The columns and the batches.
    fn parts(&self) -> Result<(Vec<Field<'_>>, Vec<Batch<'_>>), String> {
        let bytes = &self.bytes[..];
        let trailer = bytes.len().checked_sub(MAGIC.len() + 4).ok_or("too few bytes")?;
        if !bytes.starts_with(MAGIC) || !bytes.ends_with(MAGIC) {
            return Err("no ARROW1 at both ends".to_string());
        }
        let length = array(bytes, trailer).map_or(0, u32::from_le_bytes) as usize;
        let start = trailer.checked_sub(length).ok_or("a footer longer than the file")?;
        let footer = Flat::root(&bytes[start..trailer]).ok_or("no footer")?;
        let fields = fields(&footer.table(1).ok_or("no schema")?)?;
        let blocks = footer.vector(3).filter(|blocks| blocks.count <= BATCHES_MAX).ok_or("no list of batches")?;
        let mut rows = 0;
        let mut batches = Vec::new();
        for index in 0..blocks.count {
            let place = (blocks.i64(index, BLOCK, 0), blocks.i32(index, BLOCK, 8), blocks.i64(index, BLOCK, 16));
            let (Some(offset), Some(head), Some(body)) = place else {
                return Err("a batch beyond the end".to_string());
            };
            let batch = self.batch(offset, i64::from(head), body, &fields)?;
            rows += batch.rows;
            if rows > ROWS_MAX {
                return Err(format!("more than {ROWS_MAX} rows"));
            }
            batches.push(batch);
        }
        Ok((fields, batches))
    }

    fn batch(&self, offset: i64, head: i64, body: i64, fields: &[Field<'_>]) -> Result<Batch<'_>, String> {
        let size = |value: i64| usize::try_from(value).map_err(|_| "a batch of a negative size".to_string());
        let (offset, head, body) = (size(offset)?, size(head)?, size(body)?);
        let end = offset.checked_add(head).and_then(|at| Some((at, at.checked_add(body)?)));
        let (middle, end) = end.filter(|(_, end)| *end <= self.bytes.len()).ok_or("a batch beyond the end")?;
        // A continuation mark and the length of the message come first.
        let message = self.bytes.get(offset + 8..middle).and_then(Flat::root).ok_or("a batch without a message")?;
        let record = message.table(2).filter(|_| message.u8(1) == 3).ok_or("a message that is no batch")?;
        let compression = record.table(3);
        if compression.is_some_and(|kind| kind.u8(0) != 0) {
            return Err("a compression other than LZ4 frames".to_string());
        }
        let list = record.vector(2).ok_or("a batch without buffers")?;
        let expected: usize = fields.iter().map(|field| field.kind.buffers()).sum();
        if list.count != expected {
            return Err(format!("{} buffers where the columns have {expected}", list.count));
        }
        let buffers = (0..list.count)
            .map(|index| {
                Some((list.i64(index, BUFFER, 0)?.try_into().ok()?, list.i64(index, BUFFER, 8)?.try_into().ok()?))
            })
            .collect::<Option<Vec<(usize, usize)>>>()
            .ok_or("a buffer beyond the end")?;
        let rows = size(record.i64(0))?;
        if rows > ROWS_MAX {
            return Err(format!("{rows} rows in a batch"));
        }
        Ok(Batch { rows, buffers, body: &self.bytes[middle..end], is_compressed: compression.is_some() })
    }
}

impl Batch<'_> {
    /// A buffer, unpacked.
    fn buffer(&self, index: usize) -> Result<Cow<'_, [u8]>, String> {
        let place = self.buffers.get(index).and_then(|(start, length)| Some(*start..start.checked_add(*length)?));
        let bytes = place.and_then(|range| self.body.get(range)).ok_or("a buffer beyond the end")?;
        if !self.is_compressed || bytes.is_empty() {
            return Ok(Cow::Borrowed(bytes));
        }
        let length = array(bytes, 0).map(i64::from_le_bytes).ok_or("a buffer without its length")?;
        if length == -1 {
            return Ok(Cow::Borrowed(&bytes[8..]));
        }
        let content = usize::try_from(length).ok().and_then(|length| lz4::frame(&bytes[8..], length));
        content.map(Cow::Owned).ok_or_else(|| "a broken LZ4 frame".to_string())
    }
}

fn integer(kind: Kind, bytes: &[u8], row: usize) -> Option<i64> {
    match kind {
        Kind::Number(number) if !number.is_float() => Some(number.read_integer(&bytes[number.bytes() * row..])),
        Kind::Bool => Some(i64::from(bytes[row / 8] >> (row % 8) & 1)),
        _ => None,
    }
}

fn number(kind: Kind, bytes: &[u8], row: usize) -> Option<f64> {
    match kind {
        Kind::Number(number) if number.is_float() => Some(number.read(&bytes[number.bytes() * row..])),
        _ => integer(kind, bytes, row).map(|value| value as f64),
    }
}

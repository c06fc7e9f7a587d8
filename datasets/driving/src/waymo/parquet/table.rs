//! [`Table`]: a Parquet file, and the cells of its columns.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use bytes::Bytes;
use gs_base::guarded;
use gs_datasets::DatasetError;
use parquet::basic::Type;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};

use super::pages::Pages;
use super::thrift::{Event, structure};

/// Longest file, bytes. Images of a segment have some 330 MB.
const FILE_MAX: u64 = 16 << 30;

/// Longest footer, bytes. A table of 20 columns in four groups has 20 KB.
const FOOTER_MAX: u64 = 16 << 20;

/// Most rows. The boxes of a segment are some 20 000.
const ROWS_MAX: usize = 1 << 22;

/// Deepest nesting of columns; a list is three deep.
const SCHEMA_DEPTH_MAX: usize = 16;

/// The last bytes: the length of the footer, and the magic word.
const TAIL: u64 = 8;
const MAGIC: &[u8] = b"PAR1";

/// A Parquet file. It holds the metadata; cells are read when they are asked for.
#[derive(Debug)]
pub(crate) struct Table {
    path: PathBuf,
    metadata: ParquetMetaData,
}

/// Values of cells, in the type of the file.
#[derive(Debug)]
enum Values {
    Integers(Vec<i64>),
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
    Bytes(Vec<ByteArray>),
}

/// Cells of a column: each has any number of values, none where it is null.
#[derive(Debug)]
pub(crate) struct Cells {
    values: Values,
    /// The end of each cell among the values.
    ends: Vec<usize>,
}

impl Table {
    /// Reads the metadata of a file.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let mut file = guarded::open_regular(path, FILE_MAX)?;
        let wrong = |found: String| DatasetError::malformed(path, "the footer", "a whole Parquet file", found);
        let length = file.metadata().map_err(|error| DatasetError::read(path, error))?.len();
        if length < TAIL + MAGIC.len() as u64 {
            return Err(wrong(format!("{length} bytes")));
        }
        let tail = piece(path, &mut file, length - TAIL, TAIL as usize)?;
        let footer = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
        if &tail[4..] != MAGIC || footer > FOOTER_MAX.min(length - TAIL) {
            return Err(wrong("another end".to_string()));
        }
        let footer = piece(path, &mut file, length - TAIL - footer, footer as usize)?;
        sound(&footer).map_err(wrong)?;
        let metadata = guard(|| ParquetMetaDataReader::decode_metadata(&footer).map_err(|error| error.to_string()));
        let table = Self { path: path.to_path_buf(), metadata: metadata.map_err(wrong)? };
        table.check(length).map_err(wrong)?;
        Ok(table)
    }

    /// Holds rows and places of chunks against the file.
    fn check(&self, length: u64) -> Result<(), String> {
        let mut rows = 0_usize;
        let columns = self.metadata.file_metadata().schema_descr().num_columns();
        for group in self.metadata.row_groups() {
            let count = usize::try_from(group.num_rows()).ok().filter(|count| *count <= ROWS_MAX);
            rows += count.ok_or_else(|| format!("a group of {} rows", group.num_rows()))?;
            if group.num_columns() != columns {
                return Err(format!("a group of {} columns where the file has {columns}", group.num_columns()));
            }
            for chunk in group.columns() {
                let start = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset());
                let end = start.checked_add(chunk.compressed_size());
                let is_sound =
                    start >= 0 && chunk.compressed_size() >= 0 && end.is_some_and(|end| end as u64 <= length);
                if !is_sound {
                    return Err(format!("a column beyond the end, {} bytes from {start} on", chunk.compressed_size()));
                }
            }
        }
        if rows > ROWS_MAX { Err(format!("{rows} rows")) } else { Ok(()) }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Rows of each group.
    pub fn groups(&self) -> Vec<usize> {
        self.metadata.row_groups().iter().map(|group| group.num_rows() as usize).collect()
    }

    /// The column of a name, or of a list of that name.
    fn column(&self, name: &str) -> Option<usize> {
        let columns = self.metadata.file_metadata().schema_descr().columns();
        columns.iter().position(|column| column.path().parts().first().is_some_and(|part| part == name))
    }

    /// Cells of a column in rows of a group; the rows ascend.
    pub fn cells(
        &self,
        group: usize,
        name: &str,
        rows: impl Iterator<Item = usize> + Clone,
    ) -> Result<Cells, DatasetError> {
        let wrong = |found: String| {
            DatasetError::malformed(&self.path, format!("the column {name}"), "a readable column", found)
        };
        let column = self
            .column(name)
            .ok_or_else(|| DatasetError::malformed(&self.path, "the columns", name, "no such column"))?;
        let chunk = self.metadata.row_group(group).column(column);
        let start = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset());
        let mut file = guarded::open_regular(&self.path, FILE_MAX)?;
        let bytes = piece(&self.path, &mut file, start as u64, chunk.compressed_size() as usize)?;
        let value_bytes = match chunk.column_type() {
            Type::BOOLEAN => 1,
            Type::INT32 | Type::FLOAT | Type::BYTE_ARRAY => 4,
            Type::INT64 | Type::DOUBLE => 8,
            other => return Err(wrong(format!("values of the type {other}"))),
        };
        let pages = Pages::new(Bytes::from(bytes), chunk.compression(), value_bytes);
        let described = chunk.column_descr_ptr();
        let levels = (described.max_def_level() > 0, described.max_rep_level() > 0);
        if described.max_rep_level() > 1 {
            return Err(wrong("a list of lists".to_string()));
        }
        let read = || -> Result<Cells, String> {
            fn widened<T: Into<i64>>(values: Vec<T>) -> Values {
                Values::Integers(values.into_iter().map(T::into).collect())
            }
            match get_column_reader(described, Box::new(pages)) {
                ColumnReader::BoolColumnReader(reader) => collect(reader, rows, levels, widened),
                ColumnReader::Int32ColumnReader(reader) => collect(reader, rows, levels, widened),
                ColumnReader::Int64ColumnReader(reader) => collect(reader, rows, levels, Values::Integers),
                ColumnReader::FloatColumnReader(reader) => collect(reader, rows, levels, Values::Floats),
                ColumnReader::DoubleColumnReader(reader) => collect(reader, rows, levels, Values::Doubles),
                ColumnReader::ByteArrayColumnReader(reader) => collect(reader, rows, levels, Values::Bytes),
                _ => Err("values of another type".to_string()),
            }
        };
        guard(read).map_err(wrong)
    }
}

/// Cells of rows, their values in the form of `values_of`. `levels`: whether the column has definition and repetition
/// levels.
fn collect<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: impl Iterator<Item = usize>,
    levels: (bool, bool),
    values_of: fn(Vec<T::T>) -> Values,
) -> Result<Cells, String> {
    let (mut values, mut ends) = (Vec::new(), Vec::new());
    let (mut definitions, mut repetitions) = (Vec::new(), Vec::new());
    let mut at = 0;
    let short = || "fewer rows than its group".to_string();
    for row in rows {
        let ahead = row - at;
        if ahead > 0 && reader.skip_records(ahead).map_err(|error| error.to_string())? != ahead {
            return Err(short());
        }
        definitions.clear();
        repetitions.clear();
        let definitions = levels.0.then_some(&mut definitions);
        let repetitions = levels.1.then_some(&mut repetitions);
        let read = reader.read_records(1, definitions, repetitions, &mut values).map_err(|error| error.to_string())?;
        if read.0 != 1 {
            return Err(short());
        }
        ends.push(values.len());
        at = row + 1;
    }
    Ok(Cells { values: values_of(values), ends })
}

impl Cells {
    fn range(&self, cell: usize) -> std::ops::Range<usize> {
        let start = cell.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[cell]
    }

    /// The numbers of a cell; `None` where the column holds text.
    pub fn numbers(&self, cell: usize) -> Option<Vec<f64>> {
        let range = self.range(cell);
        Some(match &self.values {
            Values::Integers(values) => values[range].iter().map(|value| *value as f64).collect(),
            Values::Floats(values) => values[range].iter().map(|value| f64::from(*value)).collect(),
            Values::Doubles(values) => values[range].to_vec(),
            Values::Bytes(_) => return None,
        })
    }

    /// The numbers of a cell in single precision, as images have them; `None` where the column holds text.
    pub fn floats(&self, cell: usize) -> Option<Vec<f32>> {
        let range = self.range(cell);
        Some(match &self.values {
            Values::Floats(values) => values[range].to_vec(),
            _ => self.numbers(cell)?.into_iter().map(|value| value as f32).collect(),
        })
    }

    /// The only integer of a cell; `None` where there is none, or several.
    pub fn integer(&self, cell: usize) -> Option<i64> {
        match (&self.values, self.range(cell)) {
            (Values::Integers(values), range) if range.len() == 1 => Some(values[range.start]),
            _ => None,
        }
    }

    /// The only text of a cell; `None` where there is none, or several.
    pub fn bytes(&self, cell: usize) -> Option<&[u8]> {
        match (&self.values, self.range(cell)) {
            (Values::Bytes(values), range) if range.len() == 1 => Some(values[range.start].data()),
            _ => None,
        }
    }
}

/// Whether a footer can be given to the decoder, which takes memory for as many columns as the footer speaks of, and
/// descends into them.
fn sound(footer: &[u8]) -> Result<(), String> {
    /// Fields of the format: the list of columns, and the children of one.
    const COLUMNS: [i16; 1] = [2];
    const CHILDREN: [i16; 2] = [2, 5];
    let mut children = Vec::new();
    let length = structure(footer, |path, event| match event {
        Event::Element if path == COLUMNS => children.push(0),
        Event::Integer(count) if path == CHILDREN => {
            children.iter_mut().next_back().into_iter().for_each(|c| *c = count)
        }
        _ => {}
    });
    length.ok_or("broken metadata")?;
    // Children that are still to come, at each depth.
    let mut left: Vec<i64> = Vec::new();
    for (index, count) in children.iter().enumerate() {
        while left.last() == Some(&0) {
            left.pop();
        }
        if let Some(last) = left.last_mut() {
            *last -= 1;
        }
        if !(0..=(children.len() - index) as i64).contains(count) || left.len() > SCHEMA_DEPTH_MAX {
            return Err(format!("a column of {count} columns"));
        }
        left.push(*count);
    }
    Ok(())
}

/// Runs a decoder of the crate, which asserts some of what it expects of a file.
fn guard<T>(decoder: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(decoder)) {
        Ok(result) => result.map_err(|error| error.replace('\n', " ")),
        Err(_) => Err("values that break the rules of the format".to_string()),
    }
}

/// Bytes of a file, which was at least so long when its metadata was read.
fn piece(path: &Path, file: &mut File, start: u64, length: usize) -> Result<Vec<u8>, DatasetError> {
    let io = |error| DatasetError::read(path, error);
    file.seek(SeekFrom::Start(start)).map_err(io)?;
    let mut bytes = Vec::with_capacity(length.min(file.metadata().map_err(io)?.len() as usize));
    file.take(length as u64).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() < length {
        return Err(io(std::io::ErrorKind::UnexpectedEof.into()));
    }
    Ok(bytes)
}

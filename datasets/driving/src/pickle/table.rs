//! A pandas table in a [`Tree`]: columns by name.

use std::path::Path;

use glam::DVec3;
use gs_datasets::DatasetError;

use super::array::{Array, Cell, Kind};
use super::machine::parse;
use super::value::{Global, Id, PickleError, Tree, Value};
use crate::gzip;

/// Most blocks and columns; pandas keeps one block a type, and the widest table of PandaSet has 17 columns.
const COLUMNS_MAX: usize = 4096;

/// Columns of one type, side by side.
struct Block<'t> {
    values: Array<'t>,
    /// The columns of the table that the rows of `values` are.
    columns: Vec<usize>,
}

/// A table.
pub(crate) struct Table<'t, 'b> {
    tree: &'t Tree<'b>,
    names: Vec<&'t str>,
    blocks: Vec<Block<'t>>,
    /// Rows of every column.
    pub rows: usize,
}

/// The contents of the table in a file, as `contents` reads them.
pub(crate) fn read<T>(
    path: &Path,
    contents: impl FnOnce(&Table<'_, '_>) -> Result<T, PickleError>,
) -> Result<T, DatasetError> {
    let bytes = gzip::read(path)?;
    let found = parse(&bytes).and_then(|tree| contents(&Table::of(&tree)?));
    found.map_err(|error| DatasetError::malformed(path, error.location, error.expected, error.found))
}

impl<'t, 'b> Table<'t, 'b> {
    /// Reads the description of a table; the numbers stay where they are.
    pub fn of(tree: &'t Tree<'b>) -> Result<Self, PickleError> {
        let place = "the table";
        let (callable, _, state) = tree.object(tree.root, place)?;
        let state = state.filter(|_| callable == Global::DataFrame);
        let manager = state.and_then(|state| tree.entry(state, "_mgr").or_else(|| tree.entry(state, "_data")));
        let manager =
            manager.ok_or_else(|| PickleError::new(place, "a DataFrame with its blocks", "another object"))?;
        let (axes, blocks) = axes_and_blocks(tree, manager)?;
        let names = names(tree, *axes.first().ok_or_else(|| PickleError::new(place, "the names of columns", "none"))?)?;
        if blocks.len() > COLUMNS_MAX || names.len() > COLUMNS_MAX {
            return Err(PickleError::new(place, format!("at most {COLUMNS_MAX} columns"), "more"));
        }
        let blocks = blocks.iter().map(|id| block(tree, *id, names.len())).collect::<Result<Vec<_>, _>>()?;
        let rows = blocks.first().map_or(0, |block| block.values.columns());
        if let Some(other) = blocks.iter().find(|block| block.values.columns() != rows) {
            let found = format!("{rows} and {}", other.values.columns());
            return Err(PickleError::new(place, "blocks with equally many rows", found));
        }
        Ok(Self { tree, names, blocks, rows })
    }

    /// The cells of a column from the first row to the last; `None` without such a column.
    pub fn cells(&self, name: &str) -> Option<impl Iterator<Item = Cell<'t>> + '_> {
        let column = self.names.iter().position(|known| *known == name)?;
        let mut places = self.blocks.iter().filter_map(|block| {
            let row = block.columns.iter().position(|place| *place == column)?;
            Some((&block.values, row))
        });
        let (values, row) = places.next()?;
        Some((0..self.rows).map(move |index| values.cell(self.tree, row, index)))
    }

    /// A column of numbers; booleans are 0 and 1.
    ///
    /// # Errors
    /// When there is no such column, or it holds something else.
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, PickleError> {
        let cells = self.cells(name).ok_or_else(|| self.missing(name))?;
        cells
            .map(|cell| match cell {
                Cell::Number(value) => Ok(value),
                Cell::Int(value) => Ok(value as f64),
                _ => Err(PickleError::new(format!("column {name:?}"), "numbers", "something else")),
            })
            .collect()
    }

    /// Three columns of numbers as vectors.
    ///
    /// # Errors
    /// As [`numbers`](Self::numbers).
    pub fn vectors(&self, names: [&str; 3]) -> Result<Vec<DVec3>, PickleError> {
        let [x, y, z] = [self.numbers(names[0])?, self.numbers(names[1])?, self.numbers(names[2])?];
        Ok((0..self.rows).map(|i| DVec3::new(x[i], y[i], z[i])).collect())
    }

    /// A column of texts; `None` where one is missing.
    ///
    /// # Errors
    /// When there is no such column.
    pub fn texts(&self, name: &str) -> Result<Vec<Option<&'t str>>, PickleError> {
        let cells = self.cells(name).ok_or_else(|| self.missing(name))?;
        Ok(cells.map(|cell| if let Cell::Text(text) = cell { Some(text) } else { None }).collect())
    }

    fn missing(&self, name: &str) -> PickleError {
        const SHOWN: usize = 12;
        let known: Vec<&str> = self.names.iter().take(SHOWN).copied().collect();
        PickleError::new("the table", format!("a column {name:?}"), format!("the columns {known:?}"))
    }
}

/// The lists of axes and blocks of a block manager: arguments in newer versions, a state in older ones.
fn axes_and_blocks<'t>(tree: &'t Tree<'_>, manager: Id) -> Result<(&'t [Id], &'t [Id]), PickleError> {
    let place = "the blocks of the table";
    let (callable, args, state) = tree.object(manager, place)?;
    if callable != Global::BlockManager {
        return Err(PickleError::new(place, "a BlockManager", "another object"));
    }
    if let [blocks, axes] = tree.elements(args, place)? {
        return Ok((tree.elements(*axes, place)?, tree.elements(*blocks, place)?));
    }
    let state = state.ok_or_else(|| PickleError::new(place, "a state", "none"))?;
    let parts = tree.elements(state, place)?;
    // The fourth part repeats the other three in the form that is read.
    let described = parts.get(3).and_then(|part| tree.entry(*part, "0.14.1"));
    let lists = described.and_then(|part| Some((tree.entry(part, "axes")?, tree.entry(part, "blocks")?)));
    let (axes, blocks) = lists.ok_or_else(|| PickleError::new(place, "axes and blocks under \"0.14.1\"", "none"))?;
    Ok((tree.elements(axes, place)?, tree.elements(blocks, place)?))
}

fn names<'t>(tree: &'t Tree<'_>, axis: Id) -> Result<Vec<&'t str>, PickleError> {
    let place = "the names of columns";
    let (callable, args, _) = tree.object(axis, place)?;
    let data = match (callable, tree.elements(args, place)?) {
        (Global::NewIndex, [_, parts]) => tree.entry(*parts, "data"),
        _ => None,
    };
    let data = data.ok_or_else(|| PickleError::new(place, "an index of names", "another object"))?;
    let array = Array::of(tree, data)?;
    if array.kind != Kind::Object || array.rows() != 1 {
        return Err(PickleError::new(place, "a list of strings", "something else"));
    }
    (0..array.columns())
        .map(|index| match array.cell(tree, 0, index) {
            Cell::Text(name) => Ok(name),
            _ => Err(PickleError::new(place, "strings", "something else")),
        })
        .collect()
}

/// A block: a dictionary in older versions, a call in newer ones.
fn block<'t>(tree: &'t Tree<'_>, id: Id, columns: usize) -> Result<Block<'t>, PickleError> {
    let place = "a block of the table";
    let (values, places) = match tree.get(id) {
        Value::Dict(_) => (tree.entry(id, "values"), tree.entry(id, "mgr_locs")),
        Value::Object { callable: Global::UnpickleBlock, args, .. } => {
            let args = tree.elements(*args, place)?;
            (args.first().copied(), args.get(1).copied())
        }
        other => return Err(PickleError::new(place, "values and their columns", other.kind())),
    };
    let (Some(values), Some(places)) = (values, places) else {
        return Err(PickleError::new(place, "values and their columns", "one of them missing"));
    };
    let values = Array::of(tree, values)?;
    let places = locations(tree, places, columns)?;
    if places.len() != values.rows() {
        let found = format!("{} rows for {} columns", values.rows(), places.len());
        return Err(PickleError::new(place, "one row of values a column", found));
    }
    Ok(Block { values, columns: places })
}

/// Columns as a slice or an array of positions. The end of a slice may lie beyond the last column.
fn locations(tree: &Tree<'_>, id: Id, columns: usize) -> Result<Vec<usize>, PickleError> {
    let place = "the columns of a block";
    let (callable, args, _) = tree.object(id, place)?;
    if callable == Global::Slice {
        let [start, stop, step] = tree.elements(args, place)? else {
            return Err(PickleError::new(place, "start, stop and step", "another number of values"));
        };
        let step = if *tree.get(*step) == Value::None { 1 } else { tree.size(*step, place)? };
        let (start, stop) = (tree.size(*start, place)?, tree.size(*stop, place)?.min(columns));
        return Ok((start..stop).step_by(step.max(1)).collect());
    }
    let array = Array::of(tree, id)?;
    if array.columns() > columns {
        return Err(PickleError::new(place, format!("at most {columns} positions"), array.columns().to_string()));
    }
    (0..array.columns())
        .map(|index| match array.cell(tree, 0, index) {
            Cell::Int(value) if (0..columns as i64).contains(&value) => Ok(value as usize),
            _ => Err(PickleError::new(place, format!("positions below {columns}"), "something else")),
        })
        .collect()
}

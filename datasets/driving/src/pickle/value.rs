//! The values of a pickle as a tree in one list.

/// The place of a value in its [`Tree`].
pub(crate) type Id = u32;

/// A break of the format: where, what was expected and what was found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PickleError {
    /// "byte 17", or a part of the table.
    pub location: String,
    pub expected: String,
    pub found: String,
}

impl PickleError {
    pub fn new(location: impl Into<String>, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { location: location.into(), expected: expected.into(), found: found.into() }
    }
}

/// The names that a pickled table may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Global {
    DataFrame,
    BlockManager,
    NewIndex,
    Index,
    RangeIndex,
    Reconstruct,
    NdArray,
    Dtype,
    Slice,
    UnpickleBlock,
    FromBuffer,
}

/// Module, name and meaning; modules moved between versions of pandas and NumPy.
const GLOBALS: [(&str, &str, Global); 18] = [
    ("pandas.core.frame", "DataFrame", Global::DataFrame),
    ("pandas", "DataFrame", Global::DataFrame),
    ("pandas.core.internals.managers", "BlockManager", Global::BlockManager),
    ("pandas.core.indexes.base", "_new_Index", Global::NewIndex),
    ("pandas.core.indexes.base", "Index", Global::Index),
    ("pandas", "Index", Global::Index),
    ("pandas.core.indexes.numeric", "Int64Index", Global::Index),
    ("pandas.core.indexes.range", "RangeIndex", Global::RangeIndex),
    ("pandas", "RangeIndex", Global::RangeIndex),
    ("numpy.core.multiarray", "_reconstruct", Global::Reconstruct),
    ("numpy._core.multiarray", "_reconstruct", Global::Reconstruct),
    ("numpy", "ndarray", Global::NdArray),
    ("numpy", "dtype", Global::Dtype),
    ("builtins", "slice", Global::Slice),
    ("__builtin__", "slice", Global::Slice),
    ("pandas._libs.internals", "_unpickle_block", Global::UnpickleBlock),
    ("numpy.core.numeric", "_frombuffer", Global::FromBuffer),
    ("numpy._core.numeric", "_frombuffer", Global::FromBuffer),
];

impl Global {
    /// The meaning of a name; `None` for every name that is not in the list.
    pub fn of(module: &str, name: &str) -> Option<Self> {
        GLOBALS.iter().find(|known| known.0 == module && known.1 == name).map(|known| known.2)
    }
}

/// One value. Texts and buffers are slices of the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(&'a [u8]),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    Global(Global),
    /// A call that is not carried out: the name, the arguments, and the state that the object would be given.
    Object {
        callable: Global,
        args: Id,
        state: Option<Id>,
    },
}

impl Value<'_> {
    /// The kind, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a bool",
            Self::Int(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Text(_) => "a string",
            Self::Bytes(_) => "bytes",
            Self::Tuple(_) => "a tuple",
            Self::List(_) => "a list",
            Self::Dict(_) => "a dictionary",
            Self::Global(_) => "a class",
            Self::Object { .. } => "an object",
        }
    }
}

/// All values of a pickle.
#[derive(Debug)]
pub(crate) struct Tree<'a> {
    pub values: Vec<Value<'a>>,
    pub root: Id,
}

impl<'a> Tree<'a> {
    /// The value at a place.
    pub fn get(&self, id: Id) -> &Value<'a> {
        // Places are handed out by the machine alone, and values are never removed.
        &self.values[id as usize]
    }

    /// The entry of a dictionary; `None` where `id` is no dictionary or has no such key.
    pub fn entry(&self, id: Id, key: &str) -> Option<Id> {
        let Value::Dict(entries) = self.get(id) else { return None };
        // The last of equal keys counts, as in Python.
        entries
            .iter()
            .rev()
            .find(|(k, _)| matches!(self.get(*k), Value::Text(text) if *text == key))
            .map(|entry| entry.1)
    }

    /// The elements of a tuple or list.
    pub fn elements(&self, id: Id, place: &str) -> Result<&[Id], PickleError> {
        match self.get(id) {
            Value::Tuple(list) | Value::List(list) => Ok(list),
            other => Err(PickleError::new(place, "a tuple or list", other.kind())),
        }
    }

    /// Callable, arguments and state of an object.
    pub fn object(&self, id: Id, place: &str) -> Result<(Global, Id, Option<Id>), PickleError> {
        match self.get(id) {
            Value::Object { callable, args, state } => Ok((*callable, *args, *state)),
            other => Err(PickleError::new(place, "an object", other.kind())),
        }
    }

    /// A count or a position.
    pub fn size(&self, id: Id, place: &str) -> Result<usize, PickleError> {
        match self.get(id) {
            Value::Int(value) if *value >= 0 => Ok(*value as usize),
            Value::Int(value) => Err(PickleError::new(place, "an integer of 0 or more", value.to_string())),
            other => Err(PickleError::new(place, "an integer of 0 or more", other.kind())),
        }
    }
}

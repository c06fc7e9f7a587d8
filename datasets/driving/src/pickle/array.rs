//! Pickled NumPy arrays of one or two dimensions.

use gs_base::npy::Number;

use super::value::{Global, Id, PickleError, Tree, Value};

/// Most dimensions of an array: a block of a table is a matrix.
const DIMENSIONS_MAX: usize = 2;

/// The type of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Number(Number),
    /// A value of the tree.
    Object,
}

impl Kind {
    fn of(text: &str) -> Option<Self> {
        match text {
            "O8" | "O" => Some(Self::Object),
            _ => Number::parse(text).map(Self::Number),
        }
    }
}

/// The elements of an array, in the file's order.
#[derive(Debug, Clone, Copy)]
enum Data<'t> {
    Bytes(&'t [u8]),
    Objects(&'t [Id]),
}

/// An array; rows of a one-dimensional one are its elements.
#[derive(Debug, Clone)]
pub(crate) struct Array<'t> {
    pub kind: Kind,
    /// One or two lengths.
    pub shape: Vec<usize>,
    is_fortran: bool,
    data: Data<'t>,
}

/// One element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Cell<'t> {
    Number(f64),
    Int(i64),
    Text(&'t str),
    /// None, or NaN where texts are expected.
    Missing,
}

impl<'t> Array<'t> {
    /// Reads an array object.
    pub fn of(tree: &'t Tree<'_>, id: Id) -> Result<Self, PickleError> {
        let place = "an array";
        let (callable, args, state) = tree.object(id, place)?;
        let (shape, dtype, is_fortran, data) = match callable {
            Global::Reconstruct => {
                let state = state.ok_or_else(|| PickleError::new(place, "a state", "none"))?;
                let [_, shape, dtype, fortran, data] = five(tree, state, place)?;
                (shape, dtype, matches!(tree.get(fortran), Value::Bool(true)), data)
            }
            Global::FromBuffer => {
                let args = tree.elements(args, place)?;
                let [data, dtype, shape, order] = args[..] else {
                    return Err(PickleError::new(
                        place,
                        "a buffer, a type, a shape and an order",
                        args.len().to_string(),
                    ));
                };
                (shape, dtype, matches!(tree.get(order), Value::Text("F")), data)
            }
            _ => return Err(PickleError::new(place, "an array", "another object")),
        };
        let shape = tree.elements(shape, place)?.iter().map(|n| tree.size(*n, place)).collect::<Result<Vec<_>, _>>()?;
        if shape.is_empty() || shape.len() > DIMENSIONS_MAX {
            return Err(PickleError::new(place, "one or two dimensions", shape.len().to_string()));
        }
        let kind = kind(tree, dtype)?;
        let data = data_of(tree, data, kind, &shape)?;
        Ok(Self { kind, shape, is_fortran, data })
    }

    /// Elements of the last dimension.
    pub fn columns(&self) -> usize {
        self.shape[self.shape.len() - 1]
    }

    /// Rows: 1 for one dimension.
    pub fn rows(&self) -> usize {
        if self.shape.len() == 2 { self.shape[0] } else { 1 }
    }

    /// The element of a row and column, which are inside.
    pub fn cell(&self, tree: &'t Tree<'_>, row: usize, column: usize) -> Cell<'t> {
        let index = if self.is_fortran { column * self.rows() + row } else { row * self.columns() + column };
        match (self.data, self.kind) {
            (Data::Bytes(bytes), Kind::Number(number)) => {
                let bytes = &bytes[index * number.bytes()..];
                if number.is_float() { Cell::Number(number.read(bytes)) } else { Cell::Int(number.read_integer(bytes)) }
            }
            (Data::Objects(list), _) => match tree.get(list[index]) {
                Value::Text(text) => Cell::Text(text),
                Value::Float(value) => Cell::Number(*value),
                Value::Int(value) => Cell::Int(*value),
                Value::Bool(value) => Cell::Int(i64::from(*value)),
                _ => Cell::Missing,
            },
            (Data::Bytes(_), Kind::Object) => Cell::Missing,
        }
    }
}

fn five(tree: &Tree<'_>, id: Id, place: &str) -> Result<[Id; 5], PickleError> {
    let list = tree.elements(id, place)?;
    <[Id; 5]>::try_from(list).map_err(|_| PickleError::new(place, "a state of 5 values", list.len().to_string()))
}

/// The element type: `dtype("f8", ..)` with the state `(3, "<", ..)`.
fn kind(tree: &Tree<'_>, id: Id) -> Result<Kind, PickleError> {
    let place = "the type of an array";
    let (callable, args, state) = tree.object(id, place)?;
    let name = tree.elements(args, place)?.first().map(|id| tree.get(*id));
    let (Global::Dtype, Some(Value::Text(name))) = (callable, name) else {
        return Err(PickleError::new(place, "a type with a name", "another object"));
    };
    let order = match state {
        Some(state) => tree.elements(state, place)?.get(1).map(|id| tree.get(*id)),
        None => None,
    };
    if let Some(Value::Text(">")) = order {
        return Err(PickleError::new(place, "little-endian numbers", "big-endian ones"));
    }
    Kind::of(name).ok_or_else(|| PickleError::new(place, "f8 to f2, i8 to i1, u8 to u1, b1 or O8", format!("{name:?}")))
}

/// The elements, as many as the shape says.
fn data_of<'t>(tree: &'t Tree<'_>, id: Id, kind: Kind, shape: &[usize]) -> Result<Data<'t>, PickleError> {
    let place = "the data of an array";
    let count = shape.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
    let wrong = |found: String| PickleError::new(place, format!("elements of the shape {shape:?}"), found);
    match (kind, tree.get(id)) {
        (Kind::Object, Value::List(list)) if Some(list.len()) == count => Ok(Data::Objects(list)),
        (Kind::Object, other) => Err(wrong(other.kind().to_string())),
        (Kind::Number(number), Value::Bytes(bytes))
            if count.and_then(|n| n.checked_mul(number.bytes())) == Some(bytes.len()) =>
        {
            Ok(Data::Bytes(bytes))
        }
        (_, Value::Bytes(bytes)) => Err(wrong(format!("{} bytes", bytes.len()))),
        (_, other) => Err(wrong(other.kind().to_string())),
    }
}

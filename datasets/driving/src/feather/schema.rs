//! Names and types of the columns of a Feather file.

use gs_base::npy::Number;

use super::flat::Flat;

/// How the values of a column are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Number(Number),
    /// A bit a value.
    Bool,
    /// Offsets of so many bytes and the bytes of all strings; binary data likewise.
    Text(usize),
    /// No buffer.
    Null,
}

impl Kind {
    /// Buffers of such a column in a record batch: the first marks missing values.
    pub fn buffers(self) -> usize {
        match self {
            Self::Null => 0,
            Self::Text(_) => 3,
            _ => 2,
        }
    }

    /// Bytes of `rows` values; `None` where it does not depend on the rows alone.
    pub fn bytes(self, rows: usize) -> Option<usize> {
        match self {
            Self::Number(number) => rows.checked_mul(number.bytes()),
            Self::Bool => Some(rows.div_ceil(8)),
            Self::Text(_) | Self::Null => None,
        }
    }
}

/// A column.
#[derive(Debug, Clone)]
pub(crate) struct Field<'a> {
    pub name: &'a str,
    pub kind: Kind,
}

/// Most columns of a file; those of Argoverse 2 have at most 13.
const FIELDS_MAX: usize = 1024;

/// The columns of a schema, or what is wrong with it.
pub(crate) fn fields<'a>(schema: &Flat<'a>) -> Result<Vec<Field<'a>>, String> {
    if schema.i16(0) != 0 {
        return Err("big-endian numbers".to_string());
    }
    let list = schema.vector(1).filter(|list| list.count <= FIELDS_MAX).ok_or("no list of columns")?;
    (0..list.count)
        .map(|index| {
            let field = list.table(index).ok_or("a column beyond the end")?;
            let name = field.text(0).ok_or("a column without a name")?;
            if field.table(4).is_some() {
                return Err(format!("column {name:?} with a dictionary"));
            }
            let kind = kind(&field).ok_or_else(|| format!("column {name:?} of the type {}", field.u8(2)))?;
            Ok(Field { name, kind })
        })
        .collect()
}

fn kind(field: &Flat<'_>) -> Option<Kind> {
    let number = |name: &str| Number::parse(name).map(Kind::Number);
    // The numbers of the union `Type` in Arrow's Schema.fbs.
    match field.u8(2) {
        1 => Some(Kind::Null),
        2 => {
            let described = field.table(3)?;
            let (bits, sign) = (described.i32(0), if described.u8(1) != 0 { "i" } else { "u" });
            number(&format!("{sign}{}", bits / 8)).filter(|_| bits % 8 == 0)
        }
        3 => number(["f2", "f4", "f8"].get(usize::try_from(field.table(3)?.i16(0)).ok()?)?),
        4 | 5 => Some(Kind::Text(4)),
        19 | 20 => Some(Kind::Text(8)),
        6 => Some(Kind::Bool),
        // Time stamps are integers of eight bytes.
        10 => number("i8"),
        _ => None,
    }
}

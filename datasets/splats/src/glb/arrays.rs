//! Arrays of a file: accessors of one buffer, as they are written and as they are found.

use gs_base::npy::Number;
use serde_json::{Value, json};

use super::{BYTE, FLOAT, SHORT, UNSIGNED_BYTE, UNSIGNED_INT, UNSIGNED_SHORT};
use crate::COUNT_MAX;
use crate::json::{at, index, index_or_0};

/// Arrays that become accessors of the one buffer.
#[derive(Default)]
pub(super) struct Arrays {
    pub bytes: Vec<u8>,
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
}

impl Arrays {
    /// Adds an array of floats and returns the index of its accessor.
    pub fn floats<const D: usize>(&mut self, values: impl IntoIterator<Item = [f32; D]>) -> usize {
        let begin = self.bytes.len();
        values.into_iter().flatten().for_each(|x| self.bytes.extend(x.to_le_bytes()));
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][D];
        self.add(begin, 4 * D, FLOAT, kind)
    }

    /// Adds an array of whole numbers.
    pub fn indices(&mut self, values: &[u32]) -> usize {
        let begin = self.bytes.len();
        values.iter().for_each(|x| self.bytes.extend(x.to_le_bytes()));
        self.add(begin, 4, UNSIGNED_INT, "SCALAR")
    }

    /// Adds an array of bytes, padded so that what follows is aligned.
    pub fn small(&mut self, values: &[u8]) -> usize {
        let begin = self.bytes.len();
        self.bytes.extend(values);
        let accessor = self.add(begin, 1, UNSIGNED_BYTE, "SCALAR");
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        accessor
    }

    fn add(&mut self, begin: usize, each: usize, component: u64, kind: &str) -> usize {
        let length = self.bytes.len() - begin;
        self.views.push(json!({"buffer": 0, "byteOffset": begin, "byteLength": length}));
        let (view, count) = (self.views.len() - 1, length / each);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }
}

/// The arrays of a document.
pub(super) struct Accessors<'a> {
    pub document: &'a Value,
    pub buffer: &'a [u8],
}

impl Accessors<'_> {
    /// An array of `D` numbers each: floats, or whole numbers as they are or normalised to 0 or -1 to 1.
    pub fn floats<const D: usize>(&self, accessor: usize) -> Result<Vec<[f32; D]>, String> {
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][D];
        let found = self.described(accessor, kind)?;
        let is_normalised = found.get("normalized").and_then(Value::as_bool) == Some(true);
        let component = component_of(found);
        let (name, most) = match component {
            FLOAT => ("f4", 1.0),
            BYTE => ("i1", 127.0),
            UNSIGNED_BYTE => ("u1", 255.0),
            SHORT => ("i2", 32_767.0),
            UNSIGNED_SHORT => ("u2", 65_535.0),
            _ => return Err(format!("accessor {accessor}: expected floats, bytes or shorts, found type {component}")),
        };
        let number = Number::parse(name).expect("a number type");
        let unit = if is_normalised && component != FLOAT { 1.0 / most } else { 1.0 };
        let value = |b: &[u8]| {
            let value = number.read(b) as f32;
            // The least whole number with a sign is a step below -1.
            if unit == 1.0 { value } else { (value * unit).max(-1.0) }
        };
        let size = number.bytes();
        self.array(accessor, found, D * size, |bytes| std::array::from_fn(|i| value(&bytes[i * size..])))
    }

    /// An array of whole numbers.
    pub fn indices(&self, accessor: usize) -> Result<Vec<u32>, String> {
        let found = self.described(accessor, "SCALAR")?;
        match component_of(found) {
            UNSIGNED_BYTE => self.array(accessor, found, 1, |b| u32::from(b[0])),
            UNSIGNED_INT => self.array(accessor, found, 4, |b| u32::from_le_bytes(std::array::from_fn(|k| b[k]))),
            other => Err(format!("accessor {accessor}: expected whole numbers of 8 or 32 bits, found type {other}")),
        }
    }

    /// How many values an accessor promises.
    pub fn count(&self, accessor: usize) -> Result<usize, String> {
        index(at(self.document, &format!("/accessors/{accessor}"))?, "/count")
    }

    /// The description of an accessor, if it is of the type `kind` and complete in itself.
    fn described(&self, accessor: usize, kind: &str) -> Result<&Value, String> {
        let found = at(self.document, &format!("/accessors/{accessor}"))?;
        let other = found.get("type").and_then(Value::as_str).unwrap_or("none");
        if other != kind {
            return Err(format!("accessor {accessor}: expected the type {kind}, found {other:?}"));
        }
        if found.get("sparse").is_some() {
            return Err(format!(
                "accessor {accessor}: expected all values, found a sparse accessor, which is not read"
            ));
        }
        Ok(found)
    }

    fn array<T>(
        &self,
        accessor: usize,
        found: &Value,
        each: usize,
        value: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        let count = index(found, "/count")?;
        if count == 0 {
            return Ok(Vec::new());
        }
        if count > COUNT_MAX * 64 {
            return Err(format!("accessor {accessor}: expected fewer values, found {count}"));
        }
        let view = at(self.document, &format!("/bufferViews/{}", index(found, "/bufferView")?))?;
        if let Some(name) = view.get("extensions").and_then(Value::as_object).and_then(|all| all.keys().next()) {
            return Err(format!("accessor {accessor}: expected plain bytes, found them compressed by {name:?}"));
        }
        if index_or_0(view, "/buffer")? != 0 {
            return Err("expected one buffer inside the file, found another".into());
        }
        let stride = match index_or_0(view, "/byteStride")? {
            0 => each,
            stride => stride,
        };
        let (offset, length) = (index_or_0(view, "/byteOffset")?, index(view, "/byteLength")?);
        let view = offset.checked_add(length).and_then(|end| self.buffer.get(offset..end));
        let own = view.and_then(|view| view.get(index_or_0(found, "/byteOffset").ok()?..));
        let needed = (count - 1).checked_mul(stride).and_then(|before| before.checked_add(each));
        match (own, needed) {
            (Some(own), Some(needed)) if needed <= own.len() && stride >= each => {
                Ok((0..count).map(|i| value(&own[i * stride..])).collect())
            }
            _ => Err(format!("accessor {accessor}: expected {count} values, found fewer bytes; the file is cut short")),
        }
    }
}

fn component_of(accessor: &Value) -> u64 {
    accessor.get("componentType").and_then(Value::as_u64).unwrap_or(0)
}

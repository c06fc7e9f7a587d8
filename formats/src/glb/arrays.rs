//! Arrays of a file: accessors of one buffer, as they are written and as they are found.

use serde_json::{Value, json};

use super::json::{at, index, index_or_0};
use super::{FLOAT, UNSIGNED_INT};
use crate::COUNT_MAX;

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
    /// An array of `D` floats each.
    pub fn floats<const D: usize>(&self, accessor: usize) -> Result<Vec<[f32; D]>, String> {
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][D];
        self.array(accessor, FLOAT, kind, 4 * D, |bytes| {
            std::array::from_fn(|i| f32::from_le_bytes(std::array::from_fn(|k| bytes[4 * i + k])))
        })
    }

    /// An array of whole numbers.
    pub fn indices(&self, accessor: usize) -> Result<Vec<u32>, String> {
        self.array(accessor, UNSIGNED_INT, "SCALAR", 4, |b| u32::from_le_bytes(std::array::from_fn(|k| b[k])))
    }

    fn array<T>(
        &self,
        accessor: usize,
        component: u64,
        kind: &str,
        each: usize,
        value: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        let found = at(self.document, &format!("/accessors/{accessor}"))?;
        let is_kind = found.get("componentType").and_then(Value::as_u64) == Some(component)
            && found.get("type").and_then(Value::as_str) == Some(kind)
            && found.get("sparse").is_none();
        if !is_kind {
            return Err(format!("accessor {accessor}: expected {kind} of component type {component}, found another"));
        }
        let count = index(found, "/count")?;
        if count == 0 {
            return Ok(Vec::new());
        }
        if count > COUNT_MAX * 64 {
            return Err(format!("accessor {accessor}: expected fewer values, found {count}"));
        }
        let view = at(self.document, &format!("/bufferViews/{}", index(found, "/bufferView")?))?;
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

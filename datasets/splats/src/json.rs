//! Values of a JSON object that anybody may have written.

use serde_json::Value;

/// The value at a path of keys and indices, or a sentence.
pub fn at<'a>(value: &'a Value, pointer: &str) -> Result<&'a Value, String> {
    value.pointer(pointer).ok_or_else(|| format!("expected {pointer} in the JSON, found nothing"))
}

pub fn index(value: &Value, pointer: &str) -> Result<usize, String> {
    let number = at(value, pointer)?.as_u64().and_then(|number| usize::try_from(number).ok());
    number.ok_or_else(|| format!("expected a whole number at {pointer}, found another value"))
}

/// A whole number that may be left out, and is 0 then.
pub fn index_or_0(value: &Value, pointer: &str) -> Result<usize, String> {
    if value.pointer(pointer).is_none() { Ok(0) } else { index(value, pointer) }
}

pub fn number(value: &Value, pointer: &str) -> Result<f64, String> {
    at(value, pointer)?.as_f64().ok_or_else(|| format!("expected a number at {pointer}, found another value"))
}

pub fn list<'a>(value: &'a Value, pointer: &str) -> Result<&'a [Value], String> {
    at(value, pointer)?.as_array().map(Vec::as_slice).ok_or_else(|| format!("expected a list at {pointer}"))
}

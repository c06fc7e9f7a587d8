//! Reading JSON by hand, so that every complaint names the file, the key, and what was there.

use std::path::Path;

use gs_base::{counted, guarded};
use serde_json::{Map, Value};

use crate::error::DatasetError;

/// Reads a JSON file whose top level is an object.
pub(crate) fn read(path: &Path) -> Result<Map<String, Value>, DatasetError> {
    match read_value(path)? {
        Value::Object(object) => Ok(object),
        other => Err(DatasetError::malformed(path, "top level", "a JSON object", kind(&other))),
    }
}

/// Reads a JSON file.
pub(crate) fn read_value(path: &Path) -> Result<Value, DatasetError> {
    let bytes = guarded::read(path, guarded::DESCRIPTION_MAX)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        DatasetError::malformed(path, format!("byte {offset}"), "JSON in UTF-8", "bytes that are not UTF-8")
    })?;
    let text = quote_non_finite(text.trim_start_matches('\u{feff}'));
    serde_json::from_str(&text).map_err(|error| {
        let location = format!("line {}, column {}", error.line(), error.column());
        DatasetError::malformed(path, location, "valid JSON", error.to_string())
    })
}

/// Puts quotes around NaN and Infinity outside of strings. Python writes them although JSON has no such numbers; as
/// strings they do no harm under keys that nobody reads, and elsewhere the complaint can name the key or the frame.
fn quote_non_finite(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let (mut in_string, mut escaped) = (false, false);
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if in_string {
            in_string = escaped || c != '"';
            escaped = c == '\\' && !escaped;
        } else if let Some(word) = ["-Infinity", "Infinity", "NaN"].into_iter().find(|word| rest.starts_with(word)) {
            out.push('"');
            out.push_str(word);
            out.push('"');
            rest = &rest[word.len()..];
            continue;
        } else {
            in_string = c == '"';
        }
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

/// A value in a few words, for messages.
pub(crate) fn kind(value: &Value) -> String {
    match value {
        Value::Null => "null".to_string(),
        Value::Bool(value) => value.to_string(),
        Value::Number(value) => value.to_string(),
        Value::String(value) => format!("{:?}", value.chars().take(40).collect::<String>()),
        Value::Array(values) => format!("a list of {}", values.len()),
        Value::Object(values) => format!("an object with {}", counted(values.len(), "key")),
    }
}

/// A number, also the quoted non-finite ones.
pub(crate) fn as_f64(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => match text.as_str() {
            "NaN" => Some(f64::NAN),
            "Infinity" => Some(f64::INFINITY),
            "-Infinity" => Some(f64::NEG_INFINITY),
            _ => None,
        },
        _ => None,
    }
}

/// A list of `R` rows of `C` numbers.
pub(crate) fn matrix<const R: usize, const C: usize>(value: &Value) -> Option<[[f64; C]; R]> {
    let row = |row: &Value| numbers(row)?.try_into().ok();
    value.as_array()?.iter().map(row).collect::<Option<Vec<[f64; C]>>>()?.try_into().ok()
}

/// A list of numbers.
pub(crate) fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(as_f64).collect()
}

/// Objects that are asked in turn: the frame's own keys first, then the file's shared ones.
pub(crate) struct Keys<'a> {
    pub file: &'a Path,
    /// "top level" or "frame ...".
    pub location: String,
    pub objects: Vec<&'a Map<String, Value>>,
}

impl<'a> Keys<'a> {
    /// The first value that is there; null counts as absent.
    pub fn get(&self, key: &str) -> Option<&'a Value> {
        self.objects.iter().filter_map(|object| object.get(key)).find(|value| !value.is_null())
    }

    /// A finite number.
    pub fn number(&self, key: &str) -> Result<Option<f64>, DatasetError> {
        self.map(key, "a finite number", |value| as_f64(value).filter(|number| number.is_finite()))
    }

    /// A string.
    pub fn text(&self, key: &str) -> Result<Option<&'a str>, DatasetError> {
        self.map(key, "a string", |value| value.as_str())
    }

    /// A list of strings.
    pub fn texts(&self, key: &str) -> Result<Option<Vec<&'a str>>, DatasetError> {
        self.map(key, "a list of strings", |value| value.as_array()?.iter().map(Value::as_str).collect())
    }

    fn map<T>(
        &self,
        key: &str,
        expected: &str,
        read: impl Fn(&'a Value) -> Option<T>,
    ) -> Result<Option<T>, DatasetError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        read(value).map(Some).ok_or_else(|| self.wrong(key, expected, kind(value)))
    }

    pub fn wrong(&self, key: &str, expected: &str, found: String) -> DatasetError {
        DatasetError::malformed(self.file, format!("{}, key `{key}`", self.location), expected, found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bare_non_finite_words_are_quoted() {
        let text = r#"{"a": NaN, "b": [-Infinity, Infinity], "NaN \" NaN": "NaN"}"#;
        let expected = r#"{"a": "NaN", "b": ["-Infinity", "Infinity"], "NaN \" NaN": "NaN"}"#;
        assert_eq!(quote_non_finite(text), expected);
    }
}

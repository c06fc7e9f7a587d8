//! Configurations as tables: files stacked on their bases, single values, and keys that do not exist.

use std::path::Path;

use toml::{Table, Value};

use crate::experiment::{Config, ConfigError};

/// Files that may be stacked by `base`; more is taken for a circle.
pub(super) const MAX_BASES: usize = 8;

pub(super) fn read_with_base(path: &Path, depth: usize) -> Result<Table, ConfigError> {
    if depth > MAX_BASES {
        return Err(ConfigError::Circle { path: path.into() });
    }
    let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.into(), source })?;
    let origin = path.display().to_string();
    let mut table = parse(&text, &origin)?;
    let base = table.remove("base");
    check_keys(&table, &origin)?;
    let mut merged = match base {
        None => Table::new(),
        Some(Value::String(name)) => read_with_base(&path.with_file_name(name), depth + 1)?,
        Some(other) => {
            let found = format!("`base` must be the name of a file beside this one, found {other}");
            return Err(ConfigError::Type { origin, found });
        }
    };
    merge(&mut merged, table);
    Ok(merged)
}

pub(super) fn parse(text: &str, origin: &str) -> Result<Table, ConfigError> {
    text.parse()
        .map_err(|error: toml::de::Error| ConfigError::Syntax { origin: origin.into(), found: one_line(&error) })
}

/// `density.cap=5000` -> `{ density = { cap = 5000 } }`. What is not a TOML value is taken as a string, so that
/// `density.strategy=mcmc` needs no quotes.
pub(super) fn parse_override(text: &str) -> Result<Table, ConfigError> {
    let origin = format!("--set {text}");
    let Some((key, raw)) = text.split_once('=') else {
        return Err(ConfigError::Syntax { origin, found: "no `=`; write section.key=value".into() });
    };
    let raw = raw.trim();
    let value = format!("value = {raw}")
        .parse::<Table>()
        .ok()
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(raw.into()));
    let mut names = key.trim().split('.').rev();
    let last = names.next().unwrap_or_default();
    let mut table = Table::from_iter([(last.to_string(), value)]);
    for name in names {
        table = Table::from_iter([(name.to_string(), Value::Table(table))]);
    }
    check_keys(&table, &origin)?;
    // The value must fit on its own, so that the error names this argument.
    let probe: Result<Config, _> = Value::Table(table.clone()).try_into();
    probe.map_err(|error: toml::de::Error| ConfigError::Type { origin, found: one_line(&error) })?;
    Ok(table)
}

pub(super) fn merge(into: &mut Table, from: Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(changes)) => merge(inner, changes),
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}

/// Every key of `table` must be one of the defaults' keys.
pub(super) fn check_keys(table: &Table, origin: &str) -> Result<(), ConfigError> {
    let defaults = Table::try_from(Config::default()).expect("the defaults are a table");
    let (mut valid, mut written) = (Vec::new(), Vec::new());
    list_keys(&defaults, "", &mut valid);
    list_keys(table, "", &mut written);
    match written.into_iter().find(|key| !valid.contains(key)) {
        None => Ok(()),
        Some(key) => {
            let nearest = nearest(&key, &valid).to_string();
            Err(ConfigError::UnknownKey { origin: origin.into(), key, nearest })
        }
    }
}

/// All keys with their sections, sections included.
fn list_keys(table: &Table, prefix: &str, keys: &mut Vec<String>) {
    for (key, value) in table {
        let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        if let Value::Table(inner) = value {
            list_keys(inner, &path, keys);
        }
        keys.push(path);
    }
}

/// The valid key most like `key`: by spelling as a whole, or by its last name in another section.
fn nearest<'a>(key: &str, valid: &'a [String]) -> &'a str {
    let last = |path: &str| path.rsplit('.').next().unwrap_or_default().to_string();
    let distance = |candidate: &&String| {
        let whole = strsim::damerau_levenshtein(key, candidate);
        let name = strsim::damerau_levenshtein(&last(key), &last(candidate)) + 1;
        whole.min(name)
    };
    valid.iter().min_by_key(distance).map_or("", String::as_str)
}

pub(super) fn one_line(error: &toml::de::Error) -> String {
    error.to_string().lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

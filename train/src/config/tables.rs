//! Configurations as tables: files and recipes merged over their bases, single values, and unknown keys.

use std::path::Path;

use gs_base::guarded;
use toml::{Table, Value};

use super::error::{ConfigError, MAX_BASES};

/// Largest configuration file, bytes: all keys with comments take some 20 kB.
pub const FILE_MAX: u64 = 1 << 20;

/// Values from one source.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// The source, as errors name it.
    pub origin: String,
    /// The values.
    pub table: Table,
}

/// A file and the files it is based on, the outermost base first.
///
/// # Errors
/// A file that cannot be read or is not TOML, or too long a chain of bases.
pub fn file_layers(path: &Path) -> Result<Vec<Layer>, ConfigError> {
    let mut next = Some(path.to_path_buf());
    let mut layers = Vec::new();
    while let Some(path) = next {
        if layers.len() > MAX_BASES {
            return Err(ConfigError::Circle { origin: path.display().to_string() });
        }
        let read = guarded::read_to_string(&path, FILE_MAX);
        let text =
            read.map_err(|source| ConfigError::Read { path: path.clone(), source: source.into(), recipe: None })?;
        let (layer, base) = layer(&text, path.display().to_string())?;
        next = base.map(|name| path.with_file_name(name));
        layers.push(layer);
    }
    layers.reverse();
    Ok(layers)
}

/// A recipe and the recipes it is based on, the outermost base first; `find` gives the text of a recipe by name
/// (`folder/name`).
///
/// # Errors
/// As [`file_layers`]; the result is `None` if `find` does not know the name.
pub fn recipe_layers(
    name: &str,
    find: impl Fn(&str) -> Option<&'static str>,
) -> Result<Option<Vec<Layer>>, ConfigError> {
    let mut next = Some(name.to_string());
    let mut layers = Vec::new();
    while let Some(name) = next {
        let origin = format!("recipe {name}");
        if layers.len() > MAX_BASES {
            return Err(ConfigError::Circle { origin });
        }
        let Some(text) = find(&name) else { return Ok(None) };
        let (layer, base) = layer(text, origin)?;
        next = base.map(|base| beside(&name, &base));
        layers.push(layer);
    }
    layers.reverse();
    Ok(Some(layers))
}

/// The recipe named by `base`, a path relative to the recipe `name`: `a/b/c` and `../d.toml` give `a/d`.
fn beside(name: &str, base: &str) -> String {
    let mut parts: Vec<&str> = name.split('/').collect();
    parts.pop();
    for part in base.strip_suffix(".toml").unwrap_or(base).split('/') {
        match part {
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// The values of a text and the name of its base.
fn layer(text: &str, origin: String) -> Result<(Layer, Option<String>), ConfigError> {
    let mut table = parse(text, &origin)?;
    match table.remove("base") {
        None => Ok((Layer { origin, table }, None)),
        Some(Value::String(name)) => Ok((Layer { origin, table }, Some(name))),
        Some(other) => {
            let found = format!("`base` must be the name of a file beside this one, found {other}");
            Err(ConfigError::Type { origin, found })
        }
    }
}

/// The table of a TOML text; `origin` names it in errors.
///
/// # Errors
/// When it is not TOML.
pub fn parse(text: &str, origin: &str) -> Result<Table, ConfigError> {
    text.parse()
        .map_err(|error: toml::de::Error| ConfigError::Syntax { origin: origin.into(), found: one_line(&error) })
}

/// `density.cap=5000` gives `{ density = { cap = 5000 } }`. A value that is not TOML is a string, so that
/// `density.strategy=mcmc` needs no quotes.
///
/// # Errors
/// Without `=`.
pub fn override_layer(text: &str) -> Result<Layer, ConfigError> {
    let origin = format!("--set {text}");
    let Some((key, raw)) = text.split_once('=') else {
        return Err(ConfigError::Syntax { origin, found: "no `=`; write section.key=value".into() });
    };
    let raw = raw.trim();
    let parsed = format!("value = {raw}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
    if parsed.is_none() && is_whole(raw) {
        let found = format!("expected a whole number from {} to {}, found {raw}", i64::MIN, i64::MAX);
        return Err(ConfigError::Type { origin, found });
    }
    let value = parsed.unwrap_or_else(|| Value::String(raw.into()));
    let mut names = key.trim().split('.').rev();
    let last = names.next().unwrap_or_default();
    let mut table = Table::from_iter([(last.to_string(), value)]);
    for name in names {
        table = Table::from_iter([(name.to_string(), Value::Table(table))]);
    }
    Ok(Layer { origin, table })
}

/// Whether a text is a whole number, of any size.
fn is_whole(text: &str) -> bool {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit())
}

/// Merges `from` into `into`; values of `from` win.
pub fn merge(into: &mut Table, from: Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(changes)) => merge(inner, changes),
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}

/// All keys with their sections, sections included.
pub fn keys(table: &Table) -> Vec<String> {
    entries(table, "").into_iter().map(|(key, _)| key).collect()
}

/// Every value by its key with sections, strings without quotes.
pub fn flat(table: &Table) -> Vec<(String, String)> {
    let shown = |(key, value): (String, &Value)| match value {
        Value::Table(_) => None,
        Value::String(text) => Some((key, text.clone())),
        other => Some((key, other.to_string())),
    };
    entries(table, "").into_iter().filter_map(shown).collect()
}

/// Every key with its sections and its value; a section comes after its keys.
fn entries<'a>(table: &'a Table, prefix: &str) -> Vec<(String, &'a Value)> {
    let each = |(key, value): (&String, &'a Value)| {
        let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        let inner = value.as_table().map(|inner| entries(inner, &path)).unwrap_or_default();
        inner.into_iter().chain([(path, value)])
    };
    table.iter().flat_map(each).collect()
}

/// A parser's complaint on one line.
pub fn one_line(error: &toml::de::Error) -> String {
    error.to_string().lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bases_are_found_beside_a_recipe() {
        assert_eq!(beside("a/b/c", "../d.toml"), "a/d");
        assert_eq!(beside("a/c", "base.toml"), "a/base");
        assert_eq!(beside("a/c", "../../../x.toml"), "x");
    }

    #[test]
    fn whole_numbers_beyond_those_of_toml_are_no_text() {
        let said = override_layer("seed=18446744073709551615").expect_err("too large").to_string();
        assert!(said.ends_with("to 9223372036854775807, found 18446744073709551615"), "{said}");
        override_layer("seed=9223372036854775807").expect("a number of TOML");
    }

    #[test]
    fn a_circle_of_recipes_ends() {
        let circle = recipe_layers("a/x", |_| Some("base = \"x.toml\""));
        assert!(circle.expect_err("circle").to_string().contains("circle"));
        assert_eq!(recipe_layers("a/x", |_| None).expect("unknown"), None);
    }
}

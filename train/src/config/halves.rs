//! A configuration of two halves, the shared sections and a pipeline's own, as one table and as one text.

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Table;

use super::error::ConfigError;
use super::retired::{with_moved, without_retired};
use super::typed;

/// The halves of a table, which may omit keys; `origin` names it in errors. A key that neither half has counts as one
/// of the first.
///
/// # Errors
/// A key that does not exist, or a value of the wrong type.
pub fn read<A: DeserializeOwned, B: DeserializeOwned + Default + Serialize>(
    table: &Table,
    origin: &str,
) -> Result<(A, B), ConfigError> {
    let keys = as_table(&B::default());
    // Not by `serde(flatten)`: its buffer loses the key that a type error is about.
    let table = without_retired(with_moved(table.clone()), origin)?;
    let (own, shared): (Table, Table) = table.into_iter().partition(|(key, _)| keys.contains_key(key));
    Ok((typed(shared, origin)?, typed(own, origin)?))
}

/// Every key with its value.
pub fn table(shared: &impl Serialize, own: &impl Serialize) -> Table {
    let mut table = as_table(shared);
    table.extend(as_table(own));
    table
}

/// Every key with its value as TOML text, in the order of the sections.
pub fn text(shared: &impl Serialize, own: &impl Serialize) -> String {
    let (shared, own) = (as_text(shared), as_text(own));
    if own.is_empty() { shared } else { format!("{shared}\n{own}") }
}

fn as_table(half: &impl Serialize) -> Table {
    Table::try_from(half).expect("a configuration of numbers, strings and lists is TOML")
}

fn as_text(half: &impl Serialize) -> String {
    toml::to_string_pretty(half).expect("a configuration of numbers, strings and lists is TOML")
}

//! The declaration of a configuration's keys: documentation, type, default and range of a key stand together, once.
//!
//! [`section!`](crate::section) makes the struct, its defaults, the check of its ranges and the rows of docs/config.md
//! from it; [`choice!`](crate::choice) does so for a key whose values are words.

use serde::Serialize;
use toml::Value;

use super::error::{ConfigError, brief};
use super::ranges::Range;

/// A key of a configuration, or a section with its keys.
#[derive(Debug, Clone)]
pub struct Key {
    /// The name, without its section.
    pub name: &'static str,
    /// The meaning, on one line.
    pub about: &'static str,
    /// The words that the key may have, with their meanings; empty for other kinds of values.
    pub words: Vec<(String, &'static str)>,
    /// The keys of a section; empty for a value.
    pub keys: Vec<Key>,
}

impl Key {
    /// The key of values of type `T`; `about` are the lines of its documentation in one.
    pub fn of<T: Declared>(name: &'static str, about: &'static str) -> Self {
        Self { name, about: about.trim(), words: T::words(), keys: T::keys() }
    }
}

/// A value of a configuration, or a section of values.
pub trait Declared {
    /// The words that a choice is among, with their meanings.
    fn words() -> Vec<(String, &'static str)> {
        Vec::new()
    }

    /// The keys of a section, in their order.
    fn keys() -> Vec<Key> {
        Vec::new()
    }

    /// Checks every range of a section; `name` is the section's name, empty for the outermost one.
    ///
    /// # Errors
    /// The first value outside its range.
    fn check_ranges(&self, _name: &str) -> Result<(), ConfigError> {
        Ok(())
    }
}

/// Values that are no sections and no choices among words.
macro_rules! values {
    ($($kind:ty),*) => { $(impl Declared for $kind {})* };
}

values!(bool, f64, u64, usize, String, [f64; 2]);

impl<T: Declared> Declared for Vec<T> {
    fn words() -> Vec<(String, &'static str)> {
        T::words()
    }
}

/// Checks a key of `section`: its own range, if it has one, and the ranges of the keys in it.
///
/// # Errors
/// The first value outside its range.
pub fn check_key<T: Declared + Serialize>(
    section: &str,
    name: &str,
    value: &T,
    range: Option<&dyn Range<T>>,
) -> Result<(), ConfigError> {
    let key = if section.is_empty() { name.to_string() } else { format!("{section}.{name}") };
    match range {
        Some(range) if !range.holds(value) => {
            Err(ConfigError::Range { key, expected: range.expected(), found: shown(value) })
        }
        _ => value.check_ranges(&key),
    }
}

/// A value for people.
fn shown(value: &impl Serialize) -> String {
    match Value::try_from(value) {
        Ok(Value::Float(number)) => brief(number),
        Ok(Value::Integer(number)) => brief(number as f64),
        Ok(Value::String(text)) => text,
        Ok(other) => other.to_string(),
        Err(_) => "a value that TOML cannot hold".into(),
    }
}

/// The word of a variant in a configuration: `LastEighth` is `last-eighth`.
pub fn word(variant: &str) -> String {
    let mut word = String::new();
    for letter in variant.chars() {
        if letter.is_uppercase() && !word.is_empty() {
            word.push('-');
        }
        word.extend(letter.to_lowercase());
    }
    word
}

/// Declares a section of a configuration, or the sections of a pipeline:
///
/// ```ignore
/// section! {
///     /// Learning rates.
///     pub struct RateConfig {
///         /// Rate of the means.
///         means: f64 = 5e-3, in NOT_NEGATIVE;
///     }
///     also check_rates;
/// }
/// ```
///
/// Without `= value` the default is the type's own; without `in range` every value of the type is accepted. `also`
/// names functions that check what concerns several keys; they take the section.
#[macro_export]
macro_rules! section {
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident {
            $($(#[doc = $about:literal])+ $key:ident: $kind:ty $(= $default:expr)? $(, in $range:expr)?;)*
        }
        $(also $check:path;)*
    ) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        $visibility struct $name {
            $($(#[doc = $about])+ pub $key: $kind,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $crate::section!(@default $($default)?),)* }
            }
        }

        impl $crate::config::Declared for $name {
            fn keys() -> Vec<$crate::config::Key> {
                vec![$($crate::config::Key::of::<$kind>(stringify!($key), concat!($($about),+)),)*]
            }

            fn check_ranges(&self, name: &str) -> Result<(), $crate::config::ConfigError> {
                $($crate::config::check_key(name, stringify!($key), &self.$key, $crate::section!(@range $($range)?))?;)*
                $($check(self)?;)*
                Ok(())
            }
        }
    };
    (@default) => { Default::default() };
    (@default $default:expr) => { $default };
    (@range) => { None };
    (@range $range:expr) => { Some(&$range) };
}

/// Declares a choice among words. The word of a variant is its name in kebab case.
#[macro_export]
macro_rules! choice {
    (
        $(#[$attribute:meta])*
        $visibility:vis enum $name:ident {
            $($(#[doc = $about:literal])+ $(#[serde($($serde:tt)*)])? $variant:ident,)+
        }
    ) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(rename_all = "kebab-case")]
        $visibility enum $name {
            $($(#[doc = $about])+ $(#[serde($($serde)*)])? $variant,)+
        }

        impl $crate::config::Declared for $name {
            fn words() -> Vec<(String, &'static str)> {
                vec![$(($crate::config::word(stringify!($variant)), concat!($($about),+).trim()),)+]
            }
        }
    };
}

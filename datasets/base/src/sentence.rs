//! Words of a message: names of a data set, numbers, counts with their nouns.

use std::borrow::Cow;
use std::path::Path;

/// The text with every character that steers a terminal, begins a line or turns the direction of writing in escaped
/// form, `\u{1b}`.
///
/// Names come from data sets, and data sets from anywhere: an escape sequence in a file's name could recolour a
/// terminal, change its title or hide the line before. All other characters stay, of whatever script.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_steering) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_steering(c) { out.extend(c.escape_unicode()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// A path for a message. Bytes that are no text are shown as `\u{fffd}` is, a question mark in a lozenge.
pub fn shown(path: &Path) -> String {
    printable(&path.to_string_lossy()).into_owned()
}

/// Whether a character is an order to the terminal rather than a sign: controls (C0, DEL, C1), separators of lines and
/// paragraphs, marks and overrides of direction, and the byte order mark.
pub fn is_steering(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{feff}')
        || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// From a billion on a number is shown as a power of ten: its digits would fill lines and say nothing.
const LARGE: f64 = 1e9;

/// A number for a message, with all its digits below a billion.
pub fn number(value: f64) -> String {
    if value.abs() < LARGE { value.to_string() } else { format!("{value:e}") }
}

/// A number with this many decimals, or as a power of ten with three digits from a billion on.
pub fn decimals(value: f64, places: usize) -> String {
    let text = if value.abs() < LARGE { format!("{value:.places$}") } else { format!("{value:.2e}") };
    // A rounding error below zero is no number below zero.
    let is_zero = text.bytes().all(|byte| b"-0.".contains(&byte));
    if is_zero { text.trim_start_matches('-').to_string() } else { text }
}

/// A position with this many decimals, likewise.
pub fn position(value: glam::DVec3, places: usize) -> String {
    let [x, y, z] = value.to_array().map(|value| decimals(value, places));
    format!("[{x}, {y}, {z}]")
}

/// "1 view", "2 views": a count and its noun, which takes an s.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The word that goes with the count: `agree(count, "is", "are")`.
pub fn agree<'a>(count: usize, one: &'a str, many: &'a str) -> &'a str {
    if count == 1 { one } else { many }
}

/// "1 view is", "2 views are": a count, its noun, and the verb that goes with it.
pub fn clause(count: usize, noun: &str, one: &str, many: &str) -> String {
    format!("{} {}", counted(count, noun), agree(count, one, many))
}

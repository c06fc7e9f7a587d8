//! Numbers in sentences: "1 view has", "2 views have".

/// "1 view", "2 views": a count and its noun, which takes an s.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The word that goes with the count: `agree(count, "is", "are")`.
pub fn agree<'a>(count: usize, one: &'a str, many: &'a str) -> &'a str {
    if count == 1 { one } else { many }
}

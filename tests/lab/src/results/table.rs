//! A table in Markdown between its marks.

use anyhow::{Result, bail};

use super::Data;

/// The mark before a table.
pub fn begin(name: &str) -> String {
    format!("<!-- results {name} begin -->\n")
}

/// The mark behind it.
fn end(name: &str) -> String {
    format!("<!-- results {name} end -->")
}

/// The table with the line that says how it was measured.
pub fn markdown(data: &Data) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = line(&data.columns) + &format!("|{}\n", "---|".repeat(data.columns.len()));
    data.rows.iter().for_each(|row| text += &line(row));
    let seeds = match data.seeds.as_slice() {
        [] => "none".into(),
        seeds => seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", "),
    };
    text += &format!("\nCommit `{}`; command: `{}`; seeds: {seeds}.", data.commit, data.command);
    if let Some(reason) = &data.superseded {
        text += &format!(" Measured with superseded defaults: {reason}.");
    }
    text + "\n"
}

/// The page with this table between its marks; `None` where the page has no such marks.
///
/// # Errors
/// When the mark behind the table is missing.
pub fn replaced(page: &str, name: &str, data: &Data) -> Result<Option<String>> {
    let (begin, end) = (begin(name), end(name));
    let Some((before, rest)) = page.split_once(&begin) else { return Ok(None) };
    let Some((_, after)) = rest.split_once(&end) else {
        bail!("expected {end} behind {}, found none", begin.trim_end());
    };
    Ok(Some([before, &begin, &markdown(data), &end, after].concat()))
}

/// The names of all tables of a page.
#[cfg(test)]
pub fn names(page: &str) -> Vec<&str> {
    page.lines().filter_map(|line| line.strip_prefix("<!-- results ")?.strip_suffix(" begin -->")).collect()
}

//! A comparison in HTML: a page of its own, and a section of a run's report.

use std::fmt::Write as _;

use anyhow::{Result, bail};
use gs_base::write_atomic;
use gs_base::{guarded, printable};
use gs_train::run::folder::RunFolder;
use gs_train::run::outputs::MARK;
use gsburn::report::html::{self, escaped};
use gsburn::report::{COMPARISON, section_page, with_section};

use super::Comparison;
use super::scatter::{SIZE, Scatter};

/// Largest report, bytes: its pictures are in it.
const PAGE_MAX: u64 = 1 << 30;

/// The charts as one SVG, one below the other; the SVG's description is the command that made them.
pub fn stacked<'a>(charts: impl IntoIterator<Item = &'a Scatter>, command: &str) -> String {
    let charts: Vec<&Scatter> = charts.into_iter().collect();
    let (width, height) = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{total}\" \
         viewBox=\"0 0 {width} {total}\">\n\
         <desc>{MARK}: {}</desc>\n",
        escaped(command),
        total = height * charts.len() as u32
    );
    for (index, chart) in charts.iter().enumerate() {
        writeln!(svg, "<g transform=\"translate(0 {})\">{}</g>", height * index as u32, chart.svg())
            .expect("writing to a string does not fail");
    }
    svg + "</svg>\n"
}

/// Charts, tables, warnings and the command that made them.
fn section(comparison: &Comparison, command: &str) -> String {
    let Comparison { charts, tables, warnings } = comparison;
    let mut html = format!("<!-- {MARK} -->\n<section>\n<h2>Accuracy against cost</h2>\n<div class=\"plots\">\n");
    charts.iter().for_each(|chart| html += &format!("<figure>{}</figure>\n", chart.svg()));
    html += "</div>\n";
    warnings.iter().for_each(|warning| html += &format!("<p>{}</p>\n", escaped(&printable(warning))));
    tables.iter().for_each(|table| html += &table.html());
    html + &format!("<p>Made by <code>{}</code></p>\n</section>\n", escaped(&printable(command)))
}

/// A page of its own that needs no other file.
pub fn page(comparison: &Comparison, command: &str) -> String {
    let section = section(comparison, command);
    html::page("Runs", "", &format!("<header>\n<h1>{}</h1>\n</header>\n{section}", html::name("Runs")))
}

/// Puts the comparison into the report.html of a run, in place of an earlier one, and saves it beside it, so that a new
/// report contains it too.
///
/// # Errors
/// When the run has no report, or a file cannot be written.
pub fn add_to_report(folder: &RunFolder, comparison: &Comparison, command: &str) -> Result<()> {
    let path = folder.report();
    if !path.is_file() {
        bail!("{}: expected the report of a finished run, found none", path.display());
    }
    let report = guarded::read_to_string(&path, PAGE_MAX)?;
    let section = section(comparison, command);
    let Some(report) = with_section(&report, COMPARISON, &section) else {
        bail!("{}: expected a report of gsburn, found another page", path.display());
    };
    write_atomic(&folder.comparison(), section_page(&folder.name(), COMPARISON, &section).as_bytes())?;
    Ok(write_atomic(&path, report.as_bytes())?)
}

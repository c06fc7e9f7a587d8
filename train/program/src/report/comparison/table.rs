//! The table of a comparison, one row per measurement: for a terminal, Markdown, CSV and HTML.

use std::collections::BTreeSet;

use gs_base::printable;

use super::{ComparedRun, by_cpu, pareto_front, seconds, settings};
use crate::report::html::{self, escaped};
use gs_train::fit::figure::Prominence;
use gs_train::run::measured::Evaluation;
use gs_train::run::memory::megabytes;

/// Most further keys of the configuration shown as columns; more would not be readable.
const FURTHER: usize = 8;

/// Sections that do not change what a run learns.
const ASIDE: [&str; 2] = ["checkpoint.", "eval."];

/// Names of columns and rows of cells. Columns without any content are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Cells; empty without a value.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Every measurement of every run, with a front for moving parts, if they were measured, and one for whole images.
    pub fn new(runs: &[ComparedRun]) -> Self {
        let cpu = by_cpu(runs);
        let further = further_keys(runs);
        let all: Vec<(&ComparedRun, &Evaluation)> =
            runs.iter().flat_map(|run| run.measurements().iter().map(move |e| (run, e))).collect();
        let front = |quality: fn(&Evaluation) -> f64| {
            pareto_front(&all.iter().map(|(_, e)| (seconds(e, cpu), quality(e))).collect::<Vec<_>>())
        };
        let moving = front(|e| e.moving().map_or(f64::NAN, |scores| scores.psnr));
        let whole = front(|e| e.mean().psnr);
        let settings = settings(runs);
        let measures = measures(&all.iter().map(|(_, e)| *e).collect::<Vec<_>>());

        let mut columns: Vec<String> = vec!["run".into()];
        columns.extend(settings.iter().map(|(name, _)| name.to_string()));
        columns.push("step".into());
        columns.extend(further.clone());
        columns.extend(measures.iter().map(|(name, _)| name.clone()));
        columns.push("front".into());
        let rows = all.iter().enumerate().map(|(i, (run, e))| {
            let mut row = vec![run.name.clone()];
            let setting = |key: &str| run.setting(key).map_or(String::new(), |setting| setting.value.clone());
            row.extend(settings.iter().map(|(_, key)| setting(key)));
            row.push(e.step.to_string());
            row.extend(further.iter().map(|key| run.values.get(key).cloned().unwrap_or_default()));
            row.extend(measures.iter().map(|(_, measure)| measure(e).unwrap_or_default()));
            row.push(
                match (moving[i], whole[i]) {
                    (true, true) => "both",
                    (true, false) => "moving",
                    (false, true) if moving.contains(&true) => "whole",
                    (false, true) => "front",
                    (false, false) => "",
                }
                .to_string(),
            );
            row
        });
        Self { rows: rows.collect(), columns }.without_empty_columns()
    }

    /// A table of these columns and cells.
    pub fn of(columns: Vec<String>, rows: Vec<Vec<String>>) -> Self {
        Self { columns, rows }.without_empty_columns()
    }

    fn without_empty_columns(self) -> Self {
        let keep: Vec<bool> = (0..self.columns.len()).map(|c| self.rows.iter().any(|row| !row[c].is_empty())).collect();
        let kept =
            |cells: Vec<String>| cells.into_iter().zip(&keep).filter(|(_, keep)| **keep).map(|(c, _)| c).collect();
        Self { columns: kept(self.columns), rows: self.rows.into_iter().map(kept).collect() }
    }

    /// Aligned columns for a terminal.
    pub fn text(&self) -> String {
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|c| {
                let cells = self.rows.iter().map(|row| row[c].chars().count());
                cells.chain([self.columns[c].chars().count()]).max().unwrap_or(0)
            })
            .collect();
        let line = |cells: &[String]| {
            let aligned = cells.iter().zip(&widths).enumerate().map(|(c, (cell, width))| {
                let cell = if cell.is_empty() { "-" } else { cell };
                if c == 0 { format!("{cell:width$}") } else { format!("{cell:>width$}") }
            });
            aligned.collect::<Vec<_>>().join("  ").trim_end().to_string()
        };
        let lines: Vec<String> =
            std::iter::once(line(&self.columns)).chain(self.rows.iter().map(|r| line(r))).collect();
        lines.join("\n")
    }

    /// A Markdown table. Names are shown as they are: nothing in them is markup.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| {
            let cells = cells.iter().map(|cell| if cell.is_empty() { "–".into() } else { in_markdown(cell) });
            format!("| {} |\n", cells.collect::<Vec<String>>().join(" | "))
        };
        let rule = format!("|{}\n", "---|".repeat(self.columns.len()));
        self.rows.iter().fold(line(&self.columns) + &rule, |text, row| text + &line(row))
    }

    /// Comma-separated values with a first line of names (RFC 4180). A cell that a spreadsheet would take for a formula
    /// begins with an apostrophe.
    pub fn csv(&self) -> String {
        let cell = |cell: &String| {
            let cell = if is_formula(cell) { format!("'{cell}") } else { cell.clone() };
            match cell.contains([',', '"', '\n', '\r']) {
                true => format!("\"{}\"", cell.replace('"', "\"\"")),
                false => cell,
            }
        };
        let line = |cells: &[String]| cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\n";
        self.rows.iter().fold(line(&self.columns), |text, row| text + &line(row))
    }

    /// An HTML table; rows on a front are marked.
    pub fn html(&self) -> String {
        let front = self.columns.iter().position(|name| name == "front");
        let cell = |(c, cell): (usize, &String)| match cell.as_str() {
            "" => "–".into(),
            text if c == 0 => html::name(text),
            text => escaped(text),
        };
        let row = |cells: &Vec<String>| {
            let class = if front.is_some_and(|c| !cells[c].is_empty()) { " class=\"front\"" } else { "" };
            format!("<tr{class}>{}</tr>\n", html::cells("td", cells.iter().enumerate().map(cell)))
        };
        let head = html::row("th", self.columns.iter().map(|name| escaped(name)));
        let rows: String = self.rows.iter().map(row).collect();
        format!("<div class=\"wide\"><table>\n{head}{rows}</table></div>\n")
    }
}

/// A column's cell for a measurement.
type Measure = Box<dyn Fn(&Evaluation) -> Option<String>>;

/// Name and cells of every measured quantity: image quality, whole and by region, cost, size, figures of the methods.
fn measures(all: &[&Evaluation]) -> Vec<(String, Measure)> {
    let mut regions: Vec<String> = all.iter().flat_map(|e| e.measured.quality.regions.keys().cloned()).collect();
    regions.sort();
    regions.dedup();
    let mut columns: Vec<(String, Measure)> = Vec::new();
    let mut add = |name: String, measure: Measure| columns.push((name, measure));
    let of_region = |name: &str, shown: fn(f64, f64) -> String| -> Measure {
        let name = name.to_string();
        Box::new(move |e| e.measured.quality.regions.get(&name).map(|scores| shown(scores.psnr, scores.ssim)))
    };
    add("PSNR dB".into(), Box::new(|e| Some(format!("{:.2}", e.mean().psnr))));
    for name in &regions {
        add(format!("{name} dB"), of_region(name, |psnr, _| format!("{psnr:.2}")));
    }
    add("SSIM".into(), Box::new(|e| Some(format!("{:.4}", e.mean().ssim))));
    for name in &regions {
        add(format!("{name} SSIM"), of_region(name, |_, ssim| format!("{ssim:.4}")));
    }
    add("MS-SSIM".into(), Box::new(|e| e.mean().ms_ssim.map(|x| format!("{x:.4}"))));
    add("LPIPS".into(), Box::new(|e| e.mean().lpips.map(|x| format!("{x:.4}"))));
    if all.iter().any(|e| e.measured.quality.compared != all[0].measured.quality.compared) {
        add("compared".into(), Box::new(|e| Some(e.measured.quality.compared.clone())));
    }
    add("CPU s".into(), Box::new(|e| e.cost.cpu_seconds.map(|s| format!("{s:.1}"))));
    add("wall s".into(), Box::new(|e| Some(format!("{:.1}", e.cost.seconds))));
    add("Gaussians".into(), Box::new(|e| Some(e.measured.size.gaussians.to_string())));
    let mut figures: Vec<(String, String)> = Vec::new();
    for figure in all.iter().flat_map(|e| &e.measured.figures).filter(|f| f.prominence != Prominence::File) {
        if figures.iter().all(|(key, _)| *key != figure.key) {
            let unit = if figure.unit.is_empty() { String::new() } else { format!(" {}", figure.unit) };
            figures.push((figure.key.clone(), format!("{}{unit}", figure.name)));
        }
    }
    for (key, name) in figures {
        let cell = move |e: &Evaluation| {
            let figure = e.measured.figures.iter().find(|figure| figure.key == key)?;
            Some(format!("{:.*}", figure.digits, figure.value))
        };
        add(name, Box::new(cell));
    }
    add("size".into(), Box::new(|e| Some(megabytes(e.measured.size.bytes as u64))));
    add("peak memory".into(), Box::new(|e| e.cost.peak_memory_bytes.map(megabytes)));
    columns
}

/// Keys other than [`settings`] in which the runs differ; none if they are too many for a table.
fn further_keys(runs: &[ComparedRun]) -> Vec<String> {
    let settings = settings(runs);
    let differing = differing_keys(runs);
    let further: Vec<String> =
        differing.into_iter().filter(|key| settings.iter().all(|(_, setting)| setting != key)).collect();
    if further.len() > FURTHER { Vec::new() } else { further }
}

/// Every key of the configuration in which the runs differ.
pub fn differing_keys(runs: &[ComparedRun]) -> Vec<String> {
    let Some(first) = runs.first() else { return Vec::new() };
    let differs = |key: &&String| runs.iter().any(|run| run.values.get(*key) != first.values.get(*key));
    let counts = |key: &&String| !ASIDE.iter().any(|section| key.starts_with(section));
    // Runs of two pipelines have different keys.
    let all: BTreeSet<&String> = runs.iter().flat_map(|run| run.values.keys()).collect();
    all.into_iter().filter(counts).filter(differs).cloned().collect()
}

/// A cell with every character escaped that Markdown or the HTML in it gives a meaning.
fn in_markdown(cell: &str) -> String {
    let mut text = String::new();
    for c in printable(cell).chars() {
        match c {
            '&' => text += "&amp;",
            '<' => text += "&lt;",
            '|' | '\\' | '`' | '*' | '_' | '[' | ']' | '~' | '$' => text.extend(['\\', c]),
            c => text.push(c),
        }
    }
    text
}

/// Whether a spreadsheet takes the cell for a formula; negative numbers are none.
fn is_formula(cell: &str) -> bool {
    cell.starts_with(['=', '+', '-', '@', '\t', '\r']) && cell.parse::<f64>().is_err()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let row = |cells: [&str; 4]| cells.map(String::from).to_vec();
        Table {
            columns: row(["run", "N", "LPIPS", "front"]),
            rows: vec![row(["a,b", "3", "", "both"]), row(["c", "15", "", ""]), row(["=1|<b>", "7", "", ""])],
        }
        .without_empty_columns()
    }

    #[test]
    fn a_table_reads_in_every_format() {
        let text = ["run      N  front", "a,b      3   both", "c       15      -", "=1|<b>   7      -"];
        assert_eq!(table().text(), text.join("\n"));
        let markdown = ["| run | N | front |", "|---|---|---|", "| a,b | 3 | both |", "| c | 15 | – |"];
        // A name is no markup, and no formula.
        assert_eq!(table().markdown(), markdown.join("\n") + "\n| =1\\|&lt;b> | 7 | – |\n");
        assert_eq!(table().csv(), "run,N,front\n\"a,b\",3,both\nc,15,\n'=1|<b>,7,\n");
        assert!(table().html().contains("<td><bdi>=1|&lt;b&gt;</bdi></td>"));
        assert!(table().html().contains("<tr class=\"front\"><td><bdi>a,b</bdi></td>"));
    }
}

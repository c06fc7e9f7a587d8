//! `gs-lab chart`: accuracy against time and against count, over several runs.

use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_base::printable;
use gs_base::write_atomic;
use gs_train::run::folder::RunFolder;
use gs_train::run::outputs;
use gsburn::report::comparison::{Table, enough, gather};

use crate::cli::ChartArgs;
use crate::comparison::{Comparison, add_to_report, page, read_others, stacked};
use crate::print;

/// Draws the charts and writes the table.
///
/// # Errors
/// One sentence, when no run can be charted or a file cannot be written.
pub fn run(args: &ChartArgs) -> Result<ExitCode> {
    let extension = args.out.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    if !["svg", "html"].contains(&extension) {
        bail!("{}: expected the name of an .svg or .html file", args.out.display());
    }
    let markdown = args.out.with_extension("md");
    let table = (extension == "svg").then(|| markdown.clone());
    let reports = args.report.iter().map(RunFolder::at).flat_map(|folder| [folder.report(), folder.comparison()]);
    let paths: Vec<_> = [args.out.clone()].into_iter().chain(table).chain(args.csv.clone()).chain(reports).collect();
    outputs::check(&paths, &[])?;
    let found = gather(&args.runs)?;
    found.warnings.iter().for_each(|warning| eprintln!("warning: {}", printable(warning)));
    let others = args.beside.as_deref().map_or(Ok(Vec::new()), read_others)?;
    let (compared, command) = (Comparison::new(&found, &others), command_line());
    let Comparison { charts, tables, .. } = &compared;
    // Printed first: tables need no file, so they are shown even if a file cannot be written.
    tables.iter().for_each(|table| print(format!("{}\n", table.text())));
    if let Some(verdict) = enough(&found.runs) {
        print(verdict);
    }
    if extension == "html" {
        write_atomic(&args.out, page(&compared, &command).as_bytes())?;
        print(format!("page   {}", args.out.display()));
    } else {
        write_atomic(&args.out, stacked(charts, &command).as_bytes())?;
        write_atomic(
            &markdown,
            outputs::marked_markdown(&tables.iter().map(Table::markdown).collect::<Vec<_>>().join("\n")).as_bytes(),
        )?;
        print(format!("chart  {}\ntable  {}", args.out.display(), markdown.display()));
    }
    if let Some(path) = &args.csv {
        write_atomic(path, tables[0].csv().as_bytes())?;
        print(format!("table  {}", path.display()));
    }
    for folder in args.report.iter().map(RunFolder::at) {
        add_to_report(&folder, &compared, &command)?;
        print(format!("report {}", folder.report().display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// The command as it was typed, for figures that cite it; arguments that a shell would split are quoted.
fn command_line() -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+@%".contains(c);
    // A name that is not UTF-8 cannot stand in a figure; it is shown with replacement characters.
    let typed = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let quoted = typed.map(|word| match !word.is_empty() && word.chars().all(plain) {
        true => word,
        false => format!("'{}'", word.replace('\'', r"'\''")),
    });
    std::iter::once("gs-lab".to_string()).chain(quoted).collect::<Vec<_>>().join(" ")
}

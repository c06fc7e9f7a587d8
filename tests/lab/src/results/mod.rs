//! The tables of the docs: each is written from a data file that names commit, command and seeds.
//!
//! A data file is `tests/lab/results/NAME.json`. Its table stands between `<!-- results NAME begin -->` and `<!--
//! results NAME end -->` in a page. A file may also state its runs; these are trained where they are missing, and fill
//! the rows.

mod runs;
mod table;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use gs_base::{guarded, write_atomic};
use serde::{Deserialize, Serialize};

use crate::cli::ResultsArgs;
use crate::print;

/// Folder of the data files, from the root of the repository.
const FOLDER: &str = "tests/lab/results";

/// Pages that may have tables, beside everything in `docs`.
const PAGES: [&str; 2] = ["README.md", "BENCHMARKS.md"];

/// Longest data file and page, bytes: a page that people read is far below.
const FILE_MAX: u64 = 4 << 20;

/// A table with its origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Data {
    title: String,
    /// The commit that was measured, short.
    commit: String,
    command: String,
    seeds: Vec<u64>,
    machine: String,
    /// The reason why today's defaults would give other figures; `None` where they would not.
    superseded: Option<String>,
    columns: Vec<String>,
    /// Cells in Markdown.
    rows: Vec<Vec<String>>,
    /// The runs that give the rows, one row each; empty where something else did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    runs: Vec<runs::Run>,
    /// The figures of the runs in the columns after the first, which has their names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    figures: Vec<runs::Figure>,
    /// A chart of the runs, from the root of the repository.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    chart: Option<PathBuf>,
}

impl Data {
    /// Reads the data file of a name.
    fn read(root: &Path, name: &str) -> Result<Self> {
        let path = path_of(root, name);
        let text = guarded::read_to_string(&path, FILE_MAX)?;
        let data: Self = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        data.check().with_context(|| path.display().to_string())?;
        Ok(data)
    }

    fn check(&self) -> Result<()> {
        let width = self.columns.len();
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            ensure!(row.len() == width, "expected rows of {width} cells, found one of {}", row.len());
            let broken = row.iter().find(|cell| cell.contains(['|', '\n']));
            ensure!(broken.is_none(), "expected cells without | and line breaks, found {broken:?}");
        }
        let filled = self.runs.is_empty() || self.figures.len() + 1 == width;
        ensure!(filled, "expected a figure for each column after the first, found {}", self.figures.len());
        Ok(())
    }
}

/// Trains what is missing where runs are stated and a folder for them is given, then rewrites the tables of the names.
///
/// # Errors
/// One sentence: a name without a data file or without a place in a page, a run that fails, a full disk.
pub fn run(args: &ResultsArgs) -> Result<ExitCode> {
    for name in &args.names {
        let mut data = Data::read(&args.root, name)?;
        if let Some(out) = args.out.as_ref().filter(|_| !data.runs.is_empty()) {
            if !runs::fill(&mut data, (&args.root, name), out, &args.device)? {
                eprintln!("stopped; the same command continues");
                return Ok(ExitCode::from(gs_train::run::interrupt::exit_code()));
            }
            let json = serde_json::to_string_pretty(&data)? + "\n";
            write_atomic(&path_of(&args.root, name), json.as_bytes())?;
        }
        let mut places = 0;
        for page in pages(&args.root)? {
            let text = guarded::read_to_string(&page, FILE_MAX)?;
            let Some(new) = table::replaced(&text, name, &data)? else { continue };
            places += 1;
            if new != text {
                write_atomic(&page, new.as_bytes())?;
                print(format!("{name}: {}", page.display()));
            }
        }
        if places == 0 {
            bail!("{name}: expected a page with {}, found none", table::begin(name));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn path_of(root: &Path, name: &str) -> PathBuf {
    root.join(FOLDER).join(format!("{name}.json"))
}

/// The pages of the repository that may have tables, in order.
fn pages(root: &Path) -> Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = PAGES.map(|name| root.join(name)).into_iter().filter(|path| path.is_file()).collect();
    let mut folders = vec![root.join("docs")];
    while let Some(folder) = folders.pop().filter(|folder| folder.is_dir()) {
        for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            match path.extension().and_then(|end| end.to_str()) {
                _ if path.is_dir() => folders.push(path),
                Some("md") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    Ok(found)
}

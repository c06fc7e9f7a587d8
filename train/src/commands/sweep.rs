//! `gsburn sweep`: a run for every combination of some values, and their comparison.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_datasets::image_io::write_atomic;
use gs_datasets::printable;

use crate::cli::SweepArgs;
use crate::commands::{command_line, describe, device, marked, print};
use crate::pipelines::{Resolved, Sources, resolve, resolve_saved};
use crate::report::comparison::{Panels, Table, enough, gather, page, stacked};
use crate::run::folder::{RunFolder, full_path};
use crate::run::interrupt;
use crate::run::outputs;
use crate::run::resources::forget_peak_memory;
use crate::run::watch::{Ending, Job};

/// One combination.
#[derive(Debug, Clone, PartialEq)]
struct Combination {
    /// Name of its folder.
    name: String,
    /// Its configuration file.
    file: Option<PathBuf>,
    /// Its recipe.
    recipe: Option<String>,
    /// Its values, in the words of `--set`.
    overrides: Vec<String>,
}

/// Progress of a combination.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    New,
    Begun,
    Finished,
}

/// A planned run: its folder, configuration and progress.
type Planned = (RunFolder, Resolved, State);

/// Trains the combinations that are not finished yet, then compares all.
///
/// # Errors
/// One sentence: a value that is not valid, a folder that holds another run, bad data, a full disk.
pub fn run(args: &SweepArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    if !args.dataset.exists() {
        bail!("{}: expected a data set, found nothing", args.dataset.display());
    }
    // Every argument is checked here, before the first of many hours of training.
    let plan: Vec<Planned> = combinations(args)?
        .into_iter()
        .map(|combination| {
            let Combination { name, file, recipe, overrides } = combination;
            let sources = Sources { file: file.as_deref(), recipe: recipe.as_deref(), overrides: &overrides };
            let config = resolve(sources)?;
            let folder = RunFolder::at(args.out.join(&name));
            let state = state(&folder, &config, &args.dataset)?;
            Ok((folder, config, state))
        })
        .collect::<Result<_>>()?;
    outputs::check(&["chart.svg", "chart.md", "chart.csv", "index.html"].map(|name| args.out.join(name)), &[])?;
    interrupt::watch();
    for (i, (folder, config, state)) in plan.iter().enumerate() {
        let place = format!("run {} of {}: {}", i + 1, plan.len(), folder.name());
        if *state == State::Finished {
            say(args, &format!("{place}: finished already"));
            continue;
        }
        say(args, &place);
        if interrupt::asked() || !finishes(args, folder, config, *state, &device)? {
            eprintln!("stopped; the same command continues");
            return Ok(ExitCode::from(interrupt::exit_code()));
        }
    }
    compare(&args.out, &plan)
}

/// Trains one combination; `false` when it was interrupted.
fn finishes(args: &SweepArgs, folder: &RunFolder, config: &Resolved, state: State, device: &Device) -> Result<bool> {
    if !forget_peak_memory() {
        tracing::warn!("the system does not reset the peak of memory: each run shows the largest so far");
    }
    let job = Job {
        dataset: args.dataset.clone(),
        config: config.config.clone(),
        folder: folder.clone(),
        device: device.clone(),
        device_name: describe(device),
        resume: state == State::Begun,
        stop_at: None,
        quiet: args.quiet,
    };
    Ok(matches!(config.pipeline.train(&job)?, Ending::Finished(_)))
}

/// Writes chart, tables and page.
fn compare(out: &Path, plan: &[Planned]) -> Result<ExitCode> {
    let paths: Vec<PathBuf> = plan.iter().map(|(folder, ..)| folder.path().to_path_buf()).collect();
    let found = gather(&paths)?;
    found.warnings.iter().for_each(|warning| eprintln!("warning: {}", printable(warning)));
    let (panels, table, command) = (Panels::new(&found.runs), Table::new(&found.runs), command_line());
    print(table.text());
    if let Some(verdict) = enough(&found.runs) {
        print(verdict);
    }
    write_atomic(&out.join("chart.svg"), stacked(&panels, &command).as_bytes())?;
    write_atomic(&out.join("chart.md"), marked(&table.markdown()).as_bytes())?;
    write_atomic(&out.join("chart.csv"), table.csv().as_bytes())?;
    let index = out.join("index.html");
    let linked = table.linked(&found.runs);
    write_atomic(&index, page(&RunFolder::at(out).name(), &panels, &linked, &found.warnings, &command).as_bytes())?;
    print(format!("chart  {}\npage   {}", out.join("chart.svg").display(), index.display()));
    Ok(ExitCode::SUCCESS)
}

fn say(args: &SweepArgs, line: &str) {
    if !args.quiet {
        eprintln!("{line}");
    }
}

/// Progress of the run in `folder`.
fn state(folder: &RunFolder, config: &Resolved, dataset: &Path) -> Result<State> {
    if !folder.config().exists() {
        RunFolder::vacant(folder.path())?;
        return Ok(State::New);
    }
    let (found, trained_on) = folder.read_config()?;
    let same = resolve_saved(&found, "config.toml").is_ok_and(|found| found.text == config.text);
    let wanted = full_path(dataset);
    if !same || trained_on != wanted {
        bail!(
            "{}: holds a run with another {}; choose another folder with --out",
            folder.path().display(),
            if same { "data set" } else { "configuration" }
        );
    }
    let finished = folder.read_eval().is_ok_and(|eval| eval.last.step >= eval.steps);
    Ok(if finished { State::Finished } else { State::Begun })
}

/// Every combination of configuration files and values, the last key changing fastest.
fn combinations(args: &SweepArgs) -> Result<Vec<Combination>> {
    if args.configs.is_empty() && args.recipes.is_empty() && args.over.is_empty() {
        bail!("a sweep needs something to sweep over: --over KEY=VALUE,..., --configs FILE,... or --recipes NAME,...");
    }
    let keys: Vec<(&str, Vec<&str>)> = args.over.iter().map(|text| parse_over(text)).collect::<Result<_>>()?;
    let begin = |file: Option<&PathBuf>, recipe: Option<&String>, name: String| Combination {
        name,
        file: file.cloned(),
        recipe: recipe.cloned(),
        overrides: args.set.clone(),
    };
    let mut all: Vec<Combination> = match (args.configs.as_slice(), args.recipes.as_slice()) {
        ([], []) => vec![begin(args.config.as_ref(), args.recipe.as_ref(), String::new())],
        ([], recipes) => recipes.iter().map(|name| begin(None, Some(name), stem(Path::new(name)))).collect(),
        (files, _) => files.iter().map(|file| begin(Some(file), None, stem(file))).collect(),
    };
    for (key, values) in &keys {
        let short = short_name(key, &keys);
        let with = |combination: &Combination, value: &str| {
            let part = format!("{short}-{}", in_a_name(value));
            let overrides = combination.overrides.iter().cloned().chain([format!("{key}={value}")]);
            let separator = if combination.name.is_empty() { "" } else { "_" };
            Combination {
                name: format!("{}{separator}{part}", combination.name),
                overrides: overrides.collect(),
                ..combination.clone()
            }
        };
        all = all.iter().flat_map(|combination| values.iter().map(|value| with(combination, value))).collect();
    }
    for (i, combination) in all.iter().enumerate() {
        if all[..i].iter().any(|other| other.name == combination.name) {
            bail!("two runs of the sweep would have the folder {}; leave out or rename one", combination.name);
        }
    }
    Ok(all)
}

/// Parses `blur.samples=3,7` as the key and its values; commas inside brackets or quotes belong to a value.
fn parse_over(text: &str) -> Result<(&str, Vec<&str>)> {
    let Some((key, list)) = text.split_once('=') else {
        bail!("--over {text}: expected KEY=VALUE,..., found no `=`");
    };
    let (mut values, mut depth, mut quoted, mut begin) = (Vec::new(), 0_i32, false, 0);
    for (at, c) in list.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth -= 1,
            ',' if !quoted && depth == 0 => {
                values.push(list[begin..at].trim());
                begin = at + 1;
            }
            _ => {}
        }
    }
    values.push(list[begin..].trim());
    if values.iter().any(|value| value.is_empty()) {
        bail!("--over {text}: expected values between the commas, found nothing");
    }
    Ok((key.trim(), values))
}

/// The last component of a key, or the whole key if another one ends alike.
fn short_name<'a>(key: &'a str, keys: &[(&str, Vec<&str>)]) -> &'a str {
    let last = |key: &'a str| key.rsplit('.').next().unwrap_or(key);
    let alike = keys.iter().filter(|(other, _)| other.rsplit('.').next() == Some(last(key))).count();
    if alike > 1 { key } else { last(key) }
}

/// A value as part of a folder's name.
fn in_a_name(value: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || c == '.' || c == '-';
    let name: String = value.chars().map(|c| if plain(c) { c } else { ' ' }).collect();
    name.split_whitespace().collect::<Vec<_>>().join("_")
}

fn stem(file: &Path) -> String {
    file.file_stem().map_or_else(|| "config".into(), |stem| stem.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    fn names(args: &[&str]) -> Result<Vec<String>> {
        let line = ["gsburn", "sweep", "data", "--out", "x"].iter().chain(args);
        let Command::Sweep(args) = Cli::try_parse_from(line).expect("valid arguments").command else {
            unreachable!("the command is sweep")
        };
        Ok(combinations(&args)?.into_iter().map(|combination| combination.name).collect())
    }

    #[test]
    fn every_combination_has_a_name() {
        let two = names(&["--over", "blur.samples=3,7", "--over", "density.cap=5000, 10000"]).expect("valid");
        assert_eq!(two, ["samples-3_cap-5000", "samples-3_cap-10000", "samples-7_cap-5000", "samples-7_cap-10000"]);
        let files = names(&["--configs", "a/paper.toml,itg.toml", "--over", "seed=1,2"]).expect("valid");
        assert_eq!(files, ["paper_seed-1", "paper_seed-2", "itg_seed-1", "itg_seed-2"]);
        let alike = names(&["--over", "density.every=1", "--over", "checkpoint.every=2"]).expect("valid");
        assert_eq!(alike, ["density.every-1_checkpoint.every-2"]);
        let lists = names(&["--over", "data.background=[0,0,0],[1,1,1]"]).expect("valid");
        assert_eq!(lists, ["background-0_0_0", "background-1_1_1"]);
    }

    #[test]
    fn what_cannot_be_swept_is_said() {
        let message = |args: &[&str]| names(args).expect_err("invalid").to_string();
        assert!(message(&[]).contains("--over"));
        assert!(message(&["--over", "steps"]).contains("no `=`"));
        assert!(message(&["--over", "steps=1,,2"]).contains("found nothing"));
        assert!(message(&["--over", "steps=1,1"]).contains("steps-1"));
        assert!(message(&["--configs", "a/x.toml,b/x.toml"]).contains("folder x"));
    }
}

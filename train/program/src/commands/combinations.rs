//! The runs of a sweep: every combination of some values, or every single change.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::cli::SweepArgs;
use gs_pipelines::{Sources, resolve};

/// Folder of the run without any change.
const UNCHANGED: &str = "base";

/// One combination.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Combination {
    /// Name of its folder.
    pub name: String,
    /// Its configuration file.
    pub file: Option<PathBuf>,
    /// Its recipe.
    pub recipe: Option<String>,
    /// Its values, in the words of `--set`.
    pub overrides: Vec<String>,
}

/// Every combination of configuration files and values, the last key changing fastest; or every single change. `recipe`
/// is the data set's.
///
/// # Errors
/// One sentence: nothing to sweep over, a value that cannot be read, two runs of one name.
pub(super) fn combinations(args: &SweepArgs, recipe: Option<&str>) -> Result<Vec<Combination>> {
    let typed: Vec<(&str, Vec<&str>)> = args.over.iter().map(|text| parse_over(text)).collect::<Result<_>>()?;
    let keys = if typed.is_empty() { proposed(args, recipe)? } else { typed };
    if args.configs.is_empty() && args.recipes.is_empty() && keys.is_empty() {
        bail!("a sweep needs something to sweep over: --over KEY=VALUE,..., --configs FILE,... or --recipes NAME,...");
    }
    let begun = begun(args, recipe);
    let all: Vec<Combination> = match args.one_at_a_time {
        true => begun.iter().flat_map(|combination| around(combination, &keys)).collect(),
        false => keys.iter().fold(begun, |all, (key, values)| {
            let short = short_name(key, &keys);
            let each = |one: &Combination| values.iter().map(|value| one.with(key, short, value)).collect::<Vec<_>>();
            all.iter().flat_map(each).collect()
        }),
    };
    for (i, combination) in all.iter().enumerate() {
        if all[..i].iter().any(|other| other.name == combination.name) {
            bail!("two runs of the sweep would have the folder {}; leave out or rename one", combination.name);
        }
    }
    Ok(all)
}

/// The configurations that values are changed in.
fn begun(args: &SweepArgs, recipe: Option<&str>) -> Vec<Combination> {
    let begin = |file: Option<&PathBuf>, recipe: Option<&str>, name: String| Combination {
        name,
        file: file.cloned(),
        recipe: recipe.map(String::from),
        overrides: args.set.clone(),
    };
    match (args.configs.as_slice(), args.recipes.as_slice()) {
        ([], []) => vec![begin(args.config.as_ref(), recipe, String::new())],
        ([], recipes) => recipes.iter().map(|name| begin(None, Some(name), stem(Path::new(name)))).collect(),
        (files, _) => files.iter().map(|file| begin(Some(file), None, stem(file))).collect(),
    }
}

/// A combination itself, then with each value of each key alone.
fn around(combination: &Combination, keys: &[(&str, Vec<&str>)]) -> Vec<Combination> {
    let name = if combination.name.is_empty() { UNCHANGED.into() } else { combination.name.clone() };
    let changed = keys.iter().flat_map(|(key, values)| {
        let short = short_name(key, keys);
        values.iter().map(move |value| combination.with(key, short, value))
    });
    std::iter::once(Combination { name, ..combination.clone() }).chain(changed).collect()
}

impl Combination {
    /// The same with one more value.
    fn with(&self, key: &str, short: &str, value: &str) -> Self {
        let part = format!("{short}-{}", in_a_name(value));
        let separator = if self.name.is_empty() { "" } else { "_" };
        let overrides = self.overrides.iter().cloned().chain([format!("{key}={value}")]);
        Self { name: format!("{}{separator}{part}", self.name), overrides: overrides.collect(), ..self.clone() }
    }
}

/// The keys and values that the pipeline proposes where a model is to be chosen and nothing else is to be swept.
fn proposed(args: &SweepArgs, recipe: Option<&str>) -> Result<Vec<(&'static str, Vec<&'static str>)>> {
    if args.choose.is_none() || !args.configs.is_empty() || !args.recipes.is_empty() {
        return Ok(Vec::new());
    }
    let sources = Sources { file: args.config.as_deref(), recipe, overrides: args.set.as_slice() };
    let sizes = resolve(sources)?.pipeline.sizes();
    Ok(sizes.iter().map(|(key, values)| (*key, values.to_vec())).collect())
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
        let recipe = args.recipe.first().map(String::as_str);
        Ok(combinations(&args, recipe)?.into_iter().map(|combination| combination.name).collect())
    }

    #[test]
    fn every_combination_has_a_name() {
        let two = names(&["--over", "blur.samples=3,7", "--over", "density.cap=5000, 10000"]).expect("valid");
        assert_eq!(two, ["samples-3_cap-5000", "samples-3_cap-10000", "samples-7_cap-5000", "samples-7_cap-10000"]);
        let files = names(&["--configs", "a/paper.toml,itg.toml", "--over", "seed=1,2"]).expect("valid");
        assert_eq!(files, ["paper_seed-1", "paper_seed-2", "itg_seed-1", "itg_seed-2"]);
        let alike = names(&["--over", "density.every=1", "--over", "checkpoint.every=2"]).expect("valid");
        assert_eq!(alike, ["density.every-1_checkpoint.every-2"]);
        let around =
            names(&["--one-at-a-time", "--over", "blur.samples=3,7", "--over", "density.cap=5000"]).expect("valid");
        assert_eq!(around, ["base", "samples-3", "samples-7", "cap-5000"]);
        let recipes = names(&["--one-at-a-time", "--recipes", "a/paper,a/itg", "--over", "seed=2"]).expect("valid");
        assert_eq!(recipes, ["paper", "paper_seed-2", "itg", "itg_seed-2"]);
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

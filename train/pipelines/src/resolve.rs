//! Files, recipes and arguments merged into a pipeline and its whole configuration.

use std::path::Path;

use toml::{Table, Value};

use super::{PIPELINES, Pipeline, find, names};
use gs_train::config::nearest::{beside, nearest};
use gs_train::config::tables::{self, Layer};
use gs_train::config::{ConfigError, DEFAULT_PIPELINE, present_name, with_moved, without_retired};

/// A pipeline and its whole configuration.
#[derive(Clone)]
pub struct Resolved {
    /// The pipeline.
    pub pipeline: &'static dyn Pipeline,
    /// Every key of the pipeline, with its value.
    pub config: Table,
    /// The same as the TOML text that a run saves.
    pub text: String,
}

/// The sources of a configuration.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sources<'a> {
    /// A file, which may name a base.
    pub file: Option<&'a Path>,
    /// A compiled-in recipe by name.
    pub recipe: Option<&'a str>,
    /// Single values, `section.key=value`, which take precedence.
    pub overrides: &'a [String],
}

/// The configuration of some sources: the defaults of their pipeline, then the file or recipe (and its bases), then the
/// overrides.
///
/// # Errors
/// A sentence naming the file or argument, the key, what was expected and what was found.
pub fn resolve(sources: Sources) -> Result<Resolved, ConfigError> {
    let mut layers = Vec::new();
    if let Some(name) = sources.recipe {
        layers.extend(recipe(name)?);
    }
    if let Some(path) = sources.file {
        layers.extend(tables::file_layers(path).map_err(with_recipe)?);
    }
    let main = layers.last().map_or_else(|| "arguments".to_string(), |layer| layer.origin.clone());
    for text in sources.overrides {
        layers.push(tables::override_layer(text)?);
    }
    stack(&layers, &main)
}

/// The configuration of overrides alone.
///
/// # Errors
/// As [`resolve`].
pub fn resolve_overrides(overrides: &[String]) -> Result<Resolved, ConfigError> {
    resolve(Sources { overrides, ..Sources::default() })
}

/// A configuration that a run saved.
///
/// # Errors
/// As [`resolve`]; `origin` names the place.
pub fn resolve_saved(config: &Table, origin: &str) -> Result<Resolved, ConfigError> {
    resolve_changed(config, origin, &[])
}

/// A configuration that a run saved, with some values changed.
///
/// # Errors
/// As [`resolve`].
pub fn resolve_changed(config: &Table, origin: &str, overrides: &[String]) -> Result<Resolved, ConfigError> {
    let mut layers = vec![Layer { origin: origin.into(), table: with_moved(config.clone()) }];
    for text in overrides {
        layers.push(tables::override_layer(text)?);
    }
    stack(&layers, origin)
}

fn stack(layers: &[Layer], main: &str) -> Result<Resolved, ConfigError> {
    let pipeline = pipeline_of(layers)?;
    let defaults = pipeline.defaults();
    let mut config = defaults.clone();
    // The strategy that each layer is written for, as far as it and those before it say.
    let mut strategies = Vec::new();
    for Layer { origin, table } in layers {
        let table = without_retired(table.clone(), origin)?;
        check_keys(&table, origin, pipeline, &defaults)?;
        // The layer is also tried on its own, so that a type error names the layer that has it.
        let mut alone = defaults.clone();
        tables::merge(&mut alone, table.clone());
        if let Err(error @ ConfigError::Type { .. }) = pipeline.validate(&alone, origin) {
            return Err(error);
        }
        tables::merge(&mut config, table);
        strategies.push(strategy(&config));
    }
    for (layer, then) in layers.iter().zip(&strategies) {
        check_strategy(layer, [then.as_str(), &strategy(&config)])?;
    }
    let text = pipeline.validate(&config, main)?;
    let config = tables::parse(&text, main)?;
    Ok(Resolved { pipeline, config, text })
}

/// The density strategy of a configuration, empty in a pipeline without density control.
fn strategy(config: &Table) -> String {
    let named = config.get("density").and_then(|density| density.get("strategy")?.as_str());
    named.unwrap_or_default().to_string()
}

/// Checks that a layer sets keys of no density strategy but the ones it may mean. A saved configuration has the keys of
/// all strategies.
fn check_strategy(layer: &Layer, meant: [&str; 2]) -> Result<(), ConfigError> {
    let Some(density) = layer.table.get("density").and_then(Value::as_table) else { return Ok(()) };
    let of_strategies: Vec<(&String, &Table)> =
        density.iter().filter_map(|(name, keys)| Some((name, keys.as_table()?))).collect();
    let [(owner, keys)] = of_strategies.as_slice() else { return Ok(()) };
    match keys.keys().next() {
        Some(key) if !meant.contains(&owner.as_str()) => Err(ConfigError::OtherStrategy {
            origin: layer.origin.clone(),
            key: format!("density.{owner}.{key}"),
            owner: owner.to_string(),
            strategy: meant[1].into(),
        }),
        _ => Ok(()),
    }
}

/// The pipeline named by the last layer that names one.
fn pipeline_of(layers: &[Layer]) -> Result<&'static dyn Pipeline, ConfigError> {
    let named = layers.iter().rev().find_map(|layer| Some((layer, layer.table.get("pipeline")?)));
    let (origin, name) = match named {
        None => ("defaults", DEFAULT_PIPELINE.to_string()),
        Some((layer, Value::String(name))) => (layer.origin.as_str(), name.clone()),
        Some((layer, other)) => (layer.origin.as_str(), other.to_string()),
    };
    find(&name).ok_or_else(|| ConfigError::Pipeline { origin: origin.into(), found: name, valid: names() })
}

/// Checks that every key of a layer is one of the pipeline's.
fn check_keys(table: &Table, origin: &str, pipeline: &dyn Pipeline, defaults: &Table) -> Result<(), ConfigError> {
    let valid = tables::keys(defaults);
    let Some(key) = tables::keys(table).into_iter().find(|key| !valid.contains(key)) else { return Ok(()) };
    let origin = origin.to_string();
    let has_key = |other: &&&dyn Pipeline| tables::keys(&other.defaults()).contains(&key);
    if let Some(owner) = PIPELINES.iter().find(has_key) {
        let (owner, pipeline) = (owner.name().into(), pipeline.name().into());
        return Err(ConfigError::OtherPipeline { origin, key, owner, pipeline });
    }
    let hint = match (nearest(&key, &valid), beside(&key, &valid).as_slice()) {
        _ if present_name(&key).is_some() => format!("it is `{}` now", present_name(&key).unwrap_or_default()),
        (Some(nearest), _) => format!("the nearest valid key is `{nearest}`"),
        (None, []) => "no valid key is like it; config.toml of any run has all".to_string(),
        (None, names) => format!("the keys of its section are {}", names.join(", ")),
    };
    Err(ConfigError::UnknownKey { origin, key, hint })
}

/// A file that is not there, or the base of a file, may be meant for the recipe of its name:
/// `configs/taylormode/base.toml` outside of the repository.
fn with_recipe(error: ConfigError) -> ConfigError {
    match error {
        ConfigError::Read { path, source, .. } if !path.exists() => {
            let named = path.with_extension("").to_string_lossy().replace('\\', "/");
            let is_meant = |recipe: &&gs_recipes::Recipe| {
                let name = recipe.name;
                named == name || named.strip_suffix(name).is_some_and(|before| before.ends_with('/'))
            };
            let recipe = gs_recipes::RECIPES.iter().find(is_meant).map(|recipe| recipe.name.to_string());
            ConfigError::Read { path, source, recipe }
        }
        error => error,
    }
}

fn recipe(name: &str) -> Result<Vec<Layer>, ConfigError> {
    let name = name.strip_suffix(".toml").unwrap_or(name);
    let layers = tables::recipe_layers(name, |name| gs_recipes::find(name).map(|recipe| recipe.text))?;
    layers.ok_or_else(|| {
        let all: Vec<String> = gs_recipes::RECIPES.iter().map(|recipe| recipe.name.to_string()).collect();
        ConfigError::Recipe { found: name.into(), nearest: nearest(name, &all).map(String::from) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(overrides: &[&str]) -> Result<Resolved, ConfigError> {
        resolve_overrides(&overrides.iter().map(|s| s.to_string()).collect::<Vec<_>>())
    }

    fn message(text: &str) -> String {
        of(&[text]).map(|_| ()).expect_err("invalid").to_string()
    }

    #[test]
    fn a_missing_file_names_the_recipe_of_its_name() {
        let refuse = |path: &str| {
            let missing = resolve(Sources { file: Some(Path::new(path)), ..Sources::default() });
            missing.map(|_| ()).expect_err("not there").to_string()
        };
        let message = refuse("configs/taylormode/paper.toml");
        assert!(message.contains("--recipe taylormode/paper"), "{message}");
        assert!(!refuse("nowhere/other.toml").contains("--recipe taylormode"));
        // So does the base of a file.
        let folder = tempfile::tempdir().expect("a folder");
        let mine = folder.path().join("mine.toml");
        std::fs::write(&mine, "base = \"configs/taylormode/base.toml\"\n").expect("written");
        let message = refuse(mine.to_str().expect("UTF-8"));
        assert!(message.contains("--recipe taylormode/base"), "{message}");
    }

    #[test]
    fn overrides_change_one_value() {
        let config = of(&["density.cap=123", "density.strategy=default", "loss.dssim = 0", "data.background=[1,1,1]"]);
        let config = config.expect("valid").config;
        assert_eq!(config["density"]["cap"].as_integer(), Some(123));
        assert_eq!(config["loss"]["dssim"].as_float(), Some(0.0));
        assert_eq!(config["steps"], find("static").expect("a pipeline").defaults()["steps"]);
    }

    #[test]
    fn unknown_keys_name_the_nearest() {
        assert!(message("density.capp=1").contains("`density.cap`"), "{}", message("density.capp=1"));
        assert!(message("cap=1").contains("`density.cap`"), "{}", message("cap=1"));
        assert!(message("model.sh_degre=1").contains("`model.sh_degree`"));
        assert!(message("stepz=1").contains("`steps`"));
        assert!(message("optimizer.lr=1").contains("`optimiser.means_lr`"), "{}", message("optimizer.lr=1"));
        assert!(
            message("density.foo=1").contains("the keys of its section are cap, default, "),
            "{}",
            message("density.foo=1")
        );
        assert!(message("foo=1").contains("no valid key is like it"), "{}", message("foo=1"));
    }

    #[test]
    fn keys_and_names_of_other_pipelines_are_told() {
        let other = message("blur.samples=3");
        assert!(other.contains("pipeline taylormode") && other.contains("pipeline is static"), "{other}");
        assert!(message("pipeline=taylor").contains(&names()));
    }

    #[test]
    fn wrong_types_and_ranges_are_sentences() {
        assert!(message("steps=many").contains("steps"), "{}", message("steps=many"));
        assert!(message("loss.dssim=1.5").contains("from 0 to 1, found 1.5"));
        assert!(message("steps=0").contains("at least 1"));
        assert!(message("steps").contains("no `=`"));
        assert!(message("render.near=nan").contains("positive"));
        assert!(message("render.near=1e308").ends_with("found 1e308"), "{}", message("render.near=1e308"));
        assert!(!message("density.strategy=magic").contains('\n'));
    }

    #[test]
    fn a_saved_configuration_reads_back_the_same() {
        let config = of(&["seed=7", "eval.at=[1,2]", "data.holdout=names", "data.holdout_names=['a']"]).expect("valid");
        let again = resolve_saved(&tables::parse(&config.text, "text").expect("TOML"), "text").expect("valid");
        assert_eq!(again.text, config.text);
        assert!(!config.text.contains("[blur]"), "keys of another pipeline:\n{}", config.text);
    }

    #[test]
    fn former_keys_open_with_the_value_that_they_had() {
        assert_eq!(of(&["optimiser.beta1=0.9"]).expect("the constant").text, of(&[]).expect("valid").text);
        assert!(message("optimiser.beta1=0.8").contains("`optimiser.beta1` is no key any more"));
    }

    #[test]
    fn keys_of_a_strategy_that_is_not_chosen_are_refused() {
        let said = message("density.default.gradient=1e-5");
        assert!(said.ends_with("is a key of the strategy default; `density.strategy` is mcmc"), "{said}");
        of(&["density.default.gradient=1e-5", "density.strategy=default"]).expect("chosen afterwards");
        let changed =
            of(&["density.mcmc.growth=0.1", "density.strategy=default"]).expect("another one chosen afterwards");
        // A saved configuration has the keys of both.
        resolve_saved(&changed.config, "saved").expect("valid");
        assert!(message("density.growth=0.1").ends_with("it is `density.mcmc.growth` now"));
    }

    #[test]
    fn files_stack_on_their_base() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write("base.toml", "steps = 10\n[density]\ncap = 20\n");
        write("scene.toml", "base = \"base.toml\"\n[density]\nevery = 30\n");
        write("circle.toml", "base = \"circle.toml\"\n");
        let resolve_file = |name: &str| {
            let path = folder.path().join(name);
            resolve(Sources { file: Some(&path), ..Sources::default() }).map(|resolved| resolved.config)
        };
        let config = resolve_file("scene.toml").expect("valid");
        assert_eq!(config["steps"].as_integer(), Some(10));
        assert_eq!(
            (config["density"]["cap"].as_integer(), config["density"]["every"].as_integer()),
            (Some(20), Some(30))
        );
        assert!(resolve_file("circle.toml").expect_err("circle").to_string().contains("circle"));
        assert!(resolve_file("none.toml").expect_err("missing").to_string().contains("none.toml"));
    }

    #[test]
    fn recipes_are_found_by_name() {
        let resolve_recipe = |name: &str| resolve(Sources { recipe: Some(name), ..Sources::default() });
        let alone = of(&["pipeline=taylormode"]).expect("valid");
        assert_eq!(
            resolve_recipe("taylormode/base").expect("a recipe").text,
            alone.text,
            "the pipeline alone is its base recipe"
        );
        assert!(
            resolve_recipe("taylormode/papr").map(|_| ()).expect_err("none").to_string().contains("taylormode/paper")
        );
    }
}

//! Keys of earlier versions: some became constants, some moved into a section of their own. A saved configuration that
//! has them still opens.

use toml::{Table, Value};

use super::error::ConfigError;
use super::tables::merge;

/// Former keys by section, each with the only value that it had in practice.
const RETIRED: [(&str, &str, f64); 21] = [
    ("optimiser", "sh_rest_lr", 1.25e-4),
    ("optimiser", "beta1", 0.9),
    ("optimiser", "beta2", 0.999),
    ("optimiser", "eps", 1e-15),
    ("density", "split_size", 0.01),
    ("density", "prune_size", 0.1),
    ("density", "decay", 0.004),
    ("motion", "remainder_lr", 1e-4),
    ("motion", "select_from", 0.5),
    ("motion", "select_color", 1.0 / 255.0),
    ("motion", "shrink_color", 1.0 / 255.0),
    ("moving", "change", 0.06),
    ("moving", "cameras", 0.5),
    ("bodies", "tolerance_share", 0.08),
    ("bodies", "most", 12.0),
    ("bodies", "share", 0.02),
    ("bodies", "lr_final", 2e-5),
    ("curriculum", "outline", 0.0),
    ("lift", "scale_max", 1.0),
    ("supervision", "dssim", 0.2),
    ("actors", "speed", 0.5),
];

/// Former keys of `[density]`, each with the section that has it now.
const MOVED: [(&str, &str); 8] = [
    ("growth", "mcmc"),
    ("full", "mcmc"),
    ("noise", "mcmc"),
    ("separation", "mcmc"),
    ("gradient", "default"),
    ("absgrad", "default"),
    ("opacity_policy", "default"),
    ("reset_every", "default"),
];

/// The present name of a key that moved.
pub fn present_name(key: &str) -> Option<String> {
    let name = key.strip_prefix("density.")?;
    MOVED.iter().find(|(former, _)| *former == name).map(|(_, section)| format!("density.{section}.{name}"))
}

/// A saved table with moved keys in their present places.
pub fn with_moved(mut table: Table) -> Table {
    let Some(Value::Table(density)) = table.get_mut("density") else { return table };
    for (name, section) in MOVED {
        if let Some(value) = density.remove(name) {
            let keys = Table::from_iter([(name.to_string(), value)]);
            merge(density, Table::from_iter([(section.to_string(), Value::Table(keys))]));
        }
    }
    table
}

/// The table without former keys; `origin` names it in errors.
///
/// # Errors
/// A former key with another value than its constant.
pub fn without_retired(mut table: Table, origin: &str) -> Result<Table, ConfigError> {
    for (section, name, value) in RETIRED {
        let Some(Value::Table(keys)) = table.get_mut(section) else { continue };
        let Some(found) = keys.remove(name) else { continue };
        let number = found.as_float().or_else(|| found.as_integer().map(|whole| whole as f64));
        if number != Some(value) {
            let (origin, key, found) = (origin.into(), format!("{section}.{name}"), found.to_string());
            return Err(ConfigError::Retired { origin, key, value, found });
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_moved_are_found_in_their_places() {
        let saved = "[density]\ncap = 5\ngrowth = 0.1\ngradient = 1\n[density.mcmc]\nfull = 0.5\n";
        let now = "[density]\ncap = 5\n[density.mcmc]\nfull = 0.5\ngrowth = 0.1\n[density.default]\ngradient = 1\n";
        assert_eq!(with_moved(saved.parse().expect("TOML")), now.parse().expect("TOML"));
        assert_eq!(present_name("density.growth").as_deref(), Some("density.mcmc.growth"));
        assert_eq!((present_name("density.cap"), present_name("curriculum.growth")), (None, None));
    }

    #[test]
    fn former_keys_are_left_out_or_refused() {
        let read = |text: &str| without_retired(text.parse().expect("TOML"), "old.toml");
        let kept = read("[optimiser]\nbeta1 = 0.9\nsh_lr = 1\n[bodies]\nmost = 12\n").expect("the constants");
        assert_eq!(kept, "[optimiser]\nsh_lr = 1\n[bodies]\n".parse().expect("TOML"));
        let said = read("[optimiser]\nbeta1 = 0.8\n").expect_err("another value").to_string();
        assert_eq!(said, "old.toml: `optimiser.beta1` is no key any more, its value is 0.9 throughout; found 0.8");
    }
}

//! Keys that became constants. A saved configuration that has one still opens where the value is the constant.

use toml::{Table, Value};

use super::error::ConfigError;

/// Former keys by section, each with the only value that it had in practice.
const RETIRED: [(&str, &str, f64); 20] = [
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
    ("lift", "scale_max", 1.0),
    ("supervision", "dssim", 0.2),
    ("actors", "speed", 0.5),
];

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
    fn former_keys_are_left_out_or_refused() {
        let read = |text: &str| without_retired(text.parse().expect("TOML"), "old.toml");
        let kept = read("[optimiser]\nbeta1 = 0.9\nsh_lr = 1\n[bodies]\nmost = 12\n").expect("the constants");
        assert_eq!(kept, "[optimiser]\nsh_lr = 1\n[bodies]\n".parse().expect("TOML"));
        let said = read("[optimiser]\nbeta1 = 0.8\n").expect_err("another value").to_string();
        assert_eq!(said, "old.toml: `optimiser.beta1` is no key any more, its value is 0.9 throughout; found 0.8");
    }
}
